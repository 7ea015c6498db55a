"""A measured press over the simulated curve, a panel a pair, modes and deadbands of the simulation shaded."""

from __future__ import annotations

from math import ceil

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sims.evaluation.recorded_press import RecordedPair, RecordedPress
from sims.plots.signal import TOTAL
from sims.plots.style import BLUE, GRID, MUTED, PALE_BLUE, PALE_ORANGE, VERMILLION

PANEL_IN = (3.1, 2.5)
MOST_COLUMNS = 3
FRAME_IN = 0.7


def plot_recorded(press: RecordedPress) -> Figure:
    """Signal over untouched signal [-] against depth [mm], measured and simulated."""
    columns = min(MOST_COLUMNS, len(press.pairs))
    lines = ceil(len(press.pairs) / columns)
    size = (max(PANEL_IN[0] * columns, 4.4), PANEL_IN[1] * lines + FRAME_IN)
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    for number, ax in enumerate(panels.flat):
        if number < len(press.pairs):
            plot_recorded_pair(press.pairs[number], ax)
        else:
            ax.set_visible(False)
    figure.supxlabel("depth of the press [mm]", fontsize=9)
    figure.supylabel("signal / untouched signal [-]", fontsize=9)
    figure.legend(
        handles=[
            Line2D([], [], label="simulated", **TOTAL),
            Line2D([], [], color=VERMILLION, marker=".", linestyle="none", label="measured, press"),
            Line2D(
                [], [], color=BLUE, marker="x", markersize=4, linestyle="none", label="measured, retraction"
            ),
            Patch(facecolor=PALE_ORANGE, label="mode 1"),
            Patch(facecolor=PALE_BLUE, label="mode 2"),
            Patch(facecolor="none", edgecolor=MUTED, hatch="////", linewidth=0, label="deadband"),
        ],
        loc="outside upper left",
        ncols=2 if columns < 3 else 3,
    )
    return figure


def plot_recorded_pair(pair: RecordedPair, ax: Axes) -> Axes:
    """One pair's panel."""
    curves, score = pair.simulated.curves, pair.simulated.score
    deepest = float(curves.depth_mm[-1])
    ax.axvspan(*score.modes.mode1_mm, facecolor=PALE_ORANGE, linewidth=0)
    onset, end = score.modes.mode2_mm
    if onset is not None:
        ax.axvspan(onset, deepest if end is None else end, facecolor=PALE_BLUE, linewidth=0, alpha=0.75)
    for start, stop in score.deadbands_mm:
        ax.axvspan(start, stop, facecolor="none", edgecolor=MUTED, hatch="////", linewidth=0)
    ax.plot(curves.depth_mm, curves.total / curves.total[0], **TOTAL)
    press, after = slice(None, pair.deepest + 1), slice(pair.deepest + 1, None)
    ax.plot(pair.depth_mm[after], pair.ratio[after], "x", color=BLUE, markersize=4)
    ax.plot(pair.depth_mm[press], pair.ratio[press], ".", color=VERMILLION, markersize=5)
    ax.grid(color=GRID, linewidth=0.5)
    ax.set_title(
        f"{pair.simulated.name}: apart {pair.rms:.1%} rms, {pair.worst:.1%} at most", fontsize=8, loc="left"
    )
    ax.set_xlim(max(-1.0, min(0.0, float(pair.depth_mm.min()))), max(deepest, float(pair.depth_mm.max())))
    return ax
