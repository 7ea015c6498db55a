r"""The printed tools of a design: leveling blade, pour gauge, solder jig and indenter tip.

Leveling blade
--------------
A printed tool that is drawn over the wet black layer to level it to the design's thickness.

Its shoulders rest on the rim and its tongue extends down into the cavity. It is printed flat, bevel up:

        outer side of the mold
      +------------------------------+  ^ grip
      |                              |  |
      +--+                        +--+  v  shoulder, rests on the rim
         |                        |     ^
         |   tongue               |     |  rim + clear thickness
         +------------------------+     v  edge at the black layer's top, bevelled
          play                play

The blade spans the shorter side of the cavity and is drawn along the longer one. In a round cavity it spans the
diameter between opposite facets and is turned about the middle. Optical parts whose bodies extend above the rim get in
its way (`optopad.design.mold.webs.bodies_above_rim`). There is no blade for a crowned pad in a mold with a floor,
because that mold is filled upside down and the black layer is poured last. On a circuit board there is a blade only if
no body stands above the black layer.

Pour gauge
----------
A printed tool on the mold's rim that shows when the clear layer is thick enough.

Three teeth extend from a bar into the cavity. The middle tooth ends at the silicone's undisturbed top; pour until the
silicone touches it. It touches the longer tooth slightly earlier, and must not reach the shorter tooth. The gauge is
printed flat:

      +--------------------------------------+  ^ grip
      |                                      |  |
      +------+ +---------+ +---------+ +-----+  v  rests on the rim
             | |         | |         | |
             |_|         | |         |_|           short: rim - step
            long         |_|        short          middle: rim; long: rim + step

On a round mold the gauge is along a diameter. There is no gauge for a crowned pad, because its mold is filled by weight
and upside down.

Solder jig
----------
A printed plate that holds optical parts while wires are soldered to them at the sockets' pitch.

The jig has space for one part of each type. Parts on a circuit board need none. This view from above shows a surface-
mount part and a part with leads:

      +----------------------------+
      |   | |  | |                 |   grooves: wires at the pitch of the slots, open to the edge
      |   | |  | |                 |
      |  +--------+                |
      |  | body   |     o    o     |   recess: the part is on its active face, pads up
      |  +--------+                |   holes: drilled with the mold's lead drill they check the pitch, and hold
      +----------------------------+   the leads of a radial part upright

Indenter tip
------------
The tip of the design as a printed part, on a cylindrical shank, for a collet or chuck.

         ___
       /     \     ^ outline (`optopad.design.spec.indenter`): hemisphere, flat punch, cone or profile
      |-------|    v
      |       |    shank of tip_radius_mm: silicone wraps it in deep presses
      |       |
      +-------+    bed
      <  2 R  >

A tip printed upright has layer steps: sand it, or use it as a template for a tip made on a lathe. At the apex, the CAD
kernel makes one degenerate triangle, which `optopad.cad.mesh` removes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cadquery as cq

from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.mold.outline import is_levelled, outline_of
from optopad.design.mold.sockets import Box, Hole, lead_offsets_mm
from optopad.design.parts.catalog import Part
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.indenter import tip_outline
from optopad.design.spec.properties import fit

BLADE_PLAY_MM = 0.3
"""Gap between each end of the tongue and the cavity's wall, because prints may be too large by up to this length."""
BLADE_GRIP_MM = 12.0
"""Height of the bar above the shoulders, by which the blade is held with two fingers."""
BLADE_THICKNESS_MM = 3.0
"""Thickness of the blade, which keeps it from bending over the cavity."""
BLADE_EDGE_MM = 1.0
"""Thickness of the bevelled edge that touches the silicone."""


@dataclass(frozen=True, kw_only=True)
class BladeSize:
    """Dimensions of a leveling blade [mm].

    Attributes
    ----------
    span_mm : length of the bar
    tongue_mm : length of the tongue
    reach_mm : height from the shoulders down to the edge
    """

    span_mm: float
    tongue_mm: float
    reach_mm: float


