"""How every fit of a better learner begins: the data checked, touch told, touched samples chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sims.dataset import PressData
from sims.learning.inference.touch_svm import TouchSvm
from sims.learning.press_samples import PressSamples, press_samples
from sims.learning.settings import FitSettings
from sims.learning.touch_fit import fit_tuned_touch
from sims.learning.training_data import TrainingData, prepared

OnStep = Callable[[str, float], None]


@dataclass(frozen=True, kw_only=True)
class Begun:
    """What a fit goes on from.

    Attributes
    ----------
    data : checked
    rng : of all further choices of the fit
    touch : the classifier, and `facts` of its fit for the header
    samples : touched ones, with those that are held out to measure trust
    """

    data: TrainingData
    rng: np.random.Generator
    touch: TouchSvm
    facts: dict[str, Any]
    samples: PressSamples


def begun(train: PressData, seed: int, settings: FitSettings, on_step: OnStep) -> Begun:
    """Begin a fit.

    Raises
    ------
    InputError : too little data, or data that tell nothing.
    """
    data, rng = prepared(train), np.random.default_rng(seed)
    on_step("touch", 0.0)
    touch, facts = fit_tuned_touch(data, rng, 4 * settings.fit_samples)
    on_step("touch", 1.0)
    samples = press_samples(data, settings.network_samples, rng)
    return Begun(
        data=data, rng=rng, touch=touch, facts=facts | {"fit_samples": len(samples)}, samples=samples
    )
