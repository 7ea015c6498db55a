"""Clearances by hand: value, need, place and the field that they come from."""

import math
import subprocess
import sys

import pytest

from optopad.design.mold.outline import outline_of
from optopad.design.mold.sockets import Cut, WallFrame
from optopad.design.mold.webs import bodies_above_rim, clearances, pockets_below_clear_layer, tightest
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.shape.outline import rectangle

DESIGN = preset("piacenza2017-pad")
SFH = "osram-sfh206k"
LEADS = "mold.lead_clearance_mm"


def named(design):
    return {one.name: one for one in tightest(clearances(outline_of(design), design.mold))}


def test_the_pads_clearances_by_hand():
    found = named(DESIGN)
    wanted = {
        "wall": (45 - 32) / 2,
        "fixing hole to outer face": (2 * 3.1 - 2.0) / math.sqrt(2) - 1.6,  # the origin cut is nearest
        "fixing hole to cavity": math.hypot(6.5 - 3.1 - 1.5, 6.5 - 3.1 - 1.5) - 1.6,
        "pocket to corner": 4.0 - 2.7,
        "pocket to pocket": 8.0 - 2.7 - 1.9,
        "pocket back to outer face": 6.5 - 4.1 - 0.15,
        "floor under pocket": 6.0 - 3.45 - 0.15 + 4.0,
        "pocket below fill level": 8.0 - (5.0 - 1.4 - 0.15),
        "lead hole to lead hole": 2.54 - 0.94,
        "lead hole to cavity": 1.55 - 0.47,
        "lead hole to outer face": 6.5 - 1.55 - 0.47,
        "lead hole to pocket edge": 2.7 - 1.27 - 0.47,
        "wire slot to wire slot": 2.8 - 1.1,
    }
    for name, value in wanted.items():
        assert found[name].value_mm == pytest.approx(value, abs=1e-12), name


def test_tangent_lead_holes_are_not_kept():
    tangent = named(DESIGN.with_(part_measurements={SFH: {"lead_pitch_mm": 0.94}}))["lead hole to lead hole"]
    assert tangent.value_mm == pytest.approx(0.0, abs=1e-12)
    assert not tangent.is_kept
    assert (tangent.where, tangent.field) == ("R1 on the south wall", "mold.lead_clearance_mm")


def test_a_web_that_equals_the_need_is_enough():
    exact = DESIGN.with_(**{"mold.min_web_mm": 1.3})
    assert named(exact)["pocket to corner"].is_kept
    assert not named(DESIGN.with_(**{"mold.min_web_mm": 1.31}))["pocket to corner"].is_kept


def test_overlapping_bodies_are_told_by_their_own_distance():
    crowded = named(DESIGN.with_(layout=[{"pattern": "alternating_ring", "parts_per_side": 8}]))
    bodies = crowded["body to body"]  # 5.1 and 3.5 wide, 4.0 apart
    assert (bodies.value_mm, bodies.needed_mm) == pytest.approx((-0.3, 0.3 + 0.8), abs=1e-12)
    assert (bodies.where, bodies.field) == ("E1 and R1 on the south wall", "layout.0")


@pytest.mark.parametrize(
    ("changes", "name", "field"),
    [
        ({"mold.outer_width_mm": 40.0}, "pocket back to outer face", "mold.outer_width_mm"),
        ({"mold.outer_length_mm": 32.0}, "wall", "mold.outer_length_mm"),
        ({"mold.fixing_hole_inset_mm": 2.0}, "fixing hole to outer face", "mold.fixing_hole_inset_mm"),
        ({"mold.fixing_hole_inset_mm": 4.5}, "fixing hole to cavity", "mold.fixing_hole_inset_mm"),
        ({"mold.fixing_hole_inset_mm": 21.5}, "fixing hole to fixing hole", "mold.fixing_hole_inset_mm"),
        ({"mold.floor_mm": 0.6, "receivers.height_mm": 2.0}, "floor under pocket", "receivers.height_mm"),
        ({"emitters.height_mm": 9.0}, "pocket below fill level", "emitters.height_mm"),
        ({"part_measurements": {SFH: {"lead_pitch_mm": 4.4}}}, "lead hole to pocket edge", LEADS),
        ({"part_measurements": {SFH: {"lead_setback_mm": 1.0}}}, "lead hole to cavity", LEADS),
    ],
)
def test_a_clearance_that_is_not_kept_names_its_field(changes, name, field):
    one = named(DESIGN.with_(**changes))[name]
    assert not one.is_kept
    assert one.field == field


