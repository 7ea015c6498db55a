"""Maps over the pad: deadband, and margin to one, at each place of the workspace.

A cell stands for the press at its centre; nothing is interpolated between places. Cells at the border
reach half a pitch beyond the workspace, which is drawn dashed; where the workspace has no place there is no cell.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Rectangle

from design.arrays import FloatArray
from design.geometry.cavity import CavityGeometry, PlacedPart
from sims.plots.shapes.pad_outline import clip_to_pad, outline_patch, workspace_patch
from sims.plots.style import BLUE, INK, MUTED, VERMILLION, WIDTH_IN, axes_or_new
from sims.verdict.pad_map import PadMap, Place

DEAD_COLOURS = LinearSegmentedColormap.from_list("deadband", ["#f7f4ef", "#f2b98a", VERMILLION, "#5c2200"])
CHANGE_COLOURS = LinearSegmentedColormap.from_list("change", ["#f2f6f9", "#9cc9e6", BLUE, "#002e4a"])
MOST_LABELS = 32
"""Parts with their names beside them; more would overlap."""


def plot_deadband_map(pad_map: PadMap, cavity: CavityGeometry, ax: Axes | None = None) -> Axes:
    """Summed deadband at each place [mm], with the worst place framed if there is any deadband."""
    ax = axes_or_new(ax, _height_in(cavity))
    dead_mm = pad_map.deadband_grid_mm()
    deepest = max(float(np.nanmax(dead_mm)), 1e-9)
    _draw_cells(ax, pad_map, cavity, dead_mm, DEAD_COLOURS, (0.0, deepest), "deadband at this place [mm]")
    _draw_pad(ax, cavity)
    if pad_map.worst.deadbands_mm:
        _mark(ax, pad_map.worst, pad_map, cavity)
    return ax


def plot_margin_map(
    pad_map: PadMap, cavity: CavityGeometry, ax: Axes | None = None, *, most: float | None = None
) -> Axes:
    """Distance of frames over the least told 0.3 mm of depth [noise units]; the weakest place framed.

    Parameters
    ----------
    most : end of the colours [noise units]; None for the largest margin
    """
    ax = axes_or_new(ax, _height_in(cavity))
    margin = pad_map.grid([place.margin for place in pad_map.places])
    label = "frames apart over the least told 0.3 mm [noise units]"
    high = most or float(np.nanmax(margin)) or 1.0
    _draw_cells(ax, pad_map, cavity, margin, CHANGE_COLOURS, (0.0, high), label)
    _draw_pad(ax, cavity)
    _mark(ax, pad_map.weakest, pad_map, cavity)
    return ax


def plot_usable_map(pad_map: PadMap, cavity: CavityGeometry, ax: Axes | None = None) -> Axes:
    """Depth to which each place tells depth [mm]; the weakest place framed."""
    ax = axes_or_new(ax, _height_in(cavity))
    usable = pad_map.usable_grid_mm()
    high = float(np.nanmax(usable)) or 1.0
    _draw_cells(ax, pad_map, cavity, usable, CHANGE_COLOURS, (0.0, high), "usable depth [mm]")
    _draw_pad(ax, cavity)
    _mark(ax, pad_map.weakest, pad_map, cavity)
    return ax


def _height_in(cavity: CavityGeometry) -> float:
    return max(2.2, (WIDTH_IN - 1.4) * cavity.width_mm / cavity.length_mm + 0.8)


def _draw_cells(
    ax: Axes,
    pad_map: PadMap,
    cavity: CavityGeometry,
    values: FloatArray,
    colours: LinearSegmentedColormap,
    span: tuple[float, float],
    label: str,
) -> None:
    pitch = _pitch_mm(pad_map, cavity)
    mesh = ax.pcolormesh(
        _edges_mm(pad_map.x_mm, pitch, cavity.length_mm),
        _edges_mm(pad_map.y_mm, pitch, cavity.width_mm),
        values,
        cmap=colours,
        norm=Normalize(*span),
        edgecolor="white",
        linewidth=0.5,
    )
    clip_to_pad(mesh, ax, cavity)
    assert ax.figure is not None
    ax.figure.colorbar(mesh, ax=ax, label=label, shrink=0.75, aspect=24, pad=0.02)
    size = 8.0 if max(len(pad_map.x_mm), len(pad_map.y_mm)) <= 7 else 5.5
    for row, column in pad_map.cells:
        value = values[row, column]
        share = (float(value) - span[0]) / (span[1] - span[0])
        ax.text(
            pad_map.x_mm[column],
            pad_map.y_mm[row],
            _number(float(value), size),
            ha="center",
            va="center",
            fontsize=size,
            color="white" if share > 0.55 else INK,
            bbox={"facecolor": colours(share), "linewidth": 0, "pad": 0.6},
        )


def _number(value: float, size: float) -> str:
    if value == 0.0 or value >= 20.0:
        return f"{value:.0f}"
    return f"{value:.2f}" if size > 6 else f"{value:.1f}"


def _pitch_mm(pad_map: PadMap, cavity: CavityGeometry) -> float:
    """Distance of neighbouring places; with one place only, the side of the workspace [mm]."""
    for lines in (pad_map.x_mm, pad_map.y_mm):
        if len(lines) > 1:
            return lines[1] - lines[0]
    space = cavity.workspace
    return max(space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm, 1.0)


def _edges_mm(lines: tuple[float, ...], pitch_mm: float, side_mm: float) -> FloatArray:
    """Cell borders half-way between places, kept inside the cavity [mm]."""
    centres = np.array(lines)
    step = centres[1] - centres[0] if len(centres) > 1 else pitch_mm
    edges: FloatArray = np.append(centres - step / 2, centres[-1] + step / 2).clip(0.0, side_mm)
    return edges


def _draw_pad(ax: Axes, cavity: CavityGeometry) -> None:
    space = cavity.workspace
    ax.add_patch(outline_patch(cavity.plan, fill=False, edgecolor=INK, linewidth=1.2))
    ax.add_patch(workspace_patch(space, fill=False, edgecolor="white", linewidth=1.6))
    inner = workspace_patch(space, fill=False, edgecolor=INK, linewidth=0.8, linestyle=(0, (4, 3)))
    inner.set_gid("workspace")
    ax.add_patch(inner)
    for part in cavity.parts:
        _draw_part(ax, part, cavity)
    room = 0.10 * max(cavity.length_mm, cavity.width_mm)
    ax.set_xlim(-room, cavity.length_mm + room)
    ax.set_ylim(-room, cavity.width_mm + room)
    ax.set_aspect("equal")
    ax.spines[["left", "bottom"]].set_visible(False)
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")


def _draw_part(ax: Axes, part: PlacedPart, cavity: CavityGeometry) -> None:
    x, y, _ = part.position_mm
    is_emitter = part.kind == "emitter"
    ax.plot(
        x,
        y,
        marker="o" if is_emitter else "s",
        markersize=5,
        color=VERMILLION if is_emitter else BLUE,
        markeredgecolor="white",
        clip_on=False,
        zorder=5,
    )
    if len(cavity.parts) <= MOST_LABELS:
        right, up = part.line.outward
        reach = 0.05 * max(cavity.length_mm, cavity.width_mm)
        ax.text(
            x + right * reach, y + up * reach, part.name, ha="center", va="center", fontsize=6.5, color=MUTED
        )


def _mark(ax: Axes, place: Place, pad_map: PadMap, cavity: CavityGeometry) -> None:
    """A frame around one place's cell, with the group identifier ``marked``."""
    pitch = _pitch_mm(pad_map, cavity)
    x_mm = _edges_mm(pad_map.x_mm, pitch, cavity.length_mm)
    y_mm = _edges_mm(pad_map.y_mm, pitch, cavity.width_mm)
    row, column = pad_map.cells[pad_map.places.index(place)]
    corner, size = (x_mm[column], y_mm[row]), (np.diff(x_mm)[column], np.diff(y_mm)[row])
    frame = Rectangle(corner, *size, fill=False, edgecolor=INK, linewidth=2.2, zorder=4)
    frame.set_gid("marked")
    ax.add_patch(frame)
