"""Angular patterns as tables: exact where the table's form is exact, refused where they make no sense."""

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.parts.angular import AngularTable
from optopad.sims.optics.scene.optical_scene import (
    cosine_nodes,
    lambertian_pattern,
    normalised_pattern,
    pattern_power,
    table_pattern,
)

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


def sheet(angle_deg, relative):
    return AngularTable(angle_deg=tuple(angle_deg), relative=tuple(relative), source="s", confidence="read")


@pytest.mark.parametrize("step_deg", [1, 5, 10])
def test_a_cosine_sheet_is_a_lambertian_source_to_its_own_step(step_deg):
    angles = np.arange(0, 91, step_deg)
    pattern = table_pattern(sheet(angles, np.cos(np.radians(angles))))
    # a chord lies (step^2 / 8) below the cosine, relative to it
    assert np.abs(np.pi * pattern - 1).max() < 1.05 * np.radians(step_deg) ** 2 / 8


def test_a_cosine_sheet_at_the_nodes_themselves_is_order_one():
    c = cosine_nodes()
    angles = np.degrees(np.arccos(c[::-1]))
    angles[[0, -1]] = 0.0, 90.0
    # the nodes agree to rounding; in the last cell the sheet is linear in the angle: half a degree squared / 6
    error = np.abs(np.pi * table_pattern(sheet(angles, c[::-1])) - 1)
    assert error.max() < np.radians(0.5) ** 2 / 4


def test_a_sheets_unit_does_not_matter():
    angles = (0.0, 20.0, 50.0, 70.0)
    one, other = (table_pattern(sheet(angles, k * np.array([1.0, 1.3, 0.7, 0.2]))) for k in (1.0, 250.0))
    assert np.abs(one - other).max() < ROUNDING


def test_the_power_within_a_cone_is_that_of_the_sheet():
    # constant intensity to 90 degrees: the power within the cosine c is 1 - c, though radiance has no bound at grazing
    pattern = table_pattern(sheet((0.0, 90.0), (1.0, 1.0)))
    assert np.isfinite(pattern).all()
    assert pattern_power(pattern) == pytest.approx(1.0, abs=ROUNDING)
    c = cosine_nodes()
    for first in (32, 64, 96):
        low, high = pattern[first:-1], pattern[first + 1 :]
        cells = c[first:-1] * (2 * low + high) + c[first + 1 :] * (low + 2 * high)
        power = 2 * np.pi * cells.sum() / 128 / 6
        # chords of 1 / c lie above it by (h / c)^2 / 4 at most, and the cells below c = 0.05 hold 1 % more
        assert power == pytest.approx(1 - c[first], rel=5e-3)


def test_a_batwing_keeps_its_bright_ring():
    pattern = table_pattern(sheet((0.0, 50.0, 70.0, 90.0), (1.0, 2.0, 1.0, 0.0)))
    c = cosine_nodes()
    intensity = c * pattern
    ring = np.interp(np.cos(np.radians(50.0)), c, intensity) / intensity[-1]
    assert ring == pytest.approx(
        2.0, rel=0.01
    )  # the sheet's kink lies within a cell of 0.6 deg: 1 / 50 of its rise
