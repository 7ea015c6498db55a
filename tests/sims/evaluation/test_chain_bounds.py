"""Bounds with unknown gains and stage: against the full problem, a linear estimator, the map's own search."""

from __future__ import annotations

import numpy as np
import pytest

import optopad.sims.learning.chain_bounds as chain_bounds_module
from optopad.sims.learning.chain_bounds import StageErrors, bounds_under
from tests.sims.learning.made_up_map import (
    COUNT,
    made_up_map_model,
    made_up_noise,
    noisy_signals,
    random_presses,
    ratios,
    untouched_counts,
)

EXACT = StageErrors(position_mm=0.0, depth_mm=0.0)


def slopes_of(press_mm: np.ndarray) -> np.ndarray:
    """(n, pair, 3) slopes of the made-up signals, by central differences [counts/mm]."""
    step = 1e-4
    sides = [
        (ratios(press_mm + step * axis) - ratios(press_mm - step * axis)) / (2 * step) for axis in np.eye(3)
    ]
    return np.stack(sides, axis=-1) * untouched_counts()[:, None]


def test_gains_eliminated_are_gains_estimated_along():
    presses, noise = random_presses(3, 1), made_up_noise()
    signals = ratios(presses) * untouched_counts()
    slopes = slopes_of(presses)
    found = bounds_under(slopes, slopes, signals, noise, EXACT)
    for row in range(3):
        joint = np.concatenate([slopes[row], noise.gain_columns(signals)[row].T], axis=1)
        information = joint.T @ (joint / noise.variance(signals)[row][:, None])
        information[3:, 3:] += np.eye(2 * COUNT)  # gains in their own standard deviations
        variance = np.diag(np.linalg.inv(information))
        assert found.location_mm[row] == pytest.approx(np.sqrt(variance[0] + variance[1]), rel=1e-8)
        assert found.depth_mm[row] == pytest.approx(np.sqrt(variance[2]), rel=1e-8)


def test_a_linear_gaussian_estimate_reaches_the_bound():
    presses, noise = random_presses(1, 2), made_up_noise()
    signals = ratios(presses) * untouched_counts()
    slopes = slopes_of(presses)[0]
    columns = noise.gain_columns(signals)[0].T
    covariance = np.diag(noise.variance(signals)[0]) + columns @ columns.T
    weighted = np.linalg.solve(covariance, slopes)
    draws = np.random.default_rng(3).multivariate_normal(np.zeros(len(covariance)), covariance, size=20_000)
    estimates = draws @ weighted @ np.linalg.inv(slopes.T @ weighted)
    found = bounds_under(slopes[None], slopes[None], signals, noise, EXACT)
    # 20,000 draws know a standard deviation to 0.5 %; five of that
    assert found.location_mm[0] == pytest.approx(np.sqrt(estimates[:, :2].var(axis=0).sum()), rel=0.025)
    assert found.depth_mm[0] == pytest.approx(estimates[:, 2].std(), rel=0.025)


def test_the_maps_search_reaches_the_bound():
    model = made_up_map_model()
    press = np.array([[12.0, 18.0, 2.0]])
    estimates = model.predict(noisy_signals(np.repeat(press, 400, axis=0), model.noise, 4)).press_mm
    slopes = slopes_of(press)
    found = bounds_under(slopes, slopes, ratios(press) * untouched_counts(), model.noise, EXACT)
    # 400 draws: 3.5 % of a standard deviation; four of that, and the spline's error
    assert np.sqrt(estimates[:, :2].var(axis=0).sum()) == pytest.approx(found.location_mm[0], rel=0.16)
    assert estimates[:, 2].std() == pytest.approx(found.depth_mm[0], rel=0.16)


def test_drift_widens_the_bound():
    presses = random_presses(20, 5)
    signals, slopes = ratios(presses) * untouched_counts(), slopes_of(presses)
    steady = bounds_under(
        slopes, slopes, signals, made_up_noise(emitter_drift=0.0, receiver_drift=0.0), EXACT
    )
    drifting = bounds_under(slopes, slopes, signals, made_up_noise(), EXACT)
    assert (drifting.depth_mm > steady.depth_mm).all()
    assert (drifting.location_mm > steady.location_mm).all()


def test_a_stages_errors_add_as_squares():
    presses = random_presses(4, 6)
    signals, slopes = ratios(presses) * untouched_counts(), slopes_of(presses)
    stage = StageErrors(position_mm=0.02, depth_mm=0.05)
    found = bounds_under(slopes, slopes, signals, made_up_noise(), stage)
    assert np.allclose(found.location_mm**2, found.tip.location_mm**2 + 2 * 0.02**2)
    assert np.allclose(found.depth_mm**2, found.tip.depth_mm**2 + 0.05**2)


def test_clipped_pairs_tell_nothing():
    presses = random_presses(4, 7)
    signals, slopes = ratios(presses) * untouched_counts(), slopes_of(presses)
    noise = made_up_noise(clip_counts=np.full(64, 300.0))
    kept = signals < 300.0
    without = bounds_under(
        slopes * kept[..., None],
        slopes * kept[..., None],
        np.where(kept, signals, 0.0),
        made_up_noise(),
        EXACT,
    )
    found = bounds_under(slopes, slopes, signals, noise, EXACT)
    assert np.allclose(found.location_mm, without.location_mm)


def test_noise_of_the_trace_is_no_information():
    presses = random_presses(200, 8)
    signals, slopes = ratios(presses) * untouched_counts(), slopes_of(presses)
    chance = np.random.default_rng(9)
    halves = [slopes + chance.normal(scale=3.0, size=slopes.shape) for _ in range(2)]
    exact = bounds_under(slopes, slopes, signals, made_up_noise(), EXACT)
    found = bounds_under(*halves, signals, made_up_noise(), EXACT)
    twice = bounds_under(halves[0], halves[0], signals, made_up_noise(), EXACT)
    bias = np.median(found.location_mm / exact.location_mm)
    assert abs(bias - 1.0) < 0.1  # what the same noise in both halves gives is further off
    assert abs(np.median(twice.location_mm / exact.location_mm) - 1.0) > abs(bias - 1.0)


def test_a_depth_that_the_trace_cannot_judge_has_no_bound(monkeypatch: pytest.MonkeyPatch):
    from optopad.design.preset import preset

    def seen_below_half_a_millimetre(design, press_mm, gains, noise, **_):
        is_deep = press_mm[:, 2] > 0.5
        slopes = slopes_of(press_mm) * is_deep[:, None, None]
        return bounds_under(slopes, slopes, ratios(press_mm) * untouched_counts(), noise, EXACT)

    monkeypatch.setattr(chain_bounds_module, "chain_bounds", seen_below_half_a_millimetre)
    found = chain_bounds_module.bounds_by_depth(
        preset("piacenza2017-pad"), np.ones(8), made_up_noise(), [0.1, 1.0, 2.0]
    )
    assert list(found) == [1.0, 2.0]
    assert all(0.0 < one < 0.2 for pair in found.values() for one in pair)
