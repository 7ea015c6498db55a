"""The light of one manufactured unit, from the map of light of its design and some traced states of the unit.

A unit differs from its design by manufacturing tolerances and by unmeasured values
(`optopad.design.spec.tolerances`). A map of light of its own would take as long as that of the design. Here the unit's
untouched light is traced, and `STATES` states of all kinds of objects (`optopad.sims.robot.light_states`) in both the
unit and the design, with equal random shifts. The ratios r of the unit's light differ from those of the map r₀ by

    r(o) = r₀(s o) + f(r₀(s o)),   f(x) = Σₖ wₖ (k(x, xₖ) - k(x, 1) k(1, xₖ)),   k(x, y) = exp(-|x - y|² / 2 l²)

with the depths o of the objects' imprint, one factor s for all depths, and a kernel ridge regression f of what remains
of the traced difference. The factor is physical: parts that are closer to the top see the same dimple as a deeper one.
What remains has no simple form: scaling the logarithm of each pair's ratio, by one factor for each pair or by factors
that depend on location and depth, explains next to nothing of it. All pairs together tell where an object is, so f
needs no coordinates of it and takes any object. f is 0 on the untouched pad.

Factor, width l and ridge have the least error at the states themselves, each left out in turn. This error is stated
(`UnitLight.error`) next to the whole difference of unit and design (`UnitLight.difference`); the error of the map of
the design comes on top. Two drawn units of the 16 mm fingertip differ from their design by 3.7 and 2.7 % rms of the
untouched signal, one of the 32 mm pad by 1.0 %. At 54 other states, 3.0, 2.0 and 0.8 % remain, which is what was
stated within a tenth of it. So a unit is a likely one rather than exactly the one that was drawn. For a map as exact as
the design's, take the unit's design as a design of its own: `optopad scene UNIT.toml --out FOLDER --fit`.

Left out: scatter between parts of one kind, as in the tolerances; the force of the unit, which stays that of the
design, and its length and width in the scene. The gains are set anew on a unit, as for the units that `optopad score
--builds` judges.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError, OptopadError
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.tolerances import build_tolerances
from optopad.fabrication.scene.pad_light import PadLight
from optopad.sims.held import light_of_tops
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.press import GridTop
from optopad.sims.robot.fast_light import FastLight, Imprint
from optopad.sims.robot.light_states import QUICK_LIGHT, Pressed, StateSource
from optopad.sims.robot.shapes import Shape
from optopad.sims.verdict.builds import drawn_values
from optopad.sims.verdict.presses import untouched_flux

STATES = 240
OF_THE_OBJECT = "indenter."
"""Begin of the paths of tolerances that are not the pad's."""
FACTORS = np.linspace(0.7, 1.3, 25)
WIDTHS = np.array([0.5, 0.7, 1.0, 1.4, 2.0])
"""Widths of the kernel that are tried [-], for 64 pairs; they grow with the root of the number of pairs."""
RIDGES = (0.003, 0.01, 0.03, 0.1, 0.3)
FAINTEST = 1e-3
"""Least untouched light of a pair that is corrected, divided by the median over pairs [-]."""


def drawn_design(design: SensorDesign, build: int) -> SensorDesign:
    """The design of a unit, with all toleranced and unmeasured values of the pad drawn at once.

    Parameters
    ----------
    build : number of the unit, the seed of the draw

    Raises
    ------
    InputError : the number is below 0.
    """
    if build < 0:
        raise InputError(f"build: {build} is refused; give a number of 0 or more")
    tolerances = [one for one in build_tolerances(design) if not one.path.startswith(OF_THE_OBJECT)]
    if not tolerances:
        return design
    values = drawn_values(tolerances, 1, build)[0]
    return design.with_(**{one.path: float(value) for one, value in zip(tolerances, values, strict=True)})


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitLight:
    """The light of a unit under objects, with the methods of the map of light of its design.

    Attributes
    ----------
    base : map of light of the design
    untouched : (emitter, receiver) flux of the unit without contact [-]
    factor : factor of the depths of an imprint [-]
    known : (m, pair) ratios by the design's map at the traced states [-]
    weights : (m, pair) weights of the kernel at them [-]
    width : width of the kernel [-]
    difference, error : root mean square difference of the unit's ratios from the design's at the traced states, and the
        part of it that is not explained at states that are left out of the fit [-]
    """

    base: PadLight
    untouched: FloatArray
    factor: float
    known: FloatArray
    weights: FloatArray
    width: float
    difference: float
    error: float

    @property
    def digest(self) -> str:
        """Digest of the design."""
        return self.base.digest

    @property
    def deepest_mm(self) -> float:
        """Largest depth of objects that the map of light covers [mm]."""
        return self.base.deepest_mm

    def imprint(self, shape: Shape, centre_mm: FloatArray, turn: FloatArray) -> Imprint:
        """Where a shape in n poses reaches below the untouched top."""
        return self.base.imprint(shape, centre_mm, turn)

    def ratios(self, imprint: Imprint) -> FloatArray:
        """Light over untouched light (n, emitter, receiver), exactly 1 where nothing touches [-]."""
        base = self.base.ratios(imprint.scaled(self.factor))
        flat = base.reshape(len(base), -1)
        found = flat + _kernel(flat, self.known, self.width) @ self.weights
        found = np.where(imprint.deepest_mm[:, None] > 0.0, np.maximum(found, 0.0), 1.0)
        return np.asarray(found.reshape(base.shape))


