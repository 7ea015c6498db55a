"""The compiled entry points: one version of each serves every scene, and threads do their work."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

from optopad.sims import cache as fingerprint
from optopad.sims.optics.compiling import signatures
from optopad.sims.optics.engine import compiled
from optopad.sims.optics.engine.threads import between_pieces, run_each
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.optical_scene import lambertian_pattern, smooth_field
from tests.bench.measures.start_time import first_trace
from tests.oracle.oracle_scenes import ring_scene
from tests.sims.optics.surface.analytic import compact_dimple

ENTRY_POINTS = (
    "flat_matrix", "untouched_deposits", "joined", "scattered", "bounce_matrix", "trace_once", "trace_further",
    "patch_layout", "patch_areas",
)  # fmt: skip
SCENE = ring_scene()
DIMPLE = compact_dimple(1.5)


@pytest.mark.slow
def test_one_compiled_version_serves_every_kind_of_scene():
    """A second one would cost every user the time of compiling once more."""
    flat = smooth_field(lambda x, y: np.zeros(np.broadcast_shapes(x.shape, y.shape)), 32.0, 32.0, 2.0)
    place, pair = np.array([[11.0, 13.5]]), np.zeros((8, 8), dtype=np.bool_)
    pair[2, 5] = True
    tables = {
        "emitter_pattern": np.tile(lambertian_pattern(1.0), (8, 1)),
        "receiver_response": np.full((8, 5), 0.5),
    }
    trace_scene(SCENE, place, [DIMPLE], accuracy="draft", pairs=pair)
    trace_scene(SCENE, place, [DIMPLE], accuracy="draft", pairs=pair, fields=[flat])
    trace_scene(replace(SCENE, wall_index=1.5, tip_reflectance=0.3, **tables), place, [DIMPLE], accuracy="draft",
                pairs=pair)  # fmt: skip
    assert {name: len(getattr(compiled, name).signatures) for name in ENTRY_POINTS} == dict.fromkeys(
        ENTRY_POINTS, 1
    )
    given = {name: [types] for name, types in signatures().items()}  # else that was compiled for nothing
    assert {name: getattr(compiled, name).signatures for name in ENTRY_POINTS} == given


@pytest.mark.full
def test_the_process_that_compiles_gives_the_bits_of_every_later_one(tmp_path):
    """Kernels that it has compiled alone take the place of those that are compiled into an entry point."""
    assert first_trace(tmp_path).flux_sha256 == first_trace(tmp_path).flux_sha256


@pytest.mark.parametrize("count", [0, 1, 2, 17])
@pytest.mark.parametrize("threads", [1, numba.config.NUMBA_NUM_THREADS])
def test_every_piece_is_done_once(count, threads):
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    done = np.zeros(count, dtype=int)

    def work(number):
        done[number] += 1

    run_each(work, count)
    numba.set_num_threads(before)
    assert (done == 1).all()


def test_an_error_in_a_piece_comes_out():
    def work(number):
        if number == 3:
            raise ValueError("piece 3")

    with pytest.raises(ValueError, match="piece 3"):
        run_each(work, 9)


def test_the_fingerprint_follows_the_code_and_not_its_words(tmp_path, monkeypatch):
    copy = tmp_path / "states.py"
    copy.write_bytes(Path(compiled.states.__file__).read_bytes())
    before = fingerprint.source_fingerprint([compiled.states])
    monkeypatch.setattr(compiled.states, "__file__", str(copy))
    code = copy.read_text(encoding="utf-8")
    words = '"""Other words.\n\nOf several lines."""\n\n' + code.partition('"""\n')[2] + "\n# a comment\n"
    copy.write_text(words, encoding="utf-8")
    assert fingerprint.source_fingerprint([compiled.states]) == before
    copy.write_text(words + "x = 1\n", encoding="utf-8")
    assert fingerprint.source_fingerprint([compiled.states]) != before


@pytest.fixture(params=[1, max(2, numba.config.NUMBA_NUM_THREADS)], ids=["one thread", "threads"])
def threads(request, monkeypatch):
    """As many threads as work may have."""
    monkeypatch.setattr(numba, "get_num_threads", lambda: request.param)
    return request.param


def test_something_is_called_after_every_piece_in_the_thread_that_waits(threads):
    called = []
    with between_pieces(lambda: called.append(threading.get_ident())):
        run_each(lambda number: None, 7)
    run_each(lambda number: None, 5)
    assert called == [threading.get_ident()] * 7


def test_what_is_called_between_pieces_ends_the_work_by_an_error(threads):
    done, called = [], []

    def stop():
        called.append(len(done))
        if len(called) == 3:
            raise RuntimeError("enough")

    with between_pieces(stop), pytest.raises(RuntimeError, match="enough"):
        run_each(lambda number: (time.sleep(0.002), done.append(number)), 500)
    ended = len(done)
    assert 3 <= ended <= 3 + 20 * threads  # pieces that threads had begun
    time.sleep(0.02)
    assert len(done) == ended


def test_work_done_between_two_pieces_leaves_both_results_as_they_are(threads):
    outer, inner, begun = np.zeros(6), np.zeros(3), []

    def more():
        if not begun:
            begun.append(1)
            run_each(lambda number: inner.__setitem__(number, number + 1), 3)

    with between_pieces(more):
        run_each(lambda number: outer.__setitem__(number, number + 1), 6)
    assert outer.tolist() == [1, 2, 3, 4, 5, 6]
    assert inner.tolist() == [1, 2, 3]


def test_light_has_the_same_bits_with_other_light_traced_between_its_pieces():
    places = np.array([[11.0, 13.5], [20.0, 9.0], [16.0, 16.0]])
    alone = trace_scene(SCENE, places, [DIMPLE] * 3, accuracy="draft").flux
    begun, between = [], []

    def more():
        if not begun:
            begun.append(1)
            between.append(trace_scene(SCENE, places[:1], [DIMPLE], accuracy="draft").flux)

    with between_pieces(more):
        found = trace_scene(SCENE, places, [DIMPLE] * 3, accuracy="draft").flux
    assert np.array_equal(found, alone)
    assert len(between) == 1
    assert np.array_equal(between[0][:, 0], alone[:, 0])
