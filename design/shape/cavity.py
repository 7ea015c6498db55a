"""The geometry of the cavity, which the printed mold and the light model share.

In the cavity's coordinate system, x and y run from 0 at one corner of the cavity's bounding box to the inner length and
width. The plane z = 0 is the bottom of the clear layer, and z = clear thickness is the undisturbed top. An optical part
(emitter or receiver) is behind its wall: its active face is flush with the inner face of the wall, and its body extends
outward. Or it stands on the floor, a circuit board below the black layer: then its face is at the height of its body.

      z ^   rim            ......
        |  |      |        clear thickness (undisturbed top)
        |  |[body]|== active face, centre at height_mm
        |  |______|        0: bottom of the clear layer
        |  | black |       -black thickness
        |  | floor |       -black thickness - floor

A `Plan` combines the pad's outline, seen from above, with its top. In a round wall each part has a flat facet.

The module also selects the emitter-receiver pairs whose response is judged, and the location of the press for each.

The chord of a pair is the straight line between its parts, seen from above. A pair has a path if its parts are in
different walls, or both on the floor and near each other (`reach_mm`): a press changes the light that goes
by way of the top. The press for a pair is at the midpoint of its chord, or at the nearest location in the workspace.
The pair is judged if the tip is then over the chord. Other pairs are reported but not judged: those with both parts in
one wall, and those across a corner that no press can reach. In facing rows, all emitters are in one wall and all
receivers in the opposite one; the judged pairs are those that face each other, the middle one first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import DesignError
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.once import once
from optopad.design.parts.catalog import Part
from optopad.design.shape.outline import Arc, Line, Outline, Point, outline_in
from optopad.design.shape.top import Top
from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import FLOOR, OPPOSITE, Kind, Placement, angle_name, expand
from optopad.design.spec.properties import clearance_mm, part_of

NODES = 32
"""Number of nodes of Gauss' rule along each wall, and from the middle to the wall."""
TURN_RAD = 2.0 * math.pi / 96
"""Angle between two corners of the polygon that represents a round wall.

The arc bulges beyond the polygon's side by 5e-4 of its radius.
"""
RIGHT_DEG = 90.0
"""Tilt of a part whose face is vertical [deg]."""
PIECES = 16
"""Number of pieces of a straight wall in drawings where its upper edge is curved."""


def facet(arc: Arc, angle_deg: float, half_width_mm: float) -> Line:
    """A flat facet in a round wall; its coordinate `along` is 0 at its clockwise end and increases counter-clockwise.

    Parameters
    ----------
    arc : the round wall
    angle_deg : direction from the arc's centre, 0 along x, 90 along y
    half_width_mm : half width of the facet, less than the arc's radius
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
    """Cosine and sine of an angle, exact at multiples of 90 degrees."""
    turns, rest = divmod(angle_deg % 360.0, 90.0)
    cosine, sine = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(turns)):
        cosine, sine = -sine, cosine
    return cosine + 0.0, sine + 0.0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Outline of a pad seen from above, and its top.

    Attributes
    ----------
    outline : outline in the cavity's coordinate system, with a flat facet for each part in a round wall
    top : the untouched top
    """

    outline: Outline
    top: Top

    @property
    def is_block(self) -> bool:
        """Whether the pad is a rectangular block, so that mirrored images of the parts give exact light paths."""
        return self.top.is_flat and self.outline.kind == "rectangle"

    @property
    def has_origin_corner(self) -> bool:
        """Whether the origin of x and y is a corner of the pad, and not only of its bounding box."""
        return self.contains(0.0, 0.0)

    @property
    def walls(self) -> tuple[Line, ...]:
        """The flat walls, including the facets in round walls."""
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
        """Middle of the pad (x, y), under the highest point [mm]."""
        return self.outline.centre_mm

    @property
    def radius_mm(self) -> float:
        """Distance of the pad's farthest point from its middle [mm]; the radius of a disc."""
        if self.has_origin_corner:
            return math.hypot(self.length_mm, self.width_mm) / 2
        return max(self.length_mm, self.width_mm) / 2

    def stands_mm(self, wall: Line) -> float:
        """Distance of a wall from the middle of the pad [mm]."""
        return -wall.along_and_outward_mm(*self.centre_mm)[1]

    @property
    def area_mm2(self) -> float:
        """Area seen from above [mm2]."""
        return self.outline.area_mm2

    @property
    def rim_mm(self) -> tuple[float, float]:
        """Lowest and highest height of the edge between the untouched top and the walls [mm]."""
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
        """Unit normal (x, y, z) of the untouched top, pointing out of the pad; a press moves against it."""
        nx, ny, nz = self.top.normal(x_mm, y_mm).tolist()
        return nx, ny, nz

    def contains(self, x_mm: float, y_mm: float) -> bool:
        """Whether a location is in the pad or on its border."""
        return bool(self.outline.contains(x_mm, y_mm))

    @property
    def clear_volume_mm3(self) -> float:
        """Volume of the clear layer below the untouched top [mm3]."""
        x, y, weight = self.outline.integral(self.centre_mm, NODES)
        return self.area_mm2 * self.clear_mm - float(weight @ self.top.sag_mm(x, y))


