r"""Outline of a pad seen from above: a closed, convex loop of flat walls and arcs, counter-clockwise.

    rectangle   four lines
    disc        arcs, and a flat facet for the face of each part: a chord as wide as its socket
    stadium     two lines along its longer side and a half round at each end, with facets as on a disc

            facet of E1 (half width w)                     north
              ___|___                              __________________
           .-'       '-.                        .-'                  '-.    radius R of a disc, or of a round end:
          /             \                      /                        \   the facet stands sqrt(R² - w²) from
         |       +       |                    |       +          +       |  its centre
          \             /                      \                        /
           '-._______.-'                        '-.__________________.-'    x and y run from 0 to the inner sizes
                                                           south

Walls are named by the compass: south at low y, north at high y, west at low x, east at high x. A location is inside if
it is on the inner side of every line, and within the radius of every arc whose sector contains it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import BoolArray, FloatArray

Point = tuple[float, float]
Box = tuple[float, float, float, float]
"""Bounding box: x0, y0, x1, y1 [mm]."""
Kind = Literal["rectangle", "disc", "stadium"]

SPREAD_STEPS = 256
"""Number of steps along each wall in the computation of evenly distributed locations."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A flat wall, or a flat facet in a round wall, seen from above.

    Attributes
    ----------
    name : south, east, north or west; for a facet its direction, such as `45-degree`
    origin : x, y of the point from which `along` is measured [mm]
    tangent : unit vector along the wall
    outward : unit vector out of the pad
    length_mm : inner length of the wall
    """

    name: str
    origin: Point
    tangent: Point
    outward: Point
    length_mm: float

    def point(self, along_mm: float, outward_mm: float = 0.0) -> Point:
        """Position (x, y) in the cavity's coordinate system [mm]."""
        (x, y), (tx, ty), (nx, ny) = self.origin, self.tangent, self.outward
        return x + along_mm * tx + outward_mm * nx, y + along_mm * ty + outward_mm * ny

    def along_and_outward_mm(self, x_mm: float, y_mm: float) -> Point:
        """Coordinates of a location along the wall and outward from it [mm]; the inverse of `point`."""
        x, y = x_mm - self.origin[0], y_mm - self.origin[1]
        (tx, ty), (nx, ny) = self.tangent, self.outward
        return x * tx + y * ty, x * nx + y * ny

    @property
    def ends(self) -> tuple[Point, Point]:
        """Both ends of the wall (x, y), counter-clockwise [mm]."""
        (tx, ty), (nx, ny) = self.tangent, self.outward
        ends = self.point(0.0), self.point(self.length_mm)
        return ends if nx * ty - ny * tx > 0.0 else ends[::-1]

    def points(self, shares: FloatArray) -> FloatArray:
        """Points (n, 2) on the wall at the given shares (n,) of its length, counter-clockwise [mm]."""
        start, end = np.array(self.ends)
        return np.asarray(start + shares[:, None] * (end - start))


@dataclass(frozen=True, kw_only=True)
class Arc:
    """A piece of a round wall, counter-clockwise.

    Attributes
    ----------
    centre_mm : x, y of the arc's centre
    radius_mm : radius
    start_rad : direction of the arc's start from its centre, 0 along x
    turn_rad : angle of the arc
    """

    centre_mm: Point
    radius_mm: float
    start_rad: float
    turn_rad: float

    def points(self, shares: FloatArray) -> FloatArray:
        """Points (n, 2) on the arc at the given shares (n,) of its length, counter-clockwise [mm]."""
        angle = self.start_rad + shares * self.turn_rad
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return np.asarray(np.array(self.centre_mm) + self.radius_mm * ring)

    def turn_to(self, line: Line) -> float:
        """Angle from the arc's start counter-clockwise to the outward direction of a line, at least 0 [rad]."""
        return (math.atan2(line.outward[1], line.outward[0]) - self.start_rad) % (2.0 * math.pi)

    def past_end_deg(self, angle_deg: float, half_width_mm: float) -> float:
        """Angle by which a facet in a direction from the arc's centre extends beyond the arc's nearer end [degrees]."""
        if self.turn_rad >= 2.0 * math.pi:
            return 0.0
        middle = self.start_rad + self.turn_rad / 2
        away = abs((math.radians(angle_deg) - middle + math.pi) % (2.0 * math.pi) - math.pi)
        half = math.asin(min(half_width_mm / self.radius_mm, 1.0)) if self.radius_mm > 0.0 else math.pi / 2
        return math.degrees(away + half - self.turn_rad / 2)

    def spans(self, angle_rad: FloatArray) -> BoolArray:
        """Whether directions (...,) from the arc's centre are in its sector or on the sector's border."""
        return np.asarray((angle_rad - self.start_rad + 1e-12) % (2.0 * np.pi) <= self.turn_rad + 2e-12)


