"""What a page shows that can be drawn before the tolerance of a verdict is known."""

from __future__ import annotations

from dataclasses import dataclass

from design.spec import SensorDesign
from optopad.report.scenes.map_scene import MapScene
from optopad.report.sections.drawings import Drawing, drawings_without_tolerance
from optopad.report.sections.maps import map_scene
from sims.continuity.result import ContinuityScore


@dataclass(frozen=True, kw_only=True)
class EarlyDrawings:
    """Plots by stem without the prefix, and the maps by depth; None without a map."""

    drawings: dict[str, Drawing]
    maps: MapScene | None


def early_drawings(design: SensorDesign, score: ContinuityScore) -> EarlyDrawings:
    """All plots that a score has data for, but those of its tolerance."""
    maps = map_scene(design, score)
    return EarlyDrawings(drawings=drawings_without_tolerance(design, score, maps), maps=maps)
