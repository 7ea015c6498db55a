"""The Cramér-Rao bound on a press's location and depth, with unknown drift, reference depth and stage position.

Model
-----
One frame of signals y (lit minus off, all pairs) at the stage's position θ = (x, y, depth) has

    y = D(e, r) m(θ + δ) + n,     D(e, r) = diag (1 + e_i + r_j) for the pair of emitter i and receiver j

    n     independent noise of a pair, covariance V: read noise and rounding of both readings, shot noise
    e, r  gains: fluctuation of an emitter within the frame and drift of the set; drift of a receiver since its
          untouched signal was taken; normal, mean 0
    δ     offset of the tip from the stage's position: error of positioning in x and y, of the reference depth (set and
          location), half the backlash; normal, mean 0, covariance Δ

e, r and δ have priors, so the bound is a hybrid one (Van Trees 1968, section 2.4; Messer 2006). The information in the
priors is added to that in the data, and e, r and δ are eliminated by a Schur complement. For e and r that leaves

    F = Jᵀ C⁻¹ J,   C = V + G Gᵀ      (`optopad.sims.learning.inference.signal_map`; J = ∂m/∂θ)

and for δ, which enters only as θ + δ,

    F⁻¹ for the tip's position,     F⁻¹ + Δ for the stage's reported position

J is computed twice, by finite differences of independently seeded light. F is the symmetrised product of the two, so
that the trace's noise does not count as information (`optopad.sims.bounds.fisher`). Both are multiplied by L⁻¹, with C
= L Lᵀ, and passed to `bounds_of` with weights of 1. Pairs that are at full scale at any press of the differences are
left out.

Left out: everything that `optopad.sims.bounds.fisher` leaves out; flicker of ambient light (the surroundings are
assumed dark); several frames of a set, which would determine its drift and its reference depth together. The gains'
part of C is taken at the mean signals. The two values of the backlash count as a normal distribution of the same
spread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.progress import OnShare
from optopad.design.shape.cavity import workspace_of
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.fisher import (
    SEED_GAP,
    Bounds,
    Sensitivity,
    Steps,
    bounds_of,
    stencil_derivatives,
    stencil_presses,
)
from optopad.sims.learning.inference.signal_map import ReadingNoise
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.tracing import trace

EVENLY = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps in x and y of an evenly spread sequence of locations in the unit square: 1/p and 1/p² with p³ = p + 1 (M.
Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018).
"""


@dataclass(frozen=True, kw_only=True)
class StageErrors:
    """Standard deviations of the tip's position about the stage's: one for each of x and y, and one for depth [mm]."""

    position_mm: float
    depth_mm: float


