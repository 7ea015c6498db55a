"""Slips are found; presses that go deeper, releases, gain steps and drift are none."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.fabrication.driver.slip import (
    FEWEST_FRAMES,
    HOLD_S,
    LONG_WINDOW_S,
    WINDOW_S,
    SlipDetector,
    movement,
)
from optopad.sims.learning.inference.signal_map import SignalMapModel, whitening
from tests.fabrication.driver.made_up_model import made_up_model
from tests.sims.learning.test_signal_map_model import made_up_map_model

HELD = np.array([14.0, 17.0, 1.5])
RATES_HZ = (60.0, 450.0, 1000.0)
NOISE_COUNTS = 0.7
PREDICTED_MM = 0.05
"""Deviation of the model's predictions, at which slopes are taken."""


class Touched:
    """A touch of the made-up pad that is held for a time, and the detector that follows it."""

    def __init__(self, rate_hz: float, seed: int = 0, held_s: float = 0.2) -> None:
        self.model: SignalMapModel = made_up_map_model()
        self.rng, self.rate_hz, self.time_s = np.random.default_rng(seed), rate_hz, 0.0
        start = self.noisy(np.array([[*HELD[:2], 0.0]] * 40))
        self.detector = SlipDetector(self.model, start)
        assert not self.slips(np.tile(HELD, (int(held_s * rate_hz), 1)))

    def noisy(self, press_mm: np.ndarray) -> np.ndarray:
        signals = self.model.signals(press_mm)
        return np.asarray(signals + NOISE_COUNTS * self.rng.standard_normal(signals.shape))

    def slips(self, press_mm: np.ndarray, factor: float | np.ndarray = 1.0) -> list[tuple[int, np.ndarray]]:
        """Numbers and speeds of the frames in which the touch slips."""
        signals = self.noisy(press_mm) * factor
        near = press_mm + PREDICTED_MM * self.rng.standard_normal(press_mm.shape)
        slopes = self.model.answers(near)[1]  # predictions themselves would take most of the time
        found = []
        for k in range(len(signals)):
            self.time_s += 1.0 / self.rate_hz
            slip = self.detector.follow(self.time_s, signals[k], slopes[k])
            assert slip.is_slipping or not slip.slip_mm_s.any()
            if slip.is_slipping:
                found.append((k, slip.slip_mm_s))
        return found

    def moved(self, velocity_mm_s: tuple[float, float, float], seconds: float) -> np.ndarray:
        """Presses of a movement from the held one at a constant velocity."""
        time_s = np.arange(1, int(seconds * self.rate_hz) + 1) / self.rate_hz
        return np.asarray(HELD + time_s[:, None] * np.array(velocity_mm_s))


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_slide_is_found_with_its_velocity(rate_hz: float) -> None:
    touched = Touched(rate_hz)
    slips = touched.slips(touched.moved((12.0, -16.0, 0.0), 0.1))
    assert slips[0][0] / rate_hz < WINDOW_S
    assert slips[-1][1] == pytest.approx(
        (12.0, -16.0), abs=3.0
    )  # slopes of the map, at presses that it predicts


@pytest.mark.parametrize("rate_hz", [5.0, 15.0])
def test_few_frames_a_second_are_enough(rate_hz: float) -> None:
    touched = Touched(rate_hz, held_s=2.0)
    slips = touched.slips(touched.moved((6.0, 0.0, 0.0), 1.0))
    assert slips[0][0] < FEWEST_FRAMES
    assert [k for k, _ in slips] == list(range(slips[0][0], int(rate_hz)))


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_slide_that_grows_out_of_a_slow_drag_is_found(rate_hz: float) -> None:
    touched = Touched(rate_hz)
    time_s = np.arange(1, int(0.5 * rate_hz)) / rate_hz
    slips = touched.slips(HELD + 5.0 * time_s[:, None] ** 2 * np.array([0.6, -0.8, 0.0]))  # 10 mm/s²
    first = time_s[slips[0][0]]
    assert 0.1 < first < 0.35
    assert len(slips) == len(time_s) - slips[0][0]


