"""Kernels: light of one pressed state by path class. The result for a state does not depend on any other state.

Path classes: `DIRECT` is straight light. `TOPS` is mirrored by the top only, each time outside the skirt radius;
`SKIRT` likewise, but at least once inside it. `WALL` is mirrored by a smooth wall at least once and never scattered.
`DIFFUSE` is scattered by a wall, the bottom or a tip at least once.
"""

from __future__ import annotations

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.optics.engine.images import (
    BOX_COLUMNS,
    PATCH_COLUMNS,
    patch_boxes,
    patch_table,
    single_reflection,
)
from optopad.sims.optics.engine.repeated import (
    all_orders,
    first_hand_on_tip,
    repeated_reflections,
    shares_on_tip,
)
from optopad.sims.optics.engine.scattered import (
    ECHO_COLUMNS,
    POINT_COLUMNS,
    POWER,
    contact_rings,
    deposit,
    golden_shift,
    lattice_points,
    top_change,
)
from optopad.sims.optics.engine.straight import TIP, direct_flux, misses, reach_of
from optopad.sims.optics.kernel_types import (
    ImageRules,
    Orders,
    Patches,
    StraightRules,
    UntouchedLight,
    UntouchedRays,
)
from optopad.sims.optics.surface.curves import OUTER_R
from optopad.sims.optics.surface.radial import array_kernel, kernel
from optopad.sims.optics.surface.tops import (
    Top,
    columns_of,
    is_plain,
    is_touched,
    sectors_of,
    top_middles,
    top_nodes,
)

DIRECT, TOPS, SKIRT, WALL, DIFFUSE = range(5)
CLASSES = 5
EMITTER_SEQUENCE, RECEIVER_SEQUENCE = 1.0, 1000.0
# columns of a replicate's shifts
CELL_SHIFT, RAY_SHIFT, GRID_PHASE = 0, 2, 6
# numbers of the settings
RINGS, COLUMNS, STEP, TOP_RINGS, TOP_COLUMNS, REPEAT_SHARE, RAYS, WHOLE_RATIO, RAY_SHARE = range(9)
CLIP_CORNERS = 14
DIM = 0.03
"""The computing effort for a pair follows its brightness, relative to its emitter's brightest pair, but treats no pair
as fainter than this share."""
SEARCH_SHARE = 0.1
"""Share of the setting's power below which an emitter's ray by way of the top is followed at random. The share is small
because these rays also find light that is mirrored again: with 0.3, parts of the top were missed, and with them 0.05 %
of all light."""


@array_kernel
def straight(
    out: FloatArray, keeps: BoolArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray,
    flat: FloatArray, box: FloatArray, top: Top, rules: StraightRules,
) -> None:  # fmt: skip
    """Fill the direct light, and set `keeps` for pairs whose straight lines stay clear of every deformed part in plan.

    Pairs with `keeps` also get the untouched mirrored light. `flat` (3, emitter, receiver) holds the untouched direct
    flux, the untouched mirrored flux, and a correction factor for direct flux.
    """
    nodes_e, weights_e, nodes_u, weights_u, nodes_z, weights_z = rules
    for i in range(emitters.shape[0]):
        for j in range(receivers.shape[0]):
            keeps[i, j] = False
            if not wanted[i, j] or emitters[i, 0] == receivers[j, 0]:
                continue
            e = emitters[i]
            r = receivers[j]
            radius = reach_of(max(e[2] + e[4], r[2] + r[4]), top)
            if misses(e, r, radius, box, top):
                out[DIRECT, i, j] = flat[0, i, j]
            else:
                out[DIRECT, i, j] = flat[2, i, j] * direct_flux(
                    e, r, radius, box, top, nodes_e, weights_e, nodes_u, weights_u, nodes_z, weights_z
                )
            if is_plain(top) and misses(e, r, top.row[OUTER_R], box, top):
                out[TOPS, i, j] = flat[1, i, j]
                keeps[i, j] = True


