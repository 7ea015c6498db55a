"""The section of an improvement's page that compares the original design with its alternatives.

The module also makes the page of a comparison (`optopad compare`), one self-contained file.
"""

from __future__ import annotations

from markupsafe import Markup

from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.words import inlined, part
from optopad.screen.comparison import Comparison, shown_value
from optopad.screen.figures import figures_of
from optopad.screen.improvement import Improvement
from optopad.screen.verdict_sentences import changes_words, sentences_of
from optopad.sims.plots.maps import plot_margin_map
from optopad.sims.plots.signal import plot_signal
from optopad.sims.plots.style import plain_style, svg_text
from optopad.sims.score.result import ContinuityScore, JudgedPair


def compare_html(found: Comparison, figure_svg: str) -> str:
    """The comparison as an HTML page that contains the figure `figure_svg`."""
    designs = range(len(found.labels))
    return part(
        "compare",
        found=found,
        designs=list(zip(found.labels, found.digests, strict=True)),
        changes={path: list(map(shown_value, values)) for path, values in found.changes.items()},
        measures=[(one, list(map(one.shown, designs))) for one in found.measures],
        figure=inlined(figure_svg),
    )


COLOURS_END = 20.0
"""Margin at which the colours of the maps end [noise units]; a larger margin brings no benefit."""
SHOWN = ("location", "depth", "contact", "unresolved", "pressable", "outside", "height", "parts", "price")
"""Figures that are compared below the verdict; a figure that no design has is left out."""


def before_and_after(made: Improvement) -> Markup:
    """The section that compares a design with its alternatives; empty if there are none."""
    if not made.alternatives:
        return Markup()
    before = made.before.found
    rows = [("before", made.design, before, "unchanged", "")]
    for number, one in enumerate(made.alternatives, 1):
        words = changes_words(made.design, one.changes)
        rows.append((f"{number}: {one.title}", one.design, one.score, words, one.file))
    designs = [
        {
            "label": label,
            "score": score,
            "changes": changes,
            "file": file,
            "said": sentences_of(design, score),
            "picture": _picture(made, design, score, number),
        }
        for number, (label, design, score, changes, file) in enumerate(rows)
    ]
    cells = zip(*(figures_of(design, score).cells for _, design, score, _, _ in rows), strict=True)
    return part(
        "before_after",
        designs=designs,
        figures=[row for row in cells if row[0].name in SHOWN and any(cell.text != "-" for cell in row)],
        facing_pair=before.governing if before.is_facing_rows else "",
    )


def _same_pair(made: Improvement, score: ContinuityScore) -> JudgedPair:
    """The original design's governing pair in another design's score; if it is missing there, that score's own."""
    named = {pair.name: pair for pair in score.pairs}
    return named.get(made.before.found.governing or "") or named[score.governing or ""]


def _picture(made: Improvement, design: SensorDesign, score: ContinuityScore, number: int) -> Markup:
    """Picture of a design for the comparison: a pad's margin map, or the signal of one facing pair."""
    with plain_style():
        if score.pad_map is not None and not score.is_facing_rows:
            axes = plot_margin_map(score.pad_map, cavity_of(design), most=COLOURS_END)
        else:
            axes = plot_signal(_same_pair(made, score))
        figure = axes.get_figure(root=True)
        assert figure is not None
        return inlined(svg_text(figure, f"before-after-{number}"))
