"""A predicted accuracy: how well touch, place and depth will be told."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from design.spec import SensorDesign
from optopad.results.accuracy import Accuracy, accuracy_lines
from optopad.results.shown import block, number, picture, table

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True, repr=False)
class Prediction:
    """What the paper's collection on this pad would lead to.

    Attributes
    ----------
    design : what was pressed
    found : tables of every model and test set (`optopad.results.accuracy.Accuracy`)
    folder : the bundle, with page, pictures and trained models
    """

    design: SensorDesign
    found: Accuracy
    folder: Path

    @property
    def touch(self) -> xr.DataArray:
        """(learner, depth) share of samples told rightly as touched or untouched [-]."""
        import xarray as xr

        pooled = self.found.pooled()
        depths = [row.depth_mm for row in next(iter(pooled.values())).touch]
        right = [[np.nan if row.right is None else row.right for row in one.touch] for one in pooled.values()]
        return xr.DataArray(
            right, coords={"learner": list(pooled), "depth": depths}, dims=("learner", "depth"), name="touch"
        )

    @property
    def errors(self) -> xr.Dataset:
        """Medians of the location and depth error over (learner, depth) [mm]; NaN where there are no samples."""
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
        """Files of the trained models by learner; the driver reads them."""
        files = {name: self.folder / "sims" / "models" / f"{name}.optomodel" for name in self.found.learners}
        return {name: file for name, file in files.items() if file.is_file()}

    def to_dict(self) -> dict[str, Any]:
        """The same as `optopad predict --json`."""
        return self.found.to_json()

    def plot_errors(self) -> Figure:
        """Errors of place and depth against depth, the bound beside them where it was worked out."""
        from sims.plots.accuracy import plot_errors
        from sims.plots.style import plain_style

        rows = {learner: one.errors for learner, one in self.found.pooled().items()}
        with plain_style():
            return plot_errors(rows, self.found.bound_mm)

    def plot_touch(self) -> Figure:
        """Share of samples told rightly against depth."""
        from sims.plots.accuracy import plot_touch
        from sims.plots.style import plain_style

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
