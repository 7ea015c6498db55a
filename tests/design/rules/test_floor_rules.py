"""Rules for parts on the floor, and for a skin on the top."""

from __future__ import annotations

from typing import Any

import pytest

from optopad.design.errors import DesignError
from optopad.design.fields.finding import OUT_OF_SCOPE
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from tests.design.rules.rule_cases import BENCHMARK, about, only, single
from tests.design.spec.spec_fields import with_layout

BOARD = {"pattern": "checkerboard", "columns": 4, "rows": 4, "pitch_mm": 6.0}
"""Emitters' bodies are 3 x 3, receivers' 4 x 4 mm, and all are 1.5 mm high."""
BLACK = {
    "cavity.black_thickness_mm": 1.0,
    "operating.max_depth_mm": 2.0,
    "emitters.height_mm": None,
    "receivers.height_mm": None,
}
SKIN = {"finish": "diffuse", "reflectance": 0.6}


def floor(*patterns: dict[str, Any], **changes: Any) -> SensorDesign:
    return with_layout(*(patterns or (BOARD,)), **(BENCHMARK | BLACK | changes))


def at(x_mm: float, y_mm: float, kind: str = "receiver", **more: Any) -> dict[str, Any]:
    return {"pattern": "single", "kind": kind, "wall": "floor", "x_mm": x_mm, "y_mm": y_mm} | more


def test_a_checkerboard_has_no_finding() -> None:
    assert check(floor()) == ()


def test_bodies_keep_a_gap_on_the_board() -> None:
    size = cavity_of(floor()).receivers[0].part
    assert (size.body_width_mm.value, size.body_height_mm.value) == (4.0, 4.0)
    row = BOARD | {"rows": 1}
    near = 0.5 * (3.0 + 4.0) + 0.2
    assert check(floor(row | {"pitch_mm": near})) == ()
    finding = about(floor(row | {"pitch_mm": near - 0.1}), "too near to each other on the board")
    assert (finding.severity, finding.value, finding.limit) == ("error", "0.10 mm apart", "at least 0.20 mm")
    overlap = about(floor(row | {"pitch_mm": 3.0}), "too near to each other on the board")
    assert overlap.value == "they overlap by 0.50 mm"


def test_the_two_halves_of_a_coupler_touch() -> None:
    couplers = {
        "pattern": "grid",
        "kind": "coupler",
        "columns": 3,
        "rows": 3,
        "pitch_mm": 8.0,
        "apart_mm": 2.6,
    }
    chip = {"emitters.part": "vishay-vcnl4040-emitter", "receivers.part": "vishay-vcnl4040-receiver"}
    design = floor(couplers, **chip)
    assert not [one for one in check(design) if one.severity == "error"]
    emitter, receiver = (
        one[0].footprint_mm for one in (cavity_of(design).emitters, cavity_of(design).receivers)
    )
    assert emitter[:, 0].max() == pytest.approx(receiver[:, 0].min())
    assert receiver[:, 0].max() - emitter[:, 0].min() == pytest.approx(4.0)
    crowded = floor(couplers | {"pitch_mm": 4.1}, **chip)
    assert about(crowded, "too near to each other").value == "0.10 mm apart"


@pytest.mark.parametrize(("x_mm", "value"), [(2.1, "R9 0.10 mm inside it"), (1.5, "R9 0.50 mm past it")])
def test_bodies_stay_clear_of_the_frame(x_mm: float, value: str) -> None:
    assert check(floor(BOARD, at(2.2, 16.0))) == ()
    finding = about(floor(BOARD, at(x_mm, 16.0)), "under the wall of the frame")
    assert (finding.severity, finding.field, finding.value) == ("error", "layout.1", value)


def test_a_level_part_needs_room_behind_it() -> None:
    assert check(floor(BOARD, at(1.7, 16.0, "emitter", tilt_deg=90.0))) == ()
    about(floor(BOARD, at(1.6, 16.0, "emitter", tilt_deg=90.0)), "under the wall of the frame")
    about(floor(BOARD, at(1.6, 16.0, "emitter", tilt_deg=90.0, turn_deg=90.0)), "under the wall of the frame")


