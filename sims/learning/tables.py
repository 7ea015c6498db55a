"""The paper's tables: share of touches detected, and errors of location and of depth, each by depth.

Touch is the share of samples at a depth that are classified correctly: as untouched below 0 mm, as touched from 0 mm
on. Errors are the median, mean and standard deviation of the distance in x and y, and of the absolute error of depth.
They are stated for all samples in contact at a depth (the regressor alone), and for the samples that the model also
detects. Standard errors come from resampling locations and sessions, not samples: press and retraction at one location
have similar signals, and all presses of a session share drift and reference depth. With a single session the standard
error leaves out differences between sessions.

`needed_samples` selects the samples that tables and pictures use. `JudgedPresses` are samples with a model's
predictions. `published_touch` is a sensor's published touch detection, for comparison. Its table rows for untouched
samples set a limit to the assumed noise of the signal chain (`optopad.design.spec.sensor`), so they are not an
independent test; nothing is fitted to the other table rows.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.learning.inference.touch_model import Prediction
from optopad.sims.press import place_numbers
from optopad.sims.readings.press_data import PressData


def needed_samples(data: PressData, places_mm: FloatArray) -> PressData:
    """Select all samples at the depths of the tables, and all samples of the presses nearest to given locations.

    Parameters
    ----------
    places_mm : (place, 2) x, y of locations for which a picture shows depth sample by sample [mm]
    """
    depth_mm = data.press_mm[:, 2]
    wanted = np.zeros(len(data), dtype=np.bool_)
    for row in _all_depths():
        wanted |= np.abs(depth_mm - row) <= DEPTH_TOLERANCE_MM
    number = data.press_numbers()
    for place in places_mm:
        nearest = int(np.hypot(*(data.press_mm[:, :2] - place).T).argmin())
        wanted |= number == number[nearest]
    return data.only(wanted)


def _all_depths() -> Sequence[float]:
    return sorted({*TOUCH_DEPTHS_MM, *ERROR_DEPTHS_MM})


DEPTH_TOLERANCE_MM = 0.04
"""A sample belongs to a table row if their depths differ by at most this [mm]; schedules have steps of 0.1 mm."""


@dataclass(frozen=True, kw_only=True)
class JudgedPresses:
    """Samples, with one model's prediction for each.

    Attributes
    ----------
    press_mm : (n, 3) x, y, depth as the stage reported them [mm]; depths of 0 and more count as touched
    said_mm : (n, 3) x, y, depth that the model predicts, whether it detects a touch or not [mm]
    is_found : (n,) whether the model detects a touch
    place_number : (n,) number of each sample's location; samples at one location share errors
    session_number : (n,) number of each sample's session (one set of one simulated draw); samples of one session share
        drift and reference depth
    """

    press_mm: FloatArray
    said_mm: FloatArray
    is_found: BoolArray
    place_number: IntArray
    session_number: IntArray

    @property
    def is_touched(self) -> BoolArray:
        """Mask (n,) of the samples whose tip was at the surface or below it."""
        return np.asarray(self.press_mm[:, 2] >= 0.0)

    @property
    def false_alarms(self) -> float | None:
        """Share of the untouched samples that the model classifies as touched [-]; None if there are none."""
        quiet = self.is_found[~self.is_touched]
        return float(quiet.mean()) if len(quiet) else None

    @property
    def location_error_mm(self) -> FloatArray:
        """Distances (n,) in x and y between the predicted location and the one that the stage reported [mm]."""
        return np.asarray(np.hypot(*(self.said_mm - self.press_mm)[:, :2].T))

    @property
    def depth_error_mm(self) -> FloatArray:
        """Absolute differences (n,) between the predicted depth and the one that the stage reported [mm]."""
        return np.asarray(np.abs(self.said_mm[:, 2] - self.press_mm[:, 2]))

    def at_depth(self, depth_mm: float) -> JudgedPresses:
        """The samples at the depth of one table row."""
        return self.only(np.abs(self.press_mm[:, 2] - depth_mm) <= DEPTH_TOLERANCE_MM)

    def only(self, chosen: BoolArray) -> JudgedPresses:
        """The samples that a mask (n,) selects."""
        return JudgedPresses(**{one.name: getattr(self, one.name)[chosen] for one in fields(self)})

    def __len__(self) -> int:
        return len(self.press_mm)


def judged(data: PressData, said: Prediction) -> JudgedPresses:
    """Combine a model's predictions with the samples of a data set.

    Raises
    ------
    InputError : the numbers of predictions and samples differ.
    """
    if len(said.press_mm) != len(data.press_mm):
        raise InputError(
            f"prediction: {len(said.press_mm)} rows for {len(data.press_mm)} samples; predict all"
        )
    return JudgedPresses(
        press_mm=np.asarray(data.press_mm, dtype=np.float64),
        said_mm=np.asarray(said.press_mm, dtype=np.float64),
        is_found=np.asarray(said.is_touched, dtype=bool),
        place_number=place_numbers(data.press_mm[:, :2]),
        session_number=np.asarray(np.unique(data.set_number, return_inverse=True)[1], dtype=np.int64),
    )


def joined(parts: Sequence[JudgedPresses]) -> JudgedPresses:
    """Join the samples of several data sets or draws. Sessions remain separate; equal locations get the same number."""
    press_mm = np.concatenate([part.press_mm for part in parts])
    shifts = np.cumsum([0, *(int(part.session_number.max(initial=-1)) + 1 for part in parts[:-1])])
    return JudgedPresses(
        press_mm=press_mm,
        said_mm=np.concatenate([part.said_mm for part in parts]),
        is_found=np.concatenate([part.is_found for part in parts]),
        place_number=place_numbers(press_mm[:, :2]),
        session_number=np.concatenate(
            [part.session_number + shift for part, shift in zip(parts, shifts, strict=True)]
        ),
    )


@dataclass(frozen=True, kw_only=True)
class PublishedTouch:
    """A published table of touch detection by depth.

    Attributes
    ----------
    source : citation of the table
    depth_mm : depths of its table rows [mm]
    ambient, dark : shares of samples classified correctly at these depths, in ambient light and in the dark [-]
    """

    source: str
    depth_mm: tuple[float, ...]
    ambient: tuple[float, ...]
    dark: tuple[float, ...]

    def right(self, depth_mm: float, *, is_ambient: bool) -> float | None:
        """Share of samples classified correctly at one depth [-]; None if the table does not have this depth."""
        rows = self.ambient if is_ambient else self.dark
        return next(
            (share for at, share in zip(self.depth_mm, rows, strict=True) if abs(at - depth_mm) < 1e-9), None
        )


def published_touch(design: SensorDesign) -> PublishedTouch | None:
    """The published table for the sensor of a packaged design; None for any other design, including a changed one."""
    text = (files("optopad.sims.learning") / "touch_success.toml").read_text(encoding="utf-8")
    found = tomllib.loads(text).get(design.name)
    if found is None or design.digest != preset(design.name).digest:
        return None
    return PublishedTouch(
        source=found["source"],
        depth_mm=tuple(found["depth_mm"]),
        ambient=tuple(found["ambient"]),
        dark=tuple(found["dark"]),
    )


TOUCH_DEPTHS_MM = (-0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
ERROR_DEPTHS_MM = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)
"""Depths of the rows of the paper's error tables [mm]."""

