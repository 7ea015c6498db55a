"""The solver's results for one layer as stored, before any fit: surfaces, forces and checks at the solved depths.

Lengths are in tip radii, forces in E R². `build.fit_press` fits smooth functions of depth to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from optopad.design.arrays import FloatArray
from optopad.sims.contact.tip import TipOutline


@dataclass(frozen=True, kw_only=True)
class UnitPress:
    """Solved equilibrium states of one layer under one tip; lengths in tip radii R, forces in E R².

    Attributes
    ----------
    layer_depth, wall_radius : layer thickness on the axis, and radius of the bonded wall
    mesh_size : node spacing under the tip
    wedge_angle : opening angle of the solved wedge about the axis [rad]
    poisson_ratio : Poisson's ratio of the layer [-]
    tip_rows : (piece, 7) outline of the tip, one array row per line or arc; see `TipOutline`
    depths : (depth,) solved press depths, increasing, without 0
    rest_radii : (node,) radii of the top nodes at rest, from the axis to the wall
    radii, heights : (depth, node) points of the deformed top; heights are above the undeformed apex
    normal_force : (depth, node) force of the tip on each top node, for the full circle; positive where the tip presses
    force, contact_radius : (depth,) force on the tip, and radius of the contact edge
    reaction : (depth,) vertical reaction of the bonded surfaces, computed from the deformed shape alone
    penetration, last_step : (depth,) deepest overlap with the tip, and largest motion of a vertex in the last solver
        step
    chatter : (depth,) spread of the iterates if the solver ended in a cycle; 0 if it came to rest
    smallest_stretch : (depth,) smallest volume ratio of an element [-]
    volume_loss : (depth,) volume lost by compression [R³]
    energy : (depth,) elastic energy of the layer [E R³]
    versions : names and versions of the programs that computed the states
    crown : tip radius over the radius of the top's sphere; 0 is flat [-]
    """

    layer_depth: float
    wall_radius: float
    mesh_size: float
    wedge_angle: float
    poisson_ratio: float
    tip_rows: FloatArray
    depths: FloatArray
    rest_radii: FloatArray
    radii: FloatArray
    heights: FloatArray
    normal_force: FloatArray
    force: FloatArray
    contact_radius: FloatArray
    reaction: FloatArray
    penetration: FloatArray
    last_step: FloatArray
    chatter: FloatArray
    smallest_stretch: FloatArray
    volume_loss: FloatArray
    energy: FloatArray
    versions: tuple[str, ...]
    crown: float = 0.0

    @property
    def deepest(self) -> float:
        """Deepest solved press [tip radii]."""
        return float(self.depths[-1])

    @cached_property
    def tip(self) -> TipOutline:
        """Outline of the pressing tip."""
        return TipOutline.from_rows(self.tip_rows)
