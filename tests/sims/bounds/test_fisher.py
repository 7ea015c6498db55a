"""Bounds against models with known Jacobians: closed forms, no information from noise, scaling, honest errors."""

import json

import numpy as np
import pytest
import xarray as xr

from optopad.design.preset import preset
from optopad.sims.bounds.detection_threshold import _first_reached_mm
from optopad.sims.bounds.fisher import (
    Bounds,
    Sensitivity,
    Steps,
    bounds_of,
    information,
    stencil_derivatives,
    stencil_presses,
)
from optopad.sims.bounds.observability import bound_depths_mm, bounds_json, depth_weights, median_of, share_of
from optopad.sims.readings.readout import save_dataset
from optopad.sims.score.maps_file import bounds_dataset, provenance
from tests.sims.made_up_bounds import made_up_bounds

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


@pytest.fixture(scope="module")
def bounds():
    return made_up_bounds()


def test_json_has_no_infinities_and_blind_is_null(bounds):
    text = json.dumps(bounds_json(bounds), allow_nan=False)
    found = json.loads(text)
    assert found["location_mm"][0][0][0] is None
    assert found["location_error_mm"][0][0][0] is None
    assert found["location_mm"][1][0][0] == pytest.approx(0.02 / 0.7, rel=1e-4)
    assert found["worst_voxel"]["location_mm"] is None
    assert found["worst_loss"] == "R8"


def test_summaries_follow_from_the_maps(bounds):
    assert bounds.weight.sum() == pytest.approx(1.0)
    first_layer_share = 0.45 / 5.0 / 25
    assert bounds.blind_share == pytest.approx(first_layer_share)
    assert bounds.coverage.value == pytest.approx(1.0 - first_layer_share)
    assert bounds.dead_share.value == pytest.approx(first_layer_share)
    assert bounds.worst.depth_mm == 0.2
    assert np.isinf(bounds.worst.location_mm)


def test_maps_open_with_one_line_and_keep_units_and_blind_voxels(bounds, tmp_path):
    file = tmp_path / "maps.nc"
    save_dataset(bounds_dataset(bounds).assign_attrs(provenance(preset("piacenza2017-pad"), 3)), file)
    with xr.open_dataset(file) as maps:
        assert maps.location_bound.dims == ("y", "x", "depth")
        assert {
            name: values.attrs["units"] for name, values in maps.data_vars.items() if "bound" in name
        } == {name: "mm" for name in maps.data_vars if "bound" in name}
        assert np.isinf(maps.location_bound.sel(x=6.0, y=6.0, depth=0.2))
        assert maps.attrs["seed"] == 3
        assert maps.attrs["design_digest"] == preset("piacenza2017-pad").digest
        assert "numpy" in maps.attrs["versions"]


def test_bound_depths_leave_room_for_the_presses_beside_them():
    found = bound_depths_mm((0.2, 0.7, 1.5, 2.8), 2.0, 0.1)
    assert found == pytest.approx([0.2, 0.7, 1.5, 1.9])
    assert bound_depths_mm((0.2, 0.7), 0.4, 0.1) == pytest.approx([0.3])


def bounds_with(location, depth, error=0.0):
    location, depth = np.asarray(location, dtype=float), np.asarray(depth, dtype=float)
    errors = np.where(np.isfinite(location), error, np.inf)
    return Bounds(
        location_mm=location,
        location_error_mm=errors,
        depth_mm=depth,
        depth_error_mm=errors,
        depth_alone_mm=depth,
        depth_alone_error_mm=errors,
    )


def test_depth_weights_fill_the_range_of_use():
    weights = depth_weights((0.5, 1.0, 3.0), 5.0)
    assert weights.sum() == pytest.approx(1.0)
    assert weights * 5.0 == pytest.approx([0.75, 1.25, 3.0])


def test_median_weighs_voxels_by_their_volume_and_counts_blind_ones_as_worst():
    values, errors = np.array([1.0, 2.0, np.inf]), np.array([0.1, 0.1, np.inf])
    assert median_of(values, errors, np.array([0.2, 0.4, 0.4])).value == 2.0
    assert median_of(values, errors, np.array([0.2, 0.2, 0.6])).value == np.inf
    found = median_of(values, errors, np.array([0.6, 0.2, 0.2]))
    assert (found.low, found.value, found.high) == pytest.approx((0.8, 1.0, 1.2))


def test_coverage_needs_both_bounds_and_its_ends_follow_the_errors():
    bounds = bounds_with([0.5, 0.95, 2.0, np.inf], [0.1, 0.1, 0.1, np.inf], error=0.1)
    found = share_of(bounds, 1.0, 0.5, np.full(4, 0.25))
    assert (found.low, found.value, found.high) == (0.25, 0.5, 0.5)
    left = found.complement()
    assert (left.low, left.value, left.high) == (0.5, 0.5, 0.75)


def test_stencil_gives_the_gradient_of_a_quadratic_exactly():
    """Central differences have no error of second order, mixed terms included."""
    rng = np.random.default_rng(0)
    bend = rng.normal(size=(3, 3))
    slope = rng.normal(size=3)
    voxels = rng.uniform(1.0, 4.0, size=(5, 3))
    offsets = Steps().offsets_mm(voxels[:, 2])
    presses = stencil_presses(voxels, offsets)
    readings = (presses @ slope + np.einsum("ni,ij,nj->n", presses, bend, presses)).reshape(5, 6, 1)
    expected = slope + voxels @ (bend + bend.T)
    assert stencil_derivatives(readings, offsets)[:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_no_press_of_the_stencil_leaves_the_surface():
    voxels = np.array([[5.0, 5.0, 0.05], [5.0, 5.0, 3.0]])
    assert stencil_presses(voxels, Steps().offsets_mm(voxels[:, 2]))[:, 2].min() > 0.0


def test_a_press_is_felt_where_the_line_between_samples_meets_the_threshold():
    depth = np.array([0.0, 0.1, 0.3])
    change = np.array([[[0.0, 2.0, 6.0], [0.0, 1.0, 2.9]]])
    assert _first_reached_mm(depth, change, 3.0)[0] == pytest.approx([0.15, np.inf])
