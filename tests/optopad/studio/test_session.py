"""The design on the table: edits and refusals, steps back and forth, the press, pins, and a file that others change."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import pytest

from optopad.design.errors import InputError
from optopad.design.held_object import held_of
from optopad.design.preset import preset, preset_text
from optopad.design.rules.check import check
from optopad.design.shape.cavity import workspace_of
from optopad.studio import session as session_module
from optopad.studio.design_file import DesignFile
from optopad.studio.session import MERGE_S, LivePress, Said, Session
from tests.said import says

CLEAR = "cavity.clear_thickness_mm"
PAD = "piacenza2017-pad"


class Clock:
    """Time that goes when it is told to."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(session_module, "time", found)
    return found


@pytest.fixture
def file(tmp_path: Path) -> Path:
    found = tmp_path / "pad.toml"
    found.write_text(preset_text(PAD), encoding="utf-8")
    return found


@pytest.fixture
def session(file: Path, clock: Clock) -> Session:
    return Session(DesignFile(str(file)))


def edited_outside(file: Path, old: str, new: str) -> None:
    """What an editor does."""
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1
    file.write_text(text.replace(old, new), encoding="utf-8")
    os.utime(file, ns=(0, file.stat().st_mtime_ns + 10**9))  # however coarse the file system's clock


def thicknesses(session: Session, clock: Clock, *values: float) -> None:
    """Steps of their own."""
    for value in values:
        clock.now_s += 2 * MERGE_S
        assert session.set_field(CLEAR, value)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (CLEAR, 0.5, "cavity.clear_thickness_mm: 0.5"),
        ("cavity.length_mm", 500.0, "cavity.length_mm: 500.0"),
        ("cavity.length_mm", None, "cavity.length_mm: None"),
        ("receivers.height_mm", float("nan"), "receivers.height_mm"),
        ("layout.0.parts_per_side", 33, "layout.0.parts_per_side: 33"),
        ("layout.0.parts_per_side", "many", "layout.0.parts_per_side: 'many'"),
        ("receivers.part", "no-such-part", "receivers.part: receiver 'no-such-part'"),
        ("cavity.depth_mm", 3.0, "cavity.depth_mm: no such field"),
    ],
)  # fmt: skip
def test_an_edit_that_its_field_refuses_changes_nothing_and_says_field_and_limit(
    session: Session, path: str, value: object, words: str
) -> None:
    before, saved = session.now, session.is_saved
    assert session.set_field(path, value) is False
    assert session.now is before
    assert (session.can_undo, session.is_saved) == (False, saved)
    assert session.said.is_bad
    assert session.said.text.startswith(f"not taken: {words}")
    assert "\n" not in session.said.text


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ({"along_mm": 400.0}, "layout.0.along_mm: 400.0"),
        ({"along_mm": -2.0}, "layout.0.along_mm: -2.0"),
        ({"height_mm": -1.0}, "emitters.height_mm: -1.0"),
        ({"along_mm": float("nan")}, "E1: along_mm"),
        ({"height_mm": float("inf")}, "E1: height_mm"),
    ],
)
def test_a_part_is_not_dragged_where_no_part_can_be(
    session: Session, where: dict[str, float], words: str
) -> None:
    before = session.now
    assert session.move_part("E1", **where) is False
    assert session.now is before
    assert session.said.text.startswith(f"not taken: {words}")
    assert session.move_part("E9", along_mm=3.0) is False
    assert says(session.said.text, "E9: no ... E1, E2")


def test_a_design_that_breaks_a_rule_stays_on_the_table_and_is_never_saved(
    session: Session, file: Path
) -> None:
    before = file.read_bytes()
    assert session.set_field("receivers.height_mm", 8.5)
    errors = [one for one in check(session.design) if one.severity == "error"]
    assert len(errors) == 1
    assert session.now.errors == tuple(errors)
    assert session.design.receivers.height_mm == 8.5
    assert session.save() is False
    assert session.said == Said(text=f"not saved: {errors[0]}", is_bad=True)
    assert session.save("other.toml") is False
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == ["pad.toml"]
    session.undo()
    assert session.now.errors == ()
    assert session.save()


