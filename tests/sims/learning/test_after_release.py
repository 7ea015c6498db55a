"""How soon a model finds a touch again: the closed form for one that takes a change of brightness for a touch."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from optopad.sims.learning.after_release import LEAST_SHARE, STEPS, found_again
from optopad.sims.learning.inference.touch_model import Prediction, prediction_of
from tests.sims.learning.made_up_models import made_up_header
from tests.sims.readings.test_protocol_data import PROTOCOL, made_up_light, quiet

CURVES = made_up_light(quiet(release_residue=0.05, release_decay_s=2.0))
X_MM = CURVES.curves.places_mm[CURVES.place_of[1], 0]
"""The made-up light falls as exp(-depth x / 30) at the test locations."""


@dataclass
class Dimmer:
    """Takes a frame for touched that is darker than the untouched one by more than a share."""

    share: float
    header = made_up_header()

    def predict(self, signals: FloatArray) -> Prediction:
        untouched = (CURVES.curves.untouched * CURVES.readout.gains).ravel()
        return prediction_of(
            self.header, 1.0 - self.share - (signals / untouched).mean(axis=1), np.zeros((len(signals), 3))
        )

    def arrays(self) -> dict[str, np.ndarray]:
        return {}


def test_the_time_is_that_at_which_the_residue_is_below_the_models_threshold() -> None:
    found = found_again(CURVES, Dimmer(0.002), learner="dimmer")
    bearable = 0.002 / (1.0 - np.exp(-PROTOCOL.deepest_mm * X_MM.max() / 30.0))
    assert (found.rested_alarms, found.rested_found) == (0.0, 1.0)
    assert found.share is not None
    assert bearable * LEAST_SHARE ** (0.5**STEPS) <= found.share <= bearable * 1.001
    assert found.after_s == pytest.approx(2.0 * (0.05 / found.share - 1.0))
    assert found.low_s == pytest.approx(0.7 * (0.01 / found.share - 1.0))
    assert found.high_s == pytest.approx(1.4 * (0.07 / found.share - 1.0))
    assert (
        f"is found as often as on a rested pad, in 100 % of the frames, after {found.after_s:.1f} s"
        in str(found)
    )


def test_a_measured_residue_has_no_band_and_a_model_with_false_alarms_no_time() -> None:
    design = CURVES.design.with_(measured=["noise.release_residue"])
    measured = found_again(replace(CURVES, design=design), Dimmer(0.002), learner="dimmer")
    assert measured.after_s is not None
    assert (measured.low_s, measured.high_s) == (None, None)
    wrong = found_again(CURVES, Dimmer(-0.1), learner="dimmer")
    assert (wrong.rested_alarms, wrong.share, wrong.after_s) == (1.0, None, None)
    assert "not distinguished from the residue: more than 5 % of the untouched frames of a rested pad" in str(
        wrong
    )
