"""Drift of an untouched pad is followed; a touch is not, however long it is held; a step of gain is told from both.

All on the made-up pad with noise of reading (0.5 counts) and of light (0.2 %), at 12 frames a second: five times fewer
than the sensor has, so that ten minutes pass quickly and everything is harder by the noise of fewer frames.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.recordings import kept_share
from optopad.fabrication.driver.drift import DriftState, DriftTracker
from tests.fabrication.driver.made_up_pad import press_table

RATE_HZ = 12.0
TEN_MINUTES_S = 600.0
FLAT = np.minimum(press_table().untouched, 900.0)
NOWHERE = (16.0, 16.0, -5.0)
Gain = Callable[[float], np.ndarray | float]
Tip = Callable[[float], tuple[float, float, float]]


def still(_time_s: float) -> tuple[float, float, float]:
    return NOWHERE


def no_gain(_time_s: float) -> float:
    return 1.0


class Bench:
    """Frames of the made-up pad, and a tracker that follows them."""

    def __init__(self, tip: Tip = still, gain: Gain = no_gain, *, seed: int = 1, model: bool = True) -> None:
        self.rng = np.random.default_rng(seed)
        self.tip, self.gain, self.has_model = tip, gain, model
        start = np.array([self.frame(0.0) for _ in range(20)])
        self.tracker = DriftTracker(start, FLAT.ravel())
        self.states: list[DriftState] = []

    def light(self, time_s: float) -> np.ndarray:
        """(emitter, receiver) without noise."""
        return np.minimum(press_table().at(self.tip(time_s))[0], 900.0) * self.gain(time_s)

    def frame(self, time_s: float) -> np.ndarray:
        light = self.light(time_s) * (1 + 0.002 * self.rng.standard_normal((8, 1)))
        dark = 2.0 + 0.5 * self.rng.standard_normal(8)
        return np.round(light + 2.0 + 0.5 * self.rng.standard_normal((8, 8))) - np.round(dark)

    def run(self, until_s: float, from_s: float = 0.0) -> DriftState:
        """Follow frames; what a model would say is right from 0.2 mm on, wrong in one untouched frame of twenty."""
        for time_s in np.arange(from_s, until_s, 1 / RATE_HZ):
            depth = self.tip(time_s)[2]
            says_touch = depth > 0.2 or (depth <= 0 and self.rng.random() < 0.05)
            frame = self.frame(time_s).ravel()
            self.states.append(self.tracker.follow(time_s, frame, bool(says_touch and self.has_model)))
        return self.states[-1]

    def error(self, time_s: float) -> float:
        """Largest error of the followed levels over the true untouched ones, pairs above 40 counts [-]."""
        true = (FLAT * self.gain(time_s)).ravel()
        strong = true > 40
        return float(np.abs(self.tracker.untouched / true - 1)[strong].max())


def each_pair(seed: int) -> np.ndarray:
    """(emitter, receiver) ends of drift of 3 % up or down, pair by pair."""
    return 0.03 * np.random.default_rng(seed).choice([-1.0, 1.0], (8, 8))


@pytest.mark.parametrize(
    "ends",
    [pytest.param(0.03, marks=pytest.mark.slow), pytest.param(-0.03, marks=pytest.mark.slow), each_pair(3)],
    ids=["rising", "falling", "pair by pair"],
)
def test_a_drift_of_3_percent_in_ten_minutes_is_followed(ends: np.ndarray | float) -> None:
    bench = Bench(gain=lambda time_s: 1 + ends * time_s / TEN_MINUTES_S)
    state = bench.run(TEN_MINUTES_S)
    # It lags by (tau + guard) x rate = 10.5 s x 3 % / 600 s = 0.05 %; noise of 10 s of frames is 0.2 % x sqrt(1 / 400).
    assert bench.error(TEN_MINUTES_S) < 0.003
    assert state.drift == pytest.approx(
        0.0 if np.ndim(ends) else float(np.mean(ends)), abs=0.035 if np.ndim(ends) else 0.002
    )
    assert state.gain_steps == 0


@pytest.mark.parametrize(
    "model", [pytest.param(True, marks=pytest.mark.slow), False], ids=["model sees it", "model is blind"]
)
@pytest.mark.parametrize("depth_mm", [pytest.param(3.0, marks=pytest.mark.slow), 0.5])
def test_a_touch_that_is_held_for_ten_minutes_moves_nothing(depth_mm: float, model: bool) -> None:
    def tip(time_s: float) -> tuple[float, float, float]:
        return (12.0, 14.0, min(max(time_s - 5.0, -1.0), depth_mm))

    bench = Bench(tip, model=model)
    bench.run(5.0)
    before = bench.tracker.untouched.copy()
    state = bench.run(5.0 + TEN_MINUTES_S, 5.0)
    assert state.is_held
    assert state.gain_steps == 0
    held = np.abs(bench.tracker.untouched / before - 1)[FLAT.ravel() > 40]
    assert held.max() < 0.001  # half a second of the frames before the touch, of 10 s
    assert (state.held_without_touch_s > 590) is not model


@pytest.mark.slow
def test_the_features_of_a_held_touch_are_those_of_the_touch_and_not_of_its_drifting_away() -> None:
    bench = Bench(lambda time_s: (12.0, 14.0, 3.0 if time_s > 5 else -5.0))
    bench.run(TEN_MINUTES_S)
    light = bench.light(TEN_MINUTES_S).ravel()
    strong = FLAT.ravel() > 40
    assert np.abs(bench.tracker.features(light) / light - 1)[strong].max() < 0.003


@pytest.mark.slow
def test_drift_that_went_on_under_a_held_touch_is_taken_in_one_step_after_it() -> None:
    def gain(time_s: float) -> float:
        return 1 + 0.03 * min(time_s, TEN_MINUTES_S) / TEN_MINUTES_S

    bench = Bench(lambda time_s: (12.0, 14.0, 3.0 if 5 < time_s < TEN_MINUTES_S else -5.0), gain)
    bench.run(TEN_MINUTES_S)
    assert bench.error(TEN_MINUTES_S) > 0.025
    state = bench.run(TEN_MINUTES_S + 3.0, TEN_MINUTES_S)
    assert state.gain_steps == 1
    assert bench.error(TEN_MINUTES_S + 3.0) < 0.006  # noise of 0.2 s of frames


def one_part(emitter: int | None = None, receiver: int | None = None, change: float = -0.05) -> Gain:
    whole = np.ones((8, 8))
    if emitter is not None:
        whole[emitter] += change
    if receiver is not None:
        whole[:, receiver] += change
    return lambda time_s: whole if time_s > 10 else 1.0


@pytest.mark.parametrize(
    "gain",
    [
        one_part(emitter=2),
        one_part(receiver=5, change=0.1),
        one_part(emitter=1, receiver=6),
        lambda time_s: 0.95 if time_s > 10 else 1.0,
    ],
    ids=["an emitter dims", "a receiver gains", "both", "the supply sags"],
)
def test_a_step_of_gain_is_told_and_followed_within_two_seconds(gain: Gain) -> None:
    bench = Bench(gain=gain)
    bench.run(10.0)
    assert bench.tracker.gain_steps == 0
    bench.run(12.5, 10.0)
    assert bench.tracker.gain_steps == 1
    assert bench.error(12.5) < 0.01  # noise of 0.2 s of frames, and a product of two gains
    bench.run(60.0, 12.5)
    assert bench.error(60.0) < 0.003


def test_a_part_that_fails_is_reported_and_not_followed() -> None:
    bench = Bench(gain=one_part(emitter=3, change=-0.9))
    state = bench.run(20.0)
    assert state.is_gain_like
    assert state.gain_steps == 0


def test_a_layout_with_few_parts_tells_no_steps_of_gain() -> None:
    rng = np.random.default_rng(6)
    levels = rng.uniform(100, 400, (3, 3))
    tracker = DriftTracker(levels + 0.8 * rng.standard_normal((30, 3, 3)), levels.ravel())
    for time_s in np.arange(0.0, 10.0, 1 / 12):
        dim = levels * (0.9 if time_s > 3 else 1.0) + 0.8 * rng.standard_normal((3, 3))
        state = tracker.follow(float(time_s), dim.ravel(), time_s > 3)
    assert not state.is_gain_like
    assert state.gain_steps == 0
    assert state.is_held


def test_presses_all_over_the_pad_are_never_taken_for_gain() -> None:
    rng = np.random.default_rng(4)
    places = rng.uniform(6, 26, (40, 2))
    depths = rng.uniform(0.3, 5.0, 40)

    def tip(time_s: float) -> tuple[float, float, float]:
        k = min(int(time_s / 3.0), 39)
        return (*places[k], depths[k] if time_s % 3.0 > 0.5 else -5.0)

    bench = Bench(tip)
    state = bench.run(120.0)
    assert state.gain_steps == 0
    assert not any(state.is_gain_like for state in bench.states)
    assert bench.error(120.0) < 0.003


def test_an_untouched_pad_is_not_held_by_noise_nor_by_single_wrong_answers_of_the_model() -> None:
    bench = Bench()
    bench.run(120.0)
    # Where two of three frames, 0.2 s, are wrong at 5 % each, 0.7 % of the time, half a second is held.
    assert np.mean([state.is_held for state in bench.states]) < 0.05
    assert np.mean([state.excess for state in bench.states[100:]]) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(("rest", "is_held"), [(0.001, False), (0.004, True)])
def test_what_a_press_leaves_holds_a_quiet_board_only_while_it_is_as_large_as_a_touch(
    rest: float, is_held: bool
) -> None:
    """At 200 frames a second with noise of 0.1 %, both changes exceed the noise of 0.2 s by far."""
    rng = np.random.default_rng(2)
    frames = 300.0 + 0.3 * rng.standard_normal((600, 8, 8))
    tracker = DriftTracker(frames[:200], np.full(64, 300.0))
    left = 1.0 + rest * rng.choice([-1.0, 1.0], 64)
    states = [tracker.follow(k / 200.0, frame.ravel() * left, False) for k, frame in enumerate(frames[200:])]
    assert states[-1].excess > 4.0
    assert states[-1].is_held is is_held
    assert (states[-1].held_without_touch_s > 1.0) is is_held


def test_what_a_press_leaves_is_no_step_of_gain_and_moves_the_untouched_signals_little() -> None:
    """A residue of 4 % with a decay of 1 s, after a press that takes up to 80 % of a pair's signal."""
    released_s = 5.0
    pressed = np.minimum(press_table().at((12.0, 14.0, 5.0))[0], 900.0) / FLAT - 1.0

    def residue(time_s: float) -> np.ndarray | float:
        since_s = np.array(max(time_s - released_s, 0.0))
        kept = kept_share(since_s, residue=0.04, decay_s=1.0)
        return 1.0 + kept * pressed if time_s > released_s else 1.0

    bench = Bench(lambda time_s: (12.0, 14.0, 5.0 if 3.0 < time_s <= released_s else -5.0), residue)
    bench.run(released_s + 0.5)
    assert bench.states[-1].is_held
    state = bench.run(40.0, released_s + 0.5)
    assert not state.is_held
    assert state.gain_steps == 0
    assert not any(one.is_gain_like for one in bench.states)
    strong = FLAT > 40
    moved = np.abs(bench.tracker.untouched.reshape(FLAT.shape) / FLAT - 1.0)[strong].max()
    assert moved < 0.004  # the signals themselves were off by 3 %, and noise of 10 s of frames is 0.05 %


