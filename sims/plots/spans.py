"""All judged pairs at a glance: where in depth each one's modes and deadbands lie."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from sims.continuity.result import JudgedPair
from sims.plots.style import BLUE, GRID, INK, VERMILLION, axes_or_new

ROW_IN = 0.17
FRAME_IN = 1.1


def plot_spans(pairs: Sequence[JudgedPair], ax: Axes | None = None) -> Axes:
    """One row a pair over depth [mm]: mode 1 above, mode 2 below, deadbands framed and hatched."""
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
