# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: light with two or more specular reflections at the deformed top.

First reflections whose light goes to a second one and on towards a receiver lie in small islands of the top. The rays
of `sims.optics.top_light` tell roughly where, `repeated_cells` divides the cells there, and every cell that is left
brings one point a replicate. Each point takes one part of the emitter, and all parts take turns: the ray from the
part's centre and two more, from its side and from its upper edge, give the parallelogram that the part lights on the
receiver's wall through that point; its share that falls on the receiver counts, so a ray is no hit or miss.
Left out: an island that the rays of all replicates miss, and what a part's parallelogram lights beyond the edge of the
wall that its centre meets.
"""

from __future__ import annotations

import math

import numpy as np

from sims.optics.diffuse import golden_pair
from sims.optics.landing import landing, put_point, reaches
from sims.optics.polygon import area_and_centroid, cut_to_rectangle
from sims.optics.radial import array_kernel, kernel, radiance
from sims.optics.repeated_cells import (
    CELL_COLUMNS,
    DIVIDE,
    EDGE,
    HIGH_U,
    HIGH_V,
    KEEP,
    LOW_U,
    LOW_V,
    STACK,
    UNKNOWN,
    WIDEST_MM,
    blur_of,
    divide,
    fate_of,
    power_near,
    put_first,
)
from sims.optics.top_light import AREA, CONTACT_RINGS, ECHO_COLUMNS, SECTOR, U0, U1, V0, V1

PARTS = 3
"""Parts along each side of the emitter. Two convex mirrors spread its light so far that one parallelogram for the whole
of it lost 5 to 15 % of this light, what it threw beyond the edge of a wall."""
PART_REACH_MM = 2.0
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
def add_sample(p, one, two, source, receivers, wanted, box, top, poly, other, out):
    """Add a point's light to out[receiver, (outside, inside the skirt)], by the part of the emitter at (one, two)."""
    across = source[3] / PARTS
    height = source[4] / PARTS
    along = source[1] + across * (2.0 * math.floor(PARTS * one) + 1.0 - PARTS)
    up = source[2] + height * (2.0 * math.floor(PARTS * two) + 1.0 - PARTS)
    power, kind, s, z, tops, nearest, facing = landing(p, along, up, source, box, top)
    if power <= 0.0 or tops == 0 or kind < 0 or kind > 3:
        return
    if not reaches(
        kind, s - PART_REACH_MM, s + PART_REACH_MM, z - PART_REACH_MM, z + PART_REACH_MM, receivers, wanted
    ):
        return
    side, kind_s, s1, z1, tops_s, _, _ = landing(p, along + EDGE * across, up, source, box, top)
    above, kind_z, s2, z2, tops_z, _, _ = landing(p, along, up + EDGE * height, source, box, top)
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
def add_samples(
    cell, sector, count, source, receivers, wanted, shifts, sectors, box, top, p, poly, other, out
):
    """Add a cell's light to out[replicate, receiver, (outside, inside the skirt)], by one point a replicate."""
    for n in range(shifts.shape[0]):
        u = cell[LOW_U] + shifts[n, 0] * (cell[HIGH_U] - cell[LOW_U])
        v = cell[LOW_V] + shifts[n, 1] * (cell[HIGH_V] - cell[LOW_V])
        put_point(p, sector, u, v, sectors, top)
        p[AREA] *= (cell[HIGH_U] - cell[LOW_U]) * (cell[HIGH_V] - cell[LOW_V])
        one, two = golden_pair(count, shifts[n, 2], shifts[n, 2])
        add_sample(p, one, two, source, receivers, wanted, box, top, poly, other, out[n])


@array_kernel
def repeated_reflections(
    source, receivers, wanted, lattice, echoes, columns, shifts, unit, sectors, box, top, p, poly, other, out
):
    """Add flux of chains with two or more top reflections to out[replicate, receiver, (outside, inside the skirt)].

    lattice, echoes : a replicate's lattice, and (replicate, row, column, 5) ends of the rays over their points
    shifts : (replicate, 3 or more) place in a cell along u and v, and which part of the emitter comes first, 0 to 1
    unit : power that a sample may stand for
    """
    rings = lattice.shape[0] - CONTACT_RINGS
    known = np.full((rings + 1, lattice.shape[1], ECHO_COLUMNS), UNKNOWN)
    cells = np.empty((STACK, CELL_COLUMNS))
    nine = np.empty((3, 3, ECHO_COLUMNS))
    count = 0
    for a in range(rings):
        for b in range(lattice.shape[1]):
            unseen = power_near(a + CONTACT_RINGS, b, columns, echoes, receivers, wanted)
            if unseen < 0.0:
                continue
            root = lattice[a + CONTACT_RINGS, b]
            sector = int(root[SECTOR])
            put_first(cells[0], (sector, root[U0], root[U1], root[V0], root[V1]), int(columns[b, 4]), a, b, known,
                      source, sectors, box, top, p)  # fmt: skip
            blur = WIDEST_MM
            if fate_of(cells[0], unit, blur, unseen, receivers, wanted) == DIVIDE:
                blur = blur_of(cells[0], sector, source, sectors, box, top, p)
            n = 1
            while n > 0:
                n -= 1
                fate = fate_of(cells[n], unit, blur, unseen, receivers, wanted)
                if fate == DIVIDE:
                    divide(cells, n, sector, source, sectors, box, top, p, nine)
                    n += 4
                elif fate == KEEP:
                    count += 1
                    add_samples(cells[n], sector, count, source, receivers, wanted, shifts, sectors, box, top, p, poly,
                                other, out)  # fmt: skip
