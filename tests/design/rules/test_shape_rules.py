"""Discs and crowned pads that must be refused by field; `tests/messages.txt` holds the words of each."""

from __future__ import annotations

import re
from typing import Any

import pytest

from optopad.design.draft import Draft
from optopad.design.errors import DesignError
from optopad.design.preset import FLAT_PRESETS, SHAPED_PRESETS, preset
from optopad.design.rules.check import check, require_valid
from optopad.design.rules.shape import deepest_modelled_mm, thinnest_elastic_mm
from optopad.design.spec import SensorDesign
from tests.said import says

DISC, CROWNED, DOME, FLAT = "levi2013-disc", "crowned-40x25", "fingertip-dome", "piacenza2017-pad"
RING = {"pattern": "disc_ring", "count": 4}
BY_WALL = {"pattern": "alternating_ring", "parts_per_side": 4}
ABSENT = object()

BAD: dict[str, tuple[str, dict[str, Any], str]] = {
    "a crown smaller than its disc": (DOME, {"crown.radius_mm": 10.0}, "crown.radius_mm"),
    "a crown that is a hemisphere": (DOME, {"crown.radius_mm": 11.2}, "crown.radius_mm"),
    "a cylinder narrower than its rectangle": (CROWNED, {"crown.radius_mm": 12.0}, "crown.radius_mm"),
    "a cylinder across the longer side": (
        CROWNED,
        {"crown.axis": "y", "crown.radius_mm": 21.0},
        "crown.radius_mm",
    ),
    "a sphere that ends before a rectangle's corners": (
        CROWNED,
        {"crown": {"shape": "sphere", "radius_mm": 22.0}},
        "crown.radius_mm",
    ),
    "a rim without silicone": (DOME, {"cavity.clear_thickness_mm": 4.0}, "cavity.clear_thickness_mm"),
    "a rim of no thickness at all": (DOME, {"cavity.clear_thickness_mm": 3.0}, "cavity.clear_thickness_mm"),
    "an infinite crown": (FLAT, {"crown": {"shape": "sphere", "radius_mm": 1e9}}, "crown.radius_mm"),
    "a concave crown": (FLAT, {"crown": {"shape": "sphere", "radius_mm": -40.0}}, "crown.radius_mm"),
    "a crown without a radius": (FLAT, {"crown": {"shape": "sphere"}}, "crown.radius_mm"),
    "a crown without a shape": (FLAT, {"crown": {"radius_mm": 60.0}}, "crown.shape"),
    "a crown of an unknown shape": (FLAT, {"crown": {"shape": "dome", "radius_mm": 60.0}}, "crown.shape"),
    "a cylinder without an axis": (FLAT, {"crown": {"shape": "cylinder", "radius_mm": 60.0}}, "crown"),
    "a sphere with an axis": (FLAT, {"crown": {"shape": "sphere", "radius_mm": 60.0, "axis": "x"}}, "crown"),
    "a disc with wall patterns": (DISC, {"layout": [BY_WALL]}, "layout.0.pattern"),
    "a disc with a wall pattern among others": (
        DISC,
        {"layout": [RING, {"pattern": "single", "kind": "emitter", "wall": "north", "along_mm": 3.0}]},
        "layout.1.pattern",
    ),
    "a rectangle with angles": (FLAT, {"layout": [RING]}, "layout.0.pattern"),
    "a disc with a length": (DISC, {"cavity.length_mm": 55.0}, "cavity"),
    "a disc without a diameter": (DISC, {"cavity.diameter_mm": ABSENT}, "cavity"),
    "a rectangle with a diameter": (FLAT, {"cavity.diameter_mm": 32.0}, "cavity"),
    "an unknown outline": (FLAT, {"cavity.outline": "oval"}, "cavity.outline"),
    "a disc in a block": (
        DISC,
        {"mold.outer_diameter_mm": ABSENT, "mold.outer_length_mm": 72.0, "mold.outer_width_mm": 72.0},
        "mold.outer_diameter_mm",
    ),
    "a round mold of a rectangle": (
        FLAT,
        {"mold.outer_length_mm": ABSENT, "mold.outer_width_mm": ABSENT, "mold.outer_diameter_mm": 60.0},
        "mold.outer_diameter_mm",
    ),
    "both sizes of a mold": (DISC, {"mold.outer_length_mm": 72.0}, "mold"),
    "a part above the rim of a dome": (DOME, {"receivers.height_mm": 4.6}, "receivers.height_mm"),
    "a body under the lid": (DOME, {"receivers.height_mm": 3.5}, "receivers.height_mm"),
    "a crown without fixing holes": (
        DOME,
        {"mold.fixing_hole_diameter_mm": 0.0},
        "mold.fixing_hole_diameter_mm",
    ),
    "a glass cover on a disc": (DISC, {"mold.cover_ledge_mm": 2.0}, "mold.cover_ledge_mm"),
    "a parted crowned mold": (CROWNED, {"mold.pieces": "frame_and_base"}, "mold.pieces"),
    "a disc too small for its parts": (
        DISC,
        {"cavity.diameter_mm": 9.0},
        "facet of osram-sfh206k is too wide",
    ),
    "parts side by side that overlap": (DISC, {"layout.0.count": 20}, "layout.0"),
    "two parts at one angle": (
        DISC,
        {"layout": [RING, {"pattern": "at_angles", "kind": "emitter", "angles_deg": [45.0]}]},
        "layout.1",
    ),
    "an angle beyond a turn": (
        DISC,
        {"layout": [{"pattern": "at_angles", "kind": "emitter", "angles_deg": [400.0]}]},
        "layout.0.angles_deg.0",
    ),
    "no angle at all": (
        DISC,
        {"layout": [{"pattern": "at_angles", "kind": "emitter", "angles_deg": []}]},
        "layout.0.angles_deg",
    ),
    "a wall too thin around a disc": (DISC, {"mold.outer_diameter_mm": 60.0}, "mold.outer_diameter_mm"),
    "no room to fill a crowned pad": ("small crown", {}, "cavity.width_mm"),
    "a press through the rim of a dome": (
        DOME,
        {"operating.max_depth_mm": 7.0, "indenter.tip_radius_mm": 4.5, "operating.workspace_margin_mm": 0.5},
        "operating.max_depth_mm",
    ),
}


