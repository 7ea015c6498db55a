"""Kernels: light with exactly one reflection at the deformed top.

The top is divided into cells. A path from emitter point e by way of the top's point p to receiver point q has the
length F = |p - e| + |q - p|. It is a mirror path if the gradient of F along the top vanishes (Fermat). Gradient and
second derivatives of F are sums of an emitter's part and a receiver's part. So each part is tabulated once for every
patch (here the face of an emitter or receiver) at the corners of the cells. A pair's light can only come from cells
where the gradient is zero for some points of the two faces. To first order, as the points move over the two faces, the
gradient moves within a sum of two parallelograms, the pair's *range*.

Connected cells from which light can come form an *island*: one image of the emitter, or several that meet in a caustic.
An image is *whole* if every point of the emitter sends it to every point of the receiver, without shadow or fold; it is
summed path by path (`optopad.sims.optics.engine.mirrored`). An image that a contact edge or shadow cuts, or a caustic
folds, is summed over a grid of points of the top. From one point to the next the image moves by only a share of its
size; the share is smaller for brighter images. Every replicate shifts the grid by a different fraction of its spacing.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray, IntArray
from optopad.sims.optics.engine.mirrored import pinhole, whole_image
from optopad.sims.optics.kernel_types import ImageRules
from optopad.sims.optics.surface.radial import kernel, wall_point
from optopad.sims.optics.surface.tops import (
    GX,
    GY,
    HXX,
    HXY,
    HYY,
    NX,
    NY,
    NZ,
    Top,
    is_beyond,
    place_on_top,
    ring_edge,
    surface_bend,
    touch,
)

FINEST = 96
COARSE, FINEST_STEP, BRIGHT = 2.5, 0.5, 0.03
"""Step of the first and of the finest grid of points, as multiples of the accuracy's `image_step`; and brightness at
which an image is summed with exactly `image_step`, as a share of the pair's untouched flux."""
NEAR_RANGE, BENT, CHANGED, MOST_CHANGE = 1.02, 1.4, 0.05, 4.0
"""Tolerances of the test whether a point can mirror light from face to face (`_range_corners`): the general tolerance;
what is added per difference of a cell's middle from the mean of its corners; what is added per difference between
corners; and the largest difference that counts. Of 1.7 million points on two pads, no point with light was left out."""


@kernel
def _range_corners(
    emitter: FloatArray, receiver: FloatArray, middle_e: FloatArray, middle_q: FloatArray, a: int, b: int, e: int,
    corner: FloatArray,
) -> None:  # fmt: skip
    """Fill corner[side, 5] for a test whether points of a cell can mirror light from face to face.

    The points of both faces span a parallelogram sum of gradients, with four edge directions (sides). Columns 0 to 3
    are the gradient across the edge at the cell's corners, over half the span. Column 4 is the largest value at which a
    point still counts as able to do so.
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
    """Whether the point at fractions fu, fv of a cell cannot mirror light from face to face, by `_range_corners`."""
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
    """Flux mirrored in one cell, outside and inside the dimple's steep skirt; `corner` is from `_range_corners`."""
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
    """Fill out[replicate, (outside, inside the skirt)] with a group of cells' mirrored flux; return the largest sum."""
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
    """Fill out[replicate, (outside, inside the skirt)] with the flux that is mirrored in a group of adjacent cells.

    A coarse grid of points comes first, then a finer one if the image is bright enough. It is finest for the images
    that are brightest relative to the pair's untouched flux `unit`.
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
    """Add a pair's flux with one reflection at the top to out[replicate, (outside, inside the steep skirt)].

    unit : the pair's untouched flux
    skip_flat : whether light mirrored outside every deformed part is left out, because its untouched value is used
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
                _, share = touch(x, y, top)
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