@once
def plan_of(design: SensorDesign) -> Plan:
    """Outline and top of a design's pad, without the facets of its parts in round walls."""
    return plan_with(design, ())


def plan_with(design: SensorDesign, facets: Sequence[Line]) -> Plan:
    """Outline and top of a design's pad, with facets in its round walls."""
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
    """Corners (n, 2) of a polygon along a pad's outline, counter-clockwise [mm]; arcs are represented by chords."""
    return plan.outline.points(TURN_RAD)


def edge_mm(plan: Plan) -> FloatArray:
    """Edge of the untouched top as a polygon (n, 3), counter-clockwise: x, y, z in the cavity's coordinates [mm].

    Heights are NaN where the crown's radius is too small for the pad.
    """
    corners = plan.outline.points(TURN_RAD, 1 if plan.top.is_flat else PIECES)
    return np.column_stack([corners, plan.top.height_mm(*corners.T)])


@dataclass(frozen=True, kw_only=True)
class PlacedPart:
    """A catalogue part at its position on a wall.

    Attributes
    ----------
    name : name of the part, such as E1
    kind : `emitter` or `receiver`
    line : the flat wall that holds it, or its own facet in a round wall
    along_mm : position of the active area's centre along the wall
    height_mm : height of the active area's centre above the clear layer's bottom
    part_id : identifier in the catalogue
    part : entry of the catalogue, with the design's measured values
    clear_mm : height of the untouched top over the part, the lower of its values at both ends of the active area
    origin : dotted path of the layout entry that placed the part
    height_field : dotted path of the field that sets its height
    angle_deg : direction of its facet in a round wall; None in a straight wall
    tilt_deg : angle between its axis and the vertical: 90 in a wall; on the floor, 0 looks up
    coupler : name of the package that it shares with a part of the other kind, such as OC1; None if it has its own
    """

    name: str
    kind: Kind
    line: Line
    along_mm: float
    height_mm: float
    part_id: str
    part: Part
    clear_mm: float
    origin: str
    height_field: str
    angle_deg: float | None = None
    tilt_deg: float = RIGHT_DEG
    coupler: str | None = None

    @property
    def wall(self) -> str:
        """Name of the wall: south, east, north, west or floor, or a facet's direction, such as `45-degree`."""
        return self.line.name

    @property
    def is_on_floor(self) -> bool:
        """Whether the part stands on the floor; its `line` then passes under it, outward against its direction."""
        return self.line.name == FLOOR

    @property
    def is_leaning(self) -> bool:
        """Whether the part neither looks up nor stands upright, so that it leans over the floor."""
        return 0.0 < self.tilt_deg < RIGHT_DEG

    @property
    def turn_deg(self) -> float:
        """Direction in plan in which the part looks, or in which a part that looks up is turned [deg]."""
        return math.degrees(math.atan2(-self.line.outward[1], -self.line.outward[0])) % 360.0

    @property
    def axis(self) -> tuple[float, float, float]:
        """Unit vector in which the face looks, into the pad."""
        sine, cosine = self._tilt
        return -sine * self.line.outward[0], -sine * self.line.outward[1], cosine

    @property
    def _tilt(self) -> Point:
        """Sine and cosine of the tilt, exact for a wall and for a part that looks up."""
        cosine, sine = _unit(self.tilt_deg)
        return sine, cosine

    @property
    def half_width_mm(self) -> float:
        """Half of the active area's width along the wall [mm]."""
        return self.part.active_width_mm.value / 2

    @property
    def half_height_mm(self) -> float:
        """Half of the active area's height [mm]."""
        return self.part.active_height_mm.value / 2

    @property
    def rise_mm(self) -> float:
        """Distance of the active area's upper edge above its centre [mm]; 0 if it looks up."""
        return self.half_height_mm * self._tilt[0]

    @property
    def lost_share(self) -> float:
        """Share of the active area above the undisturbed surface or below the clear layer [-]."""
        rise = self.rise_mm
        if rise == 0.0:
            return 0.0 if -ROUNDING_MM <= self.height_mm < self.clear_mm else 1.0
        low, high = self.height_mm - rise, self.height_mm + rise
        inside = max(0.0, min(high, self.clear_mm) - max(low, 0.0))
        return 1.0 - inside / (high - low)

    @property
    def body_base_mm(self) -> float:
        """Height of the lower end of the part's body above the clear layer's bottom [mm]; may be negative."""
        return self.height_mm - _face_in_body_mm(self.part, self.tilt_deg)

    @property
    def body_top_mm(self) -> float:
        """Height of the upper end of the part's body above the clear layer's bottom [mm]."""
        above = self.part.body_height_mm.value - self.part.active_height_in_body_mm.value
        return self.height_mm + self._tilt[0] * above

    @property
    def place_lines(self) -> tuple[str, ...]:
        """Position in short lines: x or y [mm] in a straight wall, a direction in a round one, x and y on the floor."""
        x, y, _ = self.position_mm
        if self.is_on_floor:
            return f"x {x:.2f}", f"y {y:.2f}"
        if self.angle_deg is not None:
            return (f"at {self.wall.removesuffix('-degree')} deg",)
        return (f"x {x:.2f}" if self.line.outward[0] == 0.0 else f"y {y:.2f}",)

    @property
    def place_words(self) -> str:
        """Position in words: the wall and the position in it, or the floor with x and y and where a part looks."""
        place = ", ".join(self.place_lines)
        if self.angle_deg is not None:
            return place
        words = f"{self.wall}{'' if self.is_on_floor else ' wall'}, {place} mm"
        if not self.is_on_floor or self.tilt_deg == 0.0:
            return words
        return f"{words}, tilted {self.tilt_deg:g} deg towards {self.turn_deg:g} deg"

    @property
    def footprint_mm(self) -> FloatArray:
        """(4, 2) corners of its body seen from above, from the side at its face [mm].

        On the floor, a part that looks up lies on its back; one that looks level reaches back by its depth.
        """
        (sine, cosine), size = self._tilt, self.part
        half, low = size.body_width_mm.value / 2, size.active_height_in_body_mm.value
        front, back = -low * cosine, (size.body_height_mm.value - low) * cosine
        ends = (front, back + size.body_depth_mm.value * sine)
        corners = ((-half, ends[0]), (half, ends[0]), (half, ends[1]), (-half, ends[1]))
        return np.array([self.line.point(self.along_mm + along, out) for along, out in corners])

    @property
    def face_mm(self) -> FloatArray:
        """(4, 3) corners of its active area [mm]: lower edge along `line.tangent`, then the upper one back."""
        (sine, cosine), (x, y, z) = self._tilt, self.position_mm
        (tx, ty), (ox, oy) = self.line.tangent, self.line.outward
        half, up = self.half_width_mm, self.half_height_mm
        corners = ((-half, -up), (half, -up), (half, up), (-half, up))
        return np.array(
            [(x + a * tx + b * cosine * ox, y + a * ty + b * cosine * oy, z + b * sine) for a, b in corners]
        )

    @property
    def body_mm(self) -> FloatArray:
        """(8, 3) corners of its body [mm]: those behind, then those in the plane of the face.

        Each four are counter-clockwise as seen from the front, from the lower edge on.
        """
        (sine, cosine), size, low = self._tilt, self.part, self.part.active_height_in_body_mm.value
        (ox, oy), (x, y, z) = self.line.outward, self.position_mm
        across = np.array([oy, -ox, 0.0])
        up, front = np.array([cosine * ox, cosine * oy, sine]), np.array(self.axis)
        half, high = size.body_width_mm.value / 2, size.body_height_mm.value - low
        face = [a * across + b * up for a, b in ((-half, -low), (half, -low), (half, high), (-half, high))]
        back = -size.body_depth_mm.value * front
        return np.asarray(np.array([x, y, z]) + np.array([*(one + back for one in face), *face]))

    @property
    def label_way(self) -> Point:
        """Direction in plan from the part to its label: out of the pad for a part in a wall, north on the floor."""
        return (0.0, 1.0) if self.is_on_floor else self.line.outward

    def body_mm3(self, low_mm: float, high_mm: float) -> float:
        """Volume of the body of a part on the floor between two heights [mm3]; about, for a body that leans."""
        size = self.part
        volume = size.body_width_mm.value * size.body_height_mm.value * size.body_depth_mm.value
        shared = min(high_mm, self.body_top_mm) - max(low_mm, self.body_base_mm)
        return volume * max(shared, 0.0) / (self.body_top_mm - self.body_base_mm)

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Centre of the active area (x, y, z) in the cavity's coordinate system [mm]."""
        return (*self.line.point(self.along_mm), self.height_mm)


