"""The result of a sweep, which scores a design at several values of one field: scores, table, picture."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.results.shown import Result, block, number, picture, table
from sims.score.sweep import SweepRow

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
    taken_up : number of scores that were taken from an interrupted run
    folder : bundle with the table and the picture
    bundles : bundle of each value; empty without ``--build``
    """

    field: str
    rows: tuple[SweepRow, ...]
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

        cells = [table_row(row) for row in self.rows]
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
        document: dict[str, Any] = {"field": self.field, "rows": [row.to_json() for row in self.rows]}
        if self.bundles:
            document["bundles"] = [str(folder) for folder in self.bundles]
        return document

    def to_csv(self) -> str:
        """The table of the sweep as CSV; undecided or unknown entries are empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([self.field, *COLUMNS])
        for row in self.rows:
            cells = table_row(row)
            writer.writerow(
                [row.value, *("" if cells.get(name) is None else cells[name] for name in COLUMNS)]
            )
        return text.getvalue()

    def plot(self) -> Figure:
        """Plot of signal against depth, one panel per value of the swept field."""
        from sims.plots.style import plain_style
        from sims.plots.sweep import plot_sweep

        with plain_style():
            return plot_sweep(self.field, self.rows)

    def lines(self) -> list[str]:
        """The short table that `optopad sweep` prints."""
        width = max(len(self.field), *(len(str(row.value)) for row in self.rows))
        words = max(len("verdict"), *(len(row.headline) for row in self.rows if row.is_judged), 0)
        lines = [
            f"{self.field:<{width}}  {'verdict':<{words}}  deadband mm    usable mm  pair   mode 1 mm     mode 2 mm"
            "     gap mm  mode 2 from, N (band)  contin.  even.  untouched"
        ]
        for row in self.rows:
            if not row.is_judged:
                lines.append(f"{row.value!s:<{width}}  {row.score['verdict']}: {row.score['reason']}")
            else:
                lines.append(f"{row.value!s:<{width}}  {row.headline:<{words}}  {_cells(row)}")
        if any(row.is_of_another_pair for row in self.rows):
            lines.append(
                "A pair named after a deadband has that deadband; the other figures are of the pair in column pair."
            )
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

    def _repr_html_(self) -> str:
        rows = [
            (
                str(row.value),
                row.headline,
                number(cell.get("deadband_mm")),
                number(cell.get("usable_depth_mm")),
                number(cell.get("mode_gap_mm")),
            )
            for row, cell in ((row, table_row(row)) for row in self.rows)
        ]
        head = (self.field, "verdict", "deadband, mm", "usable depth, mm", "mode gap, mm")
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


def _cells(row: SweepRow) -> str:
    cells = table_row(row)
    onset, end, gap = (cells[name] for name in ("mode2_onset_mm", "mode2_end_mm", "mode_gap_mm"))
    mode2 = "never" if onset is None else f"{onset:.2f} to {'open' if end is None else f'{end:.2f}'}"
    load = (
        "-"
        if onset is None
        else f"{cells['mode2_onset_n']:.2f} ({cells['mode2_onset_low_n']:.2f}..{cells['mode2_onset_high_n']:.2f})"
    )
    usable = "-" if cells["usable_depth_mm"] is None else f"{cells['usable_depth_mm']:.2f}"
    dead = f"{cells['deadband_mm']:.2f}" + (f" {cells['governing_pair']}" if row.is_of_another_pair else "")
    return (
        f"{dead:<13}  {usable:>9}  {cells['shown_pair']:<6} "
        f"{cells['mode1_start_mm']:.2f} to {cells['mode1_end_mm']:.2f}  {mode2:<12} "
        f"{'open' if gap is None else f'{gap:+.2f}':>6}  {load:<21}  {cells['continuity']:>7.2f}  "
        f"{cells['evenness']:>5.2f}  {cells['untouched_flux']:.3e}"
    )
