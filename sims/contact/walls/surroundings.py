"""What the walls of a rectangular pad change of a press at one place, from its loads: linear elasticity.

With loads q of the press (`far_press`), G the top of a layer under them, and ρ the round pad it was solved in,

    D = Σ q (G_block - G_ρ) = Σ q (G_wide + C - G_ρ),

where C is what the block adds when its walls undo what the loads move in a wide layer (`block_layer`): smooth in the
whole pad, though every G is steep at the axis. Lengths in tip radii.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import RectBivariateSpline

from design.arrays import FloatArray
from sims.contact.walls.block_layer import BlockLayer, Size, block_layer
from sims.contact.walls.far_press import load_fields, wide_fields
from sims.contact.walls.round_layer import LayerField

MOST_PLACES = 4096
"""Places of a pad that are remembered: 10 kB each."""


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """The loads' answers between the walls of one place.

    Attributes
    ----------
    at : x and y of the axis from the pad's corner
    block : the pad
    added : (load, nx, ny) C on the block's nodes
    wide, round_pad : the loads in a wide layer and in the round pad
    """

    at: tuple[float, float]
    block: BlockLayer
    added: FloatArray
    wide: tuple[LayerField, ...]
    round_pad: tuple[LayerField, ...]

    @cached_property
    def on_axis(self) -> FloatArray:
        """(load,) D on the axis for a unit of each load."""
        zero = np.zeros(1)
        splines = [RectBivariateSpline(self.block.x, self.block.y, one) for one in self.added]
        return np.array(
            [
                spline.ev(*self.at) + wide.top_at(zero)[0] - near.top_at(zero)[0]
                for spline, wide, near in zip(splines, self.wide, self.round_pad, strict=True)
            ]
        )

    def change(self, amplitudes: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
        """(nx, ny) D of loads (load,) at places x (nx,) and y (ny,) from the pad's corner, in its walls."""
        spline = RectBivariateSpline(self.block.x, self.block.y, np.tensordot(amplitudes, self.added, axes=1))
        radius = np.hypot(x[:, None] - self.at[0], y[None, :] - self.at[1])
        change = np.asarray(spline(x, y), dtype=np.float64)
        for size, wide, near in zip(amplitudes, self.wide, self.round_pad, strict=True):
            change += size * (wide.top_at(radius) - near.top_at(radius))
        return change


def surroundings(layer: float, wall: float, size: Size, at: tuple[float, float]) -> Surroundings:
    """The walls of a pad around a place; those of the last pads are remembered, place by place.

    Parameters
    ----------
    layer : depth of the layer
    wall : radius of the round pad that the press was solved in
    size, at : length and width of the pad, and x, y of the axis from its corner
    """
    places = _places(layer, wall, size)
    if at not in places:
        if len(places) >= MOST_PLACES:
            places.clear()
        places[at] = _found(layer, wall, size, at)
    return places[at]


@lru_cache(maxsize=4)
def _places(layer: float, wall: float, size: Size) -> dict[tuple[float, float], Surroundings]:  # noqa: ARG001
    """What is known of a pad: dropped whole, so that a long row of pads keeps no more than the last ones."""
    return {}


def _found(layer: float, wall: float, size: Size, at: tuple[float, float]) -> Surroundings:
    block, wide = block_layer(layer, size), wide_fields(layer)
    images = [
        [_from(block.wall_nodes, (x, y)) for y in (at[1], size[1] - at[1])] for x in (at[0], size[0] - at[0])
    ]
    added = np.stack(
        [block.top(-np.stack([[_moved(field, *far) for far in row] for row in images])) for field in wide]
    )
    return Surroundings(at=at, block=block, added=added, wide=wide, round_pad=load_fields(layer, wall))


def _from(nodes: FloatArray, at: tuple[float, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Radius (n,), direction (2, n) and height (n,) of nodes from an axis."""
    way = nodes[:, :2].T - np.array(at)[:, None]
    radius = np.hypot(*way)
    return radius, way / radius, nodes[:, 2]


def _moved(field: LayerField, radius: FloatArray, direction: FloatArray, height: FloatArray) -> FloatArray:
    """(3, n) displacement at places."""
    outward, upward = field.at(radius, height)
    return np.stack([*(outward * direction), upward])
