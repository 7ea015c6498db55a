"""Numbers of touches from frame to frame, on frames that are computed from known paths of fingers."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from optopad.fabrication.driver.tracks import Tracks

RATE_HZ = 60.0
SIGMA_MM = 0.15


def crossing(apart_mm: float, speed_mm_s: float, turned: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and places (n, 2, 3) [mm] of two fingers on parallel strokes against each other."""
    time_s = np.arange(int(20.0 / speed_mm_s * RATE_HZ)) / RATE_HZ
    along = speed_mm_s * time_s - 10.0
    across = np.full_like(along, apart_mm / 2)
    cos, sin = np.cos(turned), np.sin(turned)
    one = np.stack([cos * along - sin * across, sin * along + cos * across, np.full_like(along, 1.0)], axis=1)
    return time_s, 16.0 + np.stack([one, -one], axis=1) * [1, 1, 0] + np.array([[0, 0, -15.0], [0, 0, -14.5]])


def numbered(
    time_s: np.ndarray, places: Iterable[np.ndarray], tracks: Tracks | None = None
) -> list[tuple[int, ...]]:
    tracks = tracks or Tracks()
    return [
        tracks.follow(float(t), one, np.full_like(one, SIGMA_MM))
        for t, one in zip(time_s, places, strict=True)
    ]


@pytest.mark.parametrize("speed_mm_s", [5.0, 20.0, 60.0])
@pytest.mark.parametrize("turned", [0.0, 0.6, 1.5])
def test_fingers_that_pass_each_other_keep_their_numbers_in_any_order_of_the_touches(
    speed_mm_s: float, turned: float
) -> None:
    rng = np.random.default_rng(3)
    time_s, places = crossing(2.0, speed_mm_s, turned)
    order = rng.random(len(time_s)) < 0.5
    noisy = places + rng.normal(0.0, SIGMA_MM, places.shape)
    mixed = [one[::-1] if flip else one for one, flip in zip(noisy, order, strict=True)]
    numbers = numbered(time_s, mixed)
    assert {one[::-1] if flip else one for one, flip in zip(numbers[1:], order[1:], strict=True)} in (
        {(1, 2)},
        {(2, 1)},
    )


@pytest.mark.parametrize("speed_mm_s", [15.0, 40.0])
@pytest.mark.parametrize("share", [0.5, 0.2])
def test_touches_that_merge_while_they_pass_get_their_numbers_back(speed_mm_s: float, share: float) -> None:
    """Nearer than 7 mm, one touch is seen between both; fingers pass at 5 mm."""
    rng = np.random.default_rng(4)
    time_s, places = crossing(5.0, speed_mm_s)
    places = places + rng.normal(0.0, SIGMA_MM, places.shape)
    is_one = np.linalg.norm(places[:, 0, :2] - places[:, 1, :2], axis=1) < 7.0
    assert 5 < is_one.sum() < len(time_s) - 10
    between = share * places[:, 0] + (1.0 - share) * places[:, 1]
    seen = [between[k][None] if is_one[k] else places[k] for k in range(len(time_s))]
    numbers = numbered(time_s, seen)
    assert {one for one in numbers if len(one) == 2} == {(1, 2)}
    assert len({one for one in numbers if len(one) == 1}) == 1  # it keeps one of both numbers


def test_a_finger_that_lifts_and_presses_again_is_a_new_touch_and_the_other_keeps_its_number() -> None:
    depth = np.concatenate([np.linspace(1.0, 0.0, 20), np.zeros(20), np.linspace(0.0, 1.0, 20)])
    held, moved = np.array([10.0, 16.0, 1.0]), np.array([22.0, 16.0])
    seen = [np.array([held, (*moved, one)]) if one > 0.1 else held[None] for one in depth]
    numbers = numbered(np.arange(60) / RATE_HZ, seen)
    assert numbers[0] == (1, 2)
    assert numbers[30] == (1,)
    assert numbers[-1] == (1, 3)


def test_numbers_count_up_and_a_frame_without_the_touch_is_no_end() -> None:
    tracks, here = Tracks(), np.array([[10.0, 10.0, 1.0]])
    none = np.zeros((0, 3))
    time_s = np.arange(40) / RATE_HZ
    seen = [here if k != 5 and (k < 10 or k > 20) else none for k in range(40)]
    numbers = numbered(time_s, seen, tracks)
    assert numbers[4] == numbers[6] == (1,)
    assert numbers[5] == numbers[15] == ()
    assert numbers[-1] == (2,)
    there = here + np.array([14.0, 0.0, 0.0])  # farther than a finger moves
    assert tracks.follow(40 / RATE_HZ, there, np.full((1, 3), np.nan)) == (3,)


def test_a_finger_that_starts_at_once_keeps_its_number() -> None:
    time_s = np.arange(60) / 200.0
    x_mm = 8.0 + np.where(time_s > 0.1, 250.0 * (time_s - 0.1), 0.0)
    seen = np.stack([x_mm, np.full(60, 16.0), np.ones(60)], axis=1)[:, None]
    assert set(numbered(time_s, seen)) == {(1,)}
