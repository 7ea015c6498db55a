"""The paper's learner: a touch classifier, then kernel ridge regression with a Laplacian kernel for (x, y, depth).

The regression is trained on depths of 0 and more. Features are the readings minus the off state, in counts, unscaled.
The noise is about equal in all of them; dividing each pair by its own spread would raise the noise of weak pairs to the
size of strong pairs' signals. As in the paper, γ and λ are tuned on half of the training data, here half of the
presses. The model is fitted on four fifths of their locations and tested on the last fifth (`mean_error_mm`). With
fewer locations in this fit, its grid of presses would be coarser than that of the final fit. The values of γ that are
tried scale with the data: γ times the median L1 distance between two training samples has fixed values, as the paper's
own numbers depend on its units. The final fit uses samples of all presses. The mean of the targets is subtracted, so
that far from every sample the estimate is the mean press, not the origin.

`touch_prepared` and `begun` begin every fit: data check, touch classifier, choice of samples in contact.

Cholesky factor of a large symmetric matrix in its own memory
-------------------------------------------------------------
    A = L Lᵀ,   for each block column k:   L_kk = chol(A_kk),   L_ik = A_ik L_kk⁻ᵀ,   A_ij -= L_ik L_jkᵀ   (i ≥ j > k)

Only the lower triangle is read and written. LAPACK's own routine does the same in one call, but with the OpenBLAS that
SciPy 1.17 ships, that call ended in a memory fault for 24,000 rows on two threads. Here every call works on blocks of
`BLOCK` rows, and the products of blocks take nearly all of the time. Source: Golub and Van Loan, Matrix computations
(2013), section 4.2.

The linear system of kernel ridge regression, solved in the available memory
----------------------------------------------------------------------------
    (K + λ I) a = y,    K_ij = exp(-γ |s_i - s_j|₁)

`exact`     double precision, Cholesky in place: 8 n² bytes. 24,000 samples take 4.6 GB.
`single`    if that does not fit: single precision, 4 n² bytes, and one step of iterative refinement. Its residual is
            computed in double precision from the samples: r = y - (K + λ I) a, then a += (K + λ I)⁻¹ r.
`nystroem`  if that does not fit either: all samples are fitted, with kernels of only m of them (landmarks z),
            min |y - K_nm a|² + λ aᵀ K_mm a, by its normal equations accumulated in blocks: 8 m² bytes. Source: Williams
            and Seeger, Using the Nystroem method to speed up kernel machines, NIPS 13 (2001); Rudi, Camoriano and
            Rosasco, Less is more, NIPS 28 (2015).

The model's header names the method, so an approximation is never silent. The matrix is built a block of rows at a time,
in its lower triangle only, so no other array is as large.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from design.arrays import FloatArray
from design.errors import InputError
from design.progress import OnShare, OnStep
from sims.learning.fits.touch import fit_plain_touch, fit_tuned_touch
from sims.learning.inference.kernel_ridge import KernelRidgeModel
from sims.learning.inference.touch_svm import TouchSvm
from sims.learning.samples import (
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
from sims.learning.settings import DEFAULT, FitSettings
from sims.readings.dataset import PressData

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


@dataclass(frozen=True, kw_only=True)
class Begun(ToldTouch):
    """State of a model's fit once samples in contact are chosen. Some are held out to scale the model's deviations."""

    samples: PressSamples


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


def begun(train: PressData, seed: int, settings: FitSettings, on_step: OnStep) -> Begun:
    """Start the fit of trees: check data, fit the tuned touch classifier, choose samples in contact."""
    prepared = touch_prepared(train, fit_tuned_touch, seed=seed, settings=settings, on_step=on_step)
    samples = press_samples(prepared.data, settings.tree_samples, prepared.rng)
    return Begun(
        data=prepared.data,
        rng=prepared.rng,
        touch=prepared.touch,
        facts=prepared.facts | {"fit_samples": len(samples)},
        samples=samples,
    )


BLOCK = 1_500


def factorise_in_place(matrix: NDArray[Any]) -> None:
    """Overwrite the lower triangle of a symmetric matrix (n, n) with its Cholesky factor L; single or double precision.

    Raises
    ------
    numpy.linalg.LinAlgError : the matrix is not positive definite in this precision; it is then partly overwritten.
    """
    size = len(matrix)
    for start in range(0, size, BLOCK):
        here = slice(start, min(start + BLOCK, size))
        # skip the upper triangle: a signalling NaN there would count as a matrix that is not positive definite
        matrix[here, here] = np.linalg.cholesky(np.tril(matrix[here, here]))
        for rows in _below(here.stop, size):
            matrix[rows, here] = solve_triangular(
                matrix[here, here], matrix[rows, here].T, lower=True, check_finite=False
            ).T
        for columns in _below(here.stop, size):
            for rows in _below(columns.start, size):
                matrix[rows, columns] -= matrix[rows, here] @ matrix[columns, here].T


def substituted(factor: NDArray[Any], targets: FloatArray) -> FloatArray:
    """Solution (n, output) of L Lᵀ x = targets; L is in the lower triangle of `factor` (n, n)."""
    found = np.array(targets, dtype=factor.dtype)
    blocks = list(_below(0, len(factor)))
    for here in blocks:
        found[here] -= factor[here, : here.start] @ found[: here.start]
        found[here] = _solved(factor[here, here], found[here], "N")
    for here in reversed(blocks):
        found[here] -= factor[here.stop :, here].T @ found[here.stop :]
        found[here] = _solved(factor[here, here], found[here], "T")
    return np.asarray(found, dtype=np.float64)


def _below(start: int, size: int) -> list[slice]:
    """Slices of at most `BLOCK` rows, from `start` up to `size`."""
    return [slice(row, min(row + BLOCK, size)) for row in range(start, size, BLOCK)]


def _solved(triangle: NDArray[Any], right: NDArray[Any], trans: str) -> NDArray[Any]:
    return np.asarray(solve_triangular(triangle, right, lower=True, trans=trans, check_finite=False))


BLOCK_ROWS = 500
CHECKED_ROWS = 1_000
RIDGE_OF_LANDMARKS = 1e-9
"""Number added to the diagonal of K_mm, which is 1, so that its Cholesky factor exists despite rounding errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KernelSolution:
    """Solution of the kernel system: weights of the samples that the model stores.

    Attributes
    ----------
    kept : (kept,) indices of the stored samples
    weights : (kept, output) weights in the unit of the targets
    method : exact, single or nystroem
    largest_residual : largest residual in `CHECKED_ROWS` of the equations, divided by the largest target [-]; NaN for
        `nystroem`, which solves a different system
    """

    kept: NDArray[np.intp]
    weights: FloatArray
    method: str
    largest_residual: float


