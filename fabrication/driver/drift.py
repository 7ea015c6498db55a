"""Slow drift of the untouched pad, followed; a touch, held however long, left alone.

Of every pair: y its signal, b the untouched level that is followed, u that of the training data [counts]. A model is
given

    f = y u / b                      (f = y where u or b is below 4 counts, too little to divide by)

and on untouched frames b goes after the signal of `guard_s` ago with the time constant tau,

    db/dt = (y(t - guard) - b) / tau.

A frame is held, and b stays, while the pad is touched, and `guard_s` before and after: what waits for the guard is
thrown away when a touch comes. The pad is taken for touched where either

- the model says so, in more than half of the last 0.2 s (single wrong frames hold nothing up), or
- the change  c = y / b - 1  over 0.2 s, less all that gains of emitters and receivers explain (`gain_pattern`), has a
  mean square of more than 4 times the noise's: a press shades pairs one by one.

A change that gains explain to 95 % or more, beyond 0.5 % and five times its noise, for 1 s on end, is a step of gain: a
part was plugged, warmed or lost supply, or drift went on under a touch that has ended. It is counted and reported, and
b is multiplied by it, also while the model takes it for a touch. A part that loses more than half is reported and not
followed. Layouts with fewer than 16 numbers beside the gains (3 x 3 parts have 4) tell no steps of gain.

What it cannot tell: a contact that is there at the start is taken for the untouched pad (`start_mismatch` says how far
the start is from the training data beyond gains); a contact that grows so slowly that the rest of its change stays
under the threshold within tau is followed as drift; a touch that changes all pairs of a part by one factor, as a finger
before the part's own window, may pass for gain. Drift under a held touch is not followed: the position is off by what
the signals drift meanwhile, until the touch ends.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from fabrication.driver.gain_pattern import GainPattern, relative_change
from fabrication.driver.link.frames import WEAKEST_BASELINE_COUNTS

TIME_CONSTANT_S, GUARD_S = 10.0, 0.5
SHORT_S = 0.2
"""Over which the change is averaged before it is judged."""

HELD_EXCESS = 4.0
"""Mean square of a change's rest over the noise's: 1 by noise alone, with a scatter of 0.2 for 49 free numbers."""

GAIN_S = 1.0
GAIN_SHARE = 0.95
LEAST_GAIN, GAIN_SIGMAS = 0.005, 5.0
LEAST_FREEDOM = 16
"""With fewer numbers beside the gains a press can look like them: they explain 95 % of one of the paper's pair."""

LONGEST_STEP = 0.5
"""After a pause a frame counts for at most this share of the time constant: its noise stays in the levels."""

LARGEST_GAIN = 0.5
"""A part that loses more is broken, which is reported and not followed."""

LEAST_NOISE_COUNTS = 0.3
"""Rounding alone."""

LEAST_START_FRAMES = 5


@dataclass(frozen=True, kw_only=True)
class DriftState:
    """What the tracker makes of a frame.

    Attributes
    ----------
    is_held : the untouched levels are not followed now
    excess : mean square of the change's rest over the noise's [-]
    drift : median of all pairs' untouched levels over the start's, less 1 [-]
    is_gain_like : whether the change since the levels were followed last is one of gains, and clear
    gain_steps : so far
    held_without_touch_s : how long the change was no gain and the model saw no touch [s]
    """

    is_held: bool
    excess: float
    drift: float
    is_gain_like: bool
    gain_steps: int
    held_without_touch_s: float


class DriftTracker:
    """Follows the untouched levels of all pairs.

    Parameters
    ----------
    start : (n, emitter, receiver) signals of the untouched pad, at least 5 frames [counts]
    trained : (pair,) untouched signals of the training data, emitter outermost [counts]
    time_constant_s : of following [s]
    guard_s : before and after a touch nothing is followed [s]
    full_scale : signals from here on tell nothing [counts]

    Attributes
    ----------
    untouched : (pair,) followed levels [counts]
    gain_steps : told so far
    start_mismatch : root mean square of start over training beyond gains, over the pairs that tell a ratio [-]

    Raises
    ------
    InputError : shapes that do not fit, numbers that are not finite, times that are none.
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
        """Variance of the levels over a frame's: each is a mean."""
        self._calibrate(start.reshape(len(start), -1))
        self.start_mismatch = self._mismatch()
        self.gain_steps = 0
        self._waiting: deque[tuple[float, float, FloatArray]] = deque()
        """Time of a frame, how long it is since the one before it [s], its signals."""
        self._short = np.zeros(self.untouched.size)
        self._short_noise = 0.0
        """Variance of the short average over a frame's; its frames may come at any times."""
        self._touched_share = 0.0
        self._time_s: float | None = None
        self._held_s = -math.inf
        self._gain_since_s: float | None = None
        self._odd_since_s: float | None = None

    def features(self, signals: FloatArray) -> FloatArray:
        """(n, pair) what a model is given for (n, pair) signals [counts]."""
        found: FloatArray = signals * self._factor
        return found

    def follow(self, time_s: float, signals: FloatArray, is_touched: bool) -> DriftState:
        """Take one frame into account.

        Parameters
        ----------
        time_s : rises from frame to frame, as the board's clock [s]
        signals : (pair,) less the off state's [counts]
        is_touched : what the model says of it
        """
        passed_s = 0.0 if self._time_s is None else max(time_s - self._time_s, 0.0)
        weight = -math.expm1(-passed_s / SHORT_S)
        self._time_s = time_s
        self._touched_share += weight * (float(is_touched) - self._touched_share)
        self._short += weight * (relative_change(signals, self.untouched) - self._short)
        self._short_noise = (1.0 - weight) ** 2 * self._short_noise + weight**2
        excess = self._excess()
        is_gain_like = self._is_gain_like()
        self._gain_since_s = _since(self._gain_since_s, time_s, is_gain_like)
        is_touch = self._touched_share > 0.5
        is_local = excess > HELD_EXCESS
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
        """The board began anew: its clock starts again, the untouched levels stay."""
        self._time_s = None
        self._held_s = -math.inf
        self._gain_since_s = self._odd_since_s = None
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
        self._factor = np.ones(self._strong.size)
        np.divide(self._trained, self.untouched, out=self._factor, where=self._strong)

    def _mismatch(self) -> float:
        pattern = GainPattern(self._trained.reshape(self._shape), self._noise, 0.98 * self._full_scale)
        rest = pattern.rest(relative_change(self.untouched, self._trained)) * pattern.sigma
        used = rest[pattern.used]
        return float(np.sqrt((used**2).mean())) if used.size else 0.0

    def _excess(self) -> float:
        """Of the averaged change: its noise is less than a frame's by the average's length; the levels add theirs."""
        noise = self._quiet * (self._short_noise + self._level_noise)
        return float(self._pattern.excess(self._short)) / noise

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
        """Let in what has waited for the guard."""
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
    """When what goes on began; None where it does not."""
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