RESAMPLES = 200
"""Number of bootstrap draws: with 200, the standard error itself is known to 5 %."""

WITHIN_MM = 0.5
"""Depth error below which a sample counts in `ErrorRow.within` [mm], as in the paper."""


@dataclass(frozen=True, kw_only=True)
class TouchRow:
    """Touch detection at one depth.

    Attributes
    ----------
    depth_mm : depth of the tip [mm]
    right : share of the samples classified correctly [-]; None if there are no samples
    right_error : standard error of `right` [-]; None if there is only one location
    samples, presses : number of samples, and number of different locations
    """

    depth_mm: float
    right: float | None
    right_error: float | None
    samples: int
    presses: int


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Median, mean, standard deviation and 95th percentile of an error, and the standard error of the median [mm]."""

    median: float
    mean: float
    deviation: float
    p95: float
    median_error: float


@dataclass(frozen=True, kw_only=True)
class ErrorRow:
    """Errors of location and depth at one depth.

    Attributes
    ----------
    depth_mm : depth of the tip [mm]
    found : share of the samples that the model classifies as touched [-]
    within : share of the samples whose depth is estimated to within `WITHIN_MM` [-]
    location, depth : errors of all samples in contact [mm]; None if there are none
    found_location, found_depth : errors of those samples in contact that the model detects [mm]; None if it detects
        none
    samples, presses : number of samples, and number of different locations
    """

    depth_mm: float
    found: float
    within: float
    location: Spread | None
    depth: Spread | None
    found_location: Spread | None
    found_depth: Spread | None
    samples: int
    presses: int


def touch_rows(presses: JudgedPresses, depths_mm: Sequence[float] = TOUCH_DEPTHS_MM) -> tuple[TouchRow, ...]:
    """Rows of the touch table: share of samples classified correctly at each depth [mm]."""
    return tuple(_touch_row(presses.at_depth(depth), depth) for depth in depths_mm)


def error_rows(
    presses: JudgedPresses, depths_mm: Sequence[float] = ERROR_DEPTHS_MM, *, seed: int = 0
) -> tuple[ErrorRow, ...]:
    """Rows of the error table: errors of location and depth, by depth [mm]; `seed` is for the bootstrap."""
    return tuple(_error_row(presses.at_depth(depth), depth, seed) for depth in depths_mm)


def _touch_row(at_depth: JudgedPresses, depth_mm: float) -> TouchRow:
    count = len(np.unique(at_depth.place_number))
    if not len(at_depth):
        return TouchRow(depth_mm=depth_mm, right=None, right_error=None, samples=0, presses=0)
    is_right = (at_depth.is_found == (depth_mm >= 0.0)).astype(np.float64)
    error = _resampled(is_right, at_depth, _weighted_mean, 0) if count > 1 else None
    return TouchRow(
        depth_mm=depth_mm,
        right=float(is_right.mean()),
        right_error=error,
        samples=len(at_depth),
        presses=count,
    )


def _error_row(at_depth: JudgedPresses, depth_mm: float, seed: int) -> ErrorRow:
    found = at_depth.only(at_depth.is_found)
    count = len(at_depth)
    return ErrorRow(
        depth_mm=depth_mm,
        found=float(at_depth.is_found.mean()) if count else 0.0,
        within=float((at_depth.depth_error_mm <= WITHIN_MM).mean()) if count else 0.0,
        location=_spread(at_depth.location_error_mm, at_depth, seed),
        depth=_spread(at_depth.depth_error_mm, at_depth, seed),
        found_location=_spread(found.location_error_mm, found, seed),
        found_depth=_spread(found.depth_error_mm, found, seed),
        samples=count,
        presses=len(np.unique(at_depth.place_number)),
    )


def _spread(error_mm: FloatArray, presses: JudgedPresses, seed: int) -> Spread | None:
    if not error_mm.size:
        return None
    return Spread(
        median=float(np.median(error_mm)),
        mean=float(error_mm.mean()),
        deviation=float(error_mm.std()),
        p95=float(np.percentile(error_mm, 95.0)),
        median_error=_resampled(error_mm, presses, _weighted_median, seed),
    )


def _resampled(
    values: FloatArray,
    presses: JudgedPresses,
    statistic: Callable[[FloatArray, FloatArray], float],
    seed: int,
) -> float:
    """Standard error of a statistic of (n,) values and weights, by bootstrap over locations and sessions."""
    rng = np.random.default_rng(seed)
    places = np.unique(presses.place_number, return_inverse=True)[1].reshape(-1)
    sessions = np.unique(presses.session_number, return_inverse=True)[1].reshape(-1)
    found = []
    for _ in range(RESAMPLES):
        weight = _drawn(places, rng)
        if sessions.max() > 0:
            weight = weight * _drawn(sessions, rng)
        if weight.any():
            found.append(statistic(values, weight))
    return float(np.std(found))


def _drawn(groups: NDArray[np.intp], rng: np.random.Generator) -> FloatArray:
    """How often each sample's group is drawn (n,) in one bootstrap draw of the groups, with replacement."""
    count = int(groups.max()) + 1
    drawn = np.bincount(rng.integers(count, size=count), minlength=count)
    return np.asarray(drawn[groups], dtype=np.float64)


