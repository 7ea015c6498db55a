"""Parts in their walls and holes in the mold: every web against its hand-computed width."""

from __future__ import annotations

from typing import Any

import pytest

from design.rules import check
from design.spec import SensorDesign
from tests.design.rule_cases import BENCHMARK, about, and_more, facing, only, single
from tests.design.spec_fields import good, with_layout


def two_on_south(distance_mm: float, **changes: Any) -> SensorDesign:
    """An emitter 3.0 mm wide and a receiver 4.0 mm wide at a distance, and a pair that sees them."""
    return with_layout(
        facing(),
        single("emitter", "south", 12.0),
        single("receiver", "south", 12.0 + distance_mm),
        **BENCHMARK,
        **changes,
    )


def test_bodies_that_overlap_are_an_error_with_the_overlap() -> None:
    finding = only(two_on_south(3.4))
    assert finding.severity == "error"
    assert finding.field == "layout.2"
    assert "the bodies of E3 and R3 on the south wall overlap" in finding.message
    assert finding.value == "by 0.10 mm"  # 3.0 / 2 + 4.0 / 2 - 3.4


def test_a_web_between_sockets_is_at_least_what_the_printer_makes() -> None:
    touching = 1.5 + 2.0 + 2 * 0.15  # half bodies and a clearance each
    assert check(two_on_south(touching + 0.8)) == ()
    finding = only(two_on_south(touching + 0.79))
    assert "web between the sockets of E3 and R3" in finding.message
    assert (finding.value, finding.limit) == ("0.79 mm", "at least mold.min_web_mm = 0.80 mm")
    assert check(two_on_south(touching + 0.79, **{"mold.min_web_mm": 0.7})) == ()


def test_many_thin_webs_on_a_wall_are_one_finding_that_counts_them() -> None:
    finding = about(with_layout(facing(8, 4.0), **BENCHMARK), "sockets of R")
    assert finding.message.startswith("the web between the sockets of R1 and R2 on the east wall is too thin")
    assert finding.message.endswith("(and 6 more places)")


@pytest.mark.parametrize(
    ("along_mm", "is_fine"), [(2.45, True), (2.44, False), (29.55, True), (29.56, False)]
)
def test_a_socket_keeps_a_web_to_both_ends_of_its_wall(along_mm: float, is_fine: bool) -> None:
    design = and_more(single("emitter", "south", along_mm), **{"mold.fixing_hole_diameter_mm": 0.0})
    if is_fine:  # 1.5 of body, 0.15 of clearance, 0.8 of web
        assert check(design) == ()
    else:
        assert only(design).value == "0.79 mm to the corner"


def test_parts_that_would_meet_around_a_corner_are_both_refused() -> None:
    design = with_layout(
        facing(),
        single("emitter", "south", 0.5),
        single("receiver", "west", 1.0),
        **BENCHMARK,
        **{"mold.fixing_hole_diameter_mm": 0.0},
    )
    assert {f.field for f in check(design)} == {"layout.1", "layout.2"}
    assert about(design, "end of the south wall").value == "-1.15 mm to the corner"
    assert about(design, "end of the west wall").value == "-1.15 mm to the corner"


@pytest.mark.parametrize("axis", ["length", "width"])
def test_a_wall_is_as_thick_as_its_deepest_socket_and_a_web(axis: str) -> None:
    fitting = {"mold.fixing_hole_diameter_mm": 0.0, f"mold.outer_{axis}_mm": 32.0 + 2 * (1.5 + 0.15 + 0.8)}
    assert check(and_more(**fitting)) == ()
    tight = fitting | {f"mold.outer_{axis}_mm": 36.88}
    finding = only(and_more(**tight))
    assert finding.field == f"mold.outer_{axis}_mm"
    assert finding.value == "outside 36.88 mm leaves 2.44 mm of wall"
    assert finding.limit == "at least 2.45 mm"


