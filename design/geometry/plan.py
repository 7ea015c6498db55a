r"""The pad in plan and its top: walls, outline, crown.

Frame of `design.geometry.cavity`. In plan a pad is convex: a rectangle, or a disc with one flat facet for each part,
as wide as the part's socket, on which the part's face lies. The facet is a chord:

            facet of E1 (half width w)
              ___|___            a round wall of radius R; the facet stands sqrt(R² - w²) from the centre
           .-'       '-.
          /             \        the centre is (R, R): x and y run from 0 to the diameter, as in a rectangle's frame
         |       +       |
          \             /
           '-._______.-'

The top, flat or convex, has its highest point over the middle of the pad (`design.shape.top`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.shape.top import Top
from design.spec import SensorDesign
from design.spec.layout import angle_name

Point = tuple[float, float]
NODES = 32
"""Of a Gauss rule over the plan."""


@dataclass(frozen=True, kw_only=True)
class WallLine:
    """A flat wall in plan.

    Attributes
    ----------
    name : south, east, north, west; of a facet, its direction, as `45-degree`
    origin : x, y of the place from which `along` is counted [mm]
    tangent, outward : unit vectors along the wall and out of the pad
    length_mm : inner length of the wall
    """

    name: str
    origin: Point
    tangent: Point
    outward: Point
    length_mm: float

    def point(self, along_mm: float, outward_mm: float = 0.0) -> Point:
        """Position (x, y) in the cavity frame [mm]."""
        (x, y), (tx, ty), (nx, ny) = self.origin, self.tangent, self.outward
        return x + along_mm * tx + outward_mm * nx, y + along_mm * ty + outward_mm * ny

    def along_and_outward_mm(self, x_mm: float, y_mm: float) -> Point:
        """The way back from `point` [mm]."""
        x, y = x_mm - self.origin[0], y_mm - self.origin[1]
        (tx, ty), (nx, ny) = self.tangent, self.outward
        return x * tx + y * ty, x * nx + y * ny


def rectangle_walls(length_mm: float, width_mm: float) -> dict[str, WallLine]:
    """The four walls of a rectangle by name: along runs with x on south and north, with y on east and west."""
    along_x, along_y = (1.0, 0.0), (0.0, 1.0)
    return {
        name: WallLine(name=name, origin=origin, tangent=tangent, outward=outward, length_mm=run)
        for name, origin, tangent, outward, run in (
            ("south", (0.0, 0.0), along_x, (0.0, -1.0), length_mm),
            ("east", (length_mm, 0.0), along_y, (1.0, 0.0), width_mm),
            ("north", (0.0, width_mm), along_x, (0.0, 1.0), length_mm),
            ("west", (0.0, 0.0), along_y, (-1.0, 0.0), width_mm),
        )
    }


def facet(radius_mm: float, angle_deg: float, half_width_mm: float) -> WallLine:
    """The flat facet of a disc in a direction from its centre; along is 0 at its low end and grows with the angle.

    Parameters
    ----------
    radius_mm : of the disc
    angle_deg : direction from the centre, 0 along x, 90 along y
    half_width_mm : of the facet, below the radius
    """
    cosine, sine = _unit(angle_deg)
    outward, tangent = (cosine, sine), (-sine, cosine)
    depth = math.sqrt(max(radius_mm**2 - half_width_mm**2, 0.0))
    return WallLine(
        name=angle_name(angle_deg),
        origin=(
            radius_mm + depth * cosine - half_width_mm * tangent[0],
            radius_mm + depth * sine - half_width_mm * tangent[1],
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
    length_mm, width_mm : of the rectangle; both the diameter of a disc
    is_disc : whether the outline is round
    walls : the flat walls: four of a rectangle, one for each part of a disc
    top : untouched
    """

    length_mm: float
    width_mm: float
    is_disc: bool
    walls: tuple[WallLine, ...]
    top: Top

    @property
    def is_flat_rectangle(self) -> bool:
        """Whether it is a plain block."""
        return self.top.is_flat and not self.is_disc

    @property
    def clear_mm(self) -> float:
        """Height of the top at its highest point [mm]."""
        return self.top.clear_mm

    @property
    def centre_mm(self) -> Point:
        """Middle of the pad, under the highest point (x, y)."""
        return self.length_mm / 2, self.width_mm / 2

    @property
    def radius_mm(self) -> float:
        """Of the disc; of a rectangle the distance of its corners from the middle [mm]."""
        return self.length_mm / 2 if self.is_disc else math.hypot(self.length_mm, self.width_mm) / 2

    def stands_mm(self, wall: WallLine) -> float:
        """Distance of a disc's facet from the centre [mm]."""
        return math.sqrt(max(self.radius_mm**2 - (wall.length_mm / 2) ** 2, 0.0))

    @property
    def area_mm2(self) -> float:
        """Area in plan; facets of a disc do not overlap where the mold can be built."""
        if not self.is_disc:
            return self.length_mm * self.width_mm
        radius = self.radius_mm
        return math.pi * radius**2 - sum(_segment_mm2(radius, wall.length_mm / 2) for wall in self.walls)

    @property
    def rim_mm(self) -> tuple[float, float]:
        """Lowest and highest place of the top's edge: where the untouched top meets the walls [mm]."""
        x, y = self.centre_mm
        if self.is_disc:  # a facet's middle is nearer to the centre than the round wall
            nearest = [wall.point(wall.length_mm / 2) for wall in self.walls]
            around = [(x + self.radius_mm, y), (x, y + self.radius_mm)]
            heights = [self.top_mm(*place) for place in (*nearest, *around)]
        else:
            heights = [self.top_mm(px, py) for px in (0.0, x) for py in (0.0, y) if (px, py) != (x, y)]
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
        inside = all(wall.along_and_outward_mm(x_mm, y_mm)[1] <= 1e-9 for wall in self.walls)
        x, y = self.centre_mm
        return inside and (not self.is_disc or math.hypot(x_mm - x, y_mm - y) <= self.radius_mm + 1e-9)

    @property
    def clear_volume_mm3(self) -> float:
        """Volume of the clear layer below the untouched top [mm3].

        Notes
        -----
        The sag of the crown is integrated over the plan by Gauss' rule: of a disc in polar coordinates, less the
        segments that its facets cut off. It is smooth there, so the rule is exact to rounding.
        """
        return self.area_mm2 * self.clear_mm - self._sag_volume_mm3()

    def _sag_volume_mm3(self) -> float:
        x0, y0 = self.centre_mm
        if not self.is_disc:
            (x, u), (y, v) = _gauss(0.0, self.length_mm), _gauss(0.0, self.width_mm)
            return float(u @ self.top.sag_mm(x[:, None], y) @ v)
        r, u = _gauss(0.0, self.radius_mm)
        turn = 2.0 * np.pi * np.arange(NODES) / NODES
        sags = self.top.sag_mm(x0 + r[:, None] * np.cos(turn), y0 + r[:, None] * np.sin(turn))
        whole = float(u * r @ sags.mean(axis=1)) * 2.0 * math.pi
        return whole - sum(self._segment_sag_mm3(wall) for wall in self.walls)

    def _segment_sag_mm3(self, wall: WallLine) -> float:
        """What a facet's segment would have had of the sag's integral."""
        half = wall.length_mm / 2
        stands = self.stands_mm(wall)
        found = 0.0
        for t, u in zip(*(each.tolist() for each in _gauss(-half, half)), strict=True):
            out, v = _gauss(0.0, math.sqrt(self.radius_mm**2 - t**2) - stands)
            (x, y), (nx, ny) = wall.point(half + t), wall.outward
            found += u * float(v @ self.top.sag_mm(x + nx * out, y + ny * out))
        return found


