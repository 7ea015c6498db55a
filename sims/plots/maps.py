"""Maps over the pad: deadband, margin and usable depth, bounds of location and depth, and detection threshold.

A cell represents the press at its centre; nothing is interpolated between locations. Cells at the border extend half a
pitch beyond the workspace, whose outline is dashed. No cell has its centre outside the workspace. Locations without a
finite value are hatched. Maps for several depths share one scale for comparison.

The module also draws a pad, its workspace and its components from above.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Rectangle

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.shape.cavity import TURN_RAD, CavityGeometry, PlacedPart, Plan, outline_mm
from optopad.design.shape.outline import Outline
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.observability import PadBounds
from optopad.sims.plots.style import BLUE, INK, MUTED, VERMILLION, WIDTH_IN, axes_or_new
from optopad.sims.verdict.pad_map import PadMap, Place

NAME_POINTS = 5
"""Distance of a component's name from its mark [points]."""


def outline_patch(plan: Plan, **look: Any) -> Patch:
    """A pad's outline as a matplotlib patch."""
    return Polygon(outline_mm(plan), **look)


def workspace_patch(space: Outline, **look: Any) -> Patch:
    """The workspace, in which presses are judged, as a matplotlib patch."""
    return Polygon(space.points(TURN_RAD), **look)


def clip_to_pad(artist: Any, ax: Any, cavity: CavityGeometry) -> None:
    """Clip an artist, such as the cells of a map, to the pad's outline."""
    artist.set_clip_path(outline_patch(cavity.plan, transform=ax.transData))


def draw_part(ax: Axes, part: PlacedPart, colour: str, *, size: float, is_named: bool) -> None:
    """Draw a component from above: an emitter as a dot, a receiver as an open square, with its name next to it.

    Parameters
    ----------
    size : size of the mark [points]
    """
    x, y, _ = part.position_mm
    is_emitter = part.kind == "emitter"
    look: dict[str, Any] = {"markersize": size, "markeredgecolor": colour, "clip_on": False, "zorder": 5}
    ax.plot(
        x, y, marker="o" if is_emitter else "s", markerfacecolor=colour if is_emitter else "white", **look
    )
    if is_named:
        right, up = part.label_way
        ax.annotate(
            part.name,
            (x, y),
            xytext=(NAME_POINTS * right, NAME_POINTS * up),
            textcoords="offset points",
            ha=("center", "left", "right")[round(right)],
            va=("center", "bottom", "top")[round(up)],
            fontsize=7,
            color=colour,
        )


Quantity = Literal["location", "depth"]
Lines = tuple[tuple[float, ...], tuple[float, ...]]
"""x and y coordinates of a map's grid [mm]."""

DEAD_COLOURS = LinearSegmentedColormap.from_list("deadband", ["#f7f4ef", "#f2b98a", VERMILLION, "#5c2200"])
CHANGE_COLOURS = LinearSegmentedColormap.from_list("change", ["#f2f6f9", "#9cc9e6", BLUE, "#002e4a"])
NONE, HATCH = "#e4e7eb", "////"
"""Colour and hatch of a cell without a finite value."""
UM_PER_MM = 1000.0
COLUMNS, PANEL_IN, LEAST_WIDTH_IN = 3, 2.9, 3.0
LABELS = {
    "location": "location bound, one frame [µm]",
    "depth": "depth bound, location unknown, one frame [µm]",
}
MOST_NUMBERED = 13
"""Largest number of locations along a side for which cells show numbers."""
FINE, MOST_WRITTEN = 160, 50
"""Points along a side of a map whose locations are not in rows and columns, and most locations with numbers."""
FEW, LETTERS = 7, ((7.0, 4.6), (8.0, 5.5))
"""Number of locations along a side up to which numbers are large, and the font sizes of large and small numbers, first
in a panel of a sheet and then in a large map [points]."""
STROKE, GAP = 0.45, 0.25
"""Half a stroke's length over the distance of locations, and the share that is left free at the location [-]."""
MOST_NAMED = 32
"""Largest number of components whose names are shown."""


def plot_deadband_map(pad_map: PadMap, cavity: CavityGeometry, ax: Axes | None = None) -> Axes:
    """Total length of the deadbands at each location [mm]; the worst location is framed if there is any deadband."""
    dead_mm = pad_map.deadband_grid_mm()
    norm = Normalize(0.0, max(float(np.nanmax(dead_mm)), 1e-9))
    framed = pad_map.worst if pad_map.worst.deadbands_mm else None
    return _plot_map(
        ax, pad_map, cavity, dead_mm, norm, "deadband at this location [mm]", framed, DEAD_COLOURS
    )


