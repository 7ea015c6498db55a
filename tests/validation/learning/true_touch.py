"""Tables of docs/validation/reality.md: the signal map held against where the simulated tip really was.

    python -m tests.validation.learning.true_touch  five draws of the paper's protocol, light from disk if there

A stage's 0 mm is off by its reference depth, and backlash keeps the tip in the pad on the way back, so that rows called
untouched hold touches and the other way round. A simulation knows the truth (`PressData.true_press_mm`). Two tables:
the share found touched by true depth, and errors of place and depth over the deviations that the model states.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.design.press_protocol import load_protocol_file
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.map_learner import fit_signal_map, map_header, mapped
from optopad.sims.readings.press_data import PressData
from optopad.sims.readings.protocol import draw, protocol_curves
from tests.validation.contact.contact_table import markdown_table, with_table

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "reality.md"
MARKS = "<!-- made by tests/validation/learning/true_touch.py -->", "<!-- end of truth -->"
DRAWS = 5
BANDS_MM = (-np.inf, 0.0, 0.05, 0.1, 0.2, 0.4, 1.0)
"""Ends of the bands of true depth, of samples whose stage says 1 mm at most."""
DEPTHS_MM = (0.2, 0.5, 1.0, 2.0, 3.0, 5.0)


def found_by_truth(model: SignalMapModel, data: PressData) -> np.ndarray:
    """(light, band, 2) samples and how many are found touched, ambient first, by true depth."""
    assert data.true_press_mm is not None
    shallow = np.flatnonzero(data.press_mm[:, 2] <= 1.0)
    chosen = data.only(shallow)
    true_mm = data.true_press_mm[shallow, 2]
    is_found = model.predict(chosen.features().astype(np.float64)).is_touched
    is_ambient = np.array([one.is_ambient for one in data.sets])[chosen.set_number]
    band = np.searchsorted(BANDS_MM, true_mm, side="left") - 1
    return np.array(
        [
            [
                [rows.sum(), (rows & is_found).sum()]
                for rows in (light & (band == k) for k in range(len(BANDS_MM) - 1))
            ]
            for light in (is_ambient, ~is_ambient)
        ]
    )


def errors_over_deviations(model: SignalMapModel, data: PressData) -> list[np.ndarray]:
    """By depth: (n, 6) errors against the true tip [mm], and the stated deviations [mm]."""
    assert data.true_press_mm is not None
    found = []
    for depth in DEPTHS_MM:
        rows = np.flatnonzero(np.abs(data.press_mm[:, 2] - depth) < 1e-6)
        told = model.predict(data.only(rows).features().astype(np.float64))
        found.append(np.concatenate([told.press_mm - data.true_press_mm[rows], told.sigma_mm], axis=1))
    return found


def touch_rows(counts: np.ndarray) -> list[list[str]]:
    """Shares by band; counts (light, band, 2)."""
    names = [
        "0 or less",
        *(f"{low:g} to {high:g}" for low, high in pairwise(BANDS_MM[1:])),
    ]
    return [
        [name, *(f"{found / total:.3f} of {total:.0f}" for total, found in counts[:, k])]
        for k, name in enumerate(names)
    ]


def deviation_rows(draws: list[list[np.ndarray]]) -> list[list[str]]:
    """Rms errors and rms ratios by depth, draws of each pooled."""
    rows = []
    for depth, parts in zip(DEPTHS_MM, zip(*draws, strict=True), strict=True):
        both = np.concatenate(parts)
        error, ratio = both[:, :3], both[:, :3] / both[:, 3:]
        place, deep = (np.sqrt((error[:, axes] ** 2).mean()) for axes in ([0, 1], [2]))
        over = [np.sqrt((ratio[:, axes] ** 2).mean()) for axes in ([0, 1], [2])]
        median = [np.median(np.abs(ratio[:, axes])) / 0.6745 for axes in ([0, 1], [2])]
        rows.append(
            [
                f"{depth:g}",
                f"{place:.3f}",
                f"{over[0]:.2f}, {median[0]:.2f}",
                f"{deep:.3f}",
                f"{over[1]:.2f}, {median[1]:.2f}",
            ]
        )
    return rows


def main() -> None:
    """Draw, fit, judge, write the page."""
    design = preset("piacenza2017-pad")
    curves = protocol_curves(design, load_protocol_file("piacenza2017"))
    found = mapped(design)
    counts, draws = np.zeros((2, len(BANDS_MM) - 1, 2)), []
    for seed in range(DRAWS):
        data = draw(curves, seed=seed)
        train, test = data.role("train"), data.role("test")
        model = fit_signal_map(design, found, map_header(design, train, found, seed), train, seed=seed)
        counts += found_by_truth(model, test)
        draws.append(errors_over_deviations(model, test))
        print(seed, counts[:, :, 1] / counts[:, :, 0], flush=True)
    text = "\n\n".join(
        [
            f"Signal map, {DRAWS} draws, test sets. Share found touched, by where the tip truly was:",
            markdown_table(["true depth mm", "ambient", "dark"], touch_rows(counts)),
            "Errors against where the tip truly was, and over the deviations stated: rms, and by the median.",
            markdown_table(
                ["depth mm", "x and y: rms mm", "over deviation", "depth: rms mm", "over deviation"],
                deviation_rows(draws),
            ),
        ]
    )
    write_text_atomically(PAGE, with_table(PAGE.read_text(encoding="utf-8"), text, MARKS))


if __name__ == "__main__":
    main()
