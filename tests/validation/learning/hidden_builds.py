"""The tables of docs/validation/calibration.md: builds whose parameters nobody tells the calibration.

    python -m tests.validation.learning.hidden_builds  ten builds; about a quarter of an hour each on one core
    python -m tests.validation.learning.hidden_builds --builds 3  the first three
    python -m tests.validation.learning.hidden_builds --fresh  the same, with nothing taken from an earlier run
    python -m tests.validation.learning.hidden_builds --page  only write the page from the builds that are done
    python -m tests.validation.learning.hidden_builds --every 2 --first 1  builds 1, 3, 5 ..., beside a run of the rest

A build: every optical tolerance of the paper's pad drawn at random (uniform, or normal for what is poured), the power
of every LED and the gain of every receiver off by a spread, its light traced with a seed of its own, its readings
through the whole signal chain (drift a set, reference depth, lag, positioning, ambient light). Thirty presses calibrate
it; two sets of random places test it; the paper's four grid sets train the learners that see only data. Finished builds
stay in `build/validation/hidden_builds/`, one file each; an interrupted run goes on with the next. The light of the
calibration's presses is traced at "standard" and at twice the depths: a real pad has neither a trace's noise nor an
interpolation's error, which a calibration could not tell from the build.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.design.press_protocol import PressProtocol, protocol_from
from optopad.design.spec import SensorDesign
from optopad.sims.learning.calibration import Calibration, calibrated
from optopad.sims.learning.calibration_problem import Unknown, unknowns_of, with_values
from optopad.sims.learning.chain_bounds import chain_bounds
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.learners import fit_kernel_ridge
from optopad.sims.learning.map_learner import chain_noise, fit_signal_map, map_header, mapped
from optopad.sims.learning.traced_map import SignalMap
from optopad.sims.readings.press_data import PressCurves, PressData, traced_curves
from optopad.sims.readings.protocol import ProtocolCurves, draw, protocol_curves
from optopad.sims.readings.signal_chain import SignalChain, chain_of
from tests.validation.contact.contact_table import markdown_table, with_table

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "calibration.md"
WORK = Path(__file__).parents[3] / "build" / "validation" / "hidden_builds"
MARKS = "<!-- made by tests/validation/learning/hidden_builds.py -->", "<!-- end -->"
BUILDS = 10
DEPTHS_MM = (1.0, 2.0, 3.0)
TEST_PLACES = 10
BOUND_PLACES = 8
POWER_SPREAD, GAIN_SPREAD = 0.10, 0.05
"""Relative standard deviations of LED power and of receiver gain: LEDs of one bin, resistors of 5 % and diodes."""
DRAW_SEED, LIGHT_SEED = 4711, 900_000
MODELS = ("nominal", "calibrated", "ridge_real", "ridge_twin")


def protocol() -> PressProtocol:
    """Calibration (25 presses on a grid, 5 at random), the paper's four training sets, two test sets."""
    grid = [
        {"name": f"grid-{k}", "role": "train", "is_ambient": k % 2 == 0, "grid_mm": 2.0} for k in range(4)
    ]
    test = [
        {
            "name": f"test-{k}",
            "role": "test",
            "is_ambient": k == 0,
            "random_places": TEST_PLACES,
            "place_seed": 1 + k,
        }
        for k in range(2)
    ]
    own = [
        {"name": "calibrate-grid", "role": "train", "is_ambient": True, "grid_mm": 5.0},
        {"name": "calibrate-random", "role": "train", "is_ambient": True, "random_places": 5},
    ]
    return protocol_from(
        {
            "name": "hidden-builds",
            "approach": [
                {"from_mm": -10.0, "to_mm": -3.0, "step_mm": 1.0},
                {"from_mm": -2.0, "to_mm": 5.0, "step_mm": 0.1},
            ],
            "sets": [*own, *grid, *test],
        },
        where="hidden-builds",
    )


