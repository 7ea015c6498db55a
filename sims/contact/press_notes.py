"""What the user should know about the press of a design, in sentences."""

from __future__ import annotations

from design.errors import ModelScopeError
from design.shape.cavity import cavity_of
from design.shape.plan import plan_of
from design.spec import SensorDesign
from sims.contact.indentation import solved_press

NOTED_FORCE_CHANGE = 0.03
"""Change of force by near walls that is worth a note [-]: the contact model's own error."""


def edge_force_note(design: SensorDesign) -> str | None:
    """How much the walls stiffen a press at the corner of the workspace; None where that is little.

    In other pads than blocks the border is thinner, not nearer to a wall, as far as the contact model goes.
    """
    space, depth_mm = cavity_of(design).workspace, design.operating.max_depth_mm
    corner = space.clamped(space.x0_mm, space.y0_mm)
    try:
        ratio = solved_press(design, at_mm=corner).force_n(depth_mm) / solved_press(design).force_n(depth_mm)
    except ModelScopeError as err:
        return f"walls: a press in the corner of the workspace is outside the contact model ({err})"
    if abs(ratio - 1.0) < NOTED_FORCE_CHANGE:
        return None
    change = f"{100.0 * (ratio - 1.0):+.0f} % force"
    if plan_of(design).is_block:
        where = f"in the workspace's corner, x {corner[0]:g}, y {corner[1]:g} mm"
        return f"walls: {change} {where}, against its middle"
    where = f"at the border of the workspace, x {corner[0]:.3g}, y {corner[1]:.3g} mm"
    return f"crown: {change} {where}, against its middle"


def contact_notes(design: SensorDesign) -> tuple[str, ...]:
    """Every note on the press of a design: how it was solved, and what its walls do."""
    walls = edge_force_note(design)
    return (*solved_press(design).notes, *((walls,) if walls else ()))
