"""Fit the touch classifier, a linear support vector machine, and scale a model's own deviations (`trust_of`).

Touch classifier
----------------
It separates samples above the surface from samples at depth 0 or more, which count as touched. It is scikit-learn's
LinearSVC: min ½ |w|² + C Σ max(0, 1 - y (w · s + b))², with the offset b counted as part of w. There are two settings:

    plain   as in the paper, which tunes only the regression: C is scikit-learn's default of 1, and the readings of
            all pairs are divided by one number, the median untouched signal
    tuned   for trees: readings are standardised pair by pair, and C is the value of a grid with the
            largest share of correct results at held-out locations

The tuned setting detects lighter touches (docs/how-to/train-learner.md has tables for both). Neither setting is tuned
for particular depths.

The hinge loss does not limit false alarms. On pads with few pairs, a plane may not separate the touches at all
locations from the untouched frames. The plane then runs through the untouched frames, since touched samples are the
majority. So with either setting the plane is shifted, if necessary, until at most `FALSE_ALARMS` of the untouched
frames of a new set are expected to count as touched. The score of these frames has the variance

    worst variance within a set + (1 + 1/sets) x variance between sets

Between sets the gain of every emitter and every receiver changes. The standard deviation of these changes is estimated
from the sets' mean untouched signals; other changes are independent for each pair. With a single set there is no
estimate, and the variance between sets counts as 0.

Scale of a model's own deviations
---------------------------------
A learner is first fitted without some of the locations. Its estimates there are compared with the truth, by depth:

    factor = rms(error) / rms(raw spread)

as a table over depth (`SigmaTable`). The final model is fitted with all locations and uses this table. A held-out
location is a grid step from the nearest trained one, but a random press is only part of a step away. So the table
overestimates the errors slightly.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.svm import LinearSVC

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.learning.inference.extra_trees import ExtraTreesModel
from optopad.sims.learning.inference.touch_model import FeatureScaling, SigmaTable, TouchSvm
from optopad.sims.learning.samples import (
    CLEARLY_UNTOUCHED_MM,
    LEAST_SCALE_COUNTS,
    PressSamples,
    TrainingData,
    counts_scaling,
    held_out,
    held_out_figures,
    spread_samples,
    standard_scaling,
)

DEFAULT_COST = 1.0
COSTS = (0.01, 0.1, 1.0, 10.0)
"""Values of C that the tuned setting tries."""
MOST_SAMPLES = 40_000
SHARE_HELD_OUT = 0.5
"""Share of the training data that is held out for tuning, as in the paper [-]."""
MOST_ITERATIONS = 2_000
FALSE_ALARMS = 0.01
"""Expected share of a new set's untouched frames that may count as touched [-]; the same as for a signal map."""
FEWEST_OF_SET = 10
"""Least number of untouched frames in a set for an estimate of their variance."""


def fit_plain_touch(
    data: TrainingData, rng: np.random.Generator, most_samples: int
) -> tuple[TouchSvm, dict[str, Any]]:
    """Fit the classifier with the paper's setting; also return figures on the fit for the model's header."""
    chosen = _chosen(data, rng, most_samples)
    untouched = float(np.median(np.abs(data.untouched_counts[data.kept])))
    plain = counts_scaling(data.kept)
    scaling = replace(plain, scale=np.full(len(data.kept), max(untouched, LEAST_SCALE_COUNTS)))
    machine, is_converged = _fitted(
        scaling.features(data.signals[chosen]), data.is_touched[chosen], DEFAULT_COST
    )
    plane, moved = with_few_false_alarms(_plane(machine, scaling), data)
    return plane, {"touch_cost": DEFAULT_COST, "touch_is_converged": is_converged} | moved


def fit_tuned_touch(
    data: TrainingData, rng: np.random.Generator, most_samples: int
) -> tuple[TouchSvm, dict[str, Any]]:
    """Fit the classifier with C tuned at held-out locations; also return figures on the fit for the model's header."""
    chosen = _chosen(data, rng, most_samples)
    scaling = standard_scaling(data.kept, data.signals[chosen])
    features, labels = scaling.features(data.signals[chosen]), data.is_touched[chosen]
    tested = held_out(data.location[chosen], SHARE_HELD_OUT, rng)
    right = {}
    for cost in COSTS:
        tried, _ = _fitted(features[~tested], labels[~tested], cost)
        right[cost] = float((tried.predict(features[tested]) == labels[tested]).mean())
    cost = max(right, key=lambda one: (right[one], -one))
    machine, is_converged = _fitted(features, labels, cost)
    plane, moved = with_few_false_alarms(_plane(machine, scaling), data)
    return plane, {
        "touch_cost": cost,
        "touch_held_out_right": right[cost],
        "touch_is_converged": is_converged,
    } | moved


def with_few_false_alarms(plane: TouchSvm, data: TrainingData) -> tuple[TouchSvm, dict[str, Any]]:
    """Shift a classifier's plane if a new set would have too many false alarms; also return the shift [-]."""
    moved = max(untouched_limit(plane, data), 0.0)
    return replace(plane, bias=plane.bias - moved), {"touch_moved": moved}


