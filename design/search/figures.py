"""Figures of merit of a design that a search can improve or limit: name, unit, direction and meaning.

They are the figures that `optopad score` reports. `dead_share`, `location_bound_mm` and `depth_bound_mm` describe the
whole pad. The other figures describe the facing pair that determines the verdict in a pad with facing rows, or the
median of the judged pairs in any other pad.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Direction = Literal["minimize", "maximize"]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of merit of a design.

    Attributes
    ----------
    unit : unit; "1" for a ratio or a count
    better : direction of improvement, `minimize` or `maximize`
    meaning : description for tables and pages
    """

    unit: str
    better: Direction
    meaning: str


FIGURES: dict[str, Figure] = {
    "evenness": Figure(
        unit="1",
        better="maximize",
        meaning="smallest over mean change of the signal in a 0.5 mm window of depth",
    ),
    "continuity": Figure(unit="1", better="maximize", meaning="share of the judged depth without deadband"),
    "deadband_mm": Figure(
        unit="mm",
        better="minimize",
        meaning="summed deadband of the facing pair, or of the pad's worst location",
    ),
    "usable_depth_mm": Figure(
        unit="mm",
        better="maximize",
        meaning="usable depth: depth is resolved down to it; the smallest of all locations",
    ),
    "margin": Figure(
        unit="1",
        better="maximize",
        meaning=(
            "sigma between two depths 0.3 mm apart, where the signal changes least within the range; "
            "a deadband is below 3"
        ),
    ),
    "strength": Figure(
        unit="1", better="maximize", meaning="untouched light of the judged pair over the emitted power"
    ),
    "swing": Figure(unit="1", better="maximize", meaning="largest loss of light over the untouched light"),
    "resolvable_steps": Figure(
        unit="1", better="maximize", meaning="number of steps of 3 sigma within the range of the signal"
    ),
    "location_bound_mm": Figure(
        unit="mm", better="minimize", meaning="Cramér-Rao bound of the location, median over the pad's voxels"
    ),
    "depth_bound_mm": Figure(
        unit="mm", better="minimize", meaning="Cramér-Rao bound of the depth, median over the pad's voxels"
    ),
    "detection_force_n": Figure(
        unit="N", better="minimize", meaning="load from which a press is detected at the worst location"
    ),
    "dead_share": Figure(
        unit="1", better="minimize", meaning="share of voxels where location or depth cannot be resolved"
    ),
    "part_count": Figure(unit="1", better="minimize", meaning="emitters and receivers"),
    "cost": Figure(
        unit="currency",
        better="minimize",
        meaning="price of emitters and receivers, where the catalogue has one",
    ),
    "pad_height_mm": Figure(unit="mm", better="minimize", meaning="clear and black layer together"),
    "outer_volume_cm3": Figure(
        unit="cm3", better="minimize", meaning="outer length, width and height of the mold, multiplied"
    ),
    "above_surface_mm": Figure(
        unit="mm", better="minimize", meaning="height of the rim, or of the highest body, above the surface"
    ),
}

BOUND_FIGURES = frozenset({"location_bound_mm", "depth_bound_mm", "dead_share", "detection_force_n"})
"""Figures that take a long time to compute, because they need the Fisher information of the whole pad."""


NO_OBJECTIVE_ALONE = frozenset({"continuity", "deadband_mm"})
"""Figures that are not permitted as the only objectives.

Thin pads have the best values of these figures, but only half the signal and a third of the depth range.
"""
