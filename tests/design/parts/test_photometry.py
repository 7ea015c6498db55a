"""Power from a sheet's intensity: the candela's definition, other tables and makers, and a ray through a dome."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from optopad.design.errors import DesignError, InputError
from optopad.design.fields.quantity import Quantity
from optopad.design.part_entry import ELASTOMER_INDEX, EPOXY_INDEX, half_angle_in_elastomer, packages
from optopad.design.parts import catalog
from optopad.design.parts.angular import AngularTable
from optopad.design.parts.catalog import packaged
from optopad.design.parts.photometry import (
    Intensity,
    efficacy_lm_per_w,
    luminosity,
    radiant_intensity_mw_per_sr,
    radiant_power_mw,
)
from optopad.design.parts.spectrum import Spectrum, spectral_index
from optopad.design.spec import properties
from tests.design.parts.own_parts import with_own_part
from tests.design.spec.spec_fields import good


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


SHEET = {"source": "sheet, fig. 2", "confidence": "read"}
ROUNDING = 1e-12


def spectrum(wavelength_nm, weight):
    return Spectrum(wavelength_nm=tuple(wavelength_nm), weight=tuple(weight), **SHEET)


def index(at_um):
    return Quantity(
        value=1.5 - 0.2 * at_um, unit="1", source="line", confidence="read", low=1.4 - 0.2 * at_um, high=1.6
    )


def test_shares_add_up_to_one_and_empty_ends_have_none():
    samples = spectrum((400.0, 433.0, 450.0, 700.0), (0.0, 3.0, 3.0, 0.0)).samples()
    assert sum(share for _, share in samples) == pytest.approx(1.0, abs=ROUNDING)
    assert min(where for where, _ in samples) > 0.400
    assert max(where for where, _ in samples) < 0.700


def test_a_triangle_averages_a_linear_index_at_its_centroid():
    # centroid of the triangle 450, 500, 610 nm is their mean; its variance (a2 + b2 + c2 - ab - ac - bc) / 18
    found = spectral_index(spectrum((450.0, 500.0, 610.0), (0.0, 7.0, 0.0)), index)
    assert found.mean.value == pytest.approx(1.5 - 0.2 * 0.520, abs=ROUNDING)
    variance = (0.45**2 + 0.5**2 + 0.61**2 - 0.45 * 0.5 - 0.45 * 0.61 - 0.5 * 0.61) / 18
    # Simpson's rule on products of three linear factors is exact
    assert found.deviation == pytest.approx(0.2 * variance**0.5, rel=1e-9)


def test_the_band_is_averaged_like_the_value():
    found = spectral_index(spectrum((450.0, 550.0), (1.0, 1.0)), index).mean
    assert (found.low, found.high) == pytest.approx((1.4 - 0.2 * 0.5, 1.6))
    assert found.confidence == "inferred"
    assert "fig. 2" in found.source


def test_a_narrow_line_has_the_index_at_its_wavelength():
    line = {"wavelength_nm": [549.0, 550.0, 551.0], "weight": [0.0, 1.0, 0.0], **SHEET}
    design = with_own_part("emitter", spectrum=line)
    there = catalog.refractive_index(properties.elastomer_of(design), 20.0, 0.55)
    # the table bends by less than 1e-4 in the 1 nm
    assert properties.refractive_index(design).value == pytest.approx(there.value, abs=1e-4)
    assert properties.elastomer_spectral_index(design).deviation < 1e-4


def test_a_flat_visible_spectrum_averages_the_elastomers_table():
    flat = {"wavelength_nm": [450.0, 650.0], "weight": [1.0, 1.0], **SHEET}
    design = with_own_part("emitter", spectrum=flat)
    elastomer = properties.elastomer_of(design)
    rows = [catalog.refractive_index(elastomer, 20.0, 0.45 + 0.001 * k).value for k in range(201)]
    mean = (sum(rows) - 0.5 * (rows[0] + rows[-1])) / 200
    # trapezoids of 1 nm against Simpson of 10 nm on a table with kinks each 10 nm: both exact between kinks
    assert properties.refractive_index(design).value == pytest.approx(mean, abs=1e-9)


def test_a_measured_index_wins_over_a_spectrum():
    flat = {"wavelength_nm": [450.0, 650.0], "weight": [1.0, 1.0], **SHEET}
    design = with_own_part("emitter", spectrum=flat, **{"elastomer.refractive_index": 1.43})
    assert properties.refractive_index(design).value == 1.43


def test_a_spectrum_beyond_the_elastomers_tables_is_refused_with_the_way_out():
    wide = {"wavelength_nm": [450.0, 1900.0], "weight": [1.0, 1.0], **SHEET}
    with pytest.raises(DesignError, match=r"give elastomer\.refractive_index"):
        properties.refractive_index(with_own_part("emitter", spectrum=wide))


def test_a_design_without_a_spectrum_has_none():
    assert properties.elastomer_spectral_index(good()) is None


@pytest.mark.parametrize(
    ("wavelength_nm", "weight", "message"),
    [
        ((450.0,), (1.0,), "at least 2"),
        ((450.0, 500.0), (1.0, 1.0, 1.0), "wavelength_nm has 2 entries, weight 3"),
        ((500.0, 450.0), (1.0, 1.0), "must rise"),
        ((0.45, 0.5), (1.0, 1.0), "to 200"),
        ((450.0, 500.0), (0.0, 0.0), "0 at every wavelength"),
        ((450.0, 500.0), (1.0, -1.0), "to 0"),
    ],
)
def test_what_is_no_spectrum_is_refused(wavelength_nm, weight, message):
    with pytest.raises(ValidationError, match=message):
        spectrum(wavelength_nm, weight)


def table(angle_deg, relative):
    return AngularTable(
        angle_deg=tuple(angle_deg), relative=tuple(relative), source="sheet, fig. 4", confidence="read"
    )


def test_a_table_is_linear_in_the_angle_between_its_points():
    shown = table((0.0, 30.0, 90.0), (100.0, 70.0, 10.0))
    assert shown.at(np.array([0.0, 15.0, 30.0, 60.0, 90.0])) == pytest.approx([100.0, 85.0, 70.0, 40.0, 10.0])


def test_beyond_its_last_angle_a_table_falls_linearly_to_nothing_at_90():
    assert table((0.0, 60.0), (1.0, 0.6)).at(np.array([75.0, 90.0])) == pytest.approx([0.3, 0.0])


def test_the_half_angle_is_where_half_of_the_axis_is_left():
    assert table((0.0, 50.0, 70.0), (2.0, 1.2, 0.8)).half_angle_deg() == pytest.approx(60.0)
    assert table((0.0, 60.0), (1.0, 0.8)).half_angle_deg() == pytest.approx(60.0 + 30.0 * 3 / 8)
    batwing = table((0.0, 50.0, 60.0, 80.0), (1.0, 1.5, 1.5, 0.0))
    assert batwing.half_angle_deg() == pytest.approx(60.0 + 20.0 * 2 / 3)
    assert table((0.0, 90.0), (1.0, 0.8)).half_angle_deg() == 90.0


@pytest.mark.parametrize(
    ("angle_deg", "relative", "message"),
    [
        ((0.0, 10.0), (1.0,), "at least 2"),
        ((0.0, 10.0, 20.0), (1.0, 0.9), "angle_deg has 3 entries, relative 2"),
        ((5.0, 10.0), (1.0, 0.9), "starts at 5; start at 0"),
        ((0.0, 20.0, 20.0), (1.0, 0.9, 0.8), "must rise"),
        ((0.0, 95.0), (1.0, 0.0), "90"),
        ((0.0, 90.0), (1.0, -0.1), "to 0"),
        ((0.0, 90.0), (0.0, 0.0), "0 at every angle"),
        ((0.0, 90.0), (1.0, float("nan")), "finite"),
    ],
)
def test_what_is_no_table_is_refused(angle_deg, relative, message):
    with pytest.raises(ValidationError, match=message):
        table(angle_deg, relative)
