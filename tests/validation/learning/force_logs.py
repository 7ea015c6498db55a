"""Fits of modulus and relaxation to 30 made-up logs of a load cell whose truth is known.

    python -m tests.validation.learning.force_logs    the table of docs/validation/calibration.md, some minutes

Each log is drawn by its number as a seed. It goes through the files and the code of `calibrate --force`: a recording
as netCDF, a log as CSV, the match of the clocks, the fit. The fit was developed with other seeds (5900 to 5929,
8100 to 8129, 9300 to 9323).

The truth is computed in another way than the fit: depth in steps of 1 ms with rounded ramps, the hereditary integral as
a sum over all past steps, and in every other log on average, the contact of the retraction after Ting (J. Appl. Mech.
33, 1966, 845-854), searched at every step; in the others the elastic contact. The load cell has latency, jitter, a
clock of its own, noise, a drift and a slow wave of its tare, and rounding; each press has its own error of depth, and
the stage's positions have noise.

The truth shares with the fit: the elastic force of `optopad.sims.contact`, one time constant, quasi-linear
viscoelasticity, and the load cell's readings at an instant (no averaging over a sample).
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator
from scipy.signal import fftconvolve

from optopad.design.arrays import FloatArray
from optopad.design.errors import OptopadError
from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.design.spec.properties import youngs_modulus_mpa
from optopad.fabrication.driver.recording.force_log import read_force_log
from optopad.fabrication.driver.recording.joined_log import Offset
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.force_fit import ForceFit, fit_force
from optopad.verbs.calibrate import _pressed_force
from tests.validation.contact.contact_table import markdown_table, with_table

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "calibration.md"
MARKS = "<!-- made by tests/validation/learning/force_logs.py -->", "<!-- end of forces -->"
PAD = preset("piacenza2017-pad")
LOGS, FIRST_SEED = 30, 12000
STEP_S = 0.001
BEGUN_S = 1_790_000_000.0
DEPTH_NOISE_MM = 0.002
WAVE = 0.01
"""Amplitude of a slow wave of the tare over the largest force [-]; its period is a minute."""
ABOVE_MM = -1.0
"""Depth at which the tip waits between presses [mm]."""


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What is drawn for a log; times in s, depths in mm, forces in N."""

    seed: int
    presses: int
    modulus: float
    share: float
    tau_s: float
    zero_mm: float
    scatter_mm: float
    approach_mm_per_s: float
    retraction_mm_per_s: float
    hold_s: float
    has_tings_contact: bool
    frame_hz: float
    cell_hz: float
    jitter_s: float
    latency_s: float
    own_clock: bool
    rate: float
    noise_n: float
    drift: float


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def drawn(seed: int) -> Drawn:
    """The circumstances of a log."""
    rng = np.random.default_rng(seed)
    approach = log_uniform(rng, 1.0, 8.0)
    relaxes, own_clock = rng.random() < 2 / 3, rng.random() < 2 / 3
    return Drawn(
        seed=seed,
        presses=int(rng.integers(8, 15)),
        modulus=rng.uniform(0.7, 1.4),
        share=rng.uniform(0.03, 0.3) if relaxes else 0.0,
        tau_s=log_uniform(rng, 0.2, 3.0),
        zero_mm=rng.uniform(-0.08, 0.08),
        scatter_mm=rng.uniform(0.0, 0.02),
        approach_mm_per_s=approach,
        retraction_mm_per_s=approach * log_uniform(rng, 1 / 3, 3.0),
        hold_s=rng.uniform(1.5, 5.0),
        has_tings_contact=bool(rng.random() < 0.5),
        frame_hz=float(rng.choice([25.0, 50.0, 100.0, 200.0])),
        cell_hz=log_uniform(rng, 5.0, 80.0),
        jitter_s=rng.uniform(0.0, 0.005),
        latency_s=rng.uniform(0.0, 0.1),
        own_clock=own_clock,
        rate=rng.uniform(-0.01, 0.01) if own_clock else 0.0,
        noise_n=log_uniform(rng, 0.002, 0.03),
        drift=rng.uniform(-0.1, 0.1),
    )


