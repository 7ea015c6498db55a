"""Every command in the docs runs as written, in order, in an empty folder."""

import os
import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.exceptions import TyperException

from optopad.cli import main
from optopad.cli.commands import whole_command
from optopad.sims.learning.inference.model_file import save_model
from tests.docs.docs_board import started_board
from tests.fabrication.driver.made_up_model import header, made_up_model
from tests.fabrication.simulated_board import missing_compiler
from tests.sims.learning.test_two_touches import model as two_touch_model

REPOSITORY = Path(__file__).parents[2]
DOCS = REPOSITORY / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), REPOSITORY / "README.md"])
RUN_WHOLE = {"README.md"}
"""Pages that count as tests of their verbs; the commands of every page run before a release."""
QUICK_VERBS = {"new", "check", "schema", "driver firmware", "part new", "parts"}
RUN_ELSEWHERE = {
    "driver ros2": "fabrication/ros2/test_workspace.py",
    "calibrate": "optopad/verbs/test_calibrate.py",
    "compare": "optopad/verbs/test_compare.py",
    "contact show": "optopad/verbs/test_contact_show.py",
    "doctor": "optopad/test_doctor.py",
    "driver check": "optopad/cli/test_cli_driver.py",
    "driver collect": "optopad/cli/test_cli_collect.py",
    "driver config": "optopad/cli/test_cli_firmware.py",
    "driver export": "optopad/cli/test_cli_driver.py",
    "driver fake": "optopad/cli/test_cli_driver.py",
    "driver firmware": "optopad/cli/test_cli_firmware.py",
    "driver flash": "optopad/cli/test_cli_firmware.py",
    "driver read": "optopad/cli/test_cli_driver.py",
    "driver record": "optopad/cli/test_cli_driver.py",
    "evaluate": "optopad/cli/test_cli_train.py",
    "explore": "optopad/cli/test_cli_explore.py",
    "improve": "optopad/verbs/test_improve.py",
    "part new": "optopad/cli/test_cli_parts.py",
    "parts": "optopad/cli/test_cli_parts.py",
    "press": "optopad/cli/test_cli_press.py",
    "rays": "optopad/cli/test_cli_rays.py",
    "report": "optopad/verbs/test_run.py",
    "scene": "optopad/verbs/test_scene.py",
    "schema": "optopad/cli/test_cli_verbs.py",
    "score": "optopad/verbs/test_score_builds.py",
    "simulate": "optopad/cli/test_cli_protocol.py",
    "studio": "optopad/cli/test_studio.py",
    "train": "optopad/cli/test_cli_train.py",
}
"""Where the verbs run that are on none of these pages."""
NEEDS_COMPILER = {"driver flash"}
"""Uploads what avr-gcc made."""


def commands_of(page: Path) -> list[list[str]]:
    blocks = re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    lines = [line.strip() for block in blocks for line in block.splitlines()]
    return [line.split()[2:] for line in lines if line.startswith("$ optopad ")]


