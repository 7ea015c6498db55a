"""Parts in their walls and holes in the mold: every web against its hand-computed width."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.draft import Draft
from optopad.design.fields.finding import Finding
from optopad.design.mold.outline import outline_of
from optopad.design.mold.webs import Clearance, clearances, rim_clearances
from optopad.design.preset import preset
from optopad.design.rules.check import check, notes
from optopad.design.rules.mold import WORDS, web_findings
from optopad.design.rules.touch import largest_ball_mm
from optopad.design.spec import SensorDesign
from tests.design.rules.rule_cases import BENCHMARK, about, and_more, facing, only, single
from tests.design.spec.spec_fields import good, with_layout
from tests.said import says


def mold_of(design: SensorDesign) -> tuple[Clearance, ...]:
    return clearances(outline_of(design), design.mold)


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
    assert "E3 and R3" in finding.message
    assert finding.value == "by 0.10 mm"  # 3.0 / 2 + 4.0 / 2 - 3.4


def test_a_web_between_sockets_is_at_least_what_the_printer_makes() -> None:
    touching = 1.5 + 2.0 + 2 * 0.15  # half bodies and a clearance each
    assert check(two_on_south(touching + 0.8)) == ()
    finding = only(two_on_south(touching + 0.79))
    assert "E3 and R3" in finding.message
    assert (finding.value, finding.limit) == ("0.79 mm", "at least mold.min_web_mm = 0.80 mm")
    assert check(two_on_south(touching + 0.79, **{"mold.min_web_mm": 0.7})) == ()


def test_many_thin_webs_on_a_wall_are_one_finding_that_counts_them() -> None:
    finding = about(with_layout(facing(8, 4.0), **BENCHMARK), "sockets of R")
    assert "R1 and R2" in finding.message
    assert finding.message.endswith("(and 6 more positions)")


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
    assert "behind the socket" in finding.message
    assert (finding.value, finding.limit) == ("0.79 mm", "at least mold.min_web_mm = 0.80 mm")
    assert f"raise mold.outer_{axis}_mm by 0.02 mm" in finding.way_out


def test_an_outside_smaller_than_the_inside_is_an_error_even_without_parts_in_that_wall() -> None:
    design = with_layout(
        facing(), **BENCHMARK, **{"mold.outer_width_mm": 30.0, "mold.fixing_hole_diameter_mm": 0.0}
    )
    finding = only(design)
    assert "south and north" in finding.message
    assert finding.value == "-1.00 mm"
    assert "raise mold.outer_width_mm by 3.60 mm" in finding.way_out


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
    assert says(finding.message, "R1 on ... 1 more")
    assert finding.value == "by 0.10 mm"


def test_a_height_given_in_the_layout_is_named_there() -> None:
    design = and_more(single("emitter", "south", 16.0, height_mm=0.3))
    assert only(design).field == "layout.3.height_mm"


@pytest.mark.parametrize(
    ("diameter_mm", "setback_mm", "what", "value"),
    [
        (1.45, 2.05, "between the lead holes", "0.79 mm"),  # holes of 1.75 at a pitch of 2.54
        (1.0, 1.44, "lead holes", "0.79 mm"),  # holes of 1.3
        (1.0, 3.60, "socket's edge", "0.00 mm"),  # socket 4.1 + 0.15 deep
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
        (6.5, "cover seat", "-3.10 mm"),  # centred on the cavity's corner, lip of 1.5
        (22.0, "the next fixing hole", "-2.20 mm"),
    ],
)
def test_a_fixing_hole_keeps_a_web_to_everything(inset_mm: float, what: str, value: str) -> None:
    finding = about(good(**{"mold.fixing_hole_inset_mm": inset_mm}), what)
    assert finding.severity == "error"
    assert finding.value == value


def test_a_fixing_hole_into_a_wire_slot_is_an_error_that_names_the_part() -> None:
    # hole of radius 1.6 centred at (0.5, -6.5); the wires' slot runs outward from x = 0.85 on
    thick = {"mold.outer_length_mm": 42.0, "mold.outer_width_mm": 56.0, "mold.fixing_hole_inset_mm": 5.5}
    design = and_more(single("emitter", "south", 2.5), **thick)
    finding = only(design)
    assert "E4 on" in finding.message
    assert finding.value == "-1.25 mm"
    assert finding.field == "mold.fixing_hole_inset_mm"
    assert finding.severity == "error"
    assert check(design.with_(**{"mold.fixing_hole_diameter_mm": 0.0})) == ()


def test_a_fixing_hole_into_a_socket_is_an_error_that_names_the_part() -> None:
    # hole of radius 1.6 centred at (0.25, -5.25); the socket is 4.1 + 0.15 deep, from x = 0.85 on
    thick = {"mold.outer_length_mm": 38.0, "mold.outer_width_mm": 49.0, "mold.fixing_hole_inset_mm": 3.25}
    finding = only(and_more(single("receiver", "south", 3.55, part="osram-sfh206k"), **thick))
    assert "R4 on" in finding.message
    assert finding.value == f"{math.hypot(0.6, 1.0) - 1.6:.2f} mm"
    assert (finding.severity, finding.field) == ("error", "mold.fixing_hole_inset_mm")


def test_a_socket_that_starts_at_the_surface_is_an_error() -> None:
    # emitter of a measured base 0.5 below its centre, clearance 0.15; surface at 8
    base = {"part_measurements.generic-emitter.active_height_in_body_mm": 0.5}
    assert check(with_layout(facing(), **BENCHMARK, **base, **{"emitters.height_mm": 7.0})) == ()
    finding = about(with_layout(facing(), **BENCHMARK, **base, **{"emitters.height_mm": 7.95}), "too shallow")
    assert "E1 on" in finding.message
    assert (finding.severity, finding.field, finding.value) == ("error", "emitters.height_mm", "0.70 mm")


def test_every_clearance_has_its_words_and_every_words_a_clearance() -> None:
    leads = {"part_measurements.osram-sfh206k.lead_pitch_mm": 2.5}
    ring = with_layout({"pattern": "alternating_ring", "parts_per_side": 4}, **leads)
    overlapping = two_on_south(3.4)
    covered = with_layout(
        {"pattern": "alternating_ring", "parts_per_side": 4}, **{"mold.cover_ledge_mm": 1.0}
    )
    found = [*mold_of(ring), *mold_of(overlapping), *rim_clearances(outline_of(ring)), *mold_of(covered)]
    assert {one.name for one in found} == set(WORDS)


def places_more(finding: Finding) -> int:
    """How many places a finding counts beside the one that it names."""
    counted = re.search(r"\(and (\d+) more position", finding.message)
    return int(counted[1]) if counted else 0


@settings(max_examples=100)
@given(
    st.floats(30.0, 60.0),
    st.floats(0.0, 9.0),
    st.floats(0.6, 4.0),
    st.floats(1.5, 8.5),
    st.floats(0.5, 31.5),
    st.sampled_from(["generic-receiver", "osram-sfh206k"]),
)
def test_the_rules_refuse_a_mold_exactly_if_a_clearance_is_not_kept(
    outer_mm: float, inset_mm: float, floor_mm: float, height_mm: float, along_mm: float, part: str
) -> None:
    design = and_more(
        single("emitter", "south", along_mm),
        single("receiver", "west", along_mm, part=part),
        **{
            "mold.outer_length_mm": outer_mm,
            "mold.floor_mm": floor_mm,
            "mold.fixing_hole_inset_mm": inset_mm,
            "emitters.height_mm": height_mm,
        },
    )
    broken = [one for one in mold_of(design) if not one.is_kept]
    errors = [finding for finding in web_findings(Draft(design)) if finding.severity == "error"]
    assert bool(errors) == bool(broken)
    assert {finding.field for finding in errors} <= {one.field for one in broken}
    assert sum(1 + places_more(finding) for finding in errors) == len(broken)


def radii_of(found: Finding) -> list[float]:
    return [float(text) for text in re.findall(r"up to (?:a radius of )?([0-9.]+) mm", found.value)]


def test_a_flat_pad_below_its_rim_is_noted_with_what_never_touches_it():
    found, fit = notes(preset("piacenza2017-pad"))
    assert (found.severity, found.field) == ("note", "mold.rim_mm")
    assert "no flat or straight object that spans the opening touches" in found.message
    assert found.value.startswith("1.50 mm below")
    assert "1.45 mm" in found.way_out
    assert (fit.severity, fit.field) == ("note", "cavity.length_mm")


def test_the_radii_that_touch_and_press_are_those_of_balls_on_the_opening():
    pad = preset("piacenza2017-pad")
    touching, pressing = radii_of(notes(pad)[0])
    half = 16.0 + 1.5  # the lip opens the rim
    for radius, sunk in ((touching, 1.5), (pressing, 1.5 + pad.operating.max_depth_mm)):
        assert radius - (radius**2 - half**2) ** 0.5 == pytest.approx(sunk, abs=0.03)


@pytest.mark.parametrize(
    ("name", "rim"), [("piacenza2017-pad", 1.5), ("fingertip-16", 4.0), ("gripper-stadium", 9.0)]
)
def test_the_largest_ball_is_clear_of_the_mold_and_a_larger_one_is_not(name: str, rim: float):
    """The mold's section: wall, lip and rim; a ball at depth 1 mm is outside of it."""
    outline = Draft(preset(name).with_(**{"mold.rim_mm": rim})).outline
    half, lip, above = (
        min(outline.length_mm, outline.width_mm) / 2,
        outline.lip_mm,
        outline.highest_mm - outline.fill_mm,
    )
    steps = np.linspace(0.0, 1.0, 500)
    x = np.concatenate([np.full(500, half), half + lip * steps])
    z = np.concatenate([(above - lip) * steps, above - lip + lip * steps])
    room = {
        share: float((np.hypot(x, z + 1.0 - share * radius) - share * radius).min())
        for radius in [largest_ball_mm(outline, 1.0)]
        for share in (0.999, 1.001)
    }
    assert room[0.999] >= 0.0 > room[1.001]