def small_crown() -> SensorDesign:
    """A pad of 8 mm with a crown, of two small parts."""
    parts = [
        {"pattern": "single", "kind": kind, "wall": wall, "along_mm": 4.0}
        for kind, wall in (("emitter", "west"), ("receiver", "east"))
    ]
    size = {"cavity.length_mm": 8.0, "cavity.width_mm": 7.5, "crown.radius_mm": 60.0}
    return preset(CROWNED).with_(**size, layout=parts, **{"layout.0.along_mm": 3.7})


def refusal(base: str, changes: dict[str, Any]) -> str:
    """Everything that is wrong with a preset with some fields changed or taken away."""
    design = small_crown() if base == "small crown" else preset(base)
    document = design.model_dump(mode="json")
    for path, value in changes.items():
        *tables, last = path.split(".")
        place: Any = document
        for name in tables:
            place = place[int(name)] if isinstance(place, list) else place[name]
        if value is ABSENT:
            del place[last]
        else:
            place[last] = value
    try:
        found = SensorDesign.from_document(document, where="bad")
    except DesignError as err:
        return str(err)
    return "\n".join(str(one) for one in check(found) if one.severity == "error")


@pytest.mark.parametrize("what", BAD)
def test_a_bad_shape_is_refused_with_field_value_and_way_out(what: str) -> None:
    said = refusal(*BAD[what][:2])
    assert BAD[what][2] in said
    assert "nan" not in said.lower()


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_a_shaped_preset_has_no_finding_but_that_no_pair_of_an_even_ring_looks_across_its_middle(
    name: str,
) -> None:
    is_even_ring = preset(name).layout[0].pattern == "disc_ring"
    assert [one.field for one in check(preset(name))] == ["layout"] * is_even_ring
    require_valid(preset(name))


def test_a_ring_whose_middle_no_pair_looks_across_is_told_with_the_nearest_line() -> None:
    (finding,) = check(preset(DISC))
    assert (finding.severity, finding.field) == ("warning", "layout")
    assert "pair looks across" in finding.message
    assert "5.35 mm from the middle" in finding.value
    assert "the tip's radius, 3.00 mm" in finding.limit
    assert "odd count" in finding.way_out
    assert check(preset(DISC).with_(**{"layout.0.count": 7})) == ()


@pytest.mark.parametrize("name", FLAT_PRESETS)
def test_a_flat_pad_is_as_thick_at_the_border_of_its_workspace(name: str) -> None:
    cavity = preset(name).cavity
    assert thinnest_elastic_mm(Draft(preset(name))) == cavity.clear_thickness_mm + cavity.black_thickness_mm


def test_a_crown_is_thinnest_at_the_border_of_the_workspace() -> None:
    # a sphere of 18 mm, presses to 7 mm from the middle: 18 - sqrt(18² - 7²) = 1.417 mm less
    dome = preset(DOME)
    assert thinnest_elastic_mm(Draft(dome)) == pytest.approx(9.0 - 1.41689, abs=1e-4)
    assert deepest_modelled_mm(Draft(dome)) == pytest.approx(1.7 * 2.0)
    deep = dome.with_(**{"indenter.tip_radius_mm": 4.4, "operating.max_depth_mm": 6.5})
    assert any("outside the contact model" in str(one) for one in check(deep))


def test_a_tip_that_is_blunt_beside_the_crown_is_told() -> None:
    wide = preset(DOME).with_(**{"indenter.tip_radius_mm": 5.0, "operating.workspace_margin_mm": 2.4})
    said = [str(one) for one in check(wide) if one.severity == "warning"]
    assert any("contact model covers" in one and says(one, "5 mm on ... of 18") for one in said)


@pytest.mark.parametrize("name", SHAPED_PRESETS)
@pytest.mark.parametrize("radius_mm", [0.1, 5.0, 8.0, 11.5, 12.0, 16.0, 21.0, 1e6])
@pytest.mark.parametrize("margin_mm", [0.0, 5.0, 12.0])
def test_no_finding_has_a_number_that_is_none(name: str, radius_mm: float, margin_mm: float) -> None:
    crown = (
        {"crown.radius_mm": radius_mm}
        if preset(name).crown is not None
        else {"cavity.diameter_mm": radius_mm}
    )
    try:
        design = preset(name).with_(**crown, **{"operating.workspace_margin_mm": margin_mm})
    except DesignError as err:
        said = [str(err)]
    else:
        said = [str(one) for one in check(design)]
    assert not re.search(r"\b(nan|inf)\b", " ".join(said), re.IGNORECASE)
