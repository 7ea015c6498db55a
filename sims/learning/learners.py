"""The learners by name: each makes a model of training data."""

from __future__ import annotations

from typing import Protocol

from design.progress import OnStep
from sims.learning.fits.extra_trees import fit_extra_trees
from sims.learning.fits.kernel_ridge import fit_kernel_ridge
from sims.learning.fits.network import fit_network
from sims.learning.inference.touch_model import TouchModel
from sims.learning.settings import FitSettings
from sims.readings.dataset import PressData


class Learner(Protocol):
    """A function that makes a model."""

    def __call__(
        self, train: PressData, *, seed: int = ..., on_step: OnStep = ..., settings: FitSettings = ...
    ) -> TouchModel:
        """Train; raises InputError where the data are insufficient."""
        ...


LEARNERS: dict[str, Learner] = {
    "kernel-ridge": fit_kernel_ridge,
    "extra-trees": fit_extra_trees,
    "network": fit_network,
}
"""Fits by name, which is also the kind of the model."""