def test_a_flush_pad_is_touched_but_not_pressed_by_flat_objects():
    flush, _ = notes(preset("fingertip-16").with_(**{"mold.rim_mm": 0.0}))
    assert "cannot press" in flush.message
    assert "crown" in flush.way_out
    sunk, _ = notes(preset("fingertip-16"))
    assert "set mold.rim_mm = 0" in sunk.way_out


def test_a_crown_is_pressed_by_flat_objects_until_they_meet_the_rim():
    dome = preset("fingertip-dome")
    assert notes(dome) == ()  # prouder of its rim than the deepest press
    (low,) = notes(dome.with_(**{"mold.rim_mm": 1.0}))
    proud = float(low.value.split(" mm")[0])
    outline = Draft(dome).outline
    assert proud == pytest.approx(outline.plan.clear_mm - outline.fill_mm - 1.0, abs=0.01)
    (straight,) = notes(preset("crowned-40x25"))
    assert "cannot press" in straight.message
    assert "both ends of x" in straight.value


def test_the_flat_face_that_fits_is_away_from_the_walls():
    """At 0.15 of both layers, which the model of pressed objects needs (tests/sims/contact/held)."""
    teensy, stadium = (notes(preset(name))[1].value for name in ("gripper-teensy", "gripper-stadium"))
    assert teensy.startswith("flat faces to 28.2 x 20.2 mm, cylinders to 28.2 mm long")
    assert stadium.startswith("flat faces to 12.2 mm across, cylinders to 10.0 mm long")