def test_a_slip_lasts_a_little_longer_than_its_last_frame() -> None:
    touched = Touched(450.0)
    assert touched.slips(touched.moved((20.0, 0.0, 0.0), 0.05))
    kept = touched.slips(np.tile(HELD + np.array([1.0, 0.0, 0.0]), (90, 1)))
    assert [k for k, _ in kept] == list(range(len(kept)))
    assert HOLD_S < len(kept) / 450.0 < HOLD_S + LONG_WINDOW_S


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_press_that_goes_deeper_or_is_released_is_no_slip(rate_hz: float) -> None:
    for speed in (3.0, 20.0, -3.0, -20.0):
        touched = Touched(rate_hz)
        assert not touched.slips(touched.moved((0.0, 0.0, speed), 0.5 / abs(speed)))


def test_a_step_of_gain_and_drift_are_no_slip() -> None:
    touched = Touched(450.0)
    still = np.tile(HELD, (100, 1))
    assert not touched.slips(still, np.linspace(1.0, 1.02, 100)[:, None])
    gains = np.ones((8, 8))
    gains[2] *= 1.03
    assert not touched.slips(still, 1.02 * gains.ravel())


def test_a_movement_that_begins_as_a_press_is_no_slip_until_the_touch_is_still_again() -> None:
    touched = Touched(450.0)
    deeper = touched.moved((0.0, 0.0, 10.0), 0.1)
    sideways = deeper[-1] + np.arange(1, 30)[:, None] * np.array([20.0, 0.0, 0.0]) / 450.0
    assert not touched.slips(np.concatenate([deeper, sideways]))
    assert not touched.slips(np.tile(sideways[-1], (40, 1)))
    assert touched.slips(sideways[-1] + np.arange(1, 20)[:, None] * np.array([0.0, 20.0, 0.0]) / 450.0)


def test_a_new_touch_and_one_after_a_gap_begin_anew() -> None:
    touched = Touched(450.0)
    touched.detector.forget()
    assert not touched.slips(touched.moved((30.0, 0.0, 0.0), 0.9 * WINDOW_S))
    touched.time_s += 1.0
    assert not touched.slips(touched.moved((30.0, 0.0, 0.0), 0.9 * WINDOW_S))


def test_slopes_are_those_at_the_predicted_press() -> None:
    touched = Touched(60.0)
    signals = touched.noisy(np.array([HELD]))
    found = touched.model.predict(signals)
    seen, slopes = touched.detector.seen(signals, found.press_mm)
    assert (seen == signals).all()
    assert (slopes == touched.model.answers(found.press_mm)[1]).all()


def test_a_model_without_slopes_finds_slides_from_its_locations() -> None:
    detector, rng = SlipDetector(made_up_model(), np.zeros((5, 64))), np.random.default_rng(3)
    time_s = np.arange(400) / 450.0
    press = HELD + np.maximum(time_s[:, None] - 0.6, 0.0) * np.array([20.0, 0.0, 0.0])
    press += 0.03 * rng.standard_normal(press.shape)
    found = [detector.follow(t, one, np.eye(3)).is_slipping for t, one in zip(time_s, press, strict=True)]
    assert 0.0 < time_s[np.argmax(found)] - 0.6 < 0.03


def test_movement_is_least_squares_with_the_depth_unknown() -> None:
    rng = np.random.default_rng(4)
    slopes, rate, weight = rng.standard_normal((3, 9)), rng.standard_normal(9), rng.uniform(1.0, 2.0, 9)
    found = movement(rate, slopes, whitening(weight[None], np.zeros((1, 1, 9))))
    root = np.sqrt(weight)
    full, rest, *_ = np.linalg.lstsq((slopes * root).T, rate * root)
    _, rest_of_depth, *_ = np.linalg.lstsq((slopes[2:] * root).T, rate * root)
    assert found.speed_mm_s == pytest.approx(full, rel=1e-6)
    assert found.sideways == pytest.approx(float(rest_of_depth[0] - rest[0]))
    assert found.whole == pytest.approx(float((weight * rate**2).sum()))
