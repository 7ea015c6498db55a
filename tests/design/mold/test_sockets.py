"""Sockets as numbers: places on the four walls, wires one by one or together."""

import pytest

from optopad.design.mold.outline import outline_of
from optopad.design.mold.sockets import Cut, WallFrame
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.shape.outline import rectangle

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
