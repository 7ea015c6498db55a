"""Angular patterns as tables: exact where the table's form is exact, refused where they make no sense."""

import numpy as np
import pytest

from design.errors import InputError
from sims.optics.emission import cosine_nodes, lambertian_pattern, normalised_pattern, pattern_power

ROUNDING = 1e-14


def test_a_lambertian_source_is_one_over_pi_at_every_angle():
    assert np.abs(lambertian_pattern(1.0) - 1 / np.pi).max() < ROUNDING


@pytest.mark.parametrize("count", [2, 3, 17, 129])
def test_power_is_exact_for_radiance_linear_in_the_cosine(count):
    # 2 pi int_0^1 c (0.2 + 0.7 c) dc = 2 pi (0.1 + 0.7 / 3)
    assert pattern_power(0.2 + 0.7 * cosine_nodes(count)) == pytest.approx(
        2 * np.pi * (0.1 + 0.7 / 3), rel=ROUNDING
    )


@pytest.mark.parametrize("order", [1.5, 2.0, 3.0, 8.0])
def test_a_power_law_tends_to_its_radiance_with_the_square_of_the_step(order):
    errors = []
    for count in (65, 129):
        exact = (order + 1) / (2 * np.pi) * cosine_nodes(count) ** (order - 1)
        errors.append(np.abs(lambertian_pattern(order, count) - exact).max() / exact.max())
    # linear interpolation of c^(m-1): second order; m = 2 is linear itself; below 2 the end at c = 0 is a root
    assert errors[1] < ROUNDING if order == 2.0 else errors[1] < errors[0] / (2.5 if order < 2 else 3.9)


def test_scaling_a_pattern_changes_nothing():
    rows = np.array([np.linspace(0, 3, 33), np.linspace(5, 1, 33)])
    assert np.abs(normalised_pattern(7.3 * rows) - normalised_pattern(rows)).max() < ROUNDING
    assert np.abs(pattern_power(normalised_pattern(rows)) - 1).max() < ROUNDING


@pytest.mark.parametrize("bad", [np.zeros(9), np.full(9, np.nan), np.linspace(-1, 1, 9)])
def test_a_pattern_without_sense_is_refused(bad):
    with pytest.raises(InputError, match="pattern"):
        normalised_pattern(bad)


def test_an_order_without_bounded_radiance_has_no_table():
    with pytest.raises(InputError, match=r"order: 0\.5"):
        lambertian_pattern(0.5)
