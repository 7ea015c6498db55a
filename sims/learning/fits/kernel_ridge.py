"""The paper's learner: kernel ridge with the Laplacian kernel for (x, y, depth), behind the touch classifier.

Trained on depth 0 and more. Features are the readings less the off state, in counts, unscaled: the noise is about equal
in all of them, and dividing each pair by its own spread would raise weak pairs' noise to the strong pairs' signal. As
in the paper half of the training data, here half of the presses, tunes γ and λ: fitted on four fifths of their
locations, judged on the last fifth (`mean_error_mm`). Fewer locations in the fit would judge a coarser grid of presses
than the final one. The grid of γ goes with the data: γ times the median L1 distance of two training samples takes fixed
values, as the paper's own numbers belong to its own units. The final fit uses samples of all presses. Targets have
their mean taken off: far from every sample the answer is the mean press, not the origin.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from design.arrays import FloatArray
from design.errors import InputError
from design.progress import OnStep
from sims.learning.fits.beginning import touch_told
from sims.learning.fits.block_cholesky import substituted
from sims.learning.fits.kernel_solve import factorise, method_for, solve_kernel
from sims.learning.fits.touch import fit_plain_touch
from sims.learning.inference.kernel_ridge import KernelRidgeModel
from sims.learning.samples.errors_mm import held_out_figures, mean_error_mm
from sims.learning.samples.model_header import trained_header
from sims.learning.samples.scalings import counts_scaling
from sims.learning.samples.settings import DEFAULT, FitSettings
from sims.learning.samples.splits import held_out, spread_samples
from sims.learning.samples.training_data import TrainingData
from sims.readings.dataset import PressData

GAMMA_TIMES_MEDIAN = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
RIDGES = (1e-2, 1e-1, 1.0, 10.0)
TUNING_SHARE = 0.5
"""Of the presses."""
JUDGED_SHARE = 0.2
"""Of the tuning presses' locations."""
PAIRS_FOR_MEDIAN = 20_000
"""Pairs of samples whose distances give the median; its error is then about 1 %."""


def fit_kernel_ridge(
    train: PressData,
    *,
    seed: int = 0,
    on_step: OnStep = lambda _stage, _share: None,
    settings: FitSettings = DEFAULT,
) -> KernelRidgeModel:
    """Train the cascade.

    Raises
    ------
    InputError : too little data, or data that tell nothing.
    """
    told = touch_told(train, fit_plain_touch, seed=seed, settings=settings, on_step=on_step)
    data, rng = told.data, told.rng
    scaling = counts_scaling(data.kept)
    touched = np.flatnonzero(data.is_touched)
    searched = searched_grid(
        data, touched, settings.search_samples, rng, lambda share: on_step("search", share)
    )
    method = method_for(min(settings.fit_samples, len(touched)), settings.memory_gb)
    chosen, landmarks = _fitted_samples(data, touched, method, settings, rng)
    features = scaling.features(data.signals[chosen].astype(np.float64))
    mean_mm = data.press_mm[chosen].mean(axis=0)
    solved = solve_kernel(
        features,
        data.press_mm[chosen] - mean_mm,
        gamma=searched["gamma"],
        ridge=searched["lambda"],
        method=method,
        landmarks=landmarks,
        on_share=lambda share: on_step("fit", share),
    )
    on_step("fit", 1.0)
    facts = (
        told.facts
        | searched
        | {
            "method": solved.method,
            "fit_samples": len(chosen),
            "kept_samples": len(solved.kept),
        }
    )
    if np.isfinite(solved.largest_residual):
        facts["largest_residual"] = solved.largest_residual
    return KernelRidgeModel(
        header=trained_header("kernel-ridge", data, facts, seed),
        touch=told.touch,
        scaling=scaling,
        samples=features[solved.kept].astype(np.float32),
        weights=solved.weights,
        mean_mm=mean_mm,
        gamma=searched["gamma"],
    )


def _fitted_samples(
    data: TrainingData,
    touched: NDArray[np.intp],
    method: str,
    settings: FitSettings,
    rng: np.random.Generator,
) -> tuple[NDArray[np.intp], NDArray[np.intp] | None]:
    """Samples of the final fit, and for the approximation the landmarks among them."""
    chosen = touched[
        spread_samples(data.press[touched], data.press_mm[touched, 2], settings.fit_samples, rng)
    ]
    if method != "nystroem":
        return chosen, None
    return chosen, spread_samples(data.press[chosen], data.press_mm[chosen, 2], settings.landmarks, rng)


def searched_grid(
    data: TrainingData,
    touched: NDArray[np.intp],
    most_samples: int,
    rng: np.random.Generator,
    on_share: Callable[[float], None],
) -> dict[str, Any]:
    """γ and λ with the smallest mean error at held-out locations, and how the search went.

    The systems are solved in single precision: from λ = 0.01 up that moves presses by less than 0.01 mm.
    """
    half = touched[held_out(data.press[touched], TUNING_SHARE, rng)]
    chosen = half[spread_samples(data.press[half], data.press_mm[half, 2], most_samples, rng)]
    features = data.signals[np.ix_(chosen, data.kept)].astype(np.float64)
    press_mm = data.press_mm[chosen]
    tested = held_out(data.location[chosen], JUDGED_SHARE, rng)
    median = median_distance(features, rng)
    among = cdist(features[~tested], features[~tested], "cityblock").astype(np.float32)
    across = cdist(features[tested], features[~tested], "cityblock")
    mean_mm = press_mm[~tested].mean(axis=0)
    errors = {}
    for number, relative in enumerate(GAMMA_TIMES_MEDIAN):
        kernel, other = np.exp(-relative / median * among), np.exp(-relative / median * across)
        for ridge in RIDGES:
            weights = substituted(factorise(kernel.copy(), ridge), press_mm[~tested] - mean_mm)
            errors[relative, ridge] = mean_error_mm(mean_mm + other @ weights, press_mm[tested])
        on_share((number + 1) / len(GAMMA_TIMES_MEDIAN))
    relative, ridge = min(errors, key=lambda one: errors[one])
    kernel, other = np.exp(-relative / median * among), np.exp(-relative / median * across)
    weights = substituted(factorise(kernel, ridge), press_mm[~tested] - mean_mm)
    return held_out_figures(mean_mm + other @ weights, press_mm[tested]) | {
        "gamma": relative / median,
        "gamma_times_median": relative,
        "lambda": ridge,
        "median_distance_counts": median,
        "search_samples": len(chosen),
        "search_error_mm": errors[relative, ridge],
        "search_at_border": _at_border(relative, ridge),
    }


def _at_border(relative: float, ridge: float) -> list[str]:
    """Which of the two lies at an end of its grid: better values may lie outside."""
    return [
        name
        for name, value, grid in (("gamma", relative, GAMMA_TIMES_MEDIAN), ("lambda", ridge, RIDGES))
        if value in (grid[0], grid[-1])
    ]


def median_distance(features: FloatArray, rng: np.random.Generator) -> float:
    """Median L1 distance of two samples (n, feature).

    Raises
    ------
    InputError : most samples are equal.
    """
    one, other = rng.integers(len(features), size=(2, PAIRS_FOR_MEDIAN))
    median = float(np.median(np.abs(features[one] - features[other]).sum(axis=1)))
    if not median > 0.0:
        raise InputError("training data: the touched samples hardly differ; check gain and wiring")
    return median