@array_kernel
def mirrored_once(
    result: FloatArray, keeps: BoolArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray,
    scale: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, image_rules: ImageRules, shifts: FloatArray,
    settings: FloatArray,
) -> None:  # fmt: skip
    """Add the light that the deformed top mirrors once to the classes TOPS and SKIRT of every replicate."""
    rings = int(settings[RINGS])
    phase_u = shifts[0, GRID_PHASE]
    columns = columns_of(settings[COLUMNS], shifts[0, GRID_PHASE + 1], sectors)
    width = columns.shape[0]
    nodes = top_nodes(rings, phase_u, columns, sectors, top)
    middles = top_middles(rings, phase_u, columns, sectors, top)
    tables = np.empty((receivers.shape[0], rings + 1, width, PATCH_COLUMNS))
    middle_tables = np.empty((receivers.shape[0], rings, width, PATCH_COLUMNS))
    boxes = np.empty((receivers.shape[0], rings, width, BOX_COLUMNS))
    own = np.empty((rings + 1, width, PATCH_COLUMNS))
    own_middle = np.empty((rings, width, PATCH_COLUMNS))
    own_boxes = np.empty((rings, width, BOX_COLUMNS))
    tag = np.zeros((rings, width), np.int64)
    stack = np.empty(rings * width, np.int64)
    cells = np.empty(rings * width, np.int64)
    steps = np.empty((rings, width, 2))
    corner = np.empty((4, 5))
    poly = np.empty((CLIP_CORNERS, 3))
    other = np.empty((CLIP_CORNERS, 3))
    one = np.empty(PATCH_COLUMNS)
    two = np.empty(PATCH_COLUMNS)
    flux = np.empty((shifts.shape[0], 2))
    part = np.empty((shifts.shape[0], 2))
    for j in range(receivers.shape[0]):
        if wanted[:, j].any():
            patch_table(receivers[j], nodes, box, tables[j])
            patch_table(receivers[j], middles, box, middle_tables[j])
            patch_boxes(tables[j], columns, boxes[j])
    for i in range(emitters.shape[0]):
        if not wanted[i].any():
            continue
        patch_table(emitters[i], nodes, box, own)
        patch_table(emitters[i], middles, box, own_middle)
        patch_boxes(own, columns, own_boxes)
        for j in range(receivers.shape[0]):
            if not wanted[i, j]:
                continue
            flux[:] = 0.0
            single_reflection(
                emitters[i], receivers[j], own, tables[j], own_middle, middle_tables[j], scale[i, j], own_boxes,
                boxes[j], keeps[i, j], settings[STEP], settings[WHOLE_RATIO], shifts, rings, phase_u, columns, sectors,
                nodes, box, top, image_rules, tag, stack, cells, steps, corner, one, two, poly, other, part, flux,
            )  # fmt: skip
            for n in range(shifts.shape[0]):
                result[n, TOPS, i, j] += flux[n, 0]
                result[n, SKIRT, i, j] += flux[n, 1]


@array_kernel
def several_times(
    result: FloatArray, from_emitter: FloatArray, on_contact: FloatArray, wanted: BoolArray, emitters: FloatArray,
    receivers: FloatArray, scale: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, shifts: FloatArray,
    lattices: FloatArray, columns: FloatArray, layout: IntArray, settings: FloatArray,
) -> None:  # fmt: skip
    """Add the light that the top mirrors several times to the classes TOPS and SKIRT of every replicate.

    If walls are not smooth, the change that the press makes to the emitters' deposits is added to
    from_emitter[replicate]. on_contact[replicate, emitter, row, column] is filled with the light that lands on the
    contact's cells.
    """
    count = shifts.shape[0]
    echoes = np.zeros((count, lattices.shape[1], lattices.shape[2], ECHO_COLUMNS))
    several = np.zeros((count, receivers.shape[0], 2))
    unwanted = np.zeros(from_emitter.shape[2])
    units = np.empty(receivers.shape[0])
    p = np.zeros(POINT_COLUMNS)
    for i in range(emitters.shape[0]):
        brightest = 0.0
        for j in range(receivers.shape[0]):
            if wanted[i, j]:
                brightest = max(brightest, scale[i, j])
        if brightest == 0.0:
            continue
        for n in range(count):
            change = from_emitter[n, i] if box[5] == 0.0 else unwanted
            top_change(
                emitters[i], receivers, lattices[n], golden_shift(i + EMITTER_SEQUENCE)[:2] + shifts[n, 2:4], layout,
                box, top, change, echoes[n], SEARCH_SHARE * settings[RAY_SHARE], shifts[n], sectors, p,
            )  # fmt: skip
            put_power(echoes[n], on_contact[n, i])
        several[:] = 0.0
        for j in range(receivers.shape[0]):
            units[j] = settings[REPEAT_SHARE] * max(scale[i, j], DIM * brightest) if wanted[i, j] else 0.0
        repeated_reflections(
            emitters[i], receivers, units, lattices[0], echoes, columns, shifts, sectors, box, top, p, several
        )
        for n in range(count):
            for j in range(receivers.shape[0]):
                result[n, TOPS, i, j] += several[n, j, 0]
                result[n, SKIRT, i, j] += several[n, j, 1]


