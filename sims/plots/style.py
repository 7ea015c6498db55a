"""Colours and sizes of the plots, and their export as SVG text with the same bytes each time.

Figures are plain objects: no window, no global state, and whatever a user's own settings say inside
`plain_style` a plot looks the same. Colours are those of Okabe and Ito (2008), told apart with the
common colour blindnesses; every colour comes with a line style, a hatch or a shape of its own, so that
nothing rests on colour alone. Text stays text in the SVG, hence in the reader's own fonts.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK: Final = "#1b1f24"
MUTED: Final = "#5b6470"
GRID: Final = "#dfe3e8"
BLUE: Final = "#0072b2"
VERMILLION: Final = "#c24e00"
GREEN: Final = "#00785a"
GREY: Final = "#8a929c"
PALE_BLUE: Final = "#cfe6f5"
PALE_ORANGE: Final = "#fbe0cc"

WIDTH_IN: Final = 5.2
"""Width of a plot [inch]: its text is still legible on a phone, where the page scales it to 0.75."""

_METADATA = {"Creator": None, "Date": None, "Format": None, "Type": None}


@contextmanager
def plain_style() -> Iterator[None]:
    """Draw and export inside: matplotlib's own defaults with our sizes; the caller's settings come back after."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(
            {
                "axes.axisbelow": True,
                "axes.edgecolor": MUTED,
                "axes.labelcolor": INK,
                "axes.labelsize": 9,
                "axes.spines.right": False,
                "axes.spines.top": False,
                "font.size": 9,
                "hatch.linewidth": 0.7,
                "legend.fontsize": 8,
                "legend.frameon": False,
                "svg.fonttype": "none",
                "text.color": INK,
                "xtick.color": MUTED,
                "xtick.labelcolor": INK,
                "xtick.labelsize": 8,
                "ytick.color": MUTED,
                "ytick.labelcolor": INK,
                "ytick.labelsize": 8,
            }
        )
        yield


def axes_or_new(ax: Axes | None, height_in: float, width_in: float = WIDTH_IN) -> Axes:
    """The axes given, or those of a new figure of this size [inch]."""
    if ax is not None:
        return ax
    return Figure(figsize=(width_in, height_in), layout="constrained").add_subplot()


def svg_text(figure: Figure, salt: str) -> str:
    """A figure as SVG text without time or version; equal figures and salts give equal bytes.

    Parameters
    ----------
    salt : makes the identifiers inside differ from those of other plots on the same page
    """
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": salt}):
        figure.savefig(buffer, format="svg", metadata=_METADATA)
    return "\n".join(line.rstrip() for line in buffer.getvalue().splitlines()) + "\n"
