"""Finds that a touch moves sideways: an object slips over the pad, or drags the pad's surface along quickly.

The change of the last frames
-----------------------------
The last `WINDOW_S` of a touch, and at least three frames, give the rate of change of every signal s by a straight line.
So do the last `LONG_WINDOW_S`, every `LOOK_S`, for slow slides:

    r = Σ (t - t̄) s / S,    S = Σ (t - t̄)²,    covariance of r by noise alone = ρ C / S

C is the covariance of one frame: independent noise of every pair as in the untouched frames at the start, and unknown
gains of emitters and receivers (`optopad.sims.learning.inference.signal_map`). ρ scales it to the scatter of recent
frames around the line through both neighbours, averaged over `MEMORY_S`. So the noise may depend on the touch.

A press that moves at the speed v = (v_x, v_y, v_depth) changes the signals by r = Jᵀv, with the slopes J of the
model's signals at the predicted press. A further row of J is the way that the touch came: r in the last frame of its
last press with W > `STRONG` n, once it is still. On this way it goes deeper or back, whatever the model's slopes. Least
squares for all rows give the sideways speed and its χ²:

    A = J C⁻¹ Jᵀ,    v = A⁻¹ J C⁻¹ r,    T = S v_xyᵀ [(A⁻¹)_xy]⁻¹ v_xy / ρ,    W = S rᵀ C⁻¹ r / ρ   (whole change)

With noise alone, T has the χ² distribution with 2 degrees of freedom, so P(T > h) = exp(-h / 2), and W has as many as
there are pairs, n. The test is a likelihood ratio for a change in a sliding window (Willsky and Jones, IEEE Trans.
Autom. Control 21 (1976), 108-112; Lai, J. R. Stat. Soc. B 57 (1995), 613-658).

The decision
------------
    still:    W < n + `STILL_SIGMAS` √(2n)  and  T < h,    or |v| in every direction is below `STILL_MM_S`
    sideways: T > h + `SIDEWAYS_SHARE` max(W - n, 0)  and  |v_xy| > `LEAST_MM_S`,
              h = 2 ln(frame rate x `NOISE_ALARM_S`)
    press:    neither, and  |v_depth| > max(`DEPTH_RATIO` |v_xy|, `LEAST_MM_S`)
              or  W > `STRONG` n  and  T < `PRESS_SHARE` (W - n)
    slip:     either window is sideways, and no press since the touch was last still

The short window alone decides on *still* and *press*. A touch begins as a press. While it is one, the long window is no
longer than the short one, so a press does not reach into it later. A slip lasts until `HOLD_S`, or three frames, after
the last frame that shows it, or until a press.

Noise alone exceeds h once in `NOISE_ALARM_S` at most in each window. A press that goes deeper, and a release, change
the signals by far more than noise. Slopes of a model are not exact, so a part of this change resembles a sideways
movement. The term with W therefore demands that a share of the change is sideways; for steps of gain it does so, too. A
press remains one until the touch is still again, because the way bends. An object that drags the pad's surface along
hardly changes the depth, so its movement may become a slip at any time. Slow drift stays below the least speed.
`docs/validation/slip.md` has the share found, the delay and the false alarms.

A model without slopes (any but a signal map) predicts x, y and depth alone. These replace the signals: J is the unit
matrix, and the noise follows from the scatter of the predictions.

Left out: friction. An object that sticks drags the pad's surface along, which moves the dimple less and changes the
signals by shear, too. It counts as slipping if it appears faster than `LEAST_MM_S`. Also left out are slower slides,
slides that begin during a press or a release, and turns of the object on its place. While there are two touches, no
slip is reported.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.fabrication.driver.drift import LEAST_NOISE_COUNTS
from optopad.sims.learning.inference.signal_map import SignalMapModel, Whitening, whitening
from optopad.sims.learning.inference.touch_model import TouchModel

WINDOW_S, LONG_WINDOW_S = 0.03, 0.1
"""Times over which the change of the signals is measured [s]."""

LOOK_S = 0.01
"""Time from one look at the long window to the next [s]."""

FEWEST_FRAMES = 3
"""Least number of frames of a window: below 67 frames a second the short one is longer than `WINDOW_S`."""

LEAST_MM_S = 2.0
"""Sideways speed above which a movement is a slip [mm/s]."""

SIDEWAYS_SHARE = 0.15
"""Share of the whole change of the signals that a slip must explain beside depth and gains [-]."""

NOISE_ALARM_S = 3600.0
"""Least mean time between false alarms by noise alone [s]."""

MEMORY_S, FEWEST_SCATTER = 1.0, 10
"""Time over which scatter is averaged [s], and number of frames for which the noise at the start counts in it."""

LARGEST_SCATTER = 5.0
"""Largest scatter of one frame, over the average: a sudden movement scatters, too [-]."""

FREE_GAIN = 0.01
"""Standard deviation of the gains that are unknown beside the movement, relative [-]."""

FIRST_SIGMA_MM = 0.1
"""Noise of a prediction that is assumed at first if the model has no slopes [mm]."""

STILL_MM_S, STILL_SIGMAS = 1.0, 4.0
"""A touch is still if it is slower than this [mm/s], or if its change is this many deviations above noise at most."""

STRONG = 10.0
"""Change of the signals, over that of noise, from which on a press has a direction, which is kept [-]."""

DEPTH_RATIO, PRESS_SHARE = 2.0, 0.05
"""A change is that of a press if the depth changes this much faster than x and y [-], or if it is strong and a smaller
share than this is sideways [-]."""

HOLD_S = 0.06
"""Time for which a slip is kept after the last frame that shows it, and three frames at least [s]."""

TINY = 1e-9

LONGEST_GAP_S = 0.1
"""Time without a frame after which a touch begins anew, and three frames at least [s]."""


@dataclass(frozen=True, kw_only=True)
class Slip:
    """Result for one frame.

    Attributes
    ----------
    is_slipping : whether the touch moves sideways
    slip_mm_s : its speed along x and y [mm/s]; 0 unless it slips
    """

    is_slipping: bool
    slip_mm_s: FloatArray


NO_SLIP = Slip(is_slipping=False, slip_mm_s=np.zeros(2))


class SlipDetector:
    """Follows the frames of touches, and finds those in which the touch moves sideways.

    Parameters
    ----------
    model : model that predicts the touches
    start : frames of the untouched pad as the model takes them, shape (n, pairs) [counts]
    """

    def __init__(self, model: TouchModel, start: FloatArray) -> None:
        self._map = model if isinstance(model, SignalMapModel) else None
        self._sigma = np.full(3, FIRST_SIGMA_MM)
        if self._map is not None:
            self._sigma = np.maximum(start.std(axis=0, ddof=1), LEAST_NOISE_COUNTS)
            self._gains = replace(self._map.noise, emitter_drift=FREE_GAIN, receiver_drift=FREE_GAIN)
        self._frames: deque[tuple[float, FloatArray, FloatArray]] = deque()
        self._since_s, self._period_s = 0.0, 0.0
        self.forget()
        self._scatter, self._scattered = 1.0, float(FEWEST_SCATTER)

    def seen(self, signals: FloatArray, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What is followed of n frames, shape (n, m), and its slopes by x, y and depth, shape (n, 3, m).

        Parameters
        ----------
        signals : frames as the model takes them, shape (n, pairs) [counts]
        press_mm : presses that the model predicts for them, shape (n, 3) [mm]
        """
        if self._map is None:
            return press_mm, np.broadcast_to(np.eye(3), (len(signals), 3, 3))
        return signals, self._map.answers(press_mm)[1]

    def forget(self) -> None:
        """Begin a new touch."""
        self._frames.clear()
        self._slip, self._slipped_s, self._looked_s = NO_SLIP, -math.inf, -math.inf
        self._is_press = True
        self._way: FloatArray | None = None
        self._moved: FloatArray | None = None

    def follow(self, time_s: float, seen: FloatArray, slopes: FloatArray) -> Slip:
        """Follow one frame of a touch.

        Parameters
        ----------
        time_s : time of the frame by a clock that never goes back, such as the board's [s]
        seen, slopes : what `seen` returns for this frame, shapes (m,) and (3, m)
        """
        frames = self._frames
        if frames:
            gap_s = time_s - frames[-1][0]
            if not 0.0 < gap_s < max(LONGEST_GAP_S, FEWEST_FRAMES * self._period_s):
                self.forget()
            self._period_s = gap_s
        if not frames:
            self._since_s = time_s
        frames.append((time_s, seen, slopes))
        kept_s = WINDOW_S if self._is_press else LONG_WINDOW_S
        while len(frames) > FEWEST_FRAMES and time_s - frames[0][0] > kept_s:
            frames.popleft()
        if len(frames) < FEWEST_FRAMES or time_s - self._since_s < WINDOW_S:
            return NO_SLIP
        count = max(sum(time_s - one[0] <= WINDOW_S for one in frames), FEWEST_FRAMES)
        last = list(frames)
        short = last[-count:]
        signals = np.array([one[1] for one in short])
        noise = self._noise(signals.mean(axis=0))
        self._follow_scatter(np.array([one[0] for one in short[-3:]]), signals[-3:], noise)
        rate, found = self._moves(short, noise)
        long = None
        if len(last) > count and time_s - self._looked_s >= LOOK_S:
            self._looked_s = time_s
            long = self._moves(last, noise)[1]
        return self._decided(time_s, rate, found, long)

    def _moves(
        self, frames: list[tuple[float, FloatArray, FloatArray]], noise: Whitening
    ) -> tuple[FloatArray, Movement]:
        """Rate of change of the signals in a window, and its movement."""
        times_s = np.array([one[0] for one in frames])
        centred = times_s - times_s.mean()
        square = float(centred @ centred)
        rate = centred @ np.array([one[1] for one in frames]) / square
        known = np.mean([one[2] for one in frames], axis=0)
        if self._way is not None:
            known = np.concatenate([known, self._way[None]])
        return rate, movement(rate, known, noise).over(self._scatter / square)

    def _decided(self, time_s: float, rate: FloatArray, found: Movement, long: Movement | None) -> Slip:
        pairs = len(rate)
        least = 2.0 * math.log(NOISE_ALARM_S / self._period_s)
        is_sideways = found.is_sideways(pairs, least)
        is_noise = found.whole < pairs + STILL_SIGMAS * math.sqrt(2.0 * pairs) and found.sideways < least
        if is_noise or float(np.abs(found.speed_mm_s).max()) < STILL_MM_S:
            self._is_press = False
            if self._moved is not None:
                self._way, self._moved = self._moved, None
        else:
            self._is_press = self._is_press or (not is_sideways and found.is_press(pairs))
            if self._is_press and found.whole > STRONG * pairs:
                self._moved = rate
        slides = (
            found if is_sideways else long if long is not None and long.is_sideways(pairs, least) else None
        )
        if slides is not None and not self._is_press:
            self._slip, self._slipped_s = Slip(is_slipping=True, slip_mm_s=slides.speed_mm_s[:2]), time_s
        elif self._is_press or time_s - self._slipped_s > max(HOLD_S, FEWEST_FRAMES * self._period_s):
            self._slip = NO_SLIP
        return self._slip

    def _noise(self, signals: FloatArray) -> Whitening:
        gains = (
            np.zeros((1, 1, len(signals))) if self._map is None else self._gains.gain_columns(signals[None])
        )
        return whitening(1.0 / self._sigma[None] ** 2, gains)

    def _follow_scatter(self, times_s: FloatArray, signals: FloatArray, noise: Whitening) -> None:
        """Follow ρ, from three frames: the middle one's distance from the line between the others."""
        last = (times_s[1] - times_s[0]) / (times_s[2] - times_s[0])
        weights = np.array([last - 1.0, 1.0, -last])
        square = float(noise.square((weights @ signals)[None])[0])
        found = square / (float(weights @ weights) * signals.shape[1])
        most = max(MEMORY_S / (times_s[2] - times_s[1]), FEWEST_SCATTER)
        self._scattered = min(self._scattered + 1.0, most)
        self._scatter += (min(found, LARGEST_SCATTER * self._scatter) - self._scatter) / self._scattered