def unit_light(light: PadLight, design: SensorDesign, unit: SensorDesign, *, seed: int = 0) -> UnitLight:
    """The light of a unit, from the map of light of its design and `STATES` traced states.

    Raises
    ------
    InputError : the unit has other parts than the design, or the models do not cover it.
    """
    if unit_parts(unit) != unit_parts(design):
        raise InputError("build: the unit has other parts than the design; give a design calibrated from it")
    try:
        return _fitted(light, *_traced(light, design, unit, seed))
    except OptopadError as err:
        raise InputError(
            f"build: the models do not cover this unit: {err}; draw another one, or correct its design"
        ) from err


def unit_parts(design: SensorDesign) -> tuple[int, int]:
    """Numbers of emitters and receivers of a design."""
    cavity = cavity_of(design)
    return len(cavity.emitters), len(cavity.receivers)


def _traced(
    light: PadLight, design: SensorDesign, unit: SensorDesign, seed: int
) -> tuple[FloatArray, Imprint, FloatArray]:
    """Untouched flux of a unit, imprints of states, and how much their ratios (m, pair) differ from the design's."""
    assert isinstance(light, FastLight)
    drafts, own, cavity = (Draft.of(design), Draft.of(unit)), cavity_of(unit), cavity_of(design)
    x_mm, y_mm = (own.length_mm - cavity.length_mm) / 2.0, (own.width_mm - cavity.width_mm) / 2.0
    source, there = (StateSource(one, light, seed) for one in drafts)
    found: dict[int, tuple[Pressed, GridTop]] = {}

    def solve(number: int) -> None:
        state = source.state(number)
        moved = tuple((held, x + x_mm, y + y_mm, depth) for held, x, y, depth in state.objects)
        with suppress(ModelScopeError):  # too near the walls of a smaller unit
            found[number] = state, there.solved(moved)[0]

    run_each(solve, STATES)
    states = [found[number] for number in sorted(found)]
    tops = [state.top for state, _ in states], [top for _, top in states]
    lights = [
        light_of_tops(*each, accuracy=QUICK_LIGHT, seed=seed) for each in zip(drafts, tops, strict=True)
    ]
    before, after = (one.flux / np.where(one.untouched > 0.0, one.untouched, 1.0) for one in lights)
    change = (after - before).reshape(len(states), -1)
    return untouched_flux(drafts[1], seed=0), source.imprint([state.objects for state, _ in states]), change


def _fitted(light: PadLight, untouched: FloatArray, imprint: Imprint, change: FloatArray) -> UnitLight:
    bright = untouched.ravel() >= FAINTEST * np.median(untouched)

    def known(factor: float) -> FloatArray:
        return light.ratios(imprint.scaled(factor)).reshape(len(imprint), -1)

    def rest(factor: float) -> FloatArray:
        return np.where(bright, change - (known(factor) - known(1.0)), 0.0)

    factor = min(FACTORS, key=lambda one: _rms(rest(one)))
    base, most, share = known(factor), np.sqrt(change.shape[1]) / 8.0, float(np.sqrt(bright.mean()))
    fits = [_left_out(base, rest(factor), width * most, ridge) for width in WIDTHS for ridge in RIDGES]
    left, width, weights = min(fits, key=lambda one: one[0])
    return UnitLight(
        base=light,
        untouched=untouched,
        factor=float(factor),
        known=base,
        weights=weights,
        width=width,
        difference=_rms(rest(1.0)) / share,
        error=left / share,
    )


def _left_out(
    known: FloatArray, rest: FloatArray, width: float, ridge: float
) -> tuple[float, float, FloatArray]:
    """Error of a kernel ridge regression of `rest` with each row left out in turn; its width and weights."""
    inverse = np.linalg.inv(_kernel(known, known, width) + ridge * np.eye(len(known)))
    weights = inverse @ rest
    return _rms(weights / np.diag(inverse)[:, None]), width, weights


def _kernel(one: FloatArray, other: FloatArray, width: float) -> FloatArray:
    """Kernel (n, m) of ratios (n, pair) and (m, pair), which is 0 where either is of the untouched pad."""
    apart = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2.0 * one @ other.T
    from_rest = [((each - 1.0) ** 2).sum(axis=1) for each in (one, other)]
    scale = -0.5 / width**2
    return np.asarray(np.exp(scale * apart) - np.exp(scale * (from_rest[0][:, None] + from_rest[1])))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