def test_an_outside_smaller_than_the_inside_is_an_error_even_without_parts_in_that_wall() -> None:
    design = with_layout(
        facing(), **BENCHMARK, **{"mold.outer_width_mm": 30.0, "mold.fixing_hole_diameter_mm": 0.0}
    )
    assert only(design).value == "outside 30 mm leaves -1.00 mm of wall"


def test_a_socket_leaves_a_floor_below_it() -> None:
    # receiver: base 2.0 below its centre, clearance 0.15; bed at -1 - 0.6
    fitting = {"receivers.height_mm": 1.35, "mold.floor_mm": 0.6, "mold.min_web_mm": 0.8}
    assert check(with_layout(facing(), **BENCHMARK, **fitting)) == ()
    finding = only(with_layout(facing(), **BENCHMARK, **(fitting | {"receivers.height_mm": 1.34})))
    assert finding.field == "receivers.height_mm"
    assert finding.value == "0.79 mm"


def test_a_body_above_the_rim_is_a_warning() -> None:
    # receiver: top 2.0 above its centre; rim at 8 + 1.5
    assert check(with_layout(facing(), **BENCHMARK, **{"receivers.height_mm": 6.6, "mold.rim_mm": 0.6})) == ()
    finding = only(with_layout(facing(), **BENCHMARK, **{"receivers.height_mm": 6.6, "mold.rim_mm": 0.5}))
    assert finding.severity == "warning"
    assert "the body of R1 on the east wall sticks out above the rim (and 1 more place)" in finding.message
    assert finding.value == "by 0.10 mm"


def test_a_height_given_in_the_layout_is_named_there() -> None:
    design = and_more(single("emitter", "south", 16.0, height_mm=0.3))
    assert only(design).field == "layout.3.height_mm"


@pytest.mark.parametrize(
    ("diameter_mm", "setback_mm", "what", "value"),
    [
        (1.45, 2.05, "between the lead holes", "0.79 mm"),  # holes of 1.75 at a pitch of 2.54
        (1.0, 1.44, "from the lead holes to the cavity", "0.79 mm"),  # holes of 1.3
        (1.0, 3.60, "from the lead holes to the socket's edge", "0.00 mm"),  # socket 4.1 + 0.15 deep
    ],
)
def test_lead_holes_of_a_radial_part_keep_a_web(
    diameter_mm: float, setback_mm: float, what: str, value: str
) -> None:
    leads = "part_measurements.osram-sfh206k.lead_"
    assert check(good(**{f"{leads}diameter_mm": 1.44, f"{leads}setback_mm": 2.05})) == ()
    finding = only(good(**{f"{leads}diameter_mm": diameter_mm, f"{leads}setback_mm": setback_mm}))
    assert (finding.severity, finding.field) == ("error", "mold.lead_clearance_mm")
    assert what in finding.message
    assert finding.value == value


@pytest.mark.parametrize(
    ("inset_mm", "what", "value"),
    [
        (2.3, "the outer face", "0.70 mm"),
        (6.5, "the cavity", "-1.60 mm"),
        (22.0, "the next fixing hole", "-2.20 mm"),
    ],
)
def test_a_fixing_hole_keeps_a_web_to_everything(inset_mm: float, what: str, value: str) -> None:
    finding = about(good(**{"mold.fixing_hole_inset_mm": inset_mm}), f"fixing hole and {what} ")
    assert finding.severity == "error"
    assert finding.value == value


def test_a_fixing_hole_into_a_socket_is_an_error_that_names_the_part() -> None:
    # hole of radius 1.6 centred at (0.5, -2.5); the wires' slot runs outward from x = 0.85 on
    thick = {"mold.outer_length_mm": 42.0, "mold.outer_width_mm": 48.0, "mold.fixing_hole_inset_mm": 5.5}
    design = and_more(single("emitter", "south", 2.5), **thick)
    finding = only(design)
    assert "a fixing hole and the socket of E4 is too thin" in finding.message
    assert finding.value == "-1.25 mm"
    assert finding.field == "mold.fixing_hole_inset_mm"
    assert finding.severity == "error"
    assert check(design.with_(**{"mold.fixing_hole_diameter_mm": 0.0})) == ()
