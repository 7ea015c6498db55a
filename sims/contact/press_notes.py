"""What the user should know about the press of a design, in sentences."""

from __future__ import annotations

from design.errors import ModelScopeError
from design.geometry.cavity import cavity_of
from design.spec import SensorDesign
from sims.contact.indentation import solved_press
from sims.contact.scope import layer_depth, tip_radius_mm
from sims.contact.walls.near_walls import wall_correction, walls_of

NOTED_FORCE_CHANGE = 0.03
"""Change of force by near walls that is worth a note [-]: the contact model's own error."""


def edge_force_note(design: SensorDesign) -> str | None:
    """How much the walls stiffen a press at the corner of the workspace; None where that is little."""
    space = cavity_of(design).workspace
    corner = (space.x0_mm, space.y0_mm)
    layer, depth = layer_depth(design), design.operating.max_depth_mm / tip_radius_mm(design)
    try:
        corner_factor, centre_factor = (
            wall_correction(layer, depth, walls_of(design, at)).force_factor for at in (corner, None)
        )
    except ModelScopeError as err:
        return f"walls: a press in the corner of the workspace is outside the wall correction ({err})"
    if abs(corner_factor / centre_factor - 1.0) < NOTED_FORCE_CHANGE:
        return None
    return (
        f"walls: pressed in the corner of the workspace ({corner[0]:g}, {corner[1]:g}) mm the force is "
        f"{100.0 * (corner_factor / centre_factor - 1.0):+.0f} % of that in the middle; light is traced with the "
        "shape of the centred press, which off the middle moves single signals by several per cent "
        "(docs/validation/walls.md)"
    )


def contact_notes(design: SensorDesign) -> tuple[str, ...]:
    """Every note on the press of a design: how it was solved, and what its walls do."""
    walls = edge_force_note(design)
    return (*solved_press(design).notes, *((walls,) if walls else ()))
