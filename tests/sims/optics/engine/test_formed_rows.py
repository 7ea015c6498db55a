"""Light of discs and crowned pads that is kept, traced once for equal states, and traced only where it is wanted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.sims.cache import LightStore
from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine import trace_states as engine
from optopad.sims.optics.engine.general import kernels as formed_kernels
from optopad.sims.optics.engine.general import pad as formed_pad
from optopad.sims.optics.engine.general.lower import stack_formed, windows_of
from optopad.sims.optics.engine.general.points import pitch_of, points_of, top_grid
from optopad.sims.optics.engine.general.rays import HALF_U
from optopad.sims.optics.engine.light_rows import row_names
from optopad.sims.optics.engine.trace_states import RawLight, trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.optics.scene.symmetry import each_its_own, state_classes, symmetries_of
from tests.oracle.form_scenes import crown_press, disc_scene, with_top

SCENE = disc_scene(6, 40.0)
SHALLOW, DEEP = crown_press(1.0, 40.0), crown_press(2.0, 40.0)
PLACES = np.array([[12.5, 11.0], [10.0, 13.0]])
EVERY = np.ones((2, 3, 3), dtype=np.bool_)


@pytest.fixture
def store(tmp_path: Path) -> LightStore:
    return LightStore(tmp_path / "rows.sqlite", 50.0)


@pytest.fixture
def rows_traced(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One number a batch: the rows that are traced."""
    counts: list[int] = []
    kernel = engine.trace_formed

    def counted(scene, tops, states, settings, seed, wanted):
        counts.append(int(wanted.any(axis=2).sum()))
        return kernel(scene, tops, states, settings, seed, wanted)

    monkeypatch.setattr(engine, "trace_formed", counted)
    return counts


def light(kept: LightStore | None = None, scene: OpticalScene = SCENE, **settings) -> RawLight:
    return trace_scene(scene, PLACES, [SHALLOW, DEEP], kept=kept, **({"accuracy": "draft"} | settings))


