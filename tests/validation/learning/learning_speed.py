"""What kernel ridge costs at 24,000 samples, and what each of its methods is off: docs/validation/learning.md.

    python -m tests.validation.learning.learning_speed          (about ten minutes of two cores, 5 GB)

Presses of a made-up pad (`tests.sims.learning.pressed_pad`): time and memory do not depend on what is learnt.
Every fit runs in a process of its own, whose largest memory the system tells. Results are kept in
build/validation/learning.json as they come; interrupted, the same command goes on where it stopped.
"""

from __future__ import annotations

import json
import os
import platform
import resource
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from design.io import write_text_atomically
from sims.learning.fits.kernel_ridge import median_distance, solve_kernel
from sims.learning.samples import prepared, spread_samples
from tests.sims.learning.pressed_pad import grid_mm, made_up_data, random_places_mm

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "validation" / "learning.md"
KEPT = ROOT / "build" / "validation" / "learning.json"
DEPTHS_MM = np.concatenate([np.arange(-4.0, 0.0), np.arange(0.0, 5.01, 0.1)])
SETS, SEED = 4, 0
GAMMA_TIMES_MEDIAN = 1.0
ASKED_PLACES = 200


@dataclass(frozen=True)
class Case:
    """One fit: how many samples, by which method, at which ridge; landmarks for the approximation."""

    samples: int
    method: str
    ridge: float
    landmarks: int = 0

    @property
    def name(self) -> str:
        """Of the case in the kept results."""
        return f"{self.method}-{self.samples}-{self.landmarks}-{self.ridge:g}"


PRECISION_SAMPLES = 6_000
SPEED = (
    Case(10_000, "exact", 0.1),
    Case(10_000, "single", 0.1),
    Case(24_000, "exact", 0.1),
    Case(24_000, "nystroem", 0.1, 4_000),
)
PRECISION = tuple(
    Case(PRECISION_SAMPLES, method, ridge)
    for ridge in (1e-4, 1e-2, 1.0)
    for method in ("exact", "plain", "single")
)


@dataclass(frozen=True)
class Outcome:
    """What a fit took [s, GB], and the presses that it says at places asked [mm]."""

    wall_s: float
    processor_s: float
    memory_gb: float
    told_mm: list[list[float]]


def main() -> None:
    """Run the cases that are not kept yet, write the page."""
    if len(sys.argv) > 1:
        print(json.dumps(asdict(outcome(Case(**json.loads(sys.argv[1]))))))
        return
    found = kept_outcomes(KEPT)
    for case in (*SPEED, *PRECISION):
        if case.name not in found:
            found[case.name] = in_a_process(case)
            print(
                case.name, f"{found[case.name].wall_s:.1f} s, {found[case.name].memory_gb:.2f} GB", flush=True
            )
            KEPT.parent.mkdir(parents=True, exist_ok=True)
            write_text_atomically(KEPT, json.dumps({name: asdict(one) for name, one in found.items()}))
    write_text_atomically(PAGE, page_text(found))


def kept_outcomes(file: Path) -> dict[str, Outcome]:
    """What an earlier run left."""
    if not file.is_file():
        return {}
    return {name: Outcome(**one) for name, one in json.loads(file.read_text(encoding="utf-8")).items()}


def in_a_process(case: Case) -> Outcome:
    """The fit alone in a fresh process, so that its memory is its own."""
    command = [sys.executable, "-m", "tests.validation.learning.learning_speed", json.dumps(asdict(case))]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return Outcome(**json.loads(done.stdout.splitlines()[-1]))


def outcome(case: Case) -> Outcome:
    """Fit and ask."""
    features, press_mm, asked = problem(case.samples)
    rng = np.random.default_rng(SEED)
    gamma = GAMMA_TIMES_MEDIAN / median_distance(features, rng)
    mean_mm = press_mm.mean(axis=0)
    begun, used = time.monotonic(), time.process_time()
    landmarks = rng.permutation(case.samples)[: case.landmarks] if case.landmarks else None
    method, refinements = ("single", 0) if case.method == "plain" else (case.method, 1)
    solved = solve_kernel(
        features,
        press_mm - mean_mm,
        gamma=gamma,
        ridge=case.ridge,
        method=method,
        landmarks=landmarks,
        refinements=refinements,
    )
    wall_s, processor_s = time.monotonic() - begun, time.process_time() - used
    kept = features[solved.kept]
    told = [mean_mm + np.exp(-gamma * np.abs(kept - one).sum(axis=1)) @ solved.weights for one in asked]
    return Outcome(
        wall_s=wall_s,
        processor_s=processor_s,
        memory_gb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        told_mm=np.array(told).tolist(),
    )