def test_undo_and_redo_walk_back_and_forth_through_every_step(session: Session, clock: Clock) -> None:
    values = [8.5, 9.0, 9.5, 10.0]
    thicknesses(session, clock, *values)
    walk = [8.0, *values]
    for value in reversed(walk[:-1]):
        session.undo()
        assert session.design.cavity.clear_thickness_mm == value
    assert session.design.digest == preset(PAD).digest
    assert session.can_undo is False
    session.undo()
    for value in walk[1:]:
        session.redo()
        assert session.design.cavity.clear_thickness_mm == value
    assert session.can_redo is False
    session.redo()
    session.undo()
    assert session.said.text == "undone: cavity.clear_thickness_mm 9.5 to 10 mm"
    session.redo()
    assert session.said.text == "redone: cavity.clear_thickness_mm 9.5 to 10 mm"


def test_quick_edits_of_one_field_are_one_step_and_its_words_tell_both_ends(
    session: Session, clock: Clock
) -> None:
    for value in (8.1, 8.2, 8.3, 8.4):
        clock.now_s += 0.9 * MERGE_S
        session.set_field(CLEAR, value)
    assert session.now.words == "cavity.clear_thickness_mm 8 to 8.4 mm"
    session.undo()
    assert session.design.digest == preset(PAD).digest
    session.redo()
    assert session.design.cavity.clear_thickness_mm == 8.4


def test_a_drag_is_one_step_whose_words_name_part_and_place(session: Session, clock: Clock) -> None:
    for place in (12.2, 12.4, 12.6):
        clock.now_s += 0.03
        assert session.move_part("R1", along_mm=place)
    assert says(session.now.words, "R1: 12.6 mm ... 6 mm high")
    assert session.said.text == session.now.words
    session.undo()
    assert session.design.digest == preset(PAD).digest


def test_an_edit_to_the_value_that_is_there_is_no_step(session: Session) -> None:
    assert session.set_field(CLEAR, 8.0)
    assert session.set_field("layout", "alternating ring")
    assert session.move_part("E1", along_mm=4.01)
    session.take(preset(PAD), "the preset again")
    assert session.can_undo is False
    assert session.said.text == "the preset again"


def test_the_history_keeps_its_newest_steps(
    session: Session, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "MOST_VERSIONS", 20)
    values = [8.0 + 0.1 * (number + 1) for number in range(25)]
    thicknesses(session, clock, *values)
    steps = 0
    while session.can_undo:
        session.undo()
        steps += 1
    assert steps == 19
    assert session.design.cavity.clear_thickness_mm == values[5]


def test_a_design_of_the_command_line_is_a_step_over_the_file_s(file: Path) -> None:
    changed = preset(PAD).with_(**{CLEAR: 9.0})
    session = Session(DesignFile(str(file)), changed)
    assert session.design.digest == changed.digest
    assert session.is_saved is False
    session.undo()
    assert session.is_saved is True
    assert Session(DesignFile(str(file)), preset(PAD)).can_undo is False


def test_pins_are_the_newest_four_designs_and_none_twice(session: Session, clock: Clock) -> None:
    session.pin()
    session.pin()
    assert [one.design.digest for one in session.pinned] == [session.design.digest]
    digests = []
    for value in (9.0, 10.0, 11.0, 12.0):
        thicknesses(session, clock, value)
        session.pin()
        digests.append(session.design.digest)
    assert [one.design.digest for one in session.pinned] == digests
    session.take(session.pinned[0].design, "pinned design again")
    assert session.design.digest == digests[0]
    session.undo()
    assert session.design.digest == digests[-1]


def test_the_press_begins_in_the_middle_at_two_fifths_of_the_range(session: Session) -> None:
    assert (session.press.place_mm, session.press.depth_mm) == ((16.0, 16.0), 2.0)


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ({"x_mm": 1.0}, (6.0, 16.0, 2.0)),
        ({"x_mm": 100.0, "y_mm": -5.0}, (26.0, 6.0, 2.0)),
        ({"depth_mm": 9.0}, (16.0, 16.0, 5.0)),
        ({"depth_mm": -1.0}, (16.0, 16.0, 0.0)),
        ({"x_mm": 12.3456, "depth_mm": 1.239}, (12.35, 16.0, 1.24)),
        ({"x_mm": float("nan"), "y_mm": float("inf"), "depth_mm": float("nan")}, (16.0, 16.0, 2.0)),
    ],
)
def test_the_press_is_kept_in_the_workspace_and_the_range_of_use(
    session: Session, wanted: dict[str, float], found: tuple[float, float, float]
) -> None:
    session.move_tip(**wanted)
    assert (*session.press.place_mm, session.press.depth_mm) == found


