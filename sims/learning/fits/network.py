"""Fit a small neural network that estimates (x, y, depth): scikit-learn's MLPRegressor, with weights stored as arrays.

Inputs are the readings, each pair standardised by its spread (at least the spread of the noise). Outputs are
standardised too. The loss is the squared error plus α |W|², minimised by Adam. Its step size is reduced in stages along
a cosine, as otherwise the last steps' noise would remain in the weights. The number of passes over the data is fixed,
because early stopping on held-out samples would test locations at which the network has seen other samples. Sources:
Rumelhart, Hinton and Williams, Nature 323 (1986); Kingma and Ba, Adam, ICLR 2015.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

from design.arrays import BoolArray, FloatArray
from design.progress import OnShare, OnStep
from sims.learning.fits.kernel_ridge import begun
from sims.learning.fits.touch import trust_of
from sims.learning.inference.network import Network, NetworkModel
from sims.learning.inference.sigma_table import UNIT_SIGMA
from sims.learning.samples import standard_scaling, trained_header
from sims.learning.settings import DEFAULT, FitSettings
from sims.readings.dataset import PressData

HIDDEN = (256, 128, 64)
WEIGHT_DECAY = 1e-2
BATCH = 200
FIRST_STEP = 2e-3
STAGES = 10
"""Number of stages in which Adam's step size is reduced."""


def fit_network(
    train: PressData,
    *,
    seed: int = 0,
    on_step: OnStep = lambda _stage, _share: None,
    settings: FitSettings = DEFAULT,
) -> NetworkModel:
    """Train the touch classifier and the network.

    Raises
    ------
    InputError : there are too few data or usable pairs, or the signals hardly vary.
    """
    start = begun(train, seed, settings, on_step)
    data, rng, samples = start.data, start.rng, start.samples
    scaling = standard_scaling(data.kept, samples.signals.astype(np.float32))
    mean_mm, scale_mm = samples.press_mm.mean(axis=0), samples.press_mm.std(axis=0)
    facts = start.facts | {
        "hidden": list(HIDDEN),
        "weight_decay": WEIGHT_DECAY,
        "epochs": settings.epochs,
    }

    def fitted(used: BoolArray, on_share: OnShare) -> Network:
        targets = (samples.press_mm[used] - mean_mm) / scale_mm
        features = scaling.features(samples.signals[used])
        return _network(features, targets, settings.epochs, int(rng.integers(2**31)), on_share)

    model = NetworkModel(
        header=trained_header("network", data, facts, seed),
        touch=start.touch,
        scaling=scaling,
        networks=(fitted(~samples.is_held_out, lambda share: on_step("fit", 0.45 * share)),),
        mean_mm=mean_mm,
        scale_mm=scale_mm,
        sigma=UNIT_SIGMA,
    )
    table, figures = trust_of(model, samples)
    final = fitted(np.ones(len(samples), np.bool_), lambda share: on_step("fit", 0.45 + 0.55 * share))
    header = trained_header("network", data, facts | figures, seed)
    return replace(model, header=header, networks=(final,), sigma=table)


def _network(features: FloatArray, targets: FloatArray, epochs: int, seed: int, on_share: OnShare) -> Network:
    """Train a network by `epochs` passes over the samples, and return its weights."""
    machine = MLPRegressor(
        hidden_layer_sizes=HIDDEN,
        alpha=WEIGHT_DECAY,
        batch_size=min(BATCH, len(features)),
        n_iter_no_change=epochs + 1,
        warm_start=True,
        random_state=seed,
    )
    stages = np.diff(np.round(np.linspace(0, epochs, min(STAGES, epochs) + 1)).astype(int))
    for number, passes in enumerate(stages):
        step = FIRST_STEP * 0.5 * (1.0 + np.cos(np.pi * number / len(stages)))
        machine.set_params(learning_rate_init=float(step), max_iter=int(passes))
        _fit(machine, features, targets)
        on_share((number + 1) / len(stages))
    return Network(
        weights=tuple(np.asarray(layer, np.float32) for layer in machine.coefs_),
        biases=tuple(np.asarray(layer, np.float32) for layer in machine.intercepts_),
        activation="relu",
    )


def _fit(machine: MLPRegressor, features: FloatArray, targets: FloatArray) -> None:
    """Run all passes of a stage; on Ctrl-C, raise `KeyboardInterrupt` instead of returning a half-trained network."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # the fixed number of passes is intended
        warnings.filterwarnings("error", "Training interrupted", UserWarning)
        try:
            machine.fit(features, targets)
        except UserWarning as err:
            raise KeyboardInterrupt from err
