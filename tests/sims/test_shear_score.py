"""A score of sideways load: symmetric locations, mirrored presses, refusals; and once a whole score of a small pad."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.sims import shear_score
from optopad.sims.bounds.fisher import Sensitivity, bounds_of, least_variances
from optopad.sims.contact.held.press import HeldPress
from optopad.sims.held import AskedPress, held_light, pressed
from optopad.sims.shear_score import PITCH_MM, WAYS, ShearScore, _image, _places, _States, score_shear

SQUARE, PLAIN = "piacenza2017-pad", "gripper-stadium"


@cache
def draft(name: str) -> Draft:
    return Draft.of(preset(name))


def test_symmetric_locations_have_the_light_of_the_image_of_pair_and_pull():
    """The pad with four equal sides: each location is the image of a computed one under a turn about the middle."""
    pad, middle = draft(SQUARE), np.array(draft(SQUARE).plan.centre_mm)
    places = _places(pad, 0.5, PITCH_MM)
    assert 3.5 * len(places.computed_mm) <= len(places.all_mm)
    parts = [
        np.array([one.position_mm[:2] for one in of]) for of in (pad.cavity.emitters, pad.cavity.receivers)
    ]
    count, seen = len(parts[1]), set()
    for number, at in enumerate(places.all_mm):
        start = places.computed_mm[places.source[number]] - middle
        turned = [
            k
            for k in range(4)
            if np.allclose(np.linalg.matrix_power([[0, -1], [1, 0]], k) @ start, at - middle)
        ]
        matrices = [np.linalg.matrix_power([[0, -1], [1, 0]], k) for k in turned]
        found = [one for one in matrices if np.allclose(WAYS[places.ways[number]] @ one.T, WAYS)]
        assert found
        seen.update(turned)
        emitter, receiver = np.divmod(places.pairs[number], count)
        for of, own in zip(parts, (emitter[::count], receiver[:count]), strict=True):
            np.testing.assert_allclose((of[own] - middle) @ found[0].T + middle, of, atol=1e-9)
    assert seen == {0, 1, 2, 3}


def test_the_light_of_a_symmetric_location_is_that_of_the_turned_pull():
    places = _places(draft(SQUARE), 0.5, 6.0)
    rng, computed = np.random.default_rng(4), len(places.computed_mm)
    states = _States(
        places=places,
        depth_mm=np.array([1.0]),
        pull_n=np.array([0.5]),
        shear_mm=np.array([0.1]),
        force_n=np.ones((computed, 1)),
        pulls_n=np.broadcast_to(0.4 * WAYS, (computed, 1, 4, 2)),
        change=rng.normal(size=(2, computed, 1, 4, 64)),
    )
    own, found = states.factors.mean(axis=0), states.light().factors
    np.testing.assert_allclose(
        own[:, 0, 0], (states.change[..., 0, :] - states.change[..., 1, :]).mean(axis=0)[:, 0] / 0.8
    )
    np.testing.assert_allclose(states.scaled, 1.25 * states.change.mean(axis=0))
    for number, source in enumerate(places.source):
        for axis in range(2):
            turned = WAYS[places.ways[number, 2 * axis]] @ own[source, 0, :2]
            np.testing.assert_allclose(found[number, 0, axis], turned[places.pairs[number]])


def test_locations_of_a_pad_without_symmetry_are_all_computed_and_inside():
    pad = draft(PLAIN)
    places = _places(pad, 0.5, PITCH_MM)
    assert len(places.computed_mm) == len(places.all_mm) > 20
    assert all(pad.workspace.contains(*at) for at in places.all_mm.tolist())
    away = np.linalg.norm(places.all_mm[:, None] - places.all_mm, axis=2) + 9.0 * np.eye(len(places.all_mm))
    assert away.min() > 1.0
    few = _places(pad, 0.5, 50.0)
    assert len(few.all_mm) == 9


def test_the_image_of_a_press_is_the_press_at_the_image():
    pad, turn = draft("fingertip-16"), np.array([[0.0, -1.0], [1.0, 0.0]])
    mirror = np.array([[-1.0, 0.0], [0.0, 1.0]])

    def pressed_at(x: float, y: float, yaw: float) -> HeldPress:
        held = held_of(f"cylinder,radius=2,length=3,yaw={yaw:g}")
        return pressed(pad, AskedPress(held=(held,), at_mm=(x, y), depth_mm=0.3))

    one = replace(pressed_at(7.0, 8.5, 20.0), pull_n=(0.3, 0.1))
    for matrix, other in ((turn, pressed_at(7.5, 7.0, 110.0)), (mirror, pressed_at(9.0, 8.5, 160.0))):
        image = _image(one, matrix, np.array([16.0, 0.0]))
        assert image.top.at_mm == other.top.at_mm
        assert image.pull_n == pytest.approx(tuple(matrix @ one.pull_n))
        for name in ("x_mm", "y_mm", "height_mm", "level"):
            np.testing.assert_allclose(getattr(image.top, name), getattr(other.top, name), atol=2e-6)


def test_more_unknowns_never_lower_a_bound():
    rng = np.random.default_rng(2)
    first = rng.normal(size=(40, 20, 5))
    five = Sensitivity(first=first, second=first, weight=np.ones((40, 20)))
    three = Sensitivity(first=first[..., :3], second=first[..., :3], weight=np.ones((40, 20)))
    assert (bounds_of(five).location_mm >= bounds_of(three).location_mm).all()
    assert (bounds_of(five).depth_mm >= bounds_of(three).depth_mm).all()
    np.testing.assert_allclose(bounds_of(five).depth_alone_mm, bounds_of(three).depth_alone_mm)
    variance, _, is_seen = least_variances(five)
    assert is_seen.all()
    inverse = np.linalg.inv(np.swapaxes(first, 1, 2) @ first)
    np.testing.assert_allclose(variance, np.diagonal(inverse, axis1=1, axis2=2))


def test_without_friction_nothing_is_scored():
    with pytest.raises(InputError, match="friction: 0 holds nothing sideways"):
        score_shear(draft(SQUARE), friction=0.0)


def test_a_workspace_without_room_is_refused():
    with pytest.raises(ModelScopeError, match="workspace_margin_mm"):
        _places(draft(SQUARE), 11.0, PITCH_MM)


@pytest.fixture(scope="module")
def whole() -> ShearScore:
    """A score of three locations a side."""
    patch = pytest.MonkeyPatch()
    patch.setattr(shear_score, "PITCH_MM", 50.0)
    patch.setattr(shear_score, "TESTS", 4)
    try:
        return score_shear(draft("fingertip-16"))
    finally:
        patch.undo()


@pytest.mark.slow
def test_a_whole_score_has_bounds_errors_and_a_map_that_finds_the_pull(whole: ShearScore):
    shape = len(whole.places_mm), 2
    assert whole.least_pull_n.shape == whole.force_n.shape == shape
    assert (whole.location_times >= 1.0).all()
    assert (whole.depth_times >= 1.0).all()
    assert 0.02 < np.median(whole.least_pull_n) < 0.2
    np.testing.assert_allclose(whole.pull_n, 0.5)
    for one in whole.moved.values():
        assert one.moved_mm.shape == one.deeper_mm.shape == one.stronger_n.shape == (*shape, 4)
        assert np.median(one.moved_mm) > 0.005
    plain, known = whole.map_errors[2:]
    assert (plain["is_pulled"], known["is_pulled"]) == (True, True)
    assert known["location_mm"][0] < plain["location_mm"][0]
    assert known["pull_n"][0] < 0.2


@pytest.mark.slow
def test_a_symmetric_press_that_is_pulled_the_other_way_gives_the_mirrored_frame():
    """In the middle of the pad, a half turn swaps the pulls along +x and -x."""
    pad = draft(SQUARE)
    x, y = pad.plan.centre_mm
    asked = [
        AskedPress(held=(held_of("sphere,radius=3"),), at_mm=(x, y), depth_mm=1.0, shear_mm=shear)
        for shear in (None, (0.1, 0.0), (-0.1, 0.0))
    ]
    still, one, other = held_light(pad, [pressed(pad, each) for each in asked]).units
    image = []
    for parts in (pad.cavity.emitters, pad.cavity.receivers):
        at = np.array([part.position_mm[:2] for part in parts])
        image.append(np.linalg.norm(at[:, None] + at - [2 * x, 2 * y], axis=2).argmin(axis=1))
    mirrored = (other - still)[np.ix_(*image)]
    size = np.linalg.norm(one - still)
    assert np.linalg.norm(one - other) > 1.5 * size
    assert (
        np.linalg.norm(one - still - mirrored) < 0.25 * size
    )  # errors of the light: 0.5 sigma in all pairs together
