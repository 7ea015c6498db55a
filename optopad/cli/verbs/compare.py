"""The verb compare: designs side by side, or a design beside a recording of its build."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optopad.cli import options
from optopad.cli.output import tell
from optopad.cli.progress import progress
from optopad.work.designs import parsed_change, read_design

if TYPE_CHECKING:
    from design.spec import SensorDesign

RECORDINGS = (".nc", ".csv")


def compare(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="DESIGN...", help="Designs, bundles or presets; or one and a RECORDING (.nc, .csv)."
        ),
    ],
    with_: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="PATH=VALUE",
            help="A copy of the first design with this changed, as receivers.part=...; several changes: 'A=1;B=2'. "
            "Repeatable: a copy each.",
        ),
    ] = None,
    pair: Annotated[
        list[str] | None, typer.Option("--pair", help="Recording: a pair to show, as E1-R1. Repeatable.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y", help="Recording: the place whose press is shown [mm]."),
    ] = None,
    set_: options.Set = None,
    fine: options.Fine = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """What differs between designs and in their scores; or a measured press over the simulated curve."""
    recordings = [name for name in what if Path(name).suffix.lower() in RECORDINGS]
    if recordings:
        _recording(what, recordings, with_, pair, at, set_, out, seed, as_json)
        return
    _refuse(pair or at, "--pair and --at are for a recording; leave them out, or name a .nc or .csv file")
    from optopad.jobs.compare import compare as hold

    designs, labels = _designs(what, with_, set_)
    with progress(quiet=as_json) as step:
        found = hold(designs, labels, out, fine=fine, seed=seed, on_step=step)
    files = f"files     {found.folder} ({found.stem}: html, json, svg, png)"
    tell(as_json, found.to_json, lambda: [*found.lines(), files])


def _designs(
    what: list[str], with_: list[str] | None, set_: list[str] | None
) -> tuple[list[SensorDesign], list[str]]:
    designs = [read_design(name, set_) for name in what]
    labels = _labels(what, [design.name for design in designs])
    for text in with_ or []:
        changes = dict(parsed_change(one, option="--with") for one in text.split(";"))
        designs.append(designs[0].with_(**changes))
        labels.append(text)
    return designs, labels


def _labels(what: list[str], names: list[str]) -> list[str]:
    """Names of designs where they differ, else what was typed."""
    return names if len(set(names)) == len(names) else list(what)


def _refuse(given: object, message: str) -> None:
    from design.errors import InputError

    if given:
        raise InputError(f"compare: {message}")


def _recording(
    what: list[str],
    recordings: list[str],
    with_: list[str] | None,
    pair: list[str] | None,
    at: str | None,
    set_: list[str] | None,
    out: Path,
    seed: int,
    as_json: bool,
) -> None:
    _refuse(
        len(what) != 2 or len(recordings) != 1, "a recording is compared with one design: DESIGN RECORDING"
    )
    _refuse(with_, "--with makes copies of a design; a recording is compared with the design that was built")
    from optopad.jobs.recorded import compare_recording, recorded_lines

    place, file = next(name for name in what if name not in recordings), Path(recordings[0])
    read = read_design(place, set_)
    with progress(quiet=as_json) as step:
        found = compare_recording(read, file, out, pairs=pair or [], at=at, seed=seed, on_step=step)
    files = f"files     {found.folder} ({found.stem}: json, svg, png)"
    tell(as_json, found.to_json, lambda: [*recorded_lines(found), files])
