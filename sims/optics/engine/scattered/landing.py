"""Kernels: where light from one point of an emitter ends after it met one point of the deformed top."""

from __future__ import annotations

from design.arrays import FloatArray
from sims.optics.engine.scattered.top_light import AREA, GX, GY, PX, PY, PZ, echo, first_leg
from sims.optics.surface.radial import kernel, wall_normal, wall_point
from sims.optics.surface.top import Top, surface_gradient, surface_height
from sims.optics.surface.top_grid import place_on_top


@kernel
def put_point(p: FloatArray, sector: int, u: float, v: float, sectors: FloatArray, top: Top) -> None:
    """Fill a lattice row with a point of the top and the plan area of a unit of (u, v) there."""
    p[PX], p[PY], _, p[AREA] = place_on_top(sector, u, v, sectors, top)
    p[PZ], p[GX], p[GY] = surface_gradient(p[PX], p[PY], top)


@kernel
def landing(
    p: FloatArray, along: float, up: float, source: FloatArray, box: FloatArray, top: Top
) -> tuple[float, int, float, float, int, float, float]:
    """Power, wall and place, further reflections, nearest one and cosine of arrival of the path from an emitter point
    over p; power 0 if there is none.
    """
    ex, ey, ez = wall_point(int(source[0]), along, up, box)
    if ez >= surface_height(ex, ey, top):
        return 0.0, -1, 0.0, 0.0, 0, 1e30, 1.0
    weight, dx, dy, dz, cos_in = first_leg(p, ex, ey, ez, source, box, top, 0.0, 0.0)
    if weight == 0.0:
        return 0.0, -1, 0.0, 0.0, 0, 1e30, 1.0
    kind, x, y, z, dx, dy, dz, left, tops, nearest = echo(p, dx, dy, dz, cos_in, box, top)
    n0, n1 = wall_normal(kind) if 0 <= kind < 4 else (0.0, 0.0)
    return weight * left, kind, (x if kind == 0 or kind == 2 else y), z, tops, nearest, -(dx * n0 + dy * n1)


@kernel
def unit_there(
    kind: int, low_s: float, high_s: float, low_z: float, high_z: float, receivers: FloatArray, units: FloatArray,
) -> float:  # fmt: skip
    """The smallest unit of the receivers that a box on a wall overlaps; 0 if none with one."""
    least = 0.0
    for j in range(receivers.shape[0]):
        if units[j] == 0.0 or receivers[j, 0] != kind or (least > 0.0 and units[j] >= least):
            continue
        if low_s > receivers[j, 1] + receivers[j, 3] or high_s < receivers[j, 1] - receivers[j, 3]:
            continue
        if low_z > receivers[j, 2] + receivers[j, 4] or high_z < receivers[j, 2] - receivers[j, 4]:
            continue
        least = units[j]
    return least
