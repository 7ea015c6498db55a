"""Tracks slow drift of the untouched pad's signals, and stops tracking during a touch.

Each pair has a signal y, a tracked signal b of the untouched pad, and an untouched signal u in the training data
[counts]. The drift-corrected signal f is the input of a model:

    f = y u / b                      (f = y where u or b is below 4 counts, too small to divide by)

While the pad is untouched, b follows the signal of `guard_s` earlier with the time constant tau,

    db/dt = (y(t - guard) - b) / tau.

While the pad is touched, and for `guard_s` before and after, b is held constant. Frames therefore wait for `guard_s`
before they are tracked, and are discarded if a touch begins. The pad counts as touched if either

- the model reports a touch in more than half of the last 0.2 s (single wrong frames have no effect), or
- the excess is above 4. The change c = y / b - 1, averaged over 0.2 s, is split into gains of emitters and receivers
  and a rest (`gain_pattern`). The excess is the mean square of the rest, divided by the mean square of noise alone. A
  press shades pairs individually, so most of its change is in the rest. A rest below 0.2 % does not count, because it
  is less than that of a touch, and a silicone keeps as much of a press for many seconds.

A change is gain-like if gains explain 95 % or more of it, and if it exceeds 0.5 % and five times its noise. A change
that is gain-like for 1 s is a gain step: a part was plugged in, warmed up or lost its supply, or drift continued during
a touch that has ended. The step is counted and reported, and b is adjusted to it, even while the model reports a touch.
A change of a part's gain by more than half is reported but not tracked. Gain steps are not detected in layouts with
fewer than 16 degrees of freedom beyond the gains (3 x 3 parts have 4).

The tracker has five limitations.

- If the pad is touched at the start, that contact is mistaken for the untouched pad; `start_mismatch` indicates this.
- A contact is tracked as drift if it grows so slowly that the excess stays below the threshold within tau.
- A touch that changes all pairs of a part by one factor, such as a finger directly in front of the part, may count as
  a change of gain.
- Drift during a long touch is not tracked, so the predicted position is wrong until the touch ends.
- What a silicone keeps of a press counts as a touch while its rest is above 0.2 %. What is left then is tracked as
  drift (docs/validation/memory.md has the times and the error).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.gain_pattern import GainPattern, relative_change
from optopad.fabrication.driver.link.frames import WEAKEST_BASELINE_COUNTS

TIME_CONSTANT_S, GUARD_S = 10.0, 0.5
SHORT_S = 0.2
"""Time constant with which changes of signals are averaged to detect a touch [s]."""

HELD_EXCESS = 4.0
"""Threshold of the excess above which the pad counts as touched [-].

