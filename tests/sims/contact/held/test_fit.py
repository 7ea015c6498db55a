"""What `check` says of objects that fit between the walls is what the model of pressed objects accepts."""

from __future__ import annotations

import pytest

from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.sims.held import AskedPress, pressed


def asked(text: str) -> AskedPress:
    return AskedPress(held=(held_of(text),), at_mm=(12.0, 7.0), depth_mm=0.5)


def test_a_flat_face_that_fits_is_pressed_and_a_larger_one_refused() -> None:
    """The face of 12.2 mm that the note on gripper-stadium names, and one that comes nearer to the walls."""
    pad = Draft.of(preset("gripper-stadium"))
    assert pressed(pad, asked("punch,radius=6.1")).force_n > 0.0
    with pytest.raises(ModelScopeError, match="of a wall"):
        pressed(pad, asked("punch,radius=6.5"))
