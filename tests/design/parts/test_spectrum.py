"""Averages over a spectrum: exact for linear tables, at the wavelength for a narrow line, refused outside."""

import numpy as np
import pytest
from pydantic import ValidationError

from optopad.design.errors import DesignError
from optopad.design.fields.quantity import Quantity
from optopad.design.parts import catalog
from optopad.design.parts.angular import AngularTable
from optopad.design.parts.spectrum import Spectrum, spectral_index
from optopad.design.spec import properties
from tests.design.parts.own_parts import with_own_part
from tests.design.spec.spec_fields import good

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
