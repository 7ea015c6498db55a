"""What `check` says of objects on the rim and between the walls is what the model of pressed objects accepts."""

from __future__ import annotations

import pytest

from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.design.rules.touch import largest_ball_mm
from optopad.sims.held import AskedPress, pressed

PAD = Draft.of(preset("gripper-stadium"))


def asked(text: str, depth_mm: float = 0.5) -> AskedPress:
    return AskedPress(held=(held_of(text),), at_mm=(12.0, 7.0), depth_mm=depth_mm)


def test_a_flat_face_that_fits_is_pressed_and_a_larger_one_refused() -> None:
    """The face of 12.2 mm that the note on gripper-stadium names, and one that comes nearer to the walls."""
    assert pressed(PAD, asked("punch,radius=6.1")).force_n > 0.0
    with pytest.raises(ModelScopeError, match="of a wall"):
        pressed(PAD, asked("punch,radius=6.5"))


@pytest.mark.parametrize("shape", ["sphere", "cylinder,length=9.9"])
def test_the_largest_ball_is_pressed_and_a_larger_one_meets_the_rim(shape: str) -> None:
    """A short cylinder in the straight part of the pad is stopped as a ball is."""
    radius = largest_ball_mm(PAD.outline, 0.5)
    assert pressed(PAD, asked(f"{shape},radius={0.98 * radius}")).force_n > 0.0
    with pytest.raises(ModelScopeError, match=r"touch the rim .* 1\.5 mm above"):
        pressed(PAD, asked(f"{shape},radius={1.02 * radius}"))


@pytest.mark.parametrize("across", ["cylinder,radius=3,length=100,yaw=90", "box,length=80,width=80"])
@pytest.mark.parametrize("rim_mm", [0.0, 1.5])
def test_an_object_that_spans_the_opening_is_stopped_by_the_rim(across: str, rim_mm: float) -> None:
    with pytest.raises(ModelScopeError, match="touch the rim"):
        pressed(Draft.of(PAD.design.with_(**{"mold.rim_mm": rim_mm})), asked(across, 0.1))
