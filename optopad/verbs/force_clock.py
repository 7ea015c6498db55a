"""Matches the clock of a load cell's log to that of a recording, from the touches in both.

A touch in the log is where the force is above its baseline. The baseline follows the tare's drift: it is the opening of
the force (a running least value, then a running largest one) over a time longer than any press. The baseline and the
threshold shift begin and end of a touch by some tens of milliseconds, and by more if the tip retracts at another speed
than it approaches. So this match is only the first estimate: `optopad.sims.learning.force_fit` fits offset and rate
with the force.

If the clocks run at different rates, the match is tried at rates up to `LARGEST_RATE`, and a straight line through the
lags of all begins and ends gives the rate. Left out: clocks that are set during the recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.recording.force_log import ForceLog
from optopad.fabrication.driver.recording.joined_log import (
    OUT_OF_STEP_S,
    WINDOW_S,
    ClockMatch,
    Offset,
    Touches,
    found_offset,
    match_at,
)
from optopad.sims.learning.press_force import TipPath

TOUCHED_SHARE, TOUCHED_SIGMAS = 0.02, 8.0
"""A touch is above this share of the largest force, and above this many standard deviations of the noise [-]."""
LONGER, LONGER_S = 1.2, 0.5
"""The opening is longer than the longest press by this factor and this time [-, s]."""
LARGEST_RATE = 0.015
"""Largest difference of the two clocks' rates that is searched [-]."""
RATE_LAG_S = 0.2
"""Lag that two neighbouring rates of the search differ by over the span of the search [s]."""
SEARCHED_S = 400.0
"""The rate is first found from presses of this span [s]."""
LEAST_LAGS = 6


@dataclass(frozen=True, kw_only=True)
class ForceClock:
    """Time by the recording's clock of a log's time T: T + offset_s + rate (T - pivot_s) [s]."""

    offset_s: float
    rate: float = 0.0
    pivot_s: float = 0.0

    def at(self, log_s: FloatArray) -> FloatArray:
        """Times by the recording's clock [s] of times by the log's [s]."""
        found: FloatArray = log_s + self.offset_s + self.rate * (log_s - self.pivot_s)
        return found


def force_clock(path: TipPath, log: ForceLog, offset: Offset) -> ForceClock:
    """Clock of a load cell's log, found or as it is given.

    Raises
    ------
    InputError : log and recording have no time in common, or their presses do not match; with the cause if it is known.
    """
    begin_s, end_s = path.touches_s
    pressed = Touches(begin_s=begin_s, end_s=end_s, span_s=(float(path.time_s[0]), float(path.time_s[-1])))
    forces = touches_of_force(log.time_s, log.force_n, _longest_s(pressed))
    if offset == "auto":
        return _found(pressed, forces, log)
    shift = float(offset or 0.0)
    first, last = forces.span_s
    begin, end = pressed.span_s
    if last + shift < begin or first + shift > end:
        raise InputError(
            f"{log.file}: no time in common with the recording: the presses last from 0 to {end - begin:.1f} s, "
            f"the log from {first + shift - begin:.1f} to {last + shift - begin:.1f} s; is it another run's log, or "
            "another clock? Find the offset with --offset auto, or give it"
        )
    match = match_at(pressed, forces, shift)
    if offset is None and match.edges and not (match.is_good and abs(match.offset_s) <= OUT_OF_STEP_S):
        _require_sign(pressed, log, shift)
        raise InputError(
            f"{log.file}: is out of step with the recording: {match.share:.0%} of {match.edges} begins and ends of "
            f"presses match, {match.offset_s:+.2f} s late; find the offset with --offset auto, or state it: --offset 0 "
            "takes the log unchanged"
        )
    return ForceClock(offset_s=shift)


def touches_of_force(time_s: FloatArray, force_n: FloatArray, longest_s: float) -> Touches:
    """Touches in a force log: where the force is above its baseline.

    Parameters
    ----------
    time_s, force_n : (n,) times in increasing order [s], and force, positive when pressed [N]
    longest_s : duration of the longest press [s]
    """
    step_s = float(np.median(np.diff(time_s)))
    grid = np.arange(time_s[0], time_s[-1], max(step_s, (time_s[-1] - time_s[0]) / 1e6))
    window = int((LONGER * longest_s + LONGER_S) / step_s) + 1
    half = min(window, len(grid)) // 2
    baseline = -_running_least(-_running_least(np.interp(grid, time_s, force_n), half), half)
    above = force_n - np.interp(time_s, grid, baseline)
    above -= np.quantile(above, 0.1)
    noise = 1.4826 * float(np.median(np.abs(np.diff(force_n)))) / np.sqrt(2.0)
    level = max(TOUCHED_SHARE * float(above.max()), min(TOUCHED_SIGMAS * noise, 0.5 * float(above.max())))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], above > level / 2, [False]]).astype(np.int8)))
    parts = [(begin, end) for begin, end in edges.reshape(-1, 2) if above[begin:end].max() > level]
    begins = [_crossing_s(time_s, above, begin - 1, level / 2) for begin, _ in parts if begin > 0]
    ends = [_crossing_s(time_s, above, end - 1, level / 2) for _, end in parts if end < len(above)]
    return Touches(
        begin_s=np.array(begins), end_s=np.array(ends), span_s=(float(time_s[0]), float(time_s[-1]))
    )


def _running_least(values: FloatArray, half: int) -> FloatArray:
    """(n,) least of the values within `half` places on either side, by spans that double."""
    size, span, least = 2 * half + 1, 1, np.pad(values, half, mode="edge")
    while 2 * span <= size:
        least, span = np.minimum(least[:-span], least[span:]), 2 * span
    rest = size - span
    return np.minimum(least[: len(least) - rest], least[rest:])


