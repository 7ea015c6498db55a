"""What near walls change of the top, as a smooth field beside the curve of revolution that kernels know.

A press off the middle, or in a small pad, has a surface that no curve of revolution describes: it is zero at the
walls and higher elsewhere. Who knows that surface gives what the walls add to the centred press. The kernels' own
curve ends in a tail beyond its last point (`sims.optics.surface.curves`), which is no part of the surface; the field
takes it away again. So curve and field together are the surface given: up to the grid, and up to the curve's own
choices.

The field is sampled at nodes (`sims.optics.scene.smooth_field`). On the paper's pad at (7, 8) and (16, 6) mm, 1 and 3
mm deep, outside the contact (largest over the four presses; the fields reach 25 to 153 µm, 9 to 54 µm rms):

    spacing    rms error    largest error    where
    1 mm       3.6 µm       80 µm            in the 0.6 mm beside the contact, where the walls' part sets in
    0.5 mm     1.8 µm       43 µm            the same, and 0.2 mm from a wall that is 6 mm from the axis
    0.25 mm    0.3 µm       6 µm             the same

The wall model itself is off by 10 to 18 µm rms to that depth (docs/validation/walls.md). Inside the contact, where
light ends on the tip, the field is not exactly 0: up to 44, 16 and 4 µm just inside the edge.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sims.optics.scene.optical_scene import OpticalScene
from sims.optics.scene.smooth_field import SmoothField, smooth_field
from sims.optics.surface.curves import (
    OFFSET,
    OUTER_R,
    SCALE,
    SPHERE_R,
    START,
    TAIL_MM,
    TOP,
    SurfaceStack,
    stack_surfaces,
)
from sims.optics.surface.radial_table import CELLS
from sims.press.indentation import Indentation

FloatArray = NDArray[np.float64]
Height = Callable[[FloatArray, FloatArray], FloatArray]

SPACING_MM = 0.5


def wall_field(
    wall_height_mm: Height,
    indentation: Indentation,
    at_mm: tuple[float, float],
    scene: OpticalScene,
    spacing_mm: float = SPACING_MM,
) -> SmoothField:
    """The field that makes a curve of revolution the surface of its place.

    Parameters
    ----------
    wall_height_mm : what the walls add to the centred press: (nx, 1) x and (1, ny) y in the cavity frame [mm] to
        (nx, ny) height [mm]; zero inside the contact
    indentation : the centred press
    at_mm : (x, y) of the press axis in the cavity frame [mm]
    scene : the block that it is pressed into
    spacing_mm : of the nodes at most [mm]

    Raises
    ------
    InputError, ModelScopeError : a press that `sims.optics.surface.curves` refuses, or a height that is not finite.
    """
    surfaces = stack_surfaces([indentation], np.array([at_mm]), scene)

    def height_mm(x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        radius = np.hypot(x_mm - at_mm[0], y_mm - at_mm[1])
        return wall_height_mm(x_mm, y_mm) - tail_height_mm(surfaces, 0, radius)

    return smooth_field(height_mm, scene.length_mm, scene.width_mm, spacing_mm)


def tail_height_mm(surfaces: SurfaceStack, state: int, radius_mm: FloatArray) -> FloatArray:
    """(...,) height over the undisturbed top [mm] that a curve has in its tail, at (...,) radii [mm]; 0 elsewhere."""
    outer = surfaces.press[state, OUTER_R]
    in_tail = (radius_mm > outer - TAIL_MM) & (radius_mm < outer)
    return np.where(in_tail, _curve_height_mm(surfaces, state, radius_mm), 0.0)


def _curve_height_mm(surfaces: SurfaceStack, state: int, radius_mm: FloatArray) -> FloatArray:
    """Height over the undisturbed top by the cubic pieces of `sims.optics.surface.radial_table`."""
    first, outer, top, scale, offset, start = surfaces.press[
        state, [SPHERE_R, OUTER_R, TOP, SCALE, OFFSET, START]
    ]
    within = np.clip(radius_mm, first, outer)
    x = np.clip(np.sqrt(scale * within**2 + offset) - start, 0.0, CELLS)
    cell = np.minimum(x.astype(np.int64), CELLS - 1)
    pieces, t = surfaces.pieces[state][cell], x - cell
    height = pieces[..., 0] + t * (pieces[..., 1] + t * (pieces[..., 2] + t * pieces[..., 3]))
    return np.asarray(height - top)