def blade_size(design: SensorDesign) -> BladeSize | None:
    """Dimensions of a design's blade; None for a design whose black layer is not levelled with one."""
    if not is_levelled(design):
        return None
    spans_y = design.cavity.width_mm <= design.cavity.length_mm
    return BladeSize(
        span_mm=design.mold.outer_width_mm if spans_y else design.mold.outer_length_mm,
        tongue_mm=_tongue_mm(design),
        reach_mm=outline_of(design).top_mm,
    )


def _tongue_mm(design: SensorDesign) -> float:
    """Length of the tongue [mm]; in a round cavity, it is such that the corners can turn freely inside the facets."""
    plan = cavity_of(design).plan
    turns = [float(plan.outline.gap_mm(*arc.centre_mm)) for arc in plan.outline.bare.arcs]
    if not turns:
        return min(plan.length_mm, plan.width_mm) - 2 * BLADE_PLAY_MM
    return 2 * math.sqrt((min(turns) - BLADE_PLAY_MM) ** 2 - (BLADE_THICKNESS_MM / 2) ** 2)


def leveling_blade(design: SensorDesign) -> cq.Workplane | None:
    """CAD solid of the blade, flat on the print bed, with its edge along x at y = 0; None for a design without one."""
    size = blade_size(design)
    if size is None:
        return None
    half, tongue, reach = size.span_mm / 2, size.tongue_mm / 2, size.reach_mm
    outline = [(-tongue, 0.0), (tongue, 0.0), (tongue, reach), (half, reach)]
    outline += [
        (half, reach + BLADE_GRIP_MM),
        (-half, reach + BLADE_GRIP_MM),
        (-half, reach),
        (-tongue, reach),
    ]
    flat = cq.Workplane("XY").polyline(outline).close().extrude(BLADE_THICKNESS_MM)
    return flat.cut(_bevel(size))


def _bevel(size: BladeSize) -> cq.Workplane:
    depth = min(BLADE_THICKNESS_MM - BLADE_EDGE_MM, size.reach_mm)
    wedge = [(0.0, BLADE_THICKNESS_MM - depth), (depth, BLADE_THICKNESS_MM), (0.0, BLADE_THICKNESS_MM)]
    prism = cq.Workplane("YZ").polyline(wedge).close().extrude(size.tongue_mm)
    return prism.translate((-size.tongue_mm / 2, 0, 0))


GAUGE_GRIP_MM = 8.0
"""Height of the bar above the teeth."""
GAUGE_THICKNESS_MM = 3.0
TOOTH_MM = 2.0
"""Width of a tooth, which is narrow so that it draws up little silicone."""
GAUGE_STEP_MM = 0.3
"""Difference in length between the middle tooth and the others: about the accuracy of pouring; less for a low rim."""


@dataclass(frozen=True, kw_only=True)
class GaugeSize:
    """Dimensions of a pour gauge [mm].

    Attributes
    ----------
    span_mm : length of the bar
    teeth_mm : lengths of the long, the middle and the short tooth
    spacing_mm : distance between the centre lines of neighbouring teeth
    """

    span_mm: float
    teeth_mm: tuple[float, float, float]
    spacing_mm: float


def gauge_size(design: SensorDesign) -> GaugeSize | None:
    """Dimensions of a design's gauge; None for a mold without a rim or for a crowned pad."""
    rim, cavity, mold = design.mold.rim_mm, design.cavity, design.mold
    if rim == 0 or is_cast_under_lid(plan_of(design)):
        return None
    spans_y = cavity.width_mm <= cavity.length_mm
    step = min(GAUGE_STEP_MM, rim / 2)
    return GaugeSize(
        span_mm=mold.outer_width_mm if spans_y else mold.outer_length_mm,
        teeth_mm=(rim + step, rim, rim - step),
        spacing_mm=(cavity.width_mm if spans_y else cavity.length_mm) / 4,
    )


def pour_gauge(design: SensorDesign) -> cq.Workplane | None:
    """CAD solid of the gauge, flat on the print bed, teeth towards low y; None for a design without one."""
    size = gauge_size(design)
    if size is None:
        return None
    half = size.span_mm / 2
    outline = [(-half, GAUGE_GRIP_MM), (-half, 0.0)]
    for place, tooth in enumerate(size.teeth_mm):
        middle = (place - 1) * size.spacing_mm
        left, right = middle - TOOTH_MM / 2, middle + TOOTH_MM / 2
        outline += [(left, 0.0), (left, -tooth), (right, -tooth), (right, 0.0)]
    outline += [(half, 0.0), (half, GAUGE_GRIP_MM)]
    return cq.Workplane("XY").polyline(outline).close().extrude(GAUGE_THICKNESS_MM)