def _crossing_s(time_s: FloatArray, values: FloatArray, k: int, level: float) -> float:
    share = (level - values[k]) / (values[k + 1] - values[k])
    return float(time_s[k] + share * (time_s[k + 1] - time_s[k]))


def _longest_s(touches: Touches) -> float:
    after = np.searchsorted(touches.end_s, touches.begin_s)
    inside = after < len(touches.end_s)
    spans = touches.end_s[after[inside]] - touches.begin_s[inside]
    return float(spans.max()) if spans.size else LONGER_S


def _require_sign(pressed: Touches, log: ForceLog, shift: float | None) -> None:
    """Refuse a log whose negated force matches the presses: at a shift [s], or at any if it is None."""
    negated = touches_of_force(log.time_s, -log.force_n, _longest_s(pressed))
    if shift is None:
        matches = _at_other_rates(pressed, negated) is not None
    else:
        matches = match_at(pressed, negated, shift).is_good
    if matches:
        raise InputError(
            f"{log.file}: the force is negative when the tip presses, as only the negated log matches the presses; it "
            "must be positive: negate the column"
        )


def _found(pressed: Touches, forces: Touches, log: ForceLog) -> ForceClock:
    try:
        return _lined_up(pressed, forces, 0.0, found_offset(pressed, forces))
    except InputError as err:
        found = _at_other_rates(pressed, forces)
        if found is None:
            _require_sign(pressed, log, None)
            raise InputError(f"{log.file}: {err}") from err
        return found


def _at_other_rates(pressed: Touches, forces: Touches) -> ForceClock | None:
    """The clock at the rate whose match is best, 0 among them; None if none matches."""
    part = _first(pressed, SEARCHED_S)
    span_s = min(part.span_s[1] - part.span_s[0], forces.span_s[1] - forces.span_s[0])
    step = RATE_LAG_S / span_s
    count = int(LARGEST_RATE / step)
    found: list[tuple[float, ClockMatch]] = []
    for rate in step * np.arange(-count, count + 1):
        try:
            found.append((float(rate), found_offset(part, _stretched(forces, float(rate)))))
        except InputError:
            continue
    if not found:
        return None
    rate, match = min(found, key=lambda one: (round(-one[1].share, 1), one[1].spread_s))
    return _lined_up(pressed, forces, rate, match)


def _first(touches: Touches, span_s: float) -> Touches:
    last = min(touches.span_s[0] + span_s, touches.span_s[1])
    return replace(
        touches,
        begin_s=touches.begin_s[touches.begin_s < last],
        end_s=touches.end_s[touches.end_s < last],
        span_s=(touches.span_s[0], last),
    )


def _stretched(touches: Touches, rate: float) -> Touches:
    """Touches by a clock that is faster by a rate [-], from the beginning of their span on."""
    first = touches.span_s[0]
    begin, end, span = (
        first + (1.0 + rate) * (np.asarray(times) - first)
        for times in (touches.begin_s, touches.end_s, touches.span_s)
    )
    return Touches(begin_s=begin, end_s=end, span_s=(float(span[0]), float(span[1])))


def _lined_up(pressed: Touches, forces: Touches, rate: float, match: ClockMatch) -> ForceClock:
    """The clock after a straight line through the lags of begins and ends, over ever longer spans."""
    pivot, offset = forces.span_s[0], match.offset_s
    span_s = SEARCHED_S
    while True:
        clock = ForceClock(offset_s=offset, rate=rate, pivot_s=pivot)
        change = _line(pressed, forces, clock, span_s)
        offset, rate = offset + change[0], rate + change[1]
        if span_s >= forces.span_s[1] - forces.span_s[0]:
            return ForceClock(offset_s=offset, rate=rate, pivot_s=pivot)
        span_s *= 2.0


def _line(pressed: Touches, forces: Touches, clock: ForceClock, span_s: float) -> tuple[float, float]:
    """Changes of offset [s] and rate [-] that the lags within a span from the first common touch on ask for."""
    first = max(pressed.span_s[0], float(clock.at(np.array([forces.span_s[0]]))[0]))
    rows, lags = [], []
    for kind, (seen, said) in enumerate(((pressed.begin_s, forces.begin_s), (pressed.end_s, forces.end_s))):
        if not seen.size or not said.size:
            continue
        lag = seen - clock.at(said)[:, None]
        nearest = np.abs(lag).argmin(axis=1)
        lag = lag[np.arange(len(said)), nearest]
        near = (np.abs(lag) < WINDOW_S) & (seen[nearest] < first + span_s)
        rows.append(
            np.stack(
                [np.full(near.sum(), kind == 0), np.full(near.sum(), kind == 1), said[near] - clock.pivot_s],
                1,
            )
        )
        lags.append(lag[near])
    matrix, lag = np.concatenate([*rows, np.zeros((0, 3))]), np.concatenate([*lags, np.zeros(0)])
    kept = np.ones(len(lag), dtype=bool)
    found = np.zeros(3)
    for _ in range(3):
        if kept.sum() < LEAST_LAGS:
            return 0.0, 0.0
        found = np.linalg.lstsq(matrix[kept], lag[kept], rcond=None)[0]
        rest = np.abs(lag - matrix @ found)
        kept = rest <= 3.0 * 1.4826 * np.median(rest[kept]) + 1e-6
    return float(found[:2].mean()), float(found[2])
