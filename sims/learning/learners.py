"""The learners by name: each trains the touch classifier (`sims/learning/touch_fit.py`) and a model of the press.

Kernel ridge
------------
The paper's learner: kernel ridge regression with a Laplacian kernel, trained on depths of 0 and more. Features are the
readings minus the off state, in counts, unscaled. The noise is about equal in all of them; dividing each pair by its
own spread would raise the noise of weak pairs to the size of strong pairs' signals. As in the paper, γ and λ are tuned
on half of the training data, here half of the presses. The model is fitted on four fifths of their locations and tested
on the last fifth (`mean_error_mm`). With fewer locations in this fit, its grid of presses would be coarser than that of
the final fit. The values of γ that are tried scale with the data: γ times the median L1 distance between two training
samples has fixed values, as the paper's own numbers depend on its units. The final fit uses samples of all presses. The
mean of the targets is subtracted, so that far from every sample the estimate is the mean press, not the origin.

    (K + λ I) a = y,    K_ij = exp(-γ |s_i - s_j|₁)

is solved by LAPACK's Cholesky factor in the matrix' own memory: 8 n² bytes, 4.6 GB for 24,000 samples. The factor is
computed on one thread: on two threads the OpenBLAS of SciPy 1.17 and NumPy 2.4 ends in a memory fault at 24,000 rows.
The matrix is built a block of rows at a time, in its lower triangle only, so no other array is as large.

Extra trees
-----------
Extremely randomised trees, grown by scikit-learn and stored in flat arrays. Features are the readings in counts. A
split uses one pair at a time, so scales have no effect. Every tree uses all samples and draws its splits at random. The
mean over trees is smooth enough to interpolate between pressed locations. x, y and depth are each divided by their
spread, so they have equal weight; in millimetres depth would hardly affect the splits. Giving depth two or four times
the weight was tried at held-out locations of three simulated data sets. The mean depth error falls by 12 % or 19 %, but
the mean location error grows by 8 % or 22 %, and the sum is larger. Left out: trees return means of training samples,
so the deepest presses are estimated too shallow.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist
from sklearn.ensemble import ExtraTreesRegressor
from threadpoolctl import threadpool_limits

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.design.progress import OnShare, OnStep
from optopad.sims.learning.inference.extra_trees import ExtraTreesModel, Forest
from optopad.sims.learning.inference.kernel_ridge import KernelRidgeModel
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA, FeatureScaling, TouchModel, TouchSvm
from optopad.sims.learning.samples import (
    PressSamples,
    TrainingData,
    counts_scaling,
    held_out,
    held_out_figures,
    mean_error_mm,
    prepared,
    press_samples,
    spread_samples,
    trained_header,
)
from optopad.sims.learning.touch_fit import fit_plain_touch, fit_tuned_touch, trust_of
from optopad.sims.readings.dataset import PressData


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Limits on the size of a fit; a learner ignores the limits of other learners.

    Attributes
    ----------
    search_samples : largest number of samples in contact for the kernel-ridge grid search, fitted and held-out together
    fit_samples : largest number of samples in contact for the final kernel-ridge fit
    tree_samples : largest number of samples in contact for the trees
    trees : number of trees in the forest
    """

    search_samples: int = 6_000
    fit_samples: int = 10_000
    tree_samples: int = 30_000
    trees: int = 80


DEFAULT = FitSettings()
QUICK = FitSettings(search_samples=2_000, fit_samples=4_000, tree_samples=8_000, trees=40)
"""Limits for a first look: a fit takes seconds instead of minutes."""
FULL = FitSettings(fit_samples=24_000, tree_samples=60_000, trees=120)
"""Limits that allow half of the paper's training samples in contact, in one kernel matrix of 4.6 GB."""
EFFORTS = {"quick": QUICK, "default": DEFAULT, "full": FULL}


FitTouch = Callable[[TrainingData, np.random.Generator, int], tuple[TouchSvm, dict[str, Any]]]


