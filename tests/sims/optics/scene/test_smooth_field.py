"""A smooth field: exact for cubics, fourth order for the rest, smooth across cells, 0 outside."""

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.sims.optics.scene.optical_scene import SmoothField, smooth_field


def wave(x, y):
    return 0.1 * np.sin(0.7 * x + 0.2) * np.cos(0.5 * y)


def cubic(x, y):
    return (1e-3 * x**3 - 0.02 * x**2 + 0.3) * (2e-3 * y**3 + 0.1 * y - 0.4)


def places(count=4000, length=12.0, width=9.0):
    return np.random.default_rng(1).random((2, count)) * np.array([[length], [width]])


def test_products_of_cubics_are_reproduced():
    x, y = places()
    field = smooth_field(cubic, 12.0, 9.0, 1.0)
    assert np.abs(field.height_mm(x, y) - cubic(x, y)).max() < 1e-13  # rounding: values up to 2


def test_the_error_falls_with_the_fourth_power_of_the_spacing():
    x, y = places()
    errors = [
        np.abs(smooth_field(wave, 12.0, 9.0, spacing).height_mm(x, y) - wave(x, y)).max()
        for spacing in (0.5, 0.25)
    ]
    assert errors[0] / errors[1] > 12.0  # 16 in the limit; the ends of the spline converge a little later
    assert errors[1] < 1e-5


def test_height_and_slope_are_continuous_across_cells():
    field = smooth_field(wave, 12.0, 9.0, 1.5)
    step, y = 1e-6, np.linspace(0.1, 8.9, 50)
    left, here, right = (field.height_mm(np.full(50, 4.5 + d), y) for d in (-step, 0.0, step))
    # a jump in slope of s would show as s * step; curvature (0.05 / mm) leaves 5e-14
    assert np.abs(right - 2 * here + left).max() < 1e-12


def test_the_grid_ends_at_the_walls_and_is_zero_beyond():
    field = smooth_field(lambda x, y: np.ones_like(x + y), 12.0, 9.0, 0.7)
    last = field.origin_mm + field.step_mm * (np.array(field.nodes.shape[:2]) - 1)
    assert np.abs(last - [12.0, 9.0]).max() < 1e-12
    assert (field.step_mm <= 0.7).all()
    assert field.height_mm(
        np.array([12.0, 12.1, -0.1, 6.0]), np.array([9.0, 4.0, 4.0, 9.2])
    ) == pytest.approx([1, 0, 0, 0])


def test_a_field_keeps_the_derivatives_of_the_function():
    field = smooth_field(cubic, 12.0, 9.0, 1.0)
    x, y = np.meshgrid(np.arange(13.0), np.arange(10.0), indexing="ij")
    along = (3e-3 * x**2 - 0.04 * x) * (2e-3 * y**3 + 0.1 * y - 0.4)
    mixed = (3e-3 * x**2 - 0.04 * x) * (6e-3 * y**2 + 0.1)
    assert np.abs(field.nodes[..., 1] - along).max() < 1e-12  # rounding
    assert np.abs(field.nodes[..., 3] - mixed).max() < 1e-12


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"origin_mm": np.zeros(3)}, "origin_mm"),
        ({"origin_mm": np.array([0.0, np.nan])}, "origin_mm"),
        ({"step_mm": np.array([1.0, 0.0])}, "step_mm"),
        ({"nodes": np.zeros((3, 3))}, r"nodes: shape \(3, 3\)"),
        ({"nodes": np.zeros((1, 3, 4))}, "nodes: shape"),
        ({"nodes": np.full((3, 3, 4), np.inf)}, r"nodes\[0, 0, 0\]: inf"),
    ],
)
def test_a_bad_field_is_refused_by_name(changes, message):
    good = {"origin_mm": np.zeros(2), "step_mm": np.ones(2), "nodes": np.zeros((3, 3, 4))}
    with pytest.raises(InputError, match=message):
        SmoothField(**(good | changes))


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ((0.0, 9.0, 1.0), "length_mm: 0"),
        ((12.0, np.nan, 1.0), "width_mm: nan"),
        ((12.0, 9.0, -1.0), "spacing_mm: -1"),
        ((12.0, 9.0, 0.001), "widen it"),
    ],
)
def test_a_bad_grid_is_refused_by_name(sizes, message):
    with pytest.raises(InputError, match=message):
        smooth_field(wave, *sizes)


def test_a_height_that_is_not_finite_is_refused_with_its_place():
    with pytest.raises(InputError, match=r"height_mm: nan at \(0, 0\) mm"):
        smooth_field(lambda x, y: np.where(x + y > 0, 0.0, np.nan), 12.0, 9.0, 1.0)


def test_a_height_of_another_shape_is_refused():
    with pytest.raises(InputError, match="one height each"):
        smooth_field(lambda x, y: np.zeros(3), 12.0, 9.0, 1.0)