@pytest.mark.slow
def test_frames_that_come_late_and_in_bunches_do_not_hold_an_untouched_pad() -> None:
    bench = Bench()
    gaps_s = bench.rng.choice([0.01, 0.01, 0.01, 0.01, 0.12], 2000)
    for time_s in np.cumsum(gaps_s):
        bench.states.append(bench.tracker.follow(time_s, bench.frame(time_s).ravel(), False))
    assert not any(state.is_held for state in bench.states)
    assert np.mean([state.excess for state in bench.states]) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("guard_s", "rate_hz"),
    [
        pytest.param(0.0, 12.0, marks=pytest.mark.slow),
        pytest.param(0.02, 12.0, marks=pytest.mark.slow),
        (0.5, 1.0),
    ],
)
def test_drift_is_followed_with_a_guard_shorter_than_a_frame(
    guard_s: float, rate_hz: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.fabrication.driver.test_drift.RATE_HZ", rate_hz)
    bench = Bench(gain=lambda time_s: 1 + each_pair(3) * time_s / TEN_MINUTES_S)
    start = np.array([bench.frame(0.0) for _ in range(20)])
    bench.tracker = DriftTracker(start, FLAT.ravel(), guard_s=guard_s)
    bench.run(TEN_MINUTES_S)
    assert bench.error(TEN_MINUTES_S) < 0.003


def test_a_start_with_a_finger_on_the_pad_shows_in_its_mismatch() -> None:
    clean, pressed = Bench(), Bench(lambda _: (12.0, 14.0, 2.0))
    dimmer = Bench(gain=lambda _: np.linspace(0.7, 1.3, 8)[:, None] * np.linspace(1.2, 0.8, 8))
    assert clean.tracker.start_mismatch < 0.01
    assert dimmer.tracker.start_mismatch < 0.05  # gains of a build are none; products of two leave a little
    assert pressed.tracker.start_mismatch > 0.08


def test_a_board_that_began_anew_keeps_its_levels() -> None:
    bench = Bench()
    bench.run(30.0)
    before = bench.tracker.untouched.copy()
    for time_s in np.arange(30.0, 31.0, 0.1):
        bench.tracker.follow(time_s, bench.frame(time_s).ravel(), True)  # unplugged during a touch
    bench.tracker.restart()
    bench.run(1.0)
    assert not any(state.is_held for state in bench.states[-12:])
    assert np.abs(bench.tracker.untouched / before - 1)[FLAT.ravel() > 40].max() < 0.002


@pytest.mark.parametrize(
    ("start", "trained", "options", "told"),
    [
        (np.ones((4, 8, 8)), np.ones(64), {}, "needs at least 5 frames"),
        (np.ones((9, 8, 8)), np.ones(63), {}, "one level a pair"),
        (np.full((9, 8, 8), np.nan), np.ones(64), {}, "not all finite numbers"),
        (np.ones((9, 8, 8)), np.ones(64), {"time_constant_s": 0.0}, "time_constant_s 0,"),
        (np.ones((9, 8, 8)), np.ones(64), {"guard_s": -1.0}, "guard_s -1"),
    ],
)
def test_a_start_that_cannot_be_followed_is_refused(
    start: np.ndarray, trained: np.ndarray, options: dict[str, float], told: str
) -> None:
    with pytest.raises(InputError, match=told):
        DriftTracker(start, trained, **options)
