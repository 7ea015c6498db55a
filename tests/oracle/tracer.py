"""The oracle: a plain Monte-Carlo ray tracer that checks the fast light model.

It shares no intersection, surface or Fresnel code with the fast model; the two have only the data of scene and press in
common. Rays start at each emitter and may pass through air, as `tests.oracle.walk` describes.
`tests.oracle.surface` describes the top and its limits.

Classes of received light
-------------------------
- `direct`: no interaction on the way.
- `top`: mirrored at the top only, each time where the surface slopes by at most 0.02 against the untouched top.
- `skirt`: mirrored at the top only, at least once where a press makes it slope by more than 0.02.
- `wall`: never scattered, mirrored by a smooth wall at least once.
- `diffuse`: scattered at least once by a wall, the bottom or the tip.
- `crossing`: left through the top, crossed air and entered again at least once, with or without other interactions. The
fast model leaves this class out; compare it with `OracleLight.without_crossing`.

The border between `top` and `skirt` is a convention: another definition moves light between the two but does not change
their sum.

Accuracy
--------
Standard errors come from the second moment over rays. A pair that no ray reached has a standard error of zero, which
means that its flux is unknown, not that it is zero: flux below about `1 / rays` is not detected.

The two compiled entry points are cached on disk, together with all functions that they call. Functions that every
flight calls are forced inline: calls that pass a scene of arrays would cost a third of the speed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import prange
from numpy.typing import ArrayLike

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.compiling import listen_to_numba
from optopad.sims.kernels import entry_points
from optopad.sims.optics.scene.optical_scene import OpticalScene, SmoothField
from tests.oracle import chance, scene, surface, top
from tests.oracle import walk as walk_file
from tests.oracle.chance import ray_stream
from tests.oracle.scene import OracleScene, lower_scene
from tests.oracle.surface import Surface
from tests.oracle.top import Presses, lower_presses
from tests.oracle.walk import CROSSING, FATES, UNSUBMERGED, VOLUME, walk

MODULES = (
    chance,
    scene,
    surface,
    top,
    walk_file,
    sys.modules[__name__],
)
CLASS_COUNT, FATE_COUNT = CROSSING + 1, len(FATES)
BATCHES = 256
"""Number of batches in which the rays of one emitter are summed. It is fixed, so that threads never change a result."""


@entry_points(MODULES, parallel=True)
def trace_emitter(
    scene: OracleScene, top: Surface, seed: int, state: int, emitter: int, rays: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Trace the rays of one emitter; return sums over the rays of each batch.

    The sums are of the received weight by class and receiver, of its square, and of the weight by fate (`FATES`).
    """
    receivers = scene.receiver_wall.shape[0]
    flux = np.zeros((BATCHES, CLASS_COUNT, receivers))
    square = np.zeros((BATCHES, CLASS_COUNT, receivers))
    ledger = np.zeros((BATCHES, FATE_COUNT))
    # numba fuses a loop over all batches with the arrays' and then does not compile it for a sum
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
    scene: OracleScene,
    top: Surface,
    emitter: int,
    wanted: BoolArray,
    seed: int,
    ray: int,
    tries: int,
    places: int,
) -> tuple[int, int, int, FloatArray]:
    """Trace rays from number `ray` on until one ends as requested; return number, fate (-1: none), receiver, points."""
    vertices = np.empty((places, 3))
    for number in range(ray, ray + tries):
        stream = ray_stream(seed, 0, emitter, number)
        fate, receiver, _, count = walk(scene, top, emitter, stream, vertices)
        if fate != UNSUBMERGED and count <= places and wanted[receiver]:  # -1, lost, is the last
            return number, fate, receiver, vertices[:count].copy()
    return ray + tries, -1, -1, vertices[:0].copy()


listen_to_numba()

CLASSES = FATES[: CROSSING + 1]
"""Classes of received light, in the order of `OracleLight.flux`."""