@dataclass(frozen=True, kw_only=True)
class CavityGeometry:
    """Geometry of a design's cavity: pad, optical parts and workspace.

    Attributes
    ----------
    plan : outline and top of the pad
    black_mm : thickness of the black layer
    emitters, receivers : placed parts in the order of the arrays and pins
    workspace : area of the permitted press locations
    tip_radius_mm : radius of the indenter; a pair is judged if its press is within this distance of its chord
    reach_mm : largest distance of two parts on the floor that count as a pair with a path
    """

    plan: Plan
    black_mm: float
    emitters: tuple[PlacedPart, ...]
    receivers: tuple[PlacedPart, ...]
    workspace: Outline
    tip_radius_mm: float
    reach_mm: float

    @property
    def length_mm(self) -> float:
        """Inner size along x [mm]."""
        return self.plan.length_mm

    @property
    def width_mm(self) -> float:
        """Inner size along y [mm]."""
        return self.plan.width_mm

    @property
    def clear_mm(self) -> float:
        """Thickness of the clear layer at its highest point [mm]."""
        return self.plan.clear_mm

    @property
    def parts(self) -> tuple[PlacedPart, ...]:
        """All placed parts, emitters first."""
        return self.emitters + self.receivers

    @property
    def on_floor(self) -> tuple[PlacedPart, ...]:
        """The placed parts on the floor, emitters first."""
        return tuple(part for part in self.parts if part.is_on_floor)

    @property
    def layers_mm3(self) -> tuple[float, float]:
        """Volumes of the black and of the clear layer, without the bodies of parts on the floor [mm3]."""
        black = sum(part.body_mm3(-self.black_mm, 0.0) for part in self.on_floor)
        clear = sum(part.body_mm3(0.0, part.clear_mm) for part in self.on_floor)
        return self.plan.area_mm2 * self.black_mm - black, self.plan.clear_volume_mm3 - clear

    @property
    def volume_mm3(self) -> float:
        """Volume of the cavity up to the undisturbed top, both layers, without sockets [mm3]."""
        plan = self.plan
        if plan.is_block:
            return plan.length_mm * plan.width_mm * (plan.clear_mm + self.black_mm)
        return plan.clear_volume_mm3 + plan.area_mm2 * self.black_mm

    def wall_length_mm(self, wall: str) -> float:
        """Inner length of a flat wall [mm]."""
        return next(line.length_mm for line in self.plan.walls if line.name == wall)


