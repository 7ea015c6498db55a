r"""The indenter's tip: its fields, its outline, and profiles from CSV files.

A CSV file can give the radial profile of a tip: radius and height above the apex of each point, in mm.

    r_mm, height_mm        a heading, empty lines and lines that begin with # are skipped
    0.0, 0.0               the apex
    1.5, 0.4
    3.0, 3.0               the shank, at indenter.tip_radius_mm

The two numbers have a decimal point and are separated by a comma, a semicolon or blanks. The height must be a function
of the radius; otherwise the profile is refused, and the message names the row.

The contact solver, the printed tip and the report use the same outline of the tip:

       |  |      shank, of tip_radius_mm, of any length
       |  |
       \  /     outline: arcs and straight lines from the apex (0, 0) to the shank
        --       apex; heights are above it

| shape      | outline                                                                                |
|------------|----------------------------------------------------------------------------------------|
| hemisphere | a quarter of a circle                                                                  |
| flat_punch | a flat face, and an edge of edge_radius_mm                                             |
| cone       | an apex of apex_radius_mm, a flank, an edge of edge_radius_mm; cone_half_angle_deg is  |
|            | between axis and flank                                                                 |
| profile    | straight lines through the user's points                                               |

This module has geometry only. The contact model itself checks whether it can resolve a small radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from optopad.design.csv_table import numbered_points
from optopad.design.errors import DesignError
from optopad.design.fields.base import Model

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

NEEDED = "a CSV table with the radius and height of a tip in mm, a row a point"


def read_profile(file: Path) -> list[list[float]]:
    """Read the profile of a tip: radius and height above the apex of each point [mm].

    Raises
    ------
    DesignError : the file cannot be read, a row is not a pair of numbers, or the points do not form a tip.
    """
    found = numbered_points(file, needed=NEEDED)
    rows, points = [number for number, _ in found], [point for _, point in found]
    fault = profile_fault(points, None, lambda index: f"{file}: row {rows[index]}")
    if fault is not None:
        raise DesignError(fault)
    return [list(point) for point in points]


class Indenter(Model):
    """The tip that represents a finger, at the end of a cylindrical shank of the same radius."""

    unsaid = ("shape", "edge_radius_mm", "cone_half_angle_deg", "apex_radius_mm", "profile_mm")

    tip_radius_mm: Annotated[
        float, Field(ge=0.5, le=20.0, description="radius of the tip and of its shank")
    ] = 3.0
    shape: Annotated[
        Literal["hemisphere", "flat_punch", "cone", "profile"], Field(description="form of the tip")
    ] = "hemisphere"
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


DEFAULT_ROUNDING = 0.1
"""Default radius of a flat punch's or cone's edge, and of a cone's apex [tip radii]."""
DEFAULT_HALF_ANGLE_DEG = 60.0
"""Default angle between the axis and the flank of a cone [deg]."""
SMALLEST_STEP_MM = 1e-3
"""Least permitted difference between the radii of neighbouring points of a profile [mm]."""
END_TOLERANCE_MM = 1e-6
"""Largest permitted distance between the last point of a profile and the shank [mm]."""
HIGHEST_PROFILE_MM = 50.0
"""Greatest permitted height of a profile [mm]."""
OWN_FIELDS = {
    "hemisphere": (),
    "flat_punch": ("edge_radius_mm",),
    "cone": ("cone_half_angle_deg", "apex_radius_mm", "edge_radius_mm"),
    "profile": ("profile_mm",),
}
"""Fields of each tip shape, in addition to `tip_radius_mm`."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A straight line or an arc of a tip's outline, directed outward from the axis [mm].

    Attributes
    ----------
    start, end : radius and height above the apex of the first and last point
    centre : radius and height of an arc's centre; (0, 0) for a line
    radius : radius of an arc, which bulges outward; 0 for a line
    """

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float] = (0.0, 0.0)
    radius: float = 0.0

    @property
    def middle(self) -> tuple[float, float]:
        """The point (radius, height above the apex) half-way along the piece [mm]."""
        if self.radius == 0.0:
            return 0.5 * (self.start[0] + self.end[0]), 0.5 * (self.start[1] + self.end[1])
        angle = 0.5 * (_angle(self, self.start) + _angle(self, self.end))
        return self.centre[0] + self.radius * math.sin(angle), self.centre[1] - self.radius * math.cos(angle)


def tip_outline(indenter: Indenter) -> tuple[Piece, ...]:
    """Outline of a tip from the apex to the shank."""
    tip = indenter.tip_radius_mm
    if indenter.shape == "hemisphere":
        return (_arc((0.0, tip), tip, 0.0, 0.5 * math.pi),)
    if indenter.shape == "profile":
        points = indenter.profile_mm or ()
        return tuple(Piece(start=a, end=b) for a, b in pairwise(points))
    edge = DEFAULT_ROUNDING * tip if indenter.edge_radius_mm is None else indenter.edge_radius_mm
    if indenter.shape == "flat_punch":
        return _pieces(tip, apex=edge, edge=edge, steepness=0.0)
    half_angle = indenter.cone_half_angle_deg or DEFAULT_HALF_ANGLE_DEG
    apex = DEFAULT_ROUNDING * tip if indenter.apex_radius_mm is None else indenter.apex_radius_mm
    return _pieces(tip, apex=apex, edge=edge, steepness=0.5 * math.pi - math.radians(half_angle))


