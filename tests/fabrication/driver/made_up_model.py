"""A kernel-ridge model of the made-up pad, solved here with numpy alone: good enough to see the finger by."""

from __future__ import annotations

from functools import cache

import numpy as np

from optopad.sims.learning.inference.header import ForceCurve, ModelHeader
from optopad.sims.learning.inference.kernel_ridge import KernelRidgeModel
from optopad.sims.learning.inference.touch_model import FeatureScaling, TouchSvm
from tests.fabrication.driver.made_up_pad import pad_config, press_table

FULL_SCALE = 1023.0
TOUCHED_LOSS = 0.006
"""Mean loss over all pairs from which on the pad counts as touched: some 0.3 mm deep."""


def readings(presses: np.ndarray) -> np.ndarray:
    """(n, pair) signals as the fake board gives them, but for noise: clipped with the ambient light, rounded."""
    light = press_table().at(presses)
    counts = np.minimum(np.round(light + 2.0), FULL_SCALE) - 2.0
    return np.asarray(counts.reshape(len(counts), -1))


def header(**changes: object) -> ModelHeader:
    """Of a model of the made-up pad."""
    config = pad_config()
    values = {
        "kind": "kernel-ridge",
        "design_digest": config.digest,
        "emitter_names": tuple(part.name for part in config.emitters),
        "receiver_names": tuple(part.name for part in config.receivers),
        "untouched_counts": readings(np.array([[16.0, 16.0, -1.0]]))[0],
        "force_curve": ForceCurve(depth_mm=(0.0, 2.5, 5.0), force_n=(0.0, 4.0, 10.0)),
    }
    return ModelHeader(**(values | changes))  # type: ignore[arg-type]


@cache
def made_up_model(samples: int = 900) -> KernelRidgeModel:
    """Trained on presses at random."""
    rng = np.random.default_rng(8)
    presses = np.column_stack([rng.uniform(5, 27, (samples, 2)), rng.uniform(0.1, 5.0, samples)])
    signals = readings(presses)
    untouched = header().untouched_counts
    pairs = len(untouched)
    scaling = FeatureScaling(kept=np.arange(pairs), centre=untouched, scale=np.full(pairs, 10.0))
    features = scaling.features(signals)
    gamma = 0.01
    distance = np.array([np.abs(features - one).sum(axis=1) for one in features])
    mean_mm = presses.mean(axis=0)
    weights = np.linalg.solve(np.exp(-gamma * distance) + 1e-2 * np.eye(samples), presses - mean_mm)
    loss = FeatureScaling(kept=np.arange(pairs), centre=untouched, scale=untouched)
    return KernelRidgeModel(
        header=header(),
        touch=TouchSvm(scaling=loss, weights=np.full(pairs, -100.0 / pairs), bias=-100.0 * TOUCHED_LOSS),
        scaling=scaling,
        samples=features.astype(np.float32),
        weights=weights,
        mean_mm=mean_mm,
        gamma=gamma,
    )
