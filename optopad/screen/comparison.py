"""Comparisons: of designs, with the fields in which they differ and the figures of each; and of a recorded press with
the simulated one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from optopad.design.spec import SensorDesign
from optopad.screen.answer import Result, block, picture, table
from optopad.screen.figures import TABLE_WIDTH, Better, PadFigures, figure_lines
from optopad.sims.score.sweep import SweepRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from optopad.sims.learning.recorded_press import RecordedPair, RecordedPress

MOST_DESIGNS = 12
NAMES = ("name", "description")
"""Fields that name a design."""
WIDEST = 26
"""Largest number of characters of a field's value in a table; longer values are cut."""
MOST_CHANGES = 8
"""Largest number of changed fields that the terminal lists for a design; the page has all."""


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One figure (such as the deadband) of all compared designs.

    Attributes
    ----------
    name, unit : name and unit of the figure
    better : "higher" or "lower"
    values : number by which each design is ranked; None if a design does not have the figure, infinite if presses are
        not resolved or not detected
    texts : the figure of each design as text
    uncertainty : uncertainty for each design, in the unit of the figure
    winner : index of the design that is better than all others by more than the uncertainties; None if there is none
    """

    name: str
    unit: str
    better: Better
    values: tuple[float | None, ...]
    texts: tuple[str, ...]
    uncertainty: tuple[float, ...]
    winner: int | None

    @property
    def title(self) -> str:
        """Name and unit of the figure, as text."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def shown(self, place: int) -> str:
        """The figure of the design with index `place`, with its uncertainty, as text."""
        spread = self.uncertainty[place]
        return f"{self.texts[place]} ± {spread:.1g}" if 0.0 < spread < math.inf else self.texts[place]


@dataclass(frozen=True, kw_only=True, repr=False)
class Comparison(Result):
    """Result of a comparison of designs.

    Attributes
    ----------
    labels, digests : name and digest of each design; all others are compared with the first one
    rows : score of each design, and its signal curve in the plot
    figures : the figures that each design is chosen by
    changes : fields in which the designs differ, as a mapping from dotted path to the value in each design
    measures : figures of all designs by which they are ranked
    winner_of_verdict : index of the only design without a deadband; None otherwise, or if a verdict is undecided
    folder, stem : folder of the written comparison, and its file name without suffix
    """

    labels: tuple[str, ...]
    digests: tuple[str, ...]
    rows: tuple[SweepRow, ...]
    figures: tuple[PadFigures, ...]
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
        from optopad.sims.plots.style import plain_style
        from optopad.sims.plots.sweep import plot_sweep

        with plain_style():
            return plot_sweep("designs", self.rows)

    def lines(self) -> list[str]:
        """The comparison as text: designs and what differs, then their figures; a star marks a winner."""
        numbers = [str(number) for number in range(1, len(self.labels) + 1)]
        winners = {one.name: one.winner for one in self.measures if one.winner is not None}
        if self.winner_of_verdict is not None:
            winners["verdict"] = self.winner_of_verdict
        lines = []
        for place, number in enumerate(numbers):
            lines += wrap(f"{number}  {self._told_apart(place)}", TABLE_WIDTH, subsequent_indent="   ")
        lines += ["", *figure_lines("design", numbers, self.figures, winners)]
        lines += [
            f"{number}: {row.score['reason']}"
            for number, row in zip(numbers, self.rows, strict=True)
            if row.score["reason"]
        ]
        return [*lines, "* better than every other design by more than the sum of both uncertainties"]

    def screen(self) -> list[str]:
        """The comparison, and its files."""
        return [*self.lines(), f"files     {self.folder} ({self.stem}: html, json, svg, png)"]

    def _told_apart(self, place: int) -> str:
        """Name and digest of a design, and the fields in which it differs from the first design."""
        name = f"{self.labels[place]} ({self.digests[place][:8]})"
        changed = [
            f"{path} = {shown_value(values[place])}"
            for path, values in self.changes.items()
            if values[place] != values[0] and path not in NAMES and path not in self.labels[place]
        ]
        if len(changed) > MOST_CHANGES:
            changed[MOST_CHANGES:] = [f"and {len(changed) - MOST_CHANGES} more fields, see the page"]
        return f"{name}: {', '.join(changed)}" if changed else name

    def _repr_html_(self) -> str:
        rows = [
            (cells[0].title, *(cell.text for cell in cells))
            for cells in zip(*(one.cells for one in self.figures), strict=True)
        ]
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
                    **figures.to_json(),
                }
                for label, digest, row, figures in zip(
                    self.labels, self.digests, self.rows, self.figures, strict=True
                )
            ],
            "changes": [{"path": path, "values": list(values)} for path, values in self.changes.items()],
            "measures": [
                {
                    "name": one.name,
                    "unit": one.unit,
                    "better": one.better,
                    "values": [_finite(value) for value in one.values],
                    "uncertainty": [_finite(value) for value in one.uncertainty],
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


def _finite(value: float | None) -> float | None:
    return None if value is None or math.isinf(value) else value


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparedRecording(Result):
    """A comparison of simulated and recorded presses, and the paths of its files."""

    press: RecordedPress
    digest: str
    recording: str
    folder: Path
    stem: str

    def to_json(self) -> dict[str, Any]:
        """The comparison as plain data for JSON."""
        return {
            "digest": self.digest,
            "recording": self.recording,
            "place_mm": [round(value, 4) for value in self.press.place_mm],
            "pairs": [_pair_json(pair) for pair in self.press.pairs],
            "notes": list(self.press.notes),
            "files": str(self.folder),
        }

    def lines(self) -> list[str]:
        """A few lines: how far each pair's measured and simulated signals are apart."""
        x_mm, y_mm = self.press.place_mm
        lines = [f"press     at x {x_mm:g}, y {y_mm:g} mm"]
        for pair in self.press.pairs:
            modes = pair.simulated.score.modes
            lines.append(
                f"{pair.simulated.name:<9} measured and simulated differ by {pair.rms:.1%} of the untouched "
                f"signal (rms; {pair.worst:.1%} at most); untouched {pair.untouched_counts:.0f}; mode 1 to "
                f"{modes.mode1_mm[1]:.2f} mm, mode 2 "
                + ("never" if modes.mode2_mm[0] is None else f"from {modes.mode2_mm[0]:.2f} mm")
            )
        return lines + [f"note      {text}" for text in self.press.notes]

    def screen(self) -> list[str]:
        """The comparison, and its files."""
        return [*self.lines(), f"files     {self.folder} ({self.stem}: json, svg, png)"]


def _pair_json(pair: RecordedPair) -> dict[str, Any]:
    return {
        "pair": pair.simulated.name,
        "rms": round(pair.rms, 5),
        "worst": round(pair.worst, 5),
        "untouched_counts": round(pair.untouched_counts, 3),
        "depth_mm": pair.depth_mm.round(4).tolist(),
        "measured": pair.ratio.round(5).tolist(),
        "press_readings": pair.deepest + 1,
        "simulated_depth_mm": pair.simulated.curves.depth_mm.tolist(),
        "simulated": (pair.simulated.curves.total / pair.simulated.curves.total[0]).round(6).tolist(),
    }
