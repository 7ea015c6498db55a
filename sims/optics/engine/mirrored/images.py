"""Kernels: light with exactly one reflection at the deformed top.

Island by island (`sims.optics.engine.mirrored.image_cells`): an image that is whole, that is which every point of the
emitter sends to every point of the receiver, hidden nowhere and without a fold, is summed path by path
(`sims.optics.engine.mirrored.mirror_paths`). Any other, cut by a contact edge or a shadow or folded in a caustic, is
summed over the top (`sims.optics.engine.mirrored.pinhole`) on a lattice of points so close that the image moves by a
share of its size from one to the next, the smaller the brighter it is. Every replicate moves the lattice by another
fraction of its spacing.
"""

from __future__ import annotations

import math

from design.arrays import FloatArray, IntArray
from sims.optics.engine.mirrored.image_cells import (
    across,
    closeness,
    island_fold,
    island_start,
    lit_cells,
    take_island,
)
from sims.optics.engine.mirrored.mirror_paths import whole_image
from sims.optics.engine.mirrored.pinhole import pinhole
from sims.optics.kernel_types import ImageRules
from sims.optics.surface.radial import kernel
from sims.optics.surface.top import Top, is_beyond, touching_tip
from sims.optics.surface.top_grid import NX, NY, ring_edge

FINEST = 96
COARSE, FINEST_STEP, BRIGHT = 2.5, 0.5, 0.03
"""First and finest lattice's steps over the setting's; share of the untouched flux that gets the setting's own."""
NEAR_RANGE, BENT, CHANGED, MOST_CHANGE = 1.02, 1.4, 0.05, 4.0
"""A place counts within so many half ranges, and more where a cell's middle differs from the mean of its corners, and
where these differ: of 1.7 million places, benchmark and paper's pad, none with light was left out."""


@kernel
def _range_corners(
    emitter: FloatArray, receiver: FloatArray, middle_e: FloatArray, middle_q: FloatArray, a: int, b: int, e: int,
    corner: FloatArray,
) -> None:  # fmt: skip
    """Fill corner[side, 5] with the gradient across each edge direction over half the range at a cell's corners, and
    how far from 0 that may be for a place in the range.
    """
    close = closeness(emitter, receiver, a, b, e)
    for side in range(4):
        mean = 0.0
        change = 0.0
        for k in range(4):
            i = a + k % 2
            j = b if k < 2 else e
            f, w = across(emitter[i, j], receiver[i, j], side)
            corner[side, k] = f / (w + close + 1e-12)
            mean += 0.25 * corner[side, k]
            change = max(change, abs(corner[side, k] - corner[side, 0]))
        f, w = across(middle_e[a, b], middle_q[a, b], side)
        bent = abs(f / (w + close + 1e-12) - mean)
        corner[side, 4] = NEAR_RANGE + BENT * min(bent, MOST_CHANGE) + CHANGED * min(change, MOST_CHANGE)


@kernel
def _is_far(corner: FloatArray, fu: float, fv: float) -> bool:
    """Whether a place in a cell lies outside the pair's range."""
    for side in range(4):
        low = corner[side, 0] + fu * (corner[side, 1] - corner[side, 0])
        high = corner[side, 2] + fu * (corner[side, 3] - corner[side, 2])
        if abs(low + fv * (high - low)) > corner[side, 4]:
            return True
    return False


