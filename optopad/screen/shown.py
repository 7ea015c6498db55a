"""Display of results: as text on the command line; in a notebook as a headline, a small table and a picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 6.4
INTERRUPTED = 130
"""Exit code of an interrupted command."""


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
