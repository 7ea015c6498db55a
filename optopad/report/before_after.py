"""The section of an improvement's page: the design before and its alternatives, side by side."""

from __future__ import annotations

from design.search.figures import FIGURES
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from optopad.report.text.markup import Html, element, section, table
from optopad.results.improvement import Figures, Improvement
from optopad.screen.answer import answer_of, changes_words
from sims.continuity.result import ContinuityScore, JudgedPair
from sims.plots.maps import plot_margin_map
from sims.plots.signal import plot_signal
from sims.plots.style import plain_style, svg_text

COLOURS_END = 20.0
"""Margin at which the colours of the maps end [noise units]: beyond it more is worth nothing."""
SHOWN = (
    "location_bound_mm",
    "depth_bound_mm",
    "resolvable_steps",
    "part_count",
    "pad_height_mm",
)
"""Figures of the search that are told beside each other, where one of the designs has them."""


def before_and_after(made: Improvement) -> Html:
    """The section; nothing without alternatives."""
    if not made.alternatives:
        return Html("")
    labels = ["before", *(f"{number}: {one.kind}" for number, one in enumerate(made.alternatives, 1))]
    designs = [made.design, *(one.design for one in made.alternatives)]
    scores = [made.before.found, *(one.score for one in made.alternatives)]
    figures = [made.figures, *(one.figures for one in made.alternatives)]
    changes = ["as it is", *(changes_words(made.design, one.changes) for one in made.alternatives)]
    files = [
        "",
        *(
            element("code", "optopad run ", element("a", one.file, href=one.file))
            for one in made.alternatives
        ),
    ]
    rows = [
        ["what changes", *changes],
        ["verdict", *(answer_of(*both).verdict for both in zip(designs, scores, strict=True))],
        ["how sure", *(answer_of(*both).sure for both in zip(designs, scores, strict=True))],
        ["usable depth [mm]", *(_number(score.usable_depth_mm) for score in scores)],
        ["deadband [mm]", *(_number(score.deadband_total_mm) for score in scores)],
        ["margin [noise units]", *(_number(score.margin) for score in scores)],
        *_figure_rows(figures),
        ["bundle of it", *files],
    ]
    pictures = [
        element(
            "figure",
            element("div", _picture(made, design, score, number), class_="card plot"),
            element("figcaption", label),
        )
        for number, (label, design, score) in enumerate(zip(labels, designs, scores, strict=True))
    ]
    what = (
        f"The signal of {made.before.found.governing} against depth."
        if made.before.found.is_facing_rows
        else "How far frames of all readings are apart over the least told 0.3 mm; below 3 noise units is blind."
    )
    return section(
        "before-after",
        "Before and after",
        table(["", *labels], rows, label="Before and after", class_="wide"),
        element("div", *pictures, class_="grid"),
        element(
            "p",
            f"{what} Verdict, usable depth, deadband and margin are as optopad score gives them; the other figures are "
            "those of the search's quick light, alike for all.",
            class_="note",
        ),
    )


def _figure_rows(figures: list[Figures]) -> list[list[str]]:
    rows = []
    for name in SHOWN:
        values = [one.get(name) for one in figures]
        if any(value is not None for value in values):
            unit = FIGURES[name].unit
            words = name.removesuffix("_mm").replace("_", " ") + ("" if unit == "1" else f" [{unit}]")
            rows.append([words, *map(_number, values)])
    return rows


def _same_pair(made: Improvement, score: ContinuityScore) -> JudgedPair:
    """The pair that governed before; of a layout without it the one that governs now."""
    named = {pair.name: pair for pair in score.pairs}
    return named.get(made.before.found.governing or "") or named[score.governing or ""]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _picture(made: Improvement, design: SensorDesign, score: ContinuityScore, number: int) -> Html:
    """Of a pad its margin, place by place, all in the same colours; of facing rows the signal of the same pair."""
    with plain_style():
        if score.pad_map is not None and not score.is_facing_rows:
            axes = plot_margin_map(score.pad_map, cavity_of(design), most=COLOURS_END)
        else:
            axes = plot_signal(_same_pair(made, score))
        figure = axes.get_figure(root=True)
        assert figure is not None
        text = svg_text(figure, f"before-after-{number}")
    return Html(text[text.index("<svg") :])