def test_the_press_stays_in_the_workspace_and_the_range_when_they_shrink(session: Session) -> None:
    session.move_tip(x_mm=26.0, y_mm=26.0, depth_mm=5.0)
    session.set_field("cavity.length_mm", 28.0)
    assert workspace_of(session.design).contains(*session.press.place_mm)
    assert session.press.place_mm == (22.0, 26.0)
    session.set_field("operating.workspace_margin_mm", 5.0)
    assert session.press.place_mm == (20.0, 24.0)
    session.set_field("operating.max_depth_mm", 3.0)
    assert session.press.depth_mm == 3.0
    session.undo()
    session.undo()
    session.undo()
    assert workspace_of(session.design).contains(*session.press.place_mm)


def test_a_file_changed_by_an_editor_is_a_step_that_undo_takes_back(session: Session, file: Path) -> None:
    session.set_field("receivers.height_mm", 5.9)
    edited_outside(file, "clear_thickness_mm = 8.0 ", "clear_thickness_mm = 9.0 ")
    session.look_at_file()
    assert (session.design.cavity.clear_thickness_mm, session.design.receivers.height_mm) == (9.0, 6.0)
    assert session.is_saved is True
    assert says(session.said.text, f"{file} ... Undo brings")
    session.undo()
    assert (session.design.cavity.clear_thickness_mm, session.design.receivers.height_mm) == (8.0, 5.9)
    assert session.is_saved is False
    assert session.save()
    assert DesignFile(str(file)).saved.digest == session.design.digest


def test_a_file_made_invalid_is_said_once_and_edits_are_kept(session: Session, file: Path) -> None:
    session.set_field("receivers.height_mm", 5.9)
    edited_outside(file, "clear_thickness_mm = 8.0 ", "clear_thickness_mm = 0.1 ")
    told: list[str] = []
    session.listen(lambda: told.append(session.said.text))
    for _ in range(3):
        session.look_at_file()
    assert len(told) == 1
    assert "cavity.clear_thickness_mm: 0.1 is refused" in told[0]
    assert "Save writes" in told[0]
    assert session.design.receivers.height_mm == 5.9
    session.undo()
    assert session.is_saved is False  # the file holds no design
    edited_outside(file, "clear_thickness_mm = 0.1 ", "clear_thickness_mm = 8.0 ")
    session.look_at_file()
    assert session.said.text == f"{file} is readable again"
    assert session.is_saved is True


@pytest.mark.parametrize(
    "content",
    [b"\xff\xfe not text", b"[cavity", b"", b"x" * 1_000_001],
    ids=["bytes", "half", "empty", "long"],
)
def test_a_file_that_is_no_design_at_all_is_said_and_saved_over(
    session: Session, file: Path, content: bytes
) -> None:
    session.set_field(CLEAR, 9.0)
    file.write_bytes(content)
    session.look_at_file()
    assert session.said.is_bad
    assert session.said.text.startswith(str(file))
    assert session.save()
    assert DesignFile(str(file)).saved.digest == session.design.digest


def test_a_deleted_file_is_said_once_and_saved_again(session: Session, file: Path) -> None:
    before = file.read_bytes()
    file.unlink()
    told: list[str] = []
    session.listen(lambda: told.append(session.said.text))
    session.look_at_file()
    session.look_at_file()
    assert len(told) == 1
    assert says(told[0], f"{file} ... Save writes")
    assert session.is_saved is False
    assert session.save()
    assert file.read_bytes() == before
    assert session.is_saved is True


def test_a_change_that_nobody_has_looked_at_is_not_saved_over(session: Session, file: Path) -> None:
    session.set_field(CLEAR, 9.0)
    edited_outside(file, "mixing_ratio = 20.0 ", "mixing_ratio = 15.0 ")
    assert session.save() is False
    assert "was just changed outside" in session.said.text
    assert "mixing_ratio = 15.0 " in file.read_text(encoding="utf-8")
    session.look_at_file()
    assert session.design.elastomer.mixing_ratio == 15.0


def test_save_says_where_and_what_is_saved_is_what_is_on_the_table(session: Session, file: Path) -> None:
    session.set_field(CLEAR, 9.0)
    assert session.is_saved is False
    assert session.save()
    assert session.said == Said(text=f"saved: {file}")
    assert session.is_saved is True
    session.undo()
    assert session.is_saved is False


def test_every_change_is_told_to_those_who_listen(session: Session) -> None:
    told: list[Said] = []
    session.listen(lambda: told.append(session.said))
    session.set_field(CLEAR, 9.0)
    session.set_field(CLEAR, 0.0)
    session.move_tip(x_mm=10.0)
    session.move_tip(x_mm=10.0)
    session.undo()
    session.redo()
    session.pin()
    session.say("hello")
    assert [one.is_bad for one in told] == [False, True, True, False, False, False, False]
    assert told[-1].text == "hello"


