"""What a calibration determined and what it could not, as numbers and in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from design.arrays import FloatArray
from sims.learning.calibration.build import Calibration
from sims.learning.calibration.unknowns import Unknown

DETERMINED = 0.5
"""A parameter, or a combination, counts as determined if its spread fell to this share of the doubt before, or less."""
NAMED = 0.3
"""Parameters with at least this share of a combination are named in it."""
GOOD_RMS = 2.0
"""Residuals above this many standard deviations say that the model does not explain the build."""


@dataclass(frozen=True, kw_only=True)
class FittedValue:
    """One parameter before and after.

    Attributes
    ----------
    path, unit : dotted path of the design
    before, before_spread : the design's value, and the spread of its doubt
    after, after_spread : fitted value and its standard deviation
    at_end : whether the fit stopped at an end of the doubt
    """

    path: str
    unit: str
    before: float
    before_spread: float
    after: float
    after_spread: float
    at_end: bool

    @property
    def share_left(self) -> float:
        """Spread after over spread before [-]."""
        return self.after_spread / self.before_spread

    @property
    def is_determined(self) -> bool:
        """Whether the data say more than the doubt did."""
        return self.share_left <= DETERMINED


@dataclass(frozen=True, kw_only=True)
class CalibrationReport:
    """A calibration in numbers and words.

    Attributes
    ----------
    values : one a parameter
    undetermined : sentences, the least determined combination first
    notes : what else to know, as sentences
    rms_before, rms_after : residuals in standard deviations [-]
    """

    values: tuple[FittedValue, ...]
    undetermined: tuple[str, ...]
    notes: tuple[str, ...]
    rms_before: float
    rms_after: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "values": [vars(one) | {"share_left": one.share_left} for one in self.values],
            "undetermined": list(self.undetermined),
            "notes": list(self.notes),
            "rms_before": self.rms_before,
            "rms_after": self.rms_after,
        }

    @property
    def lines(self) -> list[str]:
        """For people."""
        rows = [
            f"{one.path:<52} {one.before:9.4g} -> {one.after:9.4g} +- {one.after_spread:.2g} {one.unit}"
            f"{'' if one.is_determined else '   (not determined)'}"
            for one in self.values
        ]
        head = f"residuals  {self.rms_before:.1f} -> {self.rms_after:.1f} standard deviations"
        return [head, *rows, *self.undetermined, *self.notes]


def report_of(found: Calibration) -> CalibrationReport:
    """What a calibration amounts to."""
    fit = found.fitted
    rows = zip(found.unknowns, found.values, found.deviations, strict=True)
    before, after = fit.rms
    return CalibrationReport(
        values=tuple(
            FittedValue(
                path=one.path,
                unit=one.unit,
                before=one.value,
                before_spread=one.spread,
                after=float(value),
                after_spread=float(deviation),
                at_end=bool(min(value - one.low, one.high - value) < 1e-6 * (one.high - one.low)),
            )
            for one, value, deviation in rows
        ),
        undetermined=undetermined(found.unknowns, fit.covariance),
        notes=tuple(_notes(found, after)),
        rms_before=before,
        rms_after=after,
    )


def undetermined(unknowns: Sequence[Unknown], covariance: FloatArray) -> tuple[str, ...]:
    """Combinations of parameters that the data leave open, in plain words, the widest first.

    Parameters
    ----------
    covariance : (unknown, unknown) of the parameters in spreads of their doubt: the unit matrix tells nothing
    """
    variance, vectors = np.linalg.eigh(covariance)
    said = []
    for axis in np.argsort(-variance):
        spread = float(np.sqrt(variance[axis]))
        if spread <= DETERMINED:
            break
        said.append(
            f"not determined: {_combination(unknowns, vectors[:, axis])} "
            f"(known to {100 * min(spread, 1.0):.0f} % of the doubt before)"
        )
    return tuple(said)


def _combination(unknowns: Sequence[Unknown], vector: FloatArray) -> str:
    order = np.argsort(-np.abs(vector))
    named = [k for k in order if abs(vector[k]) >= NAMED] or [order[0]]
    if len(named) == 1:
        return str(unknowns[named[0]].words)
    lead = np.sign(vector[named[0]])
    parts = [f"{unknowns[k].words} {'more' if np.sign(vector[k]) == lead else 'less'}" for k in named]
    return " with ".join([parts[0], ", ".join(parts[1:])])


def _notes(found: Calibration, rms_after: float) -> list[str]:
    ends = [
        one.path
        for one, value in zip(found.unknowns, found.values, strict=True)
        if min(value - one.low, one.high - value) < 1e-6 * (one.high - one.low)
    ]
    notes = [
        "deviations hold as far as the light model does; what it leaves out is in them as 0.4 % of a signal "
        "(docs/how-to/calibrate.md)"
    ]
    if ends:
        notes.append(
            f"at an end of its doubt: {', '.join(ends)}; if the build may lie beyond, widen it in [tolerances]"
        )
    if rms_after > GOOD_RMS:
        notes.append(
            f"the fit leaves {rms_after:.1f} standard deviations; something of this build is not in the model: compare "
            "with `optopad driver check`, or train on more data instead"
        )
    zero = float(np.mean(found.fitted.offset_mm[:, 2]))
    if abs(zero) >= 0.03:
        notes.append(
            f"the tip is {abs(zero):.2f} mm {'deeper' if zero > 0.0 else 'less deep'} than the stage says, on average "
            "over the presses"
        )
    return notes
