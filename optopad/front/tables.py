"""Designs side by side: one field varied, or several designs compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from design.spec import SensorDesign
from optopad.front.shown import block, number, picture, table
from optopad.jobs.sweep import Sweep, sweep_lines, table_row
from optopad.report.compare_page import compare_lines
from optopad.results.comparison import Comparison

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

FIGURES = (
    "deadband_mm",
    "usable_depth_mm",
    "mode_gap_mm",
    "continuity",
    "evenness",
    "untouched_flux",
    "resolvable_steps",
)
"""Figures of a sweep that are numbers."""


def labelled(designs: Mapping[str, SensorDesign] | Sequence[SensorDesign]) -> dict[str, SensorDesign]:
    """Designs by a name each; names that are alike get their number."""
    if isinstance(designs, Mapping):
        return dict(designs)
    names = [design.name for design in designs]
    alike = len(set(names)) < len(names)
    return {
        f"{name} ({place})" if alike else name: design
        for place, (name, design) in enumerate(zip(names, designs, strict=True), start=1)
    }


@dataclass(frozen=True, kw_only=True, repr=False)
class Swept:
    """A design at several values of one field.

    Attributes
    ----------
    found : rows and the folder they were written to (`optopad.jobs.sweep.Sweep`)
    """

    found: Sweep

    @property
    def field(self) -> str:
        """Dotted path of the field."""
        return self.found.path

    @property
    def values(self) -> tuple[Any, ...]:
        """Values of the field, in order."""
        return tuple(row.value for row in self.found.rows)

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Verdict at each value."""
        return tuple(row.score["verdict"] for row in self.found.rows)

    @property
    def headlines(self) -> tuple[str, ...]:
        """Verdict at each value in the words of `optopad score`, with usable depth, and undecided where it is."""
        return tuple(row.headline for row in self.found.rows)

    @property
    def table(self) -> xr.Dataset:
        """Figures over the field's values, whose coordinate has the field's dotted path as its name.

        NaN where a figure does not exist. Lengths in mm, light over emitted power.
        """
        import xarray as xr

        cells = [table_row(row) for row in self.found.rows]
        columns: dict[str, Any] = {
            name: (
                self.field,
                np.array([np.nan if cell.get(name) is None else cell[name] for cell in cells], dtype=float),
            )
            for name in FIGURES
        }
        columns |= {
            "verdict": (self.field, list(self.verdicts)),
            "headline": (self.field, list(self.headlines)),
            "is_open": (self.field, [bool(cell.get("is_open")) for cell in cells]),
        }
        return xr.Dataset(columns, coords={self.field: list(self.values)}, attrs={"field": self.field})

    def to_dict(self) -> dict[str, Any]:
        """The same as `optopad sweep --json`."""
        return self.found.to_json()

    def plot(self) -> Figure:
        """Signal against depth, a panel a value."""
        from sims.plots.style import plain_style
        from sims.plots.sweep import plot_sweep

        with plain_style():
            return plot_sweep(self.field, self.found.rows)

    def __repr__(self) -> str:
        return "\n".join(sweep_lines(self.found))

    def _repr_html_(self) -> str:
        rows = [
            (
                str(row.value),
                row.headline,
                number(cell.get("deadband_mm")),
                number(cell.get("usable_depth_mm")),
                number(cell.get("mode_gap_mm")),
            )
            for row, cell in ((row, table_row(row)) for row in self.found.rows)
        ]
        head = (self.field, "verdict", "deadband, mm", "usable depth, mm", "mode gap, mm")
        return block(f"sweep of {self.field}", (), table(head, rows), picture(self.plot, "sweep"))


@dataclass(frozen=True, kw_only=True, repr=False)
class Compared:
    """Designs side by side.

    Attributes
    ----------
    found : fields that differ, figures, winners (`optopad.results.comparison.Comparison`)
    """

    found: Comparison

    @property
    def verdicts(self) -> dict[str, str]:
        """Verdict of each design by its name."""
        return {
            label: row.score["verdict"] for label, row in zip(self.found.labels, self.found.rows, strict=True)
        }

    @property
    def headlines(self) -> dict[str, str]:
        """Verdict of each design in the words of `optopad score`, by its name."""
        return {label: row.headline for label, row in zip(self.found.labels, self.found.rows, strict=True)}

    @property
    def changes(self) -> dict[str, tuple[Any, ...]]:
        """Fields in which the designs differ: the value in each."""
        return {one.path: one.values for one in self.found.changes}

    @property
    def winners(self) -> dict[str, str]:
        """Figures in which one design beats all others by more than the uncertainties: its name."""
        return {
            one.name: self.found.labels[one.winner] for one in self.found.measures if one.winner is not None
        }

    def to_dict(self) -> dict[str, Any]:
        """The same as `optopad compare --json`."""
        return self.found.to_json()

    def plot(self) -> Figure:
        """Signal against depth, a panel a design."""
        from sims.plots.style import plain_style
        from sims.plots.sweep import plot_sweep

        with plain_style():
            return plot_sweep("designs", self.found.rows)

    def __repr__(self) -> str:
        return "\n".join(compare_lines(self.found))

    def _repr_html_(self) -> str:
        rows = [
            (f"{one.name}, {one.unit}".rstrip(", "), *(number(value, 3) for value in one.values))
            for one in self.found.measures
        ]
        rows = [("verdict", *self.headlines.values()), *rows]
        return block("comparison", (), table(("", *self.found.labels), rows), picture(self.plot, "compare"))
