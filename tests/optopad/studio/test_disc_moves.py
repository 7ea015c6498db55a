"""A dragged part of a disc goes by its angle and nothing else moves; a press stays in the round workspace."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from optopad.design.errors import InputError
from optopad.design.preset import SHAPED_PRESETS, preset, preset_text
from optopad.design.shape.cavity import PlacedPart, cavity_of, workspace_of
from optopad.design.spec import SensorDesign
from optopad.studio.design_file import DesignFile
from optopad.studio.moves import STEP_DEG, moved, part_named
from optopad.studio.session import Session
from tests.design.for_each import for_each

DISC, CROWNED, DOME, STADIUM = SHAPED_PRESETS
BY_ANGLE = [
    {"pattern": "at_angles", "kind": "receiver", "angles_deg": [10.0, 200.0]},
    {"pattern": "disc_ring", "count": 2, "first": "receiver", "first_angle_deg": 60.0},
    {"pattern": "at_angles", "kind": "emitter", "angles_deg": [-90.0, 350.0], "height_mm": 4.4},
]
DESIGNS = {name: preset(name) for name in (DISC, DOME)} | {"mixed": preset(DISC).with_(layout=BY_ANGLE)}
EACH = [(where, part.name) for where, design in DESIGNS.items() for part in cavity_of(design).parts]


def angle_of(part: PlacedPart) -> float:
    """Direction of a part in a round wall."""
    assert part.angle_deg is not None
    return part.angle_deg


def directions(design: SensorDesign) -> dict[str, tuple[str, str, float, float]]:
    """Kind, catalogue part, angle from 0 on and height of each part, by name, in order."""
    return {
        part.name: (part.kind, part.part_id, angle_of(part) % 360.0, part.height_mm)
        for part in cavity_of(design).parts
    }


def after(design: SensorDesign, name: str, **where: Any) -> SensorDesign:
    return design.with_(**moved(design, name, **where))


@for_each((where, name, turn_deg) for where, name in EACH for turn_deg in (3.02, -371.2))
def test_a_part_that_is_turned_is_the_only_one_that_moves(where: str, name: str, turn_deg: float) -> None:
    design = DESIGNS[where]
    was = directions(design)
    now = directions(after(design, name, angle_deg=was[name][2] + turn_deg))
    assert list(now) == list(was)
    kind, part, angle, height = was.pop(name)
    found = now.pop(name)
    assert (found[0], found[1], found[3]) == (kind, part, height)
    off = (found[2] - angle - turn_deg + 180.0) % 360.0 - 180.0
    assert abs(off) <= STEP_DEG / 2 + 1e-9
    assert now == was


@for_each(EACH)
def test_with_its_whole_row_the_ring_turns(where: str, name: str) -> None:
    design = DESIGNS[where]
    found = after(design, name, angle_deg=angle_of(part_named(design, name)) + 7.0, with_row=True)
    assert [one.pattern for one in found.layout] == [one.pattern for one in design.layout]
    origins = {part.name: part.origin for part in cavity_of(design).parts}
    now = directions(found)
    for other, (kind, part, angle, height) in directions(design).items():
        turn = 7.0 if origins[other] == origins[name] else 0.0
        assert now[other] == (kind, part, pytest.approx((angle + turn) % 360.0, abs=1e-6), height)


def test_a_place_of_the_other_kind_of_wall_and_one_that_is_no_number_are_refused() -> None:
    with pytest.raises(InputError, match=r"E1: along_mm.*angle_deg"):
        moved(preset(DISC), "E1", along_mm=3.0)
    with pytest.raises(InputError, match=r"E1: angle_deg.*along_mm"):
        moved(preset(CROWNED), "E1", angle_deg=3.0)
    with pytest.raises(InputError, match="E1: angle_deg"):
        moved(preset(DOME), "E1", angle_deg=math.nan)


@pytest.mark.parametrize("name", [DISC, DOME])
def test_a_press_stays_in_the_round_workspace(name: str) -> None:
    session = Session(DesignFile(name))
    space, middle = workspace_of(session.design), session.design.cavity.length_mm / 2
    for turn in range(0, 360, 25):
        x, y = (
            middle + 2 * middle * math.cos(math.radians(turn)),
            middle + 2 * middle * math.sin(math.radians(turn)),
        )
        session.move_tip(x_mm=x, y_mm=y)
        at = session.press.place_mm
        assert space.contains(*at)
        assert math.atan2(at[1] - middle, at[0] - middle) == pytest.approx(
            math.atan2(y - middle, x - middle), abs=1e-3
        )
        assert math.dist(at, (middle, middle)) == pytest.approx(middle - space.x0_mm, abs=1e-6)


def test_a_dragged_part_is_told_by_its_angle_undone_and_saved(tmp_path: Path) -> None:
    file = tmp_path / "pad.toml"
    file.write_text(preset_text(DISC), encoding="utf-8")
    session = Session(DesignFile(str(file)))
    before = session.design
    assert session.move_part("R2", angle_deg=70.0)
    assert session.said.text == "R2: at 70°, 6 mm high"
    assert session.save()
    text = file.read_text(encoding="utf-8")
    assert "E1 from" in text
    assert 'pattern = "at_angles"' in text
    assert DesignFile(str(file)).saved.digest == session.design.digest
    session.undo()
    assert session.design.digest == before.digest
    assert session.move_part("R2", along_mm=3.0) is False
    assert "position along" in session.said.text
