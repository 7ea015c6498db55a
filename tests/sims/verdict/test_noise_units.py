"""Noise units against the variance model that defines them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.errors import InputError
from optopad.sims.verdict.depth_curve import counts_of_noise_units, noise_units, sigma_counts

PROPERTY = settings(max_examples=80, deadline=None, derandomize=True)
ROUNDING = 1e-12  # some hundred ulps: the functions are a handful of operations


def test_sigma_adds_rounding_read_noise_and_light_noise_in_quadrature():
    # 1/12 + 0.5² + (0.003 x 800)² = 0.083333 + 0.25 + 5.76
    assert sigma_counts(800.0, 0.5, 0.003) == pytest.approx(np.sqrt(6.0933333333333), rel=ROUNDING)


def test_sigma_without_other_noise_is_that_of_rounding():
    assert sigma_counts(0.0, 0.0, 0.0) == pytest.approx(1.0 / np.sqrt(12.0), rel=ROUNDING)


def test_one_noise_unit_is_one_standard_deviation_everywhere():
    counts = np.linspace(0.0, 1023.0, 200)
    step = 1e-3  # the third derivative of u leaves an error of (ρ step/σ0)²/6, about 5e-12
    slope = (noise_units(counts + step) - noise_units(counts - step)) / (2.0 * step)
    # 1e-8: rounding of u (1e-13) over the step
    np.testing.assert_allclose(slope * sigma_counts(counts), 1.0, rtol=1e-8)


@pytest.mark.parametrize("rho", [0.1, 0.003, 1e-4, 1e-6])
def test_noise_units_are_the_closed_form(rho):
    sigma0 = np.sqrt(1.0 / 12.0 + 0.25)
    assert noise_units(800.0, 0.5, rho) == pytest.approx(np.arcsinh(rho * 800.0 / sigma0) / rho, rel=ROUNDING)


def test_without_relative_noise_units_are_counts_over_sigma():
    counts = np.array([0.0, 10.0, 1023.0])
    np.testing.assert_allclose(
        noise_units(counts, 0.5, 0.0), counts / np.sqrt(1.0 / 12.0 + 0.25), rtol=ROUNDING
    )


@pytest.mark.parametrize("rho", [1e-320, 1e-100, 1e-13, 1e-12, 1e-11, 1e-9])
def test_the_limit_of_small_relative_noise_is_smooth(rho):
    # asinh(x) = x (1 - x²/6): at ρ = 1e-9 and 1000 counts x is 1.8e-6 and the difference 5e-13
    assert noise_units(1000.0, 0.5, rho) == pytest.approx(noise_units(1000.0, 0.5, 0.0), rel=ROUNDING)


@PROPERTY
@given(
    counts=st.floats(-2000.0, 5000.0),
    read_noise=st.floats(0.0, 20.0),
    relative_noise=st.floats(0.0, 0.1),
)
def test_the_inverse_gives_the_counts_back(counts, read_noise, relative_noise):
    units = noise_units(counts, read_noise, relative_noise)
    back = counts_of_noise_units(units, read_noise, relative_noise)
    # sinh magnifies the rounding of ρ u, at most asinh(1750) = 8.2, so to about 10 ulps
    assert back == pytest.approx(counts, rel=ROUNDING, abs=ROUNDING)


@PROPERTY
@given(relative_noise=st.floats(0.0, 0.1))
def test_noise_units_are_odd_and_increasing(relative_noise):
    counts = np.linspace(0.0, 1023.0, 50)
    units = noise_units(counts, 0.5, relative_noise)
    assert np.all(np.diff(units) > 0.0)
    np.testing.assert_array_equal(noise_units(-counts, 0.5, relative_noise), -units)


def test_simulated_readings_scatter_by_one_noise_unit():
    rng = np.random.default_rng(3)
    for mean in (5.3, 100.3, 800.3):
        light = mean * (1.0 + 0.003 * rng.standard_normal(40_000))
        readings = np.round(light + 0.5 * rng.standard_normal(40_000))
        spread = np.std(noise_units(readings, 0.5, 0.003))
        # 5 standard errors of a standard deviation from 40,000 readings: 5 / √80,000 = 1.8 %
        assert spread == pytest.approx(1.0, abs=0.018)


@pytest.mark.parametrize(("read_noise", "relative_noise"), [(-0.1, 0.003), (0.5, -1.0), (np.nan, 0.0)])
def test_impossible_noise_is_refused_by_name(read_noise, relative_noise):
    name = "relative_noise" if relative_noise < 0.0 else "read_noise_counts"
    with pytest.raises(InputError, match=rf"{name}: .*needs a finite number >= 0"):
        noise_units(1.0, read_noise, relative_noise)
