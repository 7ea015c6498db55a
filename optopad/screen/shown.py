"""Display of results: as text on the command line; in a notebook as a headline, a small table and a picture.

The module also contains the result of `optopad explore`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from optopad.design.search.explore import Findings
from optopad.design.search.improve import Judged, Tried
from optopad.design.spec import SensorDesign
from optopad.sims.score.result import headline
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 6.4


class Result(ABC):
    """Base class of results; printing a result shows the same text as the command line."""

    @property
    def found(self) -> Self:
        """This result itself; scripts for earlier versions use this attribute."""
        return self

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """The result as plain data for JSON."""

    def to_dict(self) -> dict[str, Any]:
        """The data that the command line prints with ``--json``."""
        return self.to_json()

    @abstractmethod
    def lines(self) -> list[str]:
        """The result as text."""

    def screen(self) -> list[str]:
        """The lines that the command line prints: the result, and where its files are."""
        return self.lines()

    def __repr__(self) -> str:
        return "\n".join(self.lines())


def block(title: str, lines: Iterable[str], *parts: str) -> str:
    """HTML that shows a result in a notebook: a headline, lines of text, then the HTML pieces `parts`."""
    text = "".join(f"<div>{escape(line)}</div>" for line in lines)
    return f"<div><strong>{escape(title)}</strong>{text}{''.join(parts)}</div>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """HTML of a table of texts; `head` holds the column headings."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def picture(draw: Callable[[], Figure], salt: str) -> str:
    """HTML with a figure as SVG, in the style of the plots; `salt` makes the SVG's identifiers unique."""
    from optopad.sims.plots.style import plain_style, svg_text

    with plain_style():
        return svg_text(draw(), salt).partition("?>")[2]


def drawn(draw: Callable[[Axes], Axes], ax: Axes | None, height_in: float) -> Axes:
    """Draw into the given axes, or if `ax` is None into a new pyplot figure, and return the axes."""
    from optopad.sims.plots.style import plain_style

    with plain_style():
        if ax is None:
            from matplotlib import pyplot as plt

            _, ax = plt.subplots(figsize=(WIDTH_IN, height_in), layout="constrained")
        return draw(ax)


def number(value: float | None, digits: int = 2, missing: str = "-") -> str:
    """A number as text with `digits` decimals, or `missing` for None."""
    return missing if value is None else f"{value:.{digits}f}"


QUICK_ERRORS = {"draft": 3.0, "search": 2.0, "score": 0.0}
"""Assumed error of a margin in a search [noise standard deviations], by setting of the light model.

The values round up the largest observed errors: 1.94 for `search` on 13 pads (docs/how-to/search-layouts.md), 2.9 for
`draft` on four pads of 4 + 4 parts. Other pads may have larger ones.
"""


@dataclass(frozen=True, kw_only=True)
class Search:
    """The result of a search for better designs.

    Attributes
    ----------
    folder : folder with tables, design files and page
    findings : designs and figures that the search found
    files : design file of each design on the Pareto front, relative to the folder
    importance : for each objective, each field's share of the objective's variation [-]; empty if the search evaluated
        too few designs
    """

    folder: Path
    findings: Findings
    files: tuple[str, ...]
    importance: dict[str, dict[str, float]]

    @property
    def base_headline(self) -> str:
        """The base design's verdict in the words of `optopad score`."""
        return self._headline(self.findings.base, self.findings.space.base)

    def headline(self, one: Tried) -> str:
        """A design's verdict in the words of `optopad score`; empty if the design has no verdict.

        The verdict is undecided if the error of the search's light model may change it.
        """
        design = self.findings.space.design_at(one.parameters) if one.judged.verdict else None
        return self._headline(one.judged, design)

    def is_open(self, judged: Judged) -> bool:
        """Whether a design's verdict is undecided, because the error of the search's light model may change it."""
        margin = judged.figures.get("margin")
        error = QUICK_ERRORS[self.findings.space.accuracy]
        return margin is not None and abs(margin - DEADBAND_THRESHOLD) < error

    def _headline(self, judged: Judged, design: SensorDesign | None) -> str:
        if design is None or not judged.verdict:
            return ""
        return headline(
            judged.verdict,
            is_open=self.is_open(judged),
            usable_mm=judged.figures.get("usable_depth_mm"),
            asked_mm=design.operating.max_depth_mm,
            is_short=True,
        )
