"""What a comparison of designs found: the fields in which they differ, and the figures of each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from sims.continuity.sweep import SweepRow

Better = Literal["lower", "higher", ""]


@dataclass(frozen=True, kw_only=True)
class Change:
    """A field in which designs differ: dotted path, and its value in each."""

    path: str
    values: tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One figure of every design.

    Attributes
    ----------
    name, unit, better : what it is, and which way is better; empty where neither is
    values : one a design; None where it does not exist
    uncertainty : likewise, in the same unit
    winner : number of the design that is better than all others by more than the uncertainties; None without one
    """

    name: str
    unit: str
    better: Better
    values: tuple[float | None, ...]
    uncertainty: tuple[float, ...]
    winner: int | None


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Designs side by side.

    Attributes
    ----------
    labels, digests : one a design, the first is what the others are held against
    rows : score and shown curve of each
    changes : fields that differ; measures : figures of all
    winner_of_verdict : number of the only design without a deadband; None otherwise, or where a verdict is undecided
    folder, stem : where it was written
    """

    labels: tuple[str, ...]
    digests: tuple[str, ...]
    rows: tuple[SweepRow, ...]
    changes: tuple[Change, ...]
    measures: tuple[Measure, ...]
    folder: Path
    stem: str

    @property
    def winner_of_verdict(self) -> int | None:
        """Number of the only contiguous design, no verdict being undecided."""
        if any(row.score["is_open"] for row in self.rows):
            return None
        safe = [number for number, row in enumerate(self.rows) if row.score["verdict"] == "CONTIGUOUS"]
        return safe[0] if len(safe) == 1 else None

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
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
            "changes": [{"path": one.path, "values": list(one.values)} for one in self.changes],
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