@once
def cavity_of(design: SensorDesign) -> CavityGeometry:
    """Compute the cavity of a design and the positions of its optical parts.

    Raises
    ------
    DesignError : a part is not in the catalogue, or is of the other kind (emitter or receiver).
    """
    size = design.cavity
    bare, parts = plan_of(design), dict[tuple[str, Kind], Part]()
    placed = tuple(_placed(design, place, bare, parts) for place in expand(design.layout, size))
    return CavityGeometry(
        plan=plan_with(
            design, [part.line for part in placed if part.line not in bare.walls and not part.is_on_floor]
        ),
        black_mm=size.black_thickness_mm,
        emitters=tuple(part for part in placed if part.kind == "emitter"),
        receivers=tuple(part for part in placed if part.kind == "receiver"),
        workspace=workspace_of(design),
        tip_radius_mm=design.indenter.tip_radius_mm,
        reach_mm=(FLOOR_REACH if design.top is None else SKIN_REACH) * bare.clear_mm,
    )


@once
def workspace_of(design: SensorDesign) -> Outline:
    """Area of the permitted press locations, with the required margin from tip to wall; empty for a small pad."""
    size, inset = design.cavity, design.indenter.tip_radius_mm + design.operating.workspace_margin_mm
    return outline_in(size.outline, (inset, inset, size.length_mm - inset, size.width_mm - inset))


