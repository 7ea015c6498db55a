"""Kept light: the bits of a fresh trace, and nothing is traced again that a change does not touch."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.sims.cache import SIZE_VARIABLE, LightStore
from optopad.sims.optics import tracing
from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine import trace_states as engine
from optopad.sims.optics.engine.light_rows import row_names
from optopad.sims.optics.engine.trace_states import RawLight, trace_scene
from optopad.sims.optics.scene.optical_scene import OpticalScene, smooth_field
from optopad.sims.optics.surface.tops import stack_tops
from optopad.sims.optics.tracing import trace
from optopad.sims.press import Indentation
from tests.oracle.oracle_scenes import ring_scene
from tests.sims.optics.surface.analytic import compact_dimple

SCENE = ring_scene()
DIMPLE, DEEPER = compact_dimple(1.5), compact_dimple(2.5)
PLACES = np.array([[11.0, 13.5], [20.0, 7.0]])
ALL = np.ones((2, 8, 8), dtype=np.bool_)


@pytest.fixture
def store(tmp_path: Path) -> LightStore:
    return LightStore(tmp_path / "rows.sqlite", 50.0)


@pytest.fixture
def rows_traced(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One number a batch: the rows that go to the kernels."""
    counts: list[int] = []
    kernel = engine._trace_batch

    def counted(wanted, *rest):
        counts.append(int(wanted.any(axis=2).sum()))
        return kernel(wanted, *rest)

    monkeypatch.setattr(engine, "_trace_batch", counted)
    return counts


def light(kept: LightStore | None, scene: OpticalScene = SCENE, **settings) -> RawLight:
    return trace_scene(scene, PLACES, [DIMPLE, DEEPER], kept=kept, **({"accuracy": "draft"} | settings))


