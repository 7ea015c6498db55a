"""The table of docs/validation/calibration.md on maps: how far interpolated signals are from traced ones.

    python -m tests.validation.learning.signal_map_table  some minutes on one core; traced light is read from disk

Maps of the paper's pad at several pitches, against `PRESSES` random presses traced finer ("standard") and with a seed
of their own; errors in counts at the design's gain, and in standard deviations of one reading's noise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from optopad.design.draft import Draft
from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
from optopad.sims.learning.map_learner import MAP_SEED
from optopad.sims.learning.traced_map import (
    DEPTH_NODES,
    PITCH_MM,
    QUICK_DEPTH_NODES,
    QUICK_PITCH_MM,
    SignalMap,
    traced_map,
)
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.readout import readout_of
from optopad.sims.verdict.depth_curve import sigma_counts
from tests.validation.contact.contact_table import markdown_table, with_table

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "calibration.md"
MARKS = "<!-- made by tests/validation/learning/signal_map_table.py -->", "<!-- end of maps -->"
PRESSES, SEED = 400, 77
BANDS_MM = ((0.0, 0.3), (0.3, 1.0), (1.0, 2.0), (2.0, 3.5), (3.5, 5.0))
MAPS = {
    f"{PITCH_MM:g} mm, {DEPTH_NODES} depths": (PITCH_MM, DEPTH_NODES),
    f"{QUICK_PITCH_MM:g} mm, {QUICK_DEPTH_NODES} depths (`--quick`)": (QUICK_PITCH_MM, QUICK_DEPTH_NODES),
    f"2 mm, {DEPTH_NODES} depths": (2.0, DEPTH_NODES),
}


def presses_mm() -> np.ndarray:
    """(n, 3) random presses, half of them in the first millimetre."""
    rng = np.random.default_rng(5)
    place = rng.uniform(6.0, 26.0, (PRESSES, 2))
    depth = [rng.uniform(0.0, 1.0, PRESSES // 2), rng.uniform(1.0, 5.0, PRESSES // 2)]
    return np.column_stack([place, np.concatenate(depth)])


def row_of(found: SignalMap, press_mm: np.ndarray, truth: np.ndarray) -> list[str]:
    """A cell a band of depth: rms error in counts, and rms and 99th percentile in noise units."""
    design = preset("piacenza2017-pad")
    cavity = cavity_of(design)
    untouched = found.flux[0, 0, 0]
    readout = readout_of(Draft.of(design), untouched, mask_of(judged_pairs(cavity), cavity))
    true = truth * readout.gains
    off = found.at(press_mm) * readout.gains - true
    units = np.where(true < readout.full_scale_counts, off / sigma_counts(true), np.nan)
    cells = []
    for low, high in BANDS_MM:
        rows = (press_mm[:, 2] > low) & (press_mm[:, 2] <= high)
        read = np.abs(units[rows][np.isfinite(units[rows])])
        counts = off[rows][np.isfinite(units[rows])]
        cells.append(
            f"{np.sqrt((counts**2).mean()):.2f}; {np.sqrt((read**2).mean()):.2f}, {np.quantile(read, 0.99):.1f}"
        )
    return cells


def main() -> None:
    """Trace, compare, write the table."""
    design, press_mm = preset("piacenza2017-pad"), presses_mm()
    truth = trace(Draft.of(design), press_mm, accuracy="standard", seed=SEED).flux
    rows = []
    for name, (pitch_mm, nodes) in MAPS.items():
        found = traced_map(design, pitch_mm=pitch_mm, depth_nodes=nodes, seed=MAP_SEED)
        rows.append([name, *row_of(found, press_mm, truth)])
        print(rows[-1], flush=True)
    head = ["map", *(f"{low:g}-{high:g} mm" for low, high in BANDS_MM)]
    write_text_atomically(
        PAGE, with_table(PAGE.read_text(encoding="utf-8"), markdown_table(head, rows), MARKS)
    )


if __name__ == "__main__":
    main()
