# mypy: no-warn-return-any
"""Entry points of the light model for flat rectangular pads, compiled and cached on disk."""

from __future__ import annotations

import sys

import numpy as np
from numba import njit

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.compiling import listen_to_numba
from optopad.sims.kernels import entry_points
from optopad.sims.optics.engine import images, mirrored, repeated, states, straight
from optopad.sims.optics.engine import scattered as scattered_kernels
from optopad.sims.optics.engine.repeated import all_orders
from optopad.sims.optics.engine.scattered import bounces, deposit, golden_shift, join, layout_of
from optopad.sims.optics.engine.scattered import patch_areas as areas_of
from optopad.sims.optics.engine.straight import flat_flux
from optopad.sims.optics.kernel_types import (
    ImageRules,
    Orders,
    Patches,
    StraightRules,
    UntouchedLight,
    UntouchedRays,
)
from optopad.sims.optics.surface import curves, radial, tops
from optopad.sims.optics.surface.tops import Top

EMITTER_SEQUENCE, RECEIVER_SEQUENCE = states.EMITTER_SEQUENCE, states.RECEIVER_SEQUENCE
KERNEL_MODULES = (
    curves,
    radial,
    tops,
    straight,
    mirrored,
    images,
    scattered_kernels,
    repeated,
    states,
    sys.modules[__name__],
)
kernel = entry_points(KERNEL_MODULES, error_model="numpy", nogil=True)
# inlined into their entry points: compiled alone, all functions below them would be optimised twice
put_once = njit(inline="always", error_model="numpy")(states.reflected_once.py_func)
put_further = njit(inline="always", error_model="numpy")(states.reflected_further.py_func)


@kernel
def flat_matrix(
    emitters: FloatArray, receivers: FloatArray, box: FloatArray, rules: StraightRules
) -> FloatArray:
    """(2, emitter, receiver): direct flux, and flux mirrored by the flat untouched top."""
    nodes_e, weights_e, nodes_u, weights_u, nodes_z, weights_z = rules
    out = np.zeros((2, emitters.shape[0], receivers.shape[0]))
    for i in range(emitters.shape[0]):
        for j in range(receivers.shape[0]):
            if emitters[i, 0] != receivers[j, 0]:
                for mirrored in range(2):
                    out[mirrored, i, j] = flat_flux(
                        emitters[i],
                        receivers[j],
                        box,
                        mirrored == 1,
                        nodes_e,
                        weights_e,
                        nodes_u,
                        weights_u,
                        nodes_z,
                        weights_z,
                    )
    return out


@kernel
def untouched_deposits(
    sources: FloatArray, gathers: bool, receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray,
    count: int, shift: FloatArray, first: float, layout: IntArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """(source, patch) light deposited under the untouched top; (source, receiver) light mirrored by smooth walls."""
    out = np.zeros((sources.shape[0], layout[5, 2] + layout[5, 0] * layout[5, 1]))
    seen = np.zeros((sources.shape[0], receivers.shape[0]))
    for i in range(sources.shape[0]):
        moved = golden_shift(i + first) + shift
        deposit(sources[i], gathers, receivers, box, top, points, count, moved, layout, out[i], seen[i])
    return out, seen


@kernel
def joined(
    given: FloatArray, taken: FloatArray, receivers: FloatArray, areas: FloatArray, layout: IntArray,
    reflectances: FloatArray,
) -> FloatArray:  # fmt: skip
    """(emitter, receiver) flux scattered once, from the light deposited on patches."""
    out = np.zeros((given.shape[0], taken.shape[0]))
    for i in range(given.shape[0]):
        for j in range(taken.shape[0]):
            area = 4.0 * receivers[j, 3] * receivers[j, 4]
            out[i, j] = join(given[i], taken[j], area, areas, layout, reflectances)
    return out


@kernel
def scattered(
    given: FloatArray, taken: FloatArray, receivers: FloatArray, patches: Patches, reflectances: FloatArray,
    orders: Orders, box: FloatArray, top: Top,
) -> FloatArray:  # fmt: skip
    """(emitter, receiver) flux scattered once or more often, from the light deposited on patches."""
    none = np.zeros((0, 0))
    return all_orders(given, taken, receivers, patches, reflectances, orders, none, box, top)[0]


@kernel
def bounce_matrix(
    layout: IntArray, receivers: FloatArray, box: FloatArray, top: Top, points: FloatArray, count: int
) -> FloatArray:
    """(patch, patch) share of one patch's scattered light that lands on another under the untouched top."""
    return bounces(layout, receivers, box, top, points, count)


@kernel
def trace_once(
    out: FloatArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray, box: FloatArray, row: FloatArray,
    field: FloatArray, flat: UntouchedLight, scale: FloatArray, rules: StraightRules, image_rules: ImageRules,
    shifts: FloatArray, settings: FloatArray,
) -> None:  # fmt: skip
    """Fill `out` (replicate, class, emitter, receiver) with direct flux and flux mirrored once, per emitted power."""
    put_once(
        out,
        wanted,
        emitters,
        receivers,
        box,
        Top(row, field),
        flat,
        scale,
        rules,
        image_rules,
        shifts,
        settings,
    )


@kernel
def trace_further(
    out: FloatArray, wanted: BoolArray, emitters: FloatArray, receivers: FloatArray, box: FloatArray, row: FloatArray,
    field: FloatArray, flat: UntouchedLight, scale: FloatArray, points: FloatArray, shifts: FloatArray,
    patches: Patches, reflectances: FloatArray, orders: Orders, settings: FloatArray, flat_rays: UntouchedRays,
) -> None:  # fmt: skip
    """Add to `out` the flux mirrored several times by the top, the flux mirrored by walls, and the scattered flux."""
    put_further(
        out, wanted, emitters, receivers, box, Top(row, field), flat, scale, points, shifts, patches, reflectances,
        orders, settings, flat_rays,
    )  # fmt: skip


@kernel
def patch_layout(box: FloatArray, size: float) -> IntArray:
    """(6, 3): number of patch columns, of patch rows, and index of the first patch, on walls 0-3, bottom and tip."""
    return layout_of(box, size)


@kernel
def patch_areas(layout: IntArray, receivers: FloatArray, box: FloatArray) -> FloatArray:
    """(patch,) area less receivers' faces [mm²]; 0 for the tip's patches, which change with the press."""
    return areas_of(layout, receivers, box)


listen_to_numba()
