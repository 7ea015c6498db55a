"""Two fingers that pass each other on the paper's pad, read through the whole chain: docs/images/two-fingers.svg.

    python -m tests.validation.driver.two_fingers          (about ten minutes of two cores, two with known light)

The simulated board has light that was traced with another seed than the model's, interpolated by a spline, and
multiplies the ratios of both fingers, as `optopad driver fake` does. Its frames go over a pseudo-terminal to the driver
and through drift tracking, model and track numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.finger import HOVER_MM, FingerPath
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver.simulated.press_table import SplineTable
from optopad.fabrication.driver.touch_reader import Touch, TouchReader
from optopad.fabrication.driver_config import driver_config
from optopad.fabrication.driver_file import DriverConfig
from optopad.sensor import simulated_gain
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.together_fit import fit_together
from optopad.sims.learning.traced_map import measured_error, traced_map
from optopad.sims.plots.style import BLUE, GREEN, GREY, INK, VERMILLION, WIDTH_IN, plain_style, svg_text
from optopad.sims.touches_score import TouchesScore, score_touches
from tests.validation.driver.slip_frames import (
    FINE_DEPTHS,
    FINE_PITCH_MM,
    KNOWN_SEED,
    TRUE_SEED,
    bench_with,
)

FILE = Path(__file__).parents[3] / "docs" / "images" / "two-fingers.svg"
NAME = "piacenza2017-pad"
NEAREST_MM, DEPTH_MM, SPEED_MM_S = 6.1, 1.0, 15.0
"""Nearest distance of both fingers, which is that of tips that almost touch; depth and speed of both."""
REST_S, IN_S, HELD_S = 1.2, 0.3, 0.3
FROM_MM, TO_MM, MIDDLE_MM = 8.0, 24.0, 16.0
BOOT_S = 0.2
RADIUS_MM = 3.0
COLOURS = {1: (BLUE, "o"), 2: (VERMILLION, "^")}
"""Colour and mark of each number."""


@dataclass(frozen=True, kw_only=True)
class TwoFingers:
    """The paper's pad with a simulated board, and a model that knows two touches."""

    config: DriverConfig
    light: SplineTable
    model: SignalMapModel

    def read(self, path: FingerPath) -> list[Touch]:
        """The touches of one round of a path, through port, driver and model."""
        board = FakeBoard(self.config, self.light, path)
        with FakePort(board) as port, Sensor(self.config, port.name, baseline_s=0.0) as sensor:
            found = list(TouchReader(sensor, self.model, touches=2).touches(seconds=float(path.time_s[-1])))
        return [touch for touch in found if touch.frame.device_us < 1e6 * path.time_s[-1]]


def prepared() -> TwoFingers:
    """Trace the light, and train the model."""
    design = preset(NAME)
    truth = traced_map(design, seed=TRUE_SEED)
    known = traced_map(design, pitch_mm=FINE_PITCH_MM, depth_nodes=FINE_DEPTHS, seed=KNOWN_SEED)
    known = replace(known, error=measured_error(design, known).of_ratio(known.untouched))
    model = bench_with(NAME, design, truth, known).model
    gain = simulated_gain(design, seed=0, on_step=lambda _stage, _share: None)
    config = driver_config(design, gain.counts_per_flux, gain.untouched_readings(design))
    return TwoFingers(
        config=replace(config, board=replace(config.board, boot_s=BOOT_S)),
        light=SplineTable(
            untouched=truth.untouched.reshape(truth.flux.shape[3:]) * np.array(gain.counts_per_flux),
            ratio_root=truth.ratio_root,
        ),
        model=fit_together(Draft.of(design), model, known),
    )


def crossing(nearest_mm: float = NEAREST_MM, depth_mm: float = DEPTH_MM) -> FingerPath:
    """Two fingers of equal depth on parallel strokes against each other."""
    slid_s = (TO_MM - FROM_MM) / SPEED_MM_S
    steps = [(0.0, 0, HOVER_MM), (REST_S, 0, HOVER_MM), (IN_S, 0, depth_mm), (HELD_S, 0, depth_mm)]
    steps += [(slid_s, 1, depth_mm), (HELD_S, 1, depth_mm), (IN_S, 1, HOVER_MM), (HELD_S, 1, HOVER_MM)]
    ends, y_mm = (FROM_MM, TO_MM), nearest_mm / 2
    press = [
        [(ends[at], MIDDLE_MM - y_mm, depth), (ends[1 - at], MIDDLE_MM + y_mm, depth)]
        for _, at, depth in steps
    ]
    return FingerPath(time_s=np.cumsum([step for step, *_ in steps]), press_mm=np.array(press))


