"""Outlines of tips: closed, tangent, and of the volume that geometry says."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.spec import Indenter
from optopad.design.spec.indenter import Piece, tip_outline, tip_words
from tests.cad.volumes import tip_volume_mm3
from tests.design.spec.spec_fields import good
from tests.said import says


def tip(**fields: Any) -> Indenter:
    return Indenter(**fields)


def angles(piece: Piece) -> tuple[float, float]:
    """Angle of the tangent to the radial direction at both ends [rad]."""
    if piece.radius == 0.0:
        (r0, h0), (r1, h1) = piece.start, piece.end
        angle = math.atan2(h1 - h0, r1 - r0)
        return angle, angle
    first, last = (math.atan2(r - piece.centre[0], piece.centre[1] - h) for r, h in (piece.start, piece.end))
    return first, last


def test_a_hemisphere_is_a_quarter_circle_of_two_thirds_pi_r_cubed() -> None:
    (piece,) = tip_outline(tip(tip_radius_mm=3.0))
    assert (piece.start, piece.end) == ((0.0, 0.0), (3.0, 3.0))
    assert (piece.centre, piece.radius) == ((0.0, 3.0), 3.0)
    assert tip_volume_mm3(tip(tip_radius_mm=3.0)) == pytest.approx(2 / 3 * math.pi * 27.0, rel=1e-14)


@given(
    radius=st.floats(0.5, 20.0),
    edge=st.floats(0.1, 1.0),
    apex=st.floats(0.1, 1.0),
    half_angle=st.floats(20.0, 85.0),
    shape=st.sampled_from(["cone", "flat_punch"]),
)
def test_pieces_follow_each_other_without_a_gap_or_a_kink_and_end_on_the_shank(
    radius: float, edge: float, apex: float, half_angle: float, shape: str
) -> None:
    fields: dict[str, Any] = {"edge_radius_mm": edge * radius}
    if shape == "cone":
        fields |= {"apex_radius_mm": apex * radius, "cone_half_angle_deg": half_angle}
    pieces = tip_outline(tip(tip_radius_mm=radius, shape=shape, **fields))
    assert pieces[0].start == (0.0, 0.0)
    assert angles(pieces[0])[0] == 0.0
    assert pieces[-1].end[0] == pytest.approx(radius, rel=1e-12)
    assert angles(pieces[-1])[1] == pytest.approx(math.pi / 2, abs=1e-7)
    for one, next_ in pairwise(pieces):
        assert one.end == pytest.approx(next_.start, abs=1e-9 * radius)
        lengths = [math.hypot(p.end[0] - p.start[0], p.end[1] - p.start[1]) for p in (one, next_)]
        if min(lengths) > 1e-6 * radius:  # a shorter piece has no direction to speak of
            assert angles(one)[1] == pytest.approx(angles(next_)[0], abs=1e-6)


def test_a_punch_with_an_edge_of_its_own_radius_and_such_a_cone_are_hemispheres() -> None:
    punch = tip(tip_radius_mm=2.0, shape="flat_punch", edge_radius_mm=2.0)
    cone = tip(tip_radius_mm=2.0, shape="cone", apex_radius_mm=2.0, edge_radius_mm=2.0)
    for shape in (punch, cone):
        assert tip_volume_mm3(shape) == pytest.approx(2 / 3 * math.pi * 8.0, rel=1e-12)
        assert tip_outline(shape)[-1].end[1] == pytest.approx(2.0, rel=1e-12)


def test_volumes_are_those_of_slices() -> None:
    for shape in (
        tip(shape="flat_punch", edge_radius_mm=0.7),
        tip(shape="cone", cone_half_angle_deg=50.0, apex_radius_mm=0.4, edge_radius_mm=0.9),
        tip(shape="profile", profile_mm=((0.0, 0.0), (1.0, 0.1), (2.0, 1.5), (3.0, 1.6))),
    ):
        total = 0.0
        for piece in tip_outline(shape):
            first, last = angles(piece)
            share = np.linspace(0.0, 1.0, 20001)
            if piece.radius:
                angle = first + (last - first) * share
                r = piece.centre[0] + piece.radius * np.sin(angle)
                h = piece.centre[1] - piece.radius * np.cos(angle)
            else:
                r = piece.start[0] + (piece.end[0] - piece.start[0]) * share
                h = piece.start[1] + (piece.end[1] - piece.start[1]) * share
            total += float(np.sum(np.pi * 0.25 * (r[1:] + r[:-1]) ** 2 * np.diff(h)))
        # midpoint rule with 20000 slices a piece: error of the order of 1/20000²
        assert tip_volume_mm3(shape) == pytest.approx(total, rel=1e-7)


def test_a_sharp_cone_has_a_third_of_its_cylinder() -> None:
    cone = tip(shape="profile", profile_mm=((0.0, 0.0), (3.0, 2.0)))
    assert tip_volume_mm3(cone) == pytest.approx(math.pi * 9.0 * 2.0 / 3.0, rel=1e-14)


def test_roundings_that_are_not_given_are_a_tenth_of_the_tip() -> None:
    bare, full = (
        tip_outline(tip(tip_radius_mm=4.0, shape="cone", **fields))
        for fields in ({}, {"apex_radius_mm": 0.4, "edge_radius_mm": 0.4, "cone_half_angle_deg": 60.0})
    )
    assert bare == full


def test_a_hemisphere_is_its_radius_alone_and_keeps_its_digest() -> None:
    assert good().indenter.model_dump() == {"tip_radius_mm": 3.0}
    assert good(**{"indenter.shape": "hemisphere"}).digest == good().digest
    assert good(**{"indenter.shape": "cone"}).digest != good().digest


def test_a_tip_is_told_in_words() -> None:
    assert tip_words(tip()) == "hemisphere of 3 mm radius"
    assert says(tip_words(tip(shape="flat_punch")), "3 mm radius ... 0.3 mm")
    assert "60 degrees" in tip_words(tip(shape="cone"))
    assert "profile of 2 points" in tip_words(tip(shape="profile", profile_mm=((0.0, 0.0), (3.0, 1.0))))