JIG_THICKNESS_MM = 5.0
JIG_MARGIN_MM = 3.0
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
    """

    length_mm: float
    width_mm: float
    boxes: tuple[Box, ...]
    holes: tuple[Hole, ...]


def jig_size(design: SensorDesign) -> JigSize:
    """Dimensions of a design's jig, with space for each type of part, in the order of the layout."""
    kinds = {part.part_id: part.part for part in cavity_of(design).parts}
    cells = {part_id: _cell_mm(part) for part_id, part in kinds.items()}
    boxes: list[Box] = []
    holes: list[Hole] = []
    left = JIG_MARGIN_MM
    for part_id, part in kinds.items():
        middle = left + cells[part_id][0] / 2
        if part.mounting == "surface":
            boxes += _recess_and_grooves(part, middle, max(wide for _, wide in cells.values()), design)
        else:
            radius = (part.lead_diameter_mm.value + design.mold.lead_clearance_mm) / 2
            holes += [
                Hole(
                    x=middle + offset,
                    y=JIG_MARGIN_MM + part.body_depth_mm.value / 2,
                    radius=radius,
                    z0=0.0,
                    z1=JIG_THICKNESS_MM,
                )
                for offset in lead_offsets_mm(part)
            ]
        left += cells[part_id][0] + JIG_MARGIN_MM
    return JigSize(
        length_mm=left,
        width_mm=2 * JIG_MARGIN_MM + max(wide for _, wide in cells.values()),
        boxes=tuple(boxes),
        holes=tuple(holes),
    )


def solder_jig(design: SensorDesign) -> cq.Workplane | None:
    """CAD solid of the jig, flat on the print bed; None for parts on a circuit board, which need no wires."""
    if design.is_on_board:
        return None
    size = jig_size(design)
    plate = cq.Solid.makeBox(size.length_mm, size.width_mm, JIG_THICKNESS_MM)
    top = JIG_THICKNESS_MM + BEYOND_MM
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
    slip, z1 = fit("slip").value, JIG_THICKNESS_MM
    half = part.body_width_mm.value / 2 + slip
    end = JIG_MARGIN_MM + part.body_height_mm.value + 2 * slip
    depth = min(part.body_depth_mm.value * RECESS_SHARE, DEEPEST_MM)
    yield Box(x0=middle - half, x1=middle + half, y0=JIG_MARGIN_MM, y1=end, z0=z1 - depth, z1=z1)
    wire = part.lead_diameter_mm.value + design.mold.lead_clearance_mm
    for low, high in _groove_spans(part, wire, design.mold.min_web_mm):
        yield Box(
            x0=middle + low,
            x1=middle + high,
            y0=end,
            y1=2 * JIG_MARGIN_MM + room,
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


SHANK_MM = 20.0
"""Length of the shank for the chuck, in addition to the length for the deepest press."""


def shank_mm(design: SensorDesign) -> float:
    """Length of the cylinder below the shaped tip [mm]."""
    return SHANK_MM + design.operating.max_depth_mm


def indenter_tip(design: SensorDesign) -> cq.Workplane:
    """CAD solid of the tip, upright on the print bed: apex up, axis at x = y = 0."""
    radius, shank = design.indenter.tip_radius_mm, shank_mm(design)
    pieces = tip_outline(design.indenter)
    apex = shank + pieces[-1].end[1]
    profile = cq.Workplane("XY").moveTo(0, 0).lineTo(radius, 0).lineTo(radius, shank)
    for piece in reversed(pieces):
        end = (piece.start[0], apex - piece.start[1])
        if piece.radius == 0.0:
            profile = profile.lineTo(*end)
        else:
            middle = piece.middle
            profile = profile.threePointArc((middle[0], apex - middle[1]), end)
    return profile.close().revolve(360, (0, 0, 0), (0, 1, 0)).rotate((0, 0, 0), (1, 0, 0), 90)
