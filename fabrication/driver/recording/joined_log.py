"""Joins a stage's log to a recording: each frame gets the tip's position, the set and the press number from the log.

A frame's time is its arrival at the host, about 5 to 20 ms after the measurement. At 5 mm/s, the tip moves by up to
0.1 mm in this time; if that matters, hold the tip still during frames. Frames without a known position are left out and
counted.

The offset between the clocks of log and recording is found from the touches in both. Touches are detected in the
signals of the recording. The first half second, which must be untouched, gives the untouched signals and their noise.
Later half seconds without a touch update the untouched signals, so that drift does not count as touch. A frame counts
as touched if its change, less the part that changed gains explain (`gain_pattern`), is far above the noise. In the log,
a touch begins and ends when the depth crosses 0.

Signals and log are each converted to a time series that is 1 while the pad is touched, and 0 otherwise. The two series
are correlated at every shift at which at least half of the shorter one overlaps. The best shifts are then refined with
the edges, which are the starts and ends of touches. Each edge in the signals is paired with the nearest edge of the
same type in the log. The median lag is computed for the starts and for the ends, and the offset is the mean of the two.
The signals show a touch only from slightly below the surface, so its start is late and its end is early. If the tip
moves equally fast in both directions, these two errors cancel out.

The match fails if there are too few edges, if they do not match, or if they match at several shifts. If a stage presses
in an exactly regular rhythm, shifts by a whole press cannot be distinguished.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.descriptor import descriptor_of
from optopad.fabrication.driver.gain_pattern import GainPattern, relative_change
from optopad.fabrication.driver.recording.position_log import PositionLog
from optopad.fabrication.driver.recording.recorded import Recorded, require_rising

Mask = BoolArray

STEP_S = 0.02
"""Time step of the correlated time series [s]."""

BASELINE_S = 0.5
TOUCHED_EXCESS = 6.0
"""A frame counts as touched if the mean square of its change is above this multiple of that of noise [-].

The part of the change that is explained by changed gains is subtracted first.
"""

LEAST_FRAMES = 5
LEAST_NOISE_COUNTS = 0.5
SHORTEST_S = 0.1
"""Shortest touch, and shortest pause between touches [s]; shorter ones are attributed to noise in single frames."""

LEAST_TOUCHES = 2
WINDOW_S = 1.0
"""Largest time between the start or end of a touch in the signals and the same event in the log [s]."""

LEAST_SHARE = 0.8
LARGEST_SPREAD_S = 0.15
SHARE_MARGIN = 0.1
SPREAD_MARGIN_S = 0.05
OUT_OF_STEP_S = 0.3
CANDIDATES = 8


@dataclass(frozen=True, kw_only=True)
class ClockMatch:
    """Match of a recording's clock and a log's clock, from the starts and ends (edges) of touches.

    Attributes
    ----------
    offset_s : the recording's clock minus the log's [s]
    spread_s : robust estimate of the standard deviation of the edges' lags [s]
    share : fraction of the edges in the common time span that have a partner [-]
    edges : number of edges in the common time span, in the signals or in the log, whichever has more
    """

    offset_s: float
    spread_s: float
    share: float
    edges: int

    @property
    def is_good(self) -> bool:
        """Whether most starts and ends of touches have a partner, with nearly equal time lags."""
        return self.share >= LEAST_SHARE and self.spread_s <= LARGEST_SPREAD_S

    def rivals(self, best: ClockMatch) -> bool:
        """Whether this match is nearly as good as the best one, so that the offset is ambiguous."""
        return self.share > best.share - SHARE_MARGIN and self.spread_s < max(
            3 * best.spread_s, SPREAD_MARGIN_S
        )


@dataclass(frozen=True, kw_only=True)
class Touches:
    """Start and end times of touches, and the first and last time of the observation [s]."""

    begin_s: FloatArray
    end_s: FloatArray
    span_s: tuple[float, float]

    def course(self, step_s: float) -> FloatArray:
        """Time series of shape (n,), 1 while touched and 0 otherwise, in steps of `step_s` [s] from `span_s[0]`."""
        grid = np.arange(self.span_s[0], self.span_s[1], step_s)
        begun = np.searchsorted(np.sort(self.begin_s), grid, side="right")
        ended = np.searchsorted(np.sort(self.end_s), grid, side="right")
        course: FloatArray = np.clip(begun - ended + self._is_touched_first, 0, 1).astype(np.float64)
        return course

    @property
    def _is_touched_first(self) -> int:
        first_end, first_begin = (min(times, default=np.inf) for times in (self.end_s, self.begin_s))
        return int(first_end < first_begin)


def touches_of_log(log: PositionLog) -> Touches:
    """Touches, from the depth in a stage's log."""
    begin_s, end_s = log.crossings_s()
    return Touches(begin_s=begin_s, end_s=end_s, span_s=(float(log.time_s[0]), float(log.time_s[-1])))


