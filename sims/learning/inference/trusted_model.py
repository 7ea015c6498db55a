"""Common base of models that estimate their own deviations: first touch, then the press and its deviation."""

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
    """Base class of models that combine a touch classifier with an estimator of the press and its deviation.

    Attributes
    ----------
    header : description of the model and its training data
    touch : touch classifier
    scaling : scaling of the features of the press estimator
    sigma : factors from the estimator's raw deviation to the standard deviation, by depth
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
        """Estimated presses (n, 3) of frames (n, pair), and their raw deviations (n, 3) before scaling [mm]."""

    @abstractmethod
    def arrays(self) -> Arrays:
        """The model's arrays, by their names in its file."""
