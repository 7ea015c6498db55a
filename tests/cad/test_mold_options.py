"""Options of the mold: fits, numbers, strain relief, collars, a cover's seat, two pieces; and the tools."""

import io
import json

import numpy as np
import pytest
import trimesh

from optopad.cad.checks import PartFile, check_parts, design_findings
from optopad.cad.export import export_parts, part_files
from optopad.cad.mesh import mesh_of as solid_mesh
from optopad.cad.mold import build_mold
from optopad.cad.tools import gauge_size, jig_size, pour_gauge, shank_mm, solder_jig
from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DesignError, InputError
from optopad.design.mold.lettering import area_mm2
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.mold.part_numbers import DEPTH_MM
from optopad.design.parts.assumptions import bed_of
from optopad.design.parts.catalog import find_board, packaged
from optopad.design.preset import FLAT_PRESETS, WALL_PRESETS, preset
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec.properties import fit
from optopad.fabrication.connections import connections_of
from tests.cad.agreement import cavity_agreement
from tests.cad.volumes import base_volume_mm3, gauge_volume_mm3, jig_volume_mm3, mold_volume_mm3
from tests.said import says

PAD, FINGER, PAIR = preset("piacenza2017-pad"), preset("fingertip-16"), preset("piacenza2017-pair")
ROUNDING = 1e-9  # of a volume from sums of doubles
SINGLE_PRECISION_MM = 1e-4  # coordinates in a file, below 400 mm


def mesh_of(files, name):
    return trimesh.load_mesh(io.BytesIO(files[name]), file_type="stl")


@pytest.mark.parametrize("name", WALL_PRESETS)
def test_every_part_has_its_name_of_the_wiring_table_on_the_mold(name):
    design = preset(name)
    wired = {one.part.name for one in connections_of(Circuit.of(design)).all}
    assert {number.name for number in outline_of(design).numbers} == wired
    for number in outline_of(design).numbers:
        assert number.stroke_mm >= 0.75 - ROUNDING


def test_a_name_stands_below_its_own_socket_clear_of_its_neighbours():
    for design in (PAD, FINGER, preset("oblong-60x40")):
        outline = outline_of(design)
        sockets = {socket.part.name: socket for socket in outline.sockets}
        for number in outline.numbers:
            low = min(stroke.x0 for stroke in number.strokes)
            high = max(stroke.x1 for stroke in number.strokes)
            socket = sockets[number.name]
            assert (low + high) / 2 == pytest.approx(socket.part.along_mm, abs=1e-6)
            assert max(stroke.y1 for stroke in number.strokes) <= socket.pocket.floor - 0.4 + ROUNDING
        for one in outline.numbers:
            for other in outline.numbers:
                if one is not other and one.frame.wall == other.frame.wall:
                    assert max(s.x1 for s in one.strokes) < min(s.x0 for s in other.strokes) or max(
                        s.x1 for s in other.strokes
                    ) < min(s.x0 for s in one.strokes)


def test_names_take_their_area_times_their_depth_from_the_solid():
    bare = PAIR.with_(**{"mold.numbers": "none"})
    taken = build_mold(bare).val().Volume() - build_mold(PAIR).val().Volume()
    area = sum(area_mm2(number.strokes) for number in outline_of(PAIR).numbers)
    assert taken == pytest.approx(area * DEPTH_MM, rel=1e-6)


def test_names_without_room_are_told():
    flat = FINGER.with_(**{"mold.floor_mm": 1.0, "cavity.black_thickness_mm": 0.0, "emitters.height_mm": 1.6})
    (row,) = [
        one for one in design_findings(flat) if one.name == "mold: parts without their name on the mold"
    ]
    assert row.state == "warning"
    assert row.note.startswith("E1, E2")


def test_a_fit_class_replaces_the_clearance_of_its_part_alone():
    pressed = PAD.with_(**{"mold.fits": {"osram-sfh206k": "press", "sunled-xscwd23mb": "slip"}})
    sockets = {socket.part.name: socket.pocket for socket in outline_of(pressed).sockets}
    receiver, emitter = sockets["R1"], sockets["E1"]
    assert receiver.along1 - receiver.along0 == pytest.approx(5.1 + 2 * fit("press").value)
    assert emitter.along1 - emitter.along0 == pytest.approx(3.5 + 2 * fit("slip").value)
    assert pressed.digest != PAD.digest


def test_a_fit_for_a_part_that_is_not_there_is_refused():
    with pytest.raises(DesignError, match=r"mold\.fits\.osram-sfh2400"):
        require_valid(PAD.with_(**{"mold.fits": {"osram-sfh2400": "press"}}))
    with pytest.raises(DesignError, match=r"mold\.fits"):
        PAD.with_(**{"mold.fits": {"osram-sfh206k": "tight"}})


