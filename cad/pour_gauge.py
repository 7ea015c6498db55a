r"""The pour gauge: a printed tool on the mold's rim that shows when the clear layer is thick enough.

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
"""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq

from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign

GRIP_MM = 8.0
"""Height of the bar above the teeth."""
THICKNESS_MM = 3.0
TOOTH_MM = 2.0
"""Width of a tooth, which is narrow so that it draws up little silicone."""
STEP_MM = 0.3
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
    step = min(STEP_MM, rim / 2)
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
    outline = [(-half, GRIP_MM), (-half, 0.0)]
    for place, tooth in enumerate(size.teeth_mm):
        middle = (place - 1) * size.spacing_mm
        left, right = middle - TOOTH_MM / 2, middle + TOOTH_MM / 2
        outline += [(left, 0.0), (left, -tooth), (right, -tooth), (right, 0.0)]
    outline += [(half, 0.0), (half, GRIP_MM)]
    return cq.Workplane("XY").polyline(outline).close().extrude(THICKNESS_MM)
