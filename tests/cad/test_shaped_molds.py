"""Discs and crowned pads: round molds, the lid that casts a crown, and both against formula and optical model."""

import io
import json
import math
from functools import cache

import numpy as np
import pytest
import trimesh

from optopad.cad.checks import design_findings
from optopad.cad.export import export_parts, part_files
from optopad.cad.lid import DRAFT_DEG, OVER_CROWN_MM, lid, lid_size, turned_over
from optopad.cad.mesh import CHORD_LIMIT_MM, CHORD_MM, mesh_of, read_stl
from optopad.cad.mold import build_mold
from optopad.cad.tools import BLADE_PLAY_MM, blade_size, gauge_size, leveling_blade
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.preset import FLAT_PRESETS, SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from tests.cad.agreement import cavity_agreement, dish_agreement, first_hits_mm, forms_top
from tests.cad.conftest import presets
from tests.cad.volumes import lid_volume_mm3, mold_volume_mm3

DISC, CROWNED, DOME, STADIUM = (preset(name) for name in SHAPED_PRESETS)
CROWNS = ("crowned-40x25", "fingertip-dome")
ROUNDING = 1e-9  # of a volume from sums of doubles
LID_ROUNDING = 1e-7  # of the kernel's integrals over faces with curved borders, where the adaptive rule ends
SINGLE_PRECISION_MM = 1e-4  # coordinates in a file, below 400 mm

SPHERE = {"crown": {"shape": "sphere", "radius_mm": 120.0}}
OPTIONS = {
    "a dome with a rim": DOME.with_(**{"mold.rim_mm": 1.5}),
    "a dome flush with its rim": DOME.with_(**{"mold.rim_mm": 3.6785999287779125}),
    "a sphere on a rectangle": CROWNED.with_(**SPHERE),
    "a sphere below the rim": CROWNED.with_(**{**SPHERE, "mold.rim_mm": 4.0, "mold.label": "S8"}),
    "a cylinder along y": CROWNED.with_(**{"crown.axis": "y", "crown.radius_mm": 90.0}),
    "a cylinder below the rim": CROWNED.with_(**{"mold.rim_mm": 1.0}),
    "a cylinder on a disc": DOME.with_(**{"crown": {"shape": "cylinder", "radius_mm": 18.0, "axis": "x"}}),
    "an almost flat sphere": CROWNED.with_(**{"crown": {"shape": "sphere", "radius_mm": 90_000.0}}),
    "an almost flat cylinder": CROWNED.with_(**{"crown.radius_mm": 90_000.0}),
    "radial parts around a dome": DISC.with_(
        **{"crown": {"shape": "sphere", "radius_mm": 200.0}, "cavity.clear_thickness_mm": 12.0}
    ),
}
PLAIN = {
    "no names, a label": DOME.with_(**{"mold.numbers": "none", "mold.label": "D1"}),
    "no strain relief": DISC.with_(**{"mold.strain_relief": "none", "mold.numbers": "none"}),
    "names": DISC,
    "few parts off the axes": DISC.with_(
        layout=[
            {"pattern": "at_angles", "kind": "emitter", "angles_deg": [17.0]},
            {"pattern": "at_angles", "kind": "receiver", "angles_deg": [61.5, 200.0]},
        ]
    ),
}
FAST_OPTIONS = ("sphere below", "few parts off")


def options(designs):
    """Parameters of a test that builds a design of each option."""
    slow = pytest.mark.slow
    return [
        pytest.param(design, id=name, marks=() if name in FAST_OPTIONS else slow)
        for name, design in designs.items()
    ]


def loaded(files, name):
    return trimesh.load_mesh(io.BytesIO(files[name]), file_type="stl")