@kernel
def cell_sum(
    source: FloatArray, target: FloatArray, a: int, b: int, steps: FloatArray, step: float, shift: FloatArray,
    skip_flat: bool, rings: int, phase: float, columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
    corner: FloatArray, poly: FloatArray, other: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Flux through one cell of the grid: (outside the skirt, inside it); `corner`: see `_range_corners`."""
    nu = int(min(max(math.ceil(steps[0] / step), 1.0), FINEST))
    nv = int(min(max(math.ceil(steps[1] / step), 1.0), FINEST))
    u0 = ring_edge(a, rings, phase)
    du = (ring_edge(a + 1, rings, phase) - u0) / nu
    dv = (columns[b, 2] - columns[b, 1]) / nv
    outer = 0.0
    inner = 0.0
    for m in range(nu):
        for n in range(nv):
            if _is_far(corner, (m + shift[0]) / nu, (n + shift[1]) / nv):
                continue
            u = u0 + (m + shift[0]) * du
            v = columns[b, 1] + (n + shift[1]) * dv
            flux, share = pinhole(
                int(columns[b, 0]), u, v, source, target, skip_flat, sectors, box, top, poly, other
            )
            if share < 1.0:
                inner += flux
            else:
                outer += flux
    return outer * du * dv, inner * du * dv


@kernel
def island_sum(
    source: FloatArray, target: FloatArray, emitter: FloatArray, receiver: FloatArray, middle_e: FloatArray,
    middle_q: FloatArray, cells: IntArray, count: int, steps: FloatArray, step: float, skip_flat: bool,
    shifts: FloatArray, rings: int, phase: float, columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
    corner: FloatArray, poly: FloatArray, other: FloatArray, out: FloatArray,
) -> float:  # fmt: skip
    """Fill out[replicate, (outside, inside the skirt)] with the flux through an island; the brightest replicate's."""
    out[:] = 0.0
    for k in range(count):
        a = cells[k] // columns.shape[0]
        b = cells[k] % columns.shape[0]
        _range_corners(emitter, receiver, middle_e, middle_q, a, b, int(columns[b, 4]), corner)
        for n in range(shifts.shape[0]):
            outer, inner = cell_sum(
                source, target, a, b, steps[a, b], step, shifts[n], skip_flat, rings, phase, columns, sectors, box, top,
                corner, poly, other,
            )  # fmt: skip
            out[n, 0] += outer
            out[n, 1] += inner
    brightest = 0.0
    for n in range(shifts.shape[0]):
        brightest = max(brightest, out[n, 0] + out[n, 1])
    return brightest


@kernel
def lattice_sum(
    source: FloatArray, target: FloatArray, emitter: FloatArray, receiver: FloatArray, middle_e: FloatArray,
    middle_q: FloatArray, cells: IntArray, count: int, steps: FloatArray, step: float, unit: float, skip_flat: bool,
    shifts: FloatArray, rings: int, phase: float, columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
    corner: FloatArray, poly: FloatArray, other: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    """Fill out[replicate, (outside, inside the skirt)] with an island's flux: on a coarse lattice, and where that shows
    light on one the finer the brighter the image over the pair's untouched flux `unit`.
    """
    brightest = island_sum(
        source, target, emitter, receiver, middle_e, middle_q, cells, count, steps, COARSE * step, skip_flat, shifts,
        rings, phase, columns, sectors, box, top, corner, poly, other, out,
    )  # fmt: skip
    finer = math.sqrt(BRIGHT * unit / max(brightest, 1e-300))
    if finer < COARSE:
        island_sum(
            source, target, emitter, receiver, middle_e, middle_q, cells, count, steps, max(finer, FINEST_STEP) * step,
            skip_flat, shifts, rings, phase, columns, sectors, box, top, corner, poly, other, out,
        )  # fmt: skip


@kernel
def single_reflection(
    source: FloatArray, target: FloatArray, emitter: FloatArray, receiver: FloatArray, middle_e: FloatArray,
    middle_q: FloatArray, unit: float, box_e: FloatArray, box_q: FloatArray, skip_flat: bool, step: float,
    whole_ratio: float, shifts: FloatArray, rings: int, phase: float, columns: FloatArray, sectors: FloatArray,
    nodes: FloatArray, box: FloatArray, top: Top, rules: ImageRules, tag: IntArray, stack: IntArray, cells: IntArray,
    steps: FloatArray, corner: FloatArray, one: FloatArray, two: FloatArray, poly: FloatArray, other: FloatArray,
    part: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    """Add a pair's singly reflected flux to out[replicate, (outside, inside the skirt)].

    `unit` is its untouched flux; `skip_flat`: light from beyond every deformed part is left out (the untouched value
    stands for it).
    """
    if lit_cells(emitter, receiver, box_e, box_q, columns, steps, tag) == 0:
        return
    width = tag.shape[1]
    number = 1
    for first in range(tag.size):
        if tag[first // width, first % width] != 1:
            continue
        number += 1
        count = take_island(first, number, columns, tag, stack, cells)
        sign = 0
        if whole_ratio > 0.0:
            sign = island_fold(
                source, target, cells, count, rings, phase, columns, sectors, box, top, one, two
            )
        if sign != 0:
            a, b = island_start(emitter, receiver, columns, cells, count)
            flux, x, y = whole_image(
                source, target, nodes[a, b, NX], nodes[a, b, NY], float(sign), number, tag, rings, phase, columns,
                sectors, box, top, rules, whole_ratio,
            )  # fmt: skip
            if flux >= 0.0:
                _, share = touching_tip(x, y, top)
                if not (skip_flat and is_beyond(x, y, top)):
                    for n in range(out.shape[0]):
                        out[n, 1 if share < 1.0 else 0] += flux
                continue
        lattice_sum(
            source, target, emitter, receiver, middle_e, middle_q, cells, count, steps, step, unit, skip_flat, shifts,
            rings, phase, columns, sectors, box, top, corner, poly, other, part,
        )  # fmt: skip
        for n in range(out.shape[0]):
            out[n, 0] += part[n, 0]
            out[n, 1] += part[n, 1]
