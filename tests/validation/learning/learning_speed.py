"""What kernel ridge costs at 10,000 and 24,000 samples: docs/validation/learning.md.

    python -m tests.validation.learning.learning_speed          (about five minutes of two cores, 5 GB)

Presses of a made-up pad (`tests.sims.learning.pressed_pad`): time and memory do not depend on what is learnt.
Every fit runs in a process of its own, whose largest memory the system tells. Results are kept in
build/validation/learning.json as they come; interrupted, the same command goes on where it stopped.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from optopad.design.io import write_text_atomically
from optopad.sims.learning.learners import kernel_matrix, median_distance, solved
from optopad.sims.learning.samples import prepared, spread_samples
from tests.sims.learning.pressed_pad import grid_mm, made_up_data

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "validation" / "learning.md"
KEPT = ROOT / "build" / "validation" / "learning.json"
DEPTHS_MM = np.concatenate([np.arange(-4.0, 0.0), np.arange(0.0, 5.01, 0.1)])
SETS, SEED = 4, 0
RIDGE = 0.1
SAMPLES = (10_000, 24_000)


@dataclass(frozen=True)
class Outcome:
    """What a fit took [s, GB]."""

    wall_s: float
    processor_s: float
    memory_gb: float


def main() -> None:
    """Run the fits that are not kept yet, write the page."""
    if len(sys.argv) > 1:
        print(json.dumps(asdict(outcome(int(sys.argv[1])))))
        return
    found = kept_outcomes(KEPT)
    for samples in SAMPLES:
        if samples not in found:
            found[samples] = in_a_process(samples)
            print(samples, f"{found[samples].wall_s:.1f} s, {found[samples].memory_gb:.2f} GB", flush=True)
            KEPT.parent.mkdir(parents=True, exist_ok=True)
            write_text_atomically(KEPT, json.dumps({number: asdict(one) for number, one in found.items()}))
    write_text_atomically(PAGE, page_text(found))


def kept_outcomes(file: Path) -> dict[int, Outcome]:
    """What an earlier run left, by samples."""
    if not file.is_file():
        return {}
    stored = json.loads(file.read_text(encoding="utf-8"))
    return {int(samples): Outcome(**one) for samples, one in stored.items()}


def in_a_process(samples: int) -> Outcome:
    """The fit alone in a fresh process, so that its memory is its own."""
    command = [sys.executable, "-m", "tests.validation.learning.learning_speed", str(samples)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return Outcome(**json.loads(done.stdout.splitlines()[-1]))


def outcome(samples: int) -> Outcome:
    """Fit."""
    features, press_mm = problem(samples)
    gamma = 1.0 / median_distance(features, np.random.default_rng(SEED))
    begun, used = time.monotonic(), time.process_time()
    solved(kernel_matrix(features, gamma), RIDGE, press_mm - press_mm.mean(axis=0))
    return Outcome(
        wall_s=time.monotonic() - begun,
        processor_s=time.process_time() - used,
        memory_gb=most_memory_gb(),
    )


def most_memory_gb() -> float:
    """Most memory that this program has held [GB]; `ru_maxrss` would begin with what its parent held when it forked."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / 1e6


def problem(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Features and presses of touched samples spread over the paper's four grids."""
    data = prepared(made_up_data(grid_mm(), sets=SETS, depths_mm=DEPTHS_MM))
    touched = np.flatnonzero(data.is_touched)
    chosen = touched[
        spread_samples(data.press[touched], data.press_mm[touched, 2], samples, np.random.default_rng(SEED))
    ]
    return data.signals[np.ix_(chosen, data.kept)].astype(np.float64), data.press_mm[chosen]


def page_text(found: dict[int, Outcome]) -> str:
    """The page."""
    rows = [
        f"| {samples:,} | {one.wall_s:.0f} | {one.processor_s:.0f} | {one.memory_gb:.2f} |"
        for samples, one in found.items()
    ]
    most = max(found)
    return PAGE_TEXT.format(
        machine=f"{os.cpu_count()}-core machine shared with other work, Python {platform.python_version()}",
        rows="\n".join(rows),
        most=most,
        processor_s=found[most].processor_s,
        memory_gb=found[most].memory_gb,
    )


PAGE_TEXT = """\
# Cost of kernel ridge

**Question.** How much time and memory does the paper's learner, kernel ridge, take on many presses?

**Answer.** {most:,} samples take {processor_s:.0f} s of processor time and {memory_gb:.1f} GB.

## Method

- The final fit alone is measured: kernel matrix, factor, weights. The factor runs on one core, the matrix on all.
- Each fit runs in a process of its own; memory is its largest, data and libraries (0.2 GB) included.
- {machine}. So time is longer than processor time.

## Figures

| samples | time s | processor s | memory GB |
|---|---|---|---|
{rows}

## What it means

- Memory grows with the square of the samples, time with the cube. `optopad train --effort full` fits at most {most:,}.

## Made by

`python -m tests.validation.learning.learning_speed`; fits that are done are kept, and an interrupted run continues.
"""


if __name__ == "__main__":
    main()