def test_an_edit_after_undo_ends_what_could_be_done_again(session: Session, clock: Clock) -> None:
    thicknesses(session, clock, 9.0, 10.0)
    session.undo()
    thicknesses(session, clock, 11.0)
    assert session.can_redo is False
    session.undo()
    assert session.design.cavity.clear_thickness_mm == 9.0


def test_a_comment_more_is_kept_and_takes_no_edit_away(session: Session, file: Path) -> None:
    session.set_field("receivers.height_mm", 5.9)
    edited_outside(file, "[cavity]\n", "[cavity]  # as poured on Monday\n")
    said = session.said
    session.look_at_file()
    assert session.said is said
    assert session.design.receivers.height_mm == 5.9
    assert session.save()
    assert "[cavity]  # as poured on Monday\n" in file.read_text(encoding="utf-8")


def test_a_file_that_names_an_unknown_part_is_said_and_edits_are_kept(session: Session, file: Path) -> None:
    session.set_field(CLEAR, 9.0)
    edited_outside(file, '"osram-sfh206k"', '"osram-sfh299"')
    session.look_at_file()
    assert session.said.is_bad
    assert "receivers.part" in session.said.text
    assert session.design.cavity.clear_thickness_mm == 9.0
    with pytest.raises(InputError, match=r"receivers\.part"):
        Session(DesignFile(str(file)))


def test_an_object_presses_in_place_of_the_tip_is_turned_and_taken_away(session: Session) -> None:
    before, told = session.press, []
    session.listen(lambda: told.append(session.press))
    session.turn(yaw=10.0)
    assert (session.press, told) == (before, [])
    assert session.hold("cylinder,radius=4,x=9,depth=1")
    held = session.press.held
    assert held == held_of("cylinder,radius=4")
    assert session.press == LivePress(x_mm=9.0, y_mm=before.y_mm, depth_mm=1.0, held=held)
    assert session.said == Said(text="pressed by a cylinder of radius 4 mm, 10 mm long")
    session.turn(yaw=190.4)
    session.move_tip(y_mm=12.0)
    assert session.press.held == held_of("cylinder,radius=4,yaw=-170")
    session.shear(x_mm=0.123)
    session.shear(y_mm=-7.0)
    assert session.press.sideways_mm == (0.12, -1.0)
    assert told[-1] == session.press
    turned = session.press
    for text in ("cylinder,radius=0", "cylinder,radius", "cube", "mesh,file=none.stl,units=mm"):
        assert not session.hold(text)
        assert session.said.is_bad
        assert session.press == turned
    assert session.hold("")
    assert session.press == replace(turned, held=None, sideways_mm=(0.0, 0.0))
    session.shear(x_mm=0.2)
    assert session.press.sideways_mm == (0.0, 0.0)


def test_a_second_tip_is_added_dragged_and_taken_away(session: Session) -> None:
    first, told = session.press, []
    session.listen(lambda: told.append(session.press))
    session.move_second(x_mm=3.0)
    assert (session.press, told) == (first, [])
    assert session.hold("sphere")
    session.add_second(True)
    radius, space = session.design.indenter.tip_radius_mm, workspace_of(session.design)
    press = session.press
    assert press.second_mm is not None
    assert press.held is None
    assert (press.place_mm, press.depth_mm) == (first.place_mm, 1.0)
    assert math.dist(press.place_mm, press.second_mm[:2]) > 2.0 * radius
    session.move_second(x_mm=500.0, depth_mm=0.756)
    assert session.press.second_mm == (space.x1_mm, press.second_mm[1], 0.76)
    session.move_tip(x_mm=-500.0)
    assert session.press.tips_mm == ((space.x0_mm, press.y_mm, 1.0), session.press.second_mm)
    assert told[-1] == session.press
    assert session.set_field("operating.workspace_margin_mm", 8.0)
    assert session.press.second_mm is not None
    assert session.press.second_mm[0] == workspace_of(session.design).x1_mm
    session.add_second(False)
    assert session.press.is_single_tip
    session.add_second(True)
    assert session.hold("sphere")
    assert session.press.second_mm is None


def test_an_object_may_not_leave_the_workspace_and_an_angle_in_radians_is_doubted(session: Session) -> None:
    assert session.hold("box,pose=edge,x=500,yaw=0.785398")
    assert session.press.x_mm == workspace_of(session.design).x1_mm
    assert "yaw=45" in session.said.text
