"""What the contact model covers, so that a design can be told before anything is solved.

The shipped library was compared with an independent finite-element solution (docs/validation/contact.md).
Layers beyond it are solved live, take minutes and were compared with nothing; layers beyond those are refused.
"""

from __future__ import annotations

from design.errors import DesignError
from design.geometry.plan import plan_of
from design.spec import SensorDesign

LIBRARY_LAYER_RANGE = (1.3, 6.0)
"""Elastic depths (clear + black layer) of the shipped library [tip radii]."""
LAYER_DEPTH_RANGE = (1.0, 10.0)
"""Elastic depths that are modelled at all [tip radii]."""
LARGEST_SHARE_OF_LAYER = 0.8
"""Deepest press as a share of the elastic depth [-]."""
DEEPEST_PRESS = 1.7
"""Deepest press [tip radii]."""
NEAREST_WALL = 1.5
"""Nearest wall to the axis of a press [tip radii]: the loads that stand for the press reach so far."""
LARGEST_CROWN = 0.25
"""Tip radius over the radius of a crown, at most [-]."""


def is_flat_rectangle(design: SensorDesign) -> bool:
    """Whether contact and light are computed for a pad of this shape."""
    return plan_of(design).is_flat_rectangle


def require_flat_rectangle(design: SensorDesign) -> None:
    """Refuse what contact, light and all that follows do not compute.

    Raises
    ------
    DesignError : a disc or a crowned pad.
    """
    if not is_flat_rectangle(design):
        field = "crown" if design.crown is not None else "cavity.outline"
        raise DesignError(
            f"{field}: contact and light are computed for flat rectangles alone; `optopad check`, `optopad build` and "
            "`optopad driver config` take discs and crowned pads"
        )
