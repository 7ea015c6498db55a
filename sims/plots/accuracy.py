"""Plots that evaluate an estimator: touches and errors against depth, arrows of location errors, depth estimates.

The errors of several models share one logarithmic scale, because they differ by large factors. The Cramér-Rao bound is
dashed. An arrow runs from the true to the estimated location of the tip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from optopad.design.arrays import FloatArray
from optopad.design.shape.outline import Outline
from optopad.sims.learning.tables import ErrorRow, JudgedPresses, PublishedTouch, TouchRow
from optopad.sims.plots.style import BLUE, GREEN, GREY, GRID, INK, MUTED, VERMILLION, WIDTH_IN

LOOKS = ((BLUE, "-", "o"), (VERMILLION, "-", "s"), (GREEN, "-", "^"), (INK, ":", "D"), (GREY, "-.", "v"))
"""Colours, line styles and markers of the models, in this order; no two models differ by colour alone."""


def plot_touch(rows: Mapping[str, Sequence[TouchRow]], published: PublishedTouch | None = None) -> Figure:
    """Share of samples correctly classified as touch or no touch, against depth, and published values if given.

    `rows` gives one line of the plot for each model or data set, by name.
    """
    figure = Figure(figsize=(WIDTH_IN, 3.0), layout="constrained")
    ax = figure.add_subplot()
    for (name, of_name), (colour, line, mark) in zip(rows.items(), _looks(len(rows)), strict=True):
        known = [row for row in of_name if row.right is not None]
        ax.errorbar(
            [row.depth_mm for row in known],
            [row.right or 0.0 for row in known],
            yerr=[row.right_error or 0.0 for row in known],
            color=colour, linestyle=line, marker=mark, markersize=4, linewidth=1.2, capsize=2, label=_plain(name),
        )  # fmt: skip
    if published is not None:
        ax.plot(published.depth_mm, published.ambient, "x", color=INK, label="published, ambient")
        ax.plot(published.depth_mm, published.dark, "+", color=INK, markersize=8, label="published, dark")
    ax.axvline(0.0, color=MUTED, linewidth=0.8)
    ax.set_ylim(-0.03, 1.03)
    ax.set_xlabel("depth of the tip [mm]; untouched below 0")
    ax.set_ylabel("correct touches [share]")
    ax.grid(color=GRID, linewidth=0.5)
    ax.legend(loc="lower right")
    return figure


def plot_errors(
    rows: Mapping[str, Sequence[ErrorRow]], bound: Mapping[float, tuple[float, float]] | None = None
) -> Figure:
    """Median errors of location and depth against depth, one line per model; error bars end at the 95th percentile.

    Parameters
    ----------
    rows : for each model by name, its errors at every depth
    bound : for each depth [mm], the Cramér-Rao bounds of location and of depth [mm]
    """
    figure = Figure(figsize=(WIDTH_IN * 1.35, 3.2), layout="constrained")
    panels = figure.subplots(1, 2)
    for ax, title, number in zip(panels, ("location error [mm]", "depth error [mm]"), (0, 1), strict=True):
        for (name, of_name), look in zip(rows.items(), _looks(len(rows)), strict=True):
            _error_line(ax, of_name, number, look, name)
        if bound:
            ax.plot(
                list(bound),
                [both[number] for both in bound.values()],
                "--",
                color=MUTED,
                label="Cramér-Rao bound",
            )
        ax.set_yscale("log")
        ax.set_xlabel("depth of the tip [mm]")
        ax.set_ylabel(title)
        ax.grid(color=GRID, linewidth=0.5, which="both")
    figure.legend(handles=panels[0].get_legend_handles_labels()[0], loc="outside upper left", ncols=3)
    return figure


def _error_line(
    ax: Axes, rows: Sequence[ErrorRow], number: int, look: tuple[str, str, str], name: str
) -> None:
    spreads = [(row.depth_mm, (row.location, row.depth)[number]) for row in rows]
    known = [(depth, spread) for depth, spread in spreads if spread is not None]
    median = np.array([spread.median for _, spread in known])
    high = np.array([spread.p95 for _, spread in known])
    colour, line, mark = look
    ax.errorbar(
        [depth for depth, _ in known], median, yerr=[np.zeros_like(median), np.maximum(high - median, 0.0)],
        color=colour, linestyle=line, marker=mark, markersize=4, linewidth=1.2, capsize=2, label=_plain(name),
    )  # fmt: skip


def plot_arrows(presses: JudgedPresses, depths_mm: Sequence[float], workspace: Outline) -> Figure:
    """Arrows from the true to the estimated location, one panel per depth.

    A hollow mark is a press that the model does not detect.
    """
    columns = min(3, len(depths_mm))
    lines = -(-len(depths_mm) // columns)
    figure = Figure(figsize=(2.3 * columns + 0.4, 2.4 * lines + 0.5), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    for number, ax in enumerate(panels.flat):
        if number < len(depths_mm):
            _arrow_panel(ax, presses.at_depth(depths_mm[number]), depths_mm[number], workspace)
        else:
            ax.set_visible(False)
    figure.supxlabel("x [mm]", fontsize=9)
    figure.supylabel("y [mm]", fontsize=9)
    marks = (
        Line2D([], [], color=BLUE, marker="o", markersize=3, label="true location, arrow to the estimated one"),
        Line2D([], [], color=VERMILLION, marker="o", markerfacecolor="none", markersize=4, linestyle="",
               label="touch not found"),
    )  # fmt: skip
    figure.legend(handles=marks, loc="outside upper left", ncols=2)
    return figure


def _arrow_panel(ax: Axes, presses: JudgedPresses, depth_mm: float, workspace: Outline) -> None:
    found, lost = presses.only(presses.is_found), presses.only(~presses.is_found)
    start, step = found.press_mm[:, :2], (found.said_mm - found.press_mm)[:, :2]
    if len(found):
        ax.quiver(
            start[:, 0], start[:, 1], step[:, 0], step[:, 1], angles="xy", scale_units="xy", scale=1.0,
            color=BLUE, width=0.006, headwidth=3,
        )  # fmt: skip
    ax.plot(start[:, 0], start[:, 1], ".", color=BLUE, markersize=2)
    ax.plot(
        lost.press_mm[:, 0], lost.press_mm[:, 1], "o", markerfacecolor="none", color=VERMILLION, markersize=4
    )
    ax.set_xlim(workspace.x0_mm - 1.0, workspace.x1_mm + 1.0)
    ax.set_ylim(workspace.y0_mm - 1.0, workspace.y1_mm + 1.0)
    ax.set_aspect("equal")
    middle = f", median {np.median(found.location_error_mm):.2f} mm" if len(found) else ""
    ax.set_title(f"{depth_mm:g} mm{middle}", fontsize=8, loc="left")
    ax.grid(color=GRID, linewidth=0.5)


def plot_depths(presses: JudgedPresses, places_mm: FloatArray) -> Figure:
    """Estimated against true depth, one panel per location.

    Parameters
    ----------
    places_mm : (panel, 2) x and y of locations [mm]; each panel shows the presses nearest to its location
    """
    figure = Figure(figsize=(2.2 * len(places_mm) + 0.4, 2.6), layout="constrained")
    panels = figure.subplots(1, len(places_mm), squeeze=False, sharex=True, sharey=True)[0]
    for ax, place in zip(panels, places_mm, strict=True):
        _depth_panel(ax, _nearest_press(presses, place))
    figure.supxlabel("true depth [mm]", fontsize=9)
    figure.supylabel("estimated depth [mm]", fontsize=9)
    return figure


def _depth_panel(ax: Axes, press: JudgedPresses) -> None:
    deepest = float(press.press_mm[:, 2].max(initial=0.0))
    for chosen, colour, mark in ((press.is_found, BLUE, "."), (~press.is_found, GREY, "x")):
        shown = press.only(chosen)
        said = np.where(shown.is_found, shown.said_mm[:, 2], 0.0)
        ax.plot(shown.press_mm[:, 2], said, mark, color=colour, markersize=4)
    ax.plot([0.0, deepest], [0.0, deepest], color=MUTED, linewidth=0.8)
    ax.set_xlim(-1.0, deepest + 0.2)
    x_mm, y_mm = press.press_mm[0, :2]
    ax.set_title(f"({x_mm:.1f}, {y_mm:.1f}) mm", fontsize=8, loc="left")
    ax.grid(color=GRID, linewidth=0.5)


def _nearest_press(presses: JudgedPresses, place_mm: FloatArray) -> JudgedPresses:
    nearest = int(np.hypot(*(presses.press_mm[:, :2] - place_mm).T).argmin())
    return presses.only(presses.place_number == presses.place_number[nearest])


def shown_places_mm(workspace: Outline) -> FloatArray:
    """(3, 2) locations for the depth plots [mm]: the workspace's centre, and near the middles of two of its edges."""
    x_mm, y_mm = 0.5 * (workspace.x0_mm + workspace.x1_mm), 0.5 * (workspace.y0_mm + workspace.y1_mm)
    return np.array([(x_mm, y_mm), (workspace.x0_mm, y_mm), (x_mm, workspace.y0_mm)])


def _plain(text: str) -> str:
    """Text with dollar signs escaped, so that matplotlib does not typeset formulas."""
    return text.replace("$", r"\$")


def _looks(count: int) -> list[tuple[str, str, str]]:
    return [LOOKS[number % len(LOOKS)] for number in range(count)]
