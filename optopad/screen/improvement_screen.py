"""What an improvement found, on one screen: before, up to four alternatives with what they cost, the next command."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from optopad.report.text.answer import answer_of, changes_words, verdict_words
from optopad.screen.one_screen import LABEL, row

if TYPE_CHECKING:
    from optopad.results.improvement import Alternative, Improvement


WHOLE = 12
"""Lines that any text may take: nothing is cut."""


def improvement_screen(made: Improvement) -> list[str]:
    """Lines for the terminal."""
    judged = f"; {made.tried} designs judged by quick light, {made.judged_again} of them by the score's"
    lines = row("design", f"{made.before.name}  {made.before.digest[:8]}{judged}", WHOLE)
    lines += row("before", answer_of(made.design, made.before).verdict, WHOLE)
    for number, one in enumerate(made.alternatives, 1):
        lines += row(str(number), f"{one.kind}: {changes_words(made.design, one.changes)}", WHOLE)
        lines += row("", _worth(made, one), WHOLE)
    if made.is_interrupted:
        lines += row("stopped", "nothing that was judged is lost; the same command goes on")
    elif made.alternatives:
        files = ", ".join(one.file for one in made.alternatives)
        lines += [
            f"{'files':<{LABEL}}{made.folder}/{files}",
            f"{'next':<{LABEL}}optopad run {shlex.quote(str(made.folder / made.alternatives[0].file))}",
        ]
    else:
        lines += _without(made)
    return [*lines, f"{'report':<{LABEL}}{made.folder / 'report.html'}"]


def _worth(made: Improvement, one: Alternative) -> str:
    """Verdict, confidence and margin by the score's light; the bound of the location by the search's."""
    said = answer_of(one.design, one.score)
    told = [verdict_words(one.score), said.sure.partition(":")[0]]
    told.append(f"margin {_number(one.score.margin, 1)} sigma (was {_number(made.before.margin, 1)})")
    now, was = one.figures.get("location_bound_mm"), made.figures.get("location_bound_mm")
    if now is not None:
        told.append(f"location {now:.3f} mm by quick light (was {_number(was, 3)})")
    return "; ".join(part for part in told if part)


def _without(made: Improvement) -> list[str]:
    """The best design that was judged, what is missing, and what to try."""
    none = "no better design" if made.before.verdict == "DEADBAND" else "nothing better by enough to matter"
    lines = row("none", f"{none} among {made.tried} designs", WHOLE)
    nearest = made.nearest
    if nearest is not None:
        dead = nearest.score.deadband_total_mm
        left = f"{dead:.2f} mm of deadband" if dead else f"margin {_number(nearest.score.margin, 1)} sigma"
        words = changes_words(made.design, nearest.changes)
        lines += row("nearest", f"{words}: {verdict_words(nearest.score)}; {left}", WHOLE)
        if nearest.at_ends:
            lines += row("limit", f"{', '.join(nearest.at_ends)} at the end of its range", WHOLE)
    return lines + row("next", "widen a range with --vary FIELD=A:B, allow --more-parts, or raise --budget")


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
