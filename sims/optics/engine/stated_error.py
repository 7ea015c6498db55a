"""Standard error of each pair's light, from the differences of replicates and the known error of each rule.

Two replicates give a pair one degree of freedom, and by chance often a far too small error. So the estimate of each
pair is shrunk towards the mean over its emitter's pairs in the state. This is done for each source of error, relative
to a flux to which the source's errors are proportional. For 12,000 pairs of two pads at "score" and "standard" the true
errors over the stated ones have a root mean square of 0.8 and 0.6; 0.7 and 0.2 % of them are above 3, and the largest
are 6.5 and 4.4.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from sims.optics.accuracy import Accuracy
from sims.optics.engine.untouched import Untouched

RULES_ERROR = 1e-4
"""Median relative error of pairs whose replicates agree: docs/validation/light.md [-]."""
HIDDEN_ERROR = 2e-3
"""Error of a pair's direct light that a dimple hides in part, over its untouched direct flux [-]: root mean square of
100 such pairs, which replicates do not show. If the hidden or visible share is smaller, that share is the error."""
POOLED_WEIGHT = 2.0
"""Weight of the mean over an emitter's pairs, over the weight of a pair's own replicates."""
LEAST_FLUX, LEAST_SCATTERED, ROUNDING = 1e-4, 0.1, 1e-9
"""Smallest fluxes to which a source's errors are proportional, over the untouched flux: in general, and for scattered
light; difference that counts as none [-]."""
LEAST_STEP = 0.2
"""Smallest image step used for the error of grids: even finer grids hit or miss a smaller contact."""


def standard_error(values: FloatArray, once: FloatArray, fixed: Untouched, settings: Accuracy) -> FloatArray:
    """(state, emitter, receiver) standard error of the mean over replicates; emitters do not depend on each other.

    Grids of points for light mirrored once have offsets spread evenly over R replicates. So the mean keeps only every
    R-th harmonic of one grid's error. Those of a jump decrease as 1/k, so the error is at most 1/R of one grid's.
    Replicates are also mirror images about the middles of cells, and differ mostly by terms that cancel in their mean.
    The remainder is twice the share by which an image moves from point to point. All other errors are independent,
    1/sqrt(R). Light mirrored several times errs at least by the statistics of its samples.

    Parameters
    ----------
    values : (state, replicate, class, emitter, receiver) flux; classes in the order of `sims.optics.engine.states` [-]
    once : (state, replicate, emitter, receiver) flux that the top mirrors once [-]
    fixed : light of the untouched pad
    settings : the accuracy
    """
    from sims.optics.engine.states import DIFFUSE, DIM, DIRECT, SKIRT, TOPS

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

    yardstick : variance to which the expected one is proportional; the result is 0 if there is no spread

    The mean is that of the spreads, not of their squares: a pair at a contact edge says little about others.
    """
    share = spread / np.sqrt(yardstick)
    is_spread = share > ROUNDING
    mean = np.where(is_spread, share, 0.0).sum(axis=2, keepdims=True)
    mean /= np.maximum(is_spread.sum(axis=2, keepdims=True), 1)
    short = math.sqrt(2.0 / (count - 1)) * math.gamma(count / 2) / math.gamma((count - 1) / 2)
    # for normal errors the mean spread is smaller than the standard deviation by this factor
    pooled = (mean / short) ** 2 * yardstick
    return np.where(is_spread, (POOLED_WEIGHT * pooled + spread**2) / (POOLED_WEIGHT + 1.0), 0.0)
