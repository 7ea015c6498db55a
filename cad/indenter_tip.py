r"""The indenter's tip as a printed part: the tip of the design on a cylindrical shank, for a collet or chuck.

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

import cadquery as cq

from optopad.design.spec import SensorDesign
from optopad.design.spec.indenter import tip_outline

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
