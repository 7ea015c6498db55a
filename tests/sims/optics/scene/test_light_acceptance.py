"""Receivers behind epoxy: Fresnel and Snell in their other form, and the chip's own angles."""

import math

import numpy as np
import pytest

from optopad.design.parts.catalog import Part
from optopad.sims.optics.scene.optical_scene import (
    cosine_nodes,
    half_angle_power,
    refracted_cosine,
    response_nodes,
    transmitted_share,
)
from tests.design.parts.own_parts import SHEET, own_part, quantity

ROUNDING = 1e-12
GEL, EPOXY = 1.41, 1.53


def reflected_by_angles(angle_deg, index_from, index_to):
    """Fresnel's sine and tangent laws, the mean of both polarisations (Born and Wolf, section 1.5.3)."""
    a = math.radians(angle_deg)
    b = math.asin(index_from / index_to * math.sin(a))
    s = math.sin(a - b) / math.sin(a + b)
    p = math.tan(a - b) / math.tan(a + b)
    return (s * s + p * p) / 2


def shares(angles_deg, index_from, index_to):
    return transmitted_share(np.cos(np.radians(angles_deg)), index_from, index_to)


@pytest.mark.parametrize(
    ("index_from", "index_to", "angles"),
    [
        (1.0, 1.5, (5.0, 30.0, 60.0, 85.0)),
        (1.41, 1.53, (10.0, 45.0, 70.0, 88.0)),
        (1.5, 1.0, (10.0, 30.0, 41.0)),
    ],
)
def test_transmission_keeps_to_fresnels_sine_and_tangent_laws(index_from, index_to, angles):
    expected = [1 - reflected_by_angles(angle, index_from, index_to) for angle in angles]
    assert shares(angles, index_from, index_to) == pytest.approx(expected, abs=ROUNDING)


def test_textbook_values_of_glass_in_air():
    # normal incidence ((1.5 - 1) / 2.5)^2 = 4 %; Brewster's angle atan 1.5 has R_p = 0, R_s = (1.25 / 3.25)^2
    assert 1 - shares(0.0, 1.0, 1.5) == pytest.approx(0.04, abs=ROUNDING)
    brewster = math.degrees(math.atan(1.5))
    assert 1 - shares(brewster, 1.0, 1.5) == pytest.approx((1.25 / 3.25) ** 2 / 2, abs=ROUNDING)
    assert 1 - shares(60.0, 1.0, 1.5) == pytest.approx(0.0892, abs=5e-5)  # 8.92 %, to the digits given


def test_nothing_passes_beyond_the_critical_angle_and_at_grazing():
    critical = math.degrees(math.asin(1 / GEL))
    assert shares([critical + 0.01, 60.0, 90.0], GEL, 1.0) == pytest.approx([0, 0, 0], abs=ROUNDING)
    assert shares(90.0, GEL, EPOXY) == pytest.approx(0.0, abs=1e-9)  # the cosine of 90 deg is 6e-17
    assert shares([0.0, 60.0, 90.0], GEL, GEL) == pytest.approx([1, 1, 1])


def test_snell_bends_as_the_textbook_says():
    # sin 45 / 1.5 = 0.4714: 28.126 deg
    inner = np.degrees(np.arccos(refracted_cosine(np.cos(np.radians(45.0)), 1.0, 1.5)))
    assert inner == pytest.approx(28.1255, abs=5e-5)


def receiver(**options):
    return Part.model_validate(own_part("receiver", **options))


def behind_epoxy(table=None, **options):
    if table is not None:
        angle_deg, relative = table
        sheet = {"angle_deg": list(angle_deg), "relative": list(relative), **SHEET}
        options["angular_response"] = sheet
    return receiver(epoxy_index=quantity(EPOXY, "1"), **options)


def test_a_bare_receiver_counts_everything():
    assert (response_nodes(receiver(), GEL) == 1.0).all()


def test_a_flat_chip_counts_what_the_face_lets_in():
    nodes = response_nodes(behind_epoxy(), GEL)  # half angle 60 deg: a flat chip
    assert nodes == pytest.approx(transmitted_share(cosine_nodes(), GEL, EPOXY), abs=ROUNDING)
    assert nodes[-1] == pytest.approx(1 - ((EPOXY - GEL) / (EPOXY + GEL)) ** 2, abs=ROUNDING)