def untouched_limit(plane: TouchSvm, data: TrainingData) -> float:
    """Score that `FALSE_ALARMS` of a new set's untouched frames are expected to exceed [-]."""
    quiet = np.flatnonzero(data.press_mm[:, 2] <= CLEARLY_UNTOUCHED_MM)
    if len(quiet) < FEWEST_OF_SET:
        quiet = np.flatnonzero(~data.is_touched)
    of_set = data.source.set_number[quiet]
    sets = [rows for k in np.unique(of_set) if len(rows := quiet[of_set == k]) >= FEWEST_OF_SET] or [quiet]
    scores = [plane.score(data.signals[rows].astype(np.float64)) for rows in sets]
    within = max(float(np.var(one)) for one in scores)
    means = np.array([data.signals[rows].mean(axis=0, dtype=np.float64) for rows in sets])
    between = _variance_between(plane, means, len(data.source.emitter_names))
    spread = np.sqrt(within + (1.0 + 1.0 / len(sets)) * between)
    return float(np.mean([one.mean() for one in scores]) + NormalDist().inv_cdf(1.0 - FALSE_ALARMS) * spread)


def _variance_between(plane: TouchSvm, means: FloatArray, emitters: int) -> float:
    """Variance of the score of untouched frames from set to set [-]; 0 if there is only one set.

    Parameters
    ----------
    means : (set, pair) mean untouched signals of each set, in the order E1-R1, E1-R2, ... [counts]
    """
    if len(means) < 2:
        return 0.0
    kept = plane.scaling.kept
    untouched, weights = means.mean(axis=0)[kept], plane.weights / plane.scaling.scale
    emitter, receiver = np.divmod(kept, means.shape[1] // emitters)
    # counts per relative change of an emitter's or a receiver's gain: (pair, component)
    parts = [(column == number) * untouched for column in (emitter, receiver) for number in np.unique(column)]
    columns = np.array(parts).T
    changes = (means[:, kept] - untouched).T
    gains = np.linalg.lstsq(columns, changes, rcond=None)[0]
    left = changes - columns @ gains
    sets, rank = len(means) - 1, int(np.linalg.matrix_rank(columns))
    of_gain = (gains**2).sum() / (sets * rank)
    of_pair = (left**2).sum() / (sets * max(len(kept) - rank, 1))
    return float(of_gain * ((columns.T @ weights) ** 2).sum() + of_pair * (weights**2).sum())


def _chosen(data: TrainingData, rng: np.random.Generator, most_samples: int) -> IntArray:
    return spread_samples(data.press, data.press_mm[:, 2], min(most_samples, MOST_SAMPLES), rng)


def _plane(machine: LinearSVC, scaling: FeatureScaling) -> TouchSvm:
    return TouchSvm(
        scaling=scaling,
        weights=np.asarray(machine.coef_[0], dtype=np.float64),
        bias=float(machine.intercept_[0]),
    )


def _fitted(features: FloatArray, labels: BoolArray, cost: float) -> tuple[LinearSVC, bool]:
    """Fit a support vector machine; return it, and whether its solver converged."""
    machine = LinearSVC(C=cost, dual=False, max_iter=MOST_ITERATIONS)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ConvergenceWarning)
        try:
            return machine.fit(features, labels), True
        except ConvergenceWarning:
            pass
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return machine.fit(features, labels), False


BINS = 10
"""Number of depth bins of the table; each has the same number of samples."""
LEAST_FACTOR = 1e-3


def trust_of(model: ExtraTreesModel, samples: PressSamples) -> tuple[SigmaTable, dict[str, float]]:
    """Deviation factors and figures for the header, from a model that was fitted without the held-out samples."""
    held_out = samples.is_held_out
    press_mm = samples.press_mm[held_out]
    estimated_mm, spread_mm = model.press_and_spread_mm(samples.signals[held_out])
    return sigma_table(estimated_mm, spread_mm, press_mm), held_out_figures(estimated_mm, press_mm)


def sigma_table(
    estimated_mm: FloatArray, spread_mm: FloatArray, press_mm: FloatArray, bins: int = BINS
) -> SigmaTable:
    """Factors that scale the model's raw deviations to its actual errors, tabulated by estimated depth.

    They are measured on held-out samples.

    Parameters
    ----------
    estimated_mm, spread_mm : (n, 3) the model's estimates of x, y, depth and their raw deviations, all above 0 [mm]
    press_mm : (n, 3) true x, y, depth [mm]
    bins : number of depth bins, with equal numbers of samples
    """
    order = np.argsort(estimated_mm[:, 2], kind="stable")
    parts = [part for part in np.array_split(order, bins) if len(part)]
    depth_mm = np.array([estimated_mm[part, 2].mean() for part in parts])
    factor = np.array([_factor(estimated_mm[part], spread_mm[part], press_mm[part]) for part in parts])
    rising = np.concatenate([[True], np.diff(depth_mm) > 0.0])
    return SigmaTable(depth_mm=depth_mm[rising], factor=factor[rising])


def _factor(estimated_mm: FloatArray, spread_mm: FloatArray, press_mm: FloatArray) -> FloatArray:
    error = np.sqrt(np.mean((estimated_mm - press_mm) ** 2, axis=0))
    spread = np.sqrt(np.mean(spread_mm**2, axis=0))
    return np.asarray(np.maximum(error / spread, LEAST_FACTOR))