def assert_same_bits(one: RawLight, other: RawLight) -> None:
    for name in ("flux", "standard_error", "relative_error", "is_met"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_kept_light_is_fresh_light_to_the_bit_and_traces_nothing(store, rows_traced):
    fresh = light(store)
    assert rows_traced == [6]
    kept = light(store)
    assert rows_traced == [6]
    assert_same_bits(kept, fresh)
    assert_same_bits(kept, light())


def test_a_pair_depends_on_no_other_pair_that_is_wanted():
    whole = light()
    for wanted in ([(0, 1)], [(0, 1), (2, 2)], [(1, 0), (1, 1), (1, 2)]):
        pairs = np.zeros((3, 3), dtype=np.bool_)
        for pair in wanted:
            pairs[pair] = True
        some = light(pairs=pairs)
        assert np.array_equal(some.flux[:, :, pairs], whole.flux[:, :, pairs])
        assert np.array_equal(some.standard_error[:, pairs], whole.standard_error[:, pairs])
        assert (some.flux[:, :, ~pairs] == 0.0).all()


def test_a_state_depends_on_no_other_state():
    alone = trace_scene(SCENE, PLACES[1:], [DEEP], accuracy="draft")
    assert np.array_equal(alone.flux[:, 0], light().flux[:, 1])


def test_a_changed_emitter_traces_that_emitter_only(store, rows_traced):
    light(store)
    patch = SCENE.emitter_patch.copy()
    patch[1, 1] += 0.25
    light(store, replace(SCENE, emitter_patch=patch))
    assert rows_traced == [6, 2]


def test_a_name_holds_all_that_a_row_depends_on():
    def names(scene=SCENE, press=SHALLOW, place=(12.5, 11.0), settings=ACCURACIES["draft"], seed=0):
        tops = stack_formed(scene, np.array([place]), [press])
        return row_names(scene, tops, np.arange(1), EVERY[:1], settings, seed)[0]

    assert SCENE.form is not None
    changed = [
        {"press": DEEP},
        {"press": replace(SHALLOW, height_mm=SHALLOW.height_mm * 1.001)},
        {"press": replace(SHALLOW, contact_radius_mm=SHALLOW.contact_radius_mm * 0.99)},
        {"place": (12.5, 11.000001)},
        {"settings": ACCURACIES["score"]},
        {"seed": 1},
        {"scene": replace(SCENE, form=with_top(SCENE.form, kx=1 / 40.001, ky=1 / 40.001))},
        {"scene": replace(SCENE, wall_reflectance=0.07)},
    ]
    every = [name for change in [{}, *changed] for name in names(**change)]
    assert len(set(every)) == len(every)


def test_an_untouched_state_is_one_row_wherever_its_centre_is():
    tops = stack_formed(SCENE, np.array([[1.0, 2.0], [np.nan, 0.0]]), [None, None])
    names = row_names(SCENE, tops, np.arange(2), EVERY, ACCURACIES["draft"], 0)
    assert names[0] == names[1]


def test_a_state_and_its_images_are_traced_once_and_agree_with_each_on_its_own(rows_traced):
    motions = symmetries_of(SCENE)
    places = np.array([motion.image(PLACES[1]) for motion in motions])
    presses = [DEEP] * len(places)
    shared = trace_scene(SCENE, places, presses, accuracy="draft")
    assert rows_traced == [3]
    alone = trace_scene(SCENE, places, presses, accuracy="draft", classes=each_its_own(SCENE, len(places)))
    off = (shared.flux - alone.flux).sum(axis=0) / np.hypot(shared.standard_error, alone.standard_error)
    assert np.abs(off).max() < 4.0
    assert np.sqrt((off**2).mean()) < 1.5


def test_classes_that_are_given_are_taken():
    classes = state_classes(SCENE, PLACES[[0, 1, 0]][:, None], [[1.0], [2.0], [1.0]])
    found = trace_scene(SCENE, PLACES, [SHALLOW, DEEP], classes=classes, accuracy="draft")
    assert np.array_equal(found.flux, light().flux[:, [0, 1, 0]])


CROWN = scene_of(preset("crowned-40x25"))


def test_each_point_that_carries_chains_stands_for_four_of_its_batch() -> None:
    pad_walls = formed_pad.walls_of(CROWN)
    windows = np.vstack([windows_of(CROWN, kind) for kind in ("emitter", "receiver")])
    grid = top_grid(CROWN, windows, 0.5)
    some, every = (
        points_of(grid, CROWN, *pad_walls, np.array([0.5, 0.5]), all_chains=wanted)
        for wanted in (False, True)
    )
    assert (every.chains == 1.0).all()
    assert set(some.chains.tolist()) == {0.0, 4.0}
    for batch in range(4):
        own = some.batch == batch
        assert np.isclose(some.chains[own].mean(), 1.0, atol=0.05)


def test_the_grid_goes_by_images_and_not_by_the_narrowest_part_alone() -> None:
    emitters, receivers = windows_of(CROWN, "emitter"), windows_of(CROWN, "receiver")
    narrow = emitters.copy()
    narrow[:, HALF_U] = 0.15
    wide, close = (pitch_of(ACCURACIES["score"], CROWN, of, receivers) for of in (emitters, narrow))
    assert 0.5 * wide < close < wide


def test_light_mirrored_through_the_same_points_is_traced_once_whatever_scatters(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []
    zeros = np.zeros((2, 4, len(CROWN.emitter_wall), len(CROWN.receiver_wall)))
    monkeypatch.setattr(formed_pad, "_MIRRORED", {})
    monkeypatch.setattr(formed_kernels, "points_on", lambda at, *_top: at)
    monkeypatch.setattr(formed_kernels, "mirrored_matrix", lambda *given: asked.append(given) or zeros)
    walls, arcs = formed_pad.walls_of(CROWN)
    emitters, receivers = windows_of(CROWN, "emitter"), windows_of(CROWN, "receiver")
    top = formed_pad.formed_top(CROWN, np.zeros(2), None)
    layout = formed_pad.patch_layout(CROWN, walls, arcs)
    places = np.array([[1.0, 2.0, 0.1, 0.0, 1.0]])
    for moved in (places, places.copy(), places + 0.5):
        pad = formed_pad.FormedPad(
            scene=CROWN, emitters=emitters, receivers=receivers, walls=walls, arcs=arcs, top=top,
            patches=layout, flux=np.zeros((5, 10, 10)), error=np.zeros((10, 10)),
        )  # fmt: skip
        pad.mirrored(top, pad.every, moved)
    assert len(asked) == 2
