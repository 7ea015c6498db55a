r"""The indenter's tip: the hemisphere of the design on a plain shank, for a collet or chuck.

         ___
       /     \     ^ tip radius
      |-------|    v
      |       |    shank, same radius: silicone wraps it in deep presses
      |       |
      +-------+    bed
      <  2 R  >

Printed upright, the dome has layer steps: sand it, or use it as a gauge for a turned tip.
The dome's pole tessellates with one degenerate triangle, which `cad.mesh` drops.
"""

from __future__ import annotations

import math

import cadquery as cq

from design.spec import SensorDesign

SHANK_MM = 20.0
"""Held length of the shank, beyond the deepest press."""


def shank_mm(design: SensorDesign) -> float:
    """Length of the cylinder below the dome [mm]."""
    return SHANK_MM + design.operating.max_depth_mm


def indenter_tip_volume_mm3(design: SensorDesign) -> float:
    """Volume by formula [mm3]: hemisphere and cylinder."""
    radius = design.indenter.tip_radius_mm
    return math.pi * radius**2 * shank_mm(design) + 2 / 3 * math.pi * radius**3


def indenter_tip(design: SensorDesign) -> cq.Workplane:
    """The tip standing on the print bed, dome up, axis at x = y = 0."""
    radius, shank = design.indenter.tip_radius_mm, shank_mm(design)
    arc = math.radians(45)
    profile = (
        cq.Workplane("XY")
        .moveTo(0, 0)
        .lineTo(radius, 0)
        .lineTo(radius, shank)
        .threePointArc((radius * math.cos(arc), shank + radius * math.sin(arc)), (0, shank + radius))
        .close()
    )
    return profile.revolve(360, (0, 0, 0), (0, 1, 0)).rotate((0, 0, 0), (1, 0, 0), 90)