def true_force(log: Drawn, depth_mm: FloatArray, place: tuple[float, float]) -> FloatArray:
    """Force on the tip over one press, in steps of `STEP_S` [N]."""
    depths = np.linspace(0.0, 4.6, 400)
    solved = solved_press(contact_of(PAD), 4.6, at_mm=place)
    curve = PchipInterpolator(depths, [solved.force_n(float(depth)) for depth in depths])
    inside = np.maximum(depth_mm, 0.0)
    elastic = log.modulus * curve(inside)
    kernel = np.exp(-(np.arange(len(inside)) + 0.5) * STEP_S / log.tau_s)
    excess = log.share / (1.0 - log.share)
    rise, way = np.diff(elastic, prepend=0.0), np.diff(inside, prepend=0.0)
    force = elastic + excess * fftconvolve(rise, kernel)[: len(rise)]
    if not log.has_tings_contact or not log.share:
        return np.maximum(force, 0.0)
    turn = int(np.flatnonzero(inside >= inside.max() - 1e-4)[-1])
    for now in range(turn + 1, len(inside)):
        memory = 1.0 + excess * kernel[now::-1]
        balance = np.cumsum((memory * way[: now + 1])[::-1])[::-1]  # from each past step on until now
        larger = np.flatnonzero(balance[: turn + 1] >= 0.0)
        last = int(larger[-1]) if larger.size and inside[now] > 0.0 else -1
        force[now] = float(memory[:last] @ rise[:last]) if last > 0 else 0.0
    return np.maximum(force, 0.0)