def assert_same_bits(one: RawLight, other: RawLight) -> None:
    for name in ("flux", "standard_error", "relative_error", "is_met"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def moved_emitter(number: int) -> OpticalScene:
    patch = SCENE.emitter_patch.copy()
    patch[number, 1] += 0.25
    return replace(SCENE, emitter_patch=patch)


@pytest.mark.parametrize("scene", [SCENE, replace(SCENE, tip_reflectance=0.3, wall_index=1.0)])
def test_kept_light_is_fresh_light_to_the_bit_and_traces_nothing(store, rows_traced, scene):
    without, fresh = light(None, scene), light(store, scene)
    assert rows_traced == [16, 16]
    kept = light(store, scene)
    assert rows_traced == [16, 16]
    assert_same_bits(kept, fresh)
    assert_same_bits(kept, without)


def test_a_changed_emitter_height_traces_that_emitter_only(store, rows_traced):
    light(store)
    changed = light(store, moved_emitter(3))
    assert rows_traced == [16, 2]
    assert_same_bits(changed, light(None, moved_emitter(3)))


def test_one_emitter_more_traces_that_emitter_only(store, rows_traced):
    few = replace(
        SCENE,
        emitter_wall=SCENE.emitter_wall[:7],
        emitter_patch=SCENE.emitter_patch[:7],
        emitter_order=SCENE.emitter_order[:7],
    )
    light(store, few)
    assert_same_bits(light(store), light(None))
    assert rows_traced == [14, 2, 16]


def test_a_changed_receiver_traces_everything(store, rows_traced):
    light(store)
    patch = SCENE.receiver_patch.copy()
    patch[0, 1] += 0.25
    light(store, replace(SCENE, receiver_patch=patch))
    assert rows_traced == [16, 16]


def test_a_further_press_traces_that_press_only(store, rows_traced):
    light(store)
    places = np.array([*PLACES, [16.0, 22.0]])
    more = trace_scene(SCENE, places, [DIMPLE, DEEPER, DIMPLE], kept=store, accuracy="draft")
    assert rows_traced == [16, 8]
    assert_same_bits(more, trace_scene(SCENE, places, [DIMPLE, DEEPER, DIMPLE], accuracy="draft"))


def test_finished_rows_outlive_an_interrupted_trace(store, rows_traced):
    pair = np.zeros((8, 8), dtype=np.bool_)
    pair[0, 1] = True
    places = np.column_stack([np.linspace(9.0, 20.0, 40), np.full(40, 11.0)])

    def interrupt(done: int, _states: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trace_scene(SCENE, places, [DIMPLE] * 40, kept=store, accuracy="draft", pairs=pair, on_step=interrupt)
    whole = trace_scene(SCENE, places, [DIMPLE] * 40, kept=store, accuracy="draft", pairs=pair)
    assert rows_traced == [32, 8]
    assert_same_bits(whole, trace_scene(SCENE, places, [DIMPLE] * 40, accuracy="draft", pairs=pair))


def test_a_damaged_row_is_traced_again(store, rows_traced):
    fresh = light(store)
    tops = stack_tops([DIMPLE, DEEPER], PLACES, SCENE)
    names = row_names(SCENE, tops, np.arange(2), ALL, ACCURACIES["draft"], 0)
    store.write({names[0][0]: b"short", names[1][5]: np.full((7, 8), np.nan).tobytes()})
    assert_same_bits(light(store), fresh)
    assert rows_traced == [16, 2]


def test_a_wanted_error_is_met_or_not_as_without_kept_rows(store, rows_traced):
    fresh = light(None, accuracy=2e-3)
    first, again = light(store, accuracy=2e-3), light(store, accuracy=2e-3)
    assert_same_bits(first, fresh)
    assert_same_bits(again, fresh)
    assert len(rows_traced) % 2 == 0
    assert rows_traced[: len(rows_traced) // 2] == rows_traced[len(rows_traced) // 2 :]


def names_of(
    scene: OpticalScene = SCENE,
    press: Indentation = DIMPLE,
    place: tuple[float, float] = (11.0, 13.5),
    asked=ALL[:1],
    settings=ACCURACIES["standard"],
    seed: int = 0,
    fields=None,
) -> list[bytes]:
    tops = stack_tops([press], np.array([place]), scene, fields)
    return row_names(scene, tops, np.arange(1), asked, settings, seed)[0]


def test_a_name_holds_all_that_a_row_depends_on():
    fewer = ALL[:1].copy()
    fewer[:, :, 3] = False
    flat = smooth_field(lambda x, y: np.zeros(np.broadcast_shapes(x.shape, y.shape)), 32.0, 32.0, 1.0)
    lifted = smooth_field(lambda x, y: np.full(np.broadcast_shapes(x.shape, y.shape), 0.1), 32.0, 32.0, 1.0)
    changed = [
        {"press": DEEPER},
        {"place": (11.0, 13.500001)},
        {"asked": fewer},
        {"settings": replace(ACCURACIES["standard"], replicates=3)},
        {"seed": 1},
        {"fields": [flat]},
        {"fields": [lifted]},
        *(
            {"scene": replace(SCENE, **{name: value})}
            for name, value in (
                ("height_mm", 8.001),
                ("refractive_index", 1.4321),
                ("absorption_per_mm", 0.01),
                ("wall_reflectance", 0.07),
                ("bottom_reflectance", 0.07),
                ("tip_reflectance", 0.07),
                ("wall_index", 1.5),
                ("receiver_response", np.ones((8, 5))),
                ("emitter_pattern", np.full((8, 5), np.nan)),
                ("emitter_order", SCENE.emitter_order + 0.1),
            )
        ),
    ]
    all_names = [name for change in [{}, *changed] for name in names_of(**change)]
    assert len(set(all_names)) == len(all_names)


def test_a_name_holds_one_emitter_only_and_its_number():
    before, after = names_of(), names_of(moved_emitter(3))
    assert [one != other for one, other in zip(before, after, strict=True)] == [k == 3 for k in range(8)]
    swapped = np.array([1, 0, 2, 3, 4, 5, 6, 7])
    scene = replace(
        SCENE, emitter_wall=SCENE.emitter_wall[swapped], emitter_patch=SCENE.emitter_patch[swapped],
        emitter_order=SCENE.emitter_order[swapped],
    )  # fmt: skip
    assert not set(names_of(scene)[:2]) & set(before)


def test_another_gain_or_noise_traces_no_light_again(tmp_path, monkeypatch, rows_traced):
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setenv(SIZE_VARIABLE, "50")
    design = preset("piacenza2017-pad")
    presses = np.array([[16.0, 12.0, 2.0], [9.0, 9.0, 1.0]])
    first = trace(Draft.of(design), presses, accuracy="draft")
    other = design.with_(**{"noise.read_noise_counts": 2.0, "gain.target_counts": 300.0, "name": "other"})
    again = trace(Draft.of(other), presses, accuracy="draft")
    assert rows_traced == [8, 8]
    np.testing.assert_array_equal(again.flux, first.flux)
    trace(Draft.of(design.with_(**{"emitters.height_mm": 5.1})), presses, accuracy="draft")
    assert rows_traced == [8, 8] * 2
    monkeypatch.setenv(SIZE_VARIABLE, "0")
    trace(Draft.of(design), presses, accuracy="draft")
    assert rows_traced == [8, 8] * 3


@pytest.mark.parametrize("name", ["piacenza2017-pad", "levi2013-disc"])
@pytest.mark.parametrize("stopped", [KeyboardInterrupt, ValueError])
def test_each_press_of_an_interrupted_trace_is_kept(tmp_path, monkeypatch, name, stopped):
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setenv(SIZE_VARIABLE, "50")
    monkeypatch.setattr(tracing.numba, "get_num_threads", lambda: 1)
    design, traced, real = preset(name), [], engine._traced_rows

    def counted(work, part, wanted):
        traced.append(len(part))
        return real(work, part, wanted)

    def stop(done: int, _states: int) -> None:
        if done == 3:
            raise stopped

    monkeypatch.setattr(engine, "_traced_rows", counted)
    presses = np.array([[16.0, 11.0, 0.2 * number] for number in range(1, 7)])
    pair = np.zeros((len(presses), 8, 8), dtype=np.bool_)
    pair[:, 0, 5] = pair[2:, 3, 1] = True
    with pytest.raises(stopped):
        trace(Draft.of(design), presses, accuracy="draft", pairs=pair, on_step=stop)
    known = LightStore(tmp_path / "light" / "rows.sqlite", 50.0).rows()
    traced.clear()
    found = trace(Draft.of(design), presses, accuracy="draft", pairs=pair)
    assert known >= 4  # the light of three presses, and the names of all
    assert len(traced) <= 4  # one more where the interrupted trace was still at its fourth
    monkeypatch.setenv(SIZE_VARIABLE, "0")
    monkeypatch.setattr(tracing, "_kept_one_by_one", in_one)
    whole = trace(Draft.of(design), presses, accuracy="draft", pairs=pair)
    for name in ("flux", "standard_error", "change_error", "relative_error"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))


def in_one(tops, classes, wanted, on_step) -> RawLight:
    """All states in the batches of the engine."""
    return tracing.trace_tops(tops, classes, **wanted, on_step=on_step)


@pytest.mark.parametrize("size", ["0", "0.001"])
def test_light_that_no_store_keeps_is_traced_once(tmp_path, monkeypatch, rows_traced, size):
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setenv(SIZE_VARIABLE, size)
    shares = []
    presses = np.array([[16.0, 12.0, 2.0], [9.0, 9.0, 1.0], [16.0, 12.0, 2.0]])
    light = trace(
        Draft.of(preset("piacenza2017-pad")),
        presses,
        accuracy="draft",
        on_step=lambda *done: shares.append(done),
    )
    assert rows_traced == [8, 8]
    assert shares[0] == (0, 3)
    assert shares[-1] == (3, 3)
    np.testing.assert_array_equal(light.flux[0], light.flux[2])


def test_known_light_of_presses_is_answered_without_a_single_surface(tmp_path, monkeypatch, rows_traced):
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setenv(SIZE_VARIABLE, "50")
    design = preset("piacenza2017-pad")
    presses = np.array([[16.0, 12.0, 2.0], [16.0, 20.0, 2.0], [9.0, 9.0, 0.0]])
    first = trace(Draft.of(design), presses, accuracy="draft")
    made = []
    real = tracing._made
    monkeypatch.setattr(tracing, "_made", lambda *given: made.append(1) or real(*given))
    again = trace(Draft.of(design), presses, accuracy="draft")
    for name in ("flux", "standard_error", "change_error", "relative_error"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))
    assert made == []
    for other, seed, place in (
        (design.with_(**{"indenter.tip_radius_mm": 3.1}), 0, 12.0),
        (design.with_(**{"cavity.clear_thickness_mm": 8.1}), 0, 12.0),
        (design, 1, 12.0),
        (design, 0, 12.1),
    ):
        made.clear()
        trace(Draft.of(other), presses + np.array([0.0, place - 12.0, 0.0]), accuracy="draft", seed=seed)
        assert made == [1]
    store = LightStore(tmp_path / "light" / "rows.sqlite", 50.0)
    assert store.rows() > 0
    made.clear()
    rows = store.read(names_in(store))
    store.write({name: b"damaged" for name, content in rows.items() if len(content) == 8 * 8 * 8})
    damaged = trace(Draft.of(design), presses, accuracy="draft")
    assert made == [1]
    np.testing.assert_array_equal(damaged.flux, first.flux)


def names_in(store: LightStore) -> list[bytes]:
    """Names of all rows of a store."""
    with closing(sqlite3.connect(store.path)) as file:
        return [name for (name,) in file.execute("SELECT name FROM light")]