def plot_margin_map(
    pad_map: PadMap, cavity: CavityGeometry, ax: Axes | None = None, *, most: float | None = None
) -> Axes:
    """Margin at each location: change of the frame over the least resolved 0.3 mm of depth [noise units].

    The location with the smallest margin is framed.

    Parameters
    ----------
    most : upper end of the colour scale [noise units]; None is the largest margin
    """
    margin = pad_map.grid([place.margin for place in pad_map.places])
    norm = Normalize(0.0, most or float(np.nanmax(margin)) or 1.0)
    label = "margin: least change over 0.3 mm of depth [sigma]"
    return _plot_map(ax, pad_map, cavity, margin, norm, label, pad_map.weakest)


def plot_usable_map(pad_map: PadMap, cavity: CavityGeometry, ax: Axes | None = None) -> Axes:
    """Usable depth [mm]: down to which depth presses are resolved at each location; the worst location is framed."""
    usable = pad_map.usable_grid_mm()
    norm = Normalize(0.0, float(np.nanmax(usable)) or 1.0)
    return _plot_map(ax, pad_map, cavity, usable, norm, "usable depth [mm]", pad_map.weakest)


def plot_detection_map(detection: DetectionThreshold, cavity: CavityGeometry, ax: Axes | None = None) -> Axes:
    """Detection threshold at each location [N]."""
    ax = axes_or_new(ax, _height_in(cavity))
    norm = _log_scale(detection.force_n)
    draw_map(ax, cavity, (detection.x_mm, detection.y_mm), detection.force_n, CHANGE_COLOURS, norm)
    label = f"detection threshold: {detection.threshold:g} sigma in one pair [N]"
    add_scale(ax.get_figure(root=True), [ax], label, CHANGE_COLOURS, norm)
    return ax


def plot_bound_sheet(bounds: PadBounds, cavity: CavityGeometry, quantity: Quantity) -> Figure:
    """Cramér-Rao bound of location or depth as a standard deviation [µm], in one map per depth, side by side."""
    values = UM_PER_MM * (bounds.location_mm if quantity == "location" else bounds.depth_bound_mm)
    figure, panels = map_sheet(cavity, [f"{depth:g} mm deep" for depth in bounds.depth_mm], PANEL_IN)
    norm, lines = _log_scale(values), (bounds.x_mm, bounds.y_mm)
    for layer, ax in enumerate(panels):
        draw_map(ax, cavity, lines, values[:, :, layer], CHANGE_COLOURS, norm)
    add_scale(figure, panels, LABELS[quantity], CHANGE_COLOURS, norm)
    return figure


def plot_pull_sheet(
    draft: Draft, places_mm: FloatArray, depth_mm: Sequence[float], least_n: FloatArray
) -> Figure:
    """Least standard deviation (place, depth) of a sideways force [N] at locations (place, 2), a map for each depth.

    Each point has the value of the nearest location.
    """
    cavity = draft.cavity
    figure, panels = map_sheet(cavity, [f"{depth:.3g} mm deep" for depth in depth_mm], PANEL_IN)
    half = 0.5 * float(np.sort(np.linalg.norm(places_mm[:, None] - places_mm, axis=2), axis=1)[:, 1].mean())
    x, y = (np.linspace(one.min() - half, one.max() + half, FINE) for one in places_mm.T)
    across, along = np.meshgrid(x, y)
    away = np.hypot(across[..., None] - places_mm[:, 0], along[..., None] - places_mm[:, 1])
    nearest = np.where(away.min(axis=2) <= 1.5 * half, away.argmin(axis=2), len(places_mm))
    norm = Normalize(0.0, float(np.nanmax(least_n, initial=0.0)) or 1.0)
    for values, ax in zip(least_n.T, panels, strict=True):
        cells = np.ma.masked_invalid(np.append(values, np.nan)[nearest])
        mesh = ax.pcolormesh(x, y, cells, cmap=CHANGE_COLOURS, norm=norm, rasterized=True)
        clip_to_pad(mesh, ax, cavity)
        _draw_pad(ax, cavity, is_large=False)
        for at, value in zip(places_mm if len(places_mm) <= MOST_WRITTEN else (), values, strict=False):
            if np.isfinite(value):
                ink = _ink_on(CHANGE_COLOURS(float(norm(value))))
                ax.text(
                    float(at[0]),
                    float(at[1]),
                    _number(float(value)),
                    ha="center",
                    va="center",
                    fontsize=LETTERS[0][1],
                    color=ink,
                )
    add_scale(figure, panels, "least sideways force, one frame [N]", CHANGE_COLOURS, norm)
    return figure


