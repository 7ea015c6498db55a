"""The section of an improvement's page that compares the original design with its alternatives.

The module also makes the page of a comparison (`optopad compare`), one self-contained file.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.words import Html, element, section, table
from optopad.screen.comparison import Comparison, shown_value
from optopad.screen.figures import PadFigures, figures_of
from optopad.screen.improvement import Improvement
from optopad.screen.verdict_sentences import changes_words, sentences_of
from optopad.sims.plots.maps import plot_margin_map
from optopad.sims.plots.signal import plot_signal
from optopad.sims.plots.style import plain_style, svg_text
from optopad.sims.score.result import ContinuityScore, JudgedPair

STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.45 system-ui, sans-serif; margin: 1.2rem auto; max-width: 70rem; padding: 0 1rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: left; border-bottom: 1px solid #8886; }
.best { font-weight: 700; } .best::after { content: " \\2605"; }
small { opacity: .75; } figure { margin: 1rem 0; background: #fff; overflow-x: auto; }
svg { max-width: 100%; height: auto; min-width: 30rem; }
"""
LEGEND = (
    "Marked: better than every other design by more than the sum of both uncertainties. Uncertainty: the numerical "
    "error of the figure, or its difference for a second seed of the light model, and at least the resolution of the "
    "depth step. Effects that the models leave out are not included."
)


def compare_html(found: Comparison, figure_svg: str) -> str:
    """The comparison as an HTML page that contains the figure `figure_svg`."""
    head = "".join(
        f"<th>{escape(label)}<br><small>{digest[:8]}</small></th>" for label, digest in _heads(found)
    )
    changes = "".join(
        _row(path, [(shown_value(value), False) for value in values])
        for path, values in found.changes.items()
    )
    verdicts = _row(
        "verdict",
        [(row.headline, number == found.winner_of_verdict) for number, row in enumerate(found.rows)],
    )
    figures = "".join(
        _row(one.title, [(one.shown(k), k == one.winner) for k in range(len(found.labels))])
        for one in found.measures
    )
    svg = figure_svg[figure_svg.index("<svg") :]
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" '
        'content="width=device-width, initial-scale=1"><title>Comparison of '
        f"{escape(', '.join(found.labels))}</title><style>{STYLE}</style><h1>Comparison</h1><h2>What "
        f"differs</h2><div class=wide><table><tr><th></th>{head}</tr>{changes}</table></div><h2>Effect on "
        "the verdict</h2><div "
        f"class=wide><table><tr><th></th>{head}</tr>{verdicts}{figures}</table></div><p><small>{escape(LEGEND)}</small></p><figure>{svg}</figure></html>\n"
    )


def _heads(found: Comparison) -> list[tuple[str, str]]:
    return list(zip(found.labels, found.digests, strict=True))


def _row(name: str, cells: Sequence[tuple[str, bool]]) -> str:
    shown = "".join(f"<td{' class=best' if best else ''}>{escape(text)}</td>" for text, best in cells)
    return f"<tr><th>{escape(name)}</th>{shown}</tr>"


COLOURS_END = 20.0
"""Margin at which the colours of the maps end [noise units]; a larger margin brings no benefit."""
SHOWN = ("location", "depth", "contact", "unresolved", "pressable", "outside", "height", "parts", "price")
"""Figures that are compared below the verdict; a figure that no design has is left out."""


def before_and_after(made: Improvement) -> Html:
    """The section that compares a design with its alternatives; empty if there are none."""
    if not made.alternatives:
        return Html("")
    labels = ["before", *(f"{number}: {one.title}" for number, one in enumerate(made.alternatives, 1))]
    designs = [made.design, *(one.design for one in made.alternatives)]
    scores = [made.before.found, *(one.score for one in made.alternatives)]
    figures = [figures_of(*both) for both in zip(designs, scores, strict=True)]
    changes = ["unchanged", *(changes_words(made.design, one.changes) for one in made.alternatives)]
    files = [
        "",
        *(
            element("code", "optopad run ", element("a", one.file, href=one.file))
            for one in made.alternatives
        ),
    ]
    rows = [
        ["changes", *changes],
        ["verdict", *(sentences_of(*both).verdict for both in zip(designs, scores, strict=True))],
        ["confidence", *(sentences_of(*both).confidence for both in zip(designs, scores, strict=True))],
        ["usable depth [mm]", *(_number(score.usable_depth_mm) for score in scores)],
        ["deadband [mm]", *(_number(score.deadband_total_mm) for score in scores)],
        ["margin [sigma]", *(_number(score.margin) for score in scores)],
        *_figure_rows(figures),
        ["command for its bundle", *files],
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
        else "Margin: least change of all readings over 0.3 mm of depth; a deadband is below 3 sigma."
    )
    return section(
        "before-after",
        "Before and after",
        table(["", *labels], rows, label="Before and after", class_="wide"),
        element("div", *pictures, class_="grid"),
        element(
            "p",
            f"{what} All figures are those of optopad score.",
            class_="note",
        ),
    )


def _figure_rows(figures: list[PadFigures]) -> list[list[str]]:
    rows = zip(*(one.cells for one in figures), strict=True)
    return [
        [cells[0].title, *(cell.text for cell in cells)]
        for cells in rows
        if cells[0].name in SHOWN and any(cell.text != "-" for cell in cells)
    ]


def _same_pair(made: Improvement, score: ContinuityScore) -> JudgedPair:
    """The original design's governing pair in another design's score; if it is missing there, that score's own."""
    named = {pair.name: pair for pair in score.pairs}
    return named.get(made.before.found.governing or "") or named[score.governing or ""]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _picture(made: Improvement, design: SensorDesign, score: ContinuityScore, number: int) -> Html:
    """Picture of a design for the comparison: a pad's margin map, or the signal of one facing pair."""
    with plain_style():
        if score.pad_map is not None and not score.is_facing_rows:
            axes = plot_margin_map(score.pad_map, cavity_of(design), most=COLOURS_END)
        else:
            axes = plot_signal(_same_pair(made, score))
        figure = axes.get_figure(root=True)
        assert figure is not None
        text = svg_text(figure, f"before-after-{number}")
    return Html(text[text.index("<svg") :])
