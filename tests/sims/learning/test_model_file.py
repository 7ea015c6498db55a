"""A model's file gives back the model, and nothing else passes for one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tracemalloc
import zipfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import InputError, OutputError
from optopad.design.plain_arrays import plain_arrays
from optopad.fabrication.stage.collection import CollectedParts
from optopad.sims.contact.library.stored_press import read_entry
from optopad.sims.learning.inference import model_file
from optopad.sims.learning.inference.header import header_of_json, require_design
from optopad.sims.learning.inference.kernel_ridge import l1_distances
from optopad.sims.learning.inference.model_file import load_model, save_model
from tests.sims.learning.made_up_models import (
    DIGEST,
    made_up_header,
    made_up_kernel_ridge,
    made_up_signals,
)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save_model(tmp_path / "a.optomodel", made_up_kernel_ridge())
    return tmp_path / "a.optomodel"


def rewritten(file: Path, **changes) -> None:
    """The file with changed arrays and a checksum that holds."""
    with np.load(file) as found:
        arrays = {name: found[name] for name in found.files if name != "sha256"} | changes
    arrays = {name: array for name, array in arrays.items() if array is not None}
    arrays["sha256"] = np.frombuffer(model_file._checksum(arrays), np.uint8)
    with file.open("wb") as stream:
        np.savez(stream, **arrays)


def header_bytes(**changes) -> np.ndarray:
    return np.frombuffer(json.dumps(made_up_header().to_json() | changes).encode(), np.uint8)


def test_a_model_comes_back_with_the_same_answers_to_the_bit(saved):
    signals = made_up_signals()
    before, after = made_up_kernel_ridge().predict(signals), load_model(saved).predict(signals)
    assert np.array_equal(before.press_mm, after.press_mm)
    assert np.array_equal(before.touch_score, after.touch_score)
    assert np.array_equal(before.force_n, after.force_n)
    assert load_model(saved).header.to_json() == made_up_header().to_json()


def test_the_same_model_makes_the_same_checksum(saved, tmp_path):
    save_model(tmp_path / "b.optomodel", made_up_kernel_ridge())
    with np.load(saved) as one, np.load(tmp_path / "b.optomodel") as other:
        assert np.array_equal(one["sha256"], other["sha256"])


def test_any_changed_byte_is_noticed(saved):
    content = saved.read_bytes()
    signals = made_up_signals()
    answer = load_model(saved).predict(signals).press_mm
    for place in range(0, len(content), 97):
        saved.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        with suppress(InputError):  # bytes of the zip's own bookkeeping (times, attributes) change no number
            assert np.array_equal(load_model(saved).predict(signals).press_mm, answer)


def test_a_changed_array_without_its_checksum_is_refused(saved):
    with np.load(saved) as found:
        arrays = {name: found[name] for name in found.files}
    arrays["ridge_weights"] = arrays["ridge_weights"] * 1.0001
    with saved.open("wb") as stream:
        np.savez(stream, **arrays)
    with pytest.raises(InputError, match="checksum does"):
        load_model(saved)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"no archive at all", b"\x93NUMPY\x01\x00"])
def test_what_is_no_archive_is_refused(tmp_path, content):
    (tmp_path / "a.optomodel").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.optomodel"):
        load_model(tmp_path / "a.optomodel")


def test_a_cut_file_is_refused(saved):
    saved.write_bytes(saved.read_bytes()[:-200])
    with pytest.raises(InputError, match="damaged"):
        load_model(saved)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.optomodel: no such file"):
        load_model(tmp_path / "none.optomodel")


def test_objects_are_never_unpickled(saved):
    trap = np.array([{"a": 1}], dtype=object)
    with zipfile.ZipFile(saved, "a") as archive, archive.open("extra.npy", "w") as stream:
        np.lib.format.write_array(stream, trap)
    with pytest.raises(InputError, match="objects are not loaded"):
        load_model(saved)


def test_another_version_is_refused_with_both_numbers(saved):
    rewritten(saved, header=header_bytes(version=2))
    with pytest.raises(InputError, match=r"2 of.*reads 1"):
        load_model(saved)


@pytest.mark.parametrize("kind", ["oracle", "network"])
def test_an_unknown_kind_is_refused_with_those_known(saved, kind):
    rewritten(saved, header=header_bytes(kind=kind))
    with pytest.raises(InputError, match=f"'{kind}'"):
        load_model(saved)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("ridge_weights", None),
        ("ridge_weights", np.zeros((3, 3))),
        ("ridge_weights", np.full((20, 3), np.nan)),
        ("ridge_gamma", np.array([0.0])),
        ("ridge_kept", np.array([0, 1, 2, 3, 6])),
        ("ridge_scale", np.zeros(5)),
        ("touch_bias", np.array(["a"])),
    ],
)
def test_arrays_that_do_not_fit_are_named(saved, name, value):
    rewritten(saved, **{name: value})
    with pytest.raises(InputError, match=name.rpartition("_")[0]):
        load_model(saved)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"format": "other"}, "no optopad model"),
        ({"kind": 3}, "kind"),
        ({"emitter_names": []}, "emitter_names"),
        ({"untouched_counts": [1.0]}, "1 values for 2 x 3 pairs"),
        ({"untouched_counts": [None] * 6}, "untouched_counts"),
        ({"design_digest": ""}, "design_digest"),
        ({"settings": []}, "settings"),
        ({"force_curve": {"depth_mm": [0.0, 0.0], "force_n": [0.0, 1.0]}}, "force_curve"),
        ({"force_curve": 1}, "force_curve"),
    ],
)
def test_a_header_that_does_not_fit_is_refused_by_name(change, word):
    with pytest.raises(InputError, match=word):
        header_of_json(made_up_header().to_json() | change)


def test_a_model_of_another_design_is_refused_with_both_digests():
    require_design(made_up_header(), DIGEST)
    require_design(made_up_header(design_digest=None), "00" * 32)
    with pytest.raises(InputError, match="00000000"):
        require_design(made_up_header(), "00" * 32)


def test_a_model_that_cannot_be_written_leaves_the_old_one(saved, tmp_path):
    before = saved.read_bytes()
    broken = replace(made_up_kernel_ridge(), header=made_up_header(settings={"gamma": float("nan")}))
    with pytest.raises(ValueError, match="not JSON compliant"):
        save_model(saved, broken)
    with pytest.raises(OutputError, match="cannot be written"):
        save_model(tmp_path / "absent" / "a.optomodel", made_up_kernel_ridge())
    assert saved.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.optomodel"]


def refused_part(file: Path) -> bool:
    parts = object.__new__(CollectedParts)
    parts.folder = file.parent
    file.rename(file.with_name("000001.npz"))
    with pytest.raises(InputError, match="is damaged"):
        parts._part(1)
    return True


def refused_model(file: Path) -> bool:
    with pytest.raises(InputError, match="optopad model"):
        load_model(file)
    return True


def refused_arrays(file: Path) -> bool:
    with pytest.raises(ValueError, match=r"unpacks to|another way|header states"):
        plain_arrays(file, most_bytes=10**12)
    return True


def refused_press(file: Path) -> bool:
    file.rename(file.with_name("key.npz"))
    return read_entry("key") is None


READERS = {
    "model": refused_model,
    "part of a collection": refused_part,
    "contact solution": refused_press,
    "any": refused_arrays,
}


def zeros(archive: zipfile.ZipFile, count: int, said: int) -> None:
    """An array of zeros whose header speaks of another number of them."""
    header = f"{{'descr': '|u1', 'fortran_order': False, 'shape': ({said},), }}".encode()
    with archive.open("header.npy", "w", force_zip64=True) as stream:
        stream.write(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
        for _ in range(count // 1_000_000):
            stream.write(bytes(1_000_000))


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    ("packed", "count", "said"),
    [
        (zipfile.ZIP_DEFLATED, 60_000_000, 60_000_000),
        (zipfile.ZIP_BZIP2, 60_000_000, 60_000_000),
        (zipfile.ZIP_BZIP2, 0, 0),
        (zipfile.ZIP_DEFLATED, 0, 60_000_000),
        (zipfile.ZIP_DEFLATED, 0, 2**39),
        (zipfile.ZIP_DEFLATED, 1_000_000, 999_999),
    ],
)
def test_every_reader_of_arrays_checks_sizes_before_it_unpacks(
    tmp_path, monkeypatch, reader, packed, count, said
):
    monkeypatch.setattr("optopad.sims.contact.library.stored_press.cache_folder", lambda: tmp_path)
    with zipfile.ZipFile(tmp_path / "bomb", "w", packed) as archive:
        zeros(archive, count, said)
    tracemalloc.start()
    try:
        assert READERS[reader](tmp_path / "bomb")
        assert tracemalloc.get_traced_memory()[1] < 6_000_000
    finally:
        tracemalloc.stop()


ROOT = Path(__file__).parents[3]
INFERENCE = ROOT / "sims" / "learning" / "inference"


def test_inference_loads_numpy_and_the_standard_library_only():
    files = (path.relative_to(ROOT).with_suffix("") for path in INFERENCE.rglob("[!_]*.py"))
    modules = sorted(".".join(("optopad", *file.parts)) for file in files)
    program = (
        f"import importlib, json, sys\nbefore = set(sys.modules)\n"
        f"for name in {modules}: importlib.import_module(name)\n"
        "print(json.dumps(sorted({name.partition('.')[0] for name in set(sys.modules) - before})))\n"
        "print(json.dumps(sorted(n for n in sys.modules if n.split('.')[0] == 'optopad')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded, ours = (json.loads(line) for line in done.stdout.splitlines())
    assert set(loaded) - set(sys.stdlib_module_names) == {"numpy", "optopad"}
    inside = [name for name in ours if name.startswith("optopad.sims.learning.inference")]
    of_design = {
        f"optopad.design.{name}" for name in ("arrays", "errors", "file_sets", "files", "plain_arrays")
    }
    doors = {"optopad", "optopad.design", "optopad.sims", "optopad.sims.learning"}
    front = {"optopad.api"}  # what `import optopad` loads
    assert set(ours) - set(inside) == of_design | doors | front


def test_kernel_ridge_is_the_sum_that_its_docstring_writes():
    model, signals = made_up_kernel_ridge(), made_up_signals(4)
    features = (signals[:, model.scaling.kept] - 120.0) / 10.0
    distance = np.abs(features[:, None, :] - model.samples[None].astype(np.float64)).sum(axis=2)
    wanted = model.mean_mm + np.exp(-0.3 * distance) @ model.weights
    # single-precision distances of about 20 are right to 20 x 6e-8 x 6 terms; weights of 1, a kernel's slope of 0.3
    assert np.abs(model.predict(signals).press_mm - wanted).max() < 1e-5


def test_one_frame_at_a_time_answers_as_all_at_once():
    model, signals = made_up_kernel_ridge(1300), made_up_signals(5)
    together = model.predict(signals)
    alone = [model.predict(signals[k : k + 1]) for k in range(5)]
    assert np.array_equal(np.concatenate([one.press_mm for one in alone]), together.press_mm)
    assert np.array_equal(np.concatenate([one.is_touched for one in alone]), together.is_touched)


def test_no_frames_give_no_answers():
    found = made_up_kernel_ridge().predict(made_up_signals(0))
    assert found.press_mm.shape == (0, 3)
    assert found.is_touched.shape == (0,)


def test_touch_is_a_score_above_zero_and_force_follows_the_curve():
    model = made_up_kernel_ridge()
    found = model.predict(np.array([[100.0] * 6, [200.0] * 6]))
    # w = -1 over 6 features of (counts - 150) / 50 = -1 and +1, and a bias of 0.25
    assert found.touch_score == pytest.approx([6.25, -5.75], rel=1e-12)
    assert found.is_touched.tolist() == [True, False]
    depth_mm = found.press_mm[0, 2]
    assert found.force_n == pytest.approx([np.interp(depth_mm, [0, 1, 2], [0, 3, 8]), 0.0], rel=1e-12)
    assert np.isnan(found.sigma_mm).all()


def test_distances_over_several_blocks_are_those_of_one():
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(1100, 9)).astype(np.float32)
    wanted = np.abs(samples.astype(np.float64) - samples[7]).sum(axis=1)
    # nine terms of about 1 in single precision
    assert np.abs(l1_distances(samples, samples[7]) - wanted).max() < 1e-5


def test_signals_of_another_sensor_or_no_numbers_are_refused():
    model = made_up_kernel_ridge()
    with pytest.raises(InputError, match=r"shape \(2, 5\), the model takes \(frames, 6\)"):
        model.predict(np.ones((2, 5)))
    signals = made_up_signals(3)
    signals[1, 4] = np.nan
    with pytest.raises(InputError, match="E2-R2 of frame 1 is no finite number"):
        model.predict(signals)
