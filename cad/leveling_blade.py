"""The leveling blade: a printed tool that is drawn over the wet black layer to level it to the design's thickness.

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
its way (`optopad.design.mold.webs.bodies_above_rim`). There is no blade for a crowned pad, because its mold is filled
upside down and the black layer is poured last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cadquery as cq

from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.spec import SensorDesign

PLAY_MM = 0.3
"""Gap between each end of the tongue and the cavity's wall, because prints may be too large by up to this length."""
GRIP_MM = 12.0
"""Height of the bar above the shoulders, by which the blade is held with two fingers."""
THICKNESS_MM = 3.0
"""Thickness of the blade, which keeps it from bending over the cavity."""
EDGE_MM = 1.0
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
    """Dimensions of a design's blade; None for a design without a black layer or with a crowned pad."""
    if design.cavity.black_thickness_mm == 0 or is_cast_under_lid(plan_of(design)):
        return None
    spans_y = design.cavity.width_mm <= design.cavity.length_mm
    return BladeSize(
        span_mm=design.mold.outer_width_mm if spans_y else design.mold.outer_length_mm,
        tongue_mm=_tongue_mm(design),
        reach_mm=design.cavity.clear_thickness_mm + design.mold.rim_mm,
    )


def _tongue_mm(design: SensorDesign) -> float:
    """Length of the tongue [mm]; in a round cavity, it is such that the corners can turn freely inside the facets."""
    plan = cavity_of(design).plan
    turns = [float(plan.outline.gap_mm(*arc.centre_mm)) for arc in plan.outline.bare.arcs]
    if not turns:
        return min(plan.length_mm, plan.width_mm) - 2 * PLAY_MM
    return 2 * math.sqrt((min(turns) - PLAY_MM) ** 2 - (THICKNESS_MM / 2) ** 2)


def leveling_blade(design: SensorDesign) -> cq.Workplane | None:
    """CAD solid of the blade, flat on the print bed, with its edge along x at y = 0; None for a design without one."""
    size = blade_size(design)
    if size is None:
        return None
    half, tongue, reach = size.span_mm / 2, size.tongue_mm / 2, size.reach_mm
    outline = [(-tongue, 0.0), (tongue, 0.0), (tongue, reach), (half, reach)]
    outline += [(half, reach + GRIP_MM), (-half, reach + GRIP_MM), (-half, reach), (-tongue, reach)]
    flat = cq.Workplane("XY").polyline(outline).close().extrude(THICKNESS_MM)
    return flat.cut(_bevel(size))


def _bevel(size: BladeSize) -> cq.Workplane:
    depth = min(THICKNESS_MM - EDGE_MM, size.reach_mm)
    wedge = [(0.0, THICKNESS_MM - depth), (depth, THICKNESS_MM), (0.0, THICKNESS_MM)]
    prism = cq.Workplane("YZ").polyline(wedge).close().extrude(size.tongue_mm)
    return prism.translate((-size.tongue_mm / 2, 0, 0))