def part_field(place: Placement) -> str:
    """Dotted path of the field that names the catalogue part of a layout position.

    It is a field of the layout entry if that names a part, else of the table `emitters` or `receivers`.
    """
    return f"{place.origin}.part" if place.part is not None else f"{place.kind}s.part"


def part_half_width_mm(design: SensorDesign, place: Placement) -> tuple[float, str]:
    """Half width of a part's socket along its wall, or of its facet in a round wall [mm], and the part's identifier.

    Raises
    ------
    DesignError : a part is not in the catalogue, or is of the other kind (emitter or receiver).
    """
    section = design.emitters if place.kind == "emitter" else design.receivers
    part_id = place.part or section.part
    body = part_of(design, part_id, place.kind).body_width_mm.value
    return body / 2 + clearance_mm(design.mold, part_id), part_id


def _placed(
    design: SensorDesign, place: Placement, bare: Plan, parts: dict[tuple[str, Kind], Part]
) -> PlacedPart:
    section = design.emitters if place.kind == "emitter" else design.receivers
    part_id = place.part or section.part
    if (part_id, place.kind) not in parts:
        try:
            parts[part_id, place.kind] = part_of(design, part_id, place.kind)
        except DesignError as err:
            raise DesignError(f"{part_field(place)}: {err}") from None
    part = parts[part_id, place.kind]
    if place.at_mm is not None:
        return _standing(design, place, bare, part_id, part)
    line, along = next((wall for wall in bare.walls if wall.name == place.wall), None), place.along_mm
    if line is None:
        half = part_half_width_mm(design, place)[0]
        angle = place.angle_deg or 0.0
        line, along = facet(bare.outline.arc_towards(angle), angle, half), half
    return PlacedPart(
        name=place.name,
        kind=place.kind,
        line=line,
        along_mm=along,
        height_mm=place.height_mm or section.height_mm or math.nan,
        part_id=part_id,
        part=part,
        clear_mm=_top_over_mm(bare, line, along, part.active_width_mm.value / 2),
        origin=place.origin,
        height_field=f"{place.kind}s.height_mm" if place.height_mm is None else f"{place.origin}.height_mm",
        angle_deg=place.angle_deg,
    )


