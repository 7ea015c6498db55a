"""The compiled entry points: one version of each serves every scene, and threads do their work."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest

from sims.cache import fingerprint
from sims.optics.engine import compiled
from sims.optics.engine.threads import run_each
from sims.optics.engine.trace_states import trace_scene
from sims.optics.scene.emission import lambertian_pattern
from sims.optics.scene.smooth_field import smooth_field
from sims.optics.surface.analytic import compact_dimple
from tests.bench.measures.start_time import first_trace
from tests.sims.optics.oracle.oracle_scenes import ring_scene

ENTRY_POINTS = (
    "flat_matrix", "untouched_deposits", "joined", "bounce_matrix", "trace_state", "patch_layout", "patch_areas",
)  # fmt: skip
SCENE = ring_scene()
DIMPLE = compact_dimple(1.5)


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
    trace_scene(
        SCENE, np.array([[[8.0, 9.0], [24.0, 23.0]]]), [[DIMPLE, DIMPLE]], accuracy="draft", pairs=pair
    )
    trace_scene(replace(SCENE, wall_index=1.5, tip_reflectance=0.3, **tables), place, [DIMPLE], accuracy="draft",
                pairs=pair)  # fmt: skip
    assert {name: len(getattr(compiled, name).signatures) for name in ENTRY_POINTS} == dict.fromkeys(
        ENTRY_POINTS, 1
    )


@pytest.mark.slow
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


def test_the_fingerprint_follows_every_byte_of_the_sources(tmp_path, monkeypatch):
    copy = tmp_path / "states.py"
    with open(compiled.states.__file__, "rb") as source:
        copy.write_bytes(source.read())
    before = fingerprint.source_fingerprint([compiled.states])
    monkeypatch.setattr(compiled.states, "__file__", str(copy))
    assert fingerprint.source_fingerprint([compiled.states]) == before
    copy.write_bytes(copy.read_bytes() + b"\n")
    assert fingerprint.source_fingerprint([compiled.states]) != before