def method_for(samples: int, memory_gb: float) -> str:
    """The most exact of the three methods whose matrix for `samples` samples fits into `memory_gb`."""
    if 8e-9 * samples**2 <= memory_gb:
        return "exact"
    return "single" if 4e-9 * samples**2 <= memory_gb else "nystroem"


def solve_kernel(
    features: FloatArray,
    targets: FloatArray,
    *,
    gamma: float,
    ridge: float,
    method: str,
    landmarks: NDArray[np.intp] | None = None,
    refinements: int = 1,
    on_share: OnShare = lambda _share: None,
) -> KernelSolution:
    """Solve the kernel ridge system by one of the three methods.

    Parameters
    ----------
    features : (sample, feature) [-]
    targets : (sample, output) targets with their mean subtracted
    gamma : γ of the kernel, per unit of L1 distance [-]
    ridge : λ, added to the diagonal [-]
    method : `exact`, `single` or `nystroem`
    landmarks : indices of the samples that `nystroem` stores; required by that method only
    refinements : number of refinement steps of `single`; 0 is for comparisons only

    Raises
    ------
    InputError : the matrix is not positive definite in this precision.
    """
    if method == "nystroem":
        assert landmarks is not None
        weights = _nystroem(features, targets, landmarks, gamma, ridge, on_share)
        return KernelSolution(kept=landmarks, weights=weights, method=method, largest_residual=float("nan"))
    kind = np.float64 if method == "exact" else np.float32
    factor = factorise(kernel_matrix(features, gamma, kind, on_share), ridge)
    weights = substituted(factor, targets)
    everything = np.arange(len(features))
    for _ in range(refinements if method == "single" else 0):
        residual = _residual(features, targets, weights, gamma, ridge, everything)
        weights = weights + substituted(factor, residual)
    checked = everything[:: -(-len(features) // CHECKED_ROWS)]
    residual = _residual(features, targets, weights, gamma, ridge, checked)
    return KernelSolution(
        kept=np.arange(len(features)),
        weights=weights,
        method=method,
        largest_residual=float(np.abs(residual).max() / np.abs(targets).max()),
    )


def kernel_matrix(
    features: FloatArray, gamma: float, kind: type[Any], on_share: OnShare = lambda _share: None
) -> NDArray[Any]:
    """Lower triangle of the kernel matrix (sample, sample); the zeros above take no memory until accessed."""
    samples = len(features)
    matrix = np.zeros((samples, samples), kind)

    def fill(start: int) -> int:
        end = min(start + BLOCK_ROWS, samples)
        block = cdist(features[start:end], features[:end], "cityblock")
        block *= -gamma
        np.exp(block, out=matrix[start:end, :end], casting="same_kind")
        return end

    with ThreadPoolExecutor(
        kernel_threads()
    ) as pool:  # SciPy's distances and NumPy's exp release the interpreter lock
        for end in pool.map(fill, range(0, samples, BLOCK_ROWS)):
            on_share(0.5 * (end / samples) ** 2)
    return matrix


def kernel_threads() -> int:
    """Number of threads that fill the matrix: `OMP_NUM_THREADS` if set, as for BLAS, otherwise the number of cores."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, int(wanted) if wanted.isdecimal() else os.cpu_count() or 1)


def factorise(matrix: NDArray[Any], ridge: float) -> NDArray[Any]:
    """Cholesky factor of matrix + ridge I, in the lower triangle of the matrix' own memory.

    Raises
    ------
    InputError : the matrix is not positive definite in this precision.
    """
    matrix.flat[:: len(matrix) + 1] += ridge
    try:
        factorise_in_place(matrix)
    except np.linalg.LinAlgError:
        raise InputError(
            f"kernel ridge: the matrix is not positive definite at lambda {ridge:g}; give a larger lambda"
        ) from None
    return matrix


def _residual(
    features: FloatArray,
    targets: FloatArray,
    weights: FloatArray,
    gamma: float,
    ridge: float,
    rows: NDArray[np.intp],
) -> FloatArray:
    """Residual y - (K + λ I) a (row, output) of some rows, computed block by block in double precision."""
    residual = targets[rows] - ridge * weights[rows]

    def subtract(start: int) -> None:
        block = rows[start : start + BLOCK_ROWS]
        kernel = np.exp(-gamma * cdist(features[block], features, "cityblock"))
        residual[start : start + BLOCK_ROWS] -= kernel @ weights

    with ThreadPoolExecutor(kernel_threads()) as pool:
        list(pool.map(subtract, range(0, len(rows), BLOCK_ROWS)))
    return residual


def _nystroem(
    features: FloatArray,
    targets: FloatArray,
    landmarks: NDArray[np.intp],
    gamma: float,
    ridge: float,
    on_share: OnShare,
) -> FloatArray:
    """Weights of the landmarks by the Nyström method, preconditioned by the Cholesky factor of their kernel matrix."""
    points = features[landmarks]
    among = np.exp(-gamma * cdist(points, points, "cityblock"))
    among.flat[:: len(among) + 1] += RIDGE_OF_LANDMARKS
    root = np.linalg.cholesky(among)
    normal = np.zeros((len(points), len(points)))
    right = np.zeros((len(points), targets.shape[1]))
    for start in range(0, len(features), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        kernel = np.exp(-gamma * cdist(points, features[rows], "cityblock"))
        white = solve_triangular(root, kernel, lower=True, overwrite_b=True, check_finite=False)
        normal += white @ white.T
        right += white @ targets[rows]
        on_share(0.8 * (start + BLOCK_ROWS) / (len(features) + BLOCK_ROWS))
    weights = substituted(factorise(normal, ridge), right)
    return np.asarray(solve_triangular(root, weights, lower=True, trans="T", check_finite=False))


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
        prepared.facts
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
        touch=prepared.touch,
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
    """Indices of the samples of the final fit, and of the landmarks among them (None unless `method` is nystroem)."""
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
    """Search for the γ and λ of least mean error at held-out locations; return both, and figures on the search.

    The systems are solved in single precision. For λ of 0.01 or more, this changes estimates by less than 0.01 mm.
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
