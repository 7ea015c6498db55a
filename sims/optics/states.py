# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators
"""Kernel: all states, one after the other on each thread; a state's result depends on no other state.

Path classes: `DIRECT` straight; `TOP` specular, every reflection at the top outside the skirt radius;
`SKIRT` specular with a reflection inside it; `DIFFUSE` scattered by wall, bottom or tip at least once.
"""

from __future__ import annotations

import numpy as np

from sims.optics.diffuse import deposit, golden_shift, join
from sims.optics.direct import blocking_radius, bundle_misses, direct_flux
from sims.optics.mirror import calm_mirror, calm_radius
from sims.optics.rays import kernel
from sims.optics.repeated import repeated_reflections
from sims.optics.skirt import STACK, single_reflection
from sims.optics.surface import ACTIVE, OUTER_R
from sims.optics.top_cells import coarse_cells, sectors_of
from sims.optics.top_image import aim_cells

DIRECT, TOP, SKIRT, DIFFUSE = range(4)
CLASSES = 4
EVERYWHERE = 1e9
EMITTER_SEQUENCE, RECEIVER_SEQUENCE = 1.0, 1000.0


@kernel
def straight(out, wanted, emitters, receivers, flat, box, press, cubic, rules):
    """Straight light and, where the bundle misses the deformed top in plan, mirrored light."""
    nodes_e, weights_e, nodes_u, weights_u, nodes_z, weights_z = rules
    for i in range(emitters.shape[0]):
        for j in range(receivers.shape[0]):
            if not wanted[i, j] or emitters[i, 0] == receivers[j, 0]:
                continue
            e = emitters[i]
            r = receivers[j]
            radius = blocking_radius(max(e[2] + e[4], r[2] + r[4]), press, cubic)
            if press[ACTIVE] == 0.0 or bundle_misses(e, r, radius, box, press):
                out[DIRECT, i, j] = flat[0, i, j]
            else:
                out[DIRECT, i, j] = direct_flux(
                    e, r, box, press, cubic, nodes_e, weights_e, nodes_u, weights_u, nodes_z, weights_z
                )
            if press[ACTIVE] == 0.0 or bundle_misses(e, r, press[OUTER_R], box, press):
                out[TOP, i, j] = flat[1, i, j]


@kernel
def calm(
    out, reach, wanted, emitters, receivers, box, press, cubic, steepest, bends, calm_share, mirror_rules
):
    """Mirrored light of pairs that only meet the calm part of the top; where `skirt` must look for more."""
    nodes_e, weights_e, nodes_q, weights_q = mirror_rules
    for i in range(emitters.shape[0]):
        for j in range(receivers.shape[0]):
            reach[i, j] = EVERYWHERE
            if not wanted[i, j] or emitters[i, 0] == receivers[j, 0]:
                continue
            if bundle_misses(emitters[i], receivers[j], press[OUTER_R], box, press):
                reach[i, j] = press[OUTER_R]
                continue
            radius = calm_radius(emitters[i], receivers[j], calm_share, box, press, bends)
            flux = calm_mirror(
                emitters[i], receivers[j], radius, box, press, cubic, steepest, nodes_e, weights_e, nodes_q,
                weights_q,
            )  # fmt: skip
            if flux >= 0.0:
                out[TOP, i, j] = flux
                reach[i, j] = radius


@kernel
def specular(
    out, reach, wanted, emitters, receivers, scale, box, press, cubic, steepest, points, shift, settings
):
    """Add light with one or more reflections at the deformed top to TOP and SKIRT."""
    rings = int(settings[0])
    tolerance = settings[2]
    sectors = sectors_of(press, box)
    cells = coarse_cells(rings, int(settings[1]), shift[0], shift[1], sectors)
    work = np.zeros((24 + STACK, 3))
    several = np.zeros((receivers.shape[0], 2))
    for i in range(emitters.shape[0]):
        if not wanted[i].any():
            continue
        aims = aim_cells(cells, emitters[i], sectors, EVERYWHERE, box, press, cubic)
        brightest = 0.0
        for j in range(receivers.shape[0]):
            if not wanted[i, j]:
                continue
            brightest = max(brightest, scale[i, j])
            outer, inner = single_reflection(
                emitters[i], receivers[j], cells, aims, sectors, reach[i, j], tolerance,
                settings[3] * scale[i, j], box, press, cubic, steepest, work,
            )  # fmt: skip
            out[TOP, i, j] += outer
            out[SKIRT, i, j] += inner
        several[:] = 0.0
        repeated_reflections(
            emitters[i], receivers, wanted[i], sectors, box, press, cubic, steepest, points,
            golden_shift(i + 1.0) + shift[2:6], int(settings[4]), int(settings[5]),
            settings[6] * brightest, several,
        )  # fmt: skip
        out[TOP, i] += several[:, 0]
        out[SKIRT, i] += several[:, 1]


@kernel
def scattered(
    out, wanted, emitters, receivers, flat_diffuse, flat_join, box, press, cubic, steepest,
    points, count, shift, layout, areas, reflectances,
):  # fmt: skip
    """Diffuse light: the untouched value times the ratio of joins on common points."""
    patches = areas.shape[0]
    from_emitter = np.zeros((emitters.shape[0], patches))
    from_receiver = np.zeros((receivers.shape[0], patches))
    for i in range(emitters.shape[0]):
        if wanted[i].any():
            deposit(
                emitters[i], receivers, box, press, cubic, steepest, points, count,
                golden_shift(i + EMITTER_SEQUENCE) + shift[2:6], layout, from_emitter[i],
            )  # fmt: skip
    for j in range(receivers.shape[0]):
        if wanted[:, j].any():
            deposit(
                receivers[j], receivers, box, press, cubic, steepest, points, count,
                golden_shift(j + RECEIVER_SEQUENCE) + shift[2:6], layout, from_receiver[j],
            )  # fmt: skip
    for i in range(emitters.shape[0]):
        for j in range(receivers.shape[0]):
            if wanted[i, j] and flat_join[i, j] > 0.0:
                area = 4.0 * receivers[j, 3] * receivers[j, 4]
                now = join(from_emitter[i], from_receiver[j], area, areas, layout, reflectances, press)
                out[DIFFUSE, i, j] += flat_diffuse[i, j] * now / flat_join[i, j]


@kernel
def one_state(
    result, wanted, emitters, receivers, box, press, cubic, steepest, bends, flat, flat_diffuse, flat_join, scale,
    rules, mirror_rules, points, count, shifts, layout, areas, reflectances, settings,
):  # fmt: skip
    """Fill (replicate, class, emitter, receiver) with flux over emitted power."""
    straight(result[0], wanted, emitters, receivers, flat, box, press, cubic, rules)
    reach = np.empty(wanted.shape)
    if press[ACTIVE] > 0.0:
        calm(
            result[0],
            reach,
            wanted,
            emitters,
            receivers,
            box,
            press,
            cubic,
            steepest,
            bends,
            settings[7],
            mirror_rules,
        )
    for n in range(1, shifts.shape[0]):
        result[n] = result[0]
    for n in range(shifts.shape[0]):
        if press[ACTIVE] == 0.0:
            result[n, DIFFUSE] = flat_diffuse * wanted
            continue
        specular(
            result[n], reach, wanted, emitters, receivers, scale, box, press, cubic, steepest, points, shifts[n],
            settings,
        )  # fmt: skip
        scattered(
            result[n], wanted, emitters, receivers, flat_diffuse, flat_join[n], box, press, cubic, steepest,
            points, count, shifts[n], layout, areas, reflectances,
        )  # fmt: skip
