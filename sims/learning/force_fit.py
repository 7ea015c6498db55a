"""Fits modulus and relaxation of a pad's elastomer to the force that a load cell measured under known presses.

Model: F(t) = a V(F_e(d(t) + δ); s, τ). F_e is the elastic force of the contact model at the design's modulus and at the
press's location (`sims.contact`), V the relaxation of a standard linear solid (`sims.contact.load_protocol`), and d the
depth that the stage reports. Fitted are

    a    modulus over the design's modulus, in slow tests (long-time modulus) [-]
    s    share of the instantaneous modulus that relaxes away [-], and its time constant τ [s]
    δ    error of the stage's zero of depth, the same for all presses [mm]

For given τ and δ the model is linear in a and a s/(1 - s). Both are solved by least squares, and τ and δ are searched
on a grid, which a parabola refines. The force before a press is subtracted (tare).

Errors are from the jackknife: each press is left out in turn. They contain the scatter from press to press, the noise
of the load cell, and the trade-off between modulus, relaxation and zero of depth. The relaxation counts as found if its
share is above two standard errors and above `LEAST_SHARE`; otherwise the fit is elastic.

Left out: the retraction, in which the contact model with relaxation is less accurate, so a press is used up to the end
of its deepest hold; errors of the load cell's scale; errors of the tip's radius and of the layer's thickness, which
enter the modulus: 1 % of the radius is about 0.5 % of the force of a light press (Hertz).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError
from design.spec import SensorDesign
from design.spec.properties import youngs_modulus_mpa
from sims.contact.indentation import solved_press
from sims.contact.load_protocol import StandardLinearSolid, viscoelastic_load_n

LEAST_PRESSES = 4
LEAST_DEPTH_MM = 0.3
"""Presses that stay above this depth are not used: an error of the zero of depth outweighs their force [mm]."""
REST_S, LEAST_REST = 0.5, 5
"""Time before a press whose mean force is the tare [s], and the least number of samples in it."""
HELD_MM = 0.02
"""A press ends at the last sample that is this close to its largest depth [mm]."""
TIMES_S = np.geomspace(0.05, 60.0, 25)
OFFSETS_MM = np.linspace(-0.15, 0.15, 31)
FOUND_SIGMAS, LEAST_SHARE = 2.0, 0.005
"""Standard errors, and share, above which a relaxation counts as found [-]."""
GOOD_ERROR = 0.02
"""Relative error of the modulus for which the number of sufficient presses is stated [-]."""
FORCE_DEPTHS = 60
SUMS = 7


@dataclass(frozen=True, kw_only=True)
class ForceFit:
    """Fitted modulus and relaxation, with standard errors.

    Attributes
    ----------
    modulus_mpa, modulus_sigma_mpa : long-time Young's modulus [MPa]
    relaxed_share, share_sigma : share of the instantaneous modulus that relaxes away [-]; 0 if none was found
    time_constant_s, time_sigma_s : its time constant [s]; None if none was found
    offset_mm, offset_sigma_mm : true depth minus the stage's depth [mm]
    single_mpa : (press,) modulus of each press by itself, in the order of the recording [MPa]
    rms_n : root mean square of measured less fitted force [N]
    design_mpa : modulus of the design before the fit [MPa]
    """

    modulus_mpa: float
    modulus_sigma_mpa: float
    relaxed_share: float
    share_sigma: float
    time_constant_s: float | None
    time_sigma_s: float | None
    offset_mm: float
    offset_sigma_mm: float
    single_mpa: FloatArray
    rms_n: float
    design_mpa: float

    @property
    def relative_sigma(self) -> float:
        """Standard error of the modulus, and so of every force, over its value [-]."""
        return self.modulus_sigma_mpa / self.modulus_mpa

    @property
    def scatter(self) -> float:
        """Standard deviation of the modulus of single presses over its mean [-]."""
        return float(self.single_mpa.std(ddof=1) / self.single_mpa.mean())

    @property
    def sufficient(self) -> int:
        """Number of presses for a standard error of 2 % by the scatter of single presses."""
        return max(LEAST_PRESSES, math.ceil((self.scatter / GOOD_ERROR) ** 2))

    @property
    def trend(self) -> tuple[float, float]:
        """Relative change of the modulus from the first press to the last, by a straight line, and its error [-]."""
        count = len(self.single_mpa)
        place = np.linspace(-0.5, 0.5, count)
        relative = self.single_mpa / self.single_mpa.mean() - 1.0
        slope = float(place @ relative / (place @ place))
        rest = relative - slope * place
        return slope, float(np.sqrt((rest @ rest) / max(count - 2, 1) / (place @ place)))

    def applied(self, design: SensorDesign) -> SensorDesign:
        """The design with the fitted modulus and, if it was found, relaxation."""
        changes: dict[str, object] = {"elastomer.youngs_modulus_mpa": float(f"{self.modulus_mpa:.5g}")}
        if self.time_constant_s is not None:
            changes["elastomer.viscoelastic"] = {
                "relaxed_share": float(f"{self.relaxed_share:.4g}"),
                "time_constant_s": float(f"{self.time_constant_s:.4g}"),
            }
        return design.with_(**changes)

    def to_json(self) -> dict[str, object]:
        """The fit as plain data."""
        change, error = self.trend
        return {
            "youngs_modulus_mpa": self.modulus_mpa,
            "youngs_modulus_sigma_mpa": self.modulus_sigma_mpa,
            "design_modulus_mpa": self.design_mpa,
            "relaxed_share": self.relaxed_share,
            "relaxed_share_sigma": self.share_sigma,
            "time_constant_s": self.time_constant_s,
            "time_constant_sigma_s": self.time_sigma_s,
            "depth_offset_mm": self.offset_mm,
            "depth_offset_sigma_mm": self.offset_sigma_mm,
            "presses": len(self.single_mpa),
            "press_scatter": self.scatter,
            "sufficient_presses": self.sufficient,
            "trend": change,
            "trend_sigma": error,
            "rms_n": self.rms_n,
        }

    @property
    def lines(self) -> list[str]:
        """Lines for the screen."""
        lines = [
            f"modulus   {self.modulus_mpa:.3g} ± {self.modulus_sigma_mpa:.2g} MPa (design {self.design_mpa:.3g} MPa), "
            f"{len(self.single_mpa)} presses"
        ]
        if self.time_constant_s is None:
            lines.append(f"relaxes   not found; share {self.relaxed_share:.3f} ± {self.share_sigma:.3f}")
        else:
            sigma = "" if self.time_sigma_s is None else f" ± {self.time_sigma_s:.2g}"
            share = f"{self.relaxed_share:.3f} ± {self.share_sigma:.3f}"
            lines.append(f"relaxes   {share} of the force, in {self.time_constant_s:.2g}{sigma} s")
        lines.append(
            f"force     is as uncertain as the modulus, {_percent(self.relative_sigma)}; "
            f"rms rest {1e3 * self.rms_n:.2g} mN; "
            f"zero of depth {self.offset_mm:+.3f} ± {self.offset_sigma_mm:.3f} mm"
        )
        change, error = self.trend
        drifts = abs(change) > FOUND_SIGMAS * error
        moved = f"{100 * change:+.2g} ± {_percent(error)}"
        trend = f"; the modulus changed by {moved} over the recording" if drifts else ""
        off = _percent(2 * math.hypot(self.scatter, self.relative_sigma))
        enough = f"{self.sufficient} presses give {_percent(GOOD_ERROR)}"
        lines.append(f"repeat    when a check press is off by more than {off} ({enough}{trend})")
        return lines


def fit_force(
    design: SensorDesign,
    time_s: FloatArray,
    press_mm: FloatArray,
    force_n: FloatArray,
    on_step: Callable[[float], None] = lambda _share: None,
) -> ForceFit:
    """Fit modulus, relaxation and zero of depth to a measured force.

    Parameters
    ----------
    time_s : (n,) times, increasing [s]
    press_mm : (n, 3) location and depth of the tip; a depth of 0 or less: no contact [mm]
    force_n : (n,) measured force [N]
    on_step : called with the finished share

    Raises
    ------
    InputError : there are fewer than 4 usable presses, or the force does not increase with depth.
    ModelScopeError : the contact model does not cover a press.
    """
    presses = _presses(time_s, press_mm[:, 2])
    if len(presses) < LEAST_PRESSES:
        raise InputError(
            f"the force log covers {len(presses)} presses of {LEAST_DEPTH_MM} mm and deeper with half a second of rest "
            f"before; needs {LEAST_PRESSES}: press more often, 10 presses at several depths are good"
        )
    sums = np.empty((len(presses), len(TIMES_S), len(OFFSETS_MM), SUMS))
    for k, part in enumerate(presses):
        sums[k] = _sums(design, time_s[part], press_mm[part], force_n[part])
        on_step((k + 1) / len(presses))
    whole = _solved(sums.sum(axis=0))
    if whole.a <= 0.0:
        raise InputError(
            "the force does not increase with depth; is its sign reversed (positive when pressed), or is the log of "
            "another recording?"
        )
    total = sums.sum(axis=0)
    left = [_solved(total - one) for one in sums]
    share, share_sigma = whole.share, _jackknife([one.share for one in left])
    elastic_only = share < max(FOUND_SIGMAS * share_sigma, LEAST_SHARE)
    if elastic_only:
        whole, left = _solved(total, elastic=True), [_solved(total - one, elastic=True) for one in sums]
    modulus = youngs_modulus_mpa(design)
    single = np.array([_single(one, whole) for one in sums])
    return ForceFit(
        modulus_mpa=modulus * whole.a,
        modulus_sigma_mpa=modulus * _jackknife([one.a for one in left]),
        relaxed_share=share,
        share_sigma=share_sigma,
        time_constant_s=None if elastic_only else whole.time_s,
        time_sigma_s=None
        if elastic_only
        else whole.time_s * _jackknife([math.log(one.time_s) for one in left]),
        offset_mm=whole.offset_mm,
        offset_sigma_mm=_jackknife([one.offset_mm for one in left]),
        single_mpa=modulus * single,
        rms_n=math.sqrt(max(whole.rest, 0.0) / total[0, 0, 6]),
        design_mpa=modulus,
    )


@dataclass(frozen=True, kw_only=True)
class _Solved:
    a: float
    share: float
    time_s: float
    offset_mm: float
    rest: float
    cell: tuple[int, int]
    excess: float


def _presses(time_s: FloatArray, depth_mm: FloatArray) -> list[slice]:
    """Samples of each usable press: from the rest before it to the end of its deepest hold."""
    touched: BoolArray = depth_mm > 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], touched, [False]]).astype(np.int8)))
    found, free = [], 0
    for begin, end in edges.reshape(-1, 2):
        rest = int(np.searchsorted(time_s, time_s[begin] - REST_S))
        deepest = depth_mm[begin:end].max()
        held: IntArray = begin + np.flatnonzero(depth_mm[begin:end] >= deepest - HELD_MM)
        if deepest >= LEAST_DEPTH_MM and begin - max(rest, free) >= LEAST_REST:
            found.append(slice(max(rest, free), int(held[-1]) + 1))
        free = int(end)
    return found


def _sums(design: SensorDesign, time_s: FloatArray, press_mm: FloatArray, force_n: FloatArray) -> FloatArray:
    """(time, offset, `SUMS`) sums over a press for least squares: B1², B1 B2, B2², B1 y, B2 y, y², 1.

    B1 is the elastic force, B2 the part that relaxes if the excess is 1, and y the measured force less its tare.
    """
    touched = press_mm[:, 2] > 0.0
    first = int(np.flatnonzero(touched)[0])
    y = force_n - force_n[:first].mean()
    place = press_mm[int(np.argmax(press_mm[:, 2])), :2]
    deepest = float(press_mm[:, 2].max())
    solved = solved_press(design, deepest, at_mm=(float(place[0]), float(place[1])))
    depths = np.linspace(0.0, deepest, FORCE_DEPTHS)
    elastic = PchipInterpolator(depths, [solved.force_n(float(depth)) for depth in depths])
    found = np.empty((len(TIMES_S), len(OFFSETS_MM), SUMS))
    for j, offset in enumerate(OFFSETS_MM):
        depth = np.maximum(press_mm[:, 2] + offset, 0.0)
        load = elastic(depth) * (depth > 0.0)  # beyond the deepest press the curve is continued
        for i, tau in enumerate(TIMES_S):
            solid = StandardLinearSolid(relaxed_share=0.5, time_constant_s=float(tau))  # its excess is 1
            relaxing = viscoelastic_load_n(time_s, load, solid) - load
            found[i, j] = (
                load @ load,
                load @ relaxing,
                relaxing @ relaxing,
                load @ y,
                relaxing @ y,
                y @ y,
                len(y),
            )
    return found


def _solved(sums: FloatArray, *, elastic: bool = False) -> _Solved:
    """Least squares over the grid of time constants and offsets, refined by parabolas around the best cell."""
    b11, b12, b22, b1y, b2y, yy, _ = np.moveaxis(sums, -1, 0)
    determinant = b11 * b22 - b12**2
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (b22 * b1y - b12 * b2y) / determinant, (b11 * b2y - b12 * b1y) / determinant
        alone = b1y / b11
    one = (b <= 0.0) | ~np.isfinite(b) | elastic  # no relaxation
    a, b = np.where(one, alone, a), np.where(one, 0.0, b)
    rest = yy - a * b1y - b * b2y
    i, j = (int(k) for k in np.unravel_index(int(np.argmin(rest)), rest.shape))
    along_time, along_offset = _vertex(rest[:, j], i), _vertex(rest[i], j)
    at_a, at_b = (_bilinear(values, i + along_time, j + along_offset) for values in (a, b))
    excess = at_b / at_a if at_a > 0.0 else 0.0
    return _Solved(
        a=at_a,
        share=excess / (1.0 + excess),
        time_s=float(np.exp(np.interp(i + along_time, np.arange(len(TIMES_S)), np.log(TIMES_S)))),
        offset_mm=float(np.interp(j + along_offset, np.arange(len(OFFSETS_MM)), OFFSETS_MM)),
        rest=float(rest[i, j]),
        cell=(i, j),
        excess=excess,
    )


def _vertex(values: FloatArray, k: int) -> float:
    """Position of a parabola's least value through three neighbours, relative to the middle one, -0.5 to 0.5."""
    if not 0 < k < len(values) - 1:
        return 0.0
    before, here, after = values[k - 1 : k + 2]
    bend = before - 2.0 * here + after
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5)) if bend > 0.0 else 0.0


def _bilinear(values: FloatArray, i: float, j: float) -> float:
    rows = [float(np.interp(j, np.arange(values.shape[1]), row)) for row in values]
    return float(np.interp(i, np.arange(values.shape[0]), rows))


def _single(sums: FloatArray, whole: _Solved) -> float:
    """Modulus of one press over the design's, with the relaxation and the offset of the whole fit."""
    b11, b12, b22, b1y, b2y, _, _ = sums[whole.cell]
    c = whole.excess
    return float((b1y + c * b2y) / (b11 + 2.0 * c * b12 + c**2 * b22))


def _jackknife(values: list[float]) -> float:
    """Standard error of an estimate from its values without each press in turn."""
    count = len(values)
    return float(np.sqrt((count - 1) / count * np.sum((np.array(values) - np.mean(values)) ** 2)))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
