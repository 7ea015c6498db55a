"""Light at a place is traced on the surface of a press at that place; symmetric places once."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.preset import FLAT_PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.contact.pad_surface import pad_surface
from optopad.sims.optics import tracing
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import symmetries_of
from optopad.sims.optics.tracing import trace
from tests.oracle.pressed import pressed_tops

PAD = preset("piacenza2017-pad")
ROUND = np.array([[7.0, 9.0, 2.0], [23.0, 7.0, 2.0], [25.0, 23.0, 2.0], [9.0, 25.0, 2.0]])
"""One press and its quarter turns."""


def test_symmetric_places_have_the_same_light_to_the_bit_and_are_traced_once() -> None:
    tops = pressed_tops(PAD, ROUND)
    assert len(tops.near) == len(tops.fields) == 1
    assert tops.fields[0] is not None
    light = trace(Draft.of(PAD), ROUND, accuracy="draft")
    symmetries = symmetries_of(scene_of(PAD))
    for row, press in enumerate(ROUND):
        (motion,) = [one for one in symmetries if np.allclose(one.image(ROUND[0, :2]), press[:2])]
        there = light.flux[row][np.ix_(motion.emitters, motion.receivers)]
        assert (there == light.flux[0]).all()


def test_presses_of_another_depth_or_place_are_their_own() -> None:
    presses = np.array([[7.0, 9.0, 2.0], [7.0, 9.0, 2.1], [7.0, 9.5, 2.0], [7.0, 9.0, 0.0]])
    tops = pressed_tops(PAD, presses)
    assert tops.classes.member.tolist() == [0, 1, 2, 3]
    assert tops.fields[3] is None
    assert pressed_tops(PAD, ROUND, by_symmetry=False).classes.member.tolist() == [0, 1, 2, 3]


def places_of(design):
    """Near a corner, near a wall, in the middle, and between, in a rectangular pad [mm]."""
    cavity, near = cavity_of(design), 2.0 * design.indenter.tip_radius_mm
    length, width = cavity.length_mm, cavity.width_mm
    return [
        (near, near),
        (near, 0.5 * width),
        (0.5 * length, 0.5 * width),
        (length - near, width - 1.3 * near),
        (min(2.0 * near, 0.5 * length), min(1.5 * near, 0.5 * width)),
    ]


@pytest.mark.parametrize("name", FLAT_PRESETS)
def test_curve_and_field_are_the_pads_surface_up_to_its_walls(name):
    """Limits over the tip radius, heights and slopes, all over the top and within a fifth of the radius of a wall."""
    design = preset(name)
    cavity, radius = cavity_of(design), design.indenter.tip_radius_mm
    depth = min(1.3 * radius, design.operating.max_depth_mm)
    x, y = (np.linspace(0.0, size, 8 * round(2.5 * size) + 1) for size in (cavity.length_mm, cavity.width_mm))
    from_wall = np.minimum(np.minimum(x, x[-1] - x)[:, None], np.minimum(y, y[-1] - y))
    for at in places_of(design):
        (field,) = pressed_tops(design, np.array([[*at, depth]])).fields
        off = field.height_mm(x[:, None], y[None, :]) - pad_surface(design, depth, at).beside_mm(x, y)
        slopes = np.hypot(np.gradient(off, x, axis=0), np.gradient(off, y, axis=1))
        for part in (from_wall >= 0.0, from_wall < 0.2 * radius):
            assert np.sqrt(np.mean(off[part] ** 2)) < 5e-5 * radius
            assert np.sqrt(np.mean(slopes[part] ** 2)) < 1.5e-3


def traced(design, presses):
    """Light on the tops that the contact model makes now."""
    tops = pressed_tops(design, presses, by_symmetry=False)
    return trace_scene(scene_of(design), presses[:, :2], tops.near, fields=tops.fields, seed=3)


@pytest.mark.slow
@pytest.mark.parametrize("name", FLAT_PRESETS)
def test_nodes_half_as_far_apart_change_no_pairs_light_beyond_its_error(name, monkeypatch):
    design = preset(name)
    presses = np.array(
        [
            [*at, share * design.operating.max_depth_mm]
            for at in places_of(design)
            for share in (0.06, 0.25, 0.78)
        ]
    )
    here = traced(design, presses)
    monkeypatch.setattr(tracing, "FIELD_STEP", 0.5 * tracing.FIELD_STEP)
    monkeypatch.setattr(tracing, "_SMOOTH_PARTS", WeakKeyDictionary())
    there = traced(design, presses)
    joint = np.hypot(here.standard_error, there.standard_error)
    pulls = (there.flux - here.flux).sum(axis=0)[joint > 0.0] / joint[joint > 0.0]
    assert np.sqrt(np.mean(pulls**2)) < 0.5
    assert np.abs(pulls).max() < 3.5


def test_light_off_the_middle_is_not_that_of_the_centred_shape() -> None:
    press = np.array([[6.0, 16.0, 3.0]])
    own = trace(Draft.of(PAD), press, accuracy="draft").flux[0]
    centred = trace(Draft.of(PAD), press, accuracy="draft", profile=pad_surface(PAD, 3.0).near).flux[0]
    untouched = trace(Draft.of(PAD), np.array([[6.0, 16.0, 0.0]]), accuracy="draft").flux[0]
    lit = untouched > 0.2 * np.median(untouched)
    assert np.sqrt(np.mean(((own - centred) / untouched)[lit] ** 2)) > 0.02


def test_a_place_that_the_contact_model_does_not_cover_is_out_of_scope() -> None:
    with pytest.raises(ModelScopeError, match="west wall is 1"):
        trace(Draft.of(PAD), np.array([[4.0, 16.0, 1.0]]))
