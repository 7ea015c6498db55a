"""What an improvement found, on one screen: before, up to three alternatives with what they cost, the next command."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from optopad.report.text.answer import answer_of, changes_words
from optopad.screen.one_screen import row

if TYPE_CHECKING:
    from optopad.results.improvement import Alternative, Improvement, Nearest


def improvement_screen(made: Improvement) -> list[str]:
    """Lines for the terminal."""
    lines = row("design", f"{made.before.name}  {made.before.digest[:8]}; {made.tried} designs tried near it")
    lines += row("before", answer_of(made.design, made.before).verdict, 2)
    for number, one in enumerate(made.alternatives, 1):
        lines += row(str(number), f"{one.kind}: {changes_words(made.design, one.changes)}", 2)
        lines += row("", _worth(made, one))
    if made.is_interrupted:
        lines += row("stopped", "nothing that was judged is lost; the same command goes on")
    elif made.alternatives:
        lines += [
            f"files     {made.folder}/{', '.join(one.file for one in made.alternatives)}",
            f"next      optopad run {shlex.quote(str(made.folder / made.alternatives[0].file))}",
        ]
    elif made.nearest is not None:
        lines += _without(made, made.nearest)
    return [*lines, f"report    {made.folder / 'report.html'}"]


def _worth(made: Improvement, one: Alternative) -> str:
    """Verdict, how sure, margin, and where the search worked it out what one frame tells of the place."""
    said = answer_of(one.design, one.score)
    told = [said.verdict.partition(":")[0], said.sure.partition(":")[0]]
    for name, words, unit, digits in (
        ("margin", "margin", "noise units", 1),
        ("location_bound_mm", "place", "mm", 3),
    ):
        now, was = one.figures.get(name), made.figures.get(name)
        if now is not None:
            before = "" if was is None else f" (was {was:.{digits}f})"
            told.append(f"{words} {now:.{digits}f} {unit}{before}")
    return "; ".join(part for part in told if part)


def _without(made: Improvement, nearest: Nearest) -> list[str]:
    """What came nearest, and what stops it."""
    dead = nearest.judged.figures["deadband_mm"] or 0.0
    left = (
        f"{dead:.2f} mm of deadband left"
        if dead
        else f"margin {nearest.judged.figures.get('margin') or 0.0:.1f} noise units"
    )
    words = changes_words(made.design, nearest.changes)
    none = "no better design" if made.before.verdict == "DEADBAND" else "nothing better by enough to matter"
    lines = row("none", f"{none} in reach; nearest: {words}, {left}", 2)
    if nearest.at_ends:
        lines += row("limit", f"{', '.join(nearest.at_ends)} at the end of its range")
    return lines + row("next", "widen a range with --vary FIELD=A:B, allow --more-parts, or raise --budget")
