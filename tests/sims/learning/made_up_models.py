"""Small models with known numbers."""

from __future__ import annotations

import numpy as np

from optopad.sims.learning.inference.header import ForceCurve, ModelHeader
from optopad.sims.learning.inference.kernel_ridge import KernelRidgeModel
from optopad.sims.learning.inference.touch_model import FeatureScaling, TouchSvm

EMITTERS, RECEIVERS = ("E1", "E2"), ("R1", "R2", "R3")
PAIRS = len(EMITTERS) * len(RECEIVERS)
DIGEST = "ab" * 32


def made_up_header(**changes) -> ModelHeader:
    values = {
        "kind": "kernel-ridge",
        "design_digest": DIGEST,
        "emitter_names": EMITTERS,
        "receiver_names": RECEIVERS,
        "untouched_counts": np.linspace(100.0, 200.0, PAIRS),
        "trained_on": {"samples": 20, "sets": ["grid-dark-1"]},
        "settings": {"gamma": 0.01},
        "created_with": {"optopad": "0.1.0"},
        "force_curve": ForceCurve(depth_mm=(0.0, 1.0, 2.0), force_n=(0.0, 3.0, 8.0)),
    }
    return ModelHeader(**(values | changes))


def made_up_touch() -> TouchSvm:
    scaling = FeatureScaling(kept=np.arange(PAIRS), centre=np.full(PAIRS, 150.0), scale=np.full(PAIRS, 50.0))
    return TouchSvm(scaling=scaling, weights=-np.ones(PAIRS), bias=0.25)


def made_up_kernel_ridge(samples: int = 20) -> KernelRidgeModel:
    rng = np.random.default_rng(3)
    kept = np.array([0, 1, 3, 4, 5])
    return KernelRidgeModel(
        header=made_up_header(),
        touch=made_up_touch(),
        scaling=FeatureScaling(kept=kept, centre=np.full(5, 120.0), scale=np.full(5, 10.0)),
        samples=rng.normal(size=(samples, 5)).astype(np.float32),
        weights=rng.normal(size=(samples, 3)),
        mean_mm=np.array([16.0, 16.0, 2.0]),
        gamma=0.3,
    )


def made_up_signals(frames: int = 7) -> np.ndarray:
    return np.random.default_rng(5).uniform(80.0, 220.0, size=(frames, PAIRS))
