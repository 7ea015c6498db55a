"""The model of held objects against two published sets of measurements; prints two tables.

    python -m tests.validation.held.published FOLDER      minutes

FOLDER holds `waveguide_tips_centre.csv` and `remodel_steps.csv`, tables taken from two public repositories
(zhangzhongwd/optical_waveguide_calibration; Vanvitelli-Robotics/REMODEL, commit 23dc0f1), which state no licence and
are therefore not part of this one.

* Five tips on a strip: force at 0.5, 1 and 1.5 mm beyond the depth where it passes 0.1 N, over the smallest tip's.
  The section of the strip and its modulus are not stated. A wide layer of one thickness stands for the strip. Its
  modulus gives the smallest tip's force at 1 mm, and its thickness is fitted to the other tips' forces at 1 mm.
  No thickness fits: the best is the largest on offer, a half-space, and 24 % off. The cylinder of 3 mm and the block of
  1.5 x 5 mm have almost one area; the block needs 1.6 times the force in the measurement, and 1.1 times that
  of the cylinder on a layer of any thickness. So the width of the strip and its free sides matter, which the
  source does not state. With finite strains (`finite_forces_n`) the cylinders are farther off.
* Footprint of a press in a grid of 25 cavities below a pad of 8.5 mm: signal by distance from the pressed one. In the
  model the floor is bonded and does not move; what bends a cavity's ceiling is the pressure on it, so
  the model's figure is the normal stress at the floor, averaged over a cavity's square. The floor is that of the whole
  pad, or lies at the ceilings. The tip is not stated, and matters little.

Left out: the strip's sides, the walls of both, friction, what the measured layers are glued to.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.optimize import brentq, minimize_scalar

from optopad.design.arrays import FloatArray
from optopad.sims.contact.held.layer import WideLayer
from optopad.sims.contact.held.solve import contact_pressure
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.press_oracle import Press, pressed_states
from tests.validation.elements.tip_outlines import flat_tip, sphere_tip

STEP_MM = 0.04
TOUCH_N = 0.1
"""Force from which the measured depth counts."""
DEPTHS_MM = (0.0, 0.03, 0.06, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8)
SHOWN_MM = (0.5, 1.0, 1.5)
EDGE_MM = 0.5
FINITE = Grading(axis_size=0.1, axis_radius=0.2, growth=1.3, largest_radial=3.0, largest_axial=2.0)
FINITE_DEPTHS_MM = (0.03, 0.06, 0.1, 0.15, 0.2, 0.5, 0.8, 1.0, 1.1, 1.2, 1.3)
TAXEL_MM, CAVITY_MM = 3.55, 2.55
"""Pitch and side of the cavities."""
PAD_MM = 8.5, 7.45
"""Thickness of the pad, and of what is above the ceilings of the cavities."""


@dataclass(frozen=True)
class Tip:
    """An upright tip with a flat end: half sides of the flat part, which the rounded edge surrounds [mm]."""

    flat_mm: tuple[float, float]
    is_round: bool = False

    def bottoms(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(nx, ny) height above the lowest point [mm]."""
        if self.is_round:
            beyond = np.maximum(np.hypot(x, y) - self.flat_mm[0], 0.0)
        else:
            beyond = np.hypot(
                *(np.maximum(np.abs(one) - flat, 0.0) for one, flat in zip((x, y), self.flat_mm, strict=True))
            )
        rise = EDGE_MM - np.sqrt(np.maximum(EDGE_MM**2 - beyond**2, 0.0))
        return np.where(beyond < EDGE_MM, rise, np.inf)


TIPS = {
    "cylinder d1": Tip((0.0, 0.0), is_round=True),  # half a ball: its edge is all of it
    "cylinder d2": Tip((0.5, 0.5), is_round=True),
    "cylinder d3": Tip((1.0, 1.0), is_round=True),
    "block 1.5x5": Tip((2.0, 0.25)),
    "block 3x5": Tip((2.0, 1.0)),
}


class WidePress:
    """A wide layer with shear modulus 1/3 under a body, on a grid around its middle."""

    def __init__(self, thickness_mm: float, half_mm: tuple[float, float], step_mm: float) -> None:
        axes = [step_mm * np.arange(-round(half / step_mm), round(half / step_mm) + 1) for half in half_mm]
        self.x, self.y = np.meshgrid(*axes, indexing="ij")
        self.thickness_mm, self.step_mm = thickness_mm, step_mm
        self.layer = WideLayer(thickness_mm, (step_mm, step_mm), self.x.shape).within(self.x.shape)

    def pressure(self, bottoms: FloatArray, depth_mm: float) -> FloatArray:
        """(nx, ny) over Young's modulus [-]."""
        overlap = bottoms - depth_mm
        load, _ = contact_pressure(
            self.layer.moved, overlap, 1e-5 * depth_mm, np.maximum(-overlap, 0.0) / self.thickness_mm
        )
        return load / 3.0


