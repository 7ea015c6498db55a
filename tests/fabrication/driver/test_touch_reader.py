"""Touches of a live sensor by a model: where the finger is, and nothing where it is not."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.simulated.finger import FingerPath
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver.touch_reader import Touch, TouchReader, require_fits
from optopad.screen.live_sensor import picture, touch_json
from optopad.sims.learning.inference.touch_model import Prediction, prediction_of
from tests.fabrication.driver.made_up_model import header, made_up_model
from tests.fabrication.driver.made_up_pad import board, pad_config

CONFIG = replace(pad_config(), board=replace(pad_config().board, boot_s=0.2))
PLACES = ((10.0, 22.0, 3.0), (20.0, 12.0, 1.5))
AWAY = (16.0, 16.0, -5.0)
FINGER = FingerPath(
    time_s=np.array([0.0, 1.0, 1.05, 1.5, 1.55, 1.95, 2.0, 2.5, 2.55, 1000.0]),
    press_mm=np.array([place for place in (AWAY, PLACES[0], AWAY, PLACES[1], AWAY) for _ in range(2)]),
)


@pytest.fixture(scope="module")
def touches() -> list[tuple[float, Touch]]:
    """Time by the board's clock [s], and what was read."""
    model = made_up_model()
    with FakePort(board(FINGER)) as port, Sensor(CONFIG, port.name, rate_hz=100.0, baseline_s=0.0) as sensor:
        reader = TouchReader(sensor, model, start_s=0.3)
        with pytest.raises(DeviceError, match="reader has"):
            _ = reader.tracker
        found = list(reader.touches(seconds=2.4))
        assert reader.tracker.start_mismatch < 0.02
        assert sensor.counts.lost == 0
        pictures = {touch.is_touched: picture(touch, reader) for touch in found}
        assert sum(row.count("E") for row in pictures[False]) == 8
        assert not any(mark in "".join(pictures[False]) for mark in "○◉●")
    return [(touch.frame.device_us / 1e6, touch) for touch in found]


def between(touches: list[tuple[float, Touch]], low_s: float, high_s: float) -> list[Touch]:
    return [touch for time_s, touch in touches if low_s < time_s < high_s]


def test_a_finger_is_found_where_it_presses(touches: list[tuple[float, Touch]]) -> None:
    for place, low_s, high_s in ((PLACES[0], 1.1, 1.45), (PLACES[1], 2.05, 2.45)):
        held = between(touches, low_s, high_s)
        assert len(held) > 20
        assert all(touch.is_touched for touch in held)
        middle = np.median([touch.press_mm for touch in held], axis=0)
        # The model's own error is 0.4 mm at most; noise lengthens all distances of the kernel by about as much again,
        # which draws the answer to the middle of the training presses.
        assert middle == pytest.approx(place, abs=0.9)
        force = np.median([touch.force_n for touch in held])
        assert force == pytest.approx(np.interp(middle[2], [0, 2.5, 5], [0, 4, 10]), abs=0.3)


def test_an_untouched_pad_is_told_as_untouched(touches: list[tuple[float, Touch]]) -> None:
    still = between(touches, 0.0, 0.95) + between(touches, 1.65, 1.9)
    assert not any(touch.is_touched for touch in still)
    assert all(touch.force_n == 0.0 for touch in still)


def test_a_frame_has_a_location_just_where_it_is_touched(touches: list[tuple[float, Touch]]) -> None:
    for name in ("press_mm", "point_mm", "normal"):
        has_location = [bool(np.isfinite(getattr(touch, name)).all()) for _, touch in touches]
        assert has_location == [touch.is_touched for _, touch in touches]
    untouched = [touch for _, touch in touches if not touch.is_touched]
    assert np.isnan([(one.press_mm, one.point_mm, one.normal, one.sigma_mm) for one in untouched]).all()


def test_an_answer_as_json_has_a_place_only_where_it_is_touched(touches: list[tuple[float, Touch]]) -> None:
    (held, *_), (still, *_) = between(touches, 1.3, 1.4), between(touches, 0.5, 0.9)
    document = touch_json(held)
    assert document["touched"]
    assert document["x_mm"] == pytest.approx(held.press_mm[0], abs=1e-3)
    assert document["sigma_mm"] == [None] * 3  # this model does not know
    assert document["force_n"] > 0
    empty = touch_json(still)
    assert [empty[name] for name in ("touched", "x_mm", "y_mm", "depth_mm", "sigma_mm", "force_n")] == [
        False,
        None,
        None,
        None,
        None,
        0.0,
    ]
    assert str(still) == f"untouched, score {still.touch_score:+.2f}"
    assert str(held).startswith("touched   x ")
    assert str(held.frame).startswith(f"frame {held.frame.sequence} at ")
    assert "\n" not in str(held.frame)


