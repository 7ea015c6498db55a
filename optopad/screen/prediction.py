"""The result of a prediction or evaluation: errors of touch, location and depth by model and test set, with bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.spec import SensorDesign
from optopad.screen.answer import block, number, picture, table
from optopad.sims.learning.after_release import FoundAgain
from optopad.sims.learning.inference.signal_map import KIND as SIGNAL_MAP
from optopad.sims.learning.tables import (
    ErrorRow,
    JudgedPresses,
    PublishedTouch,
    Spread,
    TouchRow,
    error_json,
    error_rows,
    joined,
    touch_json,
    touch_rows,
)
from optopad.sims.two_touch_errors import TwoTouchErrors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FALSE_ALARM_LIMIT = 0.05
"""Fraction of untouched frames that are classified as touched, above which a finding is reported [-]."""
LEAST_FOUND = 0.95
"""Fraction of presses 1 mm deep that are detected as touch, below which a finding is reported [-]."""


@dataclass(frozen=True, kw_only=True)
class ModelAccuracy:
    """Accuracy of one model on one test set.

    Attributes
    ----------
    learner : kind of the model, such as `kernel-ridge`
    test_set : name of the test set
    is_ambient : whether the test set was recorded in ambient light
    presses : true presses and the model's estimates
    touch, errors : tables of the classification of touch, and of the errors of location and depth
    """

    learner: str
    test_set: str
    is_ambient: bool
    presses: JudgedPresses
    touch: tuple[TouchRow, ...]
    errors: tuple[ErrorRow, ...]

    @property
    def title(self) -> str:
        """Names of the model and of the test set."""
        return f"{self.learner}, {self.test_set}"


@dataclass(frozen=True, kw_only=True)
class PredictedAccuracy:
    """Accuracy of all models on all test sets.

    Attributes
    ----------
    name, digest : name and digest of the design; the digest is None if a recording does not contain it
    found : results, ordered by model, then by test set
    bound_mm : Cramér-Rao bounds by depth: standard deviations of location and of depth [mm]. Infinite if the numerical
        error of the light model leaves a bound undecided; empty if no bounds were computed
    published : published figures of the same sensor; None for other sensors
    found_again : for a pad with a memory, when each model finds a touch again after a release
    touches : how well each model of two touches tells them from one
    notes : sentences about the method and its assumptions
    settings : plain data: seeds, protocol, samples
    """

    name: str
    digest: str | None
    found: tuple[ModelAccuracy, ...]
    bound_mm: Mapping[float, tuple[float, float]] = field(default_factory=dict)
    published: PublishedTouch | None = None
    found_again: tuple[FoundAgain, ...] = ()
    touches: tuple[TwoTouchErrors, ...] = ()
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def learners(self) -> tuple[str, ...]:
        """Names of the models, in order."""
        return tuple(dict.fromkeys(one.learner for one in self.found))

    def findings(self) -> tuple[str, ...]:
        """Sentences on depths at which touch is often misclassified, with cause and fix; empty if there are none."""
        return tuple(
            text for learner, one in self.pooled().items() for text in self._findings_of(learner, one)
        )

    def _findings_of(self, learner: str, pooled: ModelAccuracy) -> list[str]:
        made = []
        sets = {
            one.test_set: share
            for one in self.found
            if one.learner == learner and (share := one.presses.false_alarms) is not None
        }
        worst = max(sets, key=lambda name: sets[name], default=None)
        if worst is not None and sets[worst] > FALSE_ALARM_LIMIT:
            made.append(
                f"{learner}: {100.0 * sets[worst]:.0f} % of the untouched frames of {worst} are classified as touched "
                f"(limit {100.0 * FALSE_ALARM_LIMIT:g} %), so its touches are unreliable; the threshold follows from "
                "the differences between the training sets, and this set differs by more; train on more sets"
            )
        last = pooled.touch[-1]
        if last.right is not None and last.right < LEAST_FOUND:
            missed, limit = 100.0 * (1.0 - last.right), 100.0 * (1.0 - LEAST_FOUND)
            made.append(
                f"{learner}: {missed:.0f} % of the presses {last.depth_mm:g} mm deep are classified as untouched "
                f"(limit {limit:.0f} %); {_why_missed(learner)}"
            )
        return made

    def pooled(self) -> dict[str, ModelAccuracy]:
        """Results of each model on all test sets together; the key is the model's name."""
        return {
            learner: accuracy_of(
                learner, "all test sets", True, [one.presses for one in self.found if one.learner == learner]
            )
            for learner in self.learners
        }

    def to_json(self) -> dict[str, Any]:
        """The accuracy as plain data; `touch` and `errors` are the first model's results over all test sets."""
        pooled = self.pooled()
        first = next(iter(pooled.values()))
        return {
            "name": self.name,
            "digest": self.digest,
            **self.settings,
            "learner": first.learner,
            "touch": [self._touch_line(row) for row in touch_json(first.touch)],
            "errors": [_medians(row) for row in first.errors],
            "false_alarms": first.presses.false_alarms,
            "false_alarm_limit": FALSE_ALARM_LIMIT,
            "findings": list(self.findings()),
            "learners": [
                {
                    "learner": name,
                    "errors": [_medians(row) for row in one.errors],
                    "false_alarms": one.presses.false_alarms,
                }
                for name, one in pooled.items()
            ],
            "bound_mm": [
                {"depth_mm": depth, "location": _finite(location), "depth": _finite(of_depth)}
                for depth, (location, of_depth) in self.bound_mm.items()
            ],
            "models": [
                {
                    "learner": one.learner,
                    "test_set": one.test_set,
                    "is_ambient": one.is_ambient,
                    "false_alarms": one.presses.false_alarms,
                    "touch": touch_json(one.touch),
                    "errors": error_json(one.errors),
                }
                for one in self.found
            ],
            "published_touch": None if self.published is None else self.published.source,
            **({"found_again": [asdict(one) for one in self.found_again]} if self.found_again else {}),
            **({"touches": [one.to_json() for one in self.touches]} if self.touches else {}),
            "notes": list(self.notes),
        }

    def _touch_line(self, row: dict[str, Any]) -> dict[str, Any]:
        if self.published is None:
            return row
        sides = {"published_ambient": True, "published_dark": False}
        return row | {
            name: self.published.right(row["depth_mm"], is_ambient=side) for name, side in sides.items()
        }