def tip_words(indenter: Indenter) -> str:
    """Description of the tip for reports and messages."""
    tip, pieces = indenter.tip_radius_mm, tip_outline(indenter)
    if indenter.shape == "flat_punch":
        return f"flat punch of {tip:g} mm radius, its edge rounded by {pieces[-1].radius:g} mm"
    if indenter.shape == "cone":
        half_angle = indenter.cone_half_angle_deg or DEFAULT_HALF_ANGLE_DEG
        return (
            f"cone of {half_angle:g} degrees between axis and flank, {tip:g} mm radius, its apex rounded by "
            f"{pieces[0].radius:g} mm, its edge by {pieces[-1].radius:g} mm"
        )
    if indenter.shape == "profile":
        return f"own profile of {len(pieces) + 1} points, {tip:g} mm radius"
    return f"hemisphere of {tip:g} mm radius"


def shape_fault(indenter: Indenter) -> str | None:
    """Description of what is wrong with an indenter's fields, with limit and remedy; None if they are valid."""
    own = OWN_FIELDS[indenter.shape]
    for field in sorted({name for names in OWN_FIELDS.values() for name in names} - set(own)):
        if getattr(indenter, field) is not None:
            owners = " or ".join(repr(shape) for shape, names in OWN_FIELDS.items() if field in names)
            return (
                f"indenter.{field}: belongs to indenter.shape {owners}, and the shape is "
                f"{indenter.shape!r}; remove it or change the shape"
            )
    for field in ("edge_radius_mm", "apex_radius_mm"):
        value = getattr(indenter, field)
        if value is not None and value > indenter.tip_radius_mm:
            return (
                f"indenter.{field}: {value:g} is refused: must be at most indenter.tip_radius_mm = "
                f"{indenter.tip_radius_mm:g} mm"
            )
    if indenter.shape != "profile":
        return None
    if indenter.profile_mm is None:
        return (
            "indenter.profile_mm: is missing; indenter.shape 'profile' needs the tip's points as "
            "[[radius, height], ...], or indenter.profile_csv with the name of a file that contains them"
        )
    return profile_fault(
        indenter.profile_mm, indenter.tip_radius_mm, lambda index: f"indenter.profile_mm.{index}"
    )


def profile_fault(
    points: Sequence[tuple[float, float]], tip_radius_mm: float | None, name: Callable[[int], str]
) -> str | None:
    """Description of what is wrong with a tip's profile; None if it is valid.

    Parameters
    ----------
    points : radius and height above the apex of each point, from the apex outward [mm]
    tip_radius_mm : radius of the shank, at which the profile must end [mm]; if None, the end is not checked
    name : function that returns a point's name from its index, for the message
    """
    if math.hypot(*points[0]) > END_TOLERANCE_MM:
        return f"{name(0)}: {_shown(points[0])} is refused: a profile starts at its apex, [0, 0]"
    for index in range(1, len(points)):
        (r0, h0), (r1, h1) = points[index - 1], points[index]
        if r1 < r0 + SMALLEST_STEP_MM:
            return (
                f"{name(index)}: radius {r1:g} mm after {r0:g} mm is refused: height must be a function of radius, "
                f"which has to grow by {SMALLEST_STEP_MM:g} mm at least; sort the points or leave this one out"
            )
        if h1 < h0:
            return (
                f"{name(index)}: height {h1:g} mm after {h0:g} mm is refused: heights above the apex must not fall, "
                "because the apex touches first; give heights upward from the lowest point"
            )
    last = len(points) - 1
    if tip_radius_mm is not None and abs(points[last][0] - tip_radius_mm) > END_TOLERANCE_MM:
        return (
            f"{name(last)}: radius {points[last][0]:g} mm is refused: the profile has to end at the shank, "
            f"indenter.tip_radius_mm = {tip_radius_mm:g} mm; add the missing points or change the tip radius"
        )
    if points[last][1] > HIGHEST_PROFILE_MM:
        return (
            f"{name(last)}: height {points[last][1]:g} mm is refused: at most {HIGHEST_PROFILE_MM:g} mm "
            "(heights are in millimetres)"
        )
    return None


def _shown(point: tuple[float, float]) -> str:
    return f"[{point[0]:g}, {point[1]:g}]"


def _arc(centre: tuple[float, float], radius: float, first: float, last: float) -> Piece:
    """An arc between two angles [rad], measured at its centre from the downward direction."""
    start, end = (
        (centre[0] + radius * math.sin(angle), centre[1] - radius * math.cos(angle))
        if 0.0 < angle < 0.5 * math.pi
        else ((centre[0], centre[1] - radius) if angle == 0.0 else (centre[0] + radius, centre[1]))
        for angle in (first, last)
    )
    return Piece(start=start, end=end, centre=centre, radius=radius)


def _pieces(tip: float, *, apex: float, edge: float, steepness: float) -> tuple[Piece, ...]:
    """Apex arc, straight flank and edge arc, tangent to each other.

    Parameters
    ----------
    tip : radius of the shank
    apex, edge : radii of the arcs
    steepness : angle of the flank to the horizontal [rad]
    """
    sine, cosine = math.sin(steepness), math.cos(steepness)
    flank = max(0.0, (tip - edge + edge * sine - apex * sine) / cosine)
    low = (apex * sine, apex * (1.0 - cosine))
    high = (low[0] + flank * cosine, low[1] + flank * sine)
    found = [_arc((0.0, apex), apex, 0.0, steepness)] if steepness > 0.0 else []
    if flank > 0.0:
        found.append(Piece(start=low, end=high))
    found.append(_arc((tip - edge, high[1] + edge * cosine), edge, steepness, 0.5 * math.pi))
    return tuple(found)


def _angle(piece: Piece, point: tuple[float, float]) -> float:
    """Angle of a point on an arc [rad], measured at the arc's centre from the downward direction."""
    return math.atan2(point[0] - piece.centre[0], piece.centre[1] - point[1])
