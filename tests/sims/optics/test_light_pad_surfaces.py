"""Light at a place is traced on the surface of a press at that place; symmetric places once."""

from __future__ import annotations

import numpy as np
import pytest

from design.errors import ModelScopeError
from design.preset import preset
from sims.contact.pad_surface import pad_surface
from sims.optics.scene.lower import scene_of
from sims.optics.scene.symmetry import symmetries_of
from sims.optics.tracing import FIELD_STEP, pressed_tops, trace

PAD = preset("piacenza2017-pad")
ROUND = np.array([[7.0, 9.0, 2.0], [23.0, 7.0, 2.0], [25.0, 23.0, 2.0], [9.0, 25.0, 2.0]])
"""One press and its quarter turns."""


def test_symmetric_places_have_the_same_light_to_the_bit_and_are_traced_once() -> None:
    tops = pressed_tops(PAD, ROUND)
    assert len(tops.near) == len(tops.fields) == 1
    assert tops.fields[0] is not None
    light = trace(PAD, ROUND, accuracy="draft")
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


@pytest.mark.parametrize("at", [(16.0, 16.0), (6.0, 16.0), (6.0, 6.0)])
def test_curve_and_field_are_the_pads_surface(at: tuple[float, float]) -> None:
    tops = pressed_tops(PAD, np.array([[*at, 3.0]]))
    near, field = tops.near[0][0], tops.fields[0]
    assert near is not None
    assert field is not None
    places = np.linspace(0.0, 32.0, 161)
    off = field.height_mm(places[:, None], places[None, :]) - pad_surface(PAD, 3.0, at).beside_mm(
        places, places
    )
    # nodes a third of a tip radius apart
    assert field.step_mm.max() <= FIELD_STEP * 3.0
    assert np.sqrt(np.mean(off**2)) < 1.5e-3
    assert np.abs(off).max() < 8e-3


def test_light_off_the_middle_is_not_that_of_the_centred_shape() -> None:
    press = np.array([[6.0, 16.0, 3.0]])
    own = trace(PAD, press, accuracy="draft").flux[0]
    centred = trace(PAD, press, accuracy="draft", profile=pad_surface(PAD, 3.0).near).flux[0]
    untouched = trace(PAD, np.array([[6.0, 16.0, 0.0]]), accuracy="draft").flux[0]
    lit = untouched > 0.2 * np.median(untouched)
    assert np.sqrt(np.mean(((own - centred) / untouched)[lit] ** 2)) > 0.02


def test_two_tips_add_their_curves_and_fields() -> None:
    one, other = [8.0, 8.0, 1.0], [24.0, 24.0, 1.5]
    both = pressed_tops(PAD, np.array([[one, other]]))
    single = pressed_tops(PAD, np.array([one, other]))
    assert both.fields[0] is not None
    assert single.fields[0] is not None
    assert single.fields[1] is not None
    np.testing.assert_allclose(
        both.fields[0].nodes, single.fields[0].nodes + single.fields[1].nodes, atol=1e-15
    )
    assert [tip.depth_mm for tip in both.near[0] if tip is not None] == [1.0, 1.5]


def test_a_place_that_the_contact_model_does_not_cover_is_out_of_scope() -> None:
    with pytest.raises(ModelScopeError, match="west wall is 1"):
        trace(PAD, np.array([[4.0, 16.0, 1.0]]))
