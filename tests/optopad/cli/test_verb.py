"""Commands made of verbs: what is typed reaches the function, and its result is shown."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from optopad.cli.verb import command_of, typed, verb
from optopad.screen.output import Told
from tests.docs.command_text import verbs

CALLS: list[dict[str, Any]] = []


@verb(depth_mm=typed("MM", flag="--depth", min=0.0), quick=typed(default=False), inner=None)
def press(
    files: Sequence[Path],
    inner: int = 7,
    *,
    depth_mm: float | None = None,
    quick: bool = True,
    label: Sequence[str] = (),
    seed: int = 0,
) -> Told:
    """Press the pad.

    Not a part of the help.

    Parameters
    ----------
    files : Recordings, one for
        each pad.
    depth_mm : Depth.
    label : A label. Repeatable.
    """
    CALLS.append({"files": files, "inner": inner, "depth": depth_mm, "quick": quick, "label": label})
    return Told({"pads": len(files), "seed": seed}, ["pressed", "released"], exit_code=3 if quick else 0)


def typed_in(*words: str) -> Any:
    app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command()(command_of(press))
    CALLS.clear()
    return CliRunner().invoke(app, [*words])


def test_what_is_typed_reaches_the_verb_and_the_rest_has_its_defaults():
    assert typed_in("a.nc", "b.nc", "--depth", "2").output == "pressed\nreleased\n"
    files = [Path("a.nc"), Path("b.nc")]
    assert [{"files": files, "inner": 7, "depth": 2.0, "quick": False, "label": ()}] == CALLS
    typed_in("a.nc", "--label", "x", "--label", "y")
    assert CALLS[0]["label"] == ["x", "y"]


def test_json_is_the_document_and_the_exit_code_is_that_of_the_result():
    found = typed_in("a.nc", "--quick", "--seed", "5", "--json")
    assert json.loads(found.output) == {"pads": 1, "seed": 5}
    assert (found.exit_code, typed_in("a.nc").exit_code) == (3, 0)


@pytest.mark.parametrize("words", [["a.nc", "--depth", "-1"], ["a.nc", "--seed", "-1"], ["--quick"]])
def test_limits_and_missing_arguments_are_refused_before_the_verb_is_called(words):
    assert typed_in(*words).exit_code == 2
    assert CALLS == []


def test_the_help_is_the_docstring_s_first_paragraph_and_its_parameters():
    said = " ".join(typed_in("--help").output.split())
    assert "Press the pad." in said
    assert "Not a part of the help" not in said
    assert "Recordings, one for each pad." in said
    assert "--depth MM" in said
    assert "Seed of every random stream." in said
    assert "inner" not in said.lower()


def test_every_word_of_every_command_has_a_help():
    silent = [
        f"{name} {word.name}"
        for name, command in verbs()
        for word in command.params
        if word.name != "help" and not word.help
    ]
    assert silent == []