def curves(thickness_mm: float) -> dict[str, FloatArray]:
    """Tip -> (depth,) force over Young's modulus [mm²] at `DEPTHS_MM` from first touch."""
    found = {}
    for name, tip in TIPS.items():
        half = tuple(flat + EDGE_MM + 2.0 * STEP_MM for flat in tip.flat_mm)
        press = WidePress(thickness_mm, half, STEP_MM)
        bottoms = tip.bottoms(press.x, press.y)
        forces = [press.pressure(bottoms, depth).sum() for depth in DEPTHS_MM[1:]]
        found[name] = STEP_MM**2 * np.array([0.0, *forces])
    return found


def forces_n(curve: FloatArray, modulus_mpa: float) -> FloatArray:
    """(3,) at `SHOWN_MM` beyond the depth at which the force is `TOUCH_N` [N]."""
    touch = np.interp(TOUCH_N, modulus_mpa * curve, DEPTHS_MM)
    return modulus_mpa * np.interp(touch + np.array(SHOWN_MM), DEPTHS_MM, curve)


def fitted(curve: FloatArray, force_n: float) -> float:
    """Modulus that gives a force at the second of `SHOWN_MM` [MPa]."""
    return float(brentq(lambda one: forces_n(curve, one)[1] - force_n, 0.05, 20.0))


def finite_forces_n(thickness_mm: float, force_n: float) -> list[float]:
    """Forces of the three cylinders at 1 mm on a neo-Hookean layer whose modulus gives the first one's [N]."""
    curves = []
    for diameter in (1.0, 2.0, 3.0):
        radius = 0.5 * diameter
        tip = flat_tip(EDGE_MM / radius) if diameter > 1.0 else sphere_tip()
        press = Press(thickness_mm / radius, 2.5 * thickness_mm / radius, FINITE, POISSON_RATIO, tip)
        press.penalty = press.final_penalty = 300.0
        states = pressed_states(press, [depth / radius for depth in FINITE_DEPTHS_MM])
        curves.append([0.0, *(radius**2 * state.force for state in states)])
    depths = (0.0, *FINITE_DEPTHS_MM)

    def at_1_mm(curve: list[float], modulus: float) -> float:
        touch = float(np.interp(TOUCH_N / modulus, curve, depths))
        return modulus * float(np.interp(touch + 1.0, depths, curve))

    modulus = float(brentq(lambda one: at_1_mm(curves[0], one) - force_n, 0.3, 10.0))
    return [at_1_mm(curve, modulus) for curve in curves]


def measured_n(folder: Path) -> dict[str, FloatArray]:
    """Tip -> (3,) force at `SHOWN_MM` beyond the travel at which it passes `TOUCH_N` [N]."""
    found = {}
    with (folder / "waveguide_tips_centre.csv").open(encoding="utf-8") as lines:
        rows = [row for row in csv.DictReader(lines) if row["tip"] in TIPS]
    for name in TIPS:
        travel, force = np.array(
            [(float(row["travel_mm"]), float(row["force_N"])) for row in rows if row["tip"] == name]
        ).T
        after = np.flatnonzero(force > TOUCH_N)[0]
        touch = np.interp(TOUCH_N, force[after - 1 : after + 1], travel[after - 1 : after + 1])
        found[name] = np.interp(touch + np.array(SHOWN_MM), travel, force)
    return found


def misfit(thickness_mm: float, measured: dict[str, FloatArray]) -> float:
    """Root mean square of the logarithm of the ratios at 1 mm, model over measurement."""
    modelled = curves(thickness_mm)
    modulus = fitted(modelled["cylinder d1"], measured["cylinder d1"][1])
    logs = [np.log(forces_n(modelled[tip], modulus)[1] / measured[tip][1]) for tip in list(TIPS)[1:]]
    return float(np.sqrt(np.mean(np.square(logs))))


