"""A comparison as one self-contained page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from optopad.results.comparison import Comparison, shown_value

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
    "Marked is what beats every other design by more than both uncertainties together. Uncertainty: how far a second "
    "seed of the light model is from the first, and at least what the depth step leaves. What the models leave out is "
    "not in it."
)


def compare_html(found: Comparison, figure_svg: str) -> str:
    """The comparison as a page; `figure_svg` is its figure."""
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
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Comparison of {escape(', '.join(found.labels))}</title><style>{STYLE}</style>"
        "<h1>Comparison</h1><h2>What differs</h2>"
        f"<div class=wide><table><tr><th></th>{head}</tr>{changes}</table></div>"
        "<h2>What that does</h2>"
        f"<div class=wide><table><tr><th></th>{head}</tr>{verdicts}{figures}</table></div>"
        f"<p><small>{escape(LEGEND)}</small></p><figure>{svg}</figure></html>\n"
    )


def _heads(found: Comparison) -> list[tuple[str, str]]:
    return list(zip(found.labels, found.digests, strict=True))


def _row(name: str, cells: Sequence[tuple[str, bool]]) -> str:
    shown = "".join(f"<td{' class=best' if best else ''}>{escape(text)}</td>" for text, best in cells)
    return f"<tr><th>{escape(name)}</th>{shown}</tr>"
