"""Two tips in one pad: absent, exchanged and mirrored ones, tips far apart, and refusals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.sims.contact.held import layer, tips
from optopad.sims.contact.held.tips import TipsPress, deepest_mm, pressed_tips
from optopad.sims.contact.pad_surface import pad_surfaces
from optopad.sims.contact.scope import contact_of

PAD = contact_of(preset("piacenza2017-pad").with_(**{"cavity.clear_thickness_mm": 8.11}))
"""A pad that nothing else computes, so that it may be computed coarsely."""
DOME = contact_of(preset("fingertip-dome").with_(**{"cavity.black_thickness_mm": 0.97}))
TWO = np.array([[11.0, 16.0, 1.0], [19.0, 14.0, 0.6]])


@pytest.fixture(autouse=True, scope="module")
def coarse() -> object:
    """Few finite elements: the tests compare the model with itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layer, "MOST_ELEMENTS", 4)
        yield


@cache
def both() -> TipsPress:
    return pressed_tips(PAD, TWO)


def heights(press: TipsPress) -> FloatArray:
    return press.top.height_mm


def test_one_tip_has_the_top_and_the_force_of_the_contact_library():
    found = pressed_tips(PAD, TWO[:1])
    (surface,) = pad_surfaces(PAD, TWO[:1])
    assert found.force_n == found.alone_n == [surface.near.force_n]
    x, y = (one + at for one, at in zip((found.top.x_mm, found.top.y_mm), found.top.at_mm, strict=True))
    free = (found.top.level < 0.0) & (np.abs(x[:, None] - 16.0) < 15.9) & (np.abs(y - 16.0) < 15.9)
    # next to the contact, the library's curve is above the ball by less than a micrometre
    np.testing.assert_allclose(found.top.height_mm[free], surface.height_mm(x, y)[free], atol=1e-3)


@pytest.mark.parametrize("absent", [[5.0, 5.0, 0.0], [20.0, 9.0, -1.0], [np.nan, np.nan, np.nan]])
def test_an_absent_tip_changes_nothing(absent: list[float]):
    alone, found = (pressed_tips(PAD, tips) for tips in (TWO[:1], np.array([absent, TWO[0]])))
    np.testing.assert_array_equal(heights(found), heights(alone))
    np.testing.assert_array_equal(found.top.level, alone.top.level)


def test_exchanged_tips_have_the_same_top_to_the_bit():
    other = pressed_tips(PAD, TWO[::-1])
    np.testing.assert_array_equal(heights(other), heights(both()))
    np.testing.assert_array_equal(other.top.level, both().top.level)
    np.testing.assert_array_equal(other.force_n, both().force_n[::-1])


def test_mirrored_tips_have_the_mirrored_top():
    mirrored = pressed_tips(PAD, [32.0, 0.0, 0.0] + [-1.0, 1.0, 1.0] * TWO)
    # the pad's response is solved iteratively, to a millionth of the depth
    np.testing.assert_allclose(heights(mirrored), heights(both())[::-1], atol=1e-4)
    np.testing.assert_allclose(mirrored.force_n, both().force_n, rtol=1e-4)


def test_each_tip_is_where_it_is_pressed_and_nothing_is_above_it():
    top, radius = both().top, PAD.tip_radius_mm
    x, y = (one + at for one, at in zip((top.x_mm, top.y_mm), top.at_mm, strict=True))
    for at_x, at_y, depth in TWO:
        square = radius**2 - (x[:, None] - at_x) ** 2 - (y - at_y) ** 2
        ball = radius - depth - np.sqrt(np.maximum(square, 0.0))
        assert (top.height_mm - np.where(square > 0.0, ball, np.inf)).max() <= 1e-12
        near = np.hypot(x[:, None] - at_x, y - at_y) < 0.4
        assert (top.level[near] > 0.0).all()
        np.testing.assert_allclose(top.height_mm[near], ball[near])