def plot_touch_sheet(
    draft: Draft,
    places_mm: FloatArray,
    directions_deg: Sequence[float],
    depth_mm: Sequence[float],
    distance: FloatArray,
    is_resolved: BoolArray,
    least_mm: FloatArray,
) -> Figure:
    """Distance (place, direction, depth) of two tips that touch each other from a single touch, a map for each depth.

    At each location (place, 2) there is a stroke for each direction from one tip to the other [degrees].

    Parameters
    ----------
    distance : [noise deviations]; NaN where two tips have no room
    is_resolved : whether they are resolved as two; strokes of the others are red
    least_mm : least separation at which two tips are resolved [mm]; red strokes are dotted if it is infinite
    """
    figure, panels = map_sheet(draft.cavity, [f"{depth:.2g} mm deep" for depth in depth_mm], PANEL_IN)
    between = np.linalg.norm(places_mm[:, None] - places_mm, axis=2)
    away = between[between > 0.0]
    half = STROKE * float(away.min() if away.size else 2.0 * draft.cavity.tip_radius_mm)
    angle = np.radians(directions_deg)
    ways = half * np.column_stack([np.cos(angle), np.sin(angle)])
    norm = _log_scale(np.where(is_resolved, distance, np.nan))
    for number, ax in enumerate(panels):
        _draw_pad(ax, draft.cavity, is_large=False)
        for (place, direction), value in np.ndenumerate(distance[..., number]):
            if np.isnan(value):
                continue
            state = place, direction, number
            for sign in (-1.0, 1.0):
                ends = places_mm[place] + sign * np.array([[GAP], [1.0]]) * ways[direction]
                style = "-" if np.isfinite(least_mm[state]) else (0, (1, 1))
                colour = CHANGE_COLOURS(float(norm(value))) if is_resolved[state] else VERMILLION
                if is_resolved[state]:
                    ax.plot(*ends.T, color=INK, linewidth=3.2, solid_capstyle="butt")
                ax.plot(*ends.T, color=colour, linestyle=style, linewidth=2.4, solid_capstyle="butt")
    add_scale(figure, panels, "distance of tips that touch each other [sigma]", CHANGE_COLOURS, norm)
    return figure


