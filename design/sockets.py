"""The cuts that hold one part in its wall, as plain numbers in the cavity frame.

A part drops in from the top: its pocket is open upward, and open to the cavity so that silicone
is cast against the active face. Seen from above, for the south wall (t is measured outward):

            cavity
      ------+           +------  t = 0, inner face of the wall
            |   body    |
            |           |        pocket: body + clearance at each side and behind
            +--+  +--+--+        t = pocket depth
               |  |  |           surface part: one slot a wire, open upward, to the outside
               |  |  |           radial part: round holes from the pocket's floor down through the mold
      ---------+  +--+---------  t = wall thickness, outer face

Pocket and slots go down to the body's base less the clearance, wherever that is: a part is never
raised. A base below the clear layer meets the black layer; below that, the pocket goes into the
floor of the mold, and `design.webs` asks for enough floor under it.

Lead positions: in a row along the wall, centred on the active area; radial leads leave the body at
half its depth (the catalogue does not say where). Wires that do not fit behind the body one
by one leave together through one slot in the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

from design.catalog import Part
from design.cavity import PlacedPart
from design.layout import Wall
from design.spec import Mold


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box with edges along the axes of the cavity frame [mm]."""

    x0: float
    x1: float
    y0: float
    y1: float
    z0: float
    z1: float


@dataclass(frozen=True, kw_only=True)
class Hole:
    """A vertical round hole in the cavity frame [mm]."""

    x: float
    y: float
    radius: float
    z0: float
    z1: float


@dataclass(frozen=True, kw_only=True)
class WallFrame:
    """Where a wall stands: coordinates along it and outward from its inner face.

    Attributes
    ----------
    wall : name of the wall
    across_mm : inner size of the cavity across the wall, from it to the opposite one
    length_mm, thickness_mm : inner length and thickness of the wall
    """

    wall: Wall
    across_mm: float
    length_mm: float
    thickness_mm: float

    def point(self, along_mm: float, outward_mm: float) -> tuple[float, float]:
        """Position (x, y) in the cavity frame [mm]."""
        match self.wall:
            case "south":
                return along_mm, -outward_mm
            case "north":
                return along_mm, self.across_mm + outward_mm
            case "west":
                return -outward_mm, along_mm
            case "east":
                return self.across_mm + outward_mm, along_mm

    def along_and_outward_mm(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """The way back from `point` [mm]."""
        match self.wall:
            case "south":
                return x_mm, -y_mm
            case "north":
                return x_mm, y_mm - self.across_mm
            case "west":
                return y_mm, -x_mm
            case "east":
                return y_mm, x_mm - self.across_mm

    def box(self, cut: Cut) -> Box:
        """A cut of this wall as a box in the cavity frame."""
        xa, ya = self.point(cut.along0, cut.out0)
        xb, yb = self.point(cut.along1, cut.out1)
        return Box(x0=min(xa, xb), x1=max(xa, xb), y0=min(ya, yb), y1=max(ya, yb), z0=cut.floor, z1=cut.top)


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A rectangular cut in a wall's own coordinates: along it, outward from its inner face, upward [mm]."""

    along0: float
    along1: float
    out0: float
    out1: float
    floor: float
    top: float


@dataclass(frozen=True, kw_only=True)
class Socket:
    """Everything that is cut for one part.

    Attributes
    ----------
    part : the part at its place
    frame : its wall
    pocket : room of the body
    slots : ways of the wires of a surface part to the outside
    holes : ways of the leads of a radial part through the floor
    """

    part: PlacedPart
    frame: WallFrame
    pocket: Cut
    slots: tuple[Cut, ...]
    holes: tuple[Hole, ...]

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """Pocket and slots; they touch and do not overlap."""
        return (self.pocket, *self.slots)


def socket_of(part: PlacedPart, mold: Mold, frame: WallFrame, top_mm: float, bottom_mm: float) -> Socket:
    """The cuts for one part.

    Parameters
    ----------
    part : the part at its place
    mold : clearances and thinnest web
    frame : the wall it sits in
    top_mm, bottom_mm : upper and lower face of the mold in the cavity frame
    """
    half = part.part.body_width_mm.value / 2 + mold.part_clearance_mm
    pocket = Cut(
        along0=part.along_mm - half,
        along1=part.along_mm + half,
        out0=0.0,
        out1=part.part.body_depth_mm.value + mold.part_clearance_mm,
        floor=part.body_base_mm - mold.part_clearance_mm,
        top=top_mm,
    )
    is_radial = part.part.mounting == "radial"
    return Socket(
        part=part,
        frame=frame,
        pocket=pocket,
        slots=() if is_radial else _slots(part, mold, frame, pocket),
        holes=_holes(part, mold, frame, pocket, bottom_mm) if is_radial else (),
    )


def lead_offsets_mm(part: Part) -> tuple[float, ...]:
    """Places of the leads along the wall, from the middle of the active area [mm]."""
    count, pitch = part.lead_count, part.lead_pitch_mm.value
    return tuple((k - (count - 1) / 2) * pitch for k in range(count))


def lead_setback_mm(part: Part) -> float:
    """Distance of the leads of a radial part behind its active face [mm]."""
    return part.lead_setback_mm.value if part.lead_setback_mm else part.body_depth_mm.value / 2


def _holes(part: PlacedPart, mold: Mold, frame: WallFrame, pocket: Cut, bottom_mm: float) -> tuple[Hole, ...]:
    radius = (part.part.lead_diameter_mm.value + mold.lead_clearance_mm) / 2
    places = [
        frame.point(part.along_mm + offset, lead_setback_mm(part.part))
        for offset in lead_offsets_mm(part.part)
    ]
    return tuple(Hole(x=x, y=y, radius=radius, z0=bottom_mm, z1=pocket.floor) for x, y in places)


def _slots(part: PlacedPart, mold: Mold, frame: WallFrame, pocket: Cut) -> tuple[Cut, ...]:
    return tuple(
        Cut(
            along0=max(part.along_mm + low, pocket.along0),
            along1=min(part.along_mm + high, pocket.along1),
            out0=pocket.out1,
            out1=frame.thickness_mm,
            floor=pocket.floor,
            top=pocket.top,
        )
        for low, high in _wire_spans(part.part, mold, pocket.along1 - part.along_mm)
    )


def _wire_spans(part: Part, mold: Mold, half_pocket_mm: float) -> list[tuple[float, float]]:
    """From where to where the wires leave, from the middle of the pocket; one by one if that leaves webs."""
    width = part.lead_diameter_mm.value + mold.lead_clearance_mm
    offsets = lead_offsets_mm(part)
    if part.lead_pitch_mm.value - width >= mold.min_web_mm and offsets[-1] <= half_pocket_mm:
        return [(offset - width / 2, offset + width / 2) for offset in offsets]
    return [(-part.lead_count * width / 2, part.lead_count * width / 2)]
