r"""The solder jig: a printed plate that holds optical parts while wires are soldered to them at the sockets' pitch.

The jig has space for one part of each type. This view from above shows a surface-mount part and a part with leads:

      +----------------------------+
      |   | |  | |                 |   grooves: wires at the pitch of the slots, open to the edge
      |   | |  | |                 |
      |  +--------+                |
      |  | body   |     o    o     |   recess: the part is on its active face, pads up
      |  +--------+                |   holes: drilled with the mold's lead drill they check the pitch, and hold
      +----------------------------+   the leads of a radial part upright
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cadquery as cq

from optopad.design.mold.sockets import Box, Hole, lead_offsets_mm
from optopad.design.parts.catalog import Part
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import fit

THICKNESS_MM = 5.0
MARGIN_MM = 3.0
"""Distance between cuts in the plate, and between a cut and the plate's edge."""
RECESS_SHARE = 0.5
"""Depth of a recess as a fraction of the body's depth; solder pads and half of the body protrude from it."""
DEEPEST_MM = 3.0
"""Largest depth of recesses and grooves, under which two millimetres of plate remain."""
GROOVE_MM = 8.0
"""Length of the grooves for wires."""
BEYOND_MM = 1.0


@dataclass(frozen=True, kw_only=True)
class JigSize:
    """Dimensions of a solder jig whose corner at low x and y is at the origin.

    Attributes
    ----------
    length_mm, width_mm : size of the plate along x and y
    boxes : recesses and grooves, open upward
    holes : holes through the plate
    part_ids : catalogue names of the types of parts, from low to high x
    """

    length_mm: float
    width_mm: float
    boxes: tuple[Box, ...]
    holes: tuple[Hole, ...]
    part_ids: tuple[str, ...]


def jig_size(design: SensorDesign) -> JigSize:
    """Dimensions of a design's jig, with space for each type of part, in the order of the layout."""
    kinds = {part.part_id: part.part for part in cavity_of(design).parts}
    cells = {part_id: _cell_mm(part) for part_id, part in kinds.items()}
    boxes: list[Box] = []
    holes: list[Hole] = []
    left = MARGIN_MM
    for part_id, part in kinds.items():
        middle = left + cells[part_id][0] / 2
        if part.mounting == "surface":
            boxes += _recess_and_grooves(part, middle, max(wide for _, wide in cells.values()), design)
        else:
            radius = (part.lead_diameter_mm.value + design.mold.lead_clearance_mm) / 2
            holes += [
                Hole(
                    x=middle + offset,
                    y=MARGIN_MM + part.body_depth_mm.value / 2,
                    radius=radius,
                    z0=0.0,
                    z1=THICKNESS_MM,
                )
                for offset in lead_offsets_mm(part)
            ]
        left += cells[part_id][0] + MARGIN_MM
    return JigSize(
        length_mm=left,
        width_mm=2 * MARGIN_MM + max(wide for _, wide in cells.values()),
        boxes=tuple(boxes),
        holes=tuple(holes),
        part_ids=tuple(kinds),
    )


def solder_jig(design: SensorDesign) -> cq.Workplane:
    """CAD solid of the jig, flat on the print bed."""
    size = jig_size(design)
    plate = cq.Solid.makeBox(size.length_mm, size.width_mm, THICKNESS_MM)
    top = THICKNESS_MM + BEYOND_MM
    cutters = [_filled(box, top, size.width_mm) for box in size.boxes]
    cutters += [
        cq.Solid.makeCylinder(hole.radius, top + BEYOND_MM, cq.Vector(hole.x, hole.y, -BEYOND_MM))
        for hole in size.holes
    ]
    return cq.Workplane(obj=plate.cut(*cutters).Solids()[0])


def _cell_mm(part: Part) -> tuple[float, float]:
    """Lengths along x and y that a part of one type needs on the plate [mm]."""
    leads = lead_offsets_mm(part)
    across = max(
        part.body_width_mm.value + 2 * fit("slip").value,
        leads[-1] - leads[0] + 2 * part.lead_diameter_mm.value,
    )
    deep = part.body_height_mm.value + GROOVE_MM if part.mounting == "surface" else part.body_depth_mm.value
    return across, deep


def _recess_and_grooves(part: Part, middle: float, room: float, design: SensorDesign) -> Iterator[Box]:
    slip, z1 = fit("slip").value, THICKNESS_MM
    half = part.body_width_mm.value / 2 + slip
    end = MARGIN_MM + part.body_height_mm.value + 2 * slip
    depth = min(part.body_depth_mm.value * RECESS_SHARE, DEEPEST_MM)
    yield Box(x0=middle - half, x1=middle + half, y0=MARGIN_MM, y1=end, z0=z1 - depth, z1=z1)
    wire = part.lead_diameter_mm.value + design.mold.lead_clearance_mm
    for low, high in _groove_spans(part, wire, design.mold.min_web_mm):
        yield Box(
            x0=middle + low,
            x1=middle + high,
            y0=end,
            y1=2 * MARGIN_MM + room,
            z0=z1 - min(wire, DEEPEST_MM),
            z1=z1,
        )


def _groove_spans(part: Part, wire_mm: float, web_mm: float) -> list[tuple[float, float]]:
    offsets = lead_offsets_mm(part)
    if part.lead_pitch_mm.value - wire_mm >= web_mm:
        return [(offset - wire_mm / 2, offset + wire_mm / 2) for offset in offsets]
    return [(offsets[0] - wire_mm / 2, offsets[-1] + wire_mm / 2)]


def _filled(box: Box, top: float, edge: float) -> cq.Solid:
    """Cutting solid for a box, extended up past the plate, and past the edge at high y if the box ends there."""
    y1 = box.y1 + (BEYOND_MM if box.y1 >= edge else 0.0)
    return cq.Solid.makeBox(box.x1 - box.x0, y1 - box.y0, top - box.z0, cq.Vector(box.x0, box.y0, box.z0))
