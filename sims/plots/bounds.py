"""Maps of what a pad can tell: bounds of place and depth at each depth of the grid, and the lightest press felt.

A cell stands for the voxel at its centre; nothing is interpolated. All depths share one logarithmic scale, so that they
compare; blind voxels are hatched, and where the workspace has no place there is no cell. Numbers in the cells are
micrometres, or newtons for the press.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from design.arrays import FloatArray
from design.geometry.cavity import CavityGeometry
from sims.bounds.felt import FeltForce
from sims.bounds.observability import PadBounds
from sims.plots.shapes.pad_outline import clip_to_pad, outline_patch
from sims.plots.style import BLUE, INK, MUTED, WIDTH_IN, axes_or_new

Quantity = Literal["location", "depth"]

BOUND_COLOURS = LinearSegmentedColormap.from_list("bound", ["#f2f6f9", "#9cc9e6", BLUE, "#002e4a"])
UM_PER_MM = 1000.0
PANEL_COLUMNS = 3
PANEL_IN = 2.9
LABELS = {"location": "location bound, one frame [µm]", "depth": "depth bound, place unknown, one frame [µm]"}
MOST_NUMBERED = 13
"""Places along a side with numbers in their cells; more would not be legible."""


def plot_bound_sheet(bounds: PadBounds, cavity: CavityGeometry, quantity: Quantity) -> Figure:
    """One map a depth, side by side, on one scale."""
    count = len(bounds.depth_mm)
    columns = min(PANEL_COLUMNS, count)
    rows = -(-count // columns)
    tall = PANEL_IN * cavity.width_mm / cavity.length_mm
    figure = Figure(figsize=(PANEL_IN * columns + 0.9, (tall + 0.45) * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    norm = _scale(_values(bounds, quantity))
    for layer, ax in enumerate(panels[:count]):
        _draw_layer(ax, bounds, cavity, quantity, layer, norm)
        ax.set_title(f"{bounds.depth_mm[layer]:g} mm deep", fontsize=9, color=INK)
    for ax in panels[count:]:
        ax.set_axis_off()
    _add_scale(figure, list(panels[:count]), LABELS[quantity], norm)
    return figure


def plot_bound_map(
    bounds: PadBounds, cavity: CavityGeometry, quantity: Quantity, layer: int, ax: Axes | None = None
) -> Axes:
    """One depth: least standard deviation of place or depth [µm]; the scale is that of all depths."""
    ax = axes_or_new(ax, (WIDTH_IN - 1.4) * cavity.width_mm / cavity.length_mm + 0.8)
    norm = _scale(_values(bounds, quantity))
    _draw_layer(ax, bounds, cavity, quantity, layer, norm)
    _add_scale(ax.get_figure(root=True), [ax], LABELS[quantity], norm)
    return ax


def plot_felt_map(felt: FeltForce, cavity: CavityGeometry, ax: Axes | None = None) -> Axes:
    """Lightest press that the pad answers to, place by place [N]."""
    ax = axes_or_new(ax, (WIDTH_IN - 1.4) * cavity.width_mm / cavity.length_mm + 0.8)
    norm = _scale(felt.force_n)
    _draw_cells(ax, felt.x_mm, felt.y_mm, cavity, felt.force_n, norm)
    label = f"lightest press felt: {felt.threshold:g} noise units in a pair [N]"
    _add_scale(ax.get_figure(root=True), [ax], label, norm)
    return ax


def _add_scale(figure: Figure | None, panels: list[Axes], label: str, norm: LogNorm) -> None:
    """A colour bar beside the panels, with ticks at 1, 2 and 5 times powers of ten as plain numbers."""
    assert figure is not None
    assert norm.vmin is not None
    assert norm.vmax is not None
    decades = range(int(np.floor(np.log10(norm.vmin))), int(np.ceil(np.log10(norm.vmax))) + 1)
    ticks = [lead * 10.0**decade for decade in decades for lead in (1, 2, 5)]
    inside = [tick for tick in ticks if norm.vmin <= tick <= norm.vmax]
    bar = figure.colorbar(
        ScalarMappable(norm, BOUND_COLOURS), ax=panels, label=label, shrink=0.8, aspect=28, pad=0.02
    )
    bar.set_ticks(inside, labels=[f"{tick:g}" for tick in inside])
    bar.minorticks_off()


def _values(bounds: PadBounds, quantity: Quantity) -> FloatArray:
    """(ny, nx, nd) [µm]."""
    return UM_PER_MM * (bounds.location_mm if quantity == "location" else bounds.depth_bound_mm)


def _scale(values: FloatArray) -> LogNorm:
    known = values[np.isfinite(values) & (values > 0.0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (1.0, 10.0)
    return LogNorm(low, max(high, 1.5 * low))


def _draw_layer(
    ax: Axes, bounds: PadBounds, cavity: CavityGeometry, quantity: Quantity, layer: int, norm: LogNorm
) -> None:
    values = _values(bounds, quantity)[:, :, layer]
    _draw_cells(ax, bounds.x_mm, bounds.y_mm, cavity, values, norm)


def _draw_cells(
    ax: Axes,
    x_mm: tuple[float, ...],
    y_mm: tuple[float, ...],
    cavity: CavityGeometry,
    values: FloatArray,
    norm: LogNorm,
) -> None:
    x_edges, y_edges = _edges_mm(x_mm, cavity.length_mm), _edges_mm(y_mm, cavity.width_mm)
    known = np.ma.masked_invalid(values)
    mesh = ax.pcolormesh(
        x_edges, y_edges, known, cmap=BOUND_COLOURS, norm=norm, edgecolor="white", linewidth=0.5
    )
    clip_to_pad(mesh, ax, cavity)
    for (row, column), value in np.ndenumerate(values):
        if np.isinf(value):
            blind = _hatch(ax, x_edges[column : column + 2], y_edges[row : row + 2])
            clip_to_pad(blind, ax, cavity)
    if max(values.shape) <= MOST_NUMBERED:
        _write_numbers(ax, x_mm, y_mm, values, norm)
    _draw_outline(ax, cavity)


def _hatch(ax: Axes, x_mm: FloatArray, y_mm: FloatArray) -> Patch:
    return ax.add_patch(
        Rectangle(
            (x_mm[0], y_mm[0]),
            x_mm[1] - x_mm[0],
            y_mm[1] - y_mm[0],
            facecolor="white",
            edgecolor=MUTED,
            hatch="////",
            linewidth=0.3,
        )
    )


def _write_numbers(
    ax: Axes,
    x_mm: tuple[float, ...],
    y_mm: tuple[float, ...],
    values: FloatArray,
    norm: LogNorm,
) -> None:
    size = 7.0 if max(values.shape) <= 7 else 4.6
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = _ink_on(BOUND_COLOURS, float(norm(value)))
            ax.text(
                x_mm[column],
                y_mm[row],
                _number(float(value)),
                ha="center",
                va="center",
                fontsize=size,
                color=colour,
            )


def _number(value: float) -> str:
    """Two digits that count."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def _ink_on(colours: Colormap, share: float) -> str:
    red, green, blue, _ = colours(share)
    return INK if 0.299 * red + 0.587 * green + 0.114 * blue > 0.55 else "white"


def _draw_outline(ax: Axes, cavity: CavityGeometry) -> None:
    ax.add_patch(outline_patch(cavity.plan, fill=False, edgecolor=MUTED))
    ax.set_xlim(-0.5, cavity.length_mm + 0.5)
    ax.set_ylim(-0.5, cavity.width_mm + 0.5)
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    for part in cavity.parts:
        x, y, _ = part.position_mm
        marker = "o" if part.kind == "emitter" else "s"
        ax.plot(x, y, marker=marker, markersize=4, color=MUTED, markeredgecolor="white", clip_on=False)


def _edges_mm(centres_mm: tuple[float, ...], span_mm: float) -> FloatArray:
    """(n + 1,) cell borders half-way between centres; the outer ones as far out again."""
    centres = np.asarray(centres_mm)
    if centres.size == 1:
        half = 0.25 * span_mm
        return np.array([centres[0] - half, centres[0] + half])
    steps = 0.5 * np.diff(centres)
    return np.concatenate([[centres[0] - steps[0]], centres[:-1] + steps, [centres[-1] + steps[-1]]])