def test_epoxy_of_the_gels_index_is_as_good_as_bare_for_a_flat_chip():
    assert (response_nodes(receiver(epoxy_index=quantity(GEL, "1")), GEL) == 1.0).all()


@pytest.mark.parametrize("half_angle", [15.0, 30.0, 50.0, 58.0])
def test_a_half_angle_in_air_is_where_half_of_the_response_is_left(half_angle):
    power = half_angle_power(half_angle, EPOXY)
    inner = math.asin(math.sin(math.radians(half_angle)) / EPOXY)
    entry = shares(half_angle, 1.0, EPOXY) / shares(0.0, 1.0, EPOXY)
    seen = math.cos(math.radians(half_angle)) * entry * math.cos(inner) ** power
    assert seen == pytest.approx(0.5, abs=ROUNDING)


def test_a_wide_half_angle_is_a_flat_chip():
    assert half_angle_power(60.0, EPOXY) == 0.0
    assert half_angle_power(65.0, EPOXY) == 0.0


def test_a_sheet_of_a_flat_chip_gives_the_flat_chip_back():
    # every degree of cosine times entry; between the points the sheet is linear: 1/8 (1 deg)^2 = 4e-5, over cos 80 deg
    angles = np.arange(0.0, 86.0)
    sheet = np.cos(np.radians(angles)) * shares(angles, 1.0, EPOXY)
    nodes = response_nodes(behind_epoxy((angles, sheet)), GEL)
    assert np.abs(nodes - response_nodes(behind_epoxy(), GEL)).max() < 4e-5 / np.cos(np.radians(80.0)) * 3


def test_a_chip_that_sees_less_at_an_angle_counts_less_there():
    # q halves from the axis to 60 deg in air, which is asin(sin 60 / 1.41) = 37.9 deg in the gel
    angles = np.arange(0.0, 90.0)
    chip = 1.0 - 0.5 * angles / 60.0
    sheet = np.clip(chip, 0, 1) * np.cos(np.radians(angles)) * shares(angles, 1.0, EPOXY)
    part = behind_epoxy((angles, sheet))
    gel_deg = math.degrees(math.asin(math.sin(math.radians(60.0)) / GEL))
    counted = np.interp(math.cos(math.radians(gel_deg)), cosine_nodes(1025), response_nodes(part, GEL, 1025))
    # nodes 1e-3 apart, sheet linear in a degree
    assert counted == pytest.approx(0.5 * shares(gel_deg, GEL, EPOXY), abs=2e-4)


def test_light_that_no_sheet_in_air_shows_counts_as_at_the_last_angle():
    angles = np.arange(0.0, 71.0, 5.0)
    part = behind_epoxy((angles, np.cos(np.radians(angles)) ** 3))
    c = cosine_nodes()
    beyond = GEL * np.sqrt(1 - c * c) > np.sin(np.radians(70.0)) + 1e-9
    ratio = response_nodes(part, GEL)[beyond] / np.maximum(
        shares(np.degrees(np.arccos(c[beyond])), GEL, EPOXY), 1e-300
    )
    assert beyond.sum() > 20
    assert np.ptp(ratio[1:]) < ROUNDING  # at c = 0 nothing enters


@pytest.mark.parametrize(("epoxy", "largest"), [(1.53, 2e-5), (1.42, 2e-5), (1.40, 1.6e-3), (1.0, 1.6e-3)])
def test_the_table_keeps_the_transmission_of_diffuse_light(epoxy, largest):
    fine = cosine_nodes(20001)
    part = receiver(epoxy_index=quantity(epoxy, "1"), half_angle_deg=quantity(60.0, "deg"))
    table = np.interp(fine, cosine_nodes(), response_nodes(part, GEL))
    error = 2 * np.trapezoid(fine * (table - transmitted_share(fine, GEL, epoxy)), fine)
    # what the module states: smooth T, and T with the root of a critical angle somewhere in a cell
    assert abs(error) < largest


def test_responses_are_shares():
    for relative in ((1.0, 1.0, 1.0), (1.0, 3.0, 0.0), (1.0, 0.0, 0.0)):
        nodes = response_nodes(behind_epoxy(((0.0, 45.0, 90.0), relative)), GEL)
        assert np.isfinite(nodes).all()
        assert (nodes >= 0).all()
        assert (nodes <= 1).all()
    lens = response_nodes(behind_epoxy(half_angle_deg=quantity(10.0, "deg")), GEL)
    assert (lens >= 0).all()
    assert (lens <= 1).all()
