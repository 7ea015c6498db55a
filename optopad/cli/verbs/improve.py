"""The verb from a verdict to a better design: improve."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from design.errors import InputError
from design.spec import SensorDesign
from optopad.cli import options
from optopad.cli.output import print_json, say
from optopad.cli.progress import progress
from optopad.cli.verbs.explore import INTERRUPTED, telling
from optopad.work.designs import read_design

if TYPE_CHECKING:
    from optopad.jobs.improvement import Alternative, Improvement


def improve(
    design: options.Design,
    set_: options.Set = None,
    vary: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="FIELD[=A:B]", help="Vary this field, too, from A to B. Repeatable."),
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option("--keep", metavar="FIELD", help="Leave this field as it is. Repeatable."),
    ] = None,
    more_parts: Annotated[
        bool, typer.Option("--more-parts", help="More parts a side may help, too.")
    ] = False,
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget", metavar="MINUTES", help="Time to search, about: 3 for a pad, 1 for facing rows."
        ),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Up to three verified changes that mend or better a design, as design files; the same command goes on."""
    from optopad.jobs.improvement import improve as search_around

    read = read_design(design, set_)
    with progress(quiet=as_json) as step, telling(quiet=as_json) as tell:
        made = search_around(
            read,
            _text(design, read, is_changed=bool(set_)),
            out,
            vary=dict(_range(one) for one in vary or []),
            keep=keep or [],
            more_parts=more_parts,
            budget_min=budget,
            seed=seed,
            on_step=step,
            on_tried=tell,
        )
    if as_json:
        print_json(made.to_json())
    else:
        say("\n".join(_lines(made)))
    if made.is_interrupted:
        raise typer.Exit(INTERRUPTED)


def _text(where: str, design: SensorDesign, *, is_changed: bool) -> str:
    """The design as its author wrote it; written anew where changes or parts of its own are not in that file."""
    from design.io import dump_design
    from design.preset import preset_text

    path = Path(where)
    if is_changed or any(design.catalog.model_dump().values()):
        return dump_design(design).split("\n", 1)[1]  # its first line names the digest, which will be another
    if not path.exists():
        return preset_text(where)
    return (path / "design.toml" if path.is_dir() else path).read_text(encoding="utf-8")


def _range(text: str) -> tuple[str, tuple[float, float] | None]:
    """Path and range of one ``FIELD[=A:B]``."""
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


def _lines(made: Improvement) -> list[str]:
    """What was found, on one screen."""
    from optopad.report.text.answer import verdict_words
    from optopad.screen.one_screen import row

    lines = row(
        "design", f"{made.before.name}  {made.before.digest[:8]}; {made.tried} designs tried around it"
    )
    lines += row("before", verdict_words(made.before))
    for number, one in enumerate(made.alternatives, 1):
        lines += row(str(number), f"{one.kind}: {_changes(one.changes)}", 2)
        lines += row("", _worth(one))
        lines.append(f"          {made.folder / one.file}")
    if made.is_interrupted:
        lines += row("stopped", "nothing that was judged is lost; the same command goes on")
    elif made.alternatives:
        lines.append(f"next      optopad run {made.folder / made.alternatives[0].file}")
    elif made.nearest is not None:
        figures, limit = made.nearest.judged.figures, ", ".join(made.nearest.at_ends)
        dead = figures["deadband_mm"] or 0.0
        left = (
            f"{dead:.2f} mm of deadband left"
            if dead
            else f"margin {figures.get('margin') or 0.0:.1f} noise units"
        )
        lines += row(
            "none", f"no better design in reach; nearest: {_changes(made.nearest.changes)}, {left}", 2
        )
        lines += row("limit", f"{limit} at the end of its range" if limit else "")
        lines += row("next", "widen a range with --vary FIELD=A:B, allow --more-parts, or raise --budget")
    return [*lines, f"report    {made.folder / 'report.html'}"]


def _changes(changes: dict[str, Any]) -> str:
    return ", ".join(f"{path} = {value}" for path, value in changes.items()) or "as it is"


def _worth(one: Alternative) -> str:
    """Verdict, how sure, margin, and where the search worked it out what one frame tells of the place."""
    from optopad.report.text.answer import answer_of, verdict_words

    sure = answer_of(one.design, one.score).sure.partition(":")[0]
    margin, place = one.figures.get("margin"), one.figures.get("location_bound_mm")
    told = [verdict_words(one.score), sure, "" if margin is None else f"margin {margin:.1f} noise units"]
    told.append("" if place is None else f"place {place:.3f} mm at best")
    return "; ".join(part for part in told if part)