def _weighted_mean(values: FloatArray, weight: FloatArray) -> float:
    return float((values * weight).sum() / weight.sum())


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values)
    share = np.cumsum(weight[order])
    return float(values[order][np.searchsorted(share, 0.5 * share[-1])])


def touch_json(rows: Sequence[TouchRow]) -> list[dict[str, Any]]:
    """Rows of the touch table as plain data for JSON."""
    return [
        {
            "depth_mm": row.depth_mm,
            "right": row.right,
            "right_error": row.right_error,
            "samples": row.samples,
            "presses": row.presses,
        }
        for row in rows
    ]


def error_json(rows: Sequence[ErrorRow]) -> list[dict[str, Any]]:
    """Rows of the error table as plain data for JSON; unknown values are null."""
    return [
        {
            "depth_mm": row.depth_mm,
            "found": row.found,
            f"depth_within_{WITHIN_MM:g}_mm": row.within,
            "location_mm": _spread_json(row.location),
            "depth_error_mm": _spread_json(row.depth),
            "found_location_mm": _spread_json(row.found_location),
            "found_depth_error_mm": _spread_json(row.found_depth),
            "samples": row.samples,
            "presses": row.presses,
        }
        for row in rows
    ]


def _spread_json(spread: Spread | None) -> dict[str, float] | None:
    if spread is None:
        return None
    return {
        "median": spread.median,
        "median_error": spread.median_error,
        "mean": spread.mean,
        "deviation": spread.deviation,
        "p95": spread.p95,
    }