def test_uncertainty_is_told_where_the_model_knows_it(touches: list[tuple[float, Touch]]) -> None:
    (held, *_) = between(touches, 1.3, 1.4)
    press_mm, sigma_mm = np.array([10.0, 22.0, 3.0]), np.array([0.21, 0.18, 0.05])
    values = {"sigma_mm": sigma_mm, "press_mm": press_mm, "force_n": 5.2, "force_sigma_n": 0.12}
    known = replace(held, contacts=(replace(held.contacts[0], **values),), **values)
    assert "x 10.00 ± 0.21 mm, y 22.00 ± 0.18 mm, depth 3.00 ± 0.05 mm, force 5.20 ± 0.12 N, score " in str(
        known
    )
    assert touch_json(known)["sigma_mm"] == [0.21, 0.18, 0.05]


@pytest.mark.slow
def test_a_model_slower_than_the_frames_is_asked_for_many_at_once_and_keeps_up() -> None:
    asked: list[int] = []

    class Slow:
        """A model that takes 30 ms for as many frames as it is given."""

        header = made_up_model().header

        def predict(self, signals: np.ndarray) -> Prediction:
            asked.append(len(signals))
            time.sleep(0.03)
            return prediction_of(self.header, -np.ones(len(signals)), np.zeros((len(signals), 3)))

        def arrays(self) -> dict[str, np.ndarray]:
            return {}

    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=100.0, baseline_s=0.0) as sensor:
        found = list(TouchReader(sensor, Slow(), start_s=0.1).touches(seconds=1.0))
    assert len(found) == sum(asked) > 60
    assert np.diff([touch.frame.sequence for touch in found]).tolist() == [1] * (len(found) - 1)
    assert np.median(asked[5:]) >= 3  # 30 ms at 100 frames a second
    assert np.median([touch.latency_ms for touch in found]) < 100.0  # two rounds of 30 ms, and a busy machine


def test_the_force_s_uncertainty_is_the_depth_s_by_the_slope_of_its_curve() -> None:
    class Sure:
        """A model that finds everything 3 mm deep, to 0.1 mm."""

        header = made_up_model().header

        def predict(self, signals: np.ndarray) -> Prediction:
            press_mm, sigma_mm = np.array([[16.0, 16.0, 3.0]]), np.array([[0.2, 0.2, 0.1]])
            return prediction_of(self.header, np.array([1.0]), press_mm, sigma_mm)

        def arrays(self) -> dict[str, np.ndarray]:
            return {}

    with FakePort(board()) as port, Sensor(CONFIG, port.name, rate_hz=100.0, baseline_s=0.0) as sensor:
        (touch,) = TouchReader(sensor, Sure(), start_s=0.1).touches(count=1)
    # From 2.5 to 5 mm the curve rises from 4 to 10 N: 2.4 N a millimetre.
    assert touch.force_n == pytest.approx(5.2)
    assert touch.force_sigma_n == pytest.approx(0.24)


@pytest.mark.slow
def test_a_change_of_gain_is_no_touch() -> None:
    dim, model = board(), made_up_model()
    with FakePort(dim) as port, Sensor(CONFIG, port.name, rate_hz=100.0, baseline_s=0.0) as sensor:
        reader = TouchReader(sensor, model, start_s=0.3)
        list(reader.touches(count=30))
        table = dim._table
        dim._table = replace(table, counts=table.counts * np.linspace(0.9, 1.0, 8)[:, None])
        found = list(reader.touches(seconds=2.0))
        assert reader.tracker.gain_steps == 1
    late = found[-60:]
    assert not any(touch.is_touched for touch in late)
    assert (
        np.mean([touch.is_touched for touch in found]) < 0.1
    )  # until the change is seen as one of gain, 0.1 s
    assert any("change of gain" in str(touch) for touch in found)


def test_a_sensor_that_is_opened_again_is_followed_from_its_new_clock_on() -> None:
    """The number of the connection is 1 again, and the board's clock begins at 0."""
    with FakePort(board()) as port:
        sensor = Sensor(CONFIG, port.name, rate_hz=200.0, baseline_s=0.0)
        reader = TouchReader(sensor, made_up_model(), start_s=0.1)
        with sensor:
            first = reader.read().frame
            reader.tracker.follow(1e3, first.signals.ravel().astype(float), True)  # a late touch
            reader._last = replace(first, device_us=10**9)
        with sensor:
            (touch,) = reader.touches(count=1)
    assert touch.frame.connection == first.connection
    assert not touch.drift.is_held


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"design_digest": "cd" * 32}, "cdcdcdcd, the sensor's"),
        ({"emitter_names": tuple(f"L{k}" for k in range(8))}, "its emitters are L0, .* the sensor's E1, E2"),
        (
            {"receiver_names": ("R1",), "untouched_counts": np.ones(8)},
            "its receivers are R1, the sensor's R1, R2",
        ),
    ],
)
def test_a_model_of_another_sensor_is_refused(changes: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        require_fits(header(**changes), Sensor(CONFIG, "loop://").descriptor)


def test_a_model_that_names_no_design_is_taken() -> None:
    require_fits(header(design_digest=None), Sensor(CONFIG, "loop://").descriptor)


def test_the_untouched_levels_are_held_during_a_touch(touches: list[tuple[float, Touch]]) -> None:
    assert all(touch.drift.is_held for touch in between(touches, 1.25, 1.45))
    assert not any(touch.drift.is_held for touch in between(touches, 0.7, 0.95))