@dataclass(frozen=True, kw_only=True)
class OracleLight:
    """Light counted by the oracle. Fluxes are fractions of the power of the emitter's whole area.

    Attributes
    ----------
    flux : (class, state, emitter, receiver) flux by `CLASSES` [-]
    class_standard_error : (class, state, emitter, receiver) standard error of `flux` [-]
    standard_error : (state, emitter, receiver) standard error of the flux summed over classes [-]
    ledger : (fate, state, emitter) share of the emitted power by fate (`FATES`) [-]: received, by class; absorbed at
        walls, bottom, tip and skin, and in the volume; escaped through the top; `uncounted` light, which met a receiver
        but was not counted; `unsubmerged` light, radiated by the part of the emitter that is above the surface or below
        the bottom; `unresolved` light, whose rays were given up. The sum over fates is 1
    rays : number of rays per emitter and state
    seed : seed of the random streams
    """

    flux: FloatArray
    class_standard_error: FloatArray
    standard_error: FloatArray
    ledger: FloatArray
    rays: int
    seed: int

    @property
    def total(self) -> FloatArray:
        """(state, emitter, receiver) flux summed over all classes [-]."""
        return np.asarray(self.flux.sum(axis=0))

    @property
    def without_crossing(self) -> FloatArray:
        """(state, emitter, receiver) flux of light that never left the elastomer [-], as in the fast model."""
        return np.asarray(self.flux[:CROSSING].sum(axis=0))


def trace_oracle(
    scene: OpticalScene,
    centres_mm: ArrayLike,
    indentations: Sequence[Presses],
    *,
    fields: Sequence[SmoothField | None] | None = None,
    rays: int = 1_000_000,
    seed: int = 0,
    on_step: Callable[[int, int], None] | None = None,
) -> OracleLight:
    """Trace every emitter in every state.

    Parameters
    ----------
    scene : the pad
    centres_mm : (state, 2), or (state, tip, 2), x and y of the press axes [mm]; ignored for untouched states
    indentations : for each state one press or None (untouched), or a sequence with one of these per tip
    fields : for each state a smooth height added to the top, or None. On a crown it is a function of press coordinates
        x and y (`PadForm.press_frame`), added along the normal at the press
    rays : number of rays per emitter and state
    seed : seed of the random streams, >= 0
    on_step : function called with (emitters done, emitters in all), counted over all states

    Raises
    ------
    InputError : a curve is off its tip.
    ModelScopeError : a curve folds and there are several tips, a field or a crown; contacts overlap; several tips press
        on a crown; or a crowned pad reaches too far around a press.
    """
    lowered = lower_scene(scene)
    tops = lower_presses(scene, centres_mm, indentations, fields)
    emitters, receivers = len(scene.emitter_wall), len(scene.receiver_wall)
    flux = np.zeros((len(CLASSES), len(tops), emitters, receivers))
    square = np.zeros_like(flux)
    ledger = np.zeros((len(FATES), len(tops), emitters))
    for state, pressed in enumerate(tops):
        for emitter in range(emitters):
            sums = trace_emitter(lowered, pressed, seed, state, emitter, rays)
            flux[:, state, emitter], square[:, state, emitter], ledger[:, state, emitter] = (
                np.asarray(part.sum(axis=0)) / rays for part in sums
            )
            if on_step is not None:
                on_step(state * emitters + emitter + 1, len(tops) * emitters)
    return OracleLight(
        flux=flux,
        class_standard_error=_standard_error(flux, square, rays),
        standard_error=_standard_error(flux.sum(axis=0), square.sum(axis=0), rays),
        ledger=ledger,
        rays=rays,
        seed=seed,
    )


def _standard_error(mean: FloatArray, mean_square: FloatArray, rays: int) -> FloatArray:
    """Standard error of a mean over rays, each of which adds to only one bin."""
    return np.asarray(np.sqrt(np.maximum(mean_square - mean * mean, 0.0) / (rays - 1)))
