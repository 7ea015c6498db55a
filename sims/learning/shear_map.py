"""A signal map with the sideways force on the ball as two more unknowns.

    signal of a pair = its untouched signal x (ratio(x, y, depth) + a·f + q·f²),    limited to 0 and full scale

The ratio is that of the signal map without sideways force (`inference.signal_map`). f are the components of the force
along x and y [N]. Their factors a and q (for each component its own) come from states with a force of either sign, at a
few locations and depths. Between locations they are interpolated by thin-plate splines, between depths linearly; they
are 0 at depth 0 and constant beyond the deepest state. The location is that of the ball as it is now, not where it was
pressed.

The unknowns are found by the search of the signal map, with the same noise, and with a normal prior of the force: each
of its components counts as one more reading, which is 0. Where frames hardly depend on the force, it does not disturb
location and depth. Left out: the product of both components, and the past of the sideways motion: the force must have
grown in one direction, without sliding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RBFInterpolator

from optopad.design.arrays import FloatArray
from optopad.sims.learning.inference.signal_map import (
    FRAMES_AT_ONCE,
    Box,
    CoarseTable,
    SignalMapModel,
    Whitening,
    found_presses,
    table_presses_mm,
)

MOST = 4.0
"""Largest component of a force that is searched [standard deviations of the prior]."""
SLOPE_STEP_MM = 0.05
"""Step of the differences by which a and q change with location and depth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceLight:
    """Change of every pair's light by a sideways force.

    Attributes
    ----------
    places_mm : (place, 2) locations of the states
    depth_mm : (depth,) their depths, rising
    factors : (place, depth, 4, pair) a for x and y [1/N], and q for x and y [1/N²], over untouched light
    """

    places_mm: FloatArray
    depth_mm: FloatArray
    factors: FloatArray

    @cached_property
    def _over_places(self) -> RBFInterpolator:
        return RBFInterpolator(self.places_mm, self.factors.reshape(len(self.places_mm), -1))

    def factors_at(self, press_mm: FloatArray) -> FloatArray:
        """Factors (n, 4, pair) at presses (n, 3)."""
        found = self._over_places(press_mm[:, :2]).reshape(len(press_mm), *self.factors.shape[1:])
        nodes = np.concatenate([[0.0], self.depth_mm])
        shares = [np.interp(press_mm[:, 2], nodes, row) for row in np.eye(len(nodes))[1:]]
        return np.asarray(np.einsum("dn,ndfp->nfp", shares, found))

    def change(self, press: FloatArray) -> FloatArray:
        """Change (n, pair) of the light over untouched light, at x, y, depth and force (n, 5) [mm, N]."""
        return _summed(self.factors_at(press[:, :3]), press[:, 3:])


def _with_two(values: FloatArray) -> FloatArray:
    """An array with two zeros at the end of its last axis."""
    return np.pad(values, [*[(0, 0)] * (values.ndim - 1), (0, 2)])


def _summed(factors: FloatArray, force_n: FloatArray) -> FloatArray:
    powers = np.concatenate([force_n, force_n**2], axis=1)
    return np.asarray((powers[:, None, :] @ factors)[:, 0])


@dataclass(frozen=True, kw_only=True, eq=False)
class ShearMap:
    """A signal map that also finds the sideways force.

    Attributes
    ----------
    ball : the signal map without sideways force
    light : change of the light by the force
    usual_n : prior standard deviation of each component of the force [N]; `MOST` of them are searched
    """

    ball: SignalMapModel
    light: ForceLight
    usual_n: float

    @cached_property
    def _table(self) -> CoarseTable:
        at_rest = table_presses_mm(self.ball.box)
        return CoarseTable(press_mm=_with_two(at_rest), signals=_with_two(self.ball.signals(at_rest)))

    @cached_property
    def _box(self) -> Box:
        box, force_n = self.ball.box, np.full(2, MOST * self.usual_n)
        return Box(low=np.concatenate([box.low, -force_n]), high=np.concatenate([box.high, force_n]))

    def answers(self, press: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signals and both components of the force (n, pair + 2), and their slopes (n, 5, pair + 2) by all unknowns."""
        signals, slopes = self.signals(press)
        by_force = np.broadcast_to(np.eye(5)[:, 3:], (len(press), 5, 2))
        return np.concatenate([signals, press[:, 3:]], axis=1), np.concatenate([slopes, by_force], axis=2)

    def signals(self, press: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signals (n, pair) of presses (n, 5) and slopes (n, 5, pair) by x, y, depth and force [counts per mm, N]."""
        place, force_n, clip = press[:, :3], press[:, 3:], self.ball.noise.clip_counts
        root, by_place = self.ball.ratio_root.with_gradient(place)
        factors = self.light.factors_at(place)
        change = _summed(factors, force_n)
        by_place = 2.0 * root[:, None] * by_place
        for axis, step in enumerate(SLOPE_STEP_MM * np.eye(3)):
            beside = _summed(self.light.factors_at(place + step), force_n)
            by_place[:, axis] += (beside - change) / SLOPE_STEP_MM
        by_force = factors[:, :2] + 2.0 * factors[:, 2:] * force_n[:, :, None]
        signals = (root**2 + change) * self.ball.full_counts
        slopes = np.concatenate([by_place, by_force], axis=1) * self.ball.full_counts
        is_beyond = (signals < 0.0) | (signals >= clip)
        return np.clip(signals, 0.0, clip), np.where(is_beyond[:, None, :], 0.0, slopes)

    def found(self, signals: FloatArray) -> FloatArray:
        """x, y, depth and force (n, 5) [mm, N] that best explain frames (n, pair) [counts]."""
        noise, parts = self.ball.noise, []
        for first in range(0, len(signals), FRAMES_AT_ONCE):
            few = signals[first : first + FRAMES_AT_ONCE]
            untouched = np.minimum(self.ball.full_counts, noise.clip_counts)[None]
            seen = noise.seen_in(few)
            prior = Whitening(
                weight=np.pad(seen.weight, ((0, 0), (0, 2)), constant_values=self.usual_n**-2),
                gains=_with_two(seen.gains),
                shared=_with_two(seen.shared),
            )
            found = found_presses(
                self.answers, self._table, self._box, _with_two(few), _with_two(untouched)[0], prior
            )
            parts.append(found.press_mm)
        return np.concatenate(parts)