# columns of a patch row at a node; ACROSS_S and ACROSS_U begin three: unit vector, and reach of the patch along it
FX, FY, SX, SY, UX, UY, FXX, FXY, FYY, LIT, CLOSE, ACROSS_S = range(12)
ACROSS_U = ACROSS_S + 3
PATCH_COLUMNS = 17
BOX_COLUMNS = 5
MARGIN = 0.35
"""Tolerance added to a cell's bounds on the gradient of the path length, as a share of the gradient's change in the
cell."""
GRAZE = 1.2
CORE = 1.6
FOLD_U, FOLD_V = 4, 2
"""Number of points per cell, along u and v, at which an image is tested for a fold; only points within `CORE` half
sizes of the image count."""
CLOSE_SHARE = 0.5
"""A face of an emitter or receiver counts as close to a point if half its diagonal exceeds this share of its
distance."""
ANYWHERE = 4.0
"""Bound on the gradient of the path length for points near a face; the sum of two unit vectors cannot be that large."""
SECOND_ORDER = 0.58
"""Bound on second-order changes of the path length's gradient over a face: this factor times the square of s / (1 - s),
where s is half the face's diagonal divided by its distance. The factor is half the largest second derivative of a unit
vector, sqrt(4/3) / length². Without the bound, up to 2.5 % of a pair's light was lost, and more on a finer grid."""
CLOSE_STEPS = 2.0
NEVER = 1e30


@kernel
def _put_across(row: FloatArray, edge: int, other: int, out: int) -> None:
    """Fill three columns from column `out`: unit vector normal to one edge, and the other edge's extent along it."""
    nx = -row[edge + 1]
    ny = row[edge]
    size = 1.0 / max(math.sqrt(nx * nx + ny * ny), 1e-12)
    row[out] = nx * size
    row[out + 1] = ny * size
    row[out + 2] = abs(row[other] * nx + row[other + 1] * ny) * size


@kernel
def leg_row(
    patch: FloatArray, x: float, y: float, z: float, gx: float, gy: float, hxx: float, hxy: float, hyy: float,
    box: FloatArray, out: FloatArray,
) -> None:  # fmt: skip
    """Fill a row of `patch_table` for one point of the top.

    The columns describe the distance from a face's centre to the point: its gradient in plan; the gradient's change
    from the centre to the face's side edge and to its upper edge; second derivatives; cosine at which the face meets
    the top's underside; bound on second-order changes; and what `_put_across` fills, twice.
    """
    wall = int(patch[0])
    ex, ey, ez = wall_point(wall, patch[1], patch[2], box)
    along_x = 1.0 if wall % 2 == 0 else 0.0
    ax = x - ex
    ay = y - ey
    az = z - ez
    d = 1.0 / max(math.sqrt(ax * ax + ay * ay + az * az), 1e-6)
    ax *= d
    ay *= d
    az *= d
    fx = ax + az * gx
    fy = ay + az * gy
    along = ax if wall % 2 == 0 else ay
    out[FX] = fx
    out[FY] = fy
    out[SX] = patch[3] * (along_x - along * fx) * d
    out[SY] = patch[3] * (1.0 - along_x - along * fy) * d
    out[UX] = patch[4] * (gx - az * fx) * d
    out[UY] = patch[4] * (gy - az * fy) * d
    out[FXX] = (1.0 + gx * gx - fx * fx) * d + az * hxx
    out[FXY] = (gx * gy - fx * fy) * d + az * hxy
    out[FYY] = (1.0 + gy * gy - fy * fy) * d + az * hyy
    share = math.sqrt(patch[3] * patch[3] + patch[4] * patch[4]) * d
    out[LIT] = az - gx * ax - gy * ay + GRAZE * share
    out[CLOSE] = ANYWHERE
    if share <= CLOSE_SHARE:
        bent = share / (1.0 - share)
        out[CLOSE] = SECOND_ORDER * bent * bent * math.sqrt(1.0 + gx * gx + gy * gy)
    _put_across(out, SX, UX, ACROSS_S)
    _put_across(out, UX, SX, ACROSS_U)


