"""The result of a sweep, which scores a design at several values of one field: scores, table, picture."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.screen.answer import Result, block, picture, table
from optopad.screen.figures import PadFigures, figure_lines
from optopad.sims.score.sweep import SweepRow

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

PAD_COLUMNS = (
    "margin_noise_units",
    "location_bound_mm",
    "depth_bound_mm",
    "detection_force_n",
    "deepest_force_n",
    "unresolved_share",
    "pressable_x_mm",
    "pressable_y_mm",
    "pressable_share",
    "outer_x_mm",
    "outer_y_mm",
    "outer_z_mm",
    "parts",
)
"""Columns with the numbers of `PadFigures`."""
FIGURES = (
    "deadband_mm",
    "usable_depth_mm",
    *PAD_COLUMNS,
    "mode_gap_mm",
    "continuity",
    "evenness",
    "untouched_flux",
    "resolvable_steps",
)
"""Names of the figures in a sweep that are numbers."""


FULL, FINE = "full", "fine"
"""Settings of `optopad score` (`--full`, `--fine`) for repeating scores of neighbouring values that disagree."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Sweep(Result):
    """Scores of a design at several values of one field.

    Attributes
    ----------
    field : dotted path of the field
    rows : scores, in the order of the values
    figures : figures of the design at each value
    taken_up : number of scores that were taken from an interrupted run
    folder : bundle with the table and the picture
    bundles : bundle of each value; empty without ``--build``
    """

    field: str
    rows: tuple[SweepRow, ...]
    figures: tuple[PadFigures, ...]
    taken_up: int
    folder: Path
    bundles: tuple[Path, ...] = ()

    @property
    def values(self) -> tuple[Any, ...]:
        """Values of the swept field, in the order of the request."""
        return tuple(row.value for row in self.rows)

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Verdict at each value of the swept field."""
        return tuple(row.score["verdict"] for row in self.rows)

    @property
    def headlines(self) -> tuple[str, ...]:
        """Verdict and usable depth at each value, in the words of `optopad score`; undecided verdicts are marked."""
        return tuple(row.headline for row in self.rows)

    @property
    def table(self) -> xr.Dataset:
        """Figures as a data set over the values; the coordinate's name is the field's dotted path.

        Figures that do not exist for a value are NaN. Lengths are in mm, and light is a fraction of the emitted power.
        """
        import xarray as xr

        cells = self._cells
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

    def to_json(self) -> dict[str, Any]:
        """The sweep as plain data for JSON."""
        rows = [row.to_json() | one.to_json() for row, one in zip(self.rows, self.figures, strict=True)]
        document: dict[str, Any] = {"field": self.field, "rows": rows}
        if self.bundles:
            document["bundles"] = [str(folder) for folder in self.bundles]
        return document

    def to_csv(self) -> str:
        """The table of the sweep as CSV; undecided or unknown entries are empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([self.field, *COLUMNS])
        for value, cells in zip(self.values, self._cells, strict=True):
            writer.writerow([value, *("" if cells.get(name) is None else cells[name] for name in COLUMNS)])
        return text.getvalue()

    @property
    def _cells(self) -> list[dict[str, Any]]:
        return [table_row(row) | one.csv_columns() for row, one in zip(self.rows, self.figures, strict=True)]

    def plot(self) -> Figure:
        """Plot of signal against depth, one panel per value of the swept field."""
        from optopad.sims.plots.style import plain_style
        from optopad.sims.plots.sweep import plot_sweep

        with plain_style():
            return plot_sweep(self.field, self.rows)

    def lines(self) -> list[str]:
        """The table that `optopad sweep` prints: the figures of each value's design."""
        lines = figure_lines(self.field, [str(value) for value in self.values], self.figures)
        lines += [f"{row.value}: {row.score['reason']}" for row in self.rows if row.score["reason"]]
        for setting in (FULL, FINE):
            if values := ", ".join(str(row.value) for row in self.rows if row.refined == setting):
                lines.append(
                    f"{values}: judged again with the settings of optopad score --{setting}, because neighbouring "
                    "values disagreed"
                )
        if self.taken_up:
            lines.append(
                f"{self.taken_up} of {len(self.rows)} values were computed by an earlier, interrupted sweep"
            )
        return lines

    def screen(self) -> list[str]:
        """The table, the bundles and the files."""
        files = f"files     {self.folder / 'sims'} (sweep-{self.field}: csv, json, svg, png)"
        return [*self.lines(), *(f"bundle    {folder}" for folder in self.bundles), files]

    def _repr_html_(self) -> str:
        cells = [one.cells for one in self.figures]
        rows = [
            (str(value), *(cell.text for cell in row)) for value, row in zip(self.values, cells, strict=True)
        ]
        head = (self.field, *(cell.title for cell in cells[0]))
        return block(f"sweep of {self.field}", (), table(head, rows), picture(self.plot, "sweep"))