@cache
def mold_of(name):
    return build_mold(preset(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", presets(SHAPED_PRESETS))
def test_every_file_of_a_shaped_preset_is_one_watertight_body_that_passes_its_checks(name, built_of):
    files = built_of(name).files
    for part in (part for part in files if part.endswith(".stl")):
        mesh = loaded(files, part)
        assert mesh.is_watertight, part
        assert mesh.is_winding_consistent, part
        assert mesh.body_count == 1, part
        assert mesh.bounds[0][2] == pytest.approx(0.0, abs=SINGLE_PRECISION_MM), part
    checks = json.loads(files["checks.json"])
    assert checks["ok"], [row for row in checks["findings"] if row["state"] == "error"]


@pytest.mark.slow
@pytest.mark.parametrize("name", presets(SHAPED_PRESETS))
def test_a_shaped_mold_has_the_volume_of_the_formula(name, built_of):
    formula = mold_volume_mm3(preset(name))
    assert mold_of(name).val().Volume() == pytest.approx(formula, rel=ROUNDING)
    assert loaded(built_of(name).files, "mold.stl").volume == pytest.approx(formula, rel=1e-3)


def test_a_round_mold_s_volume_by_hand():
    """One emitter and one receiver of the disc, bare of names and leads: a ring, two segments, two pockets."""
    bare = DISC.with_(
        **{
            "layout": [
                {"pattern": "at_angles", "kind": kind, "angles_deg": [angle]}
                for kind, angle in (("emitter", 30.0), ("receiver", 200.0))
            ],
            "mold.numbers": "none",
            "mold.strain_relief": "none",
        }
    )
    whole = math.pi * (36**2 * 13.5 - 27.5**2 * 10.5)
    removed = 2 * math.pi * 1.6**2 * 13.5 + 2 * math.pi * 0.47**2 * (2.4 + 4.0)
    for width, depth, floor in ((3.8, 2.05, 3.45), (5.4, 4.25, 2.4)):
        angle = 2 * math.asin(width / 2 / 27.5)
        removed -= 27.5**2 / 2 * (angle - math.sin(angle)) * 10.5
        removed += width * depth * (9.5 - floor)
    (emitter,) = (one for one in outline_of(bare).sockets if one.part.name == "E1")
    width = 1.9 - (1.5 - 1.1 / 2)  # a wire's way of 1.1, 1.5 from the middle, ends at the pocket's side
    for slot in emitter.slots:  # to the round outer face, by a midpoint rule
        beside = slot.along0 - 1.9 + (np.arange(20_000) + 0.5) / 20_000 * width
        ends = np.sqrt(36**2 - beside**2) - math.sqrt(27.5**2 - 1.9**2)
        removed += float(np.mean(ends) - 2.05) * width * (9.5 - 3.45)
    assert len(emitter.slots) == 2
    assert mold_volume_mm3(bare) == pytest.approx(whole - removed, rel=1e-9)


@pytest.mark.parametrize("name", presets(CROWNS))
def test_a_lid_has_the_volume_of_the_formula(name, built_of):
    formula = lid_volume_mm3(preset(name))
    assert lid(preset(name)).val().Volume(LID_ROUNDING) == pytest.approx(formula, rel=LID_ROUNDING)
    assert loaded(built_of(name).files, "lid.stl").volume == pytest.approx(formula, rel=1e-3)


def test_the_dome_s_lid_by_hand():
    size = lid_size(DOME)
    assert size.plug is None
    nearest = math.sqrt(11.0**2 - (2.6 / 2 + 0.15) ** 2)  # the widest facet's distance from the middle
    cap = 8.0 - size.seat_mm
    assert size.seat_mm == pytest.approx(8.0 - (18.0 - math.sqrt(18.0**2 - nearest**2)))
    assert size.back_mm == 8.0 + OVER_CROWN_MM
    pin = math.pi * 0.95**2 * 2.525 + math.pi * 0.475 / 3 * (0.95**2 + 0.95 * 0.475 + 0.475**2)
    notch = 6 * 1.5 - (6 * 18 - (18**2 * math.asin(3 / 18) + 3 * math.sqrt(18**2 - 9)))
    by_hand = (
        math.pi * 18**2 * size.flange_mm - math.pi * cap**2 * (3 * 18.0 - cap) / 3 + 4 * pin - 2 * notch * 1.5
    )
    assert lid_volume_mm3(DOME) == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize("name", presets(SHAPED_PRESETS))
def test_rays_from_inside_meet_the_flat_and_round_walls_that_light_meets(name, built_of):
    agreement = cavity_agreement(preset(name), built_of(name).mold, rays=600)
    assert agreement.compared > 200
    assert agreement.windows > 20
    assert agreement.worst_mm < SINGLE_PRECISION_MM
    assert agreement.worst_round_mm < CHORD_LIMIT_MM
    assert (agreement.worst_round_mm > 0) == (name != "crowned-40x25")
    assert agreement.shallowest_window_mm > 0.01


def test_a_disc_half_a_millimetre_larger_all_around_is_told_from_the_printed_one(built_of):
    wider = DISC.with_(**{"cavity.diameter_mm": 56.0})
    agreement = cavity_agreement(wider, built_of("levi2013-disc").mold)
    # half a millimetre in radius, and as much of its middle along x and y
    assert agreement.worst_round_mm == pytest.approx(0.5 + 0.5 * math.sqrt(2), abs=0.05)


@pytest.mark.parametrize("name", presets(SHAPED_PRESETS))
def test_pockets_open_onto_their_facet_as_deep_as_the_body(name, built_of):
    design, mesh = preset(name), built_of(name).mold
    for socket in outline_of(design).sockets:
        line, part, pocket = socket.frame.line, socket.part, socket.pocket
        across = np.linspace(
            pocket.along0 + 0.01, pocket.along1 - 0.01, 40
        )  # some go on into the wires' slots
        height = part.height_mm + bed_lift_mm(design)
        starts = np.array([[*line.point(along, -1.0), height] for along in across])
        way = first_hits_mm(mesh, starts, np.tile([*line.outward, 0.0], (40, 1)))
        depth = part.part.body_depth_mm.value + design.mold.part_clearance_mm
        assert float(way.min()) - 1.0 == pytest.approx(depth, abs=SINGLE_PRECISION_MM), part.name


@pytest.mark.parametrize("name", presets(CROWNS))
def test_sprue_and_vents_go_through_the_floor(name, built_of):
    design, mesh = preset(name), built_of(name).mold
    holes = outline_of(design).filling
    assert [hole.radius for hole in holes] == [2.0, 1.0, 1.0, 1.0]
    inside = np.array([[hole.x + 0.9 * hole.radius, hole.y, 5.0] for hole in holes])
    outside = np.array([[hole.x + 1.1 * hole.radius, hole.y, 5.0] for hole in holes])
    down = np.tile([0.0, 0.0, -1.0], (4, 1))
    assert np.isinf(first_hits_mm(mesh, inside, down)).all()
    assert first_hits_mm(mesh, outside, down) == pytest.approx(5.0 - design.mold.floor_mm, abs=1e-5)


@pytest.mark.parametrize("name", presets(CROWNS))
def test_the_lid_s_dish_is_the_top_of_the_optical_model(name, built_of):
    agreement = dish_agreement(preset(name), read_stl(built_of(name).files["lid.stl"]))
    assert agreement.compared > 700
    assert agreement.worst_mm < CHORD_LIMIT_MM


@pytest.mark.slow
def test_a_lid_of_another_crown_is_told(built_of):
    flatter = DOME.with_(**{"crown.radius_mm": 18.5})
    assert dish_agreement(flatter, read_stl(built_of("fingertip-dome").files["lid.stl"])).worst_mm > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("name", presets(CROWNS))
def test_a_lid_lies_on_its_mold_with_its_pins_in_the_holes(name):
    design, size = preset(name), lid_size(preset(name))
    cover, mold = lid(design).val(), mold_of(name).val()
    assert sum(solid.Volume() for solid in cover.intersect(mold).Solids()) == pytest.approx(0.0, abs=1e-9)
    assert cover.distance(mold) < 0.006  # it lies on the rim; a cylinder's flange keeps 5 µm from the tangent
    holes = outline_of(design).fixing_holes
    assert [(pin.x, pin.y) for pin in size.pins] == [(hole.x, hole.y) for hole in holes]
    for pin, hole in zip(size.pins, holes, strict=True):
        assert hole.radius - pin.radius == pytest.approx(0.15)
        assert hole.z0 < pin.z0 < pin.z1 == size.seat_mm


@pytest.mark.parametrize("name", presets(CROWNS))
def test_a_lid_forms_the_top_but_for_a_narrow_ring_at_the_walls(name):
    plan, size = outline_of(preset(name)).plan, lid_size(preset(name))
    spots = np.random.default_rng(0).uniform(size=(4000, 2)) * [plan.length_mm, plan.width_mm]
    formed = [forms_top(size, plan, x, y) for x, y in spots if plan.contains(x, y)]
    ring_mm = 0.25  # play and draft, and the samples' spread
    ring = 2 * ring_mm * (1 / plan.length_mm + 1 / plan.width_mm)
    assert 1 - ring < np.mean(formed) < 1.0


@pytest.mark.parametrize("design", options(OPTIONS))
def test_a_lid_of_another_crown_outline_or_rim_keeps_its_formula_and_its_top(design):
    solid, formula, size = lid(design), lid_volume_mm3(design), lid_size(design)
    assert solid.val().isValid()
    assert solid.val().Volume(LID_ROUNDING) == pytest.approx(formula, rel=LID_ROUNDING)
    mesh = turned_over(mesh_of(solid, chord_mm=CHORD_MM), design, size)
    assert mesh.vertices[:, 2].min() == 0.0
    assert dish_agreement(design, mesh, rays=500).worst_mm < CHORD_LIMIT_MM
    outline = outline_of(design)
    assert size.back_mm >= max(outline.top_mm + 2.5, outline.plan.clear_mm + 2.5)


def test_a_plug_leaves_play_at_the_rim_and_comes_in_by_its_draft():
    plug = lid_size(OPTIONS["a sphere below the rim"]).plug
    assert plug.half_mm == (20.0 - 0.15, 12.5 - 0.15)
    assert plug.inset_mm(2.0) == pytest.approx(2.0 * math.tan(math.radians(DRAFT_DEG)))
    round_plug = lid_size(OPTIONS["a dome with a rim"]).plug
    nearest = min(outline_of(DOME).plan.stands_mm(wall) for wall in outline_of(DOME).plan.walls)
    assert round_plug.half_mm[0] == pytest.approx(nearest - 0.15)
    assert lid_size(OPTIONS["an almost flat sphere"]).plug is None


@pytest.mark.parametrize("design", options(PLAIN))
def test_options_of_a_round_mold_keep_its_formula(design):
    solid = build_mold(design).val()
    assert solid.isValid()
    assert solid.Volume() == pytest.approx(mold_volume_mm3(design), rel=ROUNDING)


def test_names_stand_below_their_facets_wider_than_these_and_clear_of_each_other():
    for design in (DISC, DOME):
        numbers = outline_of(design).numbers
        assert len(numbers) == len(cavity_of(design).parts)
        for number in numbers:
            frame = number.frame
            ends = [x - frame.length_mm / 2 for s in number.strokes for x in (s.x0, s.x1)]
            assert sum((min(ends), max(ends))) == pytest.approx(0.0, abs=1e-6)
            apart = math.pi / len(numbers)  # half an even spacing
            assert max(ends) < (frame.outer_radius_mm - 0.5) * math.tan(apart) - 0.2
            assert frame.thickness_mm - frame.thickness_at_mm(max(ends) + frame.length_mm / 2) < 0.25


def test_flat_presets_have_no_lid():
    for name in FLAT_PRESETS:
        assert lid(preset(name)) is None, name
        assert lid_volume_mm3(preset(name)) == 0.0, name


@pytest.mark.parametrize("name", presets(SHAPED_PRESETS))
def test_lid_blade_and_gauge_are_there_where_they_are_of_use(name, built_of):
    tools = {"leveling_blade.stl", "pour_gauge.stl"} & set(built_of(name).files)
    assert ("lid.stl" in built_of(name).files) == (name in CROWNS)
    assert len(tools) == (0 if name in CROWNS else 2)
    if name in CROWNS:
        rimmed = preset(name).with_(**{"mold.rim_mm": 1.0})
        assert blade_size(rimmed) is leveling_blade(rimmed) is gauge_size(rimmed) is None


def test_the_notches_of_a_round_lid_lie_along_its_cylinder_which_its_pins_do_not_tell():
    for axis, way in (("x", 0), ("y", 1)):
        changes = {"crown": {"shape": "cylinder", "radius_mm": 18.0, "axis": axis}}
        notches = lid_size(DOME.with_(**changes)).notches
        assert sorted(notch.frame.line.outward[way] for notch in notches) == [-1.0, 1.0]
        (row,) = [one for one in design_findings(DOME.with_(**changes)) if one.name.startswith("lid: steps")]
        assert f"its notches are along {axis}" in row.note


def test_the_blade_turns_within_the_facets_of_a_disc():
    plan, size = outline_of(DISC).plan, blade_size(DISC)
    nearest = min(plan.stands_mm(wall) for wall in plan.walls)
    assert math.hypot(size.tongue_mm / 2, 1.5) == pytest.approx(nearest - BLADE_PLAY_MM)
    assert size.span_mm == 72.0


@pytest.mark.parametrize("name", presets(SHAPED_PRESETS))
def test_the_finish_of_a_cast_top_is_told_for_crowned_pads_alone(name, built_of):
    rows = json.loads(built_of(name).files["checks.json"])["findings"]
    notes = [row["note"] for row in rows if row["name"].startswith("lid: steps of layers")]
    assert len(notes) == (1 if name in CROWNS else 0)
    assert all("haze" in note and "PET" in note and "cm3 clear" in note for note in notes)


def test_a_lid_left_over_from_a_crowned_pad_is_removed(tmp_path, monkeypatch):
    contents = [{"lid.stl": b"", "mold.stl": b""}, {"mold.stl": b""}]
    monkeypatch.setattr("optopad.cad.export.part_files", lambda *_, **__: contents.pop(0))
    assert "lid.stl" in export_parts(DOME, tmp_path)
    export_parts(DOME, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mold.stl"]


@pytest.mark.full
@pytest.mark.parametrize("design", [*OPTIONS.values(), *PLAIN.values()], ids=[*OPTIONS, *PLAIN])
def test_every_option_of_a_shaped_pad_passes_every_check(design):
    files = part_files(design)
    checks = json.loads(files["checks.json"])
    assert checks["ok"], [row for row in checks["findings"] if row["state"] == "error"]
    for part in (part for part in files if part.endswith(".stl")):
        assert loaded(files, part).is_watertight, part
        assert len(files[part]) < 20_000_000, part
    if "lid.stl" in files:
        shared = lid(design).val().intersect(build_mold(design).val())
        assert sum(solid.Volume() for solid in shared.Solids()) == pytest.approx(0.0, abs=1e-9)