def touches_of_signals(time_s: FloatArray, signals: FloatArray, full_scale: float = np.inf) -> Touches:
    """Touches detected in the signals; the first half second must be untouched.

    Parameters
    ----------
    time_s : times of the frames in increasing order, shape (n,) [s]
    signals : signals of the frames, shape (n, emitters, receivers) [counts]
    full_scale : pairs whose untouched signal is this or more are not used [counts]
    """
    touched = _lasting(time_s, _touched(time_s, signals, full_scale))
    change = np.flatnonzero(touched[1:] != touched[:-1])
    between = (time_s[change] + time_s[change + 1]) / 2
    return Touches(
        begin_s=between[touched[change + 1]],
        end_s=between[~touched[change + 1]],
        span_s=(float(time_s[0]), float(time_s[-1])),
    )


def found_offset(signals: Touches, log: Touches) -> ClockMatch:
    """Find the clock offset at which the touches in the signals match those in the log.

    Raises
    ------
    InputError : there are too few touches, no offset matches, or several offsets match.
    """
    for name, touches in (("signals", signals), ("log", log)):
        if min(len(touches.begin_s), len(touches.end_s)) < LEAST_TOUCHES:
            raise InputError(
                f"clock offset not found: the {name} show {len(touches.begin_s)} touches, needs {LEAST_TOUCHES} with "
                "begin and end (and half a second of untouched pad first); give --offset"
            )
    good = [
        match for shift in _likely_shifts(signals, log) if (match := match_at(signals, log, shift)).is_good
    ]
    if not good:
        raise InputError(
            "clock offset not found: the touches of signals and log match at no shift; is it this recording's log, "
            "and are its times in the unit that the column name states? If so, give --offset"
        )
    best = min(good, key=lambda match: (round(-match.share, 1), match.spread_s))
    for other in good:
        if abs(other.offset_s - best.offset_s) > OUT_OF_STEP_S and other.rivals(best):
            raise InputError(
                f"clock offset ambiguous: the touches match at {best.offset_s:.2f} s and at "
                f"{other.offset_s:.2f} s; press once at an irregular interval, or give --offset"
            )
    return best


def match_at(signals: Touches, log: Touches, shift_s: float) -> ClockMatch:
    """Match the touches of signals and log near a given clock offset [s].

    Each start is paired with the nearest start, and each end with the nearest end, at most a second away.
    """
    kinds = ((signals.begin_s, log.begin_s + shift_s), (signals.end_s, log.end_s + shift_s))
    low = max(signals.span_s[0], log.span_s[0] + shift_s)
    high = min(signals.span_s[1], log.span_s[1] + shift_s)
    lags, medians, total = [], [], 0
    for seen, said in kinds:
        seen, said = (times[(times > low) & (times < high)] for times in (seen, said))
        total += max(len(seen), len(said))
        lag = _nearest(seen, said)
        if lag.size:
            medians.append(float(np.median(lag)))
            lags.append(np.asarray(lag - medians[-1]))
    if not lags:
        return ClockMatch(offset_s=shift_s, spread_s=np.inf, share=0.0, edges=total)
    scatter: FloatArray = np.concatenate(lags)
    return ClockMatch(
        offset_s=shift_s + float(np.mean(medians)),
        spread_s=1.4826 * float(np.median(np.abs(scatter))),
        share=len(scatter) / total,
        edges=total,
    )


def require_in_step(signals: Touches, log: Touches) -> ClockMatch:
    """Check that the touches of log and recording match without a clock offset, and return the match.

    Raises
    ------
    InputError : the touches do not match, or only with an offset above 0.3 s; the message says what to do.
    """
    found = match_at(signals, log, 0.0)
    if found.edges == 0 or (found.is_good and abs(found.offset_s) <= OUT_OF_STEP_S):
        return found
    raise InputError(
        f"{_why_out_of_step(signals, log, found)}; find the offset with --offset auto, or state it: "
        "--offset 0 takes the log unchanged"
    )


