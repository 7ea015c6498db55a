"""Signal of one pair against depth: light by type of path, the two modes, and deadbands.

All curves are shares of the total light in the untouched pad, before noise, gain and clipping. Deadbands and modes are
taken from the pair's score. "Other" is light that is neither direct nor mirrored by the top, such as light scattered by
walls, bottom or tip.

A second plot compares a measured press with the simulated curve, one panel per pair. The modes and deadbands of the
simulation are shaded.
"""

from __future__ import annotations

from math import ceil
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from optopad.sims.learning.recorded_press import RecordedPair, RecordedPress
from optopad.sims.plots.style import (
    BLUE,
    GREEN,
    GRID,
    INK,
    MUTED,
    PALE_BLUE,
    PALE_ORANGE,
    VERMILLION,
    axes_or_new,
)
from optopad.sims.score.result import JudgedPair

HEIGHT_IN = 3.9
SPANS = ("mode", "deadband")
"""Beginnings of the legend labels of shaded areas, which are listed after the curves."""

TOTAL: dict[str, Any] = {"color": INK, "linewidth": 2.2, "linestyle": "-"}
DIRECT: dict[str, Any] = {"color": BLUE, "linewidth": 1.6, "linestyle": (0, (6, 2))}
TOP: dict[str, Any] = {"color": VERMILLION, "linewidth": 1.6, "linestyle": (0, (2, 1.2))}
OTHER: dict[str, Any] = {"color": GREEN, "linewidth": 1.6, "linestyle": (0, (5, 1.5, 1, 1.5))}


def plot_signal(pair: JudgedPair, ax: Axes | None = None) -> Axes:
    """Light of a pair, over its total in the untouched pad [-], against depth [mm].

    Shaded areas have the group identifiers ``mode1``, ``mode2`` and ``deadband``.
    """
    ax = axes_or_new(ax, HEIGHT_IN)
    deepest = float(pair.curves.depth_mm[-1])
    _shade_modes(ax, pair, deepest)
    _draw_curves(ax, pair)
    _hatch_deadbands(ax, pair)
    _mark_boundaries(ax, pair)
    _mark_full_scale(ax, pair)
    ax.set_xlim(0.0, deepest)
    ax.set_ylim(-0.03, 1.05 * max(1.0, float((pair.curves.total / pair.curves.total[0]).max())))
    ax.set_xlabel("depth of the press [mm]")
    ax.set_ylabel("light / untouched total [-]")
    handles, labels = ax.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda number: labels[number].startswith(SPANS))
    ax.legend(
        [handles[number] for number in order],
        [labels[number] for number in order],
        loc="upper left",
        bbox_to_anchor=(-0.02, -0.17),
        ncols=2,
        handlelength=2.6,
        columnspacing=1.4,
    )
    return ax


def _draw_curves(ax: Axes, pair: JudgedPair) -> None:
    curves = pair.curves
    untouched = float(curves.total[0])
    other = curves.total - curves.direct - curves.top
    for label, light, look in (
        ("total", curves.total, TOTAL),
        ("direct", curves.direct, DIRECT),
        ("top, mirrored", curves.top, TOP),
        ("other, scattered", other, OTHER),
    ):
        ax.plot(curves.depth_mm, light / untouched, label=label, **look)


def _shade_modes(ax: Axes, pair: JudgedPair, deepest_mm: float) -> None:
    modes = pair.score.modes
    start, end = modes.mode1_mm
    if end > start:
        area = ax.axvspan(
            start, end, facecolor=PALE_ORANGE, linewidth=0, label=f"mode 1: {start:.2f} to {end:.2f} mm"
        )
        area.set_gid("mode1")
    onset, last = modes.mode2_mm
    if onset is not None:
        text = f"mode 2: {onset:.2f} mm to {'beyond' if last is None else f'{last:.2f} mm'}"
        area = ax.axvspan(
            onset,
            deepest_mm if last is None else last,
            facecolor=PALE_BLUE,
            linewidth=0,
            alpha=0.75,
            label=text,
        )
        area.set_gid("mode2")


def _hatch_deadbands(ax: Axes, pair: JudgedPair) -> None:
    for number, (start, end) in enumerate(pair.score.deadbands_mm):
        several = f" {number + 1}" if len(pair.score.deadbands_mm) > 1 else ""
        area = ax.axvspan(
            start,
            end,
            facecolor="none",
            edgecolor=MUTED,
            hatch="////",
            linewidth=0,
            label=f"deadband{several}: {start:.2f} to {end:.2f} mm",
        )
        area.set_gid("deadband")


def _mark_boundaries(ax: Axes, pair: JudgedPair) -> None:
    """Draw labelled vertical lines at the end of mode 1 and at the onset of mode 2."""
    modes = pair.score.modes
    marks = [(modes.mode1_mm[1], "mode 1 ends", VERMILLION)]
    if modes.mode2_mm[0] is not None:
        marks.append((modes.mode2_mm[0], "mode 2 begins", BLUE))
    for place, (depth_mm, text, colour) in enumerate(sorted(marks)):
        ax.axvline(depth_mm, color=colour, linewidth=1.0)
        ends_here = place == 0 and len(marks) > 1
        ax.annotate(
            text,
            (depth_mm, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-1 if ends_here else 1, 3),
            textcoords="offset points",
            ha="right" if ends_here else "left",
            va="bottom",
            color=colour,
            fontsize=8,
        )


def _mark_full_scale(ax: Axes, pair: JudgedPair) -> None:
    if not pair.score.is_clipped:
        return
    brightest = float(pair.curves.total.max() / pair.curves.total[0])
    ax.axhline(
        brightest / pair.score.peak_share_of_full_scale,
        color=MUTED,
        linewidth=1.0,
        linestyle=":",
        label="full scale of the converter",
    )


PANEL_IN = (3.1, 2.5)
MOST_COLUMNS = 3
FRAME_IN = 0.7


def plot_recorded(press: RecordedPress) -> Figure:
    """Measured and simulated signal, over the untouched signal [-], against depth [mm]; one panel per pair."""
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
    """One pair's panel: measured and simulated signal, over the untouched signal [-], against depth [mm]."""
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
        f"{pair.simulated.name}: difference {pair.rms:.1%} rms, {pair.worst:.1%} at most",
        fontsize=8,
        loc="left",
    )
    ax.set_xlim(max(-1.0, min(0.0, float(pair.depth_mm.min()))), max(deepest, float(pair.depth_mm.max())))
    return ax
