"""What an improvement found: the design before, better ones, and what stops it where there are none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from design.search.improve import Kind
from design.search.judged import Judged
from design.spec import SensorDesign
from sims.continuity.result import ContinuityScore

Figures = dict[str, float | None]


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A design worth having.

    Attributes
    ----------
    kind : in what it is best
    changes : new values by dotted path
    design, file : itself, and its file in the folder
    figures, score : as the search judged it, and as `optopad score` does
    """

    kind: Kind
    changes: dict[str, Any]
    design: SensorDesign
    file: str
    figures: Figures
    score: ContinuityScore


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """The best of the designs that were judged as a score judges, where none is better than the design before.

    Attributes
    ----------
    changes : new values by dotted path
    judged, score : as the search judged it, and as `optopad score` does
    at_ends : fields at an end of their range
    """

    changes: dict[str, Any]
    judged: Judged
    at_ends: tuple[str, ...]
    score: ContinuityScore

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "changes": self.changes,
            "figures": self.judged.figures,
            "at_range_end": list(self.at_ends),
            "verdict": self.score.verdict,
            "usable_depth_mm": self.score.usable_depth_mm,
            "deadband_mm": self.score.deadband_total_mm,
            "margin_noise_units": self.score.margin,
        }


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """What was found around a design.

    Attributes
    ----------
    design, before, figures : the design, its score, and its figures as the search judged it
    alternatives : better designs, one of a kind at most
    nearest : without any, what came nearest
    tried, judged_again : designs judged by the search's quick light, and as a score judges
    folder : with their files
    is_interrupted : whether the search was stopped before its end
    """

    design: SensorDesign
    before: ContinuityScore
    figures: Figures
    alternatives: tuple[Alternative, ...]
    nearest: Nearest | None
    tried: int
    folder: Path
    is_interrupted: bool
    judged_again: int = 0

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "before": {**self.before.to_json(), "search_figures": self.figures},
            "alternatives": [
                {
                    "kind": one.kind,
                    "changes": one.changes,
                    "file": str(self.folder / one.file),
                    "search_figures": one.figures,
                    **one.score.to_json(),
                }
                for one in self.alternatives
            ],
            "nearest": None if self.nearest is None else self.nearest.to_json(),
            "designs": self.tried,
            "judged_by_score": self.judged_again,
            "interrupted": self.is_interrupted,
            "folder": str(self.folder),
        }
