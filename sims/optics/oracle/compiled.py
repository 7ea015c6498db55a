"""The oracle's two compiled entry points, kept on disk; everything below them is compiled into them.

What every flight goes through is forced inline: calls that hand over a scene of arrays cost a third of the speed.
"""

from __future__ import annotations

import sys

import numpy as np
from numba import prange

from design.arrays import BoolArray, FloatArray
from sims.cache.compiling import listen_to_numba
from sims.cache.kernels import entry_points
from sims.optics.oracle import (
    air,
    border,
    chance,
    crown,
    heights,
    march,
    outline,
    profile,
    scene,
    surface,
    top,
)
from sims.optics.oracle import walk as walk_file
from sims.optics.oracle.chance import ray_stream
from sims.optics.oracle.scene import Scene
from sims.optics.oracle.top import Top
from sims.optics.oracle.walk import CROSSING, FATES, UNSUBMERGED, VOLUME, walk

MODULES = (
    air,
    border,
    chance,
    crown,
    heights,
    march,
    outline,
    profile,
    scene,
    surface,
    top,
    walk_file,
    sys.modules[__name__],
)
CLASS_COUNT, FATE_COUNT = CROSSING + 1, len(FATES)
BATCHES = 256
"""Parts in which the rays of one emitter are summed; fixed, so that threads never change an answer."""


@entry_points(MODULES, parallel=True)
def trace_emitter(
    scene: Scene, top: Top, seed: int, state: int, emitter: int, rays: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over rays in each batch: received weight and its square by class, and the ledger."""
    receivers = scene.receiver_wall.shape[0]
    flux = np.zeros((BATCHES, CLASS_COUNT, receivers))
    square = np.zeros((BATCHES, CLASS_COUNT, receivers))
    ledger = np.zeros((BATCHES, FATE_COUNT))
    # numba fuses a loop over all batches with the arrays' and then does not compile it for a crowned top
    for batch in prange(BATCHES if rays > 0 else 0):
        vertices = np.empty((0, 3))
        for ray in range(batch * rays // BATCHES, (batch + 1) * rays // BATCHES):
            stream = ray_stream(seed, state, emitter, ray)
            fate, receiver, weight, _ = walk(scene, top, emitter, stream, vertices)
            ledger[batch, fate] += weight
            ledger[batch, VOLUME] += 1.0 - weight
            if receiver >= 0:
                flux[batch, fate, receiver] += weight
                square[batch, fate, receiver] += weight * weight
    return flux, square, ledger


@entry_points(MODULES, nogil=True)
def next_path(
    scene: Scene, top: Top, emitter: int, wanted: BoolArray, seed: int, ray: int, tries: int, places: int
) -> tuple[int, int, int, FloatArray]:
    """Number, fate, receiver and places of the next ray that ends where it is wanted."""
    vertices = np.empty((places, 3))
    for number in range(ray, ray + tries):
        stream = ray_stream(seed, 0, emitter, number)
        fate, receiver, _, count = walk(scene, top, emitter, stream, vertices)
        if fate != UNSUBMERGED and count <= places and wanted[receiver]:  # -1, lost, is the last
            return number, fate, receiver, vertices[:count].copy()
    return ray + tries, -1, -1, vertices[:0].copy()


listen_to_numba()
