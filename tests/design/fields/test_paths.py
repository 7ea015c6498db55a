"""Dotted paths: listing, reading, setting, and naming the nearest."""

from __future__ import annotations

import math
from typing import Any

import pytest

from optopad.design.errors import DesignError
from optopad.design.fields.base import get_at, known_paths, leaves, set_at
from optopad.design.fields.quantity import lambertian_order
from optopad.design.spec import SensorDesign

KNOWN = known_paths(SensorDesign)


def document() -> dict[str, Any]:
    return {"a": {"b": 1.0}, "layout": [{"count": 2}, {"count": 3}], "part_measurements": {}}


def test_all_fields_of_the_nested_models_are_known() -> None:
    assert {"cavity", "cavity.length_mm", "elastomer.refractive_index", "layout", "catalog.parts"} <= set(
        KNOWN
    )
    assert len(KNOWN) == len(set(KNOWN))


@pytest.mark.parametrize("path", [path for path, _ in leaves({"a": {"b": 1.0}, "layout": [{"count": 2}]})])
def test_what_is_set_is_what_is_read(path: str) -> None:
    changed = document()
    set_at(changed, path, "new", known=KNOWN)
    assert get_at(changed, path) == "new"


def test_a_first_measurement_makes_its_table() -> None:
    changed = document()
    set_at(changed, "part_measurements.my-led.active_width_mm", 2.0, known=KNOWN)
    assert changed["part_measurements"] == {"my-led": {"active_width_mm": 2.0}}


@pytest.mark.parametrize(
    ("path", "offer"),
    [
        ("cavity.lenght_mm", "cavity.length_mm"),
        ("clear_thickness_mm", "cavity.clear_thickness_mm"),
        ("operating.tip_radius_mm", "indenter.tip_radius_mm"),
        ("elastomer.ratio", "elastomer.mixing_ratio"),
        ("xyzzy", "`optopad schema` lists the fields"),
        ("", "`optopad schema` lists the fields"),
    ],
)
def test_an_unknown_path_offers_the_nearest(path: str, offer: str) -> None:
    with pytest.raises(DesignError) as caught:
        set_at(document(), path, 1.0, known=KNOWN)
    assert f"{path}" in str(caught.value)
    assert offer in str(caught.value)


@pytest.mark.parametrize(
    "path", ["layout.9.count", "layout.-3.count", "layout.one.count", "name.first", "cavity..x"]
)
def test_a_path_past_the_end_is_unknown(path: str) -> None:
    with pytest.raises(DesignError, match="no such field"):
        set_at(document() | {"name": "x", "cavity": {}}, path, 1.0, known=KNOWN)


def test_sixty_degrees_is_the_lambertian_order_itself():
    assert lambertian_order(60.0) == 1.0


@pytest.mark.parametrize("half_angle_deg", [10.0, 35.5, 65.0, 80.0])
def test_the_law_falls_to_one_half_at_the_half_angle(half_angle_deg):
    """To the twelve decimals that the order is rounded to, times ln cos of 10 degrees at most 5."""
    cosine = math.cos(math.radians(half_angle_deg))
    assert cosine ** lambertian_order(half_angle_deg) == pytest.approx(0.5, abs=1e-11)
