"""Plausibility of a force log and of the modulus fitted to it.

A fit is refused if no pad of the design's material has this modulus, if the force does not follow the presses, or if an
unknown ends at the limit of its range. The refusal names the likely cause.

Band of the modulus: the catalogue's for the elastomer and mixing ratio, otherwise the design's own modulus divided and
multiplied by `SILENT_FACTOR`. A fit is refused if its 95 % interval is outside the band widened by `REFUSED_FACTOR`. It
gets a warning if the interval is outside the band itself. Softer and harder mixes are so allowed; the least factor
between two units of force, 3.6 from ounces to newtons, is not.

Saturation: at least `PLATEAU` samples in a row have exactly the largest force of the log, although the noise is above
the log's resolution, or although the tip moves. Such a press is left out. The same of the least force at rest means
that the amplifier cuts off below, so that no tare is known; the log is refused.
"""

from __future__ import annotations

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.sims.learning.press_force import LONGEST_GAP_S, PressWindow, TipPath, largest_gap, spans

SILENT_FACTOR, REFUSED_FACTOR = 2.0, 1.5
"""Factors of the modulus: band where the catalogue has none, and beyond a band where a fit is refused [-]."""
UNITS = {
    "raw counts": (2e3, np.inf),
    "millinewtons": (1e3, 1e3),
    "grams": (1.0 / 9.80665e-3, 1.0 / 9.80665e-3),
    "ounces": (3.597, 3.597),
    "pounds": (0.22481, 0.22481),
    "kilograms": (1.0 / 9.80665, 1.0 / 9.80665),
    "kilonewtons": (1e-3, 1e-3),
}
"""Least and largest number of these units in a newton; raw counts have any."""
PLATEAU = 3
MOVED_SHARE = 0.15
"""Change of the elastic force over a plateau, over its largest, above which the tip moves [-]."""
CUT_SHARE = 0.5
"""Share of samples at rest that have the least force, if the amplifier cuts off below [-]."""
LARGEST_MISFIT = 0.05
"""Largest root mean square of the residuals in contact over that of the force [-]."""
LARGE_DRIFT = 0.05
"""Change of the tare over the largest force that is reported [-]."""


def require_motion(path: TipPath) -> None:
    """Refuse presses whose positions are not recorded while the tip moves, if they are the most.

    Raises
    ------
    InputError : between two rows of most presses the tip moves, and they are more than `LONGEST_GAP_S` apart.
    """
    presses = spans(path)
    gaps = [gap for begin, end, _ in presses if (gap := largest_gap(path, begin, end))[0] > LONGEST_GAP_S]
    if 2 * len(gaps) <= len(presses):
        return
    gap_s, moved_mm = max(gaps)
    raise InputError(
        f"{len(gaps)} of {len(presses)} presses have no position while the tip moves (by {moved_mm:.2g} mm within "
        f"{gap_s:.2g} s), so the force cannot be compared; record the stage's positions also while it moves, at least "
        f"every {LONGEST_GAP_S:g} s, and join them with --stage"
    )


def band_mpa(design: SensorDesign) -> tuple[float, float]:
    """Least and largest modulus that the material is expected to have [MPa]."""
    said = modulus(design)
    low = said.value / SILENT_FACTOR if said.low is None else said.low
    high = said.value * SILENT_FACTOR if said.high is None else said.high
    return low, high


def modulus_notes(design: SensorDesign, interval_mpa: tuple[float, float]) -> tuple[str, ...]:
    """A warning if the 95 % interval of a fitted modulus [MPa] is outside the material's band.

    Raises
    ------
    InputError : it is outside by more than a factor of 1.5; with the likely cause.
    """
    low, high = band_mpa(design)
    least, most = interval_mpa
    if low <= most and least <= high:
        return ()
    fitted = (max(least, 0.0) + most) / 2
    over = fitted / modulus(design).value
    said = (
        f"the fitted modulus, {fitted:.3g} MPa, is {over:.3g} times the design's; expected are {low:.3g} to "
        f"{high:.3g} MPa"
    )
    if low / REFUSED_FACTOR <= most and least <= high * REFUSED_FACTOR:
        return (
            f"warning: {said}; was the elastomer mixed or cured in another way, or is the load cell's scale wrong?",
        )
    units = [name for name, (few, many) in UNITS.items() if low <= fitted / few and fitted / many <= high]
    cause = (
        f"is the force in {' or '.join(units)} and not in newtons, as its column says? Name the column by its unit"
        if units
        else "is the load cell calibrated, the log this recording's, and the tip the design's? If the elastomer is "
        "softer or harder, give elastomer.youngs_modulus_mpa or mixing_ratio"
    )
    raise InputError(f"{said}, and a factor of {REFUSED_FACTOR:g} beyond is refused; {cause}")