def test_a_wire_slot_ends_in_a_neck_narrower_than_its_wire():
    emitter = next(s for s in outline_of(PAD).sockets if s.part.name == "E1")
    for slot, neck in zip(emitter.slots, emitter.necks, strict=True):
        assert neck.along1 - neck.along0 == pytest.approx(0.8 - fit("wire_pinch").value)
        assert (slot.out1, neck.out0, neck.out1) == (5.0, 5.0, 6.5)
    plain = next(
        s for s in outline_of(PAD.with_(**{"mold.strain_relief": "none"})).sockets if s.part.name == "E1"
    )
    assert plain.necks == ()


def test_radial_leads_leave_in_a_channel_as_deep_as_the_floor_allows():
    def channel(floor_mm):
        design = PAD.with_(**{"mold.floor_mm": floor_mm})
        return next(s for s in outline_of(design).sockets if s.part.name == "R1")

    assert channel(3.0).channel.top - channel(3.0).channel.floor == pytest.approx(1.5)
    assert channel(1.6).channel.top - channel(1.6).channel.floor == pytest.approx(0.8)
    assert channel(1.2).channel is None
    assert channel(1.2).holes[0].z0 == pytest.approx(-1.0 - 1.2)


@pytest.mark.slow
def test_a_body_above_the_rim_gets_a_collar_to_its_top():
    low = PAD.with_(**{"mold.rim_mm": 0.5})
    outline, mold = outline_of(low), build_mold(low)
    assert {collar.names for collar in outline.collars} == {(f"R{k}",) for k in range(1, 9)}
    top = max(part.body_top_mm for part in cavity_of(low).parts)
    assert outline.highest_mm == pytest.approx(top)
    assert mold.val().BoundingBox().zmax == pytest.approx(top, abs=1e-6)
    assert mold.val().Volume() == pytest.approx(mold_volume_mm3(low), rel=ROUNDING)
    assert outline_of(low.with_(**{"mold.raised_sockets": False})).collars == ()
    assert outline_of(PAD).collars == ()


def test_neighbours_closer_than_three_webs_share_a_collar():
    low = PAIR.with_(**{"mold.rim_mm": 0.0})
    (collar,) = outline_of(low).collars
    assert collar.names == ("R1", "R2", "R3")
    assert build_mold(low).val().Volume() == pytest.approx(mold_volume_mm3(low), rel=ROUNDING)


COVERED = FINGER.with_(**{"mold.cover_ledge_mm": 1.0})


@pytest.mark.slow
def test_a_cover_lies_at_the_undisturbed_top_and_the_cavity_stays():
    outline, mold = outline_of(COVERED), build_mold(COVERED)
    assert (outline.mouth.z0, outline.mouth.x0, outline.lip_mm) == (5.0, -1.0, 0.0)
    assert mold.val().Volume() == pytest.approx(mold_volume_mm3(COVERED), rel=ROUNDING)
    mesh = solid_mesh(mold, bed_lift_mm(COVERED))
    assert cavity_agreement(COVERED, mesh).worst_mm < SINGLE_PRECISION_MM


@pytest.mark.parametrize(
    ("design", "message"),
    [
        (PAD.with_(**{"mold.cover_ledge_mm": 1.0}), r"mold\.cover_ledge_mm"),
        (COVERED.with_(**{"mold.rim_mm": 0.2}), r"mold\.rim_mm"),
        (
            FINGER.with_(**{"mold.cover_ledge_mm": 4.5, "mold.fixing_hole_diameter_mm": 0.0}),
            r"mold\.cover_ledge_mm",
        ),
        (
            PAD.with_(**{"mold.pieces": "frame_and_base", "mold.fixing_hole_diameter_mm": 0.0}),
            r"mold\.pieces",
        ),
    ],
)
def test_an_option_that_cannot_work_is_refused(design, message):
    with pytest.raises(DesignError, match=message):
        require_valid(design)


@pytest.mark.parametrize("name", ["piacenza2017-pad", "oblong-60x40", "piacenza2017-pair"])
def test_names_of_a_parted_mold_lie_wholly_on_its_frame(name):
    """Across the joint they were feet on the base and letters without feet on the frame."""
    outline = outline_of(preset(name).with_(**{"mold.pieces": "frame_and_base"}))
    low = min((stroke.y0 for one in outline.numbers for stroke in one.strokes), default=np.inf)
    assert low >= outline.cavity_bottom_mm + 0.4 - ROUNDING
    assert min(stroke.y0 for one in outline_of(preset(name)).numbers for stroke in one.strokes) < low


