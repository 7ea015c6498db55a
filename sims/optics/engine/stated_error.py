"""Standard error of each pair's light, from the differences of replicates and the known error of each rule.

Two replicates give a pair one degree of freedom, by chance often a far too small error: the estimate of each pair is
shrunk towards the average of its emitter's pairs in its state, source by source, relative to a flux that scales the
source's errors. For 12,000 pairs of two pads at "score" and "standard" the errors over the stated ones have a root
mean square of 0.8 and 0.6, 0.7 and 0.2 % of them are beyond 3, and the largest are 6.5 and 4.4.
"""

from __future__ import annotations

import math

import numpy as np

from design.arrays import FloatArray
from sims.optics.accuracy import Accuracy
from sims.optics.engine.untouched import Untouched

RULES_ERROR = 1e-4
"""Median error of pairs whose replicates agree: docs/validation/light.md [-]."""
HIDDEN_ERROR = 2e-3
"""Error of the direct light of a pair that a dimple hides in part, over its untouched direct flux, which no replicate
shows: root mean square of 100 such pairs. A hidden or visible share below this has at most its own size as error [-].
"""
POOLED_WEIGHT = 2.0
"""Weight of the average of an emitter's pairs, over that of a pair's own replicates."""
LEAST_FLUX, LEAST_SCATTERED, ROUNDING = 1e-4, 0.1, 1e-9
"""Least flux that scales a source's errors, over the untouched one; spread that counts as none [-]."""
LEAST_STEP = 0.2
"""Least image step for the error of lattices: a contact smaller than the step is hit or missed."""


def standard_error(values: FloatArray, once: FloatArray, fixed: Untouched, settings: Accuracy) -> FloatArray:
    """(state, emitter, receiver) standard error of the mean over replicates; no emitter's depends on another.

    Lattices of light mirrored once have offsets spread evenly over R replicates, whose mean keeps only every R-th
    harmonic of one lattice's error: those of a jump fall as 1/k, so it is at most 1/R of one lattice's. Replicates are
    also mirror images about the middles of cells and differ mostly by terms that cancel in their mean; the remainder is
    twice the share by which an image moves from point to point. All else is independent, 1/sqrt(R); light mirrored
    several times errs at least by the chance of its samples, each of which may represent a share of a pair's flux.

    Parameters
    ----------
    values : (state, replicate, class, emitter, receiver) flux, classes in the order of `sims.optics.engine.states`
    once : (state, replicate, emitter, receiver) flux that the top mirrors once [-]
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
    """(state, emitter, receiver) variance of spreads over this many replicates, with a variance that scales them; 0
    where there is no spread.

    The average is that of the spreads, not of their squares: a pair crossed by a contact edge says little about others.
    """
    share = spread / np.sqrt(yardstick)
    is_spread = share > ROUNDING
    mean = np.where(is_spread, share, 0.0).sum(axis=2, keepdims=True)
    mean /= np.maximum(is_spread.sum(axis=2, keepdims=True), 1)
    short = math.sqrt(2.0 / (count - 1)) * math.gamma(count / 2) / math.gamma((count - 1) / 2)
    # for normal errors the mean spread is smaller than their deviation by this factor
    pooled = (mean / short) ** 2 * yardstick
    return np.where(is_spread, (POOLED_WEIGHT * pooled + spread**2) / (POOLED_WEIGHT + 1.0), 0.0)
