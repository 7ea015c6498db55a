"""Bounds against models with known Jacobians: closed forms, no information from noise, scaling, honest errors."""

import numpy as np
import pytest

from optopad.sims.bounds.fisher import Sensitivity, bounds_of, information

PAIRS = 48


def made_up_jacobian(rng, voxels):
    return rng.normal(size=(voxels, PAIRS, 3)) * [30.0, 25.0, 60.0]


def exact(jacobian, sigma):
    weight = np.full(jacobian.shape[:-1], sigma**-2.0)
    return Sensitivity(first=jacobian, second=jacobian, weight=weight)


def noisy(jacobian, sigma, spread, rng):
    halves = [jacobian + rng.normal(size=jacobian.shape) * spread for _ in range(2)]
    return Sensitivity(first=halves[0], second=halves[1], weight=np.full(jacobian.shape[:-1], sigma**-2.0))


def test_orthogonal_readings_give_the_closed_form():
    """Three pairs that each answer to one coordinate: F is diagonal and each bound is sigma over slope."""
    jacobian = np.diag([20.0, 40.0, 80.0])[None]
    found = bounds_of(exact(jacobian, sigma=2.0))
    assert found.location_mm[0] == pytest.approx(np.hypot(2 / 20, 2 / 40), rel=1e-12)
    assert found.depth_mm[0] == pytest.approx(2 / 80, rel=1e-12)
    assert found.depth_alone_mm[0] == pytest.approx(2 / 80, rel=1e-12)


def test_an_unknown_place_can_only_worsen_the_depth():
    found = bounds_of(exact(made_up_jacobian(np.random.default_rng(1), 50), sigma=1.0))
    assert np.all(found.depth_mm >= found.depth_alone_mm)


def test_a_repeated_pair_narrows_bounds_by_the_root_of_two():
    jacobian = made_up_jacobian(np.random.default_rng(2), 4)
    once, twice = (bounds_of(exact(j, 1.0)) for j in (jacobian, np.concatenate([jacobian, jacobian], axis=1)))
    assert twice.location_mm == pytest.approx(once.location_mm / np.sqrt(2), rel=1e-9)


def test_bounds_grow_in_proportion_to_the_noise():
    jacobian = made_up_jacobian(np.random.default_rng(3), 4)
    assert bounds_of(exact(jacobian, 3.0)).depth_mm == pytest.approx(
        3 * bounds_of(exact(jacobian, 1.0)).depth_mm
    )


def test_two_pairs_are_blind_to_three_coordinates_yet_tell_the_depth_of_a_known_place():
    jacobian = made_up_jacobian(np.random.default_rng(4), 1)[:, :2]
    found = bounds_of(exact(jacobian, 1.0))
    assert found.is_blind.all()
    assert np.isinf(found.depth_mm).all()
    assert found.depth_alone_mm[0] == pytest.approx(1 / np.linalg.norm(jacobian[0, :, 2]), rel=1e-9)


def test_pure_trace_noise_gives_no_information():
    """E[aᵀWb] = 0 for independent halves; one half alone would give nᵀWn, PAIRS times the square of the noise."""
    rng, spread, voxels = np.random.default_rng(5), 10.0, 4000
    answers = noisy(np.zeros((voxels, PAIRS, 3)), 1.0, spread, rng)
    fisher = information(answers)
    standard_error = spread**2 * np.sqrt(PAIRS / voxels)  # of the mean of a sum of PAIRS products of normals
    assert np.abs(fisher.mean(axis=0)).max() < 4 * standard_error
    half_alone = np.einsum("vpi,vpj->vij", answers.first, answers.first).mean(axis=0)
    assert np.diag(half_alone) == pytest.approx(PAIRS * spread**2, rel=0.05)


def test_pure_trace_noise_is_called_blind():
    """All three directions must exceed two standard errors by chance: at most a few in a thousand."""
    rng = np.random.default_rng(6)
    found = bounds_of(noisy(np.zeros((4000, PAIRS, 3)), 1.0, 10.0, rng))
    assert found.is_blind.mean() > 0.997


def test_halves_do_not_shift_the_information():
    rng = np.random.default_rng(7)
    truth = made_up_jacobian(rng, 1)
    answers = noisy(np.repeat(truth, 4000, axis=0), 1.0, 30.0, rng)
    true, found = information(exact(truth, 1.0))[0], information(answers)
    standard_error = found.std(axis=0) / np.sqrt(4000)
    assert np.all(np.abs(found.mean(axis=0) - true) < 4.5 * standard_error)


@pytest.mark.parametrize("spread", [0.5, 3.0])
def test_stated_errors_cover_what_the_trace_noise_moves(spread):
    """z = (bound - truth) / error has a spread of one; small samples of pairs and curvature leave 15 %."""
    rng = np.random.default_rng(8)
    truth = made_up_jacobian(rng, 1)
    exact_bounds = bounds_of(exact(truth, 1.0))
    found = bounds_of(noisy(np.repeat(truth, 3000, axis=0), 1.0, spread, rng))
    for name in ("location", "depth", "depth_alone"):
        moved = getattr(found, f"{name}_mm") - getattr(exact_bounds, f"{name}_mm")[0]
        z = moved / getattr(found, f"{name}_error_mm")
        assert z.std() == pytest.approx(1.0, abs=0.15), name
        assert abs(z.mean()) < 0.25, name


def test_lost_pairs_tell_nothing():
    jacobian = made_up_jacobian(np.random.default_rng(9), 3)
    is_lost = np.arange(PAIRS) < 12
    found = bounds_of(exact(jacobian, 1.0).without(is_lost))
    assert found.location_mm == pytest.approx(bounds_of(exact(jacobian[:, 12:], 1.0)).location_mm, rel=1e-9)