@dataclass(frozen=True, kw_only=True)
class ToldTouch:
    """State of a model's fit once the touch classifier is fitted.

    Attributes
    ----------
    data : checked training data
    rng : random generator for all further choices of the fit
    touch : the touch classifier
    facts : figures on the classifier's fit, for the model's header
    """

    data: TrainingData
    rng: np.random.Generator
    touch: TouchSvm
    facts: dict[str, Any]


def touch_prepared(
    train: PressData, fit_touch: FitTouch, *, seed: int, settings: FitSettings, on_step: OnStep
) -> ToldTouch:
    """Check the training data and fit the touch classifier with the function `fit_touch`.

    Raises
    ------
    InputError : there are too few data or usable pairs, or the signals hardly vary.
    """
    data, rng = prepared(train), np.random.default_rng(seed)
    on_step("touch", 0.0)
    touch, facts = fit_touch(data, rng, 4 * settings.fit_samples)
    on_step("touch", 1.0)
    return ToldTouch(data=data, rng=rng, touch=touch, facts=facts)


BLOCK_ROWS = 500


def kernel_matrix(features: FloatArray, gamma: float, on_share: OnShare = lambda _share: None) -> FloatArray:
    """Lower triangle of the kernel matrix (sample, sample); the zeros above take no memory until accessed."""
    samples = len(features)
    matrix = np.zeros((samples, samples))

    def fill(start: int) -> int:
        end = min(start + BLOCK_ROWS, samples)
        block = cdist(features[start:end], features[:end], "cityblock")
        block *= -gamma
        np.exp(block, out=matrix[start:end, :end])
        return end

    # SciPy's distances and NumPy's exp release the interpreter lock
    with ThreadPoolExecutor(kernel_threads()) as pool:
        for end in pool.map(fill, range(0, samples, BLOCK_ROWS)):
            on_share(0.5 * (end / samples) ** 2)
    return matrix


def kernel_threads() -> int:
    """Number of threads that fill the matrix: `OMP_NUM_THREADS` if set, as for BLAS, otherwise the number of cores."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, int(wanted) if wanted.isdecimal() else os.cpu_count() or 1)


def solved(matrix: FloatArray, ridge: float, targets: FloatArray) -> FloatArray:
    """Solution a (sample, output) of (K + λ I) a = targets.

    Parameters
    ----------
    matrix : (sample, sample) K, of which the lower triangle alone is read; it is overwritten
    ridge : λ [-]

    Raises
    ------
    InputError : the matrix is not positive definite.
    """
    matrix.flat[:: len(matrix) + 1] += ridge
    try:
        with threadpool_limits(1, user_api="blas"):
            # the lower triangle by rows is the upper triangle by columns, LAPACK's order
            factor = cho_factor(matrix.T, lower=False, overwrite_a=True, check_finite=False)
    except np.linalg.LinAlgError:
        raise InputError(
            f"kernel ridge: the matrix is not positive definite at lambda {ridge:g}; give a larger lambda"
        ) from None
    return np.asarray(cho_solve(factor, targets, check_finite=False))


GAMMA_TIMES_MEDIAN = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
RIDGES = (1e-2, 1e-1, 1.0, 10.0)
TUNING_SHARE = 0.5
"""Share of the presses on which γ and λ are tuned [-]."""
JUDGED_SHARE = 0.2
"""Share of the tuning presses' locations that are held out to test candidates for γ and λ [-]."""
PAIRS_FOR_MEDIAN = 20_000
"""Number of random pairs of samples from which the median distance is taken; its error is then about 1 %."""