def _why_missed(learner: str) -> str:
    if learner.startswith(SIGNAL_MAP):
        return "at that depth the signals change by little more than the untouched baseline changes from set to set"
    return (
        "touch is decided by one linear plane, and where few pairs cross a location a press changes the "
        f"signals little relative to it; --learner {SIGNAL_MAP} decides by the light model"
    )


def accuracy_of(
    learner: str, test_set: str, is_ambient: bool, presses: Sequence[JudgedPresses]
) -> ModelAccuracy:
    """Accuracy of one model on one test set, from one or several random draws of that set."""
    together = joined(presses)
    return ModelAccuracy(
        learner=learner,
        test_set=test_set,
        is_ambient=is_ambient,
        presses=together,
        touch=touch_rows(together),
        errors=error_rows(together),
    )


def accuracy_lines(found: PredictedAccuracy) -> list[str]:
    """The accuracy as text: findings first, then a table of each model over all test sets together."""
    lines = [f"finding   {text}" for text in found.findings()]
    for learner, one in found.pooled().items():
        lines += [f"{learner}", *_touch_lines(one.touch, found.published), *_error_lines(one.errors, found)]
    return [*lines, *(line for one in found.touches for line in _two_touch_lines(one)), *found.notes]


def _two_touch_lines(found: TwoTouchErrors) -> Iterator[str]:
    yield f"{found.learner}, two touches: share in which both are found, and errors of these, by distance"
    yield "  apart [mm]     [tip radii]    found   location: median 95 %   depth: median 95 % [mm]   frames"
    if not found.rows:
        yield "  no frames of two touches"
    for row in found.rows:
        apart, radii = range_text(row.from_mm, row.to_mm), range_text(*(row.radii(found.radius_mm)))
        sides = [
            f"{'-':>13}" if side is None else f"{side[0]:6.3f} {side[1]:6.3f}"
            for side in (row.location_mm, row.depth_mm)
        ]
        yield f"  {apart:<14} {radii:<13} {row.found:6.1%}   {sides[0]:>23}   {sides[1]:>25}   {row.frames}"
    if found.called is not None:
        none, one, two = found.called
        yield f"  one touch: {one:.1%} called one, {two:.1%} two, {none:.1%} none, of {found.single_frames} frames"


def range_text(low: float, high: float) -> str:
    """A range as text; an infinite end is open."""
    return f"{low:g} to {high:g}" if math.isfinite(high) else f"{low:g} and more"


def _touch_lines(rows: Sequence[TouchRow], published: PublishedTouch | None) -> list[str]:
    head = "  depth [mm]   correct touches" + ("   published: ambient, dark" if published else "")
    lines = [head]
    for row in rows:
        if row.right is None:
            continue
        error = "" if row.right_error is None else f" +- {row.right_error:.2f}"
        beside = ""
        if published is not None:
            both = [published.right(row.depth_mm, is_ambient=side) for side in (True, False)]
            beside = "   " + ", ".join("-" if share is None else f"{share:.2f}" for share in both)
        lines.append(f"  {row.depth_mm:10.1f}   {row.right:.2f}{error:<12}{beside}".rstrip())
    return lines