def plan_of(design: SensorDesign, facets: Sequence[WallLine] = ()) -> Plan:
    """The plan of a design; `facets` of a disc are those of its placed parts."""
    size = design.cavity
    is_disc = size.outline == "disc"
    walls = tuple(facets) if is_disc else tuple(rectangle_walls(size.length_mm, size.width_mm).values())
    crown = design.crown
    curvature = 0.0 if crown is None else 1.0 / crown.radius_mm
    straight = None if crown is None else crown.axis
    return Plan(
        length_mm=size.length_mm,
        width_mm=size.width_mm,
        is_disc=is_disc,
        walls=walls,
        top=Top(
            clear_mm=size.clear_thickness_mm,
            apex_mm=(size.length_mm / 2, size.width_mm / 2),
            kx=0.0 if straight == "x" else curvature,
            ky=0.0 if straight == "y" else curvature,
        ),
    )


def _segment_mm2(radius_mm: float, half_width_mm: float) -> float:
    """Area that a chord cuts off a disc [mm2]."""
    half = min(half_width_mm / radius_mm, 1.0)
    angle = math.asin(half)
    return radius_mm**2 * (angle - half * math.cos(angle))


def _gauss(low: float, high: float) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of Gauss' rule from low to high."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    middle, half = (low + high) / 2, (high - low) / 2
    return middle + half * nodes, half * weights
