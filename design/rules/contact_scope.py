"""What the contact model covers, so that a design can be told before anything is solved.

The shipped library was compared with an independent finite-element solution (docs/validation/contact.md).
Layers beyond it are solved live, take minutes and were compared with nothing; layers beyond those are refused.
"""

from __future__ import annotations

import math

from design.shape.cavity import workspace_of
from design.shape.plan import plan_of
from design.spec import SensorDesign

LARGEST_SHARE_OF_LAYER = 0.8
"""Deepest press as a share of the elastic depth [-]."""
DEEPEST_PRESS = 1.7
"""Deepest press [tip radii]."""
LIBRARY_LAYER_RANGE = (1.3, 6.0)
"""Elastic depths (clear + black layer) of the shipped library [tip radii]."""
CROWNED_LAYER_RANGE = (DEEPEST_PRESS / LARGEST_SHARE_OF_LAYER, 6.0)
"""Elastic depths under a crown, wherever it is pressed, of which presses are known at all [tip radii]."""
LAYER_DEPTH_RANGE = (1.0, 10.0)
"""Elastic depths that are modelled at all [tip radii]."""
NEAREST_WALL = 1.5
"""Nearest wall to the axis of a press [tip radii]: the loads that stand for the press reach so far."""
LARGEST_CROWN = 0.25
"""Tip radius over the radius of a crown, at most [-]."""


def thinnest_elastic_mm(design: SensorDesign) -> float:
    """Clear and black layer together where the workspace is thinnest: under a crown, at its border [mm]."""
    elastic = design.cavity.clear_thickness_mm + design.cavity.black_thickness_mm
    plan, space = plan_of(design), workspace_of(design)
    if space.is_empty:
        return elastic
    return elastic - float(plan.top.sag_mm(*space.points(math.pi / 2).T).max())


def deepest_modelled_mm(design: SensorDesign) -> float:
    """Deepest press that the contact model covers [mm]."""
    return min(
        LARGEST_SHARE_OF_LAYER * thinnest_elastic_mm(design), DEEPEST_PRESS * design.indenter.tip_radius_mm
    )
