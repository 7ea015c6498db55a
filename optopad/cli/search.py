"""Commands that search for better designs: improve, explore."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optopad.cli import options
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.screen.output import print_json, progress, say
from optopad.work import parsed_change, read_design

if TYPE_CHECKING:
    from optopad.design.search.explore import Findings, OnTried
    from optopad.design.search.improve import Tried
    from optopad.design.search.space import SearchSpace
    from optopad.screen.shown import Search


def improve(
    design: options.Design,
    set_: options.Set = None,
    vary: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="FIELD[=A:B]", help="Vary this field, too, from A to B. Repeatable."),
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option("--keep", metavar="FIELD", help="Keep the value of this field. Repeatable."),
    ] = None,
    more_parts: Annotated[bool, typer.Option("--more-parts", help="Also try more parts per side.")] = False,
    aim: Annotated[
        str | None,
        typer.Option(
            "--aim", metavar="AIM", help="What better means: margin, location, contact, size, flush."
        ),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget",
            metavar="MINUTES",
            help="Approximate search time; default: 3 for a pad, 2 for facing rows.",
        ),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Propose up to four changed designs with a better verdict, as files; the same command continues a search."""
    from optopad.jobs.improvement import improve as search_around

    read = read_design(design, set_)
    with progress(quiet=as_json) as step, telling(quiet=as_json) as tell:
        made = search_around(
            read,
            out,
            text=_text(design, read, is_changed=bool(set_)),
            vary=dict(_range(one) for one in vary or []),
            keep=keep or [],
            more_parts=more_parts,
            aim=aim,
            budget_min=budget,
            seed=seed,
            on_step=step,
            on_tried=tell,
        )
    if as_json:
        print_json(made.to_json())
    else:
        say("\n".join(made.lines()))
    if made.is_interrupted:
        raise typer.Exit(INTERRUPTED)


def _text(where: str, design: SensorDesign, *, is_changed: bool) -> str | None:
    """Text of a design file; None if fields were changed (`is_changed`) or the design has parts of its own."""
    from optopad.design.io import read_design_text
    from optopad.design.preset import preset_text

    path = Path(where)
    if is_changed or any(design.catalog.model_dump().values()):
        return None
    if not path.exists():
        return preset_text(where)
    text = read_design_text(path / "design.toml" if path.is_dir() else path)
    first, _, rest = text.partition("\n")
    return rest if first.startswith("# optopad design ") else text  # it names a digest, which will change


def _range(text: str) -> tuple[str, tuple[float, float] | None]:
    path, equals, ends = text.partition("=")
    if not equals:
        return path.strip(), None
    try:
        low, high = (float(end) for end in ends.split(":"))
    except ValueError:
        raise InputError(
            f"--vary: {text!r} is refused: write FIELD=A:B, as receivers.height_mm=5:7"
        ) from None
    return path.strip(), (low, high)


INTERRUPTED = 130
LINE_EVERY_S = 30.0
"""Without a terminal, a progress line is printed when the Pareto front changes, or after this time [s]."""


