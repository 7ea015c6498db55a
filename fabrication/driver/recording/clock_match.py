"""Offset between the clocks of a stage's log and a recording, from the touches in both.

The signals show touches. The first half second, which must be untouched, gives the untouched pattern and its noise.
Later half seconds without a touch renew the pattern, so that drift does not count as touch. A frame is touched if the
rest of its change, less the gains of emitters and receivers (`gain_pattern`), is far above the noise. In the log a
touch begins and ends where the depth crosses 0.

The two courses of touched and untouched are correlated over every shift at which half of the shorter one overlaps. The
best shifts are then refined on edges: each edge of the signals is compared with the log's nearest of the same kind. The
offset is the mean of the medians of the two kinds. A touch is detected slightly below the surface, late on the way in
and early on the way out: with the tip equally fast both ways the mean of the two has no such error.

The match is refused for too few edges, for edges that do not match, and for several matching shifts. A stage that
repeats one rhythm exactly gives the same pattern one press later, which cannot be distinguished.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.errors import InputError
from fabrication.driver.gain_pattern import GainPattern, relative_change
from fabrication.driver.recording.position_log import PositionLog

Mask = BoolArray

STEP_S = 0.02
"""Grid of the correlation."""

BASELINE_S = 0.5
TOUCHED_EXCESS = 6.0
"""A frame is touched if the mean square of its change's rest is above this multiple of the noise's."""

LEAST_FRAMES = 5
LEAST_NOISE_COUNTS = 0.5
SHORTEST_S = 0.1
"""Shorter touches and pauses are noise of single frames."""

LEAST_TOUCHES = 2
WINDOW_S = 1.0
"""Edges of signals and log further apart than this are not the same edge."""

LEAST_SHARE = 0.8
LARGEST_SPREAD_S = 0.15
SHARE_MARGIN = 0.1
SPREAD_MARGIN_S = 0.05
OUT_OF_STEP_S = 0.3
CANDIDATES = 8


@dataclass(frozen=True, kw_only=True)
class ClockMatch:
    """Match of two clocks.

    Attributes
    ----------
    offset_s : the recording's clock less the log's [s]
    spread_s : scatter of single edges, as a standard deviation [s]
    share : edges of one with a partner in the other, over all edges in their common time [-]
    edges : number of compared edges
    """

    offset_s: float
    spread_s: float
    share: float
    edges: int

    @property
    def is_good(self) -> bool:
        """Whether the edges match."""
        return self.share >= LEAST_SHARE and self.spread_s <= LARGEST_SPREAD_S

    def rivals(self, best: ClockMatch) -> bool:
        """Whether it is nearly as good as the best one, so that the match is ambiguous."""
        return self.share > best.share - SHARE_MARGIN and self.spread_s < max(
            3 * best.spread_s, SPREAD_MARGIN_S
        )


@dataclass(frozen=True, kw_only=True)
class Touches:
    """Times when touches begin and end, within a span of time [s]."""

    begin_s: FloatArray
    end_s: FloatArray
    span_s: tuple[float, float]

    def course(self, step_s: float) -> FloatArray:
        """(n,) 1 where touched, 0 where not, on a grid from the span's start."""
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
    """Touches by the log's depth."""
    begin_s, end_s = log.crossings_s()
    return Touches(begin_s=begin_s, end_s=end_s, span_s=(float(log.time_s[0]), float(log.time_s[-1])))


def touches_of_signals(time_s: FloatArray, signals: FloatArray, full_scale: float = np.inf) -> Touches:
    """Touches by the signals, (time, emitter, receiver) [counts]; the first half second must be untouched."""
    touched = _lasting(time_s, _touched(time_s, signals, full_scale))
    change = np.flatnonzero(touched[1:] != touched[:-1])
    between = (time_s[change] + time_s[change + 1]) / 2
    return Touches(
        begin_s=between[touched[change + 1]],
        end_s=between[~touched[change + 1]],
        span_s=(float(time_s[0]), float(time_s[-1])),
    )


def found_offset(signals: Touches, log: Touches) -> ClockMatch:
    """The offset at which the touches of signals and log match.

    Raises
    ------
    InputError : too few touches, no matching offset, or several.
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
    """Match of the edges near one offset [s]: each with the nearest of its kind within a second."""
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
    """Refuse a log that should have the recording's own clock and is not in step with it.

    Raises
    ------
    InputError : the edges of signals and log do not match, or only more than 0.3 s apart; with the way out.
    """
    found = match_at(signals, log, 0.0)
    if found.edges == 0 or (found.is_good and abs(found.offset_s) <= OUT_OF_STEP_S):
        return found
    raise InputError(
        f"{_why_out_of_step(signals, log, found)}; find the offset with --offset auto, or state it: "
        "--offset 0 takes the log unchanged"
    )


def _touched(time_s: FloatArray, signals: FloatArray, full_scale: float) -> Mask:
    """(time,) whether each frame is touched; half seconds without any touch renew the untouched level."""
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
    """Touches and pauses without those that are too short."""
    lasting = touched.copy()
    for wanted in (False, True):  # pauses first: a touch with a flickering edge is one touch
        edges = [0, *(np.flatnonzero(lasting[1:] != lasting[:-1]) + 1), len(lasting)]
        for begin, end in pairwise(edges):
            is_inner = begin > 0 and end < len(lasting)
            if lasting[begin] == wanted and is_inner and time_s[end] - time_s[begin] < SHORTEST_S:
                lasting[begin:end] = not wanted
    return lasting


def _nearest(seen: FloatArray, said: FloatArray) -> FloatArray:
    """Lags of each edge to the nearest of the other list within the window, each partner once."""
    if not seen.size or not said.size:
        return np.zeros(0)
    lags = seen[:, None] - said[None]
    partner = np.abs(lags).argmin(axis=1)
    mutual = np.abs(lags).argmin(axis=0)[partner] == np.arange(len(seen))
    lag: FloatArray = lags[np.arange(len(seen)), partner]
    near: FloatArray = lag[mutual & (np.abs(lag) <= WINDOW_S)]
    return near


def _likely_shifts(signals: Touches, log: Touches) -> list[float]:
    """Offsets at which the two courses agree best, the best first [s]."""
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
    """Correlation coefficient of two courses of 0 and 1 at every shift; -inf where less than half overlaps."""
    ones = np.ones(len(seen)), np.ones(len(said))
    n, both = _sums(ones[0], ones[1]), _sums(seen, said)
    a, b = _sums(seen, ones[1]), _sums(ones[0], said)
    variance = np.maximum(n * a - a**2, 0.0) * np.maximum(n * b - b**2, 0.0)
    is_telling = (n >= 0.5 * min(len(seen), len(said))) & (variance > 0.5)
    found: FloatArray = np.full(len(n), -np.inf)
    np.divide(n * both - a * b, np.sqrt(variance), out=found, where=is_telling)
    return found


def _sums(left: FloatArray, right: FloatArray) -> FloatArray:
    """Sums of products of two courses at every shift, by Fourier transform, as whole numbers."""
    size = len(left) + len(right) - 1
    length = 1 << (size - 1).bit_length()
    product = np.fft.rfft(left, length) * np.conj(np.fft.rfft(right, length))
    circular = np.fft.irfft(product, length)
    found: FloatArray = np.round(np.concatenate([circular[length - len(right) + 1 :], circular[: len(left)]]))
    return found