def fit_kernel_ridge(
    train: PressData,
    *,
    seed: int = 0,
    on_step: OnStep = lambda _stage, _share: None,
    settings: FitSettings = DEFAULT,
) -> KernelRidgeModel:
    """Train the touch classifier and the kernel ridge regression behind it.

    Raises
    ------
    InputError : there are too few data or usable pairs, or the signals hardly vary.
    """
    prepared = touch_prepared(train, fit_plain_touch, seed=seed, settings=settings, on_step=on_step)
    data, rng = prepared.data, prepared.rng
    scaling = counts_scaling(data.kept)
    touched = np.flatnonzero(data.is_touched)
    searched = searched_grid(
        data, touched, settings.search_samples, rng, lambda share: on_step("search", share)
    )
    chosen = touched[
        spread_samples(data.press[touched], data.press_mm[touched, 2], settings.fit_samples, rng)
    ]
    features = scaling.features(data.signals[chosen].astype(np.float64))
    mean_mm = data.press_mm[chosen].mean(axis=0)
    matrix = kernel_matrix(features, searched["gamma"], lambda share: on_step("fit", share))
    weights = solved(matrix, searched["lambda"], data.press_mm[chosen] - mean_mm)
    on_step("fit", 1.0)
    facts = prepared.facts | searched | {"fit_samples": len(chosen)}
    return KernelRidgeModel(
        header=trained_header("kernel-ridge", data, facts, seed),
        touch=prepared.touch,
        scaling=scaling,
        samples=features.astype(np.float32),
        weights=weights,
        mean_mm=mean_mm,
        gamma=searched["gamma"],
    )


def searched_grid(
    data: TrainingData,
    touched: NDArray[np.intp],
    most_samples: int,
    rng: np.random.Generator,
    on_share: Callable[[float], None],
) -> dict[str, Any]:
    """Search for the γ and λ of least mean error at held-out locations; return both, and figures on the search."""
    half = touched[held_out(data.press[touched], TUNING_SHARE, rng)]
    chosen = half[spread_samples(data.press[half], data.press_mm[half, 2], most_samples, rng)]
    features = data.signals[np.ix_(chosen, data.kept)].astype(np.float64)
    press_mm = data.press_mm[chosen]
    tested = held_out(data.location[chosen], JUDGED_SHARE, rng)
    median = median_distance(features, rng)
    among = cdist(features[~tested], features[~tested], "cityblock")
    across = cdist(features[tested], features[~tested], "cityblock")
    mean_mm = press_mm[~tested].mean(axis=0)
    errors = {}
    for number, relative in enumerate(GAMMA_TIMES_MEDIAN):
        kernel, other = np.exp(-relative / median * among), np.exp(-relative / median * across)
        for ridge in RIDGES:
            weights = solved(kernel.copy(), ridge, press_mm[~tested] - mean_mm)
            errors[relative, ridge] = mean_error_mm(mean_mm + other @ weights, press_mm[tested])
        on_share((number + 1) / len(GAMMA_TIMES_MEDIAN))
    relative, ridge = min(errors, key=lambda one: errors[one])
    kernel, other = np.exp(-relative / median * among), np.exp(-relative / median * across)
    weights = solved(kernel, ridge, press_mm[~tested] - mean_mm)
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
    """Names of those of γ and λ that are at an end of their grid, so that a better value may be outside."""
    return [
        name
        for name, value, grid in (("gamma", relative, GAMMA_TIMES_MEDIAN), ("lambda", ridge, RIDGES))
        if value in (grid[0], grid[-1])
    ]


def median_distance(features: FloatArray, rng: np.random.Generator) -> float:
    """Median L1 distance between two random samples of `features` (n, feature).

    Raises
    ------
    InputError : most samples are equal.
    """
    one, other = rng.integers(len(features), size=(2, PAIRS_FOR_MEDIAN))
    median = float(np.median(np.abs(features[one] - features[other]).sum(axis=1)))
    if not median > 0.0:
        raise InputError("training data: the touched samples are almost equal; check gain and wiring")
    return median


FEWEST_IN_LEAF = 2
SHARE_OF_FEATURES = 0.33
TREES_OF_TRUST = 40
"""Number of trees in the forest that is fitted only to measure how its spread relates to its error."""


