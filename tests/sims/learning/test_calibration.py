"""Calibration on a made-up light model with known parameters; what the data leave open."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.learning.calibration import Fitted, fitted, undetermined
from optopad.sims.learning.calibration_problem import Light, Unknown, calibration_samples
from tests.sims.learning.made_up_map import (
    COUNT,
    PAIRS,
    made_up_noise,
    ratios,
    untouched_counts,
)
from tests.sims.learning.made_up_presses import made_up_data

TRUE = np.array([0.8, -0.5])


def light(values: np.ndarray, press_mm: np.ndarray, half: int = 0) -> np.ndarray:
    """First parameter: how deep a press counts; second: how bright far pairs are; third: nothing."""
    stretched = press_mm * [1.0, 1.0, 1.0 + 0.15 * values[0]]
    far = np.linspace(-1.0, 1.0, PAIRS) ** 2
    return ratios(stretched) * untouched_counts() * (1.0 + 0.1 * values[1] * far) * 1e-5


def rough_light(values: np.ndarray, press_mm: np.ndarray, half: int = 0) -> np.ndarray:
    """As `light`, with errors of 0.1 % that a step of the third parameter changes, as an adaptive trace's."""
    exact = light(values, press_mm, half)
    rng = np.random.default_rng([half, *np.round(1e6 * (values[2:3] + 10.0)).astype(int), len(press_mm)])
    return exact * (1.0 + 0.001 * rng.normal(size=exact.shape))


def valley_light(values: np.ndarray, press_mm: np.ndarray, half: int = 0) -> np.ndarray:
    """As `light`, by a curved function of the difference of the last two parameters: their sum is not shown."""
    difference = values[1] - values[2]
    return light(np.array([values[0], difference + 0.3 * difference**2]), press_mm, half)


def calibrated(
    presses: int = 30, seed: int = 1, names: int = 2, start: float = 0.0, model: Light = light
) -> tuple[Fitted, np.ndarray]:
    zero_mm = np.random.default_rng(seed).normal(0.02, 0.03, size=presses)
    data, gains = made_up_data(lambda at: light(TRUE, at), presses, seed, zero_mm)
    samples = calibration_samples(data, 5.0)
    found = fitted(
        model,
        samples,
        made_up_noise(emitter_drift=0.0, receiver_drift=0.0, relative=0.003),
        start=np.full(names, start),
        low=np.full(names, -2.0),
        high=np.full(names, 2.0),
        stage_mm=np.array([0.01, 0.01, 0.05]),
    )
    return found, gains


@pytest.mark.slow
def test_parameters_gains_and_reference_depths_are_found_together():
    found, gains = calibrated()
    deviations = np.sqrt(np.diag(found.covariance))
    assert (np.abs(found.values - TRUE) < 4 * deviations).all()
    assert (deviations < 0.2).all()
    # what all gains share is one with the light's scale; their pattern is not
    ratio = found.gains / gains
    assert np.abs(ratio / ratio.mean() - 1.0).max() < 0.02  # the model error's share of 0.4 %, five of that
    assert found.rms[1] < 0.8 * found.rms[0]


@pytest.mark.slow
def test_the_covariance_tells_the_errors_of_many_builds():
    deviations = []
    for seed in range(12):
        found, _ = calibrated(presses=12, seed=seed)
        deviations.append((found.values - TRUE) / np.sqrt(np.diag(found.covariance)))
    # 24 numbers: their mean square is known to 29 %; the model error, which this light has not, makes it smaller
    assert 0.1 < np.mean(np.square(deviations)) < 2.0


def test_what_the_light_does_not_show_keeps_its_doubt():
    found, _ = calibrated(names=3)
    assert found.values[2] == pytest.approx(0.0, abs=1e-6)
    assert found.covariance[2, 2] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 4))])
def test_what_only_noise_shows_goes_to_the_middle_of_its_doubt(seed: int):
    found, _ = calibrated(names=3, seed=seed, start=-1.7, model=rough_light)
    # by the noise alone it went to an end of its doubt
    assert abs(found.values[2]) < 0.5
    assert found.covariance[2, 2] > 0.5


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 3))])
def test_the_light_s_curvature_does_not_pass_for_information(seed: int):
    """Slopes by differences to one side do not cancel along a valley: their sum is the curvature."""
    found, _ = calibrated(names=3, seed=seed, model=valley_light)
    along = np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)
    assert along @ found.covariance @ along == pytest.approx(1.0, abs=1e-3)
    assert along @ found.values == pytest.approx(0.0, abs=0.05)
    across = np.array([0.0, 1.0, -1.0])
    true = (np.sqrt(1.0 + 4.0 * 0.3 * TRUE[1]) - 1.0) / (2.0 * 0.3)
    assert abs(across @ found.values - true) < 4.0 * np.sqrt(across @ found.covariance @ across)


def unknown(path: str, unit: str = "mm") -> Unknown:
    return Unknown(path=path, unit=unit, value=5.0, low=4.7, high=5.3, spread=0.17)


def test_a_combination_that_is_left_open_is_said_in_words():
    names = (
        unknown("emitters.height_mm"),
        unknown("receivers.height_mm"),
        unknown("cavity.clear_thickness_mm"),
    )
    together = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    covariance = 0.01 * np.eye(3) + 0.6 * np.outer(together, together)
    (said,) = undetermined(names, covariance)
    assert "emitter height" in said
    assert "receiver height" in said
    assert "more" in said
    assert "less" in said
    assert "78 %" in said
    assert undetermined(names, 0.01 * np.eye(3)) == ()


def test_the_samples_are_of_the_way_in_and_spread_over_depth():
    data, _ = made_up_data(lambda at: light(TRUE, at), 30, 2, np.zeros(30))
    samples = calibration_samples(data, 5.0)
    assert samples.presses == 30
    assert len(samples.press_mm) == 30 * (95 // 30)
    for press in range(30):
        depths = samples.press_mm[samples.press == press, 2]
        assert (np.diff(depths) > 0.5).all()
    assert samples.untouched.mean_counts.shape == (COUNT * COUNT,)


def test_too_few_presses_are_refused():
    from optopad.design.errors import InputError

    data, _ = made_up_data(lambda at: light(TRUE, at), 3, 2, np.zeros(3))
    with pytest.raises(InputError, match="3 presses"):
        calibration_samples(data, 5.0)


def test_too_few_untouched_frames_are_refused():
    from optopad.design.errors import InputError

    data, _ = made_up_data(lambda at: light(TRUE, at), 6, 2, np.zeros(6))
    with pytest.raises(InputError, match="clear of the pad"):
        calibration_samples(data.only(data.press_mm[:, 2] > 0.0), 5.0)