@kernel
def patch_table(patch: FloatArray, nodes: FloatArray, box: FloatArray, out: FloatArray) -> None:
    """Fill (ring + 1, column, n) with the columns of `leg_row` for one face, at all corners of the cells."""
    for a in range(nodes.shape[0]):
        for b in range(nodes.shape[1]):
            leg_row(
                patch, nodes[a, b, NX], nodes[a, b, NY], nodes[a, b, NZ], nodes[a, b, GX], nodes[a, b, GY],
                nodes[a, b, HXX], nodes[a, b, HXY], nodes[a, b, HYY], box, out[a, b],
            )  # fmt: skip


@kernel
def closeness(emitter: FloatArray, receiver: FloatArray, a: int, b: int, e: int) -> float:
    """Bound on second-order changes of a cell's gradient over both faces; `ANYWHERE` or more next to a close face."""
    close = 0.0
    for k in range(4):
        i = a + k % 2
        j = b if k < 2 else e
        close = max(close, emitter[i, j, CLOSE] + receiver[i, j, CLOSE])
    return close


@kernel
def _passes_box(emitter: FloatArray, receiver: FloatArray, a: int, b: int, e: int) -> bool:
    """Whether the path length's gradient may vanish somewhere in the cell, where both faces see the top's underside."""
    low_x = NEVER
    high_x = -NEVER
    low_y = NEVER
    high_y = -NEVER
    wide_x = 0.0
    wide_y = 0.0
    lit_e = -1.0
    lit_q = -1.0
    for k in range(4):
        i = a + k % 2
        j = b if k < 2 else e
        fx = emitter[i, j, FX] + receiver[i, j, FX]
        fy = emitter[i, j, FY] + receiver[i, j, FY]
        low_x = min(low_x, fx)
        high_x = max(high_x, fx)
        low_y = min(low_y, fy)
        high_y = max(high_y, fy)
        wide_x = max(
            wide_x,
            abs(emitter[i, j, SX])
            + abs(emitter[i, j, UX])
            + abs(receiver[i, j, SX])
            + abs(receiver[i, j, UX]),
        )
        wide_y = max(
            wide_y,
            abs(emitter[i, j, SY])
            + abs(emitter[i, j, UY])
            + abs(receiver[i, j, SY])
            + abs(receiver[i, j, UY]),
        )
        lit_e = max(lit_e, emitter[i, j, LIT])
        lit_q = max(lit_q, receiver[i, j, LIT])
    close = closeness(emitter, receiver, a, b, e)
    wide_x += MARGIN * (high_x - low_x) + 1e-6 + close
    wide_y += MARGIN * (high_y - low_y) + 1e-6 + close
    if low_x > wide_x or high_x < -wide_x or low_y > wide_y or high_y < -wide_y:
        return False
    return lit_e > 0.0 and lit_q > 0.0


@kernel
def across(emitter: FloatArray, receiver: FloatArray, side: int) -> tuple[float, float]:
    """Path length's gradient across one of four edge directions of the pair's range, and half the range's width."""
    own = emitter if side < 2 else receiver
    other = receiver if side < 2 else emitter
    first = ACROSS_S if side % 2 == 0 else ACROSS_U
    nx = own[first]
    ny = own[first + 1]
    reach = own[first + 2]
    reach += abs(other[SX] * nx + other[SY] * ny)
    reach += abs(other[UX] * nx + other[UY] * ny)
    fx = emitter[FX] + receiver[FX]
    fy = emitter[FY] + receiver[FY]
    return fx * nx + fy * ny, reach


