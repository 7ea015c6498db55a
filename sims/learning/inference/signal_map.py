"""The model "signal-map": presses by least squares against the simulated signals of a design; needs numpy only.

Signals as a cubic spline over location and depth (`TensorSpline`)
------------------------------------------------------------------
On nodes at equal steps in (x, y, s), s = √depth, every pair's signal is a sum of products of uniform cubic B-splines,

    f(x, y, s) = Σ c[i + a, j + b, k + c] wₐ(x) w_b(y) w_c(s),   a, b, c = 0 ... 3  (de Boor 1978, chapter IX),

which passes through the values at the nodes. Equal steps of the root suit the signals: the contact radius grows like
√depth, and mode 1 of a pair can be over within 0.3 mm. The slope by s is zero at s = 0, so that the signal leaves its
untouched value in proportion to depth. The other ends have a third derivative that is continuous across the
neighbouring node ("not a knot"). The spline is not defined beyond its nodes: locations and depths are clamped to them.

Left out: kinks at the ends of shadows, which are rounded over a step.

Errors of readings as one normal distribution per frame (`ReadingNoise`, `Whitening`)
-------------------------------------------------------------------------------------
Signals y of all pairs (lit reading minus the off state) have the covariance

    C = V + G Gᵀ,   V = diag (floor² + shot y + (relative y)²),   G = [δₑ y by emitter | δᵣ y by receiver]

V is the independent noise of every reading (electronics and rounding of both readings, photons, other noise that grows
with the signal, the signal map's own error). G has a column for the gain of each emitter and of each receiver, with
uncertainty δ: an LED's fluctuation from frame to frame, and drift since the untouched signals were taken. Marginalising
over a normal prior of the gains adds G Gᵀ (Rasmussen and Williams 2006, eq. 2.40). So

    aᵀC⁻¹b = aᵀWb - (Ha)ᵀ(Hb),   W = V⁻¹,   H = L⁻¹GᵀW,   LLᵀ = 1 + GᵀWG        (Woodbury)

with the measured signals instead of their means. There is one factorisation per frame, used for every press that is
tried, so that the likelihoods of all presses, and of no press, can be compared. A reading at full scale has the weight
0.

Left out: the log-determinant's change with the press, drift of the off state, other errors that pairs share.

The press that explains a frame best (`found_presses`)
------------------------------------------------------
For a press θ = (x, y, depth) the signals have the mean m(θ) and the covariance C. The search minimises the square of
the residual in C⁻¹, which is minus twice the log-likelihood except for a constant,

    χ²(θ) = (y - m)ᵀ C⁻¹ (y - m),      step: (A + λ diag A) Δ = g,   A = JᵀC⁻¹J,   g = JᵀC⁻¹(y - m)

(Levenberg 1944, Marquardt 1963; J by the spline). It starts at the best press of a coarse table, and also at the best
presses of other areas. It remains inside a box: a coordinate at the border does not move beyond it. At the end, A⁻¹ is
the covariance of the press, with the gains marginalised. Pairs whose residual is still beyond `OUTLIER` deviations get
Huber's weights, and the search continues from there, so that a reading that the model does not explain moves the press
less.

Left out: presses beyond the box, other minima (the other starts are compared by χ² only), and the
spread of a flat χ²: if the touch is too light to be located, A⁻¹ is only approximate.

The model (`SignalMapModel`)
----------------------------
    signal of a pair = its untouched signal x (spline of √ratio over x, y, √depth)²,    limited at full scale

The untouched signals are those of the sensor itself, so gains need not be known. The ratio of a signal to its untouched
value comes from the light model. Touch is decided by the ratio of likelihoods of the best press and of no press, both
under the same noise and with the same unknown gains:

    score = ½ (χ²(no press) - χ²(best press)) - threshold

Untouched training frames rarely exceed the threshold. `sigma_mm` is for the tip's position from one frame. It follows
from the curvature of χ² there, times a factor by depth (`sigma_table`): the map's own error grows with depth, but is
included in the noise as an average over depths. Errors of the stage, and of contact and light model, are not included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.header import ModelHeader
from optopad.sims.learning.inference.together import Together, together_of_arrays
from optopad.sims.learning.inference.touch_model import (
    UNIT_SIGMA,
    Arrays,
    Prediction,
    SigmaTable,
    checked_signals,
    prediction_of,
    sigma_table_of_arrays,
    taken,
)

CHUNK = 256
"""Number of points that are evaluated at once: each needs 64 coefficients for every pair, 4 MB in all for 64 pairs."""
FEWEST_NODES = 5
"""Least number of nodes along an axis: the "not a knot" condition at an end of the spline needs five coefficients."""
SMALLEST_ROOT = 1e-3
"""Smallest s = √depth used for the slope by depth [√mm]: (df/ds) / 2s has a limit at 0, but is 0/0 there."""


@dataclass(frozen=True, kw_only=True)
class TensorSpline:
    """A cubic spline of several signals over x, y and √depth.

    Attributes
    ----------
    coefficients : (nx + 2, ny + 2, ns + 2, pair) coefficients of the B-splines over x, y, s = √depth, in the signals'
        unit
    start : (3,) first node of x [mm], y [mm] and √depth [√mm]
    step : (3,) distance between nodes, in the same units
    """

    coefficients: NDArray[np.float32]
    start: FloatArray
    step: FloatArray

    @property
    def nodes(self) -> tuple[int, int, int]:
        """Number of nodes in x, y and √depth."""
        nx, ny, ns = (count - 2 for count in self.coefficients.shape[:3])
        return nx, ny, ns

    @property
    def end(self) -> FloatArray:
        """Last node (3,) of x [mm], y [mm] and √depth [√mm]."""
        return np.asarray(self.start + self.step * (np.array(self.nodes) - 1))

    @property
    def deepest_mm(self) -> float:
        """Depth of the last node [mm]."""
        return float(self.end[2] ** 2)

    def values(self, press_mm: FloatArray) -> FloatArray:
        """Signals (n, pair) at locations and depths (n, 3) [mm]."""
        return self._at(press_mm, with_slopes=False)[:, 0]

    def with_gradient(self, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signals (n, pair) and their slopes (n, 3, pair) by x, y and depth [per mm], at presses (n, 3) [mm].

        Beyond the nodes, both are those at the nearest point on the border.
        """
        found = self._at(press_mm, with_slopes=True)
        return found[:, 0], found[:, 1:]

    def _at(self, press_mm: FloatArray, *, with_slopes: bool) -> FloatArray:
        parts = [
            self._of_few(press_mm[first : first + CHUNK], with_slopes)
            for first in range(0, max(len(press_mm), 1), CHUNK)
        ]
        return np.concatenate(parts)

    def _of_few(self, press_mm: FloatArray, with_slopes: bool) -> FloatArray:
        root = np.sqrt(np.maximum(press_mm[:, 2], 0.0))
        place = np.stack([press_mm[:, 0], press_mm[:, 1], root], axis=1)
        steps = np.clip((place - self.start) / self.step, 0.0, np.array(self.nodes) - 1.0)
        cell = np.minimum(steps.astype(np.int64), np.array(self.nodes) - 2)
        value, slope = _weights(steps - cell)
        rows = value[:, None]
        if with_slopes:
            slope /= self.step[:, None]
            slope[:, 2] /= 2.0 * np.maximum(root, SMALLEST_ROOT)[:, None]
            rows = np.repeat(rows, 4, axis=1)
            for axis in range(3):
                rows[:, 1 + axis, axis] = slope[:, axis]
        products = _products(rows.reshape(-1, 3, 4)).astype(np.float32)
        return np.asarray(products.reshape(*rows.shape[:2], 64) @ self._gathered(cell), dtype=np.float64)

    def _gathered(self, cell: IntArray) -> NDArray[np.float32]:
        """Coefficients (n, 64, pair) of the 4 x 4 x 4 B-splines that reach each cell (n, 3) between nodes."""
        across, along = self.coefficients.shape[1:3]
        corner = (cell[:, 0] * across + cell[:, 1]) * along + cell[:, 2]
        offsets = _offsets(across, along)
        flat = self.coefficients.reshape(-1, self.coefficients.shape[-1])
        return np.asarray(flat[corner[:, None] + offsets])


