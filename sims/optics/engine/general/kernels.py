# mypy: no-warn-return-any
"""Entry points of the light model for disc and crowned pads, compiled and cached like
`optopad.sims.optics.engine.compiled`."""

from __future__ import annotations

import sys

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.kernels import entry_points
from optopad.sims.optics.engine.general import (
    chains,
    cuts,
    deposits,
    direct,
    mirrored,
    rays,
    scattered,
    skin,
    top,
)
from optopad.sims.optics.engine.general.cuts import POINT_COLUMNS
from optopad.sims.optics.engine.general.deposits import RAY_BATCHES, deposit
from optopad.sims.optics.engine.general.direct import straight_flux
from optopad.sims.optics.engine.general.mirrored import (
    BATCHES,
    SIGHT,
    SIGHTS,
    mirrored_flux,
    top_points,
)
from optopad.sims.optics.engine.general.scattered import scattered_flux
from optopad.sims.optics.engine.general.skin import skin_again, skin_flux
from optopad.sims.optics.engine.general.top import FormedTop
from optopad.sims.optics.surface import curves, radial

KERNEL_MODULES = (
    curves,
    radial,
    top,
    rays,
    direct,
    cuts,
    chains,
    mirrored,
    scattered,
    deposits,
    skin,
    sys.modules[__name__],
)
kernel = entry_points(KERNEL_MODULES, error_model="numpy", nogil=True)
GOLDEN = 0.6180339887498949


@kernel
def straight_matrix(
    emitters: FloatArray, receivers: FloatArray, wanted: BoolArray, absorbs: float, origin: FloatArray,
    axes: FloatArray, numbers: FloatArray, row: FloatArray, grid: FloatArray, nodes_e: FloatArray,
    weights_e: FloatArray, nodes_u: FloatArray, weights_u: FloatArray, nodes_v: FloatArray, weights_v: FloatArray,
) -> FloatArray:  # fmt: skip
    """(emitter, receiver) direct light, as a share of the emitter's power."""
    top = FormedTop(origin, axes, numbers, row, grid)
    out = np.zeros((emitters.shape[0], receivers.shape[0]))
    for i in range(emitters.shape[0]):
        for j in range(receivers.shape[0]):
            if wanted[i, j]:
                out[i, j] = straight_flux(
                    emitters[i], receivers[j], absorbs, top, nodes_e, weights_e, nodes_u, weights_u, nodes_v,
                    weights_v,
                )  # fmt: skip
    return out


@kernel
def points_on(
    at: FloatArray,
    origin: FloatArray,
    axes: FloatArray,
    numbers: FloatArray,
    row: FloatArray,
    grid: FloatArray,
) -> FloatArray:
    """(n, 10) points of the top at `at` (n, 5), given in press coordinates; see `mirrored.top_points`."""
    out = np.zeros((at.shape[0], POINT_COLUMNS))
    top_points(at, FormedTop(origin, axes, numbers, row, grid), out)
    return out


@kernel
def mirrored_matrix(
    emitters: FloatArray, receivers: FloatArray, wanted: BoolArray, points: FloatArray, share: float,
    absorbs: float, index: float, walls: FloatArray, arcs: FloatArray, near: FloatArray, origin: FloatArray,
    axes: FloatArray, numbers: FloatArray, row: FloatArray, grid: FloatArray,
) -> FloatArray:  # fmt: skip
    """(2, batch, emitter, receiver) light mirrored by the top: never by the steep skirt, and at least once by it."""
    top = FormedTop(origin, axes, numbers, row, grid)
    out = np.zeros((emitters.shape[0], 2, BATCHES, receivers.shape[0]))
    work = np.zeros(SIGHTS + SIGHT * (receivers.shape[0] + 1))
    for i in range(emitters.shape[0]):
        if wanted[i].any():
            mirrored_flux(
                emitters[i], receivers, wanted[i], points, share, absorbs, index, walls, arcs, top,
                near, out[i], work,
            )  # fmt: skip
    return out.transpose(1, 2, 0, 3).copy()


