"""The model of the force under a recorded press, against closed forms and Ting's solution."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.contact.load_protocol import StandardLinearSolid, viscoelastic_load_n
from optopad.sims.learning.press_force import (
    EXCESS,
    LOG_TIME,
    TABLE_MM,
    TING,
    UNKNOWNS,
    PressWindow,
    TipPath,
    force_at,
    relaxing_part,
    smoothed,
    spans,
)
from tests.sims.contact.test_viscoelastic import ting_load, triangle


def hertz_window(time_s: np.ndarray, depth_mm: np.ndarray) -> PressWindow:
    """A press whose elastic force is depth^1.5 N."""
    return PressWindow(
        node_s=time_s,
        node_mm=depth_mm,
        rounded_mm=depth_mm,
        turn=int(np.argmax(depth_mm)),
        table_n=np.arange(0.0, 1.5, TABLE_MM) ** 1.5,
        time_s=time_s,
        force_n=np.zeros(len(time_s)),
        rests=(0, 0),
        used=np.ones(len(time_s), dtype=bool),
    )


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_the_retraction_is_tings_solution_or_that_of_an_elastic_contact(share: float) -> None:
    solid = StandardLinearSolid(relaxed_share=share, time_constant_s=1.0)
    time_s, depth_mm = triangle(1.0, 1.0, samples=200)
    window, unknowns = hertz_window(time_s, depth_mm), np.zeros(UNKNOWNS)
    unknowns[[EXCESS, LOG_TIME, TING]] = solid.excess, 0.0, 1.0
    expected = ting_load(time_s[::20], solid)
    found = force_at(window, unknowns, 0.0)
    np.testing.assert_allclose(found[::20], expected, atol=1e-4 * expected.max())  # steps of 5 ms
    unknowns[TING] = 0.0
    elastic = np.maximum(viscoelastic_load_n(time_s, depth_mm**1.5, solid), 0.0)
    np.testing.assert_allclose(force_at(window, unknowns, 0.0), elastic, atol=1e-4 * elastic.max())


def test_the_relaxing_part_is_that_of_the_load_protocol_over_any_span() -> None:
    time_s = np.cumsum(np.random.default_rng(0).uniform(0.0, 0.2, 2000))
    load = 1.0 - np.cos(time_s)
    for tau in (0.01, 0.05, 3.0):  # exp(span/τ) overflows for the first
        solid = StandardLinearSolid(relaxed_share=0.5, time_constant_s=tau)
        expected = viscoelastic_load_n(time_s, load, solid) - load
        first = load[0] * np.exp(-(time_s - time_s[0]) / tau)  # the window starts at rest
        np.testing.assert_allclose(relaxing_part(time_s / tau, load), expected - first, atol=1e-9)


def test_noise_of_the_depth_is_smoothed_and_its_corners_stay() -> None:
    time_s = np.arange(0.0, 4.0, 0.005)
    depth = np.interp(time_s, [0.0, 1.0, 2.0, 3.0, 4.0], [-1.0, -1.0, 2.0, 2.0, -1.0])
    noisy = depth + 0.002 * np.random.default_rng(0).standard_normal(len(depth))
    off = smoothed(time_s, noisy) - depth
    assert off.std() < 0.6 * 0.002
    assert np.abs(off).max() < 0.008
    np.testing.assert_array_equal(smoothed(time_s, depth), depth)


def test_flicker_of_the_depth_near_zero_does_not_divide_a_press() -> None:
    depth = np.array([-1.0, 0.001, -0.001, 0.002, 1.0, 1.0, 0.001, -0.001, 0.001, -1.0, -1.0, 0.5, -1.0])
    path = TipPath(time_s=0.04 * np.arange(len(depth)), press_mm=np.column_stack([depth, depth, depth]))
    assert path.contacts.tolist() == [[1, 9], [11, 12]]
    assert [len(times) for times in path.touches_s] == [2, 2]


def test_an_unknown_stretch_divides_presses_and_pauses() -> None:
    depth = np.array([-1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
    path = TipPath(
        time_s=np.arange(13.0),
        press_mm=np.column_stack([depth, depth, depth]),
        after_unknown=np.array([4, 9, 12]),
    )
    assert path.contacts.tolist() == [[1, 3], [6, 7], [8, 9], [9, 10], [11, 12]]
    assert [len(times) for times in path.touches_s] == [4, 3]
    assert [(begin, end, rows.start, rows.stop) for begin, end, rows in spans(path)] == [
        (1, 3, 0, 4),
        (6, 7, 4, 8),
    ]