def fitted_spline(signals: FloatArray, start: FloatArray, step: FloatArray) -> TensorSpline:
    """The spline that passes through signals at its nodes.

    Parameters
    ----------
    signals : (nx, ny, ns, pair) signals at the nodes of x, y and s = √depth, whose first node is 0
    start : (3,) first node of x [mm], y [mm], s [√mm]
    step : (3,) distance between nodes, in the same units
    """
    coefficients = np.asarray(signals, dtype=np.float64)
    for axis in range(3):
        solve = _solver(coefficients.shape[axis], axis == 2)
        coefficients = np.moveaxis(np.tensordot(solve, coefficients, axes=(1, axis)), 0, axis)
    return TensorSpline(
        coefficients=np.ascontiguousarray(coefficients, dtype=np.float32),
        start=np.asarray(start, dtype=np.float64),
        step=np.asarray(step, dtype=np.float64),
    )


def _solver(count: int, is_flat_at_start: bool) -> FloatArray:
    """Matrix (count + 2, count) that turns values at the nodes of one axis into spline coefficients."""
    if count < FEWEST_NODES:
        raise ValueError(f"{count} nodes along an axis, needs {FEWEST_NODES} or more")
    rows = np.zeros((count + 2, count + 2))
    for node in range(count):
        rows[node, node : node + 3] = 1 / 6, 4 / 6, 1 / 6
    rows[count, :5] = (-1.0, 0.0, 1.0, 0.0, 0.0) if is_flat_at_start else (1.0, -4.0, 6.0, -4.0, 1.0)
    rows[count + 1, -5:] = 1.0, -4.0, 6.0, -4.0, 1.0
    return np.asarray(np.linalg.inv(rows)[:, :count])


