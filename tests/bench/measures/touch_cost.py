"""What a touch costs: one frame through a model and through the tracker of drift, and a live sensor at 60 Hz.

python -m tests.bench.measures.touch_cost
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np

from optopad.design.preset import preset
from optopad.fabrication.driver.drift import DriftTracker
from optopad.fabrication.driver.simulated.finger import demo_path
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver_config import dump_driver_config
from optopad.sims.learning.inference.kernel_ridge import KernelRidgeModel
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.touch_model import TouchModel
from tests.fabrication.driver.made_up_model import header, made_up_model, readings
from tests.fabrication.driver.made_up_pad import board, pad_config, untouched
from tests.sims.learning.made_up_map import made_up_map_model, made_up_noise, noisy_signals, random_presses

ROOT = Path(__file__).parents[3]
KEPT = 10_000
"""Samples of a kernel-ridge model: the most that its final fit takes."""

ONE_THREAD = {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
LIVE_S = (3.0, 13.0)
"""Two runs, so that what a start costs falls out of the difference."""


def kernel_ridge(kept: int = KEPT) -> KernelRidgeModel:
    """A model of so many samples; their values do not matter for the time."""
    small = made_up_model()
    rng = np.random.default_rng(0)
    samples = small.samples[rng.integers(0, len(small.samples), kept)]
    return replace(small, samples=np.ascontiguousarray(samples), weights=rng.normal(size=(kept, 3)))


def signal_map() -> TouchModel:
    """The model-based kind for the same parts."""
    model = made_up_map_model()
    return replace(model, header=header(kind="signal-map", untouched_counts=model.header.untouched_counts))


def frames(count: int = 200) -> np.ndarray:
    """(n, pair) signals under presses at random, half of them untouched."""
    rng = np.random.default_rng(1)
    presses = np.column_stack([rng.uniform(7, 25, (count, 2)), rng.uniform(-4, 4, count)])
    return readings(presses) + rng.normal(0.0, 0.8, (count, 64))


def map_frames(count: int = 200) -> np.ndarray:
    """(n, pair) signals of the map's own pad, half of them untouched."""
    presses = random_presses(count, seed=1)
    presses[::2, 2] = 0.0
    return noisy_signals(presses, made_up_noise(), seed=2)


def milliseconds(work: Callable[[np.ndarray], object], signals: np.ndarray) -> float:
    """Processor time a frame, one frame at a time, after ten that do not count [ms]."""
    for one in signals[:10]:
        work(one)
    begun = process_time()
    for one in signals:
        work(one)
    return 1e3 * (process_time() - begun) / len(signals)


def model_cost(model: TouchModel) -> float:
    """Of one frame through a model [ms]."""
    signals = map_frames() if model.header.kind == "signal-map" else frames()
    return milliseconds(lambda one: model.predict(one[None]), signals)


def tracker_cost() -> float:
    """Of one frame through the tracker [ms]."""
    signals = frames()
    tracker = DriftTracker(signals[:30].reshape(30, 8, 8), header().untouched_counts)
    clock = iter(np.arange(len(signals) + 10) / 60.0)

    def follow(one: np.ndarray) -> None:
        tracker.features(one)
        tracker.follow(float(next(clock)), one, False)

    return milliseconds(follow, signals)


def live_core_share(model: TouchModel | None, live_s: tuple[float, float] = LIVE_S) -> float:
    """Share of a core that `driver read --json` takes at 60 frames a second, with a model or without."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        text = dump_driver_config(preset("piacenza2017-pad"), [1e5] * 8, np.minimum(untouched(), 1023))
        (folder / "driver.toml").write_text(text, encoding="utf-8")
        command = ["read", str(folder / "driver.toml"), "--json", "--out", ""]
        if model is not None:
            save_model(folder / "pad.optomodel", model)
            command += ["--model", str(folder / "pad.optomodel")]
        spent = [_seconds_of_cpu(command, folder, seconds) for seconds in live_s]
    return (spent[1] - spent[0]) / (live_s[1] - live_s[0])


def _seconds_of_cpu(command: list[str], folder: Path, seconds: float) -> float:
    """Processor time of a run against a fake board of this process [s]."""
    here = os.environ | ONE_THREAD
    whole = [sys.executable, "-m", "optopad", "driver", *command]
    whole[whole.index("")] = str(folder / f"{seconds:g}.jsonl")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with FakePort(board(demo_path(pad_config().workspace))) as port:
        subprocess.run(
            [*whole, "--port", port.name, "--rate", "60", "--seconds", str(seconds)], env=here, check=True
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)


def costs(live_s: tuple[float, float] = LIVE_S) -> dict[str, dict[str, float]]:
    """All figures: milliseconds a frame, and shares of a core at 60 frames a second."""
    models = {"kernel-ridge": kernel_ridge(), "signal-map": signal_map()}
    frame_ms = {"drift": tracker_cost()} | {name: model_cost(model) for name, model in models.items()}
    share = {"signals": live_core_share(None, live_s)} | {
        name: live_core_share(model, live_s) for name, model in models.items()
    }
    return {"frame_ms": frame_ms, "core_share": share}


def costs_on_one_thread(live_s: tuple[float, float] = LIVE_S) -> dict[str, dict[str, float]]:
    """The same, from a process whose linear algebra has one thread."""
    done = subprocess.run(
        [sys.executable, "-m", __name__, *map(str, live_s)],
        env=os.environ | ONE_THREAD,
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    found: dict[str, dict[str, float]] = json.loads(done.stdout)
    return found


if __name__ == "__main__":
    shorter, longer = map(float, sys.argv[1:] or LIVE_S)
    print(json.dumps(costs((shorter, longer)), indent=2))
