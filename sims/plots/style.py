"""Colours and sizes of the plots, and their reproducible export as SVG text.

Figures are objects without a window or global state. Within `plain_style`, a plot does not depend on the user's
matplotlib settings. Colours are those of Okabe and Ito (2008), which people with the common types of colour blindness
can distinguish. Every colour has its own line style, hatch or shape, so that nothing depends on colour alone. Text
remains text in the SVG and is shown in the reader's own fonts.

The module also plots the modes and deadbands of all judged pairs (`plot_spans`).
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from optopad.sims.score.result import JudgedPair

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
"""Width of a plot [inch], chosen so that text is legible on a phone, where the page scales plots by 0.75."""

_METADATA = {"Creator": None, "Date": None, "Format": None, "Type": None}


@contextmanager
def plain_style() -> Iterator[None]:
    """`with` block that uses matplotlib's defaults and optopad's sizes; the user's settings are restored at its end."""
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
                "axes.titley": 1.0,  # no search for ticks above the axes, as there are none
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
    """The given axes, or new axes in a figure of this size [inch] if `ax` is None."""
    if ax is not None:
        return ax
    return Figure(figsize=(width_in, height_in), layout="constrained").add_subplot()


def svg_text(figure: Figure, salt: str) -> str:
    """A figure as SVG text without time or version, so that equal figures and salts give equal bytes.

    Parameters
    ----------
    salt : text that makes the SVG's identifiers differ from those of other plots on the same page
    """
    buffer = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": salt}):
        if (layout := figure.get_layout_engine()) is not None:
            FigureCanvasSVG(figure)  # the layout measures texts as its canvas writes them
            layout.execute(figure)
            figure.set_layout_engine("none")  # `savefig` would draw the figure once more to lay it out
        figure.savefig(buffer, format="svg", metadata=_METADATA)
    return "\n".join(line.rstrip() for line in buffer.getvalue().splitlines()) + "\n"


ROW_IN = 0.17
FRAME_IN = 1.1


def plot_spans(pairs: Sequence[JudgedPair], ax: Axes | None = None) -> Axes:
    """Modes and deadbands of all pairs over depth [mm], one row of the plot per pair.

    Mode 1 is the upper bar, mode 2 the lower one. Deadbands are framed and hatched.
    """
    ax = axes_or_new(ax, FRAME_IN + ROW_IN * len(pairs))
    for row, pair in enumerate(pairs):
        _draw_row(ax, row, pair)
    ax.set_yticks(range(len(pairs)), [pair.name for pair in pairs], fontsize=7)
    ax.set_ylim(len(pairs) - 0.5, -0.5)
    ax.set_xlim(0.0, max(float(pair.curves.depth_mm[-1]) for pair in pairs))
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x", color=GRID, linewidth=0.6)
    ax.set_xlabel("depth of the press [mm]")
    ax.set_ylabel("pair")
    ax.legend(
        handles=[
            Patch(color=VERMILLION, label="mode 1"),
            Patch(color=BLUE, label="mode 2"),
            Patch(facecolor="white", edgecolor=INK, hatch="/////", label="deadband"),
        ],
        loc="lower left",
        bbox_to_anchor=(-0.02, 1.0),
        ncols=3,
    )
    return ax


def _draw_row(ax: Axes, row: int, pair: JudgedPair) -> None:
    modes, deepest = pair.score.modes, float(pair.curves.depth_mm[-1])
    start, end = modes.mode1_mm
    ax.broken_barh([(start, end - start)], (row - 0.40, 0.30), color=VERMILLION, linewidth=0)
    onset, last = modes.mode2_mm
    if onset is not None:
        length = (deepest if last is None else last) - onset
        ax.broken_barh([(onset, length)], (row + 0.10, 0.30), color=BLUE, linewidth=0)
    dead = [(begin, stop - begin) for begin, stop in pair.score.deadbands_mm]
    if dead:
        ax.broken_barh(
            dead, (row - 0.30, 0.60), facecolor=(1, 1, 1, 0.6), edgecolor=INK, hatch="/////", linewidth=0.7
        )
