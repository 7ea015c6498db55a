"""Plot of a sweep: signal against depth, one panel per value of the field, with modes and deadbands shaded.

All panels share one scale, on which 1 is the brightest untouched signal of the sweep, so that effects on signal and
modes can be compared. A panel shows the middle facing pair, or the governing pair of a pad. Its title gives the verdict
and the deadband, and says if another pair has this deadband. A line marks the usable depth if it is less than the
design requires. For a value outside the models' scope, the panel shows only the reason.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from math import ceil
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from optopad.sims.plots.signal import DIRECT, TOP, TOTAL
from optopad.sims.plots.style import GRID, INK, MUTED, PALE_BLUE, PALE_ORANGE
from optopad.sims.score.result import NEGLIGIBLE_MM
from optopad.sims.score.sweep import SweepRow

USABLE: dict[str, Any] = {"color": INK, "linestyle": ":", "linewidth": 1.2}
PANEL_IN = (1.75, 1.55)
MOST_COLUMNS = 4
FRAME_IN = 0.75
REASON_CHARACTERS = 30
SHORT_VALUE, LONGEST_LINE = 10, 27
"""Longest value that shares a line of the title with other text, and longest line of a title that fits in a panel
[characters]."""
TITLE_LINE_IN = 0.14


def plot_sweep(path: str, rows: Sequence[SweepRow]) -> Figure:
    """Light, over the brightest untouched signal of the sweep [-], against depth [mm]; one panel per value."""
    columns = min(MOST_COLUMNS, len(rows))
    lines = ceil(len(rows) / columns)
    more = max(_title(row).count("\n") for row in rows)
    size = (
        max(PANEL_IN[0] * columns, 2.6) + 0.4,
        (PANEL_IN[1] + TITLE_LINE_IN * more) * lines + FRAME_IN,
    )
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    brightest = max((row.curve.total[0] for row in rows if row.curve is not None), default=1.0)
    for number, ax in enumerate(panels.flat):
        if number >= len(rows):
            ax.set_visible(False)
            panels.flat[number - columns].tick_params(labelbottom=True)
            continue
        plot_swept_value(rows[number], brightest, ax)
    deepest = max((row.curve.depth_mm[-1] for row in rows if row.curve is not None), default=1.0)
    highest = max((max(row.curve.total) / brightest for row in rows if row.curve is not None), default=1.0)
    panels.flat[0].set_xlim(0.0, deepest)
    panels.flat[0].set_ylim(-0.03, 1.05 * max(1.0, highest))
    figure.supxlabel("depth of the press [mm]", fontsize=9)
    figure.supylabel("light / brightest untouched signal [-]", fontsize=9)
    figure.legend(handles=_legend(), loc="outside upper left", ncols=3 if columns > 2 else 1)
    figure.suptitle(path, fontsize=9, x=0.99, ha="right")
    return figure


def plot_swept_value(row: SweepRow, brightest: float, ax: Axes) -> Axes:
    """One value's panel: light, over the brightest untouched signal of the sweep [-], against depth [mm].

    Parameters
    ----------
    brightest : that brightest signal, as received over emitted power [-]; it is shown as 1
    """
    ax.set_title(_title(row), fontsize=8, loc="left")
    ax.grid(color=GRID, linewidth=0.5)
    if row.curve is None:
        reason = textwrap.fill(row.score["reason"], REASON_CHARACTERS, max_lines=6)
        ax.text(0.5, 0.5, reason, transform=ax.transAxes, ha="center", va="center", fontsize=6, color=MUTED)
        return ax
    _shade(ax, row.shown, row.curve.depth_mm[-1])
    usable_mm = row.score["usable_depth_mm"]
    if usable_mm is not None and usable_mm < row.curve.depth_mm[-1] - NEGLIGIBLE_MM:
        ax.axvline(usable_mm, **USABLE).set_gid("usable-depth")
    for light, look in ((row.curve.total, TOTAL), (row.curve.direct, DIRECT), (row.curve.top, TOP)):
        ax.plot(row.curve.depth_mm, [value / brightest for value in light], **look | {"linewidth": 1.2})
    return ax


def _title(row: SweepRow) -> str:
    """Title of a panel: value, verdict and deadband, wrapped to the width of the panel."""
    value = f"{row.value:g}" if isinstance(row.value, float) else str(row.value)
    words = "out of scope" if row.curve is None else row.headline
    lines = textwrap.wrap(f"{value}: {words}", LONGEST_LINE)
    if len(value) > SHORT_VALUE:
        cut = value if len(value) <= LONGEST_LINE else f"{value[: LONGEST_LINE - 3]}..."
        lines = [cut, *textwrap.wrap(words, LONGEST_LINE)]
    return "\n".join([*lines, *_deadband(row)])


def _deadband(row: SweepRow) -> list[str]:
    total = row.score["deadband_mm"]["total"]
    if not total:
        return []
    where = f"{row.score['governing_pair']} " if row.is_of_another_pair else ""
    where = "pad " if row.score["judged_by"] == "pad" else where
    return [f"{where}deadband {total:.2f} mm"]


def _shade(ax: Axes, pair: dict[str, Any], deepest_mm: float) -> None:
    start, end = pair["mode1_mm"]
    ax.axvspan(start, end, facecolor=PALE_ORANGE, linewidth=0)
    onset, last = pair["mode2_mm"]
    if onset is not None:
        ax.axvspan(onset, deepest_mm if last is None else last, facecolor=PALE_BLUE, linewidth=0, alpha=0.75)
    for begin, stop in pair["deadbands_mm"]:
        area = ax.axvspan(begin, stop, facecolor="none", edgecolor=MUTED, hatch="////", linewidth=0)
        area.set_gid("deadband")


def _legend() -> list[Any]:
    return [
        *(
            Line2D([], [], label=label, **look | {"linewidth": 1.2})
            for label, look in (("total", TOTAL), ("direct", DIRECT), ("top, mirrored", TOP))
        ),
        Line2D([], [], label="usable depth ends", **USABLE),
        Patch(facecolor=PALE_ORANGE, label="mode 1"),
        Patch(facecolor=PALE_BLUE, label="mode 2"),
        Patch(facecolor="none", edgecolor=MUTED, hatch="////", linewidth=0, label="deadband of the pair"),
    ]
