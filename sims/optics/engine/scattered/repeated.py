"""Kernels: light with two or more specular reflections at the deformed top.

First reflections whose light goes to a second one and on towards a receiver lie in small islands of the top. The rays
of `sims.optics.engine.scattered.top_light` tell roughly where, `repeated_cells` divides the cells there, and every
cell that is left brings one point a replicate, or more by its power, each with three rays from points evenly spread
over the emitter, moved from point to point.

A ray counts where it ends. Once it stood for the parallelogram that a part of the emitter lights, by the rays beside
it; but two convex mirrors bend light within any part, which made this light 75 % too bright on one pair and 15 % too
dark on others, whatever the setting, and its scatter was no less. Left out: an island that the rays of all replicates
miss.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from sims.optics.engine.scattered.diffuse import golden_pair, receiver_at
from sims.optics.engine.scattered.landing import landing, put_point
from sims.optics.engine.scattered.repeated_cells import (
    CELL_COLUMNS,
    DIVIDE,
    HIGH_U,
    HIGH_V,
    KEEP,
    LOW_U,
    LOW_V,
    STACK,
    UNKNOWN,
    divide,
    fate_of,
    power_near,
    put_first,
)
from sims.optics.engine.scattered.top_light import AREA, ECHO_COLUMNS, SECTOR, U0, U1, V0, V1, first_free_row
from sims.optics.surface.radial import array_kernel, kernel, radiance
from sims.optics.surface.top import Top

RAYS = 3
"""Rays of a sample, from points of the emitter that lie evenly spread over it."""


@kernel
def add_sample(
    p: FloatArray, one: float, two: float, source: FloatArray, receivers: FloatArray, units: FloatArray,
    box: FloatArray, top: Top, out: FloatArray,
) -> None:  # fmt: skip
    """Add a point's light to out[receiver, (outside, inside the skirt)], by rays from the emitter at (one, two) and
    beside it, which counts round its edges.
    """
    for k in range(RAYS):
        a = one + k / RAYS
        b = two + (RAYS - 1) * k / RAYS
        along = source[1] + source[3] * (2.0 * (a - math.floor(a)) - 1.0)
        up = source[2] + source[4] * (2.0 * (b - math.floor(b)) - 1.0)
        power, kind, s, z, tops, nearest, facing = landing(p, along, up, source, box, top)
        if power <= 0.0 or tops == 0 or kind < 0 or kind > 3:
            continue
        j = receiver_at(kind, s, s, z, receivers)
        if j >= 0 and units[j] > 0.0:
            share = power * math.pi * radiance(receivers[j], facing) / RAYS
            out[j, 1 if nearest < 1.0 else 0] += share


@kernel
def add_samples(
    cell: FloatArray, parts: int, sector: int, count: int, source: FloatArray, receivers: FloatArray,
    units: FloatArray, shifts: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, p: FloatArray,
    out: FloatArray,
) -> int:  # fmt: skip
    """Add a cell's light to out[replicate, receiver, (outside, inside the skirt)], by one point a replicate in each of
    parts² parts; the number of points so far with these.
    """
    wide = (cell[HIGH_U] - cell[LOW_U]) / parts
    high = (cell[HIGH_V] - cell[LOW_V]) / parts
    for part in range(parts * parts):
        count += 1
        for n in range(shifts.shape[0]):
            u = cell[LOW_U] + (part // parts + shifts[n, 0]) * wide
            v = cell[LOW_V] + (part % parts + shifts[n, 1]) * high
            put_point(p, sector, u, v, sectors, top)
            p[AREA] *= wide * high
            one, two = golden_pair(count, shifts[n, 2], shifts[n, 2])
            add_sample(p, one, two, source, receivers, units, box, top, out[n])
    return count


@array_kernel
def repeated_reflections(
    source: FloatArray, receivers: FloatArray, units: FloatArray, lattice: FloatArray, echoes: FloatArray,
    columns: FloatArray, shifts: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, p: FloatArray,
    out: FloatArray,
) -> None:  # fmt: skip
    """Add flux of chains with two or more top reflections to out[replicate, receiver, (outside, inside the skirt)].

    lattice, echoes : a replicate's lattice, and (replicate, row, column, 5) ends of the rays over their points
    shifts : (replicate, 3 or more) place in a cell along u and v, and where on the emitter the first ray starts, 0 to 1
    units : (receiver,) power that a sample near it may stand for; 0 where unwanted
    """
    first = first_free_row(lattice)
    rings = lattice.shape[0] - first
    known = np.full((rings + 1, lattice.shape[1], ECHO_COLUMNS), UNKNOWN)
    cells = np.empty((STACK, CELL_COLUMNS))
    nine = np.empty((3, 3, ECHO_COLUMNS))
    count = 0
    for a in range(rings):
        for b in range(lattice.shape[1]):
            unseen, unseen_unit = power_near(a + first, b, first, columns, echoes, receivers, units)
            if unseen < 0.0:
                continue
            root = lattice[a + first, b]
            sector = int(root[SECTOR])
            put_first(cells[0], (sector, root[U0], root[U1], root[V0], root[V1]), int(columns[b, 4]), a, b, known,
                      source, sectors, box, top, p)  # fmt: skip
            n = 1
            while n > 0:
                n -= 1
                fate, parts = fate_of(cells[n], unseen, unseen_unit, receivers, units)
                if fate == DIVIDE:
                    divide(cells, n, sector, source, sectors, box, top, p, nine)
                    n += 4
                elif fate == KEEP:
                    count = add_samples(cells[n], parts, sector, count, source, receivers, units, shifts, sectors,
                                        box, top, p, out)  # fmt: skip
