"""Standard error of each pair's light, from the differences of replicates and the known error of each rule.

Two replicates give a pair one degree of freedom, so by chance its error often comes out far too small. So each pair's
estimate is shrunk towards the mean over its emitter's pairs in the state. This is done for each source of error,
relative to a flux to which the source's errors are proportional. The ratio of true to stated error was tested for
12,000 pairs of two pads. At the accuracies "score" and "standard" its root mean square is 0.8 and 0.6; 0.7 and 0.2 % of
the ratios are above 3; the largest are 6.5 and 4.4.
"""

from __future__ import annotations

import math

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.engine.untouched import Untouched

RULES_ERROR = 1e-4
"""Median relative error of pairs whose replicates agree, from docs/validation/light.md [-]."""
HIDDEN_ERROR = 2e-3
"""Error of a pair's direct light that a dimple hides in part, relative to its untouched direct flux [-]: root mean
square over 100 such pairs. Replicates do not show this error. If the hidden or the visible share of the light is
smaller, that share is the error."""
POOLED_WEIGHT = 2.0
"""Weight of the mean over an emitter's pairs, relative to the weight of a pair's own replicates."""
LEAST_FLUX, LEAST_SCATTERED, ROUNDING = 1e-4, 0.1, 1e-9
"""Lower limits of the flux to which a source's errors are proportional, relative to the untouched flux: in general, and
for scattered light. The third number is a relative difference that counts as none [-]."""
LEAST_STEP = 0.2
"""Smallest image step used for the error of grids: even finer grids may still miss a small contact."""


def standard_error(values: FloatArray, once: FloatArray, fixed: Untouched, settings: Accuracy) -> FloatArray:
    """(state, emitter, receiver) standard error of the mean over replicates; each emitter's is independent.

    Grids of points for light mirrored once have offsets spread evenly over R replicates. So their mean keeps only every
    R-th harmonic of one grid's error. The k-th harmonic of a jump decreases as 1/k, so the mean's error is at most 1/R
    of one grid's. Replicates are also mirror images about the middles of cells, and differ mostly by terms that cancel
    in their mean. What remains of their difference is twice the share by which an image moves from point to point. All
    other errors are independent between replicates and decrease as 1/sqrt(R). The error of light mirrored several times
    is at least that of its sampling statistics.

    Parameters
    ----------
    values : (state, replicate, class, emitter, receiver) flux; classes in the order of
        `optopad.sims.optics.engine.states` [-]
    once : (state, replicate, emitter, receiver) flux that the top mirrors once [-]
    fixed : light of the untouched pad
    settings : the accuracy
    """
    from optopad.sims.optics.engine.states import DIFFUSE, DIM, DIRECT, SKIRT, TOPS

    count, scale = values.shape[1], fixed.scale
    several = values[:, :, [TOPS, SKIRT]].sum(axis=2) - once
    parts = once, several, values.sum(axis=2) - once - several
    lattice, chance, rest = (part.std(axis=1, ddof=1) / math.sqrt(count) for part in parts)
    lattice = lattice * 2.0 * max(settings.image_step, LEAST_STEP) / count
    unit = settings.repeat_share * np.maximum(scale, DIM * scale.max(axis=1, keepdims=True))
    mirrored, repeated, scattered = (
        np.maximum(flux.mean(axis=1), least * scale)
        for flux, least in (
            (once, LEAST_FLUX),
            (several, LEAST_FLUX),
            (values[:, :, DIFFUSE], LEAST_SCATTERED),
        )
    )
    sampled = repeated * unit
    variance = _drawn_together(lattice, scale * mirrored, count) + _drawn_together(
        rest, scale * scattered, count
    )
    variance += np.where(
        several.any(axis=1), np.maximum(_drawn_together(chance, sampled, count), sampled / count), 0.0
    )
    straight = fixed.straight[0]
    seen = np.divide(values[:, 0, DIRECT], straight, out=np.ones_like(rest), where=straight > 0.0).clip(
        0.0, 1.0
    )
    variance += (straight * np.minimum(HIDDEN_ERROR, np.minimum(seen, 1.0 - seen))) ** 2
    total = values.mean(axis=1).sum(axis=1)
    untouched = fixed.straight.sum(axis=0) + fixed.diffuse + fixed.wall.mean(axis=0)
    is_changed = np.abs(total - untouched) > 1e-9 * scale
    return np.asarray(np.sqrt(variance + np.where(is_changed, (RULES_ERROR * scale) ** 2, 0.0)))


def _drawn_together(spread: FloatArray, yardstick: FloatArray, count: int) -> FloatArray:
    """(state, emitter, receiver) variance from the spread of `count` replicates, pooled over an emitter's pairs.

    yardstick : variance to which the expected variance is proportional; the result is 0 for pairs without spread

    The mean is taken of the spreads, not of their squares: a pair at a contact edge says little about others.
    """
    share = spread / np.sqrt(yardstick)
    is_spread = share > ROUNDING
    mean = np.where(is_spread, share, 0.0).sum(axis=2, keepdims=True)
    mean /= np.maximum(is_spread.sum(axis=2, keepdims=True), 1)
    short = math.sqrt(2.0 / (count - 1)) * math.gamma(count / 2) / math.gamma((count - 1) / 2)
    # for normal errors the mean spread is smaller than the standard deviation by this factor
    pooled = (mean / short) ** 2 * yardstick
    return np.where(is_spread, (POOLED_WEIGHT * pooled + spread**2) / (POOLED_WEIGHT + 1.0), 0.0)
