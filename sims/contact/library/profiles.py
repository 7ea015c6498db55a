"""The solver's unfitted states of one layer: surfaces, forces and checks at stored depths.

Lengths are in tip radii, forces in E R². `build.fit_press` fits smooth functions of depth to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from design.arrays import FloatArray
from sims.contact.tip import TipOutline


@dataclass(frozen=True, kw_only=True)
class UnitPress:
    """Settled states of one layer under one tip; lengths in tip radii, forces in E R².

    Attributes
    ----------
    layer_depth, wall_radius : elastic depth of the layer on the axis, radius of the bonded wall
    mesh_size : node spacing under the tip
    wedge_angle : opening angle of the solved wedge [rad]
    poisson_ratio : of the layer [-]
    tip_rows : (piece, 7) outline of the tip, see `TipOutline`
    depths : (depth,) solved press depths, increasing, without 0
    rest_radii : (node,) radii of the top nodes at rest, from the axis to the wall
    radii, heights : (depth, node) deformed top; heights are above the untouched apex
    normal_force : (depth, node) force of the tip on each top node, whole turn; positive where it presses
    force, contact_radius : (depth,)
    reaction : (depth,) reaction of the bonded surfaces, computed from the shape alone
    penetration, last_step : (depth,) overlap with the tip; last motion of the solver
    chatter : (depth,) spread of the solver's cycle, 0 where it came to rest
    smallest_stretch : (depth,) smallest volume ratio of an element [-]
    volume_loss : (depth,) volume lost by compression [R³]
    energy : (depth,) elastic energy of the layer [E R³]
    versions : names and versions of the programs that computed it
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
        """The tip that presses."""
        return TipOutline.from_rows(self.tip_rows)