def drawn_values(unknowns: tuple[Unknown, ...], rng: np.random.Generator) -> np.ndarray:
    """Hidden values: uniform within the ends, but for the poured thickness, which is normal and cut off there."""
    return np.array(
        [
            float(np.clip(rng.normal(one.value, one.spread), one.low, one.high))
            if one.path == "cavity.clear_thickness_mm"
            else rng.uniform(one.low, one.high)
            for one in unknowns
        ]
    )


def calibration_curves(hidden: SensorDesign, seed: int) -> ProtocolCurves:
    """Light of the calibration's sets, finer than any that the calibration traces, its knots twice as dense."""
    whole = protocol()
    own = whole.model_copy(update={"sets": whole.sets[:2]})
    coarse = protocol_curves(hidden, own, seed=seed)
    root = np.sqrt(coarse.curves.depth_mm)
    knots = np.sort(np.concatenate([root, 0.5 * (root[1:] + root[:-1])])) ** 2
    light = traced_curves(hidden, coarse.curves.places_mm, depth_mm=knots, accuracy="standard", seed=seed)
    return replace(coarse, curves=light)


def of_sets(data: PressData, start: str) -> PressData:
    """The samples of sets whose names begin so."""
    wanted = np.array([one.name.startswith(start) for one in data.sets])
    return data.only(wanted[data.set_number])


def errors_mm(model: TouchModel, data: PressData) -> dict[str, list[float]]:
    """Medians of location and depth error at the depths, over truly touched samples, by the stage's own words."""
    location, depth = [], []
    for wanted in DEPTHS_MM:
        rows = np.abs(data.press_mm[:, 2] - wanted) < 1e-6
        found = model.predict(data.only(rows).features().astype(np.float64)).press_mm - data.press_mm[rows]
        location.append(float(np.median(np.hypot(found[:, 0], found[:, 1]))))
        depth.append(float(np.median(np.abs(found[:, 2]))))
    return {"location_mm": location, "depth_mm": depth}


def model_of(design: SensorDesign, found: SignalMap, data: PressData) -> TouchModel:
    """A map with the calibration's frames."""
    return fit_signal_map(design, found, map_header(design, data, found, 0), data)


def twin_data(
    curves: ProtocolCurves, calibration: Calibration, found: SignalMap, chain: SignalChain, seed: int
) -> PressData:
    """The training protocol on the calibrated twin: light by its map, gains as fitted."""
    places, knots = curves.curves.places_mm, curves.curves.depth_mm
    press_mm = np.column_stack([np.repeat(places, len(knots), axis=0), np.tile(knots, len(places))])
    flux = found.at(press_mm).reshape(len(places), len(knots), *chain.gains.shape)
    twin = replace(
        curves,
        design=calibration.design,
        curves=PressCurves(places_mm=places, depth_mm=knots, flux=flux),
    )
    gains = calibration.fitted.gains.reshape(chain.gains.shape)
    return of_sets(draw(twin, replace(chain, gains=gains), seed=seed), "grid")


def bound_mm(design: SensorDesign, chain: SignalChain, test: PressData, seed: int) -> dict[str, list[float]]:
    """Medians of the Cramér-Rao bounds at some of the test places."""
    places = np.unique(np.round(test.press_mm[:, :2], 1), axis=0)
    places = places[np.linspace(0, len(places) - 1, BOUND_PLACES).astype(int)]
    press_mm = np.array([[x, y, depth] for depth in DEPTHS_MM for x, y in places])
    noise = chain_noise(design, *chain.gains.shape[:1], chain.gains.size)
    noise = replace(noise, clip_counts=np.full(chain.gains.size, chain.full_scale_counts))
    found = chain_bounds(design, press_mm, chain.gains, noise, seed=seed)
    shape = (len(DEPTHS_MM), BOUND_PLACES)
    return {
        "location_mm": np.median(found.location_mm.reshape(shape), axis=1).tolist(),
        "depth_mm": np.median(found.depth_mm.reshape(shape), axis=1).tolist(),
        "tip_location_mm": np.median(found.tip.location_mm.reshape(shape), axis=1).tolist(),
        "tip_depth_mm": np.median(found.tip.depth_mm.reshape(shape), axis=1).tolist(),
    }


