"""Output of a command: lines for people or one JSON object for programs, and progress on standard error.

Progress is a live bar on a terminal, otherwise one line per step of the computation. With --json there is no progress.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from optopad.design.errors import ModelScopeError
from optopad.design.progress import OnStep
from optopad.sims.compiling import compiling_told

if TYPE_CHECKING:
    from optopad.design.pad import Pad

STAGE_TITLES = {
    "kernels": "compiling the light kernels, once on this machine: half a minute or more",
    "contact": "contact (MuJoCo)",
    "objects": "contact of the objects",
    "light of objects": "light under the objects",
    "ball": "light under the ball around each location",
    "pairs": "light, pair by pair",
    "light": "light",
    "loose walls": "light, walls torn loose",
    "data": "samples",
    "map": "light, map of the pad",
    "doubtful places": "light, doubtful locations again",
    "states": "light under objects, for the fast map",
    "check": "light under other objects",
    "map error": "light, between the map's nodes",
    "calibration": "fit of the unit's optics",
    "fit": "model",
    "curves": "light, pairs under the tip",
    "open pairs": "light, undecided pairs again",
    "open places": "light, undecided locations again",
    "bounds": "light, bounds of resolution",
    "tolerance": "unmeasured parameters",
    "what matters": "sensitivity to each parameter",
    "trial": "trial: heights and thickness moved",
    "builds": "Monte Carlo over tolerances",
    "rays": "sample paths",
    "mold": "mold and tools",
    "scene": "MuJoCo model of the pad, and a demo scene",
    "mold beside": "mold and tools: wait",
    "presses": "presses of the stage",
    "files": "build sheet, driver config, report",
}


@dataclass(frozen=True)
class Told:
    """What a verb says: plain data for ``--json``, lines for the terminal, and the exit code."""

    document: dict[str, Any]
    lines: Sequence[str]
    exit_code: int = 0

    def to_json(self) -> dict[str, Any]:
        """The data that ``--json`` prints."""
        return self.document

    def screen(self) -> Sequence[str]:
        """The lines that the terminal shows."""
        return self.lines


def tell(as_json: bool, document: Callable[[], dict[str, Any]], lines: Callable[[], Iterable[str]]) -> None:
    """Print a result: one JSON object if `as_json`, otherwise lines for people."""
    if as_json:
        print_json(document())
    else:
        say("\n".join(lines()))


def print_json(document: dict[str, Any]) -> None:
    """Print one JSON object on standard output. Infinite numbers, which mark undecided values, become null."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False))


def say(text: str = "") -> None:
    """Print a line for people on standard output."""
    typer.echo(text)


ANNOUNCED = "kernels"
"""Step of a computation that gets a line of progress even without a bar, because it is long and unexpected."""


def foretell_score(pad: Pad, *, fine: bool, full: bool, quiet: bool, is_run: bool = False) -> None:
    """Report on standard error how long a score or a whole run will take, if it takes long."""
    from optopad.sims.contact.indentation import require_covered
    from optopad.sims.contact.scope import contact_of
    from optopad.sims.score.cost import score_sentence

    if quiet:
        return
    try:
        require_covered(contact_of(pad.design))
    except ModelScopeError:
        return  # it ends at once
    if said := score_sentence(pad.design, fine=fine, full=full, is_run=is_run):
        print(said, file=sys.stderr, flush=True)


@contextmanager
def progress(*, quiet: bool) -> Iterator[OnStep]:
    """Yield the function `on_step` for progress, which is called with the name of a step and its finished fraction."""
    if quiet:
        yield lambda _stage, _share: None
    elif sys.stderr.isatty():
        with _live() as step, compiling_told(lambda share: step(ANNOUNCED, share)):
            yield step
    else:
        step = _plain()
        with compiling_told(lambda share: step(ANNOUNCED, share)):
            yield step


@contextmanager
def _live() -> Iterator[OnStep]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<26}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True)) as bars:
        tasks: dict[str, TaskID] = {}

        def step(stage: str, share: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(STAGE_TITLES.get(stage, stage), total=1.0)
            bars.update(tasks[stage], completed=share)

        yield step


def _plain() -> OnStep:
    started: dict[str, float] = {}
    done: set[str] = set()

    def step(stage: str, share: float) -> None:
        if stage == ANNOUNCED and stage not in started:
            print(STAGE_TITLES[stage], file=sys.stderr, flush=True)
        started.setdefault(stage, time.monotonic())
        if share >= 1.0 and stage not in done:
            done.add(stage)
            seconds = time.monotonic() - started[stage]
            title = "light kernels compiled" if stage == ANNOUNCED else STAGE_TITLES.get(stage, stage)
            print(f"{title:<26} {seconds:6.1f} s", file=sys.stderr)

    return step