def _weights(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values and slopes (n, 3, 4) of the four B-splines that reach a position `t` (n, 3), 0 to 1, in a cell."""
    value, slope = np.empty((*t.shape, 4)), np.empty((*t.shape, 4))
    u, t2 = 1.0 - t, t * t
    u2 = u * u
    value[..., 0], value[..., 3] = u2 * u, t2 * t
    value[..., 1] = 3.0 * value[..., 3] - 6.0 * t2 + 4.0
    value[..., 2] = 3.0 * value[..., 0] - 6.0 * u2 + 4.0
    slope[..., 0], slope[..., 3] = -u2, t2
    slope[..., 1] = 3.0 * t2 - 4.0 * t
    slope[..., 2] = 4.0 * u - 3.0 * u2
    value /= 6.0
    slope /= 2.0
    return value, slope


def _products(weights: FloatArray) -> FloatArray:
    """Products (n, 64) of the three axes' weights (n, 3, 4); the index of the last axis runs fastest."""
    first, second, third = weights[:, 0], weights[:, 1], weights[:, 2]
    plane = (first[:, :, None] * second[:, None, :]).reshape(len(weights), 16)
    return np.asarray((plane[:, :, None] * third[:, None, :]).reshape(len(weights), 64))


@cache
def _offsets(across: int, along: int) -> IntArray:
    """Offsets (64,) of a cell's 64 coefficients from its first one, in the flattened array of coefficients."""
    i, j, k = np.meshgrid(np.arange(4), np.arange(4), np.arange(4), indexing="ij")
    return ((i * across + j) * along + k).ravel()


CLIP_MARGIN = 3.0
"""A reading counts as clipped within this many standard deviations from full scale [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadingNoise:
    """Noise of a sensor's signals, which are readings minus those of the off state.

    Attributes
    ----------
    floor_counts : (pair,) standard deviation of a signal without light [counts]
    shot : variance of the shot noise, divided by the signal [counts]
    relative : standard deviation of further noise, divided by the signal; independent for each pair [-]
    emitter_drift, receiver_drift : relative standard deviation of a gain, independent for each component [-]
    emitters : number of emitters; pairs are in the order E1-R1, E1-R2, ...
    clip_counts : (pair,) signal above which the converter clips [counts]; infinite if unknown
    """

    floor_counts: FloatArray
    shot: float
    relative: float
    emitter_drift: float
    receiver_drift: float
    emitters: int
    clip_counts: FloatArray

    @property
    def receivers(self) -> int:
        """Number of receivers."""
        return len(self.floor_counts) // self.emitters

    def variance(self, signals: FloatArray) -> FloatArray:
        """Variance (n, pair) of each signal due to independent noise, without the gains [counts²]."""
        shot = self.shot * np.maximum(signals, 0.0)
        return np.asarray(self.floor_counts**2 + shot + (self.relative * signals) ** 2)

    def gain_columns(self, signals: FloatArray) -> FloatArray:
        """Change (n, gain, pair) of the signals by one standard deviation of each gain [counts]."""
        by_emitter = np.repeat(np.eye(self.emitters), self.receivers, axis=1) * self.emitter_drift
        by_receiver = np.tile(np.eye(self.receivers), (1, self.emitters)) * self.receiver_drift
        return np.concatenate([by_emitter, by_receiver]) * signals[:, None, :]

    def frames(self, mean: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Random frames around mean signals (n, pair), each with gains of its own, limited at full scale [counts]."""
        own = rng.normal(size=mean.shape) * np.sqrt(self.variance(mean))
        columns = self.gain_columns(mean)
        shared = np.einsum("ng,ngk->nk", rng.normal(size=columns.shape[:2]), columns)
        return np.asarray(np.minimum(mean + own + shared, self.clip_counts))

    def seen_in(self, signals: FloatArray) -> Whitening:
        """The inverse covariance of frames `signals` (n, pair), in the form used for products."""
        variance = self.variance(signals)
        is_clipped = signals >= self.clip_counts - CLIP_MARGIN * np.sqrt(variance)
        return whitening(np.where(is_clipped, 0.0, 1.0 / variance), self.gain_columns(signals))


@dataclass(frozen=True, kw_only=True, eq=False)
class Whitening:
    """The inverse covariance C⁻¹ of n frames, as aᵀC⁻¹b = aᵀWb - (Ha)ᵀ(Hb) for signals a and b.

    Attributes
    ----------
    weight : (n, pair) W, the inverse variances of independent noise [1/counts²]
    gains : (n, gain, pair) G, change of the signals by one standard deviation of each gain [counts]
    shared : (n, gain, pair) H, the correction for gains that pairs share [1/counts]
    """

    weight: FloatArray
    gains: FloatArray
    shared: FloatArray

    def square(self, residual: FloatArray) -> FloatArray:
        """χ² = rᵀC⁻¹r (n,) of residuals r (n, pair) [counts], with the frames' covariance C."""
        shared = (self.shared @ residual[:, :, None])[:, :, 0]
        return np.asarray((self.weight * residual**2).sum(axis=1) - (shared**2).sum(axis=1))

    def of(self, rows: FloatArray | slice | NDArray[np.intp]) -> Whitening:
        """The inverse covariance of some of the frames."""
        return Whitening(weight=self.weight[rows], gains=self.gains[rows], shared=self.shared[rows])

    def own_deviations(self, residual: FloatArray) -> FloatArray:
        """Residuals (n, pair) minus the part that gains explain, divided by each pair's own standard deviation [-]."""
        shared = (self.shared @ residual[:, :, None])[:, :, 0]
        factor = _factor(self.weight, self.gains)
        gains = np.linalg.solve(np.swapaxes(factor, 1, 2), shared[:, :, None])[:, :, 0]
        explained = (gains[:, None, :] @ self.gains)[:, 0]
        return np.asarray((residual - explained) * np.sqrt(self.weight))

    def softened(self, own_deviations: FloatArray, limit: float) -> Whitening:
        """The inverse covariance with less weight for pairs whose own deviation (n, pair) exceeds `limit` (Huber)."""
        excess = np.maximum(np.abs(own_deviations) / limit, 1.0)
        return whitening(self.weight / excess, self.gains)


def whitening(weight: FloatArray, gains: FloatArray) -> Whitening:
    """The inverse covariance from weights (n, pair) and the effect of gains (n, gain, pair)."""
    shared = np.asarray(np.linalg.solve(_factor(weight, gains), gains * weight[:, None, :]))
    return Whitening(weight=weight, gains=gains, shared=shared)


def _factor(weight: FloatArray, gains: FloatArray) -> FloatArray:
    """Lower triangular matrix L (n, gain, gain) with L Lᵀ = 1 + GᵀWG."""
    inner = (gains * weight[:, None, :]) @ np.swapaxes(gains, 1, 2)
    return np.asarray(np.linalg.cholesky(inner + np.eye(gains.shape[1])))


Answers = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Function from presses (n, 3) to signals (n, pair) and their slopes (n, 3, pair). A press may have more unknowns than
x, y and depth; then so have slopes, table and box."""

STARTS = 3
ELSEWHERE_MM = 3.0
"""Least distance in x and y between two starts of the search [mm]."""
STEPS = 9
AFTER_STEPS = 4
"""Largest number of search steps with Huber's weights, which follow at most `STEPS` steps from each start."""
MOST_PRODUCTS, MOST_ROWS = 250_000, 40
"""Blocks of the table of starts are small enough that multiplying one by `MOST_ROWS` rows takes at most `MOST_PRODUCTS`
products. From 262,144 products on, OpenBLAS splits a product of matrices among threads, which gains nothing for one
frame and costs milliseconds on busy cores.
"""
DONE_MM = 1e-3
"""The search ends at steps shorter than this [mm], which is far below the noise of any frame."""
DONE_SQUARE = 0.02
"""The search ends when a step lowers χ² by less than this: about a tenth of a standard deviation of the press."""
FIRST_DAMPING = 1e-2
FACTOR = 6.0
OUTLIER = 4.0
"""Residual of a pair, in its own standard deviations, above which its weight is reduced [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Box:
    """Range of the search for presses: lowest and highest (x, y, depth) [mm], (3,) each."""

    low: FloatArray
    high: FloatArray

    @property
    def prior_information(self) -> FloatArray:
        """Inverse covariance (3, 3) of a uniform prior in the box [1/mm²]; it limits the covariance without data."""
        return np.asarray(np.diag(12.0 / (self.high - self.low) ** 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """The best press of each frame.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth [mm]
    covariance : (n, 3, 3) covariance of x, y, depth [mm²]
    square : (n,) χ² of this press (see the module docstring) [-]
    untouched_square : (n,) χ² of no press, with the same weights [-]
    """

    press_mm: FloatArray
    covariance: FloatArray
    square: FloatArray
    untouched_square: FloatArray


class StartTable(Protocol):
    """Interface of what a search may start from."""

    def starts(self, signals: FloatArray, seen: Whitening) -> FloatArray:
        """Presses (n, start, unknown) to start from, for frames (n, pair) and their inverse covariance."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class CoarseTable:
    """Presses (t, 3) from which a search may start, and their signals (t, pair)."""

    press_mm: FloatArray
    signals: FloatArray

    def starts(self, signals: FloatArray, seen: Whitening) -> FloatArray:
        """Presses to start from (n, STARTS, 3): the table's best for each frame, then the best far from those."""
        square = self._squares(signals, seen)
        chosen = []
        for _ in range(STARTS):
            best = self.press_mm[np.argmin(square, axis=1)]
            distance = np.linalg.norm(self.press_mm[None, :, :2] - best[:, None, :2], axis=2)
            square = np.where(distance < ELSEWHERE_MM, np.inf, square)
            chosen.append(best)
        return np.stack(chosen, axis=1)

    @cached_property
    def _blocks(self) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
        """Signals (pair, press) of the table and their squares, in blocks of a few presses and in single precision."""
        by_pair = np.asarray(self.signals.T, dtype=np.float32)
        few = max(MOST_PRODUCTS // (by_pair.shape[0] * MOST_ROWS), 1)
        parts = (by_pair[:, start : start + few] for start in range(0, by_pair.shape[1], few))
        return tuple((np.ascontiguousarray(part), np.ascontiguousarray(part**2)) for part in parts)

    def _squares(self, signals: FloatArray, seen: Whitening) -> FloatArray:
        """χ² (n, t) of n frames for every press of the table, up to a constant per frame."""
        count, gains, pairs = seen.shared.shape
        own = (seen.shared @ signals[:, :, None]).astype(np.float32)
        shared = seen.shared.reshape(count * gains, pairs).astype(np.float32)
        weight, weighted = seen.weight.astype(np.float32), (seen.weight * signals).astype(np.float32)
        parts = []
        for block, squares in self._blocks:
            left = own - (shared @ block).reshape(count, gains, block.shape[1])
            parts.append(weight @ squares - 2.0 * (weighted @ block) - np.einsum("ngt,ngt->nt", left, left))
        return np.concatenate(parts, axis=1).astype(np.float64)


def found_presses(
    answers: Answers,
    table: StartTable,
    box: Box,
    signals: FloatArray,
    untouched: FloatArray,
    seen: Whitening,
    *,
    outlier: float = OUTLIER,
    steps: int = STEPS,
) -> Found:
    """Find the press that best explains each frame.

    Parameters
    ----------
    answers : function that gives the signals of presses [counts] and their slopes [counts/mm]
    table : where the search may start
    box : range of the search
    signals : (n, pair) measured frames [counts]
    untouched : (pair,) signals without a press [counts]
    seen : inverse covariance of the frames
    outlier : residual of a pair, in its own standard deviations, above which its weight is reduced [-]
    steps : largest number of steps from each start
    """
    count = len(signals)
    starts = table.starts(signals, seen)
    each = starts.shape[1]
    twice = np.repeat(np.arange(count), each)
    found = _Search(answers, box, signals[twice], seen.of(twice)).descend(
        starts.reshape(-1, starts.shape[-1]), steps
    )
    pick = np.argmin(found.square.reshape(count, each), axis=1) + each * np.arange(count)
    place = found.of(pick)
    own = seen.own_deviations(signals - answers(place.press)[0])
    untouched_square = seen.square(signals - untouched)
    wild = np.flatnonzero((np.abs(own) > outlier).any(axis=1))
    if len(wild):
        softened = seen.of(wild).softened(own[wild], outlier)
        again = _Search(answers, box, signals[wild], softened).descend(place.press[wild], AFTER_STEPS)
        place = place.replaced(wild, again)
        untouched_square[wild] = softened.square(signals[wild] - untouched)
    return Found(
        press_mm=place.press,
        covariance=np.asarray(np.linalg.inv(place.matrix + box.prior_information)),
        square=place.square,
        untouched_square=untouched_square,
    )


@dataclass(frozen=True, eq=False)
class _Place:
    """State of the search: presses (n, 3), their χ² (n,), and their Fisher information A (n, 3, 3)."""

    press: FloatArray
    square: FloatArray
    matrix: FloatArray

    def of(self, rows: NDArray[np.intp]) -> _Place:
        """The state of the search for some of the frames."""
        return _Place(self.press[rows], self.square[rows], self.matrix[rows])

    def replaced(self, rows: NDArray[np.intp], other: _Place) -> _Place:
        """The state of the search, with the presses of some frames taken from `other`."""
        merged = [one.copy() for one in (self.press, self.square, self.matrix)]
        for one, new in zip(merged, (other.press, other.square, other.matrix), strict=True):
            one[rows] = new
        return _Place(*merged)


@dataclass(frozen=True, eq=False)
class _Search:
    """Least squares search for the presses of many frames in parallel, by damped Gauss-Newton steps."""

    answers: Answers
    box: Box
    signals: FloatArray
    seen: Whitening

    def descend(self, press: FloatArray, steps: int) -> _Place:
        """Search from given presses (n, 3) for at most `steps` steps; only steps that lower χ² are taken."""
        press = np.clip(press, self.box.low, self.box.high)
        square, matrix, slope = self._normal(press)
        damping = np.full(len(press), FIRST_DAMPING)
        is_done = np.zeros(len(press), dtype=np.bool_)
        for _ in range(steps):
            trial = np.clip(press + self._step(press, matrix, slope, damping), self.box.low, self.box.high)
            new_square, new_matrix, new_slope = self._normal(trial)
            is_better = new_square < square
            is_done |= np.abs(trial - press).max(axis=1) < DONE_MM
            is_done |= is_better & (square - new_square < DONE_SQUARE)
            press = np.where(is_better[:, None], trial, press)
            matrix = np.where(is_better[:, None, None], new_matrix, matrix)
            slope = np.where(is_better[:, None], new_slope, slope)
            square = np.where(is_better, new_square, square)
            damping = np.where(is_better, damping / FACTOR, damping * FACTOR)
            if is_done.all():
                break
        return _Place(press, square, matrix)

    def _normal(self, press: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """χ² (n,), and A (n, 3, 3) and g (n, 3) of the normal equations, at given presses (n, 3)."""
        mean, slopes = self.answers(press)
        residual = self.signals - mean
        weighted = slopes * self.seen.weight[:, None, :]
        shared = self.seen.shared @ np.swapaxes(slopes, 1, 2)
        own = self.seen.shared @ residual[:, :, None]
        back = np.swapaxes(shared, 1, 2)
        matrix = weighted @ np.swapaxes(slopes, 1, 2) - back @ shared
        slope = (weighted @ residual[:, :, None] - back @ own)[:, :, 0]
        square = (self.seen.weight * residual**2).sum(axis=1) - (own**2).sum(axis=(1, 2))
        return square, matrix, slope

    def _step(
        self, press: FloatArray, matrix: FloatArray, slope: FloatArray, damping: FloatArray
    ) -> FloatArray:
        """Damped steps (n, 3) from the normal equations; a coordinate at the box's border does not move beyond it."""
        is_held = ((press <= self.box.low) & (slope < 0)) | ((press >= self.box.high) & (slope > 0))
        is_free = ~is_held
        both = is_free[:, :, None] & is_free[:, None, :]
        diagonal = np.einsum("nii->ni", matrix) * (1.0 + damping[:, None]) + 1e-9
        damped = np.where(both, matrix, 0.0)
        axes = np.arange(press.shape[1])
        damped[:, axes, axes] = np.where(is_free, diagonal, 1.0)
        return np.asarray(np.linalg.solve(damped, np.where(is_free, slope, 0.0)[:, :, None])[:, :, 0])


KIND = "signal-map"
FRAMES_AT_ONCE = 200
"""Number of frames processed in parallel, small enough that arrays do not exceed a few megabytes."""
TABLE_PITCH_MM = 2.0
LARGEST_BOX_MM = 1_000.0
"""Largest accepted coordinate of the box [mm]: no pad is larger, and the table of starts grows with its area."""
LARGEST_TABLE = 50_000_000
"""Largest accepted number of signals in the table of starts (0.4 GB); 100 x 100 mm with 256 pairs has 7 million."""
TABLE_DEPTHS = 10
"""Number of depths in the table of starts; `TABLE_PITCH_MM` is the distance between its presses in x and y."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalMapModel:
    """A model that estimates presses by least squares, from a map of simulated signals over location and depth.

    Attributes
    ----------
    header : description of the model; its `untouched_counts` include clipped readings
    ratio_root : √(signal / untouched signal) of every pair, as a spline over location and depth
    full_counts : (pair,) untouched signals as they would be without clipping [counts]
    noise : noise of the readings, including the map's own error
    box : range of the search for presses
    threshold : half of the difference in χ² above which a touch is detected [-]
    sigma : factors by depth that multiply the standard deviations
    together : what the model knows about two touches; None if it was trained for one
    """

    header: ModelHeader
    ratio_root: TensorSpline
    full_counts: FloatArray
    noise: ReadingNoise
    box: Box
    threshold: float
    sigma: SigmaTable = UNIT_SIGMA
    together: Together | None = None

    def __post_init__(self) -> None:
        """Compute the table of presses from which searches start."""
        press_mm = table_presses_mm(self.box)
        table = CoarseTable(press_mm=press_mm, signals=self.signals(press_mm))
        object.__setattr__(self, "_table", table)

    def predict(self, signals: FloatArray) -> Prediction:
        """Predictions for frames (n, pair) [counts]."""
        signals = checked_signals(self.header, signals)
        parts = [
            self.found(signals[first : first + FRAMES_AT_ONCE])
            for first in range(0, max(len(signals), 1), FRAMES_AT_ONCE)
        ]
        score = np.concatenate([0.5 * (one.untouched_square - one.square) for one in parts]) - self.threshold
        press_mm = np.concatenate([one.press_mm for one in parts])
        raw_mm = np.sqrt(np.concatenate([np.einsum("nii->ni", one.covariance) for one in parts]))
        return prediction_of(self.header, score, press_mm, self.sigma.sigma_mm(press_mm[:, 2], raw_mm))

    def found(self, signals: FloatArray) -> Found:
        """The press that best explains each frame; `signals` is (n, pair) [counts]."""
        table: CoarseTable = self._table  # type: ignore[attr-defined]
        return found_presses(
            self.answers,
            table,
            self.box,
            signals,
            np.minimum(self.full_counts, self.noise.clip_counts),
            self.noise.seen_in(signals),
        )

    def signals(self, press_mm: FloatArray) -> FloatArray:
        """Signals (n, pair) of presses (n, 3), limited at full scale [counts]."""
        ratio = self.ratio_root.values(press_mm) ** 2
        return np.asarray(np.minimum(ratio * self.full_counts, self.noise.clip_counts))

    def answers(self, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signals (n, pair) of presses, limited at full scale, and slopes (n, 3, pair) [counts/mm], 0 at full scale."""
        root, slopes = self.ratio_root.with_gradient(press_mm)
        signals = root**2 * self.full_counts
        slopes *= (2.0 * root * self.full_counts)[:, None, :]
        is_clipped = signals >= self.noise.clip_counts
        return np.where(is_clipped, self.noise.clip_counts, signals), np.where(
            is_clipped[:, None, :], 0.0, slopes
        )

    def arrays(self) -> Arrays:
        """The model's arrays, by their names in its file."""
        noise = self.noise
        return {
            "map_coefficients": self.ratio_root.coefficients,
            "map_start": self.ratio_root.start,
            "map_step": self.ratio_root.step,
            "full_counts": self.full_counts,
            "floor_counts": noise.floor_counts,
            "clip_counts": np.minimum(noise.clip_counts, np.finfo(np.float64).max),
            "noise_shares": np.array([noise.shot, noise.relative, noise.emitter_drift, noise.receiver_drift]),
            "box_mm": np.stack([self.box.low, self.box.high]),
            "threshold": np.array([self.threshold]),
            **self.sigma.arrays(),
            **({} if self.together is None else self.together.arrays()),
        }


def table_presses_mm(box: Box) -> FloatArray:
    """Presses (t, 3) all over a box, from which searches start [mm]; their √depth has equal steps."""
    sides = [
        np.linspace(low, high, int(np.ceil((high - low) / TABLE_PITCH_MM)) + 1)
        for low, high in zip(box.low[:2], box.high[:2], strict=True)
    ]
    depths = np.linspace(0.0, np.sqrt(box.high[2]), TABLE_DEPTHS + 1)[1:] ** 2
    x, y, depth = np.meshgrid(*sides, depths, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), depth.ravel()], axis=1)


def signal_map_of_arrays(header: ModelHeader, arrays: Arrays) -> SignalMapModel:
    """Make the model from its header and arrays in a file.

    Raises
    ------
    InputError : arrays are missing or inconsistent.
    """
    pairs = len(header.untouched_counts)
    full = taken(arrays, "full_counts", (pairs,))
    floor, clip = (
        taken(arrays, "floor_counts", (pairs,)),
        taken(arrays, "clip_counts", (pairs,), largest=np.finfo(np.float64).max),
    )
    box = taken(arrays, "box_mm", (2, 3))
    shot, relative, emitter_drift, receiver_drift = taken(arrays, "noise_shares", (4,))
    if full.min() <= 0.0 or floor.min() <= 0.0 or not (box[0] < box[1]).all():
        raise InputError(
            "full_counts, floor_counts, box_mm: need numbers above 0, and a box that is not empty"
        )
    if np.abs(box).max() > LARGEST_BOX_MM or box[1, 2] <= 0.0:
        raise InputError(f"box_mm: reaches beyond {LARGEST_BOX_MM:g} mm, or holds no depth above 0")
    sides = np.ceil((box[1, :2] - box[0, :2]) / TABLE_PITCH_MM) + 1
    if (table := sides.prod() * TABLE_DEPTHS * pairs) > LARGEST_TABLE:
        raise InputError(f"box_mm: needs a table of {table:.3g} signals, reads at most {LARGEST_TABLE:.3g}")
    if min(shot, relative, emitter_drift, receiver_drift) < 0.0:
        raise InputError("noise_shares: are deviations, none is below 0")
    return SignalMapModel(
        header=header,
        ratio_root=_spline_of(arrays, pairs),
        full_counts=full,
        noise=ReadingNoise(
            floor_counts=floor,
            shot=float(shot),
            relative=float(relative),
            emitter_drift=float(emitter_drift),
            receiver_drift=float(receiver_drift),
            emitters=len(header.emitter_names),
            clip_counts=clip,
        ),
        box=Box(low=box[0], high=box[1]),
        threshold=float(taken(arrays, "threshold", (1,))[0]),
        # older files have no measured factors
        sigma=sigma_table_of_arrays(arrays) if "sigma_factor" in arrays else UNIT_SIGMA,
        together=together_of_arrays(arrays, pairs),
    )


def _spline_of(arrays: Arrays, pairs: int) -> TensorSpline:
    coefficients = taken(arrays, "map_coefficients", (None, None, None, pairs))
    start, step = taken(arrays, "map_start", (3,)), taken(arrays, "map_step", (3,))
    if min(coefficients.shape[:3]) < FEWEST_NODES + 2 or step.min() <= 0.0:
        raise InputError(f"map_coefficients, map_step: need {FEWEST_NODES} nodes an axis and steps above 0")
    return TensorSpline(coefficients=coefficients.astype(np.float32), start=start, step=step)