def _standing(design: SensorDesign, place: Placement, bare: Plan, part_id: str, part: Part) -> PlacedPart:
    """A part on the floor. By default its body stands on the board, at the bottom of the black layer."""
    assert place.at_mm is not None
    cosine, sine = _unit(place.turn_deg)
    line = Line(
        name=FLOOR, origin=place.at_mm, tangent=(-sine, cosine), outward=(-cosine, -sine), length_mm=0.0
    )
    rests = _face_in_body_mm(part, place.tilt_deg) - design.cavity.black_thickness_mm
    rests = 0.0 if abs(rests) < ROUNDING_MM else rests
    reach = max(part.active_width_mm.value, part.active_height_mm.value) / 2
    corners = [line.point(a, b) for a in (-reach, reach) for b in (-reach, reach)]
    inside = [bare.top_mm(*corner) for corner in corners if bare.contains(*corner)]
    return PlacedPart(
        name=place.name,
        kind=place.kind,
        line=line,
        along_mm=0.0,
        height_mm=rests if place.height_mm is None else place.height_mm,
        part_id=part_id,
        part=part,
        clear_mm=min(inside, default=bare.clear_mm),
        origin=place.origin,
        height_field="cavity.black_thickness_mm" if place.height_mm is None else f"{place.origin}.height_mm",
        tilt_deg=place.tilt_deg,
        coupler=place.coupler,
    )


def _face_in_body_mm(part: Part, tilt_deg: float) -> float:
    """Height of the active area's centre above the lowest point of a part's body at a tilt [mm].

    A part that looks up lies on its back, and one that looks level stands.
    """
    cosine, sine = _unit(tilt_deg)
    return cosine * part.body_depth_mm.value + sine * part.active_height_in_body_mm.value


def _top_over_mm(bare: Plan, line: Line, along_mm: float, half_width_mm: float) -> float:
    """Height of the untouched top over an active area, the lower of the values at both ends [mm]."""
    return min(bare.top_mm(*line.point(along_mm + side)) for side in (-half_width_mm, half_width_mm))


FLOOR_REACH, SKIN_REACH = 2.5, 1.5
"""Largest distance of two parts on the floor that count as a pair with a path [thicknesses of the clear layer].

Under a bare top, and under a skin. A bare flat top mirrors all light between parts that are 2.0 thicknesses apart or
more (critical angle 45 degrees), and these pairs are the brightest. Under a skin, the nearest are.
"""
FACING_TOLERANCE_MM = 1e-6
"""Parts in opposite walls face each other if their positions along the walls differ by at most this [mm]."""


def direct_path_pairs(cavity: CavityGeometry) -> BoolArray:
    """Whether the parts of each pair are in different walls, or near on the floor, (emitter, receiver)."""
    reach = cavity.reach_mm

    def is_near(e: PlacedPart, r: PlacedPart) -> bool:
        return math.dist(e.position_mm[:2], r.position_mm[:2]) <= reach if e.is_on_floor else False

    return np.array(
        [[e.wall != r.wall or is_near(e, r) for r in cavity.receivers] for e in cavity.emitters],
        dtype=np.bool_,
    ).reshape(len(cavity.emitters), len(cavity.receivers))


def is_facing_rows(cavity: CavityGeometry) -> bool:
    """Whether all emitters are in one wall and all receivers in the opposite one, with at least one facing pair."""
    return bool(facing_pairs(cavity))


