"""The result of a comparison of designs: the fields in which they differ, and the figures of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from design.spec import SensorDesign
from optopad.results.shown import Result, block, number, picture, table
from sims.score.sweep import SweepRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDEST = 26
"""Largest number of characters of a field's value in a table; longer values are cut."""
Better = Literal["lower", "higher", ""]


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One figure (such as the deadband) of all compared designs.

    Attributes
    ----------
    name, unit : name and unit of the figure
    better : "higher" or "lower"; "" if neither is better
    values : value for each design; None if a design does not have the figure
    uncertainty : uncertainty for each design, in the unit of the figure
    winner : index of the design that is better than all others by more than the uncertainties; None if there is none
    """

    name: str
    unit: str
    better: Better
    values: tuple[float | None, ...]
    uncertainty: tuple[float, ...]
    winner: int | None

    @property
    def title(self) -> str:
        """Name and unit of the figure, as text."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def shown(self, place: int) -> str:
        """The value of the design with index `place`, with its uncertainty, as text."""
        value, spread = self.values[place], self.uncertainty[place]
        if value is None:
            return "open" if self.name == "mode gap" else "-"
        return f"{value:.4g} ± {spread:.1g}" if spread else f"{value:.4g}"

    def cells(self) -> list[str]:
        """The values of all designs as text; a star marks the winner."""
        return [self.shown(k) + (" *" if k == self.winner else "") for k in range(len(self.values))]


@dataclass(frozen=True, kw_only=True, repr=False)
class Comparison(Result):
    """Result of a comparison of designs.

    Attributes
    ----------
    labels, digests : name and digest of each design; all others are compared with the first one
    rows : score of each design, and its signal curve in the plot
    changes : fields in which the designs differ, as a mapping from dotted path to the value in each design
    measures : figures of all designs
    winner_of_verdict : index of the only design without a deadband; None otherwise, or if a verdict is undecided
    folder, stem : folder of the written comparison, and its file name without suffix
    """

    labels: tuple[str, ...]
    digests: tuple[str, ...]
    rows: tuple[SweepRow, ...]
    changes: dict[str, tuple[Any, ...]]
    measures: tuple[Measure, ...]
    folder: Path
    stem: str

    @property
    def winner_of_verdict(self) -> int | None:
        """Index of the only design without a deadband.

        None if several designs or none have no deadband, or if any verdict is undecided.
        """
        if any(row.score["is_open"] for row in self.rows):
            return None
        safe = [number for number, row in enumerate(self.rows) if row.score["verdict"] == "CONTIGUOUS"]
        return safe[0] if len(safe) == 1 else None

    @property
    def verdicts(self) -> dict[str, str]:
        """Verdict of each design by its name."""
        return {label: row.score["verdict"] for label, row in zip(self.labels, self.rows, strict=True)}

    @property
    def headlines(self) -> dict[str, str]:
        """Verdict of each design in the words of `optopad score`, by its name."""
        return {label: row.headline for label, row in zip(self.labels, self.rows, strict=True)}

    @property
    def winners(self) -> dict[str, str]:
        """Name of the best design by each figure, if it is better than all others by more than the uncertainties."""
        return {one.name: self.labels[one.winner] for one in self.measures if one.winner is not None}

    def plot(self) -> Figure:
        """Plot of signal against depth, one panel per design."""
        from sims.plots.style import plain_style
        from sims.plots.sweep import plot_sweep

        with plain_style():
            return plot_sweep("designs", self.rows)

    def lines(self) -> list[str]:
        """The comparison as text: designs, differences, figures; a star marks a winner."""
        labels = [shown_value(label) for label in self.labels]
        verdicts = [
            row.headline + (" *" if number == self.winner_of_verdict else "")
            for number, row in enumerate(self.rows)
        ]
        rows = [["", *labels], *([path, *map(shown_value, values)] for path, values in self.changes.items())]
        rows += [["", *[""] * len(labels)], ["verdict", *verdicts]]
        rows += [[one.title, *one.cells()] for one in self.measures]
        reasons = [
            f"{label}: {row.score['reason']}"
            for label, row in zip(self.labels, self.rows, strict=True)
            if row.score["reason"]
        ]
        return [
            *_aligned(rows),
            *reasons,
            "** better than every other design by more than the sum of both uncertainties",
        ]

    def _repr_html_(self) -> str:
        rows = [
            (f"{one.name}, {one.unit}".rstrip(", "), *(number(value, 3) for value in one.values))
            for one in self.measures
        ]
        rows = [("verdict", *self.headlines.values()), *rows]
        return block("comparison", (), table(("", *self.labels), rows), picture(self.plot, "compare"))

    def to_json(self) -> dict[str, Any]:
        """The comparison as plain data for JSON."""
        return {
            "designs": [
                {
                    "label": label,
                    "digest": digest,
                    "verdict": row.score["verdict"],
                    "headline": row.headline,
                    "usable_depth_mm": row.score["usable_depth_mm"],
                    "is_open": row.score["is_open"],
                    "reason": row.score["reason"],
                }
                for label, digest, row in zip(self.labels, self.digests, self.rows, strict=True)
            ],
            "changes": [{"path": path, "values": list(values)} for path, values in self.changes.items()],
            "measures": [
                {
                    "name": one.name,
                    "unit": one.unit,
                    "better": one.better,
                    "values": list(one.values),
                    "uncertainty": list(one.uncertainty),
                    "winner": None if one.winner is None else self.labels[one.winner],
                }
                for one in self.measures
            ],
            "verdict_winner": None if self.winner_of_verdict is None else self.labels[self.winner_of_verdict],
            "files": str(self.folder),
        }


def labelled(designs: Mapping[str, SensorDesign] | Sequence[SensorDesign]) -> dict[str, SensorDesign]:
    """Designs by name; equal names are numbered."""
    if isinstance(designs, Mapping):
        return dict(designs)
    names = [design.name for design in designs]
    alike = len(set(names)) < len(names)
    return {
        f"{name} ({place})" if alike else name: design
        for place, (name, design) in enumerate(zip(names, designs, strict=True), start=1)
    }


def shown_value(value: Any) -> str:
    """A field's value as text, cut if it is long."""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= WIDEST else f"{text[: WIDEST - 3]}..."


def _aligned(table: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[column]) for row in table) for column in range(len(table[0]))]
    return [
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]