def test_the_black_layer_must_not_cover_a_face() -> None:
    assert check(floor(**{"cavity.black_thickness_mm": 1.5})) == ()
    found = [
        one for one in check(floor(**{"cavity.black_thickness_mm": 1.6})) if "covers the face" in one.message
    ]
    assert {one.severity for one in found} == {"error"}
    assert found[0].field == "cavity.black_thickness_mm"
    assert found[0].limit == "at most 1.50 mm of black layer"


def test_a_body_cannot_be_inside_the_board() -> None:
    assert check(floor(BOARD, at(2.5, 2.5, height_mm=0.5))) == ()
    finding = about(floor(BOARD, at(2.5, 2.5, height_mm=0.4)), "inside the circuit board")
    assert (finding.field, finding.limit.split(",")[0]) == ("layout.1.height_mm", "at least 0.50 mm")


def test_a_face_above_the_layer_is_refused() -> None:
    finding = about(floor(BOARD, at(2.5, 2.5, height_mm=8.0)), "higher than the clear layer")
    assert (finding.severity, finding.field) == ("error", "layout.1.height_mm")
    assert finding.limit.startswith("less than 8.00 mm")


def test_a_press_must_not_reach_a_body_that_the_tip_passes_over() -> None:
    high = at(16.0, 10.0, "emitter", height_mm=5.0), at(22.0, 10.0)
    finding = about(floor(*high, **{"operating.max_depth_mm": 3.0}), "reaches the body of E1")
    assert (finding.severity, finding.limit.split(",")[0]) == ("error", "less than 3.00 mm")
    thin = about(floor(*high, **{"operating.max_depth_mm": 2.5}), "silicone over the body of E1 is thin")
    assert (thin.severity, thin.limit.split(",")[0]) == ("warning", "at most 2.40 mm")
    aside = at(2.5, 2.5, "emitter", height_mm=5.0), at(16.0, 10.0)
    assert not [one for one in check(floor(*aside)) if "the body of" in one.message]


def test_parts_in_walls_and_on_the_floor_are_not_mixed() -> None:
    mixed = with_layout(
        BOARD, single("emitter", "north", 16.0), **(BENCHMARK | BLACK | {"emitters.height_mm": 4.0})
    )
    finding = about(mixed, "in the walls and on the floor")
    assert (finding.severity, finding.value) == ("error", "1 in walls (E9 first), 16 on the floor")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("mold.pieces", "frame_and_base"),
        ("mold.cover_ledge_mm", 1.0),
        ("surfaces.wall_finish", "glossy"),
        ("mold.fits", {"generic-emitter": "press"}),
    ],
)
def test_options_of_a_mold_with_sockets_are_refused(path: str, value: Any) -> None:
    errors = [one for one in check(floor(**{path: value})) if one.severity == "error"]
    assert [one.field.startswith(path) for one in errors] == [True]


def test_parts_too_far_apart_have_no_light_from_each_other() -> None:
    wide = {"cavity.length_mm": 60.0, "mold.outer_length_mm": 73.0}
    design = floor(at(5.0, 16.0, "emitter"), at(55.0, 16.0), **wide)
    finding = about(design, "near enough for light by way of the top")
    assert (finding.severity, finding.value) == ("error", "50.00 mm to the nearest")


def test_a_skin_needs_its_light() -> None:
    with pytest.raises(
        DesignError, match="reflectance is missing: a skin needs its finish and its reflectance"
    ):
        floor(top={"finish": "diffuse"})
    assert check(floor(top=SKIN)) == ()


def test_a_stiff_skin_is_outside_the_contact_model() -> None:
    soft = floor(top=SKIN | {"thickness_mm": 0.05, "youngs_modulus_mpa": 0.1})
    assert check(soft) == ()
    finding = only(floor(top=SKIN | {"thickness_mm": 0.1, "youngs_modulus_mpa": 3000.0}))
    assert (finding.field, finding.weight) == ("top.thickness_mm", OUT_OF_SCOPE)


def test_light_under_a_skin_needs_diffuse_walls() -> None:
    walls = with_layout(
        {"pattern": "alternating_ring", "parts_per_side": 4}, top=SKIN, **{"surfaces.wall_finish": "glossy"}
    )
    assert about(walls, "light under a skin").field == "surfaces.wall_finish"
