"""From a design to all its printed parts in a fresh process: ``python -m tests.bench.measures.build_time``."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from optopad.design.io import save_design
from optopad.design.preset import PRESETS, preset

ROOT = Path(__file__).parents[3]
LIMIT_S = 10.0
"""What the project asks of a cold start, on an idle processor."""


@dataclass(frozen=True, kw_only=True)
class BuildTime:
    """A cold build: time on the clock, time of the processor, and what it wrote."""

    wall_s: float
    processor_s: float
    files: int


def build_time(name: str) -> BuildTime:
    """Build a preset's parts as the pipeline does, imports of the CAD kernel included."""
    with tempfile.TemporaryDirectory() as folder:
        design, out = Path(folder) / "design.toml", Path(folder) / "cad"
        save_design(preset(name), design)
        before, start = os.times(), perf_counter()
        subprocess.run(
            [sys.executable, "-m", "optopad.cad", str(design), str(out)],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            check=True,
        )
        wall, after = perf_counter() - start, os.times()
        used = after.children_user + after.children_system - before.children_user - before.children_system
        return BuildTime(wall_s=wall, processor_s=used, files=len(list(out.iterdir())))


def main() -> None:
    """Print a table over the presets, the best of two runs each: other work on the machine only adds."""
    print("| preset | files | wall s | processor s |")
    print("|---|---|---|---|")
    for name in PRESETS:
        best = min((build_time(name) for _ in range(2)), key=lambda one: one.processor_s)
        print(f"| {name} | {best.files} | {best.wall_s:.1f} | {best.processor_s:.1f} |")


if __name__ == "__main__":
    main()