COLUMNS = (
    "verdict",
    "headline",
    "reason",
    "governing_pair",
    "deadband_mm",
    "deadbands_from_to_mm",
    "usable_depth_mm",
    "usable_from_mm",
    "usable_to_mm",
    "is_open",
    *PAD_COLUMNS,
    "price",
    "rows_without_price",
    "refined",
    "shown_pair",
    "shown_pair_deadband_mm",
    "possible_deadband_mm",
    "mode1_start_mm",
    "mode1_end_mm",
    "mode2_onset_mm",
    "mode2_end_mm",
    "mode_gap_mm",
    *(
        f"{name}_{end}n"
        for name in ("mode1_start", "mode1_end", "mode2_onset", "mode2_end")
        for end in ("", "low_", "high_")
    ),
    "continuity",
    "evenness",
    "untouched_flux",
    "untouched_flux_error",
    "untouched_counts",
    "swing",
    "resolvable_steps",
)
"""Columns of the table after the column of values.

Columns up to `shown_pair` are figures of the design, later columns those of the pair in the plot. The usable depth also
has the range that the numerical error of the light model causes. Loads are given at both ends of the uncertainty band
of Young's modulus.
"""


def table_row(row: SweepRow) -> dict[str, Any]:
    """One row of the sweep's table, as a mapping from the column's name to the value."""
    score = row.score
    cells: dict[str, Any] = {
        "verdict": score["verdict"],
        "headline": row.headline,
        "reason": score["reason"],
        "refined": row.refined or None,
    }
    if row.curve is None or row.forces_n is None:
        return cells
    pair = row.shown
    least_mm, most_mm = score["usable_range_mm"] or (None, None)
    cells |= {
        "usable_depth_mm": score["usable_depth_mm"],
        "usable_from_mm": least_mm,
        "usable_to_mm": most_mm,
        "is_open": score["is_open"],
        "governing_pair": score["governing_pair"],
        "deadband_mm": score["deadband_mm"]["total"],
        "shown_pair": pair["pair"],
        "shown_pair_deadband_mm": round(sum(end - start for start, end in pair["deadbands_mm"]), 4),
        "possible_deadband_mm": row.possible_deadband_mm,
        "deadbands_from_to_mm": " ".join(f"{a:g}-{b:g}" for a, b in score["deadband_mm"]["intervals"]),
        "mode_gap_mm": pair["mode_gap_mm"],
        "continuity": pair["continuity"],
        "evenness": pair["evenness"],
        "untouched_flux": row.curve.total[0],
        "untouched_flux_error": row.curve.standard_error[0],
        **{name: pair[name] for name in ("untouched_counts", "swing", "resolvable_steps")},
    }
    for mode, names in (("mode1", ("start", "end")), ("mode2", ("onset", "end"))):
        for name, depth in zip(names, pair[f"{mode}_mm"], strict=True):
            cells[f"{mode}_{name}_mm"] = depth
            loads = row.forces_n[f"{mode}_{name}"] or (None, None, None)
            for column, load in zip(("n", "low_n", "high_n"), loads, strict=True):
                cells[f"{mode}_{name}_{column}"] = load
    return cells
