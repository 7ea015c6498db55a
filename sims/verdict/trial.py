"""Result of a trial: the change of a few fields that removes a deadband or extends usable depth, and its verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from optopad.sims.verdict.causes import Kind

Found = Literal["move", "more parts", "none"]


@dataclass(frozen=True, kw_only=True)
class Move:
    """Change of one field.

    Attributes
    ----------
    path : dotted path of the field
    parts : names of the components that the change moves, such as "R1-R8"; empty if it moves none
    was, to : values before and after [unit of the field]; `was` is None if the design does not set the field
    """

    path: str
    parts: str
    was: float | None
    to: float


@dataclass(frozen=True, kw_only=True)
class TriedMove:
    """One tried change of fields and its short verdict.

    Attributes
    ----------
    changes : new values by dotted path of the field
    deadband_mm, usable_mm : summed deadband and usable depth of the judged pairs or location [mm]
    margin : distance between frames over the least resolved 0.3 mm of depth [noise units]; a margin below 3 means a
        deadband
    """

    changes: Mapping[str, float]
    deadband_mm: float
    usable_mm: float
    margin: float


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The moves that were tried to remove a deadband, or to extend the usable depth.

    Attributes
    ----------
    kind : the problem: "deadband", or "fade" if the usable depth ends before the deepest press
    found : "move" or "more parts", whichever helps; "none" if nothing helps
    moves : the moves that help
    verdict, deadband_mm, usable_mm, margin : verdict, deadband [mm], usable depth [mm] and margin [noise units] of the
        changed design; None if nothing helps
    judged : text that names the judged pairs or locations, and the light settings
    searched : text that names the pairs or the location judged during the search
    tried : the moves with a short verdict, in the order in which they were tried
    farthest_mm : largest change that was tried [mm]
    more_parts_tried : whether one more component per side was tried
    """

    kind: Kind
    found: Found
    moves: tuple[Move, ...]
    verdict: str | None
    deadband_mm: float | None
    usable_mm: float | None
    margin: float | None
    judged: str
    searched: str
    tried: tuple[TriedMove, ...]
    farthest_mm: float
    more_parts_tried: bool

    def to_json(self) -> dict[str, Any]:
        """The trial as plain data for JSON."""
        return {
            "kind": self.kind,
            "found": self.found,
            "moves": [
                {"path": one.path, "parts": one.parts, "from": one.was, "to": one.to} for one in self.moves
            ],
            "verdict": self.verdict,
            "deadband_mm": _rounded(self.deadband_mm),
            "usable_depth_mm": _rounded(self.usable_mm),
            "margin_noise_units": _rounded(self.margin),
            "judged_by": self.judged,
            "searched_by": self.searched,
            "farthest_mm": _rounded(self.farthest_mm),
            "more_parts_tried": self.more_parts_tried,
            "tried": [
                {
                    "changes": dict(one.changes),
                    "deadband_mm": _rounded(one.deadband_mm),
                    "usable_depth_mm": _rounded(one.usable_mm),
                    "margin_noise_units": _rounded(one.margin),
                }
                for one in self.tried
            ],
        }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