def _touched(time_s: FloatArray, signals: FloatArray, full_scale: float) -> Mask:
    """Whether the pad is touched in each frame, shape (n,).

    Half seconds without any touch update the untouched signals.
    """
    first = time_s < time_s[0] + BASELINE_S
    first[:LEAST_FRAMES] = True
    start = signals[first]
    pattern = GainPattern(start.mean(axis=0), np.maximum(start.std(axis=0), LEAST_NOISE_COUNTS), full_scale)
    untouched, touched = start.mean(axis=0).ravel(), np.zeros(len(signals), dtype=bool)
    blocks = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], BASELINE_S))
    for low, high in pairwise([*np.unique(blocks), len(signals)]):
        block = signals[low:high].reshape(high - low, -1)
        touched[low:high] = pattern.excess(relative_change(block, untouched)) > TOUCHED_EXCESS
        if high - low >= LEAST_FRAMES and not touched[low:high].any():
            untouched = (untouched + block.mean(axis=0)) / 2
    return touched


def _why_out_of_step(signals: Touches, log: Touches, found: ClockMatch) -> str:
    if found.is_good:
        return f"the log is out of step with the recording by {found.offset_s:+.2f} s"
    return (
        f"the log is out of step with the recording: its depth crosses 0 {len(log.begin_s) + len(log.end_s)} times, "
        f"the signals do {len(signals.begin_s) + len(signals.end_s)} times, and {found.share:.0%} of these match"
    )


def _lasting(time_s: FloatArray, touched: Mask) -> Mask:
    """Remove touches and pauses that are too short from `touched`, which says for each frame if the pad is touched."""
    lasting = touched.copy()
    for wanted in (False, True):  # pauses first: a touch with a flickering edge is one touch
        edges = [0, *(np.flatnonzero(lasting[1:] != lasting[:-1]) + 1), len(lasting)]
        for begin, end in pairwise(edges):
            is_inner = begin > 0 and end < len(lasting)
            if lasting[begin] == wanted and is_inner and time_s[end] - time_s[begin] < SHORTEST_S:
                lasting[begin:end] = not wanted
    return lasting


def _nearest(seen: FloatArray, said: FloatArray) -> FloatArray:
    """Times of the edges in `seen` minus the times of the nearest edges in `said` [s].

    Only edges that are each other's nearest, at most `WINDOW_S` apart, are included.
    """
    if not seen.size or not said.size:
        return np.zeros(0)
    lags = seen[:, None] - said[None]
    partner = np.abs(lags).argmin(axis=1)
    mutual = np.abs(lags).argmin(axis=0)[partner] == np.arange(len(seen))
    lag: FloatArray = lags[np.arange(len(seen)), partner]
    near: FloatArray = lag[mutual & (np.abs(lag) <= WINDOW_S)]
    return near


def _likely_shifts(signals: Touches, log: Touches) -> list[float]:
    """Clock offsets at which the touches of signals and log correlate best, the best first [s]."""
    seen, said = signals.course(STEP_S), log.course(STEP_S)
    agreement = _agreement(seen, said)
    lag = np.arange(len(agreement)) - (len(said) - 1)
    shifts: list[float] = []
    for k in np.argsort(agreement)[::-1]:
        if not np.isfinite(agreement[k]) or agreement[k] <= 0 or len(shifts) >= CANDIDATES:
            break
        shift = float(lag[k] * STEP_S + signals.span_s[0] - log.span_s[0])
        if all(abs(shift - other) > WINDOW_S / 2 for other in shifts):
            shifts.append(shift)
    return shifts


def _agreement(seen: FloatArray, said: FloatArray) -> FloatArray:
    """Correlation coefficient of two series of 0 and 1 at every shift; -inf at shifts with an overlap of less than half
    of the shorter series."""
    ones = np.ones(len(seen)), np.ones(len(said))
    n, both = _sums(ones[0], ones[1]), _sums(seen, said)
    a, b = _sums(seen, ones[1]), _sums(ones[0], said)
    variance = np.maximum(n * a - a**2, 0.0) * np.maximum(n * b - b**2, 0.0)
    is_telling = (n >= 0.5 * min(len(seen), len(said))) & (variance > 0.5)
    found: FloatArray = np.full(len(n), -np.inf)
    np.divide(n * both - a * b, np.sqrt(variance), out=found, where=is_telling)
    return found


def _sums(left: FloatArray, right: FloatArray) -> FloatArray:
    """Sum of products of two series at every shift, by Fourier transform, rounded to whole numbers."""
    size = len(left) + len(right) - 1
    length = 1 << (size - 1).bit_length()
    product = np.fft.rfft(left, length) * np.conj(np.fft.rfft(right, length))
    circular = np.fft.irfft(product, length)
    found: FloatArray = np.round(np.concatenate([circular[length - len(right) + 1 :], circular[: len(left)]]))
    return found


