"""A Gaussian process for (x, y, depth) that uses all samples through a limited number of inducing points.

Readings are standardised pair by pair. One kernel, one length scale and one noise σ serve x, y and depth, each in units
of its own spread. The projected process of Rasmussen and Williams, section 8.3.4: with K_mm the kernel among the
inducing points (samples drawn at random) and K_mn that with all samples,

    B = K_mm + K_mn K_nm / σ²,    A = B⁻¹ K_mn y / σ²,    Q = K_mm⁻¹ - B⁻¹

Length scale (times the median distance of two samples) and σ come from a grid at locations held out, by an exact
process of `settings.search_samples` at most. The kernel was chosen the same way: at held-out locations of simulated
training data the exponential kernel errs less than Matérn 3/2, and that less than the Gaussian.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from design.arrays import BoolArray
from design.progress import OnStep
from sims.learning.fits.beginning import begun
from sims.learning.fits.trust import trust_of
from sims.learning.inference.feature_scaling import FeatureScaling
from sims.learning.inference.gaussian_process import GaussianProcessModel, exponential_kernel
from sims.learning.inference.sigma_table import UNIT_SIGMA
from sims.learning.samples.errors_mm import mean_error_mm
from sims.learning.samples.model_header import trained_header
from sims.learning.samples.press_samples import PressSamples
from sims.learning.samples.scalings import standard_scaling
from sims.learning.samples.settings import DEFAULT, FitSettings
from sims.readings.dataset import PressData

LENGTH_TIMES_MEDIAN = (0.5, 1.0, 2.0, 4.0)
NOISES = (0.03, 0.1, 0.3)
"""σ of the grid, in units of the outputs' spread."""
JITTER = 1e-6
"""Added to K_mm's diagonal of 1: two inducing points may almost coincide."""
BLOCK_ROWS = 2_000
PAIRS_FOR_MEDIAN = 20_000


@dataclass(frozen=True, kw_only=True)
class _Scales:
    """Length scale of the features [-] and noise over the outputs' spread [-]."""

    length: float
    noise: float


def fit_gaussian_process(
    train: PressData,
    *,
    seed: int = 0,
    on_step: OnStep = lambda _stage, _share: None,
    settings: FitSettings = DEFAULT,
) -> GaussianProcessModel:
    """Train touch and process.

    Raises
    ------
    InputError : too little data, or data that tell nothing.
    """
    start = begun(train, seed, settings, on_step)
    data, rng, samples = start.data, start.rng, start.samples
    scaling = standard_scaling(data.kept, samples.signals.astype(np.float32))
    scales, found = _searched(
        samples, scaling, settings.search_samples, rng, lambda share: on_step("search", share)
    )
    facts = start.facts | found | {"inducing": min(settings.inducing, len(samples))}
    empty = GaussianProcessModel(
        header=trained_header("gaussian-process", data, facts, seed),
        touch=start.touch,
        scaling=scaling,
        length=scales.length,
        points=np.zeros((0, len(data.kept))),
        weights=np.zeros((0, 3)),
        known=np.zeros((0, 0), np.float32),
        mean_mm=samples.press_mm.mean(axis=0),
        scale_mm=samples.press_mm.std(axis=0),
        sigma=UNIT_SIGMA,
    )
    tried = _projected(empty, samples, ~samples.is_held_out, scales.noise, settings.inducing, rng)
    table, figures = trust_of(tried, samples)
    on_step("fit", 0.45)
    whole = _projected(empty, samples, np.ones(len(samples), np.bool_), scales.noise, settings.inducing, rng)
    on_step("fit", 1.0)
    return replace(whole, header=trained_header("gaussian-process", data, facts | figures, seed), sigma=table)


def _searched(
    samples: PressSamples,
    scaling: FeatureScaling,
    most_samples: int,
    rng: np.random.Generator,
    on_share: Callable[[float], None],
) -> tuple[_Scales, dict[str, float]]:
    """Scales with the smallest mean error at the locations held out, and what the search found."""
    chosen = np.sort(rng.permutation(len(samples))[:most_samples])
    features, press_mm = scaling.features(samples.signals[chosen]), samples.press_mm[chosen]
    tested = samples.is_held_out[chosen]
    one, other = rng.integers(len(features), size=(2, PAIRS_FOR_MEDIAN))
    median = float(np.median(np.linalg.norm(features[one] - features[other], axis=1)))
    mean_mm, scale_mm = press_mm[~tested].mean(axis=0), press_mm[~tested].std(axis=0)
    errors = {}
    for number, relative in enumerate(LENGTH_TIMES_MEDIAN):
        near = features / (relative * median)
        among = exponential_kernel(near[~tested], near[~tested])
        across = exponential_kernel(near[tested], near[~tested])
        for noise in NOISES:
            noisy = among + noise**2 * np.eye(len(among))
            weights = cho_solve(cho_factor(noisy, overwrite_a=True), (press_mm[~tested] - mean_mm) / scale_mm)
            told_mm = mean_mm + scale_mm * (across @ weights)
            errors[relative, noise] = mean_error_mm(told_mm, press_mm[tested])
        on_share((number + 1) / len(LENGTH_TIMES_MEDIAN))
    relative, noise = min(errors, key=lambda one: errors[one])
    return _Scales(length=relative * median, noise=noise), {
        "length_times_median": relative,
        "length": relative * median,
        "noise": noise,
        "search_samples": len(chosen),
        "search_error_mm": errors[relative, noise],
    }


def _projected(
    empty: GaussianProcessModel,
    samples: PressSamples,
    used: BoolArray,
    noise: float,
    most_points: int,
    rng: np.random.Generator,
) -> GaussianProcessModel:
    """The process of the used samples."""
    features = empty.scaling.features(samples.signals[used]) / empty.length
    targets = (samples.press_mm[used] - empty.mean_mm) / empty.scale_mm
    points = features[np.sort(rng.permutation(len(features))[:most_points])]
    among = exponential_kernel(points, points) + JITTER * np.eye(len(points))
    both, right = among.copy(), np.zeros((len(points), 3))
    for start in range(0, len(features), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        kernel = exponential_kernel(points, features[rows])
        both += kernel @ kernel.T / noise**2
        right += kernel @ targets[rows] / noise**2
    identity = np.eye(len(points))
    factor = cho_factor(both)
    known = cho_solve(cho_factor(among), identity) - cho_solve(factor, identity)
    return replace(empty, points=points, weights=cho_solve(factor, right), known=known.astype(np.float32))
