"""The maps at a few depths side by side: what the page shows in print and where scripts do not run."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from optopad.report.scenes.map_scene import DepthMap, MapScene
from sims.plots.shapes.pad_outline import clip_to_pad, outline_patch
from sims.plots.style import INK, MUTED, WIDTH_IN

COLUMNS, MOST = 3, 6
"""Maps in a row, and altogether."""
TITLE_IN, LEGEND_IN, BAR_IN = 0.28, 0.34, 0.95
"""Room above each map, below all, and to the right for the scale [inch]."""
NONE = "#e4e7eb"
HATCH = "////"


def plot_by_depth(scene: MapScene, one: DepthMap) -> Axes:
    """One quantity at up to six depths, to one scale of colours; hatched as on the page. Returns the first axes."""
    chosen, cavity = _chosen(one), scene.cavity
    rows = -(-len(chosen) // COLUMNS)
    wide = (WIDTH_IN - BAR_IN) / COLUMNS
    tall = wide * cavity.width_mm / cavity.length_mm
    size = WIDTH_IN, rows * (tall + TITLE_IN) + LEGEND_IN
    figure = Figure(figsize=size)
    colours = LinearSegmentedColormap.from_list(one.key, list(one.colours))
    scale = (LogNorm if one.is_logarithmic else Normalize)(one.low, one.high)
    for number, layer in enumerate(chosen):
        row, column = divmod(number, COLUMNS)
        corner = column * wide, size[1] - (row + 1) * (tall + TITLE_IN)
        ax = figure.add_axes((corner[0] / size[0], corner[1] / size[1], wide / size[0], tall / size[1]))
        _draw(ax, scene, one, layer, colours, scale)
    if not one.names:
        left, low = min(COLUMNS, len(chosen)) * wide + 0.1, LEGEND_IN + 0.05
        bar = figure.add_axes(
            (left / size[0], low / size[1], 0.1 / size[0], (size[1] - low - TITLE_IN) / size[1])
        )
        label = f"{one.title.lower()} [{one.unit}]"
        figure.colorbar(ScalarMappable(scale, colours), cax=bar).set_label(label, fontsize=8)
    figure.legend(
        handles=[Patch(facecolor="white", edgecolor=INK, hatch=HATCH, label=one.hatched, linewidth=0.5)],
        loc="lower left",
        bbox_to_anchor=(0.0, 0.0),
        borderaxespad=0.2,
    )
    return figure.axes[0]


def _chosen(one: DepthMap) -> list[int]:
    """Numbers of evenly spread depths, the deepest one included."""
    count = len(one.depth_mm)
    if count <= MOST:
        return list(range(count))
    wanted = np.linspace(one.depth_mm[0], one.depth_mm[-1], MOST + 1)[1:]
    return sorted({int(np.abs(one.depth_mm - depth).argmin()) for depth in wanted})


def _draw(
    ax: Axes,
    scene: MapScene,
    one: DepthMap,
    layer: int,
    colours: LinearSegmentedColormap,
    scale: Normalize,
) -> None:
    cavity, pad = scene.cavity, scene.pad_map
    x, y = (
        _edges(lines, scene.pitch_mm, side)
        for lines, side in ((pad.x_mm, cavity.length_mm), (pad.y_mm, cavity.width_mm))
    )
    for number, (value, (row, column)) in enumerate(zip(one.values[layer], pad.cells, strict=True)):
        corner, size = (x[column], y[row]), (x[column + 1] - x[column], y[row + 1] - y[row])
        known = bool(np.isfinite(value))
        colour = colours(float(scale(min(max(float(value), one.low), one.high)))) if known else NONE
        drawn = [Rectangle(corner, *size, facecolor=colour, edgecolor="white", linewidth=0.4)]
        if one.is_hatched[layer][number] or not known:
            drawn.append(Rectangle(corner, *size, facecolor="none", edgecolor=INK, hatch=HATCH, linewidth=0))
        for cell in drawn:
            ax.add_patch(cell)
            clip_to_pad(cell, ax, cavity)
    side = cavity.length_mm, cavity.width_mm
    ax.add_patch(outline_patch(cavity.plan, fill=False, edgecolor=MUTED, linewidth=0.8))
    ax.set_xlim(-0.5, side[0] + 0.5)
    ax.set_ylim(-0.5, side[1] + 0.5)
    ax.set_aspect("equal")
    ax.set_axis_off()
    depth = one.depth_mm[layer]
    ax.set_title(f"{depth:.2f} mm" if np.isfinite(depth) else one.title, fontsize=8, color=INK, pad=2)


def _edges(lines: tuple[float, ...], pitch_mm: float, side_mm: float) -> list[float]:
    """Borders of the cells, half-way between places and inside the cavity [mm]."""
    step = lines[1] - lines[0] if len(lines) > 1 else pitch_mm
    found = [*(line - step / 2 for line in lines), lines[-1] + step / 2]
    return [min(max(edge, 0.0), side_mm) for edge in found]
