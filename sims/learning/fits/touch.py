"""The touch classifier: a linear support vector machine on both sides of zero depth, depth 0 labelled as touched.

scikit-learn's LinearSVC: min ½ |w|² + C Σ max(0, 1 - y (w · s + b))², the offset b counted with w. Two ways to set it
up:

    plain   the paper's: it tunes its regression only, so C stays at scikit-learn's default of 1, and the readings
            keep one scale for all pairs, their median untouched signal
    tuned   for the better learners: readings standardised pair by pair, C from a grid by the share of right answers at
            locations held out

The second finds lighter touches (docs/how-to/train-learner.md has both tables). No row of depths is tuned in either.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.svm import LinearSVC

from sims.learning.inference.feature_scaling import FeatureScaling
from sims.learning.inference.touch_svm import TouchSvm
from sims.learning.samples.scalings import LEAST_SCALE_COUNTS, counts_scaling, standard_scaling
from sims.learning.samples.splits import held_out, spread_samples
from sims.learning.samples.training_data import TrainingData

DEFAULT_COST = 1.0
COSTS = (0.01, 0.1, 1.0, 10.0)
"""C of the grid."""
MOST_SAMPLES = 40_000
SHARE_HELD_OUT = 0.5
"""As the paper: half of the training data tunes."""
MOST_ITERATIONS = 2_000


def fit_plain_touch(
    data: TrainingData, rng: np.random.Generator, most_samples: int
) -> tuple[TouchSvm, dict[str, Any]]:
    """The paper's classifier, and what its fit found: `touch_cost`, `touch_is_converged`."""
    chosen = _chosen(data, rng, most_samples)
    untouched = float(np.median(np.abs(data.untouched_counts[data.kept])))
    plain = counts_scaling(data.kept)
    scaling = replace(plain, scale=np.full(len(data.kept), max(untouched, LEAST_SCALE_COUNTS)))
    machine, is_converged = _fitted(
        scaling.features(data.signals[chosen]), data.is_touched[chosen], DEFAULT_COST
    )
    return _plane(machine, scaling), {"touch_cost": DEFAULT_COST, "touch_is_converged": is_converged}


def fit_tuned_touch(
    data: TrainingData, rng: np.random.Generator, most_samples: int
) -> tuple[TouchSvm, dict[str, Any]]:
    """The better learners' classifier, and what its fit found: beside the above `touch_held_out_right`."""
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
    return _plane(machine, scaling), {
        "touch_cost": cost,
        "touch_held_out_right": right[cost],
        "touch_is_converged": is_converged,
    }


def _chosen(data: TrainingData, rng: np.random.Generator, most_samples: int) -> NDArray[np.int64]:
    return spread_samples(data.press, data.press_mm[:, 2], min(most_samples, MOST_SAMPLES), rng)


def _plane(machine: LinearSVC, scaling: FeatureScaling) -> TouchSvm:
    return TouchSvm(
        scaling=scaling,
        weights=np.asarray(machine.coef_[0], dtype=np.float64),
        bias=float(machine.intercept_[0]),
    )


def _fitted(features: NDArray[np.float64], labels: NDArray[np.bool_], cost: float) -> tuple[LinearSVC, bool]:
    """A machine, and whether its solver came to an end."""
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
