"""The pad of a design in plan, and its top: the outline with the facets of its parts, and the crown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.shape.outline import Arc, Line, Outline, Point, outline_in
from design.shape.top import Top
from design.spec import SensorDesign
from design.spec.layout import angle_name

NODES = 32
"""Of Gauss' rule along each wall, and from the middle to it."""
TURN_RAD = 2.0 * math.pi / 96
"""Turn of a round wall between two corners: it stands out between them by 5e-4 of its radius."""
PIECES = 16
"""Pieces that a straight wall under a curved edge is drawn in."""


def facet(arc: Arc, angle_deg: float, half_width_mm: float) -> Line:
    """A flat facet cut into a round wall; along is 0 at its low end and grows with the angle.

    Parameters
    ----------
    arc : the round wall
    angle_deg : direction from its centre, 0 along x, 90 along y
    half_width_mm : of the facet, below the radius
    """
    cosine, sine = _unit(angle_deg)
    outward, tangent = (cosine, sine), (-sine, cosine)
    (x, y), depth = arc.centre_mm, math.sqrt(max(arc.radius_mm**2 - half_width_mm**2, 0.0))
    return Line(
        name=angle_name(angle_deg),
        origin=(
            x + depth * cosine - half_width_mm * tangent[0],
            y + depth * sine - half_width_mm * tangent[1],
        ),
        tangent=tangent,
        outward=outward,
        length_mm=2.0 * half_width_mm,
    )


def _unit(angle_deg: float) -> Point:
    """Cosine and sine, exact at quarter turns."""
    turns, rest = divmod(angle_deg % 360.0, 90.0)
    cosine, sine = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(turns)):
        cosine, sine = -sine, cosine
    return cosine + 0.0, sine + 0.0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Outline and top of a pad.

    Attributes
    ----------
    outline : in plan, with the facets of a disc's parts
    top : untouched
    """

    outline: Outline
    top: Top

    @property
    def is_disc(self) -> bool:
        """Whether the outline is round."""
        return self.outline.kind == "disc"

    @property
    def is_flat_rectangle(self) -> bool:
        """Whether it is a plain block."""
        return self.top.is_flat and not self.is_disc

    @property
    def is_block(self) -> bool:
        """Whether it fills its box under a flat top: mirror images then give its light exactly."""
        x0, y0, x1, y1 = self.outline.box_mm
        return self.top.is_flat and bool(self.outline.contains([x0, x1, x0, x1], [y0, y0, y1, y1]).all())

    @property
    def walls(self) -> tuple[Line, ...]:
        """The flat walls."""
        return self.outline.lines

    @property
    def length_mm(self) -> float:
        """Inner size along x [mm]."""
        return self.outline.box_mm[2]

    @property
    def width_mm(self) -> float:
        """Inner size along y [mm]."""
        return self.outline.box_mm[3]

    @property
    def clear_mm(self) -> float:
        """Height of the top at its highest point [mm]."""
        return self.top.clear_mm

    @property
    def centre_mm(self) -> Point:
        """Middle of the pad, under the highest point (x, y)."""
        return self.outline.centre_mm

    @property
    def radius_mm(self) -> float:
        """Of the disc; of a rectangle the distance of its corners from the middle [mm]."""
        return self.length_mm / 2 if self.is_disc else math.hypot(self.length_mm, self.width_mm) / 2

    def stands_mm(self, wall: Line) -> float:
        """Distance of a wall from the middle [mm]."""
        return -wall.along_and_outward_mm(*self.centre_mm)[1]

    @property
    def area_mm2(self) -> float:
        """Area in plan."""
        return self.outline.area_mm2

    @property
    def rim_mm(self) -> tuple[float, float]:
        """Lowest and highest place of the top's edge: where the untouched top meets the walls [mm]."""
        (x, y), (x0, y0, x1, y1) = self.centre_mm, self.outline.box_mm
        places = [end for line in self.walls for end in line.ends]
        places += [line.point(line.along_and_outward_mm(x, y)[0]) for line in self.walls]
        sides = [(x, y0), (x1, y), (x, y1), (x0, y)]
        places += [place for place in sides if self.outline.contains(*place)]
        heights = [self.top_mm(*place) for place in places]
        return min(heights), max(heights)

    def top_mm(self, x_mm: float, y_mm: float) -> float:
        """Height of the untouched top above the bottom of the clear layer [mm]."""
        return float(self.top.height_mm(x_mm, y_mm))

    def normal(self, x_mm: float, y_mm: float) -> tuple[float, float, float]:
        """Unit vector out of the untouched top: a press goes against it."""
        nx, ny, nz = self.top.normal(x_mm, y_mm).tolist()
        return nx, ny, nz

    def contains(self, x_mm: float, y_mm: float) -> bool:
        """Whether a place lies in the pad, its border included."""
        return bool(self.outline.contains(x_mm, y_mm))

    @property
    def clear_volume_mm3(self) -> float:
        """Volume of the clear layer below the untouched top [mm3]."""
        x, y, weight = self.outline.integral(self.centre_mm, NODES)
        return self.area_mm2 * self.clear_mm - float(weight @ self.top.sag_mm(x, y))


def plan_of(design: SensorDesign, facets: Sequence[Line] = ()) -> Plan:
    """The plan of a design; `facets` of a disc are those of its placed parts."""
    size, crown = design.cavity, design.crown
    box = (0.0, 0.0, size.length_mm, size.width_mm)
    outline = outline_in(size.outline, box, facets)
    bend = 0.0 if crown is None else 1.0 / crown.radius_mm
    straight = None if crown is None else crown.axis
    top = Top(
        clear_mm=size.clear_thickness_mm,
        apex_mm=outline.centre_mm,
        kx=0.0 if straight == "x" else bend,
        ky=0.0 if straight == "y" else bend,
    )
    return Plan(outline=outline, top=top)


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of a pad in plan, counter-clockwise [mm]."""
    return plan.outline.points(TURN_RAD)


def edge_mm(plan: Plan) -> FloatArray:
    """(n, 3) edge of the untouched top: corners in plan, more of them under a crown, and its height there [mm].

    Heights are not numbers where a crown is too tight for its pad.
    """
    corners = plan.outline.points(TURN_RAD, 1 if plan.top.is_flat else PIECES)
    return np.column_stack([corners, plan.top.height_mm(*corners.T)])