@pytest.mark.slow
def test_frame_and_base_are_the_mold_parted_at_the_cavity_s_floor():
    parted = PAIR.with_(**{"mold.pieces": "frame_and_base", "mold.label": "8"})
    files = part_files(parted)
    frame, base, whole = (mesh_of(files, f"{name}.stl") for name in ("mold_frame", "mold_base", "mold"))
    assert [frame.bounds[0][2], base.bounds[0][2]] == pytest.approx([0.0, 0.0], abs=SINGLE_PRECISION_MM)
    assert base.extents[2] == pytest.approx(parted.mold.floor_mm, abs=SINGLE_PRECISION_MM)
    assert frame.extents[2] + base.extents[2] == pytest.approx(whole.extents[2], abs=SINGLE_PRECISION_MM)
    assert frame.volume + base.volume == pytest.approx(whole.volume, rel=1e-4)  # chords of other triangles
    assert base.volume == pytest.approx(base_volume_mm3(parted), rel=1e-3)
    assert json.loads(files["checks.json"])["ok"]


@pytest.mark.slow
def test_a_piece_left_over_from_a_parted_mold_is_removed(tmp_path):
    parted = PAIR.with_(**{"mold.pieces": "frame_and_base"})
    assert {"mold_frame.stl", "mold_base.stl"} <= set(export_parts(parted, tmp_path))
    export_parts(PAIR, tmp_path)
    assert not (tmp_path / "mold_base.stl").exists()


@pytest.mark.parametrize("name", [*FLAT_PRESETS, "levi2013-disc"])
def test_the_middle_tooth_of_the_pour_gauge_ends_at_the_undisturbed_top(name):
    design = preset(name)
    size, gauge = gauge_size(design), pour_gauge(design)
    assert size.teeth_mm[1] == design.mold.rim_mm
    assert -gauge.val().BoundingBox().ymin == pytest.approx(design.mold.rim_mm + 0.3, abs=1e-6)
    assert gauge.val().Volume() == pytest.approx(gauge_volume_mm3(size), rel=ROUNDING)


@pytest.mark.parametrize("name", WALL_PRESETS)
def test_the_solder_jig_has_the_pitch_of_every_part(name):
    design = preset(name)
    size = jig_size(design)
    kinds = {part.part_id: part.part for part in cavity_of(design).parts}
    assert solder_jig(design).val().Volume() == pytest.approx(jig_volume_mm3(size), rel=ROUNDING)
    radial = [part for part in kinds.values() if part.mounting == "radial"]
    for part in radial:
        xs = sorted(hole.x for hole in size.holes)
        assert xs[-1] - xs[0] == pytest.approx(part.lead_pitch_mm.value * (part.lead_count - 1))


def test_the_tip_s_shank_is_long_enough_to_hold_beyond_the_deepest_press():
    assert shank_mm(PAD) == pytest.approx(20.0 + PAD.operating.max_depth_mm)


def test_a_mold_beyond_the_bed_is_a_warning_with_both_sizes(built_of):
    stl = built_of("piacenza2017-pair").files["mold.stl"]
    volume = mold_volume_mm3(PAIR)
    mold = PartFile(name="mold", stl=stl, solid_mm3=volume)
    found = check_parts(PAIR, (mold,), bed_mm=(30.0, 30.0, 30.0))
    (row,) = [row for row in found.findings if row.name == "mold: print bed"]
    assert row.state == "warning"
    assert says(row.note, "33.0 x 33.0 x 13.5 mm ... 30 x 30 x 30 mm")
    assert found.is_ok


def test_a_bed_is_three_lengths():
    assert bed_of("220,220,250") == bed_of("220x220x250") == (220.0, 220.0, 250.0)
    with pytest.raises(InputError, match=r"--bed: '220'.*above 0"):
        bed_of("220")


@pytest.mark.parametrize(
    ("parts", "layout", "width_mm"),
    [
        (2, {"pattern": "facing_rows", "emitter_wall": "west", "count": 1}, 40.0),
        (64, {"pattern": "alternating_ring", "parts_per_side": 16}, 115.0),
    ],
)
@pytest.mark.slow
def test_two_and_sixty_four_parts_in_oblong_and_square_molds_keep_every_check(parts, layout, width_mm):
    inputs = {"analog_channels": tuple(f"A{k}" for k in range(32))}
    board = find_board(packaged(), "arduino-mega-2560").model_copy(update=inputs)
    design = PAD.with_(
        **{
            "cavity.length_mm": 115.0,
            "cavity.width_mm": width_mm,
            "mold.outer_length_mm": 128.0,
            "mold.outer_width_mm": width_mm + 13.0,
            "layout": [layout],
            "catalog.boards": {"arduino-mega-2560": board.model_dump(mode="json")},
            "board.frame_rate_hz": 10.0,
        }
    )
    checks = json.loads(part_files(design)["checks.json"])
    assert len(cavity_of(design).parts) == parts
    assert checks["ok"], [row for row in checks["findings"] if row["state"] == "error"]
