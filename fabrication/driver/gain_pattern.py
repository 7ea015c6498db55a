"""Splits a change of the signals into changed gains of parts, and a rest that is due to a touch.

A part that ages, warms up or loses supply changes all of its pairs by one factor. The change of pair
(i, j) from its untouched signal,  c_ij = s_ij / b_ij - 1,  is split by weighted least squares,

    c_ij = a_i + r_j + d_ij,        weights 1 / sigma_ij^2,

into emitters' gains a_i, receivers' gains r_j and the rest d_ij. The split is of first order in the gains: an emitter
and a receiver that both change by 5 % leave 0.25 % in the rest. A press shades pairs individually, so nearly all of its
change is in the rest.

Pairs below 4 counts or at full scale are left out, because their ratio is not valid. If all pairs of a part change by
one factor, this counts as gain, whatever its cause. For example, a finger in front of a single part is not detected.
"""

from __future__ import annotations

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.fabrication.driver.link.frames import WEAKEST_BASELINE_COUNTS

LEAST_SIGMA = 1e-4
"""Smallest noise assumed for a pair, relative to its signal [-]; measured noise may be 0 because of rounding."""


class GainPattern:
    """Splits changes of the signals into changed gains of emitters and receivers, and a rest that gains do not explain.

    Parameters
    ----------
    untouched : signals of the untouched pad, shape (emitters, receivers) [counts]
    noise : standard deviation of one frame's signals, shape (emitters, receivers) [counts]
    full_scale : pairs whose untouched signal is this or more are not used [counts]

    Attributes
    ----------
    used : whether each pair is used, shape (pairs,); it is if its untouched signal is neither too small nor too large
    sigma : standard deviation of one frame's relative change, shape (pairs,); 1 for pairs that are not used [-]
    freedom : degrees of freedom of the rest
    """

    def __init__(self, untouched: FloatArray, noise: FloatArray, full_scale: float = np.inf) -> None:
        self.shape = untouched.shape
        level = untouched.ravel()
        self.used: BoolArray = (level >= WEAKEST_BASELINE_COUNTS) & (level < full_scale)
        share = np.divide(noise.ravel(), level, out=np.ones(level.size), where=self.used)
        self.sigma: FloatArray = np.where(self.used, np.maximum(share, LEAST_SIGMA), 1.0)
        weight = np.where(self.used, 1.0 / self.sigma, 0.0)
        columns = np.concatenate(
            [
                np.kron(np.eye(self.shape[0]), np.ones((self.shape[1], 1))),
                np.tile(np.eye(self.shape[1]), (self.shape[0], 1)),
            ],
            axis=1,
        )
        whitened = weight[:, None] * columns
        solve = np.linalg.pinv(whitened)
        self._gains = solve * weight  # (part, pair): gains of a change
        self._columns = columns
        self.freedom = max(int(self.used.sum()) - int(np.linalg.matrix_rank(whitened)), 0)

    def gains(self, change: FloatArray) -> FloatArray:
        """Relative changes of the gains that best fit given changes of shape (n, pairs) [-].

        The result has shape (n, parts), with emitters first. Only the sum of an emitter's and a receiver's gain is
        determined, so the solution with the smallest sum of squares is returned.
        """
        found: FloatArray = self._kept(change) @ self._gains.T
        return found

    def gain_change(self, change: FloatArray) -> FloatArray:
        """Component of the given changes that is due to gains, even for unused pairs; both of shape (n, pairs) [-]."""
        found: FloatArray = self.gains(change) @ self._columns.T
        return found

    def rest(self, change: FloatArray) -> FloatArray:
        """Rest of the given changes, which gains do not explain, in standard deviations of one frame.

        Both arrays have the shape (n, pairs). The rest of an unused pair is 0.
        """
        kept = self._kept(change)
        rest: FloatArray = np.where(self.used, (kept - self.gain_change(kept)) / self.sigma, 0.0)
        return rest

    def excess(self, change: FloatArray) -> FloatArray:
        """Sum of squares of the rest over its degrees of freedom, shape (n,): about 1 for noise alone [-]."""
        squares: FloatArray = (self.rest(change) ** 2).sum(axis=-1) / max(self.freedom, 1)
        return squares

    def _kept(self, change: FloatArray) -> FloatArray:
        kept: FloatArray = np.where(self.used, change, 0.0)
        return kept


def relative_change(signals: FloatArray, untouched: FloatArray) -> FloatArray:
    """Relative change from untouched signals, shape (n, pairs); 0 for pairs with fewer than 4 counts untouched [-]."""
    strong = untouched >= WEAKEST_BASELINE_COUNTS
    ratio = np.divide(
        signals, untouched, out=np.ones(np.broadcast_shapes(signals.shape, untouched.shape)), where=strong
    )
    change: FloatArray = ratio - 1.0
    return change