@kernel
def skin_matrix(
    emitters: FloatArray, receivers: FloatArray, wanted: BoolArray, points: FloatArray, reflectance: float,
    absorbs: float, origin: FloatArray, axes: FloatArray, numbers: FloatArray, row: FloatArray, grid: FloatArray,
) -> FloatArray:  # fmt: skip
    """(2, batch, emitter, receiver) light that the skin scatters once: outside the steep skirt, and within it."""
    top = FormedTop(origin, axes, numbers, row, grid)
    out = np.zeros((2, BATCHES, emitters.shape[0], receivers.shape[0]))
    count = emitters.shape[0] + receivers.shape[0]
    work, amounts = np.zeros(SIGHTS + SIGHT * count), np.zeros(count)
    skin_flux(emitters, receivers, wanted, points, reflectance, absorbs, top, out, amounts, work)
    return out


@kernel
def skin_again_matrix(
    emitters: FloatArray, receivers: FloatArray, wanted: BoolArray, rays: int, steps: FloatArray,
    shift: FloatArray, reflectance: float, absorbs: float, walls: FloatArray, arcs: FloatArray,
    origin: FloatArray, axes: FloatArray, numbers: FloatArray, row: FloatArray, grid: FloatArray,
) -> FloatArray:  # fmt: skip
    """(batch, emitter, receiver) light that the skin scatters twice or more, and no wall or bottom."""
    top = FormedTop(origin, axes, numbers, row, grid)
    out = np.zeros((emitters.shape[0], RAY_BATCHES, receivers.shape[0]))
    for i in range(emitters.shape[0]):
        if wanted[i].any():
            moved = shift + GOLDEN * (i + 1.0) * np.arange(1, shift.shape[0] + 1)
            skin_again(
                emitters[i], receivers, rays, steps, moved, reflectance, absorbs, walls, arcs, top, out[i]
            )
    return out.transpose(1, 0, 2).copy()


@kernel
def scattered_matrix(
    emitters: FloatArray, receivers: FloatArray, rays: int, steps: FloatArray, shift: FloatArray, absorbs: float,
    index: float, reflectances: FloatArray, walls: FloatArray, arcs: FloatArray, origin: FloatArray,
    axes: FloatArray, numbers: FloatArray, row: FloatArray, grid: FloatArray,
) -> FloatArray:  # fmt: skip
    """(2, emitter, receiver) light scattered once, and light scattered more often."""
    top = FormedTop(origin, axes, numbers, row, grid)
    out = np.zeros((emitters.shape[0], 2, receivers.shape[0]))
    for i in range(emitters.shape[0]):
        moved = shift + GOLDEN * (i + 1.0) * np.arange(1, shift.shape[0] + 1)
        scattered_flux(
            emitters[i],
            receivers,
            rays,
            steps,
            moved,
            absorbs,
            index,
            reflectances,
            walls,
            arcs,
            top,
            out[i],
        )
    return out.transpose(1, 0, 2).copy()


@kernel
def deposit_matrix(
    windows: FloatArray, wanted: BoolArray, receivers: FloatArray, rays: int, steps: FloatArray,
    shift: FloatArray, absorbs: float, index: float, walls: FloatArray, arcs: FloatArray,
    origin: FloatArray, axes: FloatArray, numbers: FloatArray, row: FloatArray, grid: FloatArray,
    layout: FloatArray, patches: int,
) -> FloatArray:  # fmt: skip
    """(batch, window, patch) light on patches of walls, bottom and tip from requested emitters or receivers."""
    top = FormedTop(origin, axes, numbers, row, grid)
    out = np.zeros((windows.shape[0], RAY_BATCHES, patches))
    for i in range(windows.shape[0]):
        if wanted[i]:
            moved = shift + GOLDEN * (i + 1.0) * np.arange(1, shift.shape[0] + 1)
            deposit(
                windows[i],
                receivers,
                rays,
                steps,
                moved,
                absorbs,
                index,
                walls,
                arcs,
                top,
                layout,
                out[i],
            )
    return out.transpose(1, 0, 2).copy()
