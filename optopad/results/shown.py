"""How results show themselves: as the command line's text; in a notebook as a headline, a small table, one picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 6.4


class Result(ABC):
    """A result that prints as the command line does."""

    @property
    def found(self) -> Self:
        """This result; scripts for earlier versions ask it for the figures."""
        return self

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""

    def to_dict(self) -> dict[str, Any]:
        """The same as the command line prints with ``--json``."""
        return self.to_json()

    @abstractmethod
    def lines(self) -> list[str]:
        """The same as the command line prints, a line an entry."""

    def __repr__(self) -> str:
        return "\n".join(self.lines())


def block(title: str, lines: Iterable[str], *parts: str) -> str:
    """A headline, lines below it, then ready HTML."""
    text = "".join(f"<div>{escape(line)}</div>" for line in lines)
    return f"<div><strong>{escape(title)}</strong>{text}{''.join(parts)}</div>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def picture(draw: Callable[[], Figure], salt: str) -> str:
    """A figure as SVG inside a page, in the plots' own style."""
    from sims.plots.style import plain_style, svg_text

    with plain_style():
        return svg_text(draw(), salt).partition("?>")[2]


def drawn(draw: Callable[[Axes], Axes], ax: Axes | None, height_in: float) -> Axes:
    """Axes given, or those of a new figure of pyplot, which a notebook shows and `plt.show()` opens."""
    from sims.plots.style import plain_style

    with plain_style():
        if ax is None:
            from matplotlib import pyplot as plt

            _, ax = plt.subplots(figsize=(WIDTH_IN, height_in), layout="constrained")
        return draw(ax)


def number(value: float | None, digits: int = 2, missing: str = "-") -> str:
    """A number as text; `missing` for None."""
    return missing if value is None else f"{value:.{digits}f}"