def tips_table(folder: Path) -> Iterable[str]:
    """Lines of Markdown: ratios of the tips, measured and of the fitted layer."""
    measured = measured_n(folder)
    lines = {"measured": [measured[tip] for tip in TIPS]}
    best = minimize_scalar(
        lambda log: misfit(float(np.exp(log)), measured),
        bounds=(np.log(1.5), np.log(30.0)),
        method="bounded",
        options={"xatol": 0.02},
    )
    for thickness in (float(np.exp(best.x)), 3.0, 5.0, 9.0, 30.0):
        modelled = curves(thickness)
        modulus = fitted(modelled["cylinder d1"], measured["cylinder d1"][1])
        name = f"{thickness:.2g} mm, {modulus:.2f} MPa, {misfit(thickness, measured):.1%} rms"
        lines[name] = [forces_n(modelled[tip], modulus) for tip in TIPS]
    finite = finite_forces_n(9.0, measured["cylinder d1"][1])
    yield "At 1 mm with finite strains, 9 mm: " + " : ".join(f"{one / finite[0]:.2f}" for one in finite)
    yield ""
    yield "| force over that of cylinder d1 at 0.5, 1, 1.5 mm | d1 [N] | " + " | ".join(list(TIPS)[1:]) + " |"
    yield "|" + " --- |" * 6
    for name, forces in lines.items():
        ratios = [", ".join(f"{one:.2f}" for one in force / forces[0]) for force in forces[1:]]
        yield (
            f"| {name} | " + ", ".join(f"{one:.2f}" for one in forces[0]) + " | " + " | ".join(ratios) + " |"
        )


def footprint(radius_mm: float, depth_mm: float, thickness_mm: float) -> FloatArray:
    """(4,) stress at the floor below cavities at four distances, over that below the press.

    Parameters
    ----------
    radius_mm : of a ball; 0 is a point
    """
    step, half = 0.1, 4.0 * thickness_mm
    press = WidePress(thickness_mm, (radius_mm + 1.0,) * 2, step)
    square = np.minimum(press.x**2 + press.y**2, radius_mm**2)
    load = np.zeros((2 * round(half / step) + 1,) * 2)
    middle, reach = len(load) // 2, len(press.x) // 2
    if radius_mm:
        bottoms = np.where(square < radius_mm**2, radius_mm - np.sqrt(radius_mm**2 - square), np.inf)
        found = press.pressure(bottoms, depth_mm)
        load[middle - reach : middle + reach + 1, middle - reach : middle + reach + 1] = found
    else:
        load[middle, middle] = 1.0
    q = 2.0 * np.pi * np.fft.fftfreq(len(load), step)
    stress = np.fft.ifft2(np.fft.fft2(load) * floor_share(np.hypot(q[:, None], q), thickness_mm)).real
    cells = uniform_filter(stress, round(CAVITY_MM / step), mode="wrap")
    taxel = round(TAXEL_MM / step)
    beside = [(0, 0), (taxel, 0), (taxel, taxel), (2 * taxel, 0)]
    return np.array([cells[middle + i, middle + j] for i, j in beside]) / cells[middle, middle]


def floor_share(q: FloatArray, thickness: float) -> FloatArray:
    """Normal stress at the bonded floor over the pressure on top (...) of a wide incompressible layer [-].

    At a wave number q and k = q h: (cosh k + k sinh k) / (cosh² k + k²).
    """
    k = np.minimum(q * thickness, 40.0)
    return (np.cosh(k) + k * np.sinh(k)) / (np.cosh(k) ** 2 + k**2)


def measured_footprint(folder: Path) -> FloatArray:
    """(4,) mean signal of the taxels at each distance over that of the pressed one, number 13 [-]."""
    with (folder / "remodel_steps.csv").open(encoding="utf-8") as lines:
        rows = [row for row in csv.DictReader(lines) if row["pressed_taxel"] == "13"]
    by_distance: dict[int, list[float]] = {}
    for row in rows:
        square = (int(row["row"]) - 3) ** 2 + (int(row["column"]) - 3) ** 2
        by_distance.setdefault(square, []).append(float(row["dv_hold_V"]))
    means = np.array([np.mean(by_distance[square]) for square in (0, 1, 2, 4)])
    return means / means[0]


def footprint_table(folder: Path) -> Iterable[str]:
    """Lines of Markdown: the footprint, measured and of the layer."""
    yield "| distance [mm] | 0 | 3.55 | 5.02 | 7.10 |"
    yield "|" + " --- |" * 5
    shares = {"measured signal, taxel 13": measured_footprint(folder)}
    for thickness, radius in product(PAD_MM, (0.0, 3.0)):
        name = f"ball of {radius:g} mm, 1.7 mm deep" if radius else "force on a point"
        shares[f"stress at a floor {thickness:g} mm deep, {name}"] = footprint(radius, 1.7, thickness)
    for name, found in shares.items():
        yield f"| {name} | " + " | ".join(f"{one:.2f}" for one in found) + " |"


if __name__ == "__main__":
    source = Path(sys.argv[1])
    print(*footprint_table(source), sep="\n", end="\n\n", flush=True)
    print(*tips_table(source), sep="\n")