LATE_S = 0.05
"""A frame counts as delayed if its delay exceeds the shortest delay of frames near it by more than this [s].

Such delays occur when the computer is busy or asleep.
"""

LAG_S = 2.0
"""Length of the time intervals in each of which the shortest delay of a frame is determined [s].

Over two intervals, a clock error of 0.5 % changes the delay by 20 ms.
"""

Offset = float | Literal["auto"] | None
"""Clock offset: clock of the recording's computer minus the log's clock [s]. With "auto", the offset is found from the
touches. None means that both use the same clock, which is checked."""


@dataclass(frozen=True, kw_only=True)
class JoinedLog:
    """A recording whose frames have positions from a stage's log.

    Attributes
    ----------
    recorded : the frames with a known position
    offset_s : clock offset that was used: clock of the recording's computer minus the log's clock [s]
    match : match of the touches in recording and log, near that offset
    left_out : number of frames without a known position
    """

    recorded: Recorded
    offset_s: float
    match: ClockMatch
    left_out: int


def joined(recorded: Recorded, log: PositionLog, offset: Offset = None) -> JoinedLog:
    """Give every frame of a recording the tip's position in a stage's log at the frame's time.

    Raises
    ------
    InputError : recording and log do not overlap in time, their touches do not match, or the clock offset cannot be
        found or is ambiguous.
    """
    require_rising(recorded.host_s)
    host_s = measured_s(recorded.host_s, recorded.device_s, recorded.connection)
    said = descriptor_of(recorded.config)
    seen = touches_of_signals(host_s, recorded.signals, 0.98 * said.full_scale)
    logged = touches_of_log(log)
    if offset == "auto":
        match = found_offset(seen, logged)
        offset_s = match.offset_s
    else:
        offset_s = float(offset or 0.0)
        _require_overlap(recorded, log, offset_s)
        match = require_in_step(seen, logged) if offset is None else match_at(seen, logged, offset_s)
    labels, known = log.labels_at(host_s - offset_s)
    if not known.any():
        raise InputError(
            f"{log.file}: of {len(host_s)} frames none has a known position: {_spans(recorded, log, offset_s)}"
        )
    whole = replace(recorded, labels=labels)
    return JoinedLog(
        recorded=whole.only(known), offset_s=offset_s, match=match, left_out=int(np.count_nonzero(~known))
    )


def measured_s(host_s: FloatArray, device_s: FloatArray, connection: IntArray) -> FloatArray:
    """Arrival time of each frame by the host's clock, never decreasing, shape (n,) [s].

    For frames that had to wait because the host was busy, the time is derived from the board's clock. Frames that were
    read together have the same time.

    Parameters
    ----------
    host_s : host's time of arrival of each frame, never decreasing, shape (n,) [s]
    device_s, connection : board's time [s] and connection number of each frame, shape (n,); the board's clock starts
        anew where the number changes, or where it goes back
    """
    late_s = np.zeros(len(host_s))
    anew = 1 + np.flatnonzero((np.diff(connection) != 0) | (np.diff(device_s) < 0.0))
    for begin, end in pairwise([0, *anew.tolist(), len(host_s)]):
        own_s = device_s[begin:end]
        lag_s, block = host_s[begin:end] - own_s, ((own_s - own_s[0]) // LAG_S).astype(np.int64)
        least_s = np.full(block.max() + 3, np.inf)
        np.minimum.at(least_s, block + 1, lag_s)
        near_s = np.minimum(np.minimum(least_s[:-2], least_s[1:-1]), least_s[2:])
        late_s[begin:end] = lag_s - near_s[block]
    found: FloatArray = np.maximum.accumulate(host_s - np.where(late_s > LATE_S, late_s, 0.0))
    return found


def _require_overlap(recorded: Recorded, log: PositionLog, offset_s: float) -> None:
    first, last = log.time_s[[0, -1]] + offset_s
    if last < recorded.host_s.min() or first > recorded.host_s.max():
        raise InputError(
            f"{log.file}: no time in common with the recording: {_spans(recorded, log, offset_s)}; is it "
            "another run's log, or another clock? Find the offset with --offset auto, or give it"
        )


def _spans(recorded: Recorded, log: PositionLog, offset_s: float) -> str:
    begun = recorded.host_s.min()
    first, last = log.time_s[[0, -1]] + offset_s - begun
    ends = f"frames from 0 to {recorded.host_s.max() - begun:.1f} s of the recording"
    return f"{ends}, the log from {first:.1f} to {last:.1f} s"
