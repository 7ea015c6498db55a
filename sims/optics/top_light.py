# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernels: what the pressed top does to the light that it receives first hand, on a lattice of its points.

A ray from a patch to a point p of the top, contact included, has a fate now and had one in the untouched pad. The
difference of the two, summed over the lattice with the weight

    radiance x cos x (g . d) / d^3 dA,    g = (-dh/dx, -dh/dy, 1), d from the patch to p,

is the exact change of the light that falls on walls and bottom: a ray that does not meet the top first never meets it.
The lattice goes on over the part of the top that is still flat, for what that mirrors may then meet a dimple. One ray
serves both, so a top that hardly changes changes hardly anything.
"""

from __future__ import annotations

import math

from sims.optics.diffuse import add_deposit, golden_pair, receiver_at
from sims.optics.radial import fresnel, kernel, radiance, wall_hit, wall_normal, wall_point
from sims.optics.rays import BOTTOM, LOST, TIP, chain, is_clear
from sims.optics.surface import CONTACT_R, TOP, X, Y
from sims.optics.top import FIELD_ON, is_beyond, surface_gradient, surface_height, touching_tip
from sims.optics.top_grid import TIP as SECTOR_TIP
from sims.optics.top_grid import place_on_top

# columns of a lattice row
PX, PY, PZ, GX, GY, AREA, TOUCHED, SECTOR, U0, U1, V0, V1, FLAT = range(13)
POINT_COLUMNS = 13
CONTACT_RINGS = 3
# columns of an echo row: where a ray from the emitter ends
POWER, KIND, ALONG, UP, TOPS = range(5)
ECHO_COLUMNS = 5


@kernel
def lattice_points(rings, columns, shift_u, shift_v, sectors, top, out):
    """Fill zeros (row, column, 13) with points of the pressed top; rows are `CONTACT_RINGS` rings in the contact, then
    rings of u.
    """
    for b in range(columns.shape[0]):
        k = int(columns[b, 0])
        tip = int(sectors[k, SECTOR_TIP])
        v = columns[b, 1] + shift_v * (columns[b, 2] - columns[b, 1])
        x0, y0, _, _ = place_on_top(k, 0.0, columns[b, 1], sectors, top)
        x1, y1, _, _ = place_on_top(k, 0.0, columns[b, 2], sectors, top)
        ox = top.rows[tip, X]
        oy = top.rows[tip, Y]
        contact = top.rows[tip, CONTACT_R]
        angle = math.atan2(
            (x0 - ox) * (y1 - oy) - (y0 - oy) * (x1 - ox), (x0 - ox) * (x1 - ox) + (y0 - oy) * (y1 - oy)
        )
        xc, yc, _, _ = place_on_top(k, 0.0, v, sectors, top)
        for a in range(CONTACT_RINGS + rings):
            row = out[a, b]
            if a < CONTACT_RINGS:
                share = math.sqrt((a + shift_u) / CONTACT_RINGS)
                row[PX] = ox + share * (xc - ox)
                row[PY] = oy + share * (yc - oy)
                row[AREA] = 0.5 * angle * contact * contact / CONTACT_RINGS
                row[TOUCHED] = 1.0
            else:
                n = a - CONTACT_RINGS
                row[U0] = n / rings
                row[U1] = (n + 1.0) / rings
                u = (n + shift_u) / rings
                row[PX], row[PY], _, area = place_on_top(k, u, v, sectors, top)
                row[AREA] = area * (columns[b, 2] - columns[b, 1]) / rings
                other, _ = touching_tip(row[PX], row[PY], top)
                if other >= 0:
                    row[AREA] = 0.0
                if top.rows[0, FIELD_ON] == 0.0 and is_beyond(row[PX], row[PY], top):
                    row[FLAT] = 1.0
            row[SECTOR] = k
            row[V0] = columns[b, 1]
            row[V1] = columns[b, 2]
            row[PZ], row[GX], row[GY] = surface_gradient(row[PX], row[PY], top)


@kernel
def first_leg(p, ex, ey, ez, source, box, top):
    """Weight of the leg from e to a lattice point, 0 if it is hidden or the wrong side; direction; cosine there."""
    n0, n1 = wall_normal(int(source[0]))
    dx = p[PX] - ex
    dy = p[PY] - ey
    dz = p[PZ] - ez
    out = dx * n0 + dy * n1
    into = dz - p[GX] * dx - p[GY] * dy
    if out <= 0.0 or into <= 0.0 or p[AREA] == 0.0:
        return 0.0, dx, dy, dz, 0.0
    d = math.sqrt(dx * dx + dy * dy + dz * dz)
    dx /= d
    dy /= d
    dz /= d
    if not is_clear(p[PX], p[PY], p[PZ], -dx, -dy, -dz, d, top):
        return 0.0, dx, dy, dz, 0.0
    weight = radiance(source, out / d) * out * into / (d * d * d * d) * p[AREA] * math.exp(-box[4] * d)
    weight *= 4.0 * source[3] * source[4] / source[6]
    return weight, dx, dy, dz, into / (d * math.sqrt(1.0 + p[GX] * p[GX] + p[GY] * p[GY]))


@kernel
def echo(p, dx, dy, dz, cos_in, box, top):
    """Where the ray goes after its reflection at a lattice point: kind, point, direction, share left, further
    reflections, nearest one (over the skirt's radius).
    """
    norm = 1.0 / math.sqrt(1.0 + p[GX] * p[GX] + p[GY] * p[GY])
    back = 2.0 * cos_in * norm
    return chain(
        p[PX] + 1e-9 * p[GX] * norm, p[PY] + 1e-9 * p[GY] * norm, p[PZ] - 1e-9 * norm,
        dx + back * p[GX], dy + back * p[GY], dz - back, fresnel(cos_in, box[3]), box, top,
    )  # fmt: skip


@kernel
def _untouched_fate(x, y, z, dx, dy, dz, height, box):
    """Where the ray would end under an undisturbed top: kind, point, share of its power at z that is left."""
    t, kind = wall_hit(x, y, z, dx, dy, dz, box)
    left = 1.0
    run = 0.0
    if dz > 0.0 and (height - z) / dz < t:
        run = (height - z) / dz
        x += run * dx
        y += run * dy
        z = height
        left = fresnel(dz, box[3])
        dz = -dz
        t, kind = wall_hit(x, y, z, dx, dy, dz, box)
    return kind, x + t * dx, y + t * dy, z + t * dz, left * math.exp(-box[4] * (run + t))


@kernel
def top_change(source, receivers, lattice, shift, layout, box, top, out, echoes):
    """Add the change of a patch's deposits to out (patch,); fill echoes (row, column, 5) with each ray's end."""
    height = top.rows[0, TOP]
    n = 0
    for a in range(lattice.shape[0]):
        for b in range(lattice.shape[1]):
            p = lattice[a, b]
            n += 1
            one, two = golden_pair(n, shift[0], shift[1])
            along = source[1] + source[3] * (2.0 * one - 1.0)
            up = source[2] + source[4] * (2.0 * two - 1.0)
            ex, ey, ez = wall_point(int(source[0]), along, up, box)
            echoes[a, b, POWER] = 0.0
            echoes[a, b, KIND] = LOST
            if ez >= surface_height(ex, ey, top):
                continue
            weight, dx, dy, dz, cos_in = first_leg(p, ex, ey, ez, source, box, top)
            if weight == 0.0:
                continue
            if p[TOUCHED] == 0.0:
                kind, x, y, z, _, _, _, left, tops, _ = echo(p, dx, dy, dz, cos_in, box, top)
                echoes[a, b, POWER] = weight * left
                echoes[a, b, KIND] = kind
                echoes[a, b, ALONG] = x if kind == 0 or kind == 2 else y
                echoes[a, b, UP] = z
                echoes[a, b, TOPS] = tops
                if p[FLAT] == 1.0 and tops == 0 and kind != TIP:
                    continue  # the undisturbed top mirrors it to the same place
                if kind >= 0 and (kind >= BOTTOM or receiver_at(kind, x, y, z, receivers) < 0):
                    add_deposit(kind, x, y, z, weight * left, layout, box, top, out)
            else:
                add_deposit(TIP, p[PX], p[PY], p[PZ], weight, layout, box, top, out)
            gone = weight
            if box[4] > 0.0:
                gone *= math.exp(
                    box[4] * math.sqrt((p[PX] - ex) ** 2 + (p[PY] - ey) ** 2 + (p[PZ] - ez) ** 2)
                )
            kind, x, y, z, left = _untouched_fate(ex, ey, ez, dx, dy, dz, height, box)
            if kind >= 0 and (kind == BOTTOM or receiver_at(kind, x, y, z, receivers) < 0):
                add_deposit(kind, x, y, z, -gone * left, layout, box, top, out)