def unsaturated(windows: list[PressWindow], noise_n: float) -> tuple[list[PressWindow], tuple[str, ...]]:
    """The presses without samples at the end of the load cell's range, and a note on the others.

    Parameters
    ----------
    noise_n : standard deviation of the force at rest [N]

    Raises
    ------
    InputError : the least force at rest is the end of the range.
    """
    if not windows:
        return [], ()
    _require_uncut(windows)
    force_n = np.concatenate([one.force_n for one in windows])
    top, step_n = float(force_n.max()), _resolution_n(force_n)
    plateaus = [_plateau(one.force_n == top) for one in windows]
    moved = [
        np.ptp(_expected_n(one)[flat]) / one.table_n.max() > MOVED_SHARE if flat.any() else False
        for one, flat in zip(windows, plateaus, strict=True)
    ]
    if not any(flat.any() for flat in plateaus) or not (noise_n > step_n or any(moved)):
        return windows, ()
    kept = [one for one, flat in zip(windows, plateaus, strict=True) if not flat.any()]
    count = len(windows) - len(kept)
    return kept, (
        f"{count} of {len(windows)} presses left out: their force stays at exactly {top:.4g} N, the end of the load "
        "cell's range; press less deep, or lower the amplifier's gain",
    )


def _require_uncut(windows: list[PressWindow]) -> None:
    force_n = np.concatenate([one.force_n for one in windows])
    rests = np.concatenate([np.concatenate(one.at_rest_n) for one in windows])
    holds = np.concatenate([np.diff(one.force_n[one.is_held]) for one in windows])
    noise_n = float(np.median(np.abs(holds))) if holds.size else 0.0
    share = float(np.mean(rests == force_n.min()))
    if share > CUT_SHARE and noise_n > 2.0 * _resolution_n(force_n):
        raise InputError(
            f"{share:.0%} of the forces at rest are exactly {force_n.min():.4g} N, the least of the log, though held "
            "forces fluctuate: the load cell or its amplifier cuts off below, so no tare is known; preload the cell, "
            "or shift its zero"
        )


def _resolution_n(force_n: FloatArray) -> float:
    values = np.unique(force_n)
    return float(np.diff(values).min()) if len(values) > 1 else 0.0


def _expected_n(window: PressWindow) -> FloatArray:
    depth = np.interp(window.time_s, window.node_s, window.node_mm)
    return window.elastic_n(np.maximum(depth, 0.0))


def _plateau(same: BoolArray) -> BoolArray:
    """(sample,) whether a sample is in a run of at least `PLATEAU`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8))).reshape(-1, 2)
    found = np.zeros(len(same), dtype=bool)
    for begin, end in edges:
        found[begin:end] = end - begin >= PLATEAU
    return found


def require_misfit(windows: list[PressWindow], rests: list[FloatArray], models: list[FloatArray]) -> None:
    """Refuse a fit whose force does not follow the presses.

    Parameters
    ----------
    rests, models : measured less fitted force, and fitted force, at the samples of each window [N]

    Raises
    ------
    InputError : the residuals in contact are above 5 % of the force.
    """
    rest, model = (
        np.concatenate([part[one.used] for one, part in zip(windows, parts, strict=True)])
        for parts in (rests, models)
    )
    touched = model > 0.0
    rms_n, force_n = (
        float(np.sqrt(np.mean(part[touched] ** 2))) if touched.any() else 0.0 for part in (rest, model)
    )
    if rms_n <= LARGEST_MISFIT * force_n:
        return
    raise InputError(
        f"the force does not follow the presses: it is off by {rms_n:.3g} N (rms) of {force_n:.3g} N, and above "
        f"{LARGEST_MISFIT:.0%} no modulus is fitted; is it this recording's log, and does the recording have the "
        "positions while the tip moves? If they were set by hand or logged at rest only, record the stage's positions "
        "all the time and join them with --stage"
    )


def tare_notes(windows: list[PressWindow]) -> tuple[str, ...]:
    """A note if the force at rest drifts by more than 5 % of the largest force over the recording."""
    levels = [float(np.median(np.concatenate(one.at_rest_n))) for one in windows]
    top = max(float(one.force_n.max()) - level for one, level in zip(windows, levels, strict=True))
    drift = max(levels) - min(levels)
    if drift <= LARGE_DRIFT * top:
        return ()
    return (
        f"the force at rest drifts by {drift:.3g} N over the recording ({drift / top:.0%} of the largest force); it is "
        "subtracted press by press",
    )