@kernel
def put_power(echoes: FloatArray, out: FloatArray) -> None:
    """Copy the power column of `echoes` to `out` (row, column), for as many rows as `out` has."""
    for a in range(out.shape[0]):
        for b in range(out.shape[1]):
            out[a, b] = echoes[a, b, POWER]


@array_kernel
def beyond_one(
    result: FloatArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray,
    flat: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray], scale: FloatArray, sectors: FloatArray,
    box: FloatArray, top: Top, points: FloatArray, shifts: FloatArray, patches: Patches, reflectances: FloatArray,
    orders: Orders, settings: FloatArray, flat_rays: UntouchedRays,
) -> None:  # fmt: skip
    """Add all other light: mirrored several times by the top (TOPS, SKIRT), mirrored by walls (WALL), and scattered."""
    flat_diffuse, flat_wall, given, taken, flat_join = flat
    layout = patches[0]
    count = shifts.shape[0]
    columns = columns_of(settings[TOP_COLUMNS], 0.5, sectors)
    in_contact = contact_rings(settings[TOP_COLUMNS])
    rows = in_contact + int(settings[TOP_RINGS])
    lattices = np.zeros((count, rows, columns.shape[0], POINT_COLUMNS))
    from_emitter = np.empty((count, given.shape[0], given.shape[1]))
    for n in range(count):
        lattice_points(in_contact, columns, shifts[n, 0], shifts[n, 1], sectors, top, lattices[n])
        for i in range(given.shape[0]):
            for k in range(given.shape[1]):
                from_emitter[n, i, k] = given[i, k]
    on_cells = in_contact if reflectances[TIP] > 0.0 else 0
    given_cells = np.zeros((count, emitters.shape[0], on_cells, columns.shape[0]))
    several_times(
        result, from_emitter, given_cells, wanted, emitters, receivers, scale, sectors, box, top, shifts, lattices,
        columns, layout, settings,
    )  # fmt: skip
    taken_cells = np.zeros((receivers.shape[0], on_cells, columns.shape[0]))
    echoes = np.empty((rows, columns.shape[0], ECHO_COLUMNS))
    seen = np.zeros(wanted.shape)
    p = np.zeros(POINT_COLUMNS)
    on_tip = np.zeros((0, 0))
    if reflectances[TIP] > 0.0:
        on_tip = shares_on_tip(receivers, orders, box, top)
    for n in range(count):
        from_receiver = taken.copy()
        if box[5] > 0.0:
            rays = (flat_rays[0][n], flat_rays[1][n], flat_rays[2][n])
            seen[:] = 0.0
            walled(from_emitter[n], from_receiver, seen, wanted, emitters, receivers, box, top, points,
                   int(settings[RAYS]), shifts[n], layout, rays)  # fmt: skip
        else:
            for j in range(receivers.shape[0]):
                if wanted[:, j].any():
                    top_change(receivers[j], receivers, lattices[n],
                               golden_shift(j + RECEIVER_SEQUENCE)[:2] + shifts[n, 2:4], layout, box, top,
                               from_receiver[j], echoes, settings[RAY_SHARE], shifts[n], sectors, p)  # fmt: skip
                    put_power(echoes, taken_cells[j])
        now = all_orders(
            from_emitter[n], from_receiver, receivers, patches, reflectances, orders, on_tip, box, top
        )
        if box[5] == 0.0:
            now[1] += first_hand_on_tip(
                given_cells[n],
                taken_cells,
                lattices[n],
                sectors,
                emitters,
                receivers,
                reflectances[TIP],
                layout,
                box,
                top,
            )
        for i in range(emitters.shape[0]):
            for j in range(receivers.shape[0]):
                if not wanted[i, j]:
                    continue
                if box[5] > 0.0:
                    result[n, WALL, i, j] = max(flat_wall[n, i, j] + seen[i, j], 0.0)
                scattered = now[1, i, j]
                if flat_join[i, j] > 0.0:
                    scattered += flat_diffuse[i, j] * now[0, i, j] / flat_join[i, j]
                result[n, DIFFUSE, i, j] = max(scattered, 0.0)