The excess is the mean square of the rest of the signals' change, which gains do not explain, divided by the noise
variance. Noise alone gives about 1."""

LEAST_REST = 0.002
"""Smallest rest in every pair that may count as a touch [-]; a touch of 0.1 mm has about 0.5 %. The noise of a board
with 1,000 frames a second is far below, and would hold the untouched signals for a minute after a press."""

GAIN_S = 1.0
GAIN_SHARE = 0.95
LEAST_GAIN, GAIN_SIGMAS = 0.005, 5.0
LEAST_FREEDOM = 16
"""Gain steps are detected only if there are at least this many more pairs than fitted gains; with fewer, a press
resembles a change of gains."""

LONGEST_STEP = 0.5
"""Largest time step used when a frame after a pause updates the untouched signals [time constants]. A larger step would
give too much weight to the noise of that frame."""

LARGEST_GAIN = 0.5
"""Largest relative change of a part's gain that is tracked [-]. A part that changes more is considered broken and is
reported."""

LEAST_NOISE_COUNTS = 0.3
"""Smallest standard deviation that is assumed for a signal, because readings are rounded [counts]."""

LEAST_START_FRAMES = 5


@dataclass(frozen=True, kw_only=True)
class DriftState:
    """The drift tracker's result for one frame.

    Attributes
    ----------
    is_held : whether tracking is stopped, so that the untouched signals stay constant
    excess : mean square of the rest of the signals' change, which gains do not explain, over the noise variance [-].
        The variance is that of the average plus that of the untouched signals
    drift : relative change of the untouched signal since the start, median over the pairs [-]
    is_gain_like : whether the signals' present change exceeds the noise and is explained by changed gains of parts
    gain_steps : number of sudden changes of gains so far
    held_without_touch_s : time for which the rest has been large enough for a touch although the model saw none [s]
    """

    is_held: bool
    excess: float
    drift: float
    is_gain_like: bool
    gain_steps: int
    held_without_touch_s: float


class DriftTracker:
    """Tracks the untouched signals of all pairs, which are the signals that they would have without contact.

    Parameters
    ----------
    start : signals of the untouched pad, shape (n, emitters, receivers), at least 5 frames [counts]
    trained : untouched signals of the training data, shape (pairs,), in the order of a flattened array of shape
        (emitters, receivers) [counts]
    time_constant_s : time constant of tracking [s]
    guard_s : time before and after a touch during which nothing is tracked [s]
    full_scale : largest possible signal; pairs near it are not used [counts]

    Attributes
    ----------
    untouched : tracked untouched signals, shape (pairs,) [counts]
    gain_steps : number of sudden changes of the parts' gains so far
    start_mismatch : relative deviation of `start` from `trained` that gains do not explain, root mean square over the
        pairs [-]; a large value indicates that the pad was touched

    Raises
    ------
    InputError : shapes do not match, numbers are not finite, or times are invalid.
    """

    def __init__(
        self,
        start: FloatArray,
        trained: FloatArray,
        *,
        time_constant_s: float = TIME_CONSTANT_S,
        guard_s: float = GUARD_S,
        full_scale: float = np.inf,
    ) -> None:
        _require(start, trained, time_constant_s, guard_s)
        self._shape = start.shape[1:]
        self._full_scale = full_scale
        self._tau_s, self._guard_s = time_constant_s, guard_s
        self._trained = np.asarray(trained, dtype=np.float64)
        self._noise = np.maximum(start.std(axis=0, ddof=1), LEAST_NOISE_COUNTS)
        self.untouched: FloatArray = start.mean(axis=0).ravel()
        self._first = self.untouched.copy()
        self._level_noise = 1.0 / len(start)
        """Variance of the untouched signals, relative to the variance of one frame's signals [-]."""
        self._calibrate(start.reshape(len(start), -1))
        self.start_mismatch = self._mismatch()
        self.gain_steps = 0
        self._waiting: deque[tuple[float, float, FloatArray]] = deque()
        """Frames waiting for the guard time to pass: time [s], interval since the previous frame [s], and signals of
        all pairs [counts]."""
        self._short = np.zeros(self.untouched.size)
        self._short_noise = 0.0
        """Variance of the averaged change of signals, relative to the variance of one frame's signals [-]."""
        self._touched_share = 0.0
        self._time_s: float | None = None
        self._held_s = -math.inf
        self._gain_since_s: float | None = None
        self._odd_since_s: float | None = None

    def features(self, signals: FloatArray) -> FloatArray:
        """Input of a model: the given signals with drift removed, both of shape (n, pairs) [counts]."""
        found: FloatArray = signals * self._factor
        return found

    def follow(self, time_s: float, signals: FloatArray, is_touched: bool) -> DriftState:
        """Update the untouched signals with one frame, unless the pad is touched.

        Parameters
        ----------
        time_s : time of the frame by a clock that never goes back, such as the board's [s]
        signals : readings minus those in the dark state, shape (pairs,) [counts]
        is_touched : whether the model reports a touch in this frame
        """
        passed_s = 0.0 if self._time_s is None else max(time_s - self._time_s, 0.0)
        weight = -math.expm1(-passed_s / SHORT_S)
        self._time_s = time_s
        self._touched_share += weight * (float(is_touched) - self._touched_share)
        self._short += weight * (relative_change(signals, self.untouched) - self._short)
        self._short_noise = (1.0 - weight) ** 2 * self._short_noise + weight**2
        square = float(self._pattern.excess(self._short))
        excess = square / (self._quiet * (self._short_noise + self._level_noise))
        is_gain_like = self._is_gain_like()
        self._gain_since_s = _since(self._gain_since_s, time_s, is_gain_like)
        is_touch = self._touched_share > 0.5
        is_local = excess > HELD_EXCESS and square > self._least
        if self._gain_since_s is not None and time_s - self._gain_since_s >= GAIN_S and self._is_small_gain():
            self._take_gain()
        elif is_touch or is_local:
            self._held_s = time_s
            self._waiting.clear()
        elif time_s - self._held_s >= self._guard_s:
            self._waiting.append((time_s, passed_s, signals))
            self._follow_waiting(time_s)
        self._odd_since_s = _since(self._odd_since_s, time_s, is_local and not is_touch)
        return DriftState(
            is_held=time_s - self._held_s < self._guard_s,
            excess=excess,
            drift=self._drift(),
            is_gain_like=is_gain_like,
            gain_steps=self.gain_steps,
            held_without_touch_s=0.0 if self._odd_since_s is None else time_s - self._odd_since_s,
        )

    def restart(self) -> None:
        """Continue after a reset of the board, when its clock starts from 0 again; the untouched signals are kept."""
        self._time_s = None
        self._held_s = -math.inf
        self._gain_since_s = self._odd_since_s = None
        self._touched_share = 0.0
        self._waiting.clear()
        self._forget_short()

    def _calibrate(self, start: FloatArray) -> None:
        self._set_pattern()
        rest = self._pattern.rest(relative_change(start, self.untouched))
        freedom = max(self._pattern.freedom, 1) * (1.0 - 1.0 / len(start))
        self._quiet = max(float((rest**2).sum(axis=1).mean()) / freedom, 1e-6)

    def _set_pattern(self) -> None:
        level = self.untouched.reshape(self._shape)
        self._pattern = GainPattern(level, self._noise, 0.98 * self._full_scale)
        self._strong = (self.untouched >= WEAKEST_BASELINE_COUNTS) & (
            self._trained >= WEAKEST_BASELINE_COUNTS
        )
        shares = LEAST_REST / self._pattern.sigma[self._pattern.used]
        self._least = float(shares @ shares) / max(self._pattern.freedom, 1)
        """Mean square of a rest of `LEAST_REST` in every pair, over the variance of one frame [-]."""
        self._factor = np.ones(self._strong.size)
        np.divide(self._trained, self.untouched, out=self._factor, where=self._strong)

    def _mismatch(self) -> float:
        pattern = GainPattern(self._trained.reshape(self._shape), self._noise, 0.98 * self._full_scale)
        rest = pattern.rest(relative_change(self.untouched, self._trained)) * pattern.sigma
        used = rest[pattern.used]
        return float(np.sqrt((used**2).mean())) if used.size else 0.0

    def _is_gain_like(self) -> bool:
        if self._pattern.freedom < LEAST_FREEDOM:
            return False
        gains = self._pattern.gain_change(self._short)
        used, sigma = self._pattern.used, self._pattern.sigma
        in_noise = (self._short / sigma)[used]
        whole = float(in_noise @ in_noise)
        rest = float((self._pattern.rest(self._short) ** 2).sum())
        largest = float(np.abs(gains[used]).max(initial=0.0))
        clear = float(np.abs(gains / sigma)[used].max(initial=0.0)) > GAIN_SIGMAS
        return largest > LEAST_GAIN and clear and rest <= (1.0 - GAIN_SHARE) * whole

    def _is_small_gain(self) -> bool:
        gains = self._pattern.gain_change(self._short)
        return float(np.abs(gains).max(initial=0.0)) <= LARGEST_GAIN

    def _take_gain(self) -> None:
        self.untouched = self.untouched * (1.0 + self._pattern.gain_change(self._short))
        self._level_noise += self._short_noise
        self.gain_steps += 1
        self._forget_short()
        self._touched_share = 0.0
        self._gain_since_s = None
        self._waiting.clear()
        self._set_pattern()

    def _forget_short(self) -> None:
        self._short[:] = 0.0
        self._short_noise = 0.0

    def _follow_waiting(self, time_s: float) -> None:
        while self._waiting and time_s - self._waiting[0][0] >= self._guard_s:
            _, passed_s, signals = self._waiting.popleft()
            weight = -math.expm1(-min(passed_s / self._tau_s, LONGEST_STEP))
            self.untouched = self.untouched + weight * (signals - self.untouched)
            self._level_noise = (1.0 - weight) ** 2 * self._level_noise + weight**2
            np.divide(self._trained, self.untouched, out=self._factor, where=self._strong)

    def _drift(self) -> float:
        used = self._pattern.used
        return float(np.median(self.untouched[used] / self._first[used])) - 1.0 if used.any() else 0.0


def _since(begun_s: float | None, time_s: float, goes_on: bool) -> float | None:
    if not goes_on:
        return None
    return time_s if begun_s is None else begun_s


def _require(start: FloatArray, trained: FloatArray, time_constant_s: float, guard_s: float) -> None:
    if start.ndim != 3 or len(start) < LEAST_START_FRAMES or trained.shape != (start[0].size,):
        raise InputError(
            f"drift: start {start.shape}, trained {trained.shape}: needs at least {LEAST_START_FRAMES} frames "
            "(n, emitter, receiver) and one level a pair"
        )
    if not (np.isfinite(start).all() and np.isfinite(trained).all()):
        raise InputError("drift: the levels are not all finite numbers; read the untouched pad again")
    if not (
        math.isfinite(time_constant_s) and time_constant_s > 0 and math.isfinite(guard_s) and guard_s >= 0
    ):
        raise InputError(
            f"drift: time_constant_s {time_constant_s:g}, guard_s {guard_s:g}: need seconds above 0, and 0 or more"
        )
