"""The tip that presses: its fields. Its outline is in `design.spec.tip_shape`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from design.fields.base import Model


class Indenter(Model):
    """The tip that stands for a finger, and its shank of the same radius."""

    unsaid = ("shape", "edge_radius_mm", "cone_half_angle_deg", "apex_radius_mm", "profile_mm")

    tip_radius_mm: Annotated[float, Field(ge=0.5, le=20.0)] = 3.0
    shape: Literal["hemisphere", "flat_punch", "cone", "profile"] = "hemisphere"
    edge_radius_mm: Annotated[
        float | None,
        Field(
            ge=0.05,
            le=20.0,
            description="flat_punch, cone: rounding towards the shank; 0.1 tip radii if left out",
        ),
    ] = None
    cone_half_angle_deg: Annotated[
        float | None, Field(ge=20.0, le=85.0, description="cone: from axis to flank; 60 if left out")
    ] = None
    apex_radius_mm: Annotated[
        float | None, Field(ge=0.05, le=20.0, description="cone: its rounded apex; 0.1 tip radii if left out")
    ] = None
    profile_mm: Annotated[
        tuple[tuple[float, float], ...] | None,
        Field(
            min_length=2,
            max_length=400,
            description="profile: radius and height above the apex of each point, from [0, 0] to the shank",
        ),
    ] = None
