# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light with two or more specular reflections at the deformed top.

The rays of `sims.optics.top_light` tell which cells of the top send light to a second reflection and on towards a
receiver. These cells and their neighbours are sampled on a finer lattice, the finer the more light may pass; cells
that send it elsewhere, on a coarse one. Each point takes one part of the emitter, and all parts take turns: the ray
from the part's centre and two more, from its side and from its upper edge, give the parallelogram that the part lights
on the receiver's wall through that point; its share that falls on the receiver counts, so a ray is no hit or miss.
Left out: a feature narrower than a cell that all rays around it miss, and what a part's parallelogram lights beyond the
edge of the wall that its centre meets.
"""

from __future__ import annotations

import math

from sims.optics.diffuse import golden_pair
from sims.optics.polygon import area_and_centroid, cut_to_rectangle
from sims.optics.radial import kernel, radiance, wall_normal, wall_point
from sims.optics.top import surface_gradient, surface_height
from sims.optics.top_grid import place_on_top
from sims.optics.top_light import (
    ALONG,
    AREA,
    CONTACT_RINGS,
    GX,
    GY,
    KIND,
    POWER,
    PX,
    PY,
    PZ,
    SECTOR,
    TOPS,
    U0,
    U1,
    UP,
    V0,
    V1,
    echo,
    first_leg,
)

NEAR_RECEIVER_MM = 2.0
FEWEST, NEAR_FEWEST, MOST = 2, 4, 12
"""Points along each side of a cell whose neighbours reflect again: elsewhere, towards a receiver, and at most."""
PARTS = 3
"""Parts along each side of the emitter. Two convex mirrors spread its light so far that one parallelogram for the whole
of it lost 5 to 15 % of this light, what it threw beyond the edge of a wall."""
EDGE = 0.5
WIDEST_MM = 2.0
"""Farthest from a ray's end that the light of one part is looked for on a receiver."""


@kernel
def overlap_share(s, z, ax, az, bx, bz, low_s, high_s, low_z, high_z, poly, other):
    """Share of the parallelogram centre +- a +- b that lies in a rectangle."""
    whole = 4.0 * abs(ax * bz - az * bx)
    if whole < 1e-9:
        return 1.0 if low_s <= s <= high_s and low_z <= z <= high_z else 0.0
    for c in range(4):
        i = -1.0 if c == 0 or c == 3 else 1.0
        j = -1.0 if c < 2 else 1.0
        poly[c, 0] = s - 0.5 * (low_s + high_s) + i * ax + j * bx
        poly[c, 1] = z - 0.5 * (low_z + high_z) + i * az + j * bz
        poly[c, 2] = 1.0
    n = cut_to_rectangle(4, poly, other, 0.5 * (high_s - low_s), 0.5 * (high_z - low_z))
    if n == 0:
        return 0.0
    area, _, _ = area_and_centroid(n, poly)
    return min(abs(area) / whole, 1.0)


@kernel
def _landing(p, along, up, source, box, top):
    """Power, wall and place, further reflections, nearest one and cosine of arrival of the path from an emitter point
    over p; power 0 if there is none.
    """
    ex, ey, ez = wall_point(int(source[0]), along, up, box)
    if ez >= surface_height(ex, ey, top):
        return 0.0, -1, 0.0, 0.0, 0, 1e30, 1.0
    weight, dx, dy, dz, cos_in = first_leg(p, ex, ey, ez, source, box, top)
    if weight == 0.0:
        return 0.0, -1, 0.0, 0.0, 0, 1e30, 1.0
    kind, x, y, z, dx, dy, dz, left, tops, nearest = echo(p, dx, dy, dz, cos_in, box, top)
    n0, n1 = wall_normal(kind) if 0 <= kind < 4 else (0.0, 0.0)
    return weight * left, kind, (x if kind == 0 or kind == 2 else y), z, tops, nearest, -(dx * n0 + dy * n1)


@kernel
def _reaches(kind, low_s, high_s, low_z, high_z, receivers, wanted):
    """Whether a box on a wall overlaps a wanted receiver."""
    for j in range(receivers.shape[0]):
        if not wanted[j] or receivers[j, 0] != kind:
            continue
        if low_s > receivers[j, 1] + receivers[j, 3] or high_s < receivers[j, 1] - receivers[j, 3]:
            continue
        if low_z > receivers[j, 2] + receivers[j, 4] or high_z < receivers[j, 2] - receivers[j, 4]:
            continue
        return True
    return False