@kernel
def image_steps(emitter: FloatArray, receiver: FloatArray, a: int, b: int, e: int) -> tuple[float, float]:
    """How far a pair's image moves across a cell along u and v, in image sizes; (-1, -1): no light from there."""
    if not _passes_box(emitter, receiver, a, b, e):
        return -1.0, -1.0
    along_u = 0.0
    along_v = 0.0
    close = closeness(emitter, receiver, a, b, e)
    for side in range(4):
        f0, w0 = across(emitter[a, b], receiver[a, b], side)
        f1, w1 = across(emitter[a + 1, b], receiver[a + 1, b], side)
        f2, w2 = across(emitter[a, e], receiver[a, e], side)
        f3, w3 = across(emitter[a + 1, e], receiver[a + 1, e], side)
        low = min(min(f0, f1), min(f2, f3))
        high = max(max(f0, f1), max(f2, f3))
        wide = max(max(w0, w1), max(w2, w3))
        spare = wide + MARGIN * (high - low) + 1e-6 + close
        if low > spare or high < -spare:
            return -1.0, -1.0
        along_u = max(along_u, max(abs(f1 - f0), abs(f3 - f2)) / (2.0 * wide + 1e-12))
        along_v = max(along_v, max(abs(f2 - f0), abs(f3 - f1)) / (2.0 * wide + 1e-12))
    if close >= ANYWHERE:
        return min(along_u, CLOSE_STEPS), min(along_v, CLOSE_STEPS)
    return along_u, along_v


@kernel
def patch_boxes(table: FloatArray, columns: FloatArray, out: FloatArray) -> None:
    """Fill (ring, column, 5) with bounds of a face's gradient over each cell, and its largest cosine there.

    The bounds hold for all points of the face: low x, high x, low y, high y.
    """
    for a in range(table.shape[0] - 1):
        for b in range(table.shape[1]):
            e = int(columns[b, 4])
            out[a, b, 0] = NEVER
            out[a, b, 1] = -NEVER
            out[a, b, 2] = NEVER
            out[a, b, 3] = -NEVER
            out[a, b, 4] = -1.0
            wide_x = 0.0
            wide_y = 0.0
            close = 0.0
            for k in range(4):
                i = a + k % 2
                j = b if k < 2 else e
                close = max(close, table[i, j, CLOSE])
                out[a, b, 0] = min(out[a, b, 0], table[i, j, FX])
                out[a, b, 1] = max(out[a, b, 1], table[i, j, FX])
                out[a, b, 2] = min(out[a, b, 2], table[i, j, FY])
                out[a, b, 3] = max(out[a, b, 3], table[i, j, FY])
                out[a, b, 4] = max(out[a, b, 4], table[i, j, LIT])
                wide_x = max(wide_x, abs(table[i, j, SX]) + abs(table[i, j, UX]))
                wide_y = max(wide_y, abs(table[i, j, SY]) + abs(table[i, j, UY]))
            wide_x += MARGIN * (out[a, b, 1] - out[a, b, 0]) + 1e-6 + close
            wide_y += MARGIN * (out[a, b, 3] - out[a, b, 2]) + 1e-6 + close
            out[a, b, 0] -= wide_x
            out[a, b, 1] += wide_x
            out[a, b, 2] -= wide_y
            out[a, b, 3] += wide_y


@kernel
def lit_cells(
    emitter: FloatArray, receiver: FloatArray, box_e: FloatArray, box_q: FloatArray, columns: FloatArray,
    steps: FloatArray, tag: IntArray,
) -> int:  # fmt: skip
    """Set `tag` to 1 for cells that may mirror light between the pair's faces, else to 0; return how many may.

    steps : (ring, column, 2) filled as by `image_steps`
    """
    count = 0
    for a in range(emitter.shape[0] - 1):
        for b in range(emitter.shape[1]):
            tag[a, b] = 0
            if box_e[a, b, 0] + box_q[a, b, 0] > 0.0 or box_e[a, b, 1] + box_q[a, b, 1] < 0.0:
                continue
            if box_e[a, b, 2] + box_q[a, b, 2] > 0.0 or box_e[a, b, 3] + box_q[a, b, 3] < 0.0:
                continue
            if box_e[a, b, 4] < 0.0 or box_q[a, b, 4] < 0.0:
                continue
            along_u, along_v = image_steps(emitter, receiver, a, b, int(columns[b, 4]))
            if along_u >= 0.0:
                steps[a, b, 0] = along_u
                steps[a, b, 1] = along_v
                tag[a, b] = 1
                count += 1
    return count


