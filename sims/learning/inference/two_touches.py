"""Up to two touches in each frame, by a signal map that was trained for two; needs numpy only.

Signals of two touches
----------------------
    ratio(A, B) = ratio(A) ratio(B),      limited at full scale

with the ratios of single touches from the map. The error of map and product is part of the noise
(`optopad.sims.learning.inference.together`). On the paper's pad, a network that was fitted to what the product misses
lowered that by a third, and the errors of location not at all; so there is none.

The search
----------
Six unknowns, x, y and depth of both touches, are searched as those of one touch are (`found_presses`). The starts come
from a table of single presses. In logarithms a product of ratios is a sum, so with one weight per pair, the square of
the residual of every two presses i and j of the table follows from their Gram matrix G:

    χ²(i, j) = const + s_i + s_j + 2 G_ij,      s_i = G_ii - 2 v_i,      v = the frame's products with the table

A pseudo reading keeps the touches apart: it is 0 unless the tips overlap.

One or two
----------
A frame with a touch has two if they explain it better than one by more than a threshold, under the same noise:

    second score = ½ (χ²(best single touch) - χ²(best two touches)) - threshold.

The single touch is searched from the best one that the map has found, and from each of the two, so that no other
minimum of the single one passes for a second touch. Readings that two touches leave beyond `OUTLIER` deviations count
less in both. On the simulated single touches that set the threshold, whose light is not that of the map, the score is
above 0 in `together_fit.FALSE_SECONDS` of the frames. After the decision the search goes on with the error of the
product in the noise; so pairs that both touches change count less, and the deviations include this error.

The model leaves out more than two touches, and touches by anything but the tip of the training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.signal_map import (
    FRAMES_AT_ONCE,
    OUTLIER,
    STEPS,
    Box,
    Found,
    SignalMapModel,
    Whitening,
    found_presses,
    whitening,
)
from optopad.sims.learning.inference.together import Together
from optopad.sims.learning.inference.touch_model import TouchModel, checked_signals

MOST_STARTS = 600
"""About the number of single presses of which two are chosen to start from; the Gram matrix grows with its square."""
START_DEPTHS = 5
FAINTEST = 0.03
"""Least ratio of light in logarithms [-]."""
USUAL_ERROR = 0.02
"""Error of the logarithms for the choice of starts [-]: about that of a product of ratios."""
APART_MM = 0.3
"""Standard deviation of the pseudo reading that keeps tips from overlapping [mm]."""
OTHER_MM = 2.5
"""Least distance of one touch between two starts [mm]."""
STARTS, FEW_STEPS = 3, 4
"""Starts of the search, and its largest number of steps from where it has ended before."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Touches:
    """Up to two touches in each of n frames.

    Attributes
    ----------
    count : (n,) number of touches, 0 to 2
    touch_score : (n,) score of touch against no touch, as of `Prediction` [-]
    second_score : (n,) score of two touches against one [-]; above 0 there are two. Not computed without touch
    press_mm : (n, 2, 3) x, y, depth of each touch, the deeper first; NaN where absent [mm]
    sigma_mm : (n, 2, 3) standard deviations; NaN where absent [mm]
    force_n : (n, 2) force from the model's force curve, 0 where absent [N]; None if the model has no such curve. It is
        that of each touch alone: the other one adds some per cent
    """

    count: IntArray
    touch_score: FloatArray
    second_score: FloatArray
    press_mm: FloatArray
    sigma_mm: FloatArray
    force_n: FloatArray | None


def require_one_or_two(touches: int) -> None:
    """Check a number of touches that models can know at once, 1 or 2; raises InputError."""
    if touches not in (1, 2):
        raise InputError(f"touches: {touches} is refused; the models know one or two")


def require_two_touches(model: TouchModel) -> SignalMapModel:
    """The model, if it can tell two touches apart.

    Raises
    ------
    InputError : it is of another kind, or was trained for one touch.
    """
    way_out = "train one with `optopad train DATA --learner signal-map --design DESIGN --touches 2`"
    if not isinstance(model, SignalMapModel):
        raise InputError(f"model: {model.header.kind} knows one touch; a signal map can know two: {way_out}")
    if model.together is None:
        raise InputError(f"model: this signal map was trained for one touch; {way_out}")
    return model