def explore(
    space: Annotated[
        str, typer.Argument(metavar="SPACE", help="Search-space file (.toml), or the name of a packaged one.")
    ],
    trials: Annotated[
        int | None, typer.Option(min=1, help="Designs to judge, those of earlier runs included.")
    ] = None,
    storage: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Database that many workers share, as postgresql://user@host/name."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers judge, as tcp://host:8786."),
    ] = None,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: Annotated[
        int | None,
        typer.Option(min=0, max=options.LARGEST_SEED, help="Seed of the search; default: the space's."),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Search a space of designs for the best ones; the same command continues a search."""
    from optopad.jobs.exploration import search, summary

    read = _read(space, set_, seed)
    with telling(quiet=as_json) as tell:
        result = search(read, out, trials=trials, storage=storage, scheduler=scheduler, on_tried=tell)
    if as_json:
        print_json(summary(result))
    else:
        _say(result)
    if result.findings.is_interrupted:
        raise typer.Exit(INTERRUPTED)


def _read(where: str, changes: list[str] | None, seed: int | None) -> SearchSpace:
    from optopad.design.search.space import load_space, space_from

    space = load_space(where)
    document = space.model_dump(mode="json")
    if changes:
        base = space.base.with_(**dict(parsed_change(change) for change in changes))
        document |= {"base": base.model_dump(mode="json")}
    if seed is not None:
        document["search"] |= {"seed": seed}
    return space_from(document, where=where) if changes or seed is not None else space


@contextmanager
def telling(*, quiet: bool) -> Iterator[OnTried | None]:
    """Live progress of a search on standard error: a bar with the best figures so far, or lines without a terminal."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        yield from _bar()
    else:
        yield _lines()


def _bar() -> Iterator[OnTried]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("base design", total=None)

        def tell(found: Findings, _: Tried | None) -> None:
            bars.update(task, completed=len(found.tried), total=found.wanted, description=standing(found))

        yield tell


def _lines() -> OnTried:
    last = {"time": -LINE_EVERY_S, "front": -1.0}

    def tell(found: Findings, _: Tried | None) -> None:
        front = hash(tuple(best.digest for best in found.front))
        now = time.monotonic()
        if front != last["front"] or now - last["time"] >= LINE_EVERY_S or len(found.tried) == found.wanted:
            last.update(time=now, front=front)
            print(f"{len(found.tried):>6} of {found.wanted}  {standing(found)}", file=sys.stderr)

    return tell


def standing(found: Findings) -> str:
    """Text with the best value so far of each objective, and the value of the base design."""
    parts = [f"front {len(found.front)}"]
    for objective in found.space.objectives:
        values = [value for one in found.front if (value := one.judged.figures[objective.figure]) is not None]
        base = found.base.figures.get(objective.figure)
        if values:
            best = min(values) if objective.sense == "minimize" else max(values)
            parts.append(
                f"{objective.figure} {best:.3g}" + (f" (base {base:.3g})" if base is not None else "")
            )
    return ", ".join(parts)


def front_lines(result: Search) -> list[str]:
    """Lines of a table of the base design and the front: figures of the search, verdicts, sizes and price."""
    from optopad.screen.figures import figures_of, in_columns

    found = result.findings
    names = [objective.figure for objective in found.space.objectives]
    if "usable_depth_mm" in found.base.figures and "usable_depth_mm" not in names:
        names.append("usable_depth_mm")
    designs = [found.space.base, *(found.space.design_at(one.parameters) for one in found.front)]
    judged = [found.base, *(one.judged for one in found.front)]
    verdicts = [result.base_headline, *map(result.headline, found.front)]
    columns = [("design", "", ["base", *result.files]), ("verdict", "", verdicts)]
    for name in names:
        values = [one.figures.get(name) for one in judged]
        columns.append((name, "", ["-" if value is None else f"{value:.4g}" for value in values]))
    for cells in zip(*(figures_of(design, None).of_size for design in designs), strict=True):
        columns.append((cells[0].name, cells[0].unit, [cell.text for cell in cells]))
    return in_columns(columns)


def _say(result: Search) -> None:
    found = result.findings
    stopped = sum(bool(one.judged.reason) for one in found.tried)
    say(
        f"search    {found.space.name}: {len(found.tried)} of {max(found.wanted, len(found.tried))} designs judged, "
        f"{stopped} stopped early"
    )
    for limit in found.limits:
        say(f"limit     {limit}")
    for line in front_lines(result):
        say(line)
    if not found.front:
        say(
            "front     empty: no design was judged to the end within all limits; designs.csv lists the reasons"
        )
    say(f"files     {result.folder}")
    say(f"report    {result.folder / 'report.html'}")
    if found.front:
        say(f"next      {_scoring(result)}   (the figures of a score; those above have search accuracy)")


def _scoring(result: Search) -> str:
    """Command that scores the designs of the front, or the first of them if they are too many for one comparison."""
    from optopad.screen.comparison import MOST_DESIGNS

    if len(result.files) == 1:
        return f"optopad score {result.folder / result.files[0]}"
    if len(result.files) <= MOST_DESIGNS:
        return f"optopad compare {result.folder / 'designs'}/*.toml"
    return f"optopad compare {' '.join(str(result.folder / file) for file in result.files[:3])}"