@array_kernel
def walled(
    from_emitter: FloatArray, from_receiver: FloatArray, seen: FloatArray, wanted: BoolArray, emitters: FloatArray,
    receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray, count: int, shift: FloatArray,
    layout: IntArray, flat_rays: UntouchedRays,
) -> None:  # fmt: skip
    """Between smooth walls, add the press's change of deposits on patches and of light mirrored onto receivers.

    The untouched light to be subtracted was traced with the same rays.
    """
    given, taken, flat_seen = flat_rays
    from_emitter -= given
    from_receiver -= taken
    seen -= flat_seen
    none = np.zeros(receivers.shape[0])
    for k in range(2):
        gathers = k == 1
        patches = receivers if gathers else emitters
        out = from_receiver if gathers else from_emitter
        first = RECEIVER_SEQUENCE if gathers else EMITTER_SEQUENCE
        for i in range(patches.shape[0]):
            if wanted[:, i].any() if gathers else wanted[i].any():
                deposit(patches[i], gathers, receivers, box, top, points, count, golden_shift(i + first) + shift[2:6],
                        layout, out[i], none if gathers else seen[i])  # fmt: skip


@kernel
def unpressed(
    result: FloatArray, wanted: BoolArray, flat_straight: FloatArray, flat_diffuse: FloatArray, flat_wall: FloatArray,
) -> None:  # fmt: skip
    """Fill (replicate, class, emitter, receiver) with the requested pairs' untouched flux."""
    for n in range(result.shape[0]):
        for i in range(wanted.shape[0]):
            for j in range(wanted.shape[1]):
                if wanted[i, j]:
                    result[n, DIRECT, i, j] = flat_straight[0, i, j]
                    result[n, TOPS, i, j] = flat_straight[1, i, j]
                    result[n, WALL, i, j] = flat_wall[n, i, j]
                    result[n, DIFFUSE, i, j] = flat_diffuse[i, j]


@kernel
def repeat_first(result: FloatArray) -> None:
    """Copy the first replicate to all others. Loops, as Numba takes seconds to compile an assignment of arrays."""
    for n in range(1, result.shape[0]):
        for k in range(result.shape[1]):
            for i in range(result.shape[2]):
                for j in range(result.shape[3]):
                    result[n, k, i, j] = result[0, k, i, j]


@array_kernel
def reflected_once(
    result: FloatArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray, box: FloatArray, top: Top,
    flat: UntouchedLight, scale: FloatArray, rules: StraightRules, image_rules: ImageRules, shifts: FloatArray,
    settings: FloatArray,
) -> None:  # fmt: skip
    """Fill (replicate, class, emitter, receiver) with direct flux and flux that the top mirrors once.

    An untouched state gets its flux of all classes.
    """
    flat_straight, flat_diffuse, flat_wall, _, _, _ = flat
    if not is_touched(top):
        unpressed(result, wanted, flat_straight, flat_diffuse, flat_wall)
        return
    keeps = np.zeros(wanted.shape, np.bool_)
    straight(result[0], keeps, wanted, emitters, receivers, flat_straight, box, top, rules)
    repeat_first(result)
    mirrored_once(
        result, keeps, wanted, emitters, receivers, scale, sectors_of(top, box), box, top, image_rules, shifts,
        settings,
    )  # fmt: skip


@array_kernel
def reflected_further(
    result: FloatArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray, box: FloatArray, top: Top,
    flat: UntouchedLight, scale: FloatArray, points: FloatArray, shifts: FloatArray, patches: Patches,
    reflectances: FloatArray, orders: Orders, settings: FloatArray, flat_rays: UntouchedRays,
) -> None:  # fmt: skip
    """Add to a pressed state the flux that `reflected_once` leaves out; an untouched state is left as it is."""
    _, flat_diffuse, flat_wall, given, taken, flat_join = flat
    if is_touched(top):
        beyond_one(
            result, wanted, emitters, receivers, (flat_diffuse, flat_wall, given, taken, flat_join), scale,
            sectors_of(top, box), box, top, points, shifts, patches, reflectances, orders, settings, flat_rays,
        )  # fmt: skip