PLAIN: Kind = "rectangle"
"""The usual kind of outline, which files and tables do not mention."""
X, Y = (1.0, 0.0), (0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Dimension:
    """A dimension of an outline for drawings and tables.

    Attributes
    ----------
    size_mm : the length
    direction : unit vector along which the length is measured, `X` or `Y`
    is_diameter : whether the dimension is the diameter of a disc
    """

    size_mm: float
    direction: Point
    is_diameter: bool = False


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A convex closed loop of lines and arcs.

    Attributes
    ----------
    kind : name of the shape in a design file
    box_mm : bounding box
    lines : flat walls and facets, which hold the optical parts
    arcs : pieces of round walls
    """

    kind: Kind
    box_mm: Box
    lines: tuple[Line, ...]
    arcs: tuple[Arc, ...] = ()

    @property
    def x0_mm(self) -> float:
        """Smallest x [mm]."""
        return self.box_mm[0]

    @property
    def y0_mm(self) -> float:
        """Smallest y [mm]."""
        return self.box_mm[1]

    @property
    def x1_mm(self) -> float:
        """Largest x [mm]."""
        return self.box_mm[2]

    @property
    def y1_mm(self) -> float:
        """Largest y [mm]."""
        return self.box_mm[3]

    @property
    def is_empty(self) -> bool:
        """Whether the bounding box has a negative size, so no location is inside."""
        return self.x1_mm < self.x0_mm or self.y1_mm < self.y0_mm

    def in_box(self, box_mm: Box) -> Outline:
        """An outline of the same kind, without facets, in another box."""
        return outline_in(self.kind, box_mm)

    @property
    def bare(self) -> Outline:
        """The outline without the facets of optical parts in its round walls."""
        return self.in_box(self.box_mm)

    @property
    def dimensions(self) -> tuple[Dimension, ...]:
        """Length and width, or the diameter of a disc."""
        x0, y0, x1, y1 = self.box_mm
        if self.kind == "disc":
            return (Dimension(size_mm=x1 - x0, direction=X, is_diameter=True),)
        return Dimension(size_mm=x1 - x0, direction=X), Dimension(size_mm=y1 - y0, direction=Y)

    @property
    def size_words(self) -> str:
        """Size as text for tables: `40 x 25 mm`, `disc of 55 mm`."""
        sizes = " x ".join(f"{one.size_mm:g}" for one in self.dimensions) + " mm"
        return sizes if self.kind == PLAIN else f"{self.kind} of {sizes}"

    @property
    def place_words(self) -> str:
        """Size and position as text for tables: `x 6 to 26, y 6 to 26 mm`, `disc of 20 mm around x 16, y 16 mm`."""
        (x0, y0, x1, y1), (x, y) = self.box_mm, self.centre_mm
        if self.kind == PLAIN:
            return f"x {x0:g} to {x1:g}, y {y0:g} to {y1:g} mm"
        return f"{self.size_words} around x {x:g}, y {y:g} mm"

    def touches_mm(self, direction: Point) -> tuple[Point, Point]:
        """Where the outline touches a side of its bounding box [mm]: both ends of a wall, or the same point twice.

        Parameters
        ----------
        direction : unit vector along an axis, out of the pad, that selects the side
        """
        for line in self.lines:
            if line.outward == direction:
                return line.ends
        dx, dy = direction
        arc = next(one for one in self.arcs if one.spans(np.array(math.atan2(dy, dx))))
        place = arc.centre_mm[0] + arc.radius_mm * dx, arc.centre_mm[1] + arc.radius_mm * dy
        return place, place

    @property
    def centre_mm(self) -> Point:
        """Middle of the bounding box (x, y) [mm]."""
        x0, y0, x1, y1 = self.box_mm
        return (x0 + x1) / 2, (y0 + y1) / 2

    @cached_property
    def loop(self) -> tuple[Line | Arc, ...]:
        """Lines and arcs in the order in which they follow each other, counter-clockwise."""
        x, y = self.centre_mm

        def turn(one: Line | Arc) -> float:
            px, py = one.points(np.array([0.5]))[0]
            return math.atan2(py - y, px - x)

        return tuple(sorted((*self.lines, *self.arcs), key=turn))

    def arc_towards(self, angle_deg: float) -> Arc:
        """The arc in a direction from its centre, or else the arc nearest to this direction."""
        turn = math.radians(angle_deg)

        def off(arc: Arc) -> float:
            away = abs((turn - arc.start_rad - arc.turn_rad / 2 + math.pi) % (2.0 * math.pi) - math.pi)
            return max(away - arc.turn_rad / 2, 0.0)

        return min(self.arcs, key=off)

    def gap_mm(self, x_mm: ArrayLike, y_mm: ArrayLike) -> FloatArray:
        """Distance (...,) of locations from the nearest wall [mm]; negative outside."""
        x, y = np.broadcast_arrays(np.asarray(x_mm, np.float64), np.asarray(y_mm, np.float64))
        gap = np.full(x.shape, np.inf)
        for line in self.lines:
            (ox, oy), (nx, ny) = line.origin, line.outward
            gap = np.minimum(gap, -((x - ox) * nx + (y - oy) * ny))
        for arc in self.arcs:
            px, py = x - arc.centre_mm[0], y - arc.centre_mm[1]
            within = np.where(arc.spans(np.arctan2(py, px)), arc.radius_mm - np.hypot(px, py), np.inf)
            gap = np.minimum(gap, within)
        return gap

    def contains(self, x_mm: ArrayLike, y_mm: ArrayLike, slack_mm: float = 1e-9) -> BoolArray:
        """Whether locations are inside the outline or on its border, (...,)."""
        return np.asarray(self.gap_mm(x_mm, y_mm) >= -slack_mm)

    def outside_mm(self, x_mm: float, y_mm: float) -> float:
        """Distance of a location from the outline, negative inside [mm]."""
        gap = float(self.gap_mm(x_mm, y_mm))
        x, y = self.clamped(x_mm, y_mm)
        return -gap if gap >= 0.0 else math.hypot(x_mm - x, y_mm - y)

    @property
    def corners_mm(self) -> tuple[Point, ...]:
        """The corners of the bounding box if they belong to the outline, else none; sorted by x, then by y."""
        x0, y0, x1, y1 = self.box_mm
        corners = ((x0, y0), (x0, y1), (x1, y0), (x1, y1))
        return corners if all(self.contains(*corner) for corner in corners) else ()

    def room_mm(self, width_mm: float) -> Point:
        """Length and width of a rectangle inside the outline around its middle, with at most the given width [mm].

        For a round outline with a large `width_mm` the rectangle is about the largest one.
        """
        length, width = self.x1_mm - self.x0_mm, self.y1_mm - self.y0_mm
        if self.corners_mm:
            return length, min(width_mm, width)
        across = min(length, width)
        wide = min(width_mm, width - across + across / math.sqrt(2))
        return length - across + math.sqrt(across**2 - max(wide - (width - across), 0.0) ** 2), wide

    def clamped(self, x_mm: float, y_mm: float) -> Point:
        """The location itself if it is inside, else a location on the border near it [mm]."""
        x, y = self._within_arcs(x_mm, y_mm)
        for line in self.lines:
            (ox, oy), (nx, ny) = line.origin, line.outward
            past = (x - ox) * nx + (y - oy) * ny
            if past > 0.0:
                x, y = x - past * nx, y - past * ny
        return self._within_arcs(x, y)

    def _within_arcs(self, x_mm: float, y_mm: float) -> Point:
        for arc in self.arcs:
            px, py = x_mm - arc.centre_mm[0], y_mm - arc.centre_mm[1]
            away = math.hypot(px, py)
            if away > arc.radius_mm and arc.spans(np.array(math.atan2(py, px))):
                share = arc.radius_mm / away
                return arc.centre_mm[0] + share * px, arc.centre_mm[1] + share * py
        return x_mm, y_mm

    def spread(self, shares: FloatArray) -> FloatArray:
        """Evenly distributed locations (n, 2) [mm] from evenly distributed numbers (n, 2) between 0 and 1."""
        low, high = np.array(self.box_mm[:2]), np.array(self.box_mm[2:])
        if not self.arcs:
            return np.asarray(low + shares * (high - low))
        middle, step = (low + high) / 2, np.linspace(0.0, 1.0, SPREAD_STEPS + 1)
        at, areas = [], []
        for k, one in enumerate(self.loop):
            (ax, ay), (bx, by) = (one.points(step)[:-1] - middle).T, (one.points(step)[1:] - middle).T
            turn = one.turn_rad / SPREAD_STEPS if isinstance(one, Arc) else 0.0
            bulge = one.radius_mm**2 * (turn - math.sin(turn)) if isinstance(one, Arc) else 0.0
            at.append(k + step)
            areas.append(np.append(0.0, ax * by - ay * bx + bulge))
        area = np.cumsum(np.concatenate(areas))
        place = np.interp(shares[:, 1], area / area[-1], np.concatenate(at))
        piece = np.minimum(place.astype(np.int64), len(self.loop) - 1)
        border = np.empty((len(shares), 2))
        for k, one in enumerate(self.loop):
            border[piece == k] = one.points((place - piece)[piece == k])
        return np.asarray(middle + np.sqrt(shares[:, :1]) * (border - middle))

    def farthest_mm(self, x_mm: float, y_mm: float) -> float:
        """Distance from a location to the farthest point of the border [mm]."""
        ends = np.concatenate([one.points(np.array([0.0, 1.0])) for one in self.loop])
        found = float(np.hypot(*(ends - (x_mm, y_mm)).T).max())
        for arc in self.arcs:
            px, py = arc.centre_mm[0] - x_mm, arc.centre_mm[1] - y_mm
            if arc.spans(np.array(math.atan2(py, px))):
                found = max(found, arc.radius_mm + math.hypot(px, py))
        return found

    @property
    def words(self) -> str:
        """Position as text for messages, such as `x 6 to 26 and y 6 to 26 mm`."""
        x0, y0, x1, y1 = self.box_mm
        if self.lines and self.arcs:
            return f"x {x0:g} to {x1:g} and y {y0:g} to {y1:g} mm with half-round ends"
        if self.arcs:
            x, y = self.centre_mm
            return f"within {(x1 - x0) / 2:g} mm of x {x:g}, y {y:g} mm"
        return f"x {x0:g} to {x1:g} and y {y0:g} to {y1:g} mm"

    def way_out_mm(self, start_mm: Point, direction: Point) -> float:
        """Distance from a location inside to the wall in the direction of a unit vector [mm]."""
        (x, y), (dx, dy) = start_mm, direction
        found = math.inf
        for line in self.lines:
            toward = dx * line.outward[0] + dy * line.outward[1]
            if toward > 1e-12:
                found = min(found, -line.along_and_outward_mm(x, y)[1] / toward)
        for arc in self.arcs:
            px, py = x - arc.centre_mm[0], y - arc.centre_mm[1]
            along = px * dx + py * dy
            square = along**2 - (px**2 + py**2 - arc.radius_mm**2)
            if square >= 0.0:
                far = math.sqrt(square) - along
                if arc.spans(np.array(math.atan2(py + far * dy, px + far * dx))):
                    found = min(found, far)
        return found

    def points(self, step_rad: float, pieces: int = 1) -> FloatArray:
        """Corners (n, 2) of a polygon along the outline, counter-clockwise [mm].

        Parameters
        ----------
        step_rad : largest angle between two corners on an arc
        pieces : number of pieces of each line
        """
        parts = [
            one.points(np.linspace(0.0, 1.0, pieces, endpoint=False))
            if isinstance(one, Line)
            else one.points(np.linspace(0.0, 1.0, math.ceil(one.turn_rad / step_rad - 1e-9), endpoint=False))
            for one in self.loop
        ]
        return np.concatenate(parts)

    def integral(self, about_mm: Point, nodes: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Nodes x, y (n,) [mm] and weights (n,) [mm²] of a quadrature rule over the area of the outline.

        The rule applies Gauss' rule along every line and arc, and along the rays from `about_mm` to the border. With
        (x, y) on the border relative to `about_mm` and s from 0 to 1 along a ray, the area is ∫ (x dy - y dx) ∫ s ds.
        The integrand must be smooth along every ray from `about_mm`.
        """
        nodes_at, weights = np.polynomial.legendre.leggauss(nodes)
        share, weight = (1.0 + nodes_at) / 2, weights / 2
        xs, ys, found = [], [], []
        for one in self.loop:
            if isinstance(one, Line):
                places, slopes = one.points(share), np.array(one.ends[1]) - np.array(one.ends[0])
            else:
                places = one.points(share)
                away = places - np.array(one.centre_mm)
                slopes = one.turn_rad * np.stack([-away[:, 1], away[:, 0]], axis=-1)
            px, py = (places - np.array(about_mm)).T
            dx, dy = np.broadcast_to(slopes, places.shape).T
            xs.append((about_mm[0] + np.outer(share, px)).ravel())
            ys.append((about_mm[1] + np.outer(share, py)).ravel())
            found.append(np.outer(weight * share, weight * (px * dy - py * dx)).ravel())
        return np.concatenate(xs), np.concatenate(ys), np.concatenate(found)

    @property
    def area_mm2(self) -> float:
        """Area [mm2]; approximate for a disc whose facets overlap, which cannot be manufactured."""
        x0, y0, _, _ = self.box_mm
        found = 0.0
        for one in self.loop:
            (ax, ay), (bx, by) = (one.points(np.array([0.0, 1.0])) - (x0, y0)).tolist()
            found += ax * by - bx * ay
            if isinstance(one, Arc):
                found += one.radius_mm**2 * (one.turn_rad - math.sin(one.turn_rad))
        return found / 2


def outline_in(kind: Kind, box_mm: Box, facets: Sequence[Line] = ()) -> Outline:
    """An outline of the given kind in a bounding box, with the facets of optical parts in its round walls."""
    if kind == "rectangle":
        return rectangle(box_mm)
    return disc(box_mm, facets) if kind == "disc" else stadium(box_mm, facets)


def rectangle(box_mm: Box) -> Outline:
    """A rectangular outline of four walls.

    The coordinate `along` increases with x on the south and north walls, and with y on the east and west walls.
    """
    x0, y0, x1, y1 = box_mm
    along_x, along_y = (1.0, 0.0), (0.0, 1.0)
    walls = (
        ("south", (x0, y0), along_x, (0.0, -1.0), x1 - x0),
        ("east", (x1, y0), along_y, (1.0, 0.0), y1 - y0),
        ("north", (x0, y1), along_x, (0.0, 1.0), x1 - x0),
        ("west", (x0, y0), along_y, (-1.0, 0.0), y1 - y0),
    )
    return Outline(
        kind="rectangle",
        box_mm=box_mm,
        lines=tuple(
            Line(name=name, origin=origin, tangent=tangent, outward=outward, length_mm=run)
            for name, origin, tangent, outward, run in walls
        ),
    )


def disc(box_mm: Box, facets: Sequence[Line] = ()) -> Outline:
    """A circular outline, with flat facets in place of the arcs where parts are."""
    x0, y0, x1, y1 = box_mm
    centre, radius = ((x0 + x1) / 2, (y0 + y1) / 2), (x1 - x0) / 2
    spans = sorted(
        (math.atan2(line.outward[1], line.outward[0]), math.asin(min(line.length_mm / 2 / radius, 1.0)))
        for line in facets
    )
    if not spans:
        whole = Arc(centre_mm=centre, radius_mm=radius, start_rad=0.0, turn_rad=2.0 * math.pi)
        return Outline(kind="disc", box_mm=box_mm, lines=(), arcs=(whole,))
    arcs = []
    for (low, half), (high, other) in zip(spans, (*spans[1:], spans[0]), strict=True):
        turn = (high - low) % (2.0 * math.pi) or (2.0 * math.pi if len(spans) == 1 else 0.0)
        turn -= half + other
        if turn > 0.0:
            arcs.append(Arc(centre_mm=centre, radius_mm=radius, start_rad=low + half, turn_rad=turn))
    return Outline(kind="disc", box_mm=box_mm, lines=tuple(facets), arcs=tuple(arcs))


def stadium(box_mm: Box, facets: Sequence[Line] = ()) -> Outline:
    """An outline of two walls along the longer side and a half circle at each end, with flat facets where parts are."""
    x0, y0, x1, y1 = box_mm
    radius = min(x1 - x0, y1 - y0) / 2
    if x1 - x0 >= y1 - y0:
        between, names, turned = (x0 + radius, y0, x1 - radius, y1), ("south", "north"), -math.pi / 2
        centres = ((x1 - radius, (y0 + y1) / 2), (x0 + radius, (y0 + y1) / 2))
    else:
        between, names, turned = (x0, y0 + radius, x1, y1 - radius), ("east", "west"), 0.0
        centres = (((x0 + x1) / 2, y1 - radius), ((x0 + x1) / 2, y0 + radius))
    straight = tuple(line for line in rectangle(between).lines if line.name in names)
    arcs = [
        arc
        for centre, start in zip(centres, (turned, turned + math.pi), strict=True)
        for arc in _left_of_half(
            Arc(centre_mm=centre, radius_mm=radius, start_rad=start, turn_rad=math.pi), facets
        )
    ]
    return Outline(kind="stadium", box_mm=box_mm, lines=(*straight, *facets), arcs=tuple(arcs))


def _left_of_half(half: Arc, facets: Sequence[Line]) -> list[Arc]:
    left, done = [], 0.0
    for line in sorted(facets, key=half.turn_to):
        middle, cut = half.turn_to(line), math.asin(min(line.length_mm / 2 / half.radius_mm, 1.0))
        if middle <= half.turn_rad:
            left.append(replace(half, start_rad=half.start_rad + done, turn_rad=middle - cut - done))
            done = middle + cut
    left.append(replace(half, start_rad=half.start_rad + done, turn_rad=half.turn_rad - done))
    return [piece for piece in left if piece.turn_rad > 0.0]
