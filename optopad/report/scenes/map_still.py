"""The maps at a few depths side by side: what the page shows in print and where scripts do not run."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.patches import Patch

from optopad.report.scenes.map_scene import DepthMap, MapScene
from sims.plots.maps import HATCH, add_scale, draw_map, map_sheet
from sims.plots.style import INK

MOST = 6
"""Maps altogether."""
PANEL_IN = 1.45
"""Width of a map [inch]."""


def plot_by_depth(scene: MapScene, one: DepthMap) -> Axes:
    """One quantity at up to six depths, to one scale of colours; hatched as on the page. Returns the first axes."""
    chosen, pad = _chosen(one), scene.pad_map
    depths = [one.depth_mm[layer] for layer in chosen]
    titles = [f"{depth:.2f} mm" if np.isfinite(depth) else one.title for depth in depths]
    figure, panels = map_sheet(scene.cavity, titles, PANEL_IN)
    colours = LinearSegmentedColormap.from_list(one.key, list(one.colours))
    scale = (LogNorm if one.is_logarithmic else Normalize)(one.low, one.high)
    for layer, ax in zip(chosen, panels, strict=True):
        values = pad.grid(one.values[layer].clip(one.low, one.high))
        is_hatched = pad.grid(one.is_hatched[layer] | ~np.isfinite(one.values[layer])) == 1.0
        draw_map(
            ax,
            scene.cavity,
            (pad.x_mm, pad.y_mm),
            values,
            colours,
            scale,
            hatched=is_hatched,
            is_numbered=False,
        )
        ax.set_axis_off()
    if not one.names:
        add_scale(figure, panels, f"{one.title.lower()} [{one.unit}]", colours, scale)
    key = Patch(facecolor="white", edgecolor=INK, hatch=HATCH, label=one.hatched, linewidth=0.5)
    figure.legend(handles=[key], loc="outside lower left")
    return panels[0]


def _chosen(one: DepthMap) -> list[int]:
    """Numbers of evenly spread depths, the deepest one included."""
    count = len(one.depth_mm)
    if count <= MOST:
        return list(range(count))
    wanted = np.linspace(one.depth_mm[0], one.depth_mm[-1], MOST + 1)[1:]
    return sorted({int(np.abs(one.depth_mm - depth).argmin()) for depth in wanted})