def map_sheet(cavity: CavityGeometry, titles: Sequence[str], panel_in: float) -> tuple[Figure, list[Axes]]:
    """A figure and its titled axes, for maps side by side with three in a row.

    Parameters
    ----------
    panel_in : width of one map [inch]
    """
    columns = min(COLUMNS, len(titles))
    rows = -(-len(titles) // columns)
    tall = panel_in * cavity.width_mm / cavity.length_mm + 0.45
    figure = Figure(
        figsize=(max(LEAST_WIDTH_IN, panel_in * columns + 0.9), tall * rows), layout="constrained"
    )
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for ax, title in zip(panels, titles, strict=False):
        ax.set_title(title, fontsize=9, color=INK)
    for ax in panels[len(titles) :]:
        ax.set_axis_off()
    return figure, panels[: len(titles)]


def draw_map(
    ax: Axes,
    cavity: CavityGeometry,
    lines: Lines,
    values: FloatArray,
    colours: Colormap,
    norm: Normalize,
    *,
    hatched: BoolArray | None = None,
    is_numbered: bool = True,
    is_large: bool = False,
) -> None:
    """Draw the cells of a map, with the pad's outline and components.

    Parameters
    ----------
    lines : x and y coordinates of the locations [mm]
    values : (ny, nx) values; NaN where there is no cell
    hatched : (ny, nx) cells to hatch; if None, those with infinite values
    is_numbered : whether to write the values into the cells, if they are few enough to be legible
    is_large : whether there is space to draw the components' names and the workspace
    """
    x, y = _edges_mm(lines, cavity)
    known = np.ma.masked_invalid(values)
    mesh = ax.pcolormesh(x, y, known, cmap=colours, norm=norm, edgecolor="white", linewidth=0.5)
    clip_to_pad(mesh, ax, cavity)
    for row, column in np.argwhere(np.isinf(values) if hatched is None else hatched):
        cell = _cell(x, y, int(row), int(column), edgecolor=INK, hatch=HATCH, linewidth=0.0)
        cell.set_facecolor("none" if np.isfinite(values[row, column]) else NONE)
        ax.add_patch(cell)
        clip_to_pad(cell, ax, cavity)
    _draw_pad(ax, cavity, is_large=is_large)
    places = max(values.shape)
    if not is_numbered or places > MOST_NUMBERED:
        return
    letters = LETTERS[is_large][places > FEW]
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            ground = colours(float(norm(value)))
            look: dict[str, Any] = {
                "ha": "center",
                "va": "center",
                "fontsize": letters,
                "color": _ink_on(ground),
                "in_layout": False,  # within the cell, so the layout need not measure it
            }
            box = {"facecolor": ground, "linewidth": 0, "pad": 0.6} if is_large else None
            ax.text(lines[0][column], lines[1][row], _number(float(value)), bbox=box, **look)


def add_scale(
    figure: Figure | None, panels: Sequence[Axes], label: str, colours: Colormap, norm: Normalize
) -> None:
    """Add a colour bar next to the panels; a logarithmic one has ticks at 1, 2 and 5 times powers of ten."""
    assert figure is not None
    assert norm.vmin is not None
    assert norm.vmax is not None
    bar = figure.colorbar(
        ScalarMappable(norm, colours), ax=list(panels), label=label, shrink=0.8, aspect=26, pad=0.02
    )
    if isinstance(norm, LogNorm):
        decades = range(int(np.floor(np.log10(norm.vmin))), int(np.ceil(np.log10(norm.vmax))) + 1)
        ticks = [lead * 10.0**decade for decade in decades for lead in (1, 2, 5)]
        inside = [tick for tick in ticks if norm.vmin <= tick <= norm.vmax]
        bar.set_ticks(inside, labels=[f"{tick:g}" for tick in inside])
        bar.minorticks_off()


def _plot_map(
    ax: Axes | None,
    pad_map: PadMap,
    cavity: CavityGeometry,
    values: FloatArray,
    norm: Normalize,
    label: str,
    framed: Place | None,
    colours: Colormap = CHANGE_COLOURS,
) -> Axes:
    """Draw a large map with its colour bar. The frame around the cell `framed` has the group identifier ``marked``."""
    ax = axes_or_new(ax, _height_in(cavity))
    lines = pad_map.x_mm, pad_map.y_mm
    draw_map(ax, cavity, lines, values, colours, norm, is_large=True)
    add_scale(ax.get_figure(root=True), [ax], label, colours, norm)
    if framed is not None:
        place = pad_map.cells[pad_map.places.index(framed)]
        frame = _cell(*_edges_mm(lines, cavity), *place, fill=False, edgecolor=INK, linewidth=2.2, zorder=4.0)
        frame.set_gid("marked")
        ax.add_patch(frame)
    return ax


def _height_in(cavity: CavityGeometry) -> float:
    return max(2.2, (WIDTH_IN - 1.4) * cavity.width_mm / cavity.length_mm + 0.8)


def _log_scale(values: FloatArray) -> LogNorm:
    known = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (1.0, 10.0)
    return LogNorm(low, max(high, 1.5 * low))


def _edges_mm(lines: Lines, cavity: CavityGeometry) -> tuple[FloatArray, FloatArray]:
    """x and y coordinates of the cells' borders, half-way between locations and within the cavity [mm].

    If there is a single location in one direction, its cell is as wide as the pitch of the other direction.
    """
    space = cavity.workspace
    side = max(space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm, 1.0)
    pitch = next((line[1] - line[0] for line in lines if len(line) > 1), side)
    found = []
    for line, limit in zip(lines, (cavity.length_mm, cavity.width_mm), strict=True):
        step = line[1] - line[0] if len(line) > 1 else pitch
        found.append(np.append(np.array(line) - step / 2, line[-1] + step / 2).clip(0.0, limit))
    return found[0], found[1]


def _cell(x: FloatArray, y: FloatArray, row: int, column: int, **look: Any) -> Rectangle:
    """Rectangle of the cell in this row and column of the grid, from the x and y of all cell borders [mm]."""
    wide, tall = float(x[column + 1] - x[column]), float(y[row + 1] - y[row])
    return Rectangle((float(x[column]), float(y[row])), wide, tall, **look)


def _number(value: float) -> str:
    return f"{value:.0f}" if value == 0.0 or value >= 9.95 else f"{value:.2g}"


def _ink_on(ground: tuple[float, float, float, float]) -> str:
    red, green, blue, _ = ground
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 0.55 else "white"


def _draw_pad(ax: Axes, cavity: CavityGeometry, *, is_large: bool) -> None:
    ax.add_patch(outline_patch(cavity.plan, fill=False, edgecolor=INK, linewidth=1.2 if is_large else 0.8))
    if is_large:
        space = cavity.workspace
        ax.add_patch(workspace_patch(space, fill=False, edgecolor="white", linewidth=1.6))
        inner = workspace_patch(space, fill=False, edgecolor=INK, linewidth=0.8, linestyle=(0, (4, 3)))
        inner.set_gid("workspace")
        ax.add_patch(inner)
    for part in cavity.parts:
        colour = (VERMILLION if part.kind == "emitter" else BLUE) if is_large else MUTED
        named = is_large and len(cavity.parts) <= MOST_NAMED
        draw_part(ax, part, colour, size=5.0 if is_large else 3.5, is_named=named)
    room = (0.10 if is_large else 0.03) * max(cavity.length_mm, cavity.width_mm)
    ax.set_xlim(-room, cavity.length_mm + room)
    ax.set_ylim(-room, cavity.width_mm + room)
    ax.set_aspect("equal")
    ax.spines[["left", "bottom"]].set_visible(False)
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
