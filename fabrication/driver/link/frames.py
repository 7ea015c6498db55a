"""Decodes the board's messages into frames, counts lost frames and measures the frame rate.

The board's 32-bit counters are unwrapped, repeated frames and restarts of the board are detected, and the board's times
are turned into this machine's by `BoardClock`.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import DeviceError
from optopad.design.recordings import signals_of
from optopad.fabrication.driver.link.protocol import STAMP, WRAP, CountArray, FrameFormat, unpack_frames

WINDOW_S = 10.0
"""Time over which the least delay is sought [s]."""
BLOCK_S = 0.5
"""Time for which one minimum is kept [s]."""
QUARTZ = 1e-4
"""Largest relative difference between the board's clock and that of this machine [-]."""


class BoardClock:
    """Estimates when frames were read, in this machine's time, from the times of arrival.

    Every frame states the board's time d of its first conversion. It arrives at the host's time

        h = d + offset + least delay + jitter,   jitter >= 0,

    where the least delay is the duration of the conversions and of the transfer, by the timing model. Jitter is the
    time for which the bytes wait in drivers and buffers. The offset is the minimum of h - d over the last `WINDOW_S`,
    less the least delay. Two quartz clocks differ by up to 100 ppm, so the minimum is taken over a short window only.

    Left out: a delay that every frame has, such as that of a USB bridge, which makes all stamps late by the same time.

    Parameters
    ----------
    least_delay_s : time from a frame's first conversion to its arrival, without waiting [s]
    """

    def __init__(self, least_delay_s: float) -> None:
        self._least_delay_s = least_delay_s
        self._blocks: deque[tuple[float, float]] = deque()

    def restart(self) -> None:
        """Forget all frames, because the board's clock started again."""
        self._blocks.clear()

    def began_s(self, device_s: float, host_s: float) -> float:
        """Host's time at which a frame's first conversion began [s]; never after its arrival.

        Parameters
        ----------
        device_s : board's time of the first conversion [s]
        host_s : host's time at the frame's arrival [s]
        """
        behind = host_s - device_s
        blocks = self._blocks
        if blocks and device_s - blocks[-1][0] < BLOCK_S:
            blocks[-1] = (blocks[-1][0], min(blocks[-1][1], behind))
        else:
            blocks.append((device_s, behind))
            while blocks[0][0] < device_s - WINDOW_S:
                blocks.popleft()
        return device_s + min(least for _, least in blocks) - self._least_delay_s

    @property
    def error_s(self) -> float:
        """Bound of the error by the drift of the clocks within the window [s]; infinite before the first frame."""
        blocks = self._blocks
        return QUARTZ * (blocks[-1][0] - blocks[0][0] + BLOCK_S) if blocks else float("inf")


REMEMBERED_FRAMES = 256
"""Number of past frames with which a new frame is compared to detect repeats; they span 0.6 s at 400 Hz."""


