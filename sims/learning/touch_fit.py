"""The touch classifier: a linear support vector machine on both sides of zero depth.

scikit-learn's LinearSVC (squared hinge, L2): min ½ |w|² + C Σ max(0, 1 - y (w · s + b))², on standardised features, C
from a grid by the share of right answers at locations held out. Samples within CONTACT_BAND_MM of zero are used as they
are labelled, depth 0 as touched, as in the paper: no row is tuned.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.svm import LinearSVC

from sims.learning.inference.touch_svm import TouchSvm
from sims.learning.scalings import standard_scaling
from sims.learning.splits import held_out, spread_samples
from sims.learning.training_data import TrainingData

COSTS = (0.001, 0.01, 0.1, 1.0, 10.0)
"""C of the grid."""
MOST_SAMPLES = 40_000
SHARE_HELD_OUT = 0.5
"""As the paper: half of the training data tunes."""
MOST_ITERATIONS = 2_000


def fit_touch(
    data: TrainingData, rng: np.random.Generator, most_samples: int
) -> tuple[TouchSvm, dict[str, Any]]:
    """The classifier, and what its fit found: `touch_cost`, `touch_held_out_right`, `touch_is_converged`."""
    chosen = spread_samples(data.press, data.press_mm[:, 2], min(most_samples, MOST_SAMPLES), rng)
    scaling = standard_scaling(data.kept, data.signals[chosen])
    features = scaling.features(data.signals[chosen])
    labels = data.is_touched[chosen]
    tested = held_out(data.location[chosen], SHARE_HELD_OUT, rng)
    right = {}
    for cost in COSTS:
        tried, _ = _fitted(features[~tested], labels[~tested], cost)
        right[cost] = float((tried.predict(features[tested]) == labels[tested]).mean())
    cost = max(right, key=lambda one: (right[one], -one))
    machine, is_converged = _fitted(features, labels, cost)
    touch = TouchSvm(
        scaling=scaling,
        weights=np.asarray(machine.coef_[0], dtype=np.float64),
        bias=float(machine.intercept_[0]),
    )
    return touch, {
        "touch_cost": cost,
        "touch_held_out_right": right[cost],
        "touch_is_converged": is_converged,
    }


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
