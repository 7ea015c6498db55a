"""Common part of models that estimate their own deviations: touch first, then a press and its deviation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from design.arrays import FloatArray
from sims.learning.inference.feature_scaling import FeatureScaling
from sims.learning.inference.header import ModelHeader
from sims.learning.inference.prediction import Prediction
from sims.learning.inference.sigma_table import SigmaTable
from sims.learning.inference.touch_model import Arrays, checked_signals, prediction_of
from sims.learning.inference.touch_svm import TouchSvm


@dataclass(frozen=True, kw_only=True, eq=False)
class TrustedModel(ABC):
    """A touch classifier, an estimator of the press with a raw deviation, and the scale of that deviation.

    Attributes
    ----------
    header : description of the model and its training data
    touch : classifier of the first stage
    scaling : scaling of the press's features
    sigma : factors of the raw deviation
    """

    header: ModelHeader
    touch: TouchSvm
    scaling: FeatureScaling
    sigma: SigmaTable

    def predict(self, signals: FloatArray) -> Prediction:
        """Predictions for frames (n, pair) [counts]."""
        signals = checked_signals(self.header, signals)
        press_mm, spread_mm = self.press_and_spread_mm(signals)
        sigma_mm = self.sigma.sigma_mm(press_mm[:, 2], spread_mm)
        return prediction_of(self.header, self.touch.score(signals), press_mm, sigma_mm)

    @abstractmethod
    def press_and_spread_mm(self, signals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) press and (n, 3) raw deviation of frames (n, pair), before scaling [mm]."""

    @abstractmethod
    def arrays(self) -> Arrays:
        """The arrays in its file."""
