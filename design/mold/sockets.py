r"""Numeric model of a socket: the cuts that hold one optical part in the mold's wall.

Positions are in the cavity's coordinate system. A part is inserted from the top. Its pocket is open upward, and open to
the cavity so that silicone is cast against the active face. The drawing shows the wall at low y from above (t is
measured outward):

            cavity
      ------+           +------  t = 0, inner face of the wall
            |   body    |
            |           |        pocket: body + clearance at each side and behind
            +--+  +--+--+        t = pocket depth
               |  |  |           surface part: one slot per wire, open upward, to the outside
               |  |  |           radial part: round holes from the pocket's floor down through the mold
      ---------+  +--+---------  t = wall thickness, outer face

Pocket and slots extend down to the body's base less the clearance, so the part is always at its height in the design. A
base below the clear layer is in the black layer. A pocket may even extend into the floor of the mold, and
`optopad.design.mold.webs` then requires enough floor under it.

Leads are in a row along the wall, centred on the active area. Radial leads leave the body at half its depth, unless the
catalogue states their setback. Wires that do not fit separately behind the body leave together through one slot in the
middle.

For strain relief a wire slot ends in a neck that is narrower than the wire; the wire is pressed in from above. Radial
leads bend into a channel in the underside that leads outward, so that the mold is flat. The depth of the channel is
limited by the floor under the pocket. There is no channel if a lead would not fit in it.

Collars are walls above the rim that hold taller bodies up to their top.

            body
         ___ | ___   collar, up to the body's top
        |   | |   |
    ____|   | |   |__  rim           neighbours closer than three webs share one collar
            | |
    cavity  |_|  pocket

A web is a wall of the least printable thickness. A collar starts behind the pour lip and leaves a web around its
pockets on the other three sides. Pocket and slots are open upward through the collar. There is no collar where it would
meet a fixing hole. The body is then exposed, which `optopad.design.mold.webs.bodies_above_rim` reports.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.parts.catalog import Part
from optopad.design.shape.cavity import PlacedPart
from optopad.design.shape.outline import Line
from optopad.design.spec import Mold
from optopad.design.spec.pad import WALLS
from optopad.design.spec.properties import clearance_mm, fit

NECK_MM = 1.5
"""Length of the neck of a wire slot, if the slot is at least twice as long."""
CHANNEL_DEPTH_MM = 1.5
"""Depth of the channel for leads where the floor is thick enough: it holds a bent lead with its sleeve."""
CHANNEL_MARGIN_MM = 0.1
"""Distance between a lead hole and the edge of its channel, because tangent cuts do not give a manifold."""


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box with edges along the axes of the cavity's coordinate system [mm]."""

    x0: float
    x1: float
    y0: float
    y1: float
    z0: float
    z1: float


@dataclass(frozen=True, kw_only=True)
class Hole:
    """A vertical round hole, in the cavity's coordinate system [mm]."""

    x: float
    y: float
    radius: float
    z0: float
    z1: float


