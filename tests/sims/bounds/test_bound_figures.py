"""Summaries over the volume, the stencil, and the depth from which a press is felt."""

import numpy as np
import pytest

from optopad.sims.bounds.detection_threshold import _first_reached_mm
from optopad.sims.bounds.fisher import Bounds, Steps, stencil_derivatives, stencil_presses
from optopad.sims.bounds.observability import depth_weights, median_of, share_of


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