def tracked(touches: list[Touch]) -> tuple[FloatArray, IntArray, FloatArray]:
    """Time [s], number and x, y, depth [mm] of every contact."""
    rows = [
        (touch.frame.device_us / 1e6, one.number, *one.press_mm)
        for touch in touches
        for one in touch.contacts
    ]
    table = np.array(rows).reshape(-1, 5)
    return table[:, 0], table[:, 1].astype(np.int64), table[:, 2:]


def plot_places(path: FingerPath, touches: list[Touch], two_point_mm: float, ax: Axes) -> None:
    """Tracks of both touches over the true strokes, seen from above, with both tips where they are nearest."""
    _, number, place = tracked(touches)
    for tip, y_mm in zip(np.moveaxis(path.press_mm, 1, 0), (-NEAREST_MM / 2, NEAREST_MM / 2), strict=True):
        (stroke,) = ax.plot(*tip[tip[:, 2] > 0.0, :2].T, color=INK, lw=0.8)
        ax.add_patch(Circle((MIDDLE_MM, MIDDLE_MM + y_mm), RADIUS_MM, fill=False, color=GREY, lw=0.8))
    stroke.set_label("true")
    for one, (colour, mark) in COLOURS.items():
        mine = number == one
        ax.plot(*place[mine, :2].T, mark, ms=3.0, color=colour, label=f"touch {one}")
    ax.errorbar(MIDDLE_MM, MIDDLE_MM, two_point_mm / 2, color=GREEN, capsize=4, lw=1.2)
    ax.text(MIDDLE_MM + 3.2, MIDDLE_MM, f"two-point limit {two_point_mm:.1f} mm", color=GREEN, va="center")
    ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", xlim=(6.0, 26.0), ylim=(9.0, 23.0))
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=3)


def plot_distance(path: FingerPath, touches: list[Touch], two_point_mm: float, ax: Axes) -> None:
    """True and found distance of both touches over time."""
    time_s = np.array([touch.frame.device_us / 1e6 for touch in touches])
    tips = path.at(time_s)
    both = (tips[..., 2] > 0.0).all(axis=1)
    true_mm = np.linalg.norm(tips[:, 0, :2] - tips[:, 1, :2], axis=1)
    ax.plot(time_s[both], true_mm[both], color=INK, lw=0.8, label="true")
    found = [
        (t, float(np.linalg.norm(touch.contacts[0].press_mm[:2] - touch.contacts[1].press_mm[:2])))
        for t, touch in zip(time_s, touches, strict=True)
        if len(touch.contacts) == 2
    ]
    ax.plot(*np.array(found).T, ".", ms=3.0, color=BLUE, label="found")
    ax.axhline(two_point_mm, color=GREEN, lw=1.2, ls="--", label="two-point limit")
    ax.set(xlabel="time [s]", ylabel="distance of both [mm]", ylim=(0.0, None))
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=3)


def figure(path: FingerPath, touches: list[Touch], two_point_mm: float) -> Figure:
    """Both plots."""
    made = Figure(figsize=(WIDTH_IN, 6.2), layout="constrained")
    upper, lower = made.subplots(2, 1, height_ratios=(1.9, 1.0))
    plot_places(path, touches, two_point_mm, upper)
    plot_distance(path, touches, two_point_mm, lower)
    return made


def limit_mm(score: TouchesScore, depth_mm: float = DEPTH_MM) -> float:
    """Least separation at which touches of this depth, one above the other in the middle of the pad, are resolved."""
    place = int(np.linalg.norm(score.places_mm - MIDDLE_MM, axis=1).argmin())
    direction, depth = score.directions_deg.index(90.0), int(np.abs(score.depth_mm - depth_mm).argmin())
    return float(score.least_mm[place, direction, depth])


def main() -> None:
    """Draw the figure, and print what it shows."""
    pad, path = prepared(), crossing()
    touches = pad.read(path)
    two_point_mm = limit_mm(score_touches(Draft.of(preset(NAME))))
    with plain_style():
        made = figure(path, touches, two_point_mm)
    write_text_atomically(FILE, svg_text(made, "two-fingers"))
    print(f"{FILE}: two-point limit {two_point_mm:.2f} mm; {summary(path, touches)}")


def summary(path: FingerPath, touches: list[Touch]) -> str:
    """Share of frames of two fingers with two touches, numbers, and errors of location."""
    tips = path.at(np.array([touch.frame.device_us / 1e6 for touch in touches]))
    both = (tips[..., 2] > 0.9 * DEPTH_MM).all(axis=1)
    found = [touch for touch, is_both in zip(touches, both, strict=True) if is_both]
    two = [len(touch.contacts) == 2 for touch in found]
    numbers = sorted({one.number for touch in found for one in touch.contacts})
    return f"{np.mean(two):.1%} of {len(two)} frames of both have two touches, numbered {numbers}"


if __name__ == "__main__":
    main()