class WrappingCounter:
    """Turns successive values of one of the board's 32-bit counters into numbers that do not wrap.

    Parameters
    ----------
    goes_back : whether the counter may step backward. Sequence numbers may, because a restart of the board resets
        them; their steps are from -2^31 to 2^31 - 1. Device time never decreases; its steps are from 0 to 2^32 - 1 us
        (71.6 minutes)
    """

    def __init__(self, *, goes_back: bool) -> None:
        self._goes_back = goes_back
        self._last: int | None = None

    def next(self, value: int) -> tuple[int, int]:
        """The unwrapped number for a counter value, and the step from the previous value.

        The step of the first value is 1. For single values, `next` is faster than `extended`.
        """
        if self._last is None:
            self._last = value
            return value, 1
        step = (value - self._last) % WRAP
        if self._goes_back and step >= WRAP // 2:
            step -= WRAP
        self._last += step
        return self._last, step

    def extended(self, values: CountArray) -> tuple[IntArray, IntArray]:
        """The unwrapped numbers for n counter values, and for each the step from the previous value; shapes (n,).

        The step of the very first value is 1.
        """
        if not len(values):
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        plain = values.astype(np.int64)
        last = int(plain[0]) - 1 if self._last is None else self._last
        steps = np.diff(plain, prepend=last) % WRAP
        if self._goes_back:
            steps = np.where(steps < WRAP // 2, steps, steps - WRAP)
        whole = last + np.cumsum(steps)
        self._last = int(whole[-1])
        return whole, steps


class Repeats:
    """Detects frames delivered twice, whose sequence number and time equal those of one of the last 256 frames.

    A restarted board repeats its sequence numbers, but not with the same times.
    """

    def __init__(self) -> None:
        self._order: deque[bytes] = deque()
        self._seen: set[bytes] = set()

    def has(self, message: bytes) -> bool:
        """Whether a message of readings repeats one of the last 256; if it does not, it is remembered."""
        stamp = message[STAMP]
        if stamp in self._seen:
            return True
        if len(self._order) == REMEMBERED_FRAMES:
            self._seen.remove(self._order.popleft())
        self._order.append(stamp)
        self._seen.add(stamp)
        return False


def restarts(values: CountArray, last: int) -> IntArray:
    """Indices of the frames that are the first after a restart of the board.

    The board has restarted if a sequence number is not above the previous one, modulo 2^32.

    Parameters
    ----------
    values : sequence numbers of the frames, shape (n,)
    last : sequence number before the first of them
    """
    steps: IntArray = np.diff(values.astype(np.int64), prepend=last).astype(np.int64) % WRAP
    places: IntArray = np.flatnonzero((steps == 0) | (steps >= WRAP // 2))
    return places


US_PER_S = 1e6
RATE_FRAMES = 256
"""Number of most recent frames over which the frame rate is measured."""

WEAKEST_BASELINE_COUNTS = 4.0
"""Smallest untouched signal by which a signal is divided [counts]; smaller ones are dominated by rounding."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One complete frame: a reading of every receiver in every state of the emitters.

    The host's clock of a simulated pad is that of the simulation, and begins with it.

    Attributes
    ----------
    connection : number of the connection, from 1; it increases at each restart of the board and each reconnection
    sequence : sequence number of the frame within the connection; it does not wrap
    device_us : time of the frame's first conversion by the board's clock; it does not wrap [us]
    host_s : time of arrival of the frame's batch by the host's clock, since 1970 [s]; at 400 Hz up to 5 ms late
    lost_before : number of frames missing between the previous frame and this one, by their sequence numbers
    counts : raw readings, shape (states, receivers); the last state is dark [counts]
    signals : readings minus those in the dark state, shape (emitters, receivers) [counts]
    saturated : whether each reading is at full scale, shape (states, receivers)
    baseline : signals of the untouched pad, shape (emitters, receivers) [counts]; None if no baseline was taken
    began_s : time of the frame's first conversion by the host's clock, since 1970, by `BoardClock` [s]
    began_error_s : bound of its error by the drift of the clocks [s]
    """

    connection: int
    sequence: int
    device_us: int
    host_s: float
    lost_before: int
    counts: NDArray[np.uint16]
    signals: NDArray[np.int32]
    saturated: BoolArray
    baseline: FloatArray | None = None
    began_s: float = math.nan
    began_error_s: float = math.inf

    def __str__(self) -> str:
        """One line: number, time, range of the signals, and the pair that changed most if there is a baseline."""
        emitters, receivers = self.signals.shape
        text = (
            f"frame {self.sequence} at {self.device_us / US_PER_S:.3f} s: {emitters} x {receivers} signals of "
            f"{self.signals.min()} to {self.signals.max()} counts, {self.saturated.sum()} readings saturated"
        )
        if self.baseline is None or not np.isfinite(self.normalised).any():
            return text
        change = np.nan_to_num(self.normalised - 1.0)
        i, j = np.unravel_index(int(np.abs(change).argmax()), change.shape)
        return f"{text}, signal [{i}, {j}] changed most: {change[i, j]:+.1%}"

    @property
    def normalised(self) -> FloatArray:
        """Signals divided by the baseline, shape (emitters, receivers); NaN where that is below 4 counts [-].

        Raises
        ------
        DeviceError : no baseline was taken.
        """
        if self.baseline is None:
            raise DeviceError("no baseline was taken; call take_baseline(), or open with baseline_s > 0")
        return normalised(self.signals, self.baseline)


def normalised(signals: NDArray[np.int32] | FloatArray, baseline: FloatArray) -> FloatArray:
    """Signals divided by a baseline, shape (emitters, receivers); NaN where the baseline is below 4 counts [-]."""
    strong = baseline >= WEAKEST_BASELINE_COUNTS
    ratio: FloatArray = np.divide(signals, baseline, out=np.full(baseline.shape, np.nan), where=strong)
    return ratio


class FrameDecoder:
    """Decodes complete messages of readings into frames, and counts them.

    Attributes
    ----------
    frames : number of frames decoded so far
    lost : number of frames missing so far, by their sequence numbers
    doubled : number of messages discarded so far because they repeat an earlier one
    connection : connection number of the next frame
    baseline : untouched signals that are attached to the next frames, shape (emitters, receivers) [counts]; None if no
        baseline was taken

    Parameters
    ----------
    layout : shape of the frames
    least_delay_s : time from a frame's first conversion to its arrival, without waiting [s]
    """

    def __init__(self, layout: FrameFormat, least_delay_s: float = 0.0) -> None:
        self._layout = layout
        self._clock = BoardClock(least_delay_s)
        self.frames = 0
        self.lost = 0
        self.doubled = 0
        self.connection = 0
        self.baseline: FloatArray | None = None
        self.begin()

    def begin(self) -> None:
        """Begin a new connection; must be called when the board has restarted, because its counters start again."""
        self.connection += 1
        self._sequence = WrappingCounter(goes_back=True)
        self._time = WrappingCounter(goes_back=False)
        self._clock.restart()
        self._recent_us: deque[int] = deque(maxlen=RATE_FRAMES)
        self._repeats = Repeats()

    @property
    def rate_hz(self) -> float | None:
        """Delivered frames per second, over the last 256 frames by the board's clock; None before the second frame."""
        times = self._recent_us
        passed = times[-1] - times[0] if len(times) > 1 else 0
        return (len(times) - 1) * US_PER_S / passed if passed > 0 else None

    def without_repeats(self, messages: list[bytes]) -> list[bytes]:
        """The given messages of readings without those that repeat an earlier one, which are counted in `doubled`."""
        new = [message for message in messages if not self._repeats.has(message)]
        self.doubled += len(messages) - len(new)
        return new

    def decoded(self, messages: list[bytes], host_s: float) -> list[Frame]:
        """Frames of complete messages that arrived at time `host_s` [s].

        If a sequence number does not increase, a new connection begins. A batch has only a few frames, so the work for
        each frame uses plain numbers instead of arrays.
        """
        found = unpack_frames(self._layout, messages)
        counts = found.counts
        signals = signals_of(counts.astype(np.int32))
        saturated = counts >= self._layout.full_scale
        frames = []
        for k, number in enumerate(found.sequence.tolist()):
            sequence, step = self._sequence.next(number)
            if step <= 0:  # the board restarted without a hello
                self.begin()
                sequence, step = self._sequence.next(number)
            device_us, _ = self._time.next(int(found.device_us[k]))
            self._recent_us.append(device_us)
            self.lost += step - 1
            frame = Frame(
                connection=self.connection,
                sequence=sequence,
                device_us=device_us,
                host_s=host_s,
                lost_before=step - 1,
                counts=counts[k],
                signals=signals[k],
                saturated=saturated[k],
                baseline=self.baseline,
                began_s=self._clock.began_s(device_us / US_PER_S, host_s),
                began_error_s=self._clock.error_s,
            )
            frames.append(frame)
        self.frames += len(frames)
        return frames