def test_the_other_tip_pushes_the_top_up_and_so_raises_the_force_most_on_the_shallower_one():
    """The layer is incompressible: what one tip displaces rises elsewhere."""
    share = both().force_n / both().alone_n
    assert 1.0 < share[0] < share[1] < 1.2


def test_on_a_crown_tips_are_pressed_along_their_own_normals():
    at = np.array([[8.8, 11.0, 0.3], [13.2, 11.0, 0.3]])
    found = pressed_tips(DOME, at)
    assert found.force_n[0] == pytest.approx(found.force_n[1], rel=1e-3)
    top = found.top
    assert top.at_mm == (11.0, 11.0)
    for x, y, depth in at:
        plan = DOME.draft.plan.top
        origin, axes = plan.press_frame(*top.at_mm)
        apex = np.array([x, y, float(plan.height_mm(x, y))]) - depth * plan.normal(x, y)
        near = axes @ (apex - origin)
        i, j = np.abs(top.x_mm - near[0]).argmin(), np.abs(top.y_mm - near[1]).argmin()
        assert top.level[i, j] > 0.0


@pytest.mark.parametrize("radius", [3.0, 4.0])
def test_each_contact_grows_from_the_library_s_as_the_linear_one_does(radius: float):
    """Also where the linear layer's contact is narrower by more than a step of the grid."""
    pad = contact_of(
        preset("piacenza2017-pad").with_(
            **{"indenter.tip_radius_mm": radius, "cavity.clear_thickness_mm": 2.7 * radius}
        )
    )
    at = np.array([[9.5, 16.0, 0.9 * radius], [22.5, 16.0, 0.9 * radius]])
    top, on = pressed_tips(pad, at).top, tips.pad_at(pad, pad.draft.plan.centre_mm, tips.FINE)
    overlaps = [tips._overlap(on, pad, one) for one in at]
    alone, both = (
        sum(tips._linear(on, one, 0.9 * radius).area_mm2 for one in of)
        for of in (overlaps, [np.minimum(*overlaps)])
    )
    library = sum(np.pi * one.near.contact_radius_mm**2 for one in pad_surfaces(pad, at))
    share = np.clip(0.5 + top.level / on.step_mm, 0.0, 1.0)
    assert share.sum() * on.step_mm**2 == pytest.approx(library * both / alone, rel=0.01)


def test_a_tip_of_some_micrometres_leaves_the_other_one_s_top():
    barely = np.array([[10.03, 16.04, 1.0], [20.07, 16.06, 0.002]])
    found = pressed_tips(PAD, barely)
    np.testing.assert_array_equal(heights(found), heights(pressed_tips(PAD, barely[:1])))
    assert 0.0 < found.force_n[1] < 1e-3
    crown = pressed_tips(DOME, np.array([[11.0, 11.0, 1e-4]]))
    assert not heights(crown).any()
    assert (crown.top.level < 0.0).all()


def test_what_is_not_covered_is_refused_with_the_way_out():
    deep = deepest_mm(PAD)
    for at, kind, words in (
        ([[12.0, 16.0, 1.0], [17.9, 16.0, 1.0]], ModelScopeError, "overlap.*5.9.*6 mm"),
        ([[8.0, 8.0, 1.0], [16.0, 16.0, 1.0], [24.0, 24.0, 1.0]], InputError, "3 at once"),
        ([[10.0, 16.0, deep + 0.01], [22.0, 16.0, 1.0]], ModelScopeError, "deeper"),
        ([[10.0, 16.0, 0.0]], InputError, "none"),
    ):
        with pytest.raises(kind, match=words):
            pressed_tips(PAD, np.array(at))
    flat = contact_of(preset("piacenza2017-pad").with_(**{"indenter.shape": "flat_punch"}))
    with pytest.raises(ModelScopeError, match=r"indenter\.shape"):
        pressed_tips(flat, TWO)