def name_of(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()


PAGES_WITH_COMMANDS = [page for page in PAGES if commands_of(page)]


def verb_of(command: list[str]) -> str:
    return " ".join(command[:2]) if command[0] in ("driver", "part") else command[0]


def can_run(command: list[str]) -> bool:
    return verb_of(command) not in NEEDS_COMPILER or not missing_compiler()


def toml_blocks_of(page: Path) -> list[str]:
    return re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.fixture
def in_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def few_presses(design_file: Path, recording: Path) -> None:
    """A recording of nine presses of a simulated build, its emitters a little high."""
    from dataclasses import replace

    from optopad.design.io import load_design
    from optopad.design.press_protocol import protocol_from
    from optopad.sims.readings.dataset import save_data
    from optopad.sims.readings.protocol import draw, protocol_curves

    design = load_design(design_file)
    approach = [
        {"from_mm": -1.0, "to_mm": 0.0, "step_mm": 0.5},
        {"from_mm": 0.5, "to_mm": 2.0, "step_mm": 0.75},
    ]
    bench = {"name": "bench", "role": "train", "is_ambient": False, "grid_mm": 10.0}
    protocol = protocol_from(
        {"name": "nine", "approach": approach, "retract": "none", "curves": "coarse", "sets": [bench]},
        where="nine",
    )
    data = draw(protocol_curves(design.with_(**{"emitters.height_mm": 5.1}), protocol), seed=0)
    save_data(replace(data, design_digest=design.digest), recording)


def prepare(page: Path, *, with_data: bool = False) -> None:
    """What a page says in prose: files that the reader has saved by then.

    Parameters
    ----------
    with_data : what no quick command reads, too: presses, recordings and models
    """
    if page.name == "search-layouts.md":
        Path("my-search.toml").write_text(toml_blocks_of(page)[0], encoding="utf-8")
    if page.name in ("simulate-data-set.md", "predict-accuracy.md"):
        Path("my-protocol.toml").write_text(toml_blocks_of(page)[0], encoding="utf-8")
    if page.name == "build.md":
        heading = "part_number,unit_cost,currency,cost_date"
        Path("my-prices.csv").write_text(f"{heading}\nA000067,40,EUR,2026-11\n", encoding="utf-8")
    if page.name == "calibrate.md":
        (exact,) = toml_blocks_of(page)
        assert main(["new", "my-pad.toml"]) == 0
        text = Path("my-pad.toml").read_text(encoding="utf-8")
        Path("my-pad.toml").write_text(f"{text}\n{exact}", encoding="utf-8")
        if with_data:
            few_presses(Path("my-pad.toml"), Path("presses.nc"))
    if page.name in ("train-learner.md", "two-touches.md") and with_data:
        from optopad.sims.readings.dataset import save_data
        from tests.sims.learning.pressed_pad import grid_mm, made_up_data

        save_data(made_up_data(grid_mm(6), sets=2), Path("presses.nc"))
    if page.name == "compare-with-recording.md":
        heading, *rows = [
            "depth_mm,E2-R2",
            *(f"{depth / 10:.1f},{800 - 3 * max(depth, 0)}" for depth in range(-5, 51)),
        ]
        Path("press.csv").write_text("\n".join([heading, *rows]), encoding="utf-8")
    if page.name in ("read-sensor.md", "collect-presses.md") and with_data:
        presses = [f"{place},{depth}" for place in ("14,14", "20,18") for depth in (-1, 1, -1)]
        Path("presses.csv").write_text("\n".join(["x_mm,y_mm,depth_mm", *presses]), encoding="utf-8")
        save_model("pad.optomodel", replace(made_up_model(), header=header(design_digest=None)))
        two = two_touch_model()
        save_model("two.optomodel", replace(two, header=replace(two.header, design_digest=None)))
    if page.name == "objects.md":
        rows = re.findall(r"```text\n(x_mm.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        Path("presses.csv").write_text(rows[0], encoding="utf-8")
    if page.name == "own-parts.md":
        part, use, _, price, gel, shine, epoxy, walls, _, converter, *_ = toml_blocks_of(page)
        Path("my-parts.toml").write_text("\n".join([part, price, shine, gel, converter]), encoding="utf-8")
        assert main(["new", "my-pad.toml"]) == 0
        text = Path("my-pad.toml").read_text(encoding="utf-8")
        top, emitters = use.split("\n\n")
        text = text.replace('name = "my-pad"', f'name = "my-pad"\n{top}')
        text = re.sub(r"\[emitters\]\npart = .*\nheight_mm = \S+", emitters.strip(), text)
        text = text.replace('material = "sylgard-184"', 'material = "my-gel"')
        text = text.replace("mixing_ratio = 20.0", "mixing_ratio = 1.0")
        text = re.sub(r"\[surfaces\].*\n", walls, text) + "\n" + epoxy
        Path("my-pad.toml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS, ids=name_of)
def test_quick_commands_of_every_page_succeed(page, in_empty_folder):
    prepare(page)
    for command in commands_of(page):
        if verb_of(command) in QUICK_VERBS:
            assert main(command) == 0, " ".join(command)


@cache
def verbs() -> dict[str, Any]:
    """The parser of every verb, by its words."""

    def below(node: Any, words: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
        if not hasattr(node, "commands"):
            yield " ".join(words), node
        for name, inner in getattr(node, "commands", {}).items():
            yield from below(inner, (*words, name))

    return dict(below(whole_command(), ()))


def words_of(command: list[str]) -> str:
    """The verb of a command, of one word or two; empty where there is no such verb."""
    return next((words for words in (" ".join(command[:n]) for n in (1, 2)) if words in verbs()), "")


def fault_of(command: list[str]) -> str:
    """Why a command cannot be read; empty where it can."""
    words = words_of(command)
    if not words:
        return "no such verb"
    verb = verbs()[words]
    context = verb.context_class(verb, info_name=words)
    try:
        given, left, _ = verb.make_parser(context).parse_args(args=command[len(words.split()) :])
    except TyperException as err:
        return str(err)
    missing = [one.name for one in verb.params if one.required and not given.get(one.name)]
    return " ".join([*(f"too much: {one}" for one in left), *(f"needs {one}" for one in missing)])


def test_every_command_of_every_page_has_a_verb_with_its_options():
    faults = {
        f"{name_of(page)}: {' '.join(command)}": fault
        for page in PAGES_WITH_COMMANDS
        for command in commands_of(page)
        if (fault := fault_of(command))
    }
    assert faults == {}


def test_every_verb_runs_on_a_page_that_runs_whole_or_in_a_test_of_its_own():
    on_pages = {
        words_of(command) for page in PAGES if name_of(page) in RUN_WHOLE for command in commands_of(page)
    }
    alone = set(verbs()) - on_pages
    assert alone == set(RUN_ELSEWHERE)
    for words, place in RUN_ELSEWHERE.items():
        text = (REPOSITORY / "tests" / place).read_text(encoding="utf-8")
        assert re.search(r",\s*".join(f'"{word}"' for word in words.split()), text), (
            f"{words}: not in {place}"
        )


@pytest.mark.full
@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS, ids=name_of)
def test_all_commands_of_every_page_succeed(page, in_empty_folder):
    prepare(page, with_data=True)
    with ExitStack() as boards:
        for command in filter(can_run, commands_of(page)):
            if verb_of(command) == "driver fake":
                boards.callback(boards.enter_context(started_board(command)).terminate)
            else:
                assert main(command) == 0, " ".join(command)
    assert not [name for name in os.listdir() if name.endswith(".partial")]