def _error_lines(rows: Sequence[ErrorRow], found: PredictedAccuracy) -> list[str]:
    bound = "   bound" if found.bound_mm else ""
    lines = [f"  depth [mm]   location: median mean sd{bound}   depth: median mean sd{bound} [mm]   found"]
    for row in rows:
        if row.location is None or row.depth is None:
            continue
        limits = found.bound_mm.get(row.depth_mm)
        sides = [
            f"{_spread(spread)}" + (f"   {bound_text(limits[number])}" if limits else "")
            for number, spread in enumerate((row.location, row.depth))
        ]
        lines.append(f"  {row.depth_mm:10.1f}   {sides[0]}   {sides[1]}   {row.found:.0%}")
    return lines


def _spread(one: Spread) -> str:
    return f"{one.median:.3f} {one.mean:.3f} {one.deviation:.3f}"


def bound_text(bound_mm: float) -> str:
    """A Cramér-Rao bound [mm] as text. An infinite bound is undecided, due to numerical error of the light model."""
    return f"{bound_mm:.3f}" if math.isfinite(bound_mm) else "open"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _medians(row: ErrorRow) -> dict[str, Any]:
    return {
        "depth_mm": row.depth_mm,
        "location_median_mm": None if row.location is None else row.location.median,
        "depth_median_mm": None if row.depth is None else row.depth.median,
        "found": row.found,
    }


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction:
    """The predicted accuracy of a pad whose models are trained on the paper's data collection.

    Attributes
    ----------
    design : the design of the pad
    found : tables of errors for every model and test set
    folder : folder of the bundle with page, pictures and trained models
    """

    design: SensorDesign
    found: PredictedAccuracy
    folder: Path

    @property
    def touch(self) -> xr.DataArray:
        """(learner, depth) fraction of samples that are correctly classified as touched or untouched [-]."""
        import xarray as xr

        pooled = self.found.pooled()
        depths = [row.depth_mm for row in next(iter(pooled.values())).touch]
        right = [[np.nan if row.right is None else row.right for row in one.touch] for one in pooled.values()]
        return xr.DataArray(
            right, coords={"learner": list(pooled), "depth": depths}, dims=("learner", "depth"), name="touch"
        )

    @property
    def errors(self) -> xr.Dataset:
        """Median errors of location and of depth, each (learner, depth) [mm]; NaN where there are no samples."""
        import xarray as xr

        pooled = self.found.pooled()
        depths = [row.depth_mm for row in next(iter(pooled.values())).errors]
        columns = {
            name: (
                ("learner", "depth"),
                [
                    [np.nan if (one := getattr(row, name)) is None else one.median for row in model.errors]
                    for model in pooled.values()
                ],
                {"units": "mm"},
            )
            for name in ("location", "depth")
        }
        columns = {f"{name}_error": column for name, column in columns.items()}
        return xr.Dataset(columns, coords={"learner": list(pooled), "depth": depths})

    @property
    def models(self) -> dict[str, Path]:
        """Files of the trained models by learner, for `optopad.fabrication.driver.touch_reader`."""
        files = {name: self.folder / "sims" / "models" / f"{name}.optomodel" for name in self.found.learners}
        return {name: file for name, file in files.items() if file.is_file()}

    def to_json(self) -> dict[str, Any]:
        """The data that `optopad predict --json` prints."""
        return self.found.to_json()

    to_dict = to_json

    def screen(self) -> list[str]:
        """The tables, and the files."""
        files = f"files     {self.folder / 'sims'} (prediction.html, prediction.json, pictures, models)"
        return [*accuracy_lines(self.found), files]

    def plot_errors(self) -> Figure:
        """Plot of the errors of location and depth against depth, with the bound if it was computed."""
        from optopad.sims.plots.accuracy import plot_errors
        from optopad.sims.plots.style import plain_style

        rows = {learner: one.errors for learner, one in self.found.pooled().items()}
        with plain_style():
            return plot_errors(rows, self.found.bound_mm)

    def plot_touch(self) -> Figure:
        """Plot of the fraction of correctly classified samples against depth."""
        from optopad.sims.plots.accuracy import plot_touch
        from optopad.sims.plots.style import plain_style

        rows = {learner: one.touch for learner, one in self.found.pooled().items()}
        with plain_style():
            return plot_touch(rows, self.found.published)

    def __repr__(self) -> str:
        return "\n".join(accuracy_lines(self.found))

    def _repr_html_(self) -> str:
        errors = self.errors
        rows = [
            (learner, f"{depth:g}", number(float(place)), number(float(of_depth)))
            for learner, places, depths in zip(
                errors.learner.values, errors.location_error.values, errors.depth_error.values, strict=True
            )
            for depth, place, of_depth in zip(errors.depth.values, places, depths, strict=True)
        ]
        head = ("learner", "depth, mm", "location error, mm", "depth error, mm")
        return block(
            f"{self.design.name}: predicted medians",
            (),
            table(head, rows),
            picture(self.plot_errors, "errors"),
        )
