"""Mode boundaries in newtons: the load at which a mode starts or ends, with the band of the modulus.

    depth of the boundary ──► load of the press there, at the modulus believed most and at both ends of its band

Depths do not depend on the modulus (light sees the shape only, and the shape of a frictionless layer does not
depend on its stiffness); loads are proportional to it. So a softer mix moves every boundary in newtons and none in
millimetres. The load is that of the pair's own press, near walls included where the contact model covers the
place; elsewhere that of the centred press, and `is_at_place` says so.

Left out: the error of the contact model, friction, viscosity.
"""

from __future__ import annotations

from dataclasses import dataclass

from design.errors import ModelScopeError
from design.spec import SensorDesign
from sims.contact.force_curve import LoadCurve, load_curve
from sims.contact.indentation import solved_press
from sims.press.depths import depth_schedule_mm
from sims.verdict.pair.modes import Modes

Load = tuple[float, float, float]
"""Load and both ends of its band [N]."""


@dataclass(frozen=True, kw_only=True)
class BoundaryForces:
    """Loads at the boundaries of the modes: (load, low end, high end) [N]; None for an open boundary.

    Attributes
    ----------
    mode1_start, mode1_end, mode2_onset, mode2_end : the boundaries
    is_at_place : whether the load is that of the pair's press; else that of the centred press
    """

    mode1_start: Load
    mode1_end: Load
    mode2_onset: Load | None
    mode2_end: Load | None
    is_at_place: bool

    def to_json(self) -> dict[str, object]:
        """Plain data for JSON."""
        loads = {name: getattr(self, name) for name in BOUNDARIES}
        return {
            name: None if load is None else [round(end, 4) for end in load] for name, load in loads.items()
        } | {"is_at_place": self.is_at_place}


BOUNDARIES = ("mode1_start", "mode1_end", "mode2_onset", "mode2_end")


def boundary_forces(modes: Modes, force: LoadCurve, *, is_at_place: bool = True) -> BoundaryForces:
    """The loads of a press at the boundaries of the modes.

    Parameters
    ----------
    force : load of the press, at least as deep as the deepest boundary
    """
    onset, end = modes.mode2_mm
    return BoundaryForces(
        mode1_start=force.at(modes.mode1_mm[0]),
        mode1_end=force.at(modes.mode1_mm[1]),
        mode2_onset=None if onset is None else force.at(onset),
        mode2_end=None if end is None else force.at(end),
        is_at_place=is_at_place,
    )


def place_force(design: SensorDesign, place_mm: tuple[float, float]) -> tuple[LoadCurve, bool]:
    """Load against depth of a press at a place, and whether it is that place's or the centred press's."""
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm)
    try:
        return load_curve(design, solved_press(design, at_mm=place_mm), depth_mm), True
    except ModelScopeError:
        return load_curve(design, solved_press(design), depth_mm), False