def fit_extra_trees(
    train: PressData,
    *,
    seed: int = 0,
    on_step: OnStep = lambda _stage, _share: None,
    settings: FitSettings = DEFAULT,
) -> ExtraTreesModel:
    """Train the touch classifier and the forest.

    Raises
    ------
    InputError : there are too few data or usable pairs, or the signals hardly vary.
    """
    start = touch_prepared(train, fit_tuned_touch, seed=seed, settings=settings, on_step=on_step)
    data, rng = start.data, start.rng
    samples = press_samples(data, settings.tree_samples, rng)
    scaling = counts_scaling(data.kept)
    tried = _forest(samples, ~samples.is_held_out, scaling, min(settings.trees, TREES_OF_TRUST), rng)
    on_step("fit", 0.3)
    forest = _forest(samples, np.ones(len(samples), np.bool_), scaling, settings.trees, rng)
    facts = start.facts | {
        "fit_samples": len(samples),
        "trees": settings.trees,
        "fewest_in_leaf": FEWEST_IN_LEAF,
        "share_of_features": SHARE_OF_FEATURES,
    }
    model = ExtraTreesModel(
        header=trained_header("extra-trees", data, facts, seed),
        touch=start.touch,
        scaling=scaling,
        forest=tried,
        sigma=UNIT_SIGMA,
    )
    table, figures = trust_of(model, samples)
    on_step("fit", 1.0)
    header = trained_header("extra-trees", data, facts | figures, seed)
    return replace(model, header=header, forest=forest, sigma=table)


def _forest(
    samples: PressSamples,
    used: BoolArray,
    scaling: FeatureScaling,
    trees: int,
    rng: np.random.Generator,
) -> Forest:
    """Grow a forest on the used samples; `used` is a mask (sample,)."""
    grown = ExtraTreesRegressor(
        n_estimators=trees,
        min_samples_leaf=FEWEST_IN_LEAF,
        max_features=SHARE_OF_FEATURES,
        random_state=int(rng.integers(2**31)),
    )
    scale_mm = samples.press_mm[used].std(axis=0)
    grown.fit(scaling.features(samples.signals[used]).astype(np.float32), samples.press_mm[used] / scale_mm)
    return flat_forest([one.tree_ for one in grown.estimators_], scale_mm)


def flat_forest(trees: list[Any], scale_mm: FloatArray) -> Forest:
    """Convert scikit-learn's trees to one `Forest` in shared arrays.

    Parameters
    ----------
    trees : scikit-learn's trees; their leaves have x, y, depth in units of `scale_mm`
    scale_mm : (3,) units of x, y, depth [mm]

    Notes
    -----

    scikit-learn compares single-precision features with double-precision thresholds. Thresholds rounded down to single
    precision give the same decisions. The left child of a node is stored directly after it, as trees are grown depth
    first.
    """
    feature, threshold, other, leaf_mm, roots = [], [], [], [], []
    nodes = leaves = 0
    for tree in trees:
        is_leaf = tree.children_left < 0
        assert (tree.children_left[~is_leaf] == np.flatnonzero(~is_leaf) + 1).all()
        roots.append(nodes)
        feature.append(np.where(is_leaf, -1, tree.feature))
        threshold.append(np.where(is_leaf, 0.0, _rounded_down(tree.threshold)))
        leaf_number = leaves + np.cumsum(is_leaf) - 1
        other.append(np.where(is_leaf, leaf_number, nodes + tree.children_right))
        leaf_mm.append(tree.value[is_leaf, :, 0] * scale_mm)
        nodes, leaves = nodes + len(is_leaf), leaves + int(is_leaf.sum())
    return Forest(
        roots=np.array(roots, np.int32),
        feature=np.concatenate(feature).astype(np.int16),
        threshold=np.concatenate(threshold).astype(np.float32),
        other=np.concatenate(other).astype(np.int32),
        leaf_mm=np.concatenate(leaf_mm).astype(np.float32),
    )


def _rounded_down(threshold: FloatArray) -> NDArray[np.float32]:
    """Round thresholds (node,) down to single precision, never up."""
    near = threshold.astype(np.float32)
    below = np.nextafter(near, np.float32(-np.inf))
    return np.asarray(np.where(near > threshold, below, near))


class Learner(Protocol):
    """A function that trains a model."""

    def __call__(
        self, train: PressData, *, seed: int = ..., on_step: OnStep = ..., settings: FitSettings = ...
    ) -> TouchModel:
        """Train a model; raises `InputError` if the data are insufficient."""
        ...


LEARNERS: dict[str, Learner] = {"kernel-ridge": fit_kernel_ridge, "extra-trees": fit_extra_trees}
"""Training functions by name. The name is also stored as the trained model's `kind`."""