def test_no_fixing_holes_no_clearance_to_them():
    found = named(DESIGN.with_(**{"mold.fixing_hole_diameter_mm": 0.0}))
    assert not [name for name in found if "fixing" in name]


def test_tall_bodies_and_deep_pockets_are_named():
    assert bodies_above_rim(outline_of(DESIGN)) == ()
    assert bodies_above_rim(outline_of(DESIGN.with_(**{"mold.rim_mm": 0.5}))) == tuple(
        f"R{k}" for k in range(1, 9)
    )
    assert pockets_below_clear_layer(outline_of(DESIGN)) == ()
    assert len(pockets_below_clear_layer(outline_of(DESIGN.with_(**{"receivers.height_mm": 3.0})))) == 8


def test_clearances_need_no_cad_kernel():
    code = (
        "import sys, optopad.design.mold.webs, optopad.design.mold.outline; "
        "print('cadquery' in sys.modules, 'OCP' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


PAD = preset("piacenza2017-pad")
LED = "sunled-xscwd23mb"


def sockets(design):
    return {socket.part.name: socket for socket in outline_of(design).sockets}


@pytest.mark.parametrize(
    ("wall", "wanted"),
    [
        ("south", (1.0, 3.0, -4.0, 0.0)),
        ("north", (1.0, 3.0, 32.0, 36.0)),
        ("west", (-4.0, 0.0, 1.0, 3.0)),
        ("east", (32.0, 36.0, 1.0, 3.0)),
    ],
)
def test_a_cut_lies_behind_its_wall(wall, wanted):
    walls = {line.name: line for line in rectangle((0.0, 0.0, 32.0, 32.0)).lines}
    frame = WallFrame(line=walls[wall], thickness_mm=6.5)
    box = frame.box(Cut(along0=1.0, along1=3.0, out0=0.0, out1=4.0, floor=2.0, top=9.0))
    assert (box.x0, box.x1, box.y0, box.y1) == wanted
    assert (box.z0, box.z1) == (2.0, 9.0)
    assert frame.along_and_outward_mm(*frame.point(1.0, 4.0)) == (1.0, 4.0)


def test_a_pocket_is_the_body_and_its_clearance():
    assert set(sockets(PAD)) == {part.name for part in cavity_of(PAD).parts}
    for socket in sockets(PAD).values():
        part = socket.part.part
        assert socket.pocket.along1 - socket.pocket.along0 == pytest.approx(part.body_width_mm.value + 0.3)
        assert socket.pocket.out1 == pytest.approx(part.body_depth_mm.value + 0.15)
        assert socket.pocket.floor == pytest.approx(socket.part.body_base_mm - 0.15)
        assert socket.pocket.top == pytest.approx(9.5)


def test_radial_leads_go_through_the_floor_and_surface_wires_through_the_back():
    receiver, emitter = sockets(PAD)["R1"], sockets(PAD)["E1"]
    assert (len(receiver.holes), len(receiver.slots)) == (2, 0)
    assert (len(emitter.holes), len(emitter.slots)) == (0, 2)
    assert {hole.z0 for hole in receiver.holes} == {receiver.channel.top} == {-4.0 + 1.5}
    assert receiver.holes[1].x - receiver.holes[0].x == pytest.approx(2.54)
    assert {(way.out0, way.out1) for way in (*emitter.slots, *emitter.necks)} == {(2.05, 5.0), (5.0, 6.5)}


def test_slots_stay_behind_the_pocket():
    for socket in sockets(PAD).values():
        for slot in socket.slots:
            assert socket.pocket.along0 <= slot.along0 < slot.along1 <= socket.pocket.along1


def test_wires_too_close_for_a_web_leave_together():
    close = PAD.with_(part_measurements={LED: {"lead_pitch_mm": 1.8}})
    (slot,) = sockets(close)["E1"].slots
    assert slot.along1 - slot.along0 == pytest.approx(2 * (0.8 + 0.3))


def test_height_moves_a_pocket_by_as_much():
    low, high = sockets(PAD)["R1"], sockets(PAD.with_(**{"receivers.height_mm": 6.5}))["R1"]
    assert high.pocket.floor - low.pocket.floor == pytest.approx(0.5)
    assert (low.pocket.top, high.pocket.top) == (9.5, high.part.body_top_mm)  # a collar, above the rim