def course(log: Drawn, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, tip's positions as the stage reports them without noise (n, 3), and true force, in steps of `STEP_S`."""
    places, depths, forces = [], [], []
    for _ in range(log.presses):
        x, y = rng.uniform(8.0, 24.0, 2)
        deepest, rest = rng.uniform(0.8, 4.0), rng.uniform(0.8, 2.5)
        way = deepest - ABOVE_MM
        times = [0.0, rest, way / log.approach_mm_per_s, log.hold_s * rng.uniform(0.8, 1.2)]
        knots = np.cumsum([*times, way / log.retraction_mm_per_s, 0.3])
        own = np.arange(0.0, knots[-1], STEP_S)
        depth = np.interp(own, knots, [ABOVE_MM, ABOVE_MM, deepest, deepest, ABOVE_MM, ABOVE_MM])
        width = int(rng.uniform(0.02, 0.1) / STEP_S)  # the stage speeds up and slows down
        padded = np.concatenate([np.full(width, ABOVE_MM), depth, np.full(width, ABOVE_MM)])
        depth = np.convolve(padded, np.ones(width) / width, mode="same")[width:-width]
        error = log.zero_mm + log.scatter_mm * rng.standard_normal()
        depths.append(depth)
        places.append(np.tile([x, y], (len(own), 1)))
        forces.append(true_force(log, depth + error, (float(x), float(y))))
    depth = np.concatenate(depths)
    time_s = STEP_S * np.arange(len(depth))
    return time_s, np.column_stack([np.concatenate(places), depth]), np.concatenate(forces)


def write(log: Drawn, folder: Path) -> tuple[Path, Path, Offset]:
    """Write recording and log of a load cell; return their paths and the option `--offset`."""
    rng = np.random.default_rng([log.seed, 1])
    time_s, press_mm, force_n = course(log, rng)
    frames = np.arange(0.0, time_s[-1], 1.0 / log.frame_hz)
    seen = np.stack([np.interp(frames, time_s, axis) for axis in press_mm.T], axis=1)
    seen[:, 2] = np.round(seen[:, 2] + DEPTH_NOISE_MM * rng.standard_normal(len(frames)), 3)
    names = dict(zip(("press_x", "press_y", "press_depth"), seen.T, strict=True))
    columns = {"host_time": BEGUN_S + frames} | names
    dataset = xr.Dataset({name: ("time", values) for name, values in columns.items()})
    recording = folder / f"{log.seed}.nc"
    dataset.to_netcdf(recording, engine="h5netcdf")
    steps = rng.uniform(0.8, 1.2, int(1.3 * time_s[-1] * log.cell_hz)) / log.cell_hz
    moments = np.cumsum(steps)
    moments = moments[moments < time_s[-1] - 0.2]
    wave = WAVE * np.sin(2.0 * np.pi * moments / 60.0 + rng.uniform(0.0, 6.0))
    tare = rng.uniform(-2.0, 2.0) + force_n.max() * (log.drift * moments / time_s[-1] + wave)
    force = np.interp(moments, time_s, force_n) + tare + log.noise_n * rng.standard_normal(len(moments))
    stamps = moments + log.latency_s + log.jitter_s * rng.uniform(-1.0, 1.0, len(moments))
    stamps = (stamps + rng.uniform(3.0, 90.0)) / (1.0 + log.rate) if log.own_clock else BEGUN_S + stamps
    rows = [f"{at:.4f},{value:.3f}" for at, value in zip(stamps, force, strict=True)]
    csv = folder / f"{log.seed}.csv"
    csv.write_text("\n".join(["time_s,force_n", *rows]) + "\n")
    return recording, csv, "auto" if log.own_clock else None


def hits(log: Drawn, fit: ForceFit) -> dict[str, bool | None]:
    """Whether the true value is in the 95 % interval, by quantity; None where there is no value."""
    truth = {
        "youngs_modulus_mpa": log.modulus * youngs_modulus_mpa(PAD),
        "relaxed_share": log.share,
        "time_constant_s": log.tau_s,
        "depth_offset_mm": log.zero_mm,
    }
    found: dict[str, bool | None] = {}
    for name, value in truth.items():
        low, high = fit.intervals.get(name, (np.nan, np.nan))
        found[name] = None if np.isnan(low) else bool(low <= value <= high)
    if log.share == 0.0:
        found["time_constant_s"] = None if fit.time_constant_s is None else False
    return found


def row_of(log: Drawn, fit: ForceFit | None, why: str = "") -> list[str]:
    """Cells of the table of one log."""
    kind = "elastic" if not log.share else "Ting" if log.has_tings_contact else "elastic contact"
    cells = [
        str(log.seed),
        kind,
        f"{log.cell_hz:.0f}",
        f"{log.approach_mm_per_s:.1f}, {log.retraction_mm_per_s:.1f}",
        f"{1e3 * log.latency_s:.0f}",
        f"{100 * log.rate:+.2f}" if log.own_clock else "same clock",
    ]
    if fit is None:
        return [*cells, *["refused"] * 4, why]
    said, hit = fit.intervals, hits(log, fit)

    def cell(name: str, true: float, digits: int) -> str:
        if name not in said:
            return "not found"
        low, high = said[name]
        missed = " **missed**" if hit[name] is False else ""
        return f"{true:.{digits}f}: {low:.{digits}f} to {high:.{digits}f}{missed}"

    return [
        *cells,
        cell("youngs_modulus_mpa", log.modulus * youngs_modulus_mpa(PAD), 4),
        cell("relaxed_share", log.share, 4),
        cell("time_constant_s", log.tau_s, 3),
        cell("depth_offset_mm", log.zero_mm, 4),
        "all" if False not in hit.values() else "no",
    ]


HEAD = [
    "log",
    "pad, contact in retraction",
    "samples/s",
    "approach, retraction mm/s",
    "latency ms",
    "clock's rate %",
    "modulus MPa",
    "share",
    "time constant s",
    "zero of depth mm",
    "in the intervals",
]


def made(seeds: range, folder: Path) -> str:
    """The table of logs, and how often the truth is in the intervals."""
    body, counts, begun = [], {}, time.process_time()
    for seed in seeds:
        log = drawn(seed)
        recording, csv, offset = write(log, folder)
        try:
            fit, why = fit_force(PAD, *_pressed_force(recording, read_force_log(csv), offset)), ""
        except OptopadError as err:
            fit, why = None, str(err).replace(str(folder), "")
        body.append(row_of(log, fit, why))
        print(" | ".join(body[-1]), flush=True)
        found = {} if fit is None else hits(log, fit)
        for name in ("youngs_modulus_mpa", "relaxed_share", "time_constant_s", "depth_offset_mm"):
            counts[name] = counts.get(name, 0) + (bool(found) and found[name] is not False)
        counts["all four"] = counts.get("all four", 0) + (bool(found) and False not in found.values())
    print(f"{time.process_time() - begun:.0f} s")
    titles = ["modulus", "share", "time constant", "zero of depth", "all four"]
    inside = ", ".join(f"{title} {count}" for title, count in zip(titles, counts.values(), strict=True))
    said = (
        f"True value within the stated interval (95 % for all four together), of {len(seeds)} logs: {inside}."
    )
    return said + "\n\n" + markdown_table(HEAD, body)


def main() -> None:
    """Make the logs, fit them, write the table."""
    with tempfile.TemporaryDirectory() as folder:
        text = made(range(FIRST_SEED, FIRST_SEED + LOGS), Path(folder))
    write_text_atomically(PAGE, with_table(PAGE.read_text(encoding="utf-8"), text, MARKS))


if __name__ == "__main__":
    main()
