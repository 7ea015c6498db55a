"""A trained model answers with numpy alone, frame by frame as all at once."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.sims.learning.inference.kernel_ridge import l1_distances
from tests.sims.learning.made_up_models import made_up_kernel_ridge, made_up_signals

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
