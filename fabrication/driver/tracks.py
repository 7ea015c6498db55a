"""Numbers the touches of successive frames, so that a finger keeps its number while it touches.

Where a touch is expected
-------------------------
The frames of a track in the last `LINE_S`, and four at least, give a straight line for each of x, y and depth. With the
weights w = 1 / (σ² + `LEAST_SIGMA_MM`²), the weighted means t̄ and p̄, and speeds that are normally distributed with
`SPEED_MM_S` before anything is known,

    v = Σ w (t - t̄)(p - p̄) / (Σ w (t - t̄)² + 1 / `SPEED_MM_S`²),      expected place at t: p̄ + v (t - t̄).

Which touch it is
-----------------
Touches p_k of a frame are assigned to tracks i so that as many as possible continue a track, and then with the least

    Σ d²,   d² = Σ over x, y, depth of (p_k - expected_i)² / (σ_k² + `LEAST_SIGMA_MM`²).

The scale is the touch's, not the track's, so that a track of unknown place does not attract touches. A touch is not
assigned to a track that is farther away than a finger moves; it gets a new number, and no number is used twice.

When a touch is missing
-----------------------
A track ends when it is missing for `LOST_S` and three frames. A touch that ends becomes shallow before. One that is
expected at a depth above `LIFTED_MM` has merged with another touch, if there is another: two fingers pass each other
more closely than the model can resolve. Then the track is kept for `MERGED_S`, and is expected where it was going. The
touch that is left keeps one of the two numbers meanwhile. If it is not where its own track is expected, it is between
both, and changes neither line.

Left out: fingers that turn or stop while they are merged may exchange their numbers.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from optopad.design.arrays import FloatArray

LINE_S, FEWEST_FRAMES = 0.1, 4
LEAST_SIGMA_MM = 0.3
"""Standard deviation that is added to the touch's own: fingers do not move on straight lines [mm]."""
SPEED_MM_S = 50.0
REACH_MM, FASTEST_MM_S = 5.0, 300.0
"""Largest distance of a touch from its track along x and y: a constant, and speed by the time without the touch."""
LOST_S, LOST_FRAMES = 0.05, 3
LIFTED_MM, MERGED_S = 0.2, 0.5
CLEAR = 3.0
"""Largest distance d, along x and y, at which the touch that is left is that of its own track alone [-]."""


@dataclass(eq=False)
class _Track:
    number: int
    seen_s: float
    place_mm: FloatArray
    frames: deque[tuple[float, FloatArray, FloatArray]] = field(default_factory=deque)

    def add(self, time_s: float, place_mm: FloatArray, weight: FloatArray) -> None:
        self.frames.append((time_s, place_mm, weight))
        while len(self.frames) > FEWEST_FRAMES and time_s - self.frames[0][0] > LINE_S:
            self.frames.popleft()

    def expected_mm(self, time_s: float) -> FloatArray:
        """Place at a time on the line through the last frames: x, y, depth [mm]."""
        times, places, weights = (np.array(column) for column in zip(*self.frames, strict=True))
        whole = weights.sum(axis=0)
        mean_s, mean_mm = weights.T @ times / whole, (weights * places).sum(axis=0) / whole
        since_s = times[:, None] - mean_s
        square = (weights * since_s**2).sum(axis=0) + SPEED_MM_S**-2
        speed = (weights * since_s * (places - mean_mm)).sum(axis=0) / square
        return np.asarray(mean_mm + speed * (time_s - mean_s))


class Tracks:
    """The touches that are followed from frame to frame; numbers count up from 1."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []
        self._latest = 0
        self._time_s, self._period_s = -math.inf, 0.0
        self._left: int | None = None
        """Number of the only touch of the frame before; None if it had none or several."""

    def follow(self, time_s: float, place_mm: FloatArray, sigma_mm: FloatArray) -> tuple[int, ...]:
        """Numbers of the touches of the next frame.

        Parameters
        ----------
        time_s : time of the frame by a clock that never goes back, such as the board's [s]
        place_mm : (touch, 3) x, y and depth of the frame's touches; none for an untouched pad [mm]
        sigma_mm : (touch, 3) their standard deviations, NaN where unknown [mm]
        """
        step_s, self._time_s = time_s - self._time_s, time_s
        lost_s = max(LOST_S, LOST_FRAMES * (self._period_s or step_s))
        self._period_s = step_s if math.isfinite(step_s) else 0.0
        expected = {track: track.expected_mm(time_s) for track in self._tracks}
        expected = {
            track: place
            for track, place in expected.items()
            if (missing_s := time_s - track.seen_s) <= lost_s
            or (len(place_mm) and missing_s < MERGED_S and place[2] > LIFTED_MM)
        }
        weight = 1.0 / (np.nan_to_num(sigma_mm, posinf=REACH_MM) ** 2 + LEAST_SIGMA_MM**2)
        found = self._assigned(time_s, place_mm, weight, expected, lost_s)
        for k, track in enumerate(found):
            if track is None:
                self._latest += 1
                found[k] = track = _Track(self._latest, time_s, place_mm[k])
                track.add(time_s, place_mm[k], weight[k])
            elif (
                len(found) > 1
                or len(expected) == 1
                or self._is_clear(place_mm[k], expected[track], weight[k])
            ):
                track.add(time_s, place_mm[k], weight[k])
            track.seen_s, track.place_mm = time_s, place_mm[k]
        followed = [track for track in found if track is not None]
        self._tracks = [*followed, *(track for track in expected if track not in followed)]
        numbers = tuple(track.number for track in followed)
        self._left = numbers[0] if len(numbers) == 1 else None
        return numbers

    def _assigned(
        self,
        time_s: float,
        place_mm: FloatArray,
        weight: FloatArray,
        expected: dict[_Track, FloatArray],
        lost_s: float,
    ) -> list[_Track | None]:
        """The track of each touch; None for a new one."""
        options: list[list[tuple[_Track | None, float]]] = []
        for one_mm, weights in zip(place_mm, weight, strict=True):
            near: list[tuple[_Track | None, float]] = [(None, 0.0)]
            for track, at_mm in expected.items():
                reach_mm = REACH_MM + FASTEST_MM_S * min(time_s - track.seen_s, lost_s)
                if min(math.dist(one_mm[:2], at[:2]) for at in (at_mm, track.place_mm)) <= reach_mm:
                    near.append((track, float(weights @ (one_mm - at_mm) ** 2)))
            kept = [one for one in near if one[0] is not None and one[0].number == self._left]
            options.append(kept if kept and len(place_mm) == 1 else near)
        best: tuple[int, float] = (len(options) + 1, 0.0)
        chosen: list[_Track | None] = []
        for choice in itertools.product(*options):
            tracks = [track for track, _ in choice if track is not None]
            cost = len(choice) - len(tracks), sum(square for _, square in choice)
            if len(set(tracks)) == len(tracks) and cost < best:
                best, chosen = cost, [track for track, _ in choice]
        return chosen

    @staticmethod
    def _is_clear(place_mm: FloatArray, expected_mm: FloatArray, weight: FloatArray) -> bool:
        return float(weight[:2] @ (place_mm - expected_mm)[:2] ** 2) < CLEAR**2