def stage_errors(design: SensorDesign) -> StageErrors:
    """Positioning errors of the stage: per set, per press, and half the backlash, added in quadrature."""
    noise = design.noise
    depth = np.hypot(noise.zero_offset_set_mm, noise.zero_offset_place_mm)
    return StageErrors(
        position_mm=noise.position_error_mm, depth_mm=float(np.hypot(depth, 0.5 * noise.retract_lag_mm))
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ChainBounds:
    """Least standard deviations of unbiased estimates from one frame [mm]; infinite where not resolved.

    Attributes
    ----------
    tip : bounds on the tip's position, with unknown gains
    stage : errors of the stage; added in quadrature to `tip`, they give the bounds on the stage's reported position
    """

    tip: Bounds
    stage: StageErrors

    @property
    def location_mm(self) -> FloatArray:
        """Bound (n,) on the stage's reported location, √(var x + var y) [mm]."""
        return np.asarray(np.hypot(self.tip.location_mm, np.sqrt(2.0) * self.stage.position_mm))

    @property
    def depth_mm(self) -> FloatArray:
        """Bound (n,) on the stage's reported depth [mm]."""
        return np.asarray(np.hypot(self.tip.depth_mm, self.stage.depth_mm))


def bounds_under(
    first: FloatArray, second: FloatArray, signals: FloatArray, noise: ReadingNoise, stage: StageErrors
) -> ChainBounds:
    """Bounds at n presses, from the slopes of the signals.

    Parameters
    ----------
    first, second : (n, pair, 3) two independent estimates of the signals' slopes by x, y, depth [counts/mm]
    signals : (n, pair) mean signals [counts]; pairs at or above `noise.clip_counts` are left out
    """
    is_lost = signals >= noise.clip_counts
    reached = np.where(is_lost, 0.0, signals)
    columns = noise.gain_columns(reached)
    covariance = np.swapaxes(columns, 1, 2) @ columns
    pairs = np.arange(signals.shape[1])
    covariance[:, pairs, pairs] += noise.variance(reached)
    root = np.linalg.cholesky(covariance)
    whitened = [np.linalg.solve(root, np.where(is_lost[..., None], 0.0, half)) for half in (first, second)]
    answers = Sensitivity(first=whitened[0], second=whitened[1], weight=np.ones(signals.shape))
    return ChainBounds(tip=bounds_of(answers), stage=stage)


def chain_bounds(
    design: SensorDesign,
    press_mm: FloatArray,
    gains: FloatArray,
    noise: ReadingNoise,
    *,
    stage: StageErrors | None = None,
    accuracy: str | Accuracy = "draft",
    seed: int = 0,
    steps: Steps | None = None,
    on_step: OnShare | None = None,
) -> ChainBounds:
    """Bounds at n presses of a design; light is traced 12 times for each press.

    Parameters
    ----------
    press_mm : (n, 3) x, y, depth [mm]
    gains : counts per flux, (receiver,) or (emitter, receiver) [counts]
    noise : noise of a frame; pairs at or above its `clip_counts` are left out
    stage : errors of the stage; if None, those of the design
    accuracy, seed : accuracy setting and random seed of the light model; the second estimate of the slopes has ``seed +
        SEED_GAP``
    on_step : called with the fraction done (0 to 1)

    Raises
    ------
    ModelScopeError : the contact or light model does not cover a press.
    """
    offsets = (steps or Steps()).offsets_mm(press_mm[:, 2])
    presses = stencil_presses(press_mm, offsets)
    halves = []
    for half in range(2):
        light = trace(
            Draft.of(design),
            presses,
            accuracy=accuracy,
            seed=seed + SEED_GAP * half,
            on_step=None if on_step is None else _share_of(on_step, half),
        )
        halves.append((light.flux * gains).reshape(len(press_mm), -1, light.flux[0].size))
    highest = np.maximum(*(signals.max(axis=1) for signals in halves))
    mean = 0.5 * sum(signals.mean(axis=1) for signals in halves)
    first, second = (stencil_derivatives(signals, offsets) for signals in halves)
    reached = np.where(highest >= noise.clip_counts, noise.clip_counts, mean)
    return bounds_under(first, second, reached, noise, stage or stage_errors(design))


def _share_of(on_step: OnShare, half: int) -> Callable[[int, int], None]:
    return lambda done, total: on_step(0.5 * (half + done / total))


def bounds_by_depth(
    design: SensorDesign,
    gains: FloatArray,
    noise: ReadingNoise,
    depths_mm: Sequence[float],
    *,
    places: int = 9,
    accuracy: str | Accuracy = "draft",
    seed: int = 0,
    on_step: OnShare | None = None,
) -> dict[float, tuple[float, float]]:
    """Bounds on location and on depth [mm] by depth [mm], as medians over locations in the workspace.

    A depth is left out if one of its medians is infinite, that is, if half of the locations or more are not resolved.

    Parameters
    ----------
    gains, noise, accuracy, seed, on_step : see `chain_bounds`
    depths_mm : depths of the presses, above 0 [mm]
    places : number of evenly spread locations; light is traced 12 times for each location and depth
    """
    space = workspace_of(design)
    share = np.outer(np.arange(1, places + 1), EVENLY) % 1.0
    press_mm = np.array([[x, y, depth] for depth in depths_mm for x, y in space.spread(share).tolist()])
    found = chain_bounds(design, press_mm, gains, noise, accuracy=accuracy, seed=seed, on_step=on_step)
    shape = (len(depths_mm), places)
    location, depth = (np.median(one.reshape(shape), axis=1) for one in (found.location_mm, found.depth_mm))
    return {
        float(at): (float(one), float(other))
        for at, one, other in zip(depths_mm, location, depth, strict=True)
        if np.isfinite([one, other]).all()
    }