def build_figures(number: int, say: Any = print) -> dict[str, Any]:
    """Everything about one build."""
    started = time.monotonic()

    def tell(what: str) -> None:
        say(f"build {number}: {what}, {time.monotonic() - started:.0f} s", flush=True)

    design = preset("piacenza2017-pad")
    rng = np.random.default_rng([DRAW_SEED, number])
    unknowns = unknowns_of(design)
    values = drawn_values(unknowns, rng)
    hidden = with_values(design, unknowns, values)
    curves = protocol_curves(hidden, protocol(), seed=LIGHT_SEED + number)
    tell("light of the unit")
    chain = chain_of(hidden, curves.readout)
    emitters, receivers = chain.gains.shape
    power = np.exp(POWER_SPREAD * rng.normal(size=(emitters, 1)))
    chain = replace(chain, gains=chain.gains * power * np.exp(GAIN_SPREAD * rng.normal(size=(1, receivers))))
    data = replace(draw(curves, chain, seed=number), design_digest=design.digest)
    grid, test = (of_sets(data, start) for start in ("grid", "test"))
    own = replace(
        draw(calibration_curves(hidden, LIGHT_SEED + number), chain, seed=number), design_digest=design.digest
    )
    tell("readings")
    found: dict[str, Any] = {"nominal": errors_mm(model_of(design, mapped(design), own), test)}
    tell("nominal map")
    calibration = calibrated(design, own)
    tell(f"calibration, residuals {calibration.fitted.rms[0]:.2f} -> {calibration.fitted.rms[1]:.2f}")
    twin = mapped(calibration.design)
    found["calibrated"] = errors_mm(model_of(calibration.design, twin, own), test)
    tell("calibrated map")
    found["bound"] = bound_mm(hidden, chain, test, LIGHT_SEED + number)
    tell("bound")
    found["ridge_real"] = errors_mm(fit_kernel_ridge(grid), test)
    tell("kernel ridge on the build's data")
    found["ridge_twin"] = errors_mm(
        fit_kernel_ridge(twin_data(curves, calibration, twin, chain, number)), test
    )
    tell("kernel ridge on the twin's data")
    return found | {
        "number": number,
        "seconds": time.monotonic() - started,
        "rms": calibration.fitted.rms,
        "parameters": [
            {
                "path": one.path,
                "spread": one.spread,
                "nominal": one.value,
                "true": true,
                "fitted": fit,
                "deviation": off,
            }
            for one, true, fit, off in zip(
                unknowns,
                values.tolist(),
                calibration.values.tolist(),
                calibration.deviations.tolist(),
                strict=True,
            )
        ],
    }


def finished(builds: int = 10_000) -> list[dict[str, Any]]:
    """Builds that are done, in order."""
    files = sorted(WORK.glob("*.json"))
    found = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    return sorted((one for one in found if one["number"] < builds), key=lambda one: one["number"])


NAMES = {
    "nominal": "map of the design as drawn, not calibrated",
    "calibrated": "map of the calibrated twin, 30 presses",
    "ridge_real": "kernel ridge, the unit's own four grid sets (484 presses)",
    "ridge_twin": "kernel ridge, the same sets simulated on the calibrated twin",
    "bound": "Cramér-Rao bound, the stage's errors included",
}
TIP_BOUND = "Cramér-Rao bound of the tip's position, without the stage's errors"


def error_table(builds: list[dict[str, Any]], what: str) -> str:
    """Medians over builds, lowest and highest in brackets [mm]."""
    found = {title: [one[name][what] for one in builds] for name, title in NAMES.items()}
    found[TIP_BOUND] = [one["bound"][f"tip_{what}"] for one in builds]
    rows = []
    for title, values in found.items():
        cells = [
            f"{np.median(column):.3f} ({column.min():.3f}-{column.max():.3f})"
            for column in np.array(values).T
        ]
        rows.append([title, *cells])
    return markdown_table(["", *(f"{depth:g} mm" for depth in DEPTHS_MM)], rows)


