"""Light of two tips at once, on the top that the contact model of both gives."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.sims.cache import LightStore
from optopad.sims.contact.held import tips
from optopad.sims.optics import tracing
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.optics.engine import trace_states
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import symmetries_of
from optopad.sims.optics.tracing import tops_of_tips, trace
from tests.oracle.tracer import trace_oracle
from tests.sims.optics.surface.analytic import compact_dimple

PAD = Draft.of(preset("piacenza2017-pad"))
ABSENT = [np.nan] * 3
ONE, OTHER = [12.0, 14.0, 1.0], [21.0, 17.0, 0.6]
STATES = [[ONE, OTHER], [OTHER, ONE], [ONE, ABSENT], [[3.0, 99.0, -1.0], ONE], [ABSENT, [16.0, 16.0, 0.0]]]


@pytest.fixture(scope="module")
def light() -> LightSignals:
    return trace(PAD, np.array(STATES), accuracy="draft")


def test_the_order_of_tips_and_an_absent_one_change_no_bit(light):
    both, exchanged, alone, as_alone, untouched = light.flux
    np.testing.assert_array_equal(both, exchanged)
    np.testing.assert_array_equal(alone, as_alone)
    assert np.abs(both / untouched - 1.0).max() > 0.2
    assert np.abs(both / alone - 1.0).max() > 0.1
    again = trace(PAD, np.array([[OTHER, ONE]]), accuracy="draft")
    np.testing.assert_array_equal(again.flux[0], both)
    assert light.presses.shape == (5, 2, 3)
    assert np.isfinite(light.presses).all()


def test_tips_mirrored_with_the_pad_have_the_mirrored_light_to_the_bit(light):
    motion = symmetries_of(scene_of(PAD.design))[-1]
    images = np.array(STATES[:1])
    images[..., :2] = motion.image(images[..., :2])
    found = trace(PAD, np.concatenate([images, STATES[:1]]), accuracy="draft").flux
    np.testing.assert_array_equal(found[0][motion.emitters][:, motion.receivers], found[1])
    np.testing.assert_allclose(found[1], light.flux[0], rtol=1e-9, atol=2e-3 * found.max())


def test_one_tip_on_a_grid_has_nearly_the_light_of_its_curve(light):
    curve = trace(PAD, np.array([ONE, [*ONE[:2], 0.0]]), accuracy="draft").flux
    grid = light.flux[2] / light.flux[4]
    assert np.sqrt(np.mean((grid - curve[0] / curve[1]) ** 2)) < 0.005


def test_tips_that_are_not_modelled_are_refused_before_any_light():
    near, profile = np.array([[ONE, [15.0, 14.0, 1.0]]]), compact_dimple(1.0)
    with pytest.raises(ModelScopeError, match="overlap"):
        trace(PAD, near)
    with pytest.raises(InputError, match="3 at once"):
        trace(PAD, np.array([[ONE, OTHER, [16.0, 25.0, 0.5]]]))
    with pytest.raises(InputError, match="leave the profile out"):
        trace(PAD, np.array([[ONE, OTHER]]), profile)
    smooth = Draft.of(PAD.design.with_(**{"surfaces.wall_finish": "air_gap"}))
    with pytest.raises(ModelScopeError, match=r"one tip at a time.*diffuse"):
        trace(smooth, np.array([[ONE, OTHER]]))


def test_the_light_of_each_state_is_kept_and_found_without_the_contact_model(tmp_path, monkeypatch):
    store, solved, real = LightStore(tmp_path / "rows.sqlite", 50.0), [], tips.pressed_tips
    monkeypatch.setattr(tracing, "light_store", lambda: store)
    monkeypatch.setattr(tips, "pressed_tips", lambda *given: solved.append(1) or real(*given))
    monkeypatch.setattr(trace_states, "BATCH_GRIDS", 1)
    states, pair = np.array([STATES[0], STATES[2], [OTHER, ABSENT]]), np.zeros((8, 8), dtype=np.bool_)
    pair[0, 5] = True

    def stop(done: int, _states: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trace(PAD, states, accuracy="draft", pairs=pair, on_step=stop)
    assert len(solved) == 2
    whole = trace(PAD, states, accuracy="draft", pairs=pair)
    assert len(solved) == 3
    again = trace(PAD, states[::-1], accuracy="draft", pairs=pair)
    assert len(solved) == 3
    np.testing.assert_array_equal(again.flux[::-1], whole.flux)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["levi2013-disc", "crowned-40x25"])
def test_two_tips_are_traced_on_every_shape(name):
    draft = Draft.of(preset(name))
    x, y = draft.plan.outline.centre_mm
    one, other = [x - 4.0, y, 0.5], [x + 4.0, y + 1.0, 0.8]
    both, untouched = trace(draft, np.array([[one, other], [ABSENT, ABSENT]]), accuracy="draft").flux
    assert np.abs(both / untouched - 1.0).max() > 0.05


@pytest.mark.slow
def test_every_pairs_light_under_two_tips_is_the_oracles():
    presses = np.array([ABSENT, ABSENT, [12.0, 12.0, 1.0], [17.3, 17.3, 1.0]]).reshape(2, 2, 3)
    found, scene = trace(PAD, presses, accuracy="standard"), scene_of(PAD.design)
    top = tops_of_tips(PAD, scene, np.nan_to_num(presses)).made(1)
    rays = 200_000
    known = trace_oracle(scene, np.zeros((1, 2)), [top], rays=rays, seed=2017).without_crossing[0]
    # the oracle counts rays, so its variance is flux / rays, by the product's flux: few counts would seem too certain
    pulls = (found.flux[1] - known) / np.hypot(found.standard_error[1], np.sqrt(found.flux[1] / rays))
    bright = found.flux[1] * rays >= 25.0
    assert bright.sum() > 40
    assert np.abs(pulls[bright]).max() < 4.0
    assert np.sqrt(np.mean(pulls[bright] ** 2)) < 1.3
    # and a press by one of the two alone would be far off
    alone = trace(PAD, np.array([[*presses[1, :1].tolist(), ABSENT], *STATES[:1]]), accuracy="standard").flux[
        0
    ]
    assert np.abs((alone - known) / np.sqrt(found.flux[1] / rays))[bright].max() > 10.0