@kernel
def _cell_power(a, b, columns, echoes, receivers, wanted):
    """Largest power of a ray by a cell or a neighbour that is reflected again; 0 if none is.

    Negative (by the same size) where the ends of these rays, with a margin, leave every wanted receiver out.
    """
    brightest = 0.0
    any_power = 0.0
    for wall in range(4):
        low_s = 1e9
        high_s = -1e9
        low_z = 1e9
        high_z = -1e9
        most = 0.0
        for near in range(3):
            c = b if near == 0 else int(columns[b, 2 + near])
            for d in range(max(a - 1, CONTACT_RINGS), min(a + 2, echoes.shape[0])):
                one = echoes[d, c]
                if one[POWER] > 0.0 and one[TOPS] > 0.0:
                    any_power = max(any_power, one[POWER])
                    if one[KIND] == wall:
                        low_s = min(low_s, one[ALONG])
                        high_s = max(high_s, one[ALONG])
                        low_z = min(low_z, one[UP])
                        high_z = max(high_z, one[UP])
                        most = max(most, one[POWER])
        if most > 0.0 and _reaches(
            wall, low_s - NEAR_RECEIVER_MM, high_s + NEAR_RECEIVER_MM, low_z - NEAR_RECEIVER_MM,
            high_z + NEAR_RECEIVER_MM, receivers, wanted,
        ):  # fmt: skip
            brightest = max(brightest, most)
    return brightest if brightest > 0.0 else -any_power


@kernel
def _add_sample(p, one, two, source, receivers, wanted, box, top, poly, other, out):
    """Add a point's light to out[receiver, (outside, inside the skirt)], by the part of the emitter at (one, two)."""
    across = source[3] / PARTS
    height = source[4] / PARTS
    along = source[1] + across * (2.0 * math.floor(PARTS * one) + 1.0 - PARTS)
    up = source[2] + height * (2.0 * math.floor(PARTS * two) + 1.0 - PARTS)
    power, kind, s, z, tops, nearest, facing = _landing(p, along, up, source, box, top)
    if power <= 0.0 or tops == 0 or kind < 0 or kind > 3:
        return
    if not _reaches(kind, s - WIDEST_MM, s + WIDEST_MM, z - WIDEST_MM, z + WIDEST_MM, receivers, wanted):
        return
    side, kind_s, s1, z1, tops_s, _, _ = _landing(p, along + EDGE * across, up, source, box, top)
    above, kind_z, s2, z2, tops_z, _, _ = _landing(p, along, up + EDGE * height, source, box, top)
    ax = az = bx = bz = 0.0
    if side > 0.0 and above > 0.0 and kind_s == kind and kind_z == kind and tops_s == tops and tops_z == tops:
        ax = (s1 - s) / EDGE
        az = (z1 - z) / EDGE
        bx = (s2 - s) / EDGE
        bz = (z2 - z) / EDGE
    for j in range(receivers.shape[0]):
        r = receivers[j]
        if not wanted[j] or r[0] != kind:
            continue
        share = overlap_share(
            s, z, ax, az, bx, bz, r[1] - r[3], r[1] + r[3], r[2] - r[4], r[2] + r[4], poly, other
        )
        if share > 0.0:
            out[j, 1 if nearest < 1.0 else 0] += power * share * math.pi * radiance(r, facing)


@kernel
def repeated_reflections(
    source,
    receivers,
    wanted,
    lattice,
    echoes,
    columns,
    shift_u,
    shift_v,
    turn,
    unit,
    sectors,
    box,
    top,
    p,
    poly,
    other,
    out,
):
    """Add flux of chains with two or more top reflections to out[receiver, (outside, inside the skirt)].

    `turn`, 0 to 1: which part of the emitter the first point takes.
    """
    n = 0
    for a in range(CONTACT_RINGS, lattice.shape[0]):
        for b in range(lattice.shape[1]):
            cell = lattice[a, b]
            power = _cell_power(a, b, columns, echoes, receivers, wanted)
            if power == 0.0:
                continue
            m = FEWEST
            if power > 0.0:
                m = int(min(max(math.ceil(math.sqrt(power / unit)), NEAR_FEWEST), MOST))
            for c in range(m):
                for d in range(m):
                    u = cell[U0] + (c + shift_u) / m * (cell[U1] - cell[U0])
                    v = cell[V0] + (d + shift_v) / m * (cell[V1] - cell[V0])
                    p[PX], p[PY], _, area = place_on_top(int(cell[SECTOR]), u, v, sectors, top)
                    p[AREA] = area * (cell[U1] - cell[U0]) * (cell[V1] - cell[V0]) / (m * m)
                    p[PZ], p[GX], p[GY] = surface_gradient(p[PX], p[PY], top)
                    n += 1
                    one, two = golden_pair(n, turn, turn)
                    _add_sample(p, one, two, source, receivers, wanted, box, top, poly, other, out)