def ratio_table(builds: list[dict[str, Any]]) -> str:
    """One learner's location error over another's."""
    location = {name: np.array([one[name]["location_mm"] for one in builds]) for name in NAMES}
    cases = (
        ("calibrated map over the bound", "calibrated", "bound"),
        ("kernel ridge over the calibrated map", "ridge_real", "calibrated"),
        ("calibrated map over kernel ridge on the real protocol", "calibrated", "ridge_real"),
        ("kernel ridge on the twin's data over the same on the real protocol", "ridge_twin", "ridge_real"),
    )
    rows = []
    for title, above, below in cases:
        ratio = location[above] / location[below]
        cells = [f"{np.median(column):.2f} ({column.min():.2f}-{column.max():.2f})" for column in ratio.T]
        rows.append([title, *cells])
    return markdown_table(["median location error", *(f"{depth:g} mm" for depth in DEPTHS_MM)], rows)


def parameter_table(builds: list[dict[str, Any]]) -> str:
    """How far fitted parameters are from the hidden ones."""
    rows = []
    for k, one in enumerate(builds[0]["parameters"]):
        off = np.array(
            [build["parameters"][k]["fitted"] - build["parameters"][k]["true"] for build in builds]
        )
        before = np.array(
            [build["parameters"][k]["nominal"] - build["parameters"][k]["true"] for build in builds]
        )
        said = np.array([build["parameters"][k]["deviation"] for build in builds])
        rms = [float(np.sqrt((values**2).mean())) for values in (before, off, said)]
        rows.append([f"`{one['path']}`", *(f"{value:.3g}" for value in rms)])
    return markdown_table(
        ["parameter", "off before (rms)", "off after (rms)", "stated deviation (rms)"], rows
    )


def optimism(builds: list[dict[str, Any]]) -> float:
    """Root mean square of parameters' errors over their said deviations; 1 would be honest [-]."""
    rows = [row for one in builds for row in one["parameters"]]
    return float(np.sqrt(np.mean([((row["fitted"] - row["true"]) / row["deviation"]) ** 2 for row in rows])))


def write_page(builds: list[dict[str, Any]]) -> None:
    """Put the tables of finished builds into the page."""
    seconds = [one["seconds"] for one in builds]
    text = "\n\n".join(
        [
            f"{len(builds)} of {BUILDS} units done; {min(seconds):.0f} to {max(seconds):.0f} s each, one thread on a "
            "shared machine. "
            "Median over units, lowest and highest in brackets.",
            "Location error [mm]:",
            error_table(builds, "location_mm"),
            "Depth error [mm]:",
            error_table(builds, "depth_mm"),
            ratio_table(builds),
            parameter_table(builds),
            f"Errors over stated deviations, root mean square over parameters and units: {optimism(builds):.2f}.",
        ]
    )
    write_text_atomically(PAGE, with_table(PAGE.read_text(encoding="utf-8"), text, MARKS))


def main() -> None:
    """Run what is missing, then write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--builds", type=int, default=BUILDS)
    parser.add_argument("--fresh", action="store_true", help="run finished builds anew")
    parser.add_argument("--every", type=int, default=1, help="only every n-th build")
    parser.add_argument("--first", type=int, default=0, help="the first of them")
    parser.add_argument("--page", action="store_true", help="only write the page")
    asked = parser.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    for file in WORK.glob("*.json") if asked.fresh else ():
        file.unlink()
    for number in range(asked.first, 0 if asked.page else asked.builds, asked.every):
        file = WORK / f"{number:02d}.json"
        if not file.exists():
            write_text_atomically(file, json.dumps(build_figures(number), indent=1) + "\n")
    if done := finished(asked.builds):
        write_page(done)


if __name__ == "__main__":
    main()
