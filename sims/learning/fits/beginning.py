"""How every fit begins: the data checked, touch told; of a better learner also touched samples chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from design.progress import OnStep
from sims.learning.fits.touch import fit_tuned_touch
from sims.learning.inference.touch_svm import TouchSvm
from sims.learning.samples.press_samples import PressSamples, press_samples
from sims.learning.samples.settings import FitSettings
from sims.learning.samples.training_data import TrainingData, prepared
from sims.readings.dataset import PressData

FitTouch = Callable[[TrainingData, np.random.Generator, int], tuple[TouchSvm, dict[str, Any]]]


@dataclass(frozen=True, kw_only=True)
class ToldTouch:
    """What a fit goes on from once touch is told.

    Attributes
    ----------
    data : checked
    rng : of all further choices of the fit
    touch : the classifier, and `facts` of its fit for the header
    """

    data: TrainingData
    rng: np.random.Generator
    touch: TouchSvm
    facts: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Begun(ToldTouch):
    """The same, and touched `samples` with those that are held out to measure trust."""

    samples: PressSamples


def touch_told(
    train: PressData, fit_touch: FitTouch, *, seed: int, settings: FitSettings, on_step: OnStep
) -> ToldTouch:
    """Check the data and fit the classifier.

    Raises
    ------
    InputError : too little data, or data that tell nothing.
    """
    data, rng = prepared(train), np.random.default_rng(seed)
    on_step("touch", 0.0)
    touch, facts = fit_touch(data, rng, 4 * settings.fit_samples)
    on_step("touch", 1.0)
    return ToldTouch(data=data, rng=rng, touch=touch, facts=facts)


def begun(train: PressData, seed: int, settings: FitSettings, on_step: OnStep) -> Begun:
    """Begin the fit of a better learner; errors of `touch_told`."""
    told = touch_told(train, fit_tuned_touch, seed=seed, settings=settings, on_step=on_step)
    samples = press_samples(told.data, settings.network_samples, told.rng)
    return Begun(
        data=told.data,
        rng=told.rng,
        touch=told.touch,
        facts=told.facts | {"fit_samples": len(samples)},
        samples=samples,
    )
