"""Trials of designs: read, check, and now and then through the command line."""

from __future__ import annotations

from pathlib import Path
from random import Random

from optopad.design.io import load_design
from optopad.design.rules.check import check
from tests.fuzz.bad_texts import bad_design
from tests.fuzz.trial import Outcome, command, tried

COMMAND_EVERY = 20
"""Of so many designs one goes through the command line."""


def design_trial(seed: int, number: int, folder: Path) -> Outcome:
    """The outcome of one design, the same for a seed and number."""
    file = folder / "design.toml"
    file.write_bytes(bad_design(Random(f"design {seed} {number}")))

    def answer() -> list[str]:
        return [str(finding) for finding in check(load_design(file))]

    def answered_by_command() -> list[str]:
        return command(["check", str(file)], refused=False)

    asked = answered_by_command if number % COMMAND_EVERY == 0 else answer
    return tried(f"design {number}", asked)