def _sit_opposite(cavity: CavityGeometry) -> bool:
    emitter_walls = {part.wall for part in cavity.emitters}
    receiver_walls = {part.wall for part in cavity.receivers}
    opposite = {wall: other for wall, other in OPPOSITE.items() if emitter_walls == {wall}}
    return receiver_walls == set(opposite.values()) and bool(opposite)


def facing_pairs(cavity: CavityGeometry) -> tuple[tuple[int, int], ...]:
    """Facing pairs as (emitter, receiver) indices, the middle pair first; empty for a pad without facing rows."""
    if not _sit_opposite(cavity):
        return ()
    pairs = [
        (i, j)
        for i, e in enumerate(cavity.emitters)
        for j, r in enumerate(cavity.receivers)
        if abs(e.along_mm - r.along_mm) <= FACING_TOLERANCE_MM
    ]
    middle = cavity.wall_length_mm(cavity.emitters[0].wall) / 2
    return tuple(sorted(pairs, key=lambda pair: abs(cavity.emitters[pair[0]].along_mm - middle)))


def judged_pairs(cavity: CavityGeometry) -> tuple[tuple[int, int], ...]:
    """Pairs that are judged one by one and determine the gain, as (emitter, receiver) indices.

    In facing rows these are the pairs that face each other. On other pads they are the pairs with parts in different
    walls whose straight path passes below the tip at their press. If there are no such pairs, all pairs with parts in
    different walls are judged.
    """
    facing = facing_pairs(cavity)
    if facing:
        return facing
    direct = tuple((int(i), int(j)) for i, j in np.argwhere(direct_path_pairs(cavity)))
    return tuple(pair for pair in direct if _comes_between(cavity, pair)) or direct


def _comes_between(cavity: CavityGeometry, pair: tuple[int, int]) -> bool:
    """Whether the tip is over a pair's chord (the straight line between its parts) in the press for this pair."""
    return beside_chord(cavity, pair, chord_midpoint_mm(cavity, pair))[0] <= cavity.tip_radius_mm


def beside_chord(
    cavity: CavityGeometry, pair: tuple[int, int], place_mm: tuple[float, float]
) -> tuple[float, float]:
    """Distance of a location from a pair's chord [mm], and the nearest point's position on the chord.

    The chord is the straight line between the parts. The position is 0 at the emitter and 1 at the receiver.
    """
    ends = (cavity.emitters[pair[0]], cavity.receivers[pair[1]])
    start, end = (np.array(part.position_mm[:2]) for part in ends)
    along, to_place = end - start, np.array(place_mm) - start
    squared = float(along @ along)  # 0 for parts of two walls in their common corner
    share = float(np.clip(to_place @ along / squared, 0.0, 1.0)) if squared > 0.0 else 0.0
    return float(np.hypot(*(to_place - share * along))), share


def pair_name(cavity: CavityGeometry, pair: tuple[int, int]) -> str:
    """Name of a pair, such as E1-R3."""
    return f"{cavity.emitters[pair[0]].name}-{cavity.receivers[pair[1]].name}"


def mask_of(pairs: tuple[tuple[int, int], ...], cavity: CavityGeometry) -> BoolArray:
    """Mask (emitter, receiver) that is true for the given pairs."""
    mask = np.zeros((len(cavity.emitters), len(cavity.receivers)), dtype=np.bool_)
    for i, j in pairs:
        mask[i, j] = True
    return mask


def chord_midpoint_mm(cavity: CavityGeometry, pair: tuple[int, int]) -> tuple[float, float]:
    """Location x, y of a pair's press [mm]: the midpoint between its parts, clamped to the workspace."""
    ex, ey, _ = cavity.emitters[pair[0]].position_mm
    rx, ry, _ = cavity.receivers[pair[1]].position_mm
    return cavity.workspace.clamped((ex + rx) / 2, (ey + ry) / 2)
