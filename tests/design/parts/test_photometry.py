"""Power from a sheet's intensity: the candela's definition, other tables and makers, and a ray through a dome."""

import math

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.fields.quantity import Quantity
from optopad.design.part_entry import ELASTOMER_INDEX, EPOXY_INDEX, half_angle_in_elastomer, packages
from optopad.design.parts.catalog import packaged
from optopad.design.parts.photometry import (
    Intensity,
    efficacy_lm_per_w,
    luminosity,
    radiant_intensity_mw_per_sr,
    radiant_power_mw,
)


def mcd(value):
    return Intensity(value=value, unit="mcd")


def wyman_2013(wavelength_nm):
    """Fit of two Gaussians to y-bar of the CIE 1931 observer (Wyman, Sloan, Shirley, JCGT 2 (2), 2013)."""
    first = (wavelength_nm - 568.8) * (0.0213 if wavelength_nm < 568.8 else 0.0247)
    second = (wavelength_nm - 530.9) * (0.0613 if wavelength_nm < 530.9 else 0.0322)
    return 0.821 * math.exp(-0.5 * first**2) + 0.286 * math.exp(-0.5 * second**2)


def test_a_candela_at_555_nm_is_a_683rd_of_a_watt_per_steradian():
    assert radiant_intensity_mw_per_sr(mcd(683.0), 555.0) == pytest.approx(1.0)
    assert radiant_intensity_mw_per_sr(mcd(250.0), 630.0) == pytest.approx(250.0 / (683.0 * 0.265))
    assert radiant_intensity_mw_per_sr(Intensity(value=12.0, unit="mW/sr"), 940.0) == 12.0


@pytest.mark.parametrize("wavelength_nm", [470.0, 525.0, 533.0, 569.0, 590.0, 624.0, 632.0, 650.0])
def test_the_eyes_sensitivity_is_that_of_an_independent_fit(wavelength_nm):
    assert luminosity(wavelength_nm) == pytest.approx(wyman_2013(wavelength_nm), abs=0.015)


@pytest.mark.parametrize(
    ("wavelength_nm", "maker", "error"), [(622.0, 210.0, 0.16), (530.0, 535.0, 0.10), (470.0, 84.0, -0.26)]
)
def test_one_wavelength_for_a_spectrum_errs_as_documented(wavelength_nm, maker, error):
    """Broadcom ASMT-QTB4 states the efficacy of the whole spectrum beside the dominant wavelength."""
    assert efficacy_lm_per_w(wavelength_nm).value / maker - 1.0 == pytest.approx(error, abs=0.01)


@pytest.mark.parametrize("wavelength_nm", [405.0, 419.0, 701.0, 850.0, 940.0])
def test_millicandela_where_the_eye_is_blind_are_refused(wavelength_nm):
    assert luminosity(wavelength_nm) == 0.0
    with pytest.raises(InputError, match=rf"{wavelength_nm:g} nm is refused.*420 to 700 nm.*mW/sr"):
        radiant_intensity_mw_per_sr(mcd(250.0), wavelength_nm)


@pytest.mark.parametrize("half_angle_deg", [10.0, 15.0, 30.0, 60.0, 65.0])
def test_the_power_is_the_integral_over_the_hemisphere(half_angle_deg):
    angle = (np.arange(20000) + 0.5) * math.pi / 2 / 20000
    order = math.log(0.5) / math.log(math.cos(math.radians(half_angle_deg)))
    integral = 2 * math.pi * (np.cos(angle) ** order * np.sin(angle)).sum() * math.pi / 2 / 20000
    assert radiant_power_mw(3.0, half_angle_deg) == pytest.approx(3.0 * integral, rel=1e-6)


def test_the_packaged_conversion_agrees():
    """Lite-On LTST-C170GKT: 6 mcd at 10 mA, 569 nm, half angle 65 degrees; its entry has the power at 30 mA."""
    power = packaged().parts["liteon-ltst-c170gkt"].radiant_power_mw
    assert power is not None
    mine = 3.0 * radiant_power_mw(radiant_intensity_mw_per_sr(mcd(6.0), 569.0), 65.0)
    assert mine == pytest.approx(power.value, rel=0.05)


def leaves_deg(alpha_deg, behind, outside_index):
    """Exact direction of a ray behind a dome of radius 1, from a point `behind` its centre, by Snell's law."""
    alpha = math.radians(alpha_deg)
    inside = math.asin(behind * math.sin(alpha))
    outside = math.asin(EPOXY_INDEX / outside_index * math.sin(inside))
    return math.degrees(alpha + inside - outside)


@pytest.mark.parametrize("air_deg", [10.0, 15.0, 30.0])
def test_a_bedded_dome_bends_light_near_the_axis_as_snell_says(air_deg):
    behind = (1.0 - air_deg / 60.0) / (EPOXY_INDEX - 1.0)  # where a 60 degree die has this half angle in air
    in_air, bedded = (leaves_deg(1.0, behind, index) for index in (1.0, ELASTOMER_INDEX))
    assert in_air == pytest.approx(air_deg / 60.0, rel=0.01)
    sheet = Quantity(value=air_deg, unit="deg", source="sheet", confidence="read")
    assert half_angle_in_elastomer(sheet, "kept").value == pytest.approx(60.0 * bedded, abs=0.1)
    assert half_angle_in_elastomer(sheet, "filed").value == 60.0
    assert half_angle_in_elastomer(sheet, "none") == sheet


def test_every_package_states_sizes_with_sources_and_marks_what_is_recalled():
    assert {"radial-5mm", "radial-3mm", "side-looking-5mm", "plcc-2", "0805"} <= set(packages())
    for package in packages().values():
        for name in type(package).model_fields:
            value = getattr(package, name)
            if isinstance(value, Quantity) and value.source.startswith(("recalled", "assumed")):
                assert value.confidence == "unverified"
