"""The learners by name; each trains a model on data."""

from __future__ import annotations

from typing import Protocol

from optopad.design.progress import OnStep
from optopad.sims.learning.fits.extra_trees import fit_extra_trees
from optopad.sims.learning.fits.kernel_ridge import fit_kernel_ridge
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.settings import FitSettings
from optopad.sims.readings.dataset import PressData


class Learner(Protocol):
    """A function that trains a model."""

    def __call__(
        self, train: PressData, *, seed: int = ..., on_step: OnStep = ..., settings: FitSettings = ...
    ) -> TouchModel:
        """Train a model; raises `InputError` if the data are insufficient."""
        ...


LEARNERS: dict[str, Learner] = {"kernel-ridge": fit_kernel_ridge, "extra-trees": fit_extra_trees}
"""Training functions by name. The name is also stored as the trained model's `kind`."""