def problem(samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Features and presses of touched samples spread over the paper's four grids, and features that are asked."""
    data = prepared(made_up_data(grid_mm(), sets=SETS, depths_mm=DEPTHS_MM))
    touched = np.flatnonzero(data.is_touched)
    chosen = touched[
        spread_samples(data.press[touched], data.press_mm[touched, 2], samples, np.random.default_rng(SEED))
    ]
    asked = made_up_data(random_places_mm(ASKED_PLACES), seed=5, depths_mm=np.array([1.0, 3.0]))
    features = data.signals[np.ix_(chosen, data.kept)].astype(np.float64)
    return features, data.press_mm[chosen], asked.features()[:, data.kept].astype(np.float64)


def largest_difference_mm(one: Outcome, other: Outcome) -> float:
    """Between what two fits say at the places asked."""
    return float(np.abs(np.array(one.told_mm) - np.array(other.told_mm)).max())


def page_text(found: dict[str, Outcome]) -> str:
    """The page."""
    speed = [
        f"| {case.samples:,} | {words_of(case)} | {one.wall_s:.0f} | {one.processor_s:.0f} | {one.memory_gb:.2f} |"
        for case in SPEED
        for one in [found[case.name]]
    ]
    precision, off_plain, off_refined = [], [], []
    for ridge in sorted({case.ridge for case in PRECISION}):
        exact, plain, single = (
            found[Case(PRECISION_SAMPLES, method, ridge).name] for method in ("exact", "plain", "single")
        )
        off_plain.append(largest_difference_mm(plain, exact))
        off_refined.append(largest_difference_mm(single, exact))
        precision.append(f"| {ridge:g} | {off_plain[-1]:.2g} | {off_refined[-1]:.2g} |")
    whole, rough = (found[case.name] for case in SPEED[-2:])
    machine = f"{os.cpu_count()}-core machine shared with other work, Python {platform.python_version()}"
    return PAGE_TEXT.format(
        machine=machine,
        speed="\n".join(speed),
        precision="\n".join(precision),
        asked=2 * ASKED_PLACES,
        samples=PRECISION_SAMPLES,
        exact=SPEED[-2],
        exact_s=whole.processor_s,
        exact_gb=whole.memory_gb,
        rough_s=rough.processor_s,
        rough_gb=rough.memory_gb,
        worst=max(off_refined),
        plain=max(off_plain),
    )


def words_of(case: Case) -> str:
    """The method in words."""
    return {
        "exact": "double precision, exact",
        "single": "single precision, refined once",
        "nystroem": f"approximation, {case.landmarks:,} landmarks",
    }[case.method]


PAGE_TEXT = """\
# Cost of kernel ridge, and the errors of its methods

**Question.** How much time and memory does the paper's learner, kernel ridge, take on many presses? How much accuracy
do the cheaper methods cost?

**Answer.** {exact.samples:,} samples take {exact_s:.0f} s of processor time and {exact_gb:.1f} GB exactly,
{rough_s:.0f} s and {rough_gb:.1f} GB by the approximation. Single precision, refined once, gives the same
press to {worst:.1g} mm.

## Method

- The final fit alone is measured: kernel matrix, factor, weights, and the residual that is checked afterwards.
- Each fit runs in a process of its own; memory is its largest, data and libraries (0.2 GB) included.
- {machine}. So time is longer than processor time; the fit itself
  uses both cores.
- Precision: {samples:,} samples, {asked} random presses asked; the largest difference to double precision in x, y or
  depth.

## Figures

| samples | method | time s | processor s | memory GB |
|---|---|---|---|---|
{speed}

Largest difference to double precision [mm]:

| lambda | single precision | refined once |
|---|---|---|
{precision}

## What it means

- `optopad train` fits in double precision where its matrix fits into memory (5 GB: 25,000 samples). Up to 35,000 it
  fits in refined single precision, and beyond by the approximation. The model's header and the command's
  lines name the method.
- The error of refined single precision is far below that of the learner itself ([reality.md](reality.md)). Without
  refinement it is off by up to {plain:.1g} mm, at a small lambda.
- The error of the approximation is not measured here.

## Made by

`python -m tests.validation.learning.learning_speed`; fits that are done are kept, and an interrupted run continues.
"""


if __name__ == "__main__":
    main()
