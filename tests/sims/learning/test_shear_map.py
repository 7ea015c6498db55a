"""A signal map with a sideways force as unknown, made of smooth functions: slopes, limits, and forces found again."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.sims.learning.shear_map import ForceLight, ShearMap
from tests.sims.learning.made_up_map import PAIRS, made_up_map_model, random_presses

DEPTHS = np.array([0.5, 1.0])


@cache
def light() -> ForceLight:
    """Factors that depend smoothly on the location, proportional to depth."""
    nodes = np.linspace(6.0, 26.0, 6)
    places = np.stack([one.ravel() for one in np.meshgrid(nodes, nodes, indexing="ij")], axis=1)
    waves = np.sin(places @ np.random.default_rng(5).uniform(-0.2, 0.2, (2, 4 * PAIRS)))
    sizes = np.array([0.04, 0.04, 0.005, 0.005])[:, None]
    factors = waves.reshape(-1, 1, 4, PAIRS) * sizes * DEPTHS[:, None, None]
    return ForceLight(places_mm=places, depth_mm=DEPTHS, factors=factors)


@cache
def shear_map() -> ShearMap:
    return ShearMap(ball=made_up_map_model(), light=light(), usual_n=5.0)


def presses(count: int) -> FloatArray:
    """x, y, depth and force (n, 5)."""
    force_n = np.random.default_rng(3).uniform(-0.5, 0.5, (count, 2))
    return np.concatenate([random_presses(count, 7, (0.5, 0.95)), force_n], axis=1)


def test_without_a_force_the_map_is_that_of_the_ball():
    found, ball = shear_map(), made_up_map_model()
    press = presses(5) * [1.0, 1.0, 1.0, 0.0, 0.0]
    signals, slopes = found.signals(press)
    expected, by_place = ball.answers(press[:, :3])
    np.testing.assert_allclose(signals, expected)
    np.testing.assert_allclose(slopes[:, :3], by_place)


def test_factors_are_those_of_the_states_and_fade_to_the_surface():
    one = light()
    at = np.column_stack([one.places_mm, np.full(len(one.places_mm), 1.0)])
    np.testing.assert_allclose(one.factors_at(at), one.factors[:, 1], atol=1e-9)
    np.testing.assert_allclose(one.factors_at(at * [1, 1, 0.25]), one.factors[:, 1] / 4, atol=1e-9)
    np.testing.assert_allclose(one.factors_at(at * [1, 1, 3.0]), one.factors[:, 1], atol=1e-9)


def test_slopes_are_those_of_the_signals():
    found, press = shear_map(), presses(6)
    slopes = found.signals(press)[1]
    for axis, step in enumerate(1e-3 * np.eye(5)):
        change = (found.signals(press + step)[0] - found.signals(press - step)[0]) / 2e-3
        np.testing.assert_allclose(slopes[:, axis], change, atol=0.02 * np.abs(slopes[:, axis]).max())


def test_location_depth_and_force_are_found_again_and_the_ball_s_map_is_misled():
    found, press = shear_map(), presses(16)
    signals = found.signals(press)[0]
    off = np.abs(found.found(signals) - press)
    assert np.median(off[:, :2]) < 0.005
    assert np.median(off[:, 3:]) < 0.02
    misled = np.abs(found.ball.found(signals).press_mm - press[:, :3])
    assert np.median(misled[:, :2]) > 10.0 * np.median(off[:, :2])


def test_a_narrow_prior_gives_the_ball_s_map_and_no_force():
    press = presses(8)
    signals = shear_map().signals(press)[0]
    found = replace(shear_map(), usual_n=1e-4).found(signals)
    assert np.abs(found[:, 3:]).max() < 1e-4
    np.testing.assert_allclose(found[:, :3], shear_map().ball.found(signals).press_mm, atol=0.01)
