"""The oracle: a plain forward Monte-Carlo tracer that checks the fast light engine.

It shares no intersection, surface or Fresnel code with the fast engine; only the scene and the press,
as data, are common. Light walks from each emitter as `sims.optics.oracle_walk` describes; the top is
what `sims.optics.oracle_surface` describes, with what both leave out.

Classes of received light
-------------------------
- `direct`: no interaction on the way.
- `top`: mirrored at the top only, each time where the surface slopes by at most 0.02.
- `skirt`: mirrored at the top only, at least once where a press makes it slope by more than 0.02.
- `diffuse`: scattered at least once by a wall, the bottom or the tip.

The border between `top` and `skirt` is a convention: another definition moves light between the two and
leaves their sum alone.

Accuracy
--------
Standard errors come from the second moment over rays. A pair that no ray reached has a standard error of
zero, which means "not resolved", not "known to be zero": below about `1 / rays` nothing is seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from design.errors import InputError
from sims.indentation import Indentation
from sims.optics.oracle_surface import RevolvedSurface, lower_surface
from sims.optics.oracle_walk import DIFFUSE, FATES, VOLUME, Scene, ray_stream, walk
from sims.optics.scene import OpticalScene

FloatArray = NDArray[np.float64]

CLASSES = FATES[: DIFFUSE + 1]
"""Classes of received light, in the order of `OracleLight.flux`."""
FATE_COUNT = len(FATES)
BATCHES = 256
"""Parts in which the rays of one emitter are summed; fixed, so that threads never change an answer."""


@dataclass(frozen=True, kw_only=True)
class OracleLight:
    """What the oracle counted. Fluxes are fractions of the power of the emitter's whole area.

    Attributes
    ----------
    flux : (class, state, emitter, receiver) by `CLASSES` [-]
    class_standard_error : (class, state, emitter, receiver) of `flux` [-]
    standard_error : (state, emitter, receiver) of the flux summed over classes [-]
    ledger : (fate, state, emitter) share of the emitted power by `FATES` [-]: received by class; absorbed
        at walls, bottom and tip, and in the volume; escaped through the top; `unsubmerged`, radiated by
        the part of the emitter that is above the surface; `unresolved`, rays given up. It sums to 1.
    rays : per emitter and state
    seed : of the random streams
    """

    flux: FloatArray
    class_standard_error: FloatArray
    standard_error: FloatArray
    ledger: FloatArray
    rays: int
    seed: int

    @property
    def total(self) -> FloatArray:
        """(state, emitter, receiver) flux summed over classes [-]."""
        return np.asarray(self.flux.sum(axis=0))


def trace_oracle(
    scene: OpticalScene,
    centres_mm: ArrayLike,
    indentations: Sequence[Indentation | None],
    *,
    rays: int = 1_000_000,
    seed: int = 0,
    on_step: Callable[[int, int], None] | None = None,
) -> OracleLight:
    """Trace every emitter in every state.

    Parameters
    ----------
    centres_mm : (state, 2) x and y of the press axes [mm]; not read where the pad is untouched
    indentations : one press or None (untouched) for each state
    rays : for each emitter and state
    seed : of the random streams, >= 0
    on_step : called with emitters done and emitters in all, over all states
    """
    if rays < 2:
        raise InputError(f"rays: {rays} is too few; at least 2")
    lowered = lower_scene(scene)
    surfaces = lower_presses(scene, centres_mm, indentations)
    check_seed(seed)
    emitters, receivers = len(scene.emitter_wall), len(scene.receiver_wall)
    flux = np.zeros((len(CLASSES), len(surfaces), emitters, receivers))
    square = np.zeros_like(flux)
    ledger = np.zeros((len(FATES), len(surfaces), emitters))
    for state, surface in enumerate(surfaces):
        for emitter in range(emitters):
            sums = _trace_emitter(lowered, surface, seed, state, emitter, rays)
            flux[:, state, emitter], square[:, state, emitter], ledger[:, state, emitter] = (
                np.asarray(part.sum(axis=0)) / rays for part in sums
            )
            if on_step is not None:
                on_step(state * emitters + emitter + 1, len(surfaces) * emitters)
    return OracleLight(
        flux=flux,
        class_standard_error=_standard_error(flux, square, rays),
        standard_error=_standard_error(flux.sum(axis=0), square.sum(axis=0), rays),
        ledger=ledger,
        rays=rays,
        seed=seed,
    )


def _standard_error(mean: FloatArray, mean_square: FloatArray, rays: int) -> FloatArray:
    """Standard error of a mean over rays, each of which adds to one bin only."""
    return np.asarray(np.sqrt(np.maximum(mean_square - mean * mean, 0.0) / (rays - 1)))


def check_seed(seed: int) -> None:
    """Refuse seeds that do not fit a random stream."""
    if not 0 <= seed < 2**63:
        raise InputError(f"seed: {seed} must lie between 0 and 2^63 - 1")


def lower_presses(
    scene: OpticalScene, centres_mm: ArrayLike, indentations: Sequence[Indentation | None]
) -> list[RevolvedSurface]:
    """Check the states' presses and turn each into numbers.

    centres_mm : (state, 2) [mm]; indentations : (state,).
    """
    centres = np.asarray(centres_mm, dtype=np.float64)
    if centres.ndim != 2 or centres.shape != (len(indentations), 2):
        raise InputError(
            f"centres_mm: shape {centres.shape}, needs ({len(indentations)}, 2): one x, y per indentation"
        )
    size = (scene.length_mm, scene.width_mm)
    surfaces = []
    for state, (centre, press) in enumerate(zip(centres, indentations, strict=True)):
        if press is not None and press.depth_mm > 0.0:
            for name, place, limit in zip("xy", centre, size, strict=True):
                if not 0.0 <= place <= limit:
                    raise InputError(
                        f"centres_mm[{state}]: {name} = {place:g} mm is outside the pad, 0 to {limit:g} mm"
                    )
        surfaces.append(lower_surface(press, centre, scene.height_mm, f"indentations[{state}]"))
    return surfaces


def lower_scene(scene: OpticalScene) -> Scene:
    """Check a scene and turn it into a tuple for compiled code."""
    for name in ("length_mm", "width_mm", "height_mm"):
        _require(name, getattr(scene, name), 0.0, np.inf, open_low=True)
    _require("refractive_index", scene.refractive_index, 1.0, np.inf)
    _require("absorption_per_mm", scene.absorption_per_mm, 0.0, np.inf)
    for name in ("wall_reflectance", "bottom_reflectance", "tip_reflectance"):
        _require(name, getattr(scene, name), 0.0, 1.0)
    for kind in ("emitter", "receiver"):
        _check_patches(scene, kind)
    order = np.asarray(scene.emitter_order, dtype=np.float64)
    if order.shape != np.shape(scene.emitter_wall):
        raise InputError(f"emitter_order: shape {order.shape}, needs {np.shape(scene.emitter_wall)}")
    for i, m in enumerate(order):
        _require(f"emitter_order[{i}]", float(m), 0.0, np.inf)
    return Scene(
        float(scene.length_mm),
        float(scene.width_mm),
        float(scene.height_mm),
        float(scene.refractive_index),
        float(scene.absorption_per_mm),
        float(scene.wall_reflectance),
        float(scene.bottom_reflectance),
        float(scene.tip_reflectance),
        np.ascontiguousarray(scene.emitter_wall, dtype=np.int64),
        np.ascontiguousarray(scene.emitter_patch, dtype=np.float64),
        np.ascontiguousarray(order),
        np.ascontiguousarray(scene.receiver_wall, dtype=np.int64),
        np.ascontiguousarray(scene.receiver_patch, dtype=np.float64),
    )


def _require(name: str, value: float, low: float, high: float, *, open_low: bool = False) -> None:
    """Refuse a number outside its range, NaN and infinity."""
    if not (np.isfinite(value) and low <= value <= high and not (open_low and value == low)):
        sign = ">" if open_low else ">="
        limit = f"{sign} {low:g}" + ("" if np.isinf(high) else f" and <= {high:g}")
        raise InputError(f"{name}: {value:g} must be {limit}")


def _check_patches(scene: OpticalScene, kind: str) -> None:
    """Refuse emitters or receivers that are not rectangles on a wall of the block."""
    walls, patches = np.asarray(getattr(scene, f"{kind}_wall")), np.asarray(getattr(scene, f"{kind}_patch"))
    if walls.ndim != 1 or patches.shape != (walls.size, 4):
        raise InputError(f"{kind}_patch: shape {patches.shape}, needs ({walls.size}, 4)")
    for i, (wall, patch) in enumerate(zip(walls, patches, strict=True)):
        name = f"{kind}_patch[{i}]"
        if wall not in (0, 1, 2, 3):
            raise InputError(f"{kind}_wall[{i}]: {wall} is no wall; south 0, east 1, north 2, west 3")
        if not np.isfinite(patch).all() or patch[2] <= 0.0 or patch[3] <= 0.0:
            raise InputError(f"{name}: {patch.tolist()} must be finite, with half sizes > 0 mm")
        run = scene.length_mm if wall in (0, 2) else scene.width_mm
        if patch[0] - patch[2] < 0.0 or patch[0] + patch[2] > run:
            raise InputError(
                f"{name}: spans {patch[0] - patch[2]:g} to {patch[0] + patch[2]:g} mm along a wall of"
                f" {run:g} mm; move it along the wall"
            )
        if patch[1] - patch[3] < 0.0:
            raise InputError(f"{name}: reaches {patch[3] - patch[1]:g} mm below the bottom; raise it")


@njit(cache=True, parallel=True)
def _trace_emitter(
    scene: Scene, surface: RevolvedSurface, seed: int, state: int, emitter: int, rays: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over rays in each batch: received weight and its square by class, and the ledger."""
    receivers = scene.receiver_wall.shape[0]
    flux = np.zeros((BATCHES, DIFFUSE + 1, receivers))
    square = np.zeros((BATCHES, DIFFUSE + 1, receivers))
    ledger = np.zeros((BATCHES, FATE_COUNT))
    for batch in prange(BATCHES):
        vertices = np.empty((0, 3))
        for ray in range(batch * rays // BATCHES, (batch + 1) * rays // BATCHES):
            stream = ray_stream(seed, state, emitter, ray)
            fate, receiver, weight, _ = walk(scene, surface, emitter, stream, vertices)
            ledger[batch, fate] += weight
            ledger[batch, VOLUME] += 1.0 - weight
            if receiver >= 0:
                flux[batch, fate, receiver] += weight
                square[batch, fate, receiver] += weight * weight
    return flux, square, ledger