@kernel
def take_island(
    first: int, number: int, columns: FloatArray, tag: IntArray, stack: IntArray, cells: IntArray
) -> int:
    """Set `tag` to `number` for a connected group of cells with tag 1, list them in `cells`, and return how many."""
    rings, width = tag.shape
    found = 0
    tag[first // width, first % width] = number
    stack[0] = first
    left = 1
    while left > 0:
        left -= 1
        at = stack[left]
        cells[found] = at
        found += 1
        a = at // width
        b = at % width
        for near in range(3):
            c = b if near == 0 else int(columns[b, 2 + near])
            for d in range(max(a - 1, 0), min(a + 2, rings)):
                if tag[d, c] == 1:
                    tag[d, c] = number
                    stack[left] = d * width + c
                    left += 1
    return found


@kernel
def island_start(
    emitter: FloatArray, receiver: FloatArray, columns: FloatArray, cells: IntArray, count: int
) -> tuple[int, int]:
    """Ring and column of the cell corner, in a group of cells, that is closest to mirroring light from face to face."""
    width = emitter.shape[1]
    nearest = NEVER
    best_a = 0
    best_b = 0
    for n in range(count):
        for k in range(4):
            i = cells[n] // width + k % 2
            j = cells[n] % width
            j = j if k < 2 else int(columns[j, 4])
            off = _range_share(emitter[i, j], receiver[i, j])
            if off < nearest:
                nearest = off
                best_a = i
                best_b = j
    return best_a, best_b


@kernel
def _range_share(emitter: FloatArray, receiver: FloatArray) -> float:
    """How far a point is from mirroring light between the pair's faces; at most 1 if it does mirror light."""
    off = 0.0
    for side in range(4):
        f, w = across(emitter, receiver, side)
        off = max(off, abs(f) / (w + 1e-12))
    return off


@kernel
def island_fold(
    source: FloatArray, target: FloatArray, cells: IntArray, count: int, rings: int, phase: float,
    columns: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, one: FloatArray, two: FloatArray,
) -> int:  # fmt: skip
    """Sign of the determinant of d²F/dp² over a group of cells, where F is the path length and p the point of the top.

    It is tested near the image, at `FOLD_U` x `FOLD_V` points per cell. The result is 0 if the sign changes, if no
    point is near the image, or if a face is close.
    """
    width = columns.shape[0]
    sign = 0
    for n in range(count):
        a = cells[n] // width
        b = cells[n] % width
        u0 = ring_edge(a, rings, phase)
        du = ring_edge(a + 1, rings, phase) - u0
        for m in range(FOLD_U * FOLD_V):
            u = u0 + (m % FOLD_U + 0.5) / FOLD_U * du
            v = columns[b, 1] + (m // FOLD_U + 0.5) / FOLD_V * (columns[b, 2] - columns[b, 1])
            x, y, _, _ = place_on_top(int(columns[b, 0]), u, v, sectors, top)
            h, gx, gy, hxx, hxy, hyy = surface_bend(x, y, top)
            leg_row(source, x, y, h, gx, gy, hxx, hxy, hyy, box, one)
            leg_row(target, x, y, h, gx, gy, hxx, hxy, hyy, box, two)
            if one[CLOSE] + two[CLOSE] >= ANYWHERE:
                return 0
            if _range_share(one, two) > CORE:
                continue
            fxy = one[FXY] + two[FXY]
            fxx = one[FXX] + two[FXX]
            here = 1 if fxx * (one[FYY] + two[FYY]) > fxy * fxy else -1
            if sign == 0:
                sign = here
            elif sign != here:
                return 0
    return sign