@dataclass(frozen=True, kw_only=True)
class Movement:
    """How the press moves.

    Attributes
    ----------
    speed_mm_s : v, along x, y and depth [mm/s]
    sideways, whole : T and W of the module's equations [-]
    """

    speed_mm_s: FloatArray
    sideways: float
    whole: float

    def is_sideways(self, pairs: int, least: float) -> bool:
        """Whether the change is a slip's: more than noise, sideways by its share, and fast."""
        return (
            self.sideways > least + SIDEWAYS_SHARE * max(self.whole - pairs, 0.0)
            and math.hypot(*self.speed_mm_s[:2]) > LEAST_MM_S
        )

    def is_press(self, pairs: int) -> bool:
        """Whether the change is that of a press that goes deeper or back."""
        excess, (x_mm_s, y_mm_s, depth_mm_s) = self.whole - pairs, self.speed_mm_s
        return abs(depth_mm_s) > max(LEAST_MM_S, DEPTH_RATIO * math.hypot(x_mm_s, y_mm_s)) or (
            self.whole > STRONG * pairs and self.sideways < PRESS_SHARE * excess
        )

    def over(self, scale: float) -> Movement:
        """The same with χ² divided by a variance."""
        return replace(self, sideways=self.sideways / scale, whole=self.whole / scale)


def movement(rate: FloatArray, slopes: FloatArray, noise: Whitening) -> Movement:
    """Least squares of a change of the signals, with χ² for the covariance of one frame.

    Parameters
    ----------
    rate : r, rates of change of the signals, shape (m,) [counts/s]
    slopes : changes of the signals by x, y, depth, and in further unknown ways, shape (3 or more, m) [counts/mm]
    noise : C⁻¹ of one frame
    """
    both = np.concatenate([slopes, rate[None]])
    shared = both @ noise.shared[0].T
    products = (both * noise.weight[0]) @ both.T - shared @ shared.T
    size = np.sqrt(np.diagonal(products)[:-1]) + TINY
    matrix = products[:-1, :-1] / size / size[:, None] + TINY * np.eye(len(size))
    speed = np.linalg.solve(matrix, products[:-1, -1] / size)
    shared_xy = matrix[:2, 2:]
    alone = matrix[:2, :2] - shared_xy @ np.linalg.solve(matrix[2:, 2:], shared_xy.T)
    return Movement(
        speed_mm_s=(speed / size)[:3],
        sideways=float(speed[:2] @ alone @ speed[:2]),
        whole=float(products[-1, -1]),
    )