def found_touches(model: TouchModel, signals: FloatArray) -> Touches:
    """Find up to two touches in frames (n, pair) [counts].

    Raises
    ------
    InputError : the model knows one touch only, or frames do not fit it.
    """
    known = require_two_touches(model)
    signals = checked_signals(known.header, signals)
    search = search_of(known)
    parts = [
        search.touches(signals[first : first + FRAMES_AT_ONCE])
        for first in range(0, max(len(signals), 1), FRAMES_AT_ONCE)
    ]
    found, curve = joined_touches(parts), known.header.force_curve
    if curve is None:
        return found
    depth_mm = found.press_mm[..., 2]
    return replace(found, force_n=np.where(np.isnan(depth_mm), 0.0, curve.at(np.nan_to_num(depth_mm))))


def joined_touches(parts: Sequence[Touches]) -> Touches:
    """The touches of several groups of frames, one group after another."""
    joined: dict[str, Any] = {}
    for one in fields(Touches):
        column = [getattr(part, one.name) for part in parts]
        joined[one.name] = None if column[0] is None else np.concatenate(column)
    return Touches(**joined)


def search_of(model: SignalMapModel) -> TwoTouchSearch:
    """The search of a model, made once."""
    found = model.__dict__.get("_two_touches")
    if not isinstance(found, TwoTouchSearch):
        assert model.together is not None
        found = TwoTouchSearch(single=model, together=model.together)
        object.__setattr__(model, "_two_touches", found)
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Starts:
    """Table of starts that are the same for every search: `starts` of `CoarseTable` for chosen ones."""

    chosen: FloatArray

    def starts(self, signals: FloatArray, seen: Whitening) -> FloatArray:  # noqa: ARG002
        return self.chosen


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoTouchSearch:
    """Searches two touches in frames.

    Attributes
    ----------
    single : the model of one touch
    together : what the model knows about two touches
    """

    single: SignalMapModel
    together: Together

    @cached_property
    def _box(self) -> Box:
        box = self.single.box
        return Box(low=np.tile(box.low, 2), high=np.tile(box.high, 2))

    @cached_property
    def _presses(self) -> FloatArray:
        """Single presses (t, 3) of which starts are made."""
        box = self.single.box
        sides = (box.high - box.low)[:2]
        pitch = float(np.sqrt(sides.prod() * START_DEPTHS / MOST_STARTS))
        axes = [
            np.linspace(low, high, max(round((high - low) / pitch), 1) + 1)
            for low, high in zip(box.low[:2], box.high[:2], strict=True)
        ]
        depths = np.linspace(0.0, np.sqrt(box.high[2]), START_DEPTHS + 1)[1:] ** 2
        return np.stack([one.ravel() for one in np.meshgrid(*axes, depths, indexing="ij")], axis=1)

    @cached_property
    def _weights(self) -> FloatArray:
        """Weights (pair,) of logarithms for the choice of starts."""
        model = self.single
        variance = model.noise.variance(model.full_counts[None])[0] / model.full_counts**2
        is_clipped = model.full_counts >= model.noise.clip_counts
        return np.where(is_clipped, 0.0, 1.0 / (variance + USUAL_ERROR**2))

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Weighted logarithms (pair, t) of the table, their squares (t,), and half the squares of their sums (t, t).

        The latter are infinite where tips overlap.
        """
        log = self._logarithm(self.single.ratio_root.values(self._presses) ** 2)
        gram = (log * self._weights) @ log.T
        place = self._presses[:, :2]
        apart = np.linalg.norm(place[:, None] - place, axis=2)
        own = np.diagonal(gram)
        pairs = np.where(apart < self.together.least_mm, np.inf, 0.5 * (own[:, None] + own) + gram)
        return (log * self._weights).T.astype(np.float32), own.astype(np.float32), pairs.astype(np.float32)

    def starts(self, signals: FloatArray, alone: FloatArray) -> FloatArray:
        """Two touches to start from (n, STARTS, 6) for frames (n, pair) and their best single touches (n, 3).

        The first ones are pairs of the table, the last one is the single touch and the table's best second.
        """
        (table, own, pairs), presses = self._table, self._presses
        log = self._logarithm(signals / self.single.full_counts)
        left = log - self._logarithm(self.single.ratio_root.values(alone) ** 2)
        found = np.empty((len(signals), STARTS, 6))
        found[:, -1, :3] = alone
        square = own - 2.0 * (left.astype(np.float32) @ table)
        apart = np.linalg.norm(alone[:, None, :2] - presses[:, :2], axis=2)
        square[apart < self.together.least_mm] = np.inf
        found[:, -1, 3:] = presses[square.argmin(axis=1)]
        for number, row in enumerate(-(log.astype(np.float32) @ table)):
            square = pairs + row
            other = square.argmin(axis=1)
            best = square[np.arange(len(row)), other] + row
            for start in range(STARTS - 1):
                first = int(best.argmin())
                chosen = presses[[first, other[first]]]
                found[number, start] = chosen.ravel()
                away = np.abs(presses[:, None, :2] - chosen[:, :2]).max(axis=2)
                best[(away < OTHER_MM).any(axis=1)] = np.inf
        return found

    @staticmethod
    def _logarithm(ratio: FloatArray) -> FloatArray:
        return np.asarray(np.log(np.maximum(ratio, FAINTEST)))

    def touches(self, signals: FloatArray) -> Touches:
        """Touches in at most `FRAMES_AT_ONCE` frames, without forces."""
        model = self.single
        one = model.found(signals)
        touch_score = 0.5 * (one.untouched_square - one.square) - model.threshold
        is_touched, second_score = touch_score > 0.0, np.full(len(signals), -self.together.threshold)
        two, is_double = np.zeros((len(signals), 6)), np.zeros(len(signals), np.bool_)
        if is_touched.any():
            two[is_touched], second_score[is_touched] = self._compared(
                signals[is_touched], one.press_mm[is_touched]
            )
            is_double = (second_score > 0.0) & self._apart(two)
        press = np.full((len(signals), 2, 3), np.nan)
        sigma = np.full((len(signals), 2, 3), np.nan)
        if is_double.any():
            found, deviations = self._refined(signals[is_double], two[is_double])
            kept = self._apart(found.reshape(-1, 6))
            is_double[is_double] = kept
            press[is_double], sigma[is_double] = found[kept], deviations[kept]
        second_score = np.where(is_double, second_score, np.minimum(second_score, 0.0))
        single = is_touched & ~is_double
        press[single, 0] = one.press_mm[single]
        raw = np.sqrt(np.einsum("nii->ni", one.covariance[single]))
        sigma[single, 0] = model.sigma.sigma_mm(one.press_mm[single, 2], raw)
        return Touches(
            count=is_touched.astype(np.int64) + is_double,
            touch_score=touch_score,
            second_score=second_score,
            press_mm=press,
            sigma_mm=sigma,
            force_n=None,
        )

    def _compared(self, signals: FloatArray, one: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The best two touches (n, 6) of frames, and their second score (n,), from the best single touch (n, 3)."""
        model, seen = self.single, self._seen(signals)
        two = self._search(signals, seen, self.starts(signals, one), STEPS).press_mm
        mean = self.answers(two)[0][:, :-1]
        fair = seen.softened(seen.own_deviations(signals - mean), OUTLIER)
        alone = found_presses(
            model.answers,
            _Starts(chosen=np.stack([one, two[:, :3], two[:, 3:]], axis=1)),
            model.box,
            signals,
            self._untouched,
            fair,
            outlier=np.inf,
            steps=FEW_STEPS,
        ).press_mm
        gain = fair.square(signals - model.answers(alone)[0]) - fair.square(signals - mean)
        return two, 0.5 * gain - self.together.threshold

    def _seen(self, signals: FloatArray, more: FloatArray | float = 0.0) -> Whitening:
        """The inverse covariance of frames, with the map's error and `more` variance (n, pair) over untouched light."""
        model, together = self.single, self.together
        seen = replace(model.noise, floor_counts=together.floor_counts).seen_in(signals)
        variance = together.map_variance(signals / model.full_counts) + more
        own = np.where(seen.weight > 0.0, seen.weight, 1.0)
        weight = 1.0 / (1.0 / own + variance * model.full_counts**2)
        return whitening(np.where(seen.weight > 0.0, weight, 0.0), seen.gains)

    @cached_property
    def _untouched(self) -> FloatArray:
        return np.minimum(self.single.full_counts, self.single.noise.clip_counts)

    def _search(self, signals: FloatArray, seen: Whitening, starts: FloatArray, steps: int) -> Found:
        """The best two touches, from starts (n, start, 6)."""
        return found_presses(
            self.answers,
            _Starts(chosen=starts),
            self._box,
            _with_zero(signals),
            _with_zero(self._untouched),
            _padded(seen),
            outlier=np.inf,
            steps=steps,
        )

    def _apart(self, press: FloatArray) -> BoolArray:
        """Whether both touches (n, 6) are deeper than nothing and about as far apart as two tips need."""
        away = np.hypot(press[:, 0] - press[:, 3], press[:, 1] - press[:, 4])
        is_apart = away > self.together.least_mm - 3.0 * APART_MM
        return np.asarray(is_apart & (press[:, [2, 5]].min(axis=1) > 0.0))

    def _refined(self, signals: FloatArray, press: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Presses and deviations (n, 2, 3), the deeper first, with the error of the product in the noise."""
        first, second = (self.single.ratio_root.values(press[:, k : k + 3]) ** 2 for k in (0, 3))
        seen = self._seen(signals, self.together.product_variance(first, second))
        off = signals - self.answers(press)[0][:, :-1]
        seen = seen.softened(seen.own_deviations(off), OUTLIER)
        found = self._search(signals, seen, press[:, None], FEW_STEPS)
        raw = np.sqrt(np.einsum("nii->ni", found.covariance)).reshape(-1, 2, 3)
        both = found.press_mm.reshape(-1, 2, 3)
        sigma = np.stack([self.together.sigma.sigma_mm(both[:, k, 2], raw[:, k]) for k in range(2)], axis=1)
        order = np.argsort(-both[:, :, 2], axis=1, kind="stable")[..., None]
        return np.take_along_axis(both, order, axis=1), np.take_along_axis(sigma, order, axis=1)

    def answers(self, press: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signals and overlap of the tips (n, pair + 1), and their slopes (n, 6, pair + 1)."""
        model, count = self.single, len(press)
        root, slopes = model.ratio_root.with_gradient(press.reshape(-1, 3))
        ratio = (root**2).reshape(count, 2, -1)
        slope = (2.0 * root[:, None] * slopes).reshape(count, 2, 3, -1)
        signals = ratio.prod(axis=1) * model.full_counts
        slope = (slope * ratio[:, ::-1, None]).reshape(count, 6, -1) * model.full_counts
        clip = model.noise.clip_counts
        is_beyond = (signals < 0.0) | (signals >= clip)
        signals, slope = np.clip(signals, 0.0, clip), np.where(is_beyond[:, None], 0.0, slope)
        along = press[:, 0:2] - press[:, 3:5]
        away = np.maximum(np.hypot(*along.T), 1e-9)
        overlap = np.maximum(self.together.least_mm - away, 0.0)
        by_place = np.where(overlap[:, None] > 0.0, -along / away[:, None], 0.0)
        none = np.zeros((count, 1))
        by_all = np.concatenate([by_place, none, -by_place, none], axis=1)
        return (
            np.concatenate([signals, overlap[:, None]], axis=1),
            np.concatenate([slope, by_all[:, :, None]], axis=2),
        )


def _with_zero(values: FloatArray) -> FloatArray:
    """An array with a zero at the end of its last axis."""
    return np.pad(values, [*[(0, 0)] * (values.ndim - 1), (0, 1)])


def _padded(seen: Whitening) -> Whitening:
    """The inverse covariance with the pseudo reading of the tips' overlap."""
    return Whitening(
        weight=np.pad(seen.weight, ((0, 0), (0, 1)), constant_values=APART_MM**-2),
        gains=_with_zero(seen.gains),
        shared=_with_zero(seen.shared),
    )