@dataclass(frozen=True, kw_only=True)
class WallFrame:
    """Coordinate system of a wall of the mold: along the wall, and outward from its inner face.

    Attributes
    ----------
    line : inner face of the wall, seen from above
    thickness_mm : thickness of the wall; in a round wall, at the middle of the facet
    outer_radius_mm : radius of a round outer face, whose centre is opposite the facet's middle; 0 for a flat outer face
    """

    line: Line
    thickness_mm: float
    outer_radius_mm: float = 0.0

    @property
    def is_facet(self) -> bool:
        """Whether the wall is the facet of a single part in a round wall."""
        return self.outer_radius_mm > 0.0

    @property
    def wall(self) -> str:
        """Name of the wall: south, east, north or west, or the direction of a facet, such as `45-degree`."""
        return self.line.name

    @property
    def length_mm(self) -> float:
        """Inner length of the wall [mm]."""
        return self.line.length_mm

    def point(self, along_mm: float, outward_mm: float) -> tuple[float, float]:
        """Position (x, y) in the cavity's coordinate system [mm]."""
        return self.line.point(along_mm, outward_mm)

    def along_and_outward_mm(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """Coordinates of a location along the wall and outward from it [mm]; the inverse of `point`."""
        return self.line.along_and_outward_mm(x_mm, y_mm)

    def thickness_at_mm(self, along_mm: float) -> float:
        """Distance from the inner face outward to the outer face, at a position along the wall [mm]."""
        if not self.is_facet:
            return self.thickness_mm
        beside = along_mm - self.length_mm / 2
        radius = self.outer_radius_mm
        return self.thickness_mm - (radius - math.sqrt(max(radius**2 - beside**2, 0.0)))

    def corners(self, cut: Cut) -> tuple[tuple[float, float], ...]:
        """Corners (x, y) of a cut seen from above, in order around the cut [mm]."""
        ends = (
            (cut.along0, cut.out0),
            (cut.along1, cut.out0),
            (cut.along1, cut.out1),
            (cut.along0, cut.out1),
        )
        return tuple(self.point(*end) for end in ends)

    def middle(self, cut: Cut) -> tuple[float, float]:
        """Middle (x, y) of a cut seen from above [mm]."""
        return self.point((cut.along0 + cut.along1) / 2, (cut.out0 + cut.out1) / 2)

    @property
    def runs_along_axes(self) -> bool:
        """Whether the wall is parallel to x or y, so that the edges of a cut in it are along the cavity's axes."""
        return 0.0 in self.line.outward

    def box(self, cut: Cut) -> Box:
        """A cut of this wall as a box along the cavity's axes; for a facet, the bounding box of the cut."""
        xs, ys = zip(*self.corners(cut), strict=True)
        return Box(x0=min(xs), x1=max(xs), y0=min(ys), y1=max(ys), z0=cut.floor, z1=cut.top)

    def gap_mm(self, cut: Cut, hole: Hole) -> float:
        """Horizontal distance between a cut of this wall and a hole [mm]; negative if they overlap."""
        along, outward = self.along_and_outward_mm(hole.x, hole.y)
        return _signed_mm(cut, along, outward) - hole.radius

    def apart_mm(self, cut: Cut, other: WallFrame, cut_there: Cut) -> float:
        """Horizontal distance between a cut of this wall and a cut of another wall [mm]; zero or less if they overlap.

        If the middle of one cut is inside the other, they overlap. Otherwise one of them has a corner at the shortest
        distance.
        """
        mine = [
            self.along_and_outward_mm(*place)
            for place in (*other.corners(cut_there), other.middle(cut_there))
        ]
        theirs = [other.along_and_outward_mm(*place) for place in (*self.corners(cut), self.middle(cut))]
        return min(
            *(_signed_mm(cut, *place) for place in mine), *(_signed_mm(cut_there, *place) for place in theirs)
        )


def _signed_mm(cut: Cut, along_mm: float, outward_mm: float) -> float:
    """Horizontal distance of a point from a cut, in the wall's coordinates [mm]; negative inside the cut."""
    beside = max(cut.along0 - along_mm, along_mm - cut.along1)
    behind = max(cut.out0 - outward_mm, outward_mm - cut.out1)
    return math.hypot(max(beside, 0.0), max(behind, 0.0)) + min(max(beside, behind), 0.0)


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A rectangular cut in the coordinates of a wall: along it, outward from its inner face, and upward [mm]."""

    along0: float
    along1: float
    out0: float
    out1: float
    floor: float
    top: float


@dataclass(frozen=True, kw_only=True)
class Socket:
    """All cuts in the mold for one optical part.

    Attributes
    ----------
    part : the part at its position
    frame : coordinate system of its wall
    pocket : space for the part's body
    slots : paths for the wires of a surface-mount part to the outside
    necks : narrow outer ends of the slots, for strain relief
    holes : paths for the leads of a radial part through the floor
    channel : path for these leads in the underside to the outside; None if there is no space or no strain relief
    """

    part: PlacedPart
    frame: WallFrame
    pocket: Cut
    slots: tuple[Cut, ...]
    necks: tuple[Cut, ...]
    holes: tuple[Hole, ...]
    channel: Cut | None

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """Pocket, slots and necks, which are all open upward; they touch but do not overlap."""
        return (self.pocket, *self.slots, *self.necks)

    def without_channel(self) -> Socket:
        """The socket without its lead channel, with lead holes down to the underside."""
        if self.channel is None:
            return self
        holes = tuple(replace(hole, z0=self.channel.floor) for hole in self.holes)
        return replace(self, channel=None, holes=holes)

    def open_to(self, top_mm: float) -> Socket:
        """The socket with pocket, slots and necks open up to another height [mm]."""
        return replace(
            self,
            pocket=replace(self.pocket, top=top_mm),
            slots=tuple(replace(cut, top=top_mm) for cut in self.slots),
            necks=tuple(replace(cut, top=top_mm) for cut in self.necks),
        )


def socket_of(part: PlacedPart, mold: Mold, frame: WallFrame, top_mm: float, bottom_mm: float) -> Socket:
    """Compute the cuts for one optical part.

    Parameters
    ----------
    part : the part at its position
    mold : clearances and thinnest web
    frame : coordinate system of its wall
    top_mm, bottom_mm : height z of the mold's upper and lower face
    """
    room = clearance_mm(mold, part.part_id)
    half = part.part.body_width_mm.value / 2 + room
    pocket = Cut(
        along0=part.along_mm - half,
        along1=part.along_mm + half,
        out0=0.0,
        out1=part.part.body_depth_mm.value + room,
        floor=part.body_base_mm - room,
        top=top_mm,
    )
    if part.part.mounting == "radial":
        channel = _channel(part, mold, frame, pocket, bottom_mm)
        foot = bottom_mm if channel is None else channel.top
        holes = _holes(part, mold, frame, pocket, foot)
        return Socket(part=part, frame=frame, pocket=pocket, slots=(), necks=(), holes=holes, channel=channel)
    slots, necks = _wire_ways(part, mold, frame, pocket)
    return Socket(part=part, frame=frame, pocket=pocket, slots=slots, necks=necks, holes=(), channel=None)


def lead_offsets_mm(part: Part) -> tuple[float, ...]:
    """Positions of a part's leads along the wall, relative to the middle of the active area [mm]."""
    count, pitch = part.lead_count, part.lead_pitch_mm.value
    return tuple((k - (count - 1) / 2) * pitch for k in range(count))


def lead_setback_mm(part: Part) -> float:
    """Distance of a radial part's leads behind its active face [mm]."""
    return part.lead_setback_mm.value if part.lead_setback_mm else part.body_depth_mm.value / 2


def _holes(part: PlacedPart, mold: Mold, frame: WallFrame, pocket: Cut, foot_mm: float) -> tuple[Hole, ...]:
    radius = _lead_radius_mm(part.part, mold)
    places = [
        frame.point(part.along_mm + offset, lead_setback_mm(part.part))
        for offset in lead_offsets_mm(part.part)
    ]
    return tuple(Hole(x=x, y=y, radius=radius, z0=foot_mm, z1=pocket.floor) for x, y in places)


def _lead_radius_mm(part: Part, mold: Mold) -> float:
    return (part.lead_diameter_mm.value + mold.lead_clearance_mm) / 2


def _channel(part: PlacedPart, mold: Mold, frame: WallFrame, pocket: Cut, bottom_mm: float) -> Cut | None:
    depth = min(CHANNEL_DEPTH_MM, mold.floor_mm - mold.min_web_mm, pocket.floor - bottom_mm - mold.min_web_mm)
    if mold.strain_relief == "none" or depth < part.part.lead_diameter_mm.value:
        return None
    reach = _lead_radius_mm(part.part, mold) + CHANNEL_MARGIN_MM
    offsets = lead_offsets_mm(part.part)
    return Cut(
        along0=part.along_mm + offsets[0] - reach,
        along1=part.along_mm + offsets[-1] + reach,
        out0=lead_setback_mm(part.part) - reach,
        out1=frame.thickness_mm,
        floor=bottom_mm,
        top=bottom_mm + depth,
    )


def _wire_ways(
    part: PlacedPart, mold: Mold, frame: WallFrame, pocket: Cut
) -> tuple[tuple[Cut, ...], tuple[Cut, ...]]:
    """Slots for the wires, and their narrow outer ends if strain relief is required and the slots are long enough."""
    back = frame.thickness_mm - pocket.out1
    has_necks = mold.strain_relief == "pinch" and back >= 2 * NECK_MM
    ends = frame.thickness_mm - (NECK_MM if has_necks else 0.0)
    slots, necks = [], []
    for low, high in _wire_spans(part.part, mold, pocket.along1 - part.along_mm):
        along0, along1 = max(part.along_mm + low, pocket.along0), min(part.along_mm + high, pocket.along1)
        slot = Cut(
            along0=along0, along1=along1, out0=pocket.out1, out1=ends, floor=pocket.floor, top=pocket.top
        )
        slots.append(slot)
        if has_necks:
            narrower = (mold.lead_clearance_mm + fit("wire_pinch").value) / 2
            inset = max(min(narrower, (high - low - fit("narrowest_slot").value) / 2), 0.0)
            inner = (
                max(part.along_mm + low + inset, along0),
                min(part.along_mm + high - inset, along1),
            )
            necks.append(replace(slot, along0=inner[0], along1=inner[1], out0=ends, out1=frame.thickness_mm))
    return tuple(slots), tuple(necks)


def _wire_spans(part: Part, mold: Mold, half_pocket_mm: float) -> list[tuple[float, float]]:
    """Ranges along the wall where wires leave, relative to the middle of the pocket [mm].

    One range per wire if printable webs remain between them, else one for all.
    """
    width = 2 * _lead_radius_mm(part, mold)
    offsets = lead_offsets_mm(part)
    if part.lead_pitch_mm.value - width >= mold.min_web_mm and offsets[-1] <= half_pocket_mm:
        return [(offset - width / 2, offset + width / 2) for offset in offsets]
    return [(-part.lead_count * width / 2, part.lead_count * width / 2)]


OWN_COLLAR_WEBS = 3
"""Least distance between neighbouring pockets for each to have its own collar [webs].

A web is the least printable wall thickness.
"""


@dataclass(frozen=True, kw_only=True)
class Collar:
    """A wall above the rim that holds one or more tall bodies.

    Attributes
    ----------
    names : names of the held parts
    frame : coordinate system of the mold's wall below
    block : the collar before pockets and slots are cut
    """

    names: tuple[str, ...]
    frame: WallFrame
    block: Cut

    @property
    def top_mm(self) -> float:
        """Height z of the collar's upper face [mm]."""
        return self.block.top

    @property
    def box(self) -> Box:
        """The collar before it is cut, as a box along the cavity's axes."""
        return self.frame.box(self.block)


def raised(
    sockets: tuple[Socket, ...], rim_mm: float, start_mm: float, fixing_holes: tuple[Hole, ...], mold: Mold
) -> tuple[tuple[Collar, ...], tuple[Socket, ...]]:
    """The collars for tall bodies, and the mold's sockets with their cuts extended up through them.

    Parameters
    ----------
    rim_mm : height z of the rim
    start_mm : distance from the cavity outward at which a collar starts, behind the lip or the cover's seat
    """
    if not mold.raised_sockets:
        return (), sockets
    collars = [
        collar
        for row in by_wall(sockets).values()
        for collar in _of_wall(row, rim_mm, start_mm, mold.min_web_mm)
        if all(collar.frame.gap_mm(collar.block, hole) >= mold.min_web_mm for hole in fixing_holes)
    ]
    tops = {name: collar.top_mm for collar in collars for name in collar.names}
    opened = tuple(
        socket.open_to(tops[socket.part.name]) if socket.part.name in tops else socket for socket in sockets
    )
    return tuple(collars), opened


def _of_wall(row: Sequence[Socket], rim_mm: float, start_mm: float, web_mm: float) -> Iterator[Collar]:
    """Collars on one wall; neighbouring tall bodies share a collar unless they are far apart."""
    held: list[Socket] = []
    for socket in row:
        is_tall = socket.part.body_top_mm > rim_mm + ROUNDING_MM
        apart = bool(held) and socket.pocket.along0 - held[-1].pocket.along1 >= OWN_COLLAR_WEBS * web_mm
        if held and (apart or not is_tall):
            yield _collar(held, rim_mm, start_mm, web_mm)
            held = []
        if is_tall:
            held.append(socket)
    if held:
        yield _collar(held, rim_mm, start_mm, web_mm)


def _collar(held: Sequence[Socket], rim_mm: float, start_mm: float, web_mm: float) -> Collar:
    frame = held[0].frame
    deepest = max(socket.pocket.out1 for socket in held)
    return Collar(
        names=tuple(socket.part.name for socket in held),
        frame=frame,
        block=Cut(
            along0=held[0].pocket.along0 - web_mm,
            along1=held[-1].pocket.along1 + web_mm,
            out0=start_mm,
            out1=min(deepest + web_mm, frame.thickness_mm),
            floor=rim_mm,
            top=max(socket.part.body_top_mm for socket in held),
        ),
    )


def by_wall(sockets: tuple[Socket, ...]) -> dict[str, tuple[Socket, ...]]:
    """Sockets of each wall by its name (south, east, north, west, or a facet's direction), in their order along it."""
    names = dict.fromkeys((*WALLS, *(socket.frame.wall for socket in sockets)))
    return {
        wall: tuple(
            sorted((s for s in sockets if s.frame.wall == wall), key=lambda socket: socket.pocket.along0)
        )
        for wall in names
    }
