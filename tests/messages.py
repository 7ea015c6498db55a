"""What optopad says of bad input, and its screens: `python -m tests.messages` writes tests/messages.txt anew.

The cases are those of other tests, which hold the field, the value and the limit. Whole sentences are held here alone:
after a change of words, write the file anew and read the difference.
"""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

from optopad.cli.main import main
from optopad.design.errors import DesignError
from optopad.design.io import load_design
from optopad.design.preset import PRESETS, preset
from optopad.design.rules.check import notes, require_valid
from optopad.screen.answer import checks_line
from optopad.screen.verdict import answer_of
from optopad.screen.verdict_sentences import cause_sentence
from tests.design import test_held_object
from tests.design.bad_designs import BAD_DESIGNS, FILE_NAME, design_text, put
from tests.design.parts import test_catalog
from tests.design.rules import test_shape_rules
from tests.optopad.cli import test_cli_bad_input, test_cli_explore, test_cli_parts, test_cli_rays, test_studio
from tests.optopad.screen.test_one_screen import LACKS, SCORES, cause
from tests.optopad.verbs import test_improve
from tests.sims import test_held_data

FILE = Path(__file__).with_name("messages.txt")


def messages() -> Iterator[tuple[str, str]]:
    """A heading and what is said; one after another, always in the same order."""
    yield from _designs()
    for what, (base, changes, _) in test_shape_rules.BAD.items():
        yield f"shape: {what}", test_shape_rules.refusal(base, changes)
    for field, value, _ in test_catalog.REFUSED:
        yield f"part: {field} = {value!r}", test_catalog.refused(test_catalog.part_with(**{field: value}))
    for text, _ in test_held_object.REFUSED:
        if "file=" not in text:  # such a file is made for the test
            yield f"object: {text}", test_held_object.refusal(text)
    for text, _ in test_held_data.REFUSED:
        yield f"list: {text}", test_held_data.refusal(text)
    for arguments in _commands():
        yield f"optopad {' '.join(arguments)}", _said(arguments)
    for old, new, _ in test_cli_explore.REFUSED:
        text = test_cli_explore.SPACE.replace(old, new, 1)
        yield f"space: {old} -> {new}", _said(["explore", "space.toml"], {"space.toml": text})
    for name in PRESETS:
        yield f"notes: {name}", "\n".join(map(str, notes(preset(name))))
    yield from _screens()


def _designs() -> Iterator[tuple[str, str]]:
    for bad in BAD_DESIGNS:
        with tempfile.TemporaryDirectory() as folder, chdir(folder):
            try:
                require_valid(load_design(put(bad, Path())))
            except DesignError as err:
                yield f"design: {bad.id}", str(err).replace(f"{Path.cwd()}{os.sep}", "")


def _commands() -> Iterator[list[str]]:
    for change, _ in test_cli_bad_input.CHANGES:
        yield ["check", FILE_NAME, "--set", change]
    for arguments, _ in (*test_cli_bad_input.SLIPS, *test_cli_bad_input.OVERWRITES):
        yield arguments
    for changes, _ in test_cli_parts.BAD:
        yield test_cli_parts.typed("my-led", test_cli_parts.LED | changes)
    for arguments, _ in test_cli_rays.REFUSED:
        yield ["rays", test_cli_rays.PAIR, *arguments]
    for arguments, _ in test_studio.REFUSED:
        yield ["studio", test_cli_rays.PAIR, "--no-open", *arguments]
    for arguments, _ in test_improve.REFUSED:
        yield ["improve", test_cli_rays.PAIR, *arguments]


def _said(arguments: list[str], files: dict[str, str] | None = None) -> str:
    """Exit code and both streams of a command, in a folder that holds a good design by three names."""
    held = dict.fromkeys((FILE_NAME, "pad.toml", "pad.nc"), design_text()) | (files or {})
    out = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, chdir(folder), redirect_stdout(out), redirect_stderr(out):
        for name, text in held.items():
            Path(name).write_text(text, encoding="utf-8")
        code = main(arguments)
    return f"{out.getvalue().rstrip()}\nexit {code}"


def _screens() -> Iterator[tuple[str, str]]:
    for lack in LACKS:
        yield f"cause: {lack}", cause_sentence(cause(lack))
    for design, score in SCORES:
        shown = replace(score, causes=(cause("apart"),)) if score.deadbands_mm else score
        for is_open in (False, True):
            lines = answer_of(design, replace(shown, is_open=is_open), "").lines([], command="pad.toml")
            yield f"screen: {design.name}, {score.verdict}{', undecided' * is_open}", "\n".join(lines)
    warned = [{"name": "mold: print bed", "state": "warning"}]
    broken = [*warned, {"name": "mold: volume", "state": "error"}]
    for is_ok, findings in ((True, []), (True, warned), (False, broken)):
        yield "mold on the screen", checks_line({"ok": is_ok, "findings": findings})


def text_of_all() -> str:
    """The whole file."""
    os.environ["COLUMNS"] = "100"
    return "".join(f"== {' '.join(head.split())[:100]}\n{said.rstrip()}\n\n" for head, said in messages())


if __name__ == "__main__":
    FILE.write_text(text_of_all(), encoding="utf-8")
    print(f"written: {FILE.name}")
