"""Load curves: proportional to the modulus, with the band that the catalogue leaves open."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.sims.contact.force_curve import band_factors, force_curve
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of

DEPTH_MM = np.array([0.0, 0.5, 1.0, 2.0, 3.0])
PAD = preset("piacenza2017-pad")
ROUNDING = 1e-12


def test_the_band_is_that_of_the_catalogues_modulus() -> None:
    curve = force_curve(solved_press(contact_of(PAD)), DEPTH_MM)
    young = modulus(PAD)
    assert young.low is not None
    assert young.high is not None
    assert curve.low_n == pytest.approx(curve.force_n * young.low / young.value, rel=ROUNDING)
    assert curve.high_n == pytest.approx(curve.force_n * young.high / young.value, rel=ROUNDING)
    assert curve.has_band


def test_the_load_at_the_low_modulus_is_the_load_of_a_pad_of_that_modulus() -> None:
    low = modulus(PAD).low
    softer = PAD.with_(**{"elastomer.youngs_modulus_mpa": low})
    band = force_curve(solved_press(contact_of(PAD)), DEPTH_MM).low_n
    own = force_curve(solved_press(contact_of(softer)), DEPTH_MM)
    assert own.force_n == pytest.approx(band, rel=ROUNDING)
    assert not own.has_band
    assert np.array_equal(own.low_n, own.high_n)


@pytest.mark.parametrize(("ratio", "expected"), [(10.0, 2.0), (20.0, 1.0), (30.0, 2.0 / 3.0)])
def test_the_mixing_ratio_sets_the_load(ratio: float, expected: float) -> None:
    mixed: SensorDesign = PAD.with_(**{"elastomer.mixing_ratio": ratio})
    load = force_curve(solved_press(contact_of(mixed)), DEPTH_MM).force_n[-1]
    unit = force_curve(solved_press(contact_of(PAD)), DEPTH_MM).force_n[-1]
    assert load / unit == pytest.approx(expected, rel=1e-5)  # E = 20 MPa / ratio, to the catalogue's digits


def test_the_load_starts_at_nothing_and_rises() -> None:
    curve = force_curve(solved_press(contact_of(PAD)), DEPTH_MM)
    assert curve.force_n[0] == curve.contact_radius_mm[0] == 0.0
    assert np.all(np.diff(curve.force_n) > 0.0)
    assert curve.at(1.0) == (curve.force_n[2], curve.low_n[2], curve.high_n[2])
    assert curve.contact_radius_at(1.0) == curve.contact_radius_mm[2]


def test_a_value_without_a_band_has_factors_of_one() -> None:
    assert band_factors(modulus(PAD).model_copy(update={"low": None, "high": None})) == (1.0, 1.0)
