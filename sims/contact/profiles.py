"""A solved press: surfaces, forces and checks at stored depths, and everything in between.

Between stored depths the trajectories of the material nodes of the top, r(d) and z(d), are
interpolated by PCHIP (Fritsch and Carlson 1980: monotone data stay monotone), with the flat state as
depth 0, and the contact edge is found again on every interpolated surface. Force is interpolated as
F^(2/3), which is linear in depth in the Hertz limit; that keeps the power law down to zero. Below the
first solved depth (tip radius/150, 0.02 mm for a 3 mm tip) the contact is smaller than a mesh cell:
there the heights of the first curve are scaled with the depth and its contact radius with the root of
the depth, as Hertz' is. Nothing is extrapolated beyond the deepest solved depth.

`UnitPress` has lengths in tip radii and forces in E R²; `SolvedPress` gives it units.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from design.errors import ModelScopeError
from sims.contact.surface_curve import FAR_SPACING, contact_tolerance, surface_curve
from sims.indentation import Indentation

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class UnitPress:
    """Settled states of one layer under one tip; lengths in tip radii, forces in E R².

    Attributes
    ----------
    layer_depth, wall_radius : elastic depth of the layer, radius of the bonded wall
    mesh_size : node spacing under the tip
    wedge_angle : opening angle of the solved wedge [rad]
    depths : (depth,) solved press depths, increasing, without 0
    rest_radii : (node,) radii of the top nodes at rest, from the axis to the wall
    radii, heights : (depth, node) deformed top
    normal_force : (depth, node) force of the tip on each top node, whole turn; positive where it presses
    force, contact_radius : (depth,)
    reaction : (depth,) reaction of the bonded surfaces, computed from the shape alone
    penetration, last_step : (depth,) overlap with the tip; last motion of the solver
    chatter : (depth,) spread of the solver's cycle, 0 where it came to rest
    smallest_stretch : (depth,) smallest volume ratio of an element [-]
    volume_loss : (depth,) volume lost by compression [R³]
    energy : (depth,) elastic energy of the layer [E R³]
    versions : names and versions of what computed it
    """

    layer_depth: float
    wall_radius: float
    mesh_size: float
    wedge_angle: float
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

    @property
    def deepest(self) -> float:
        """Deepest solved press [tip radii]."""
        return float(self.depths[-1])

    @cached_property
    def _nodes(self) -> PchipInterpolator:
        """Depth -> (2, node) radii and heights of the top nodes."""
        flat = np.stack([self.rest_radii, np.zeros_like(self.rest_radii)])[None]
        solved = np.stack([self.radii, self.heights], axis=1)
        return PchipInterpolator(np.append(0.0, self.depths), np.concatenate([flat, solved]), axis=0)

    @cached_property
    def _force_root(self) -> PchipInterpolator:
        """Depth -> force^(2/3)."""
        return PchipInterpolator(np.append(0.0, self.depths), np.append(0.0, self.force) ** (2 / 3))

    def nodes_at(self, depth: float) -> FloatArray:
        """(2, node) radii and heights of the top nodes at a depth [all tip radii]."""
        return np.asarray(self._nodes(depth), dtype=np.float64)

    def force_at(self, depth: float) -> float:
        """Force [E R²] at a depth between 0 and the deepest solved one [tip radii]."""
        return float(self._force_root(depth) ** 1.5) if depth > 0.0 else 0.0

    def curve_at(self, depth: float) -> tuple[FloatArray, FloatArray, float]:
        """Radius and height (n,) of the top and the contact radius, at a depth [all tip radii]."""
        if depth <= 0.0:
            flat = np.linspace(0.0, self.wall_radius, int(self.wall_radius / FAR_SPACING) + 1)
            return flat, np.zeros_like(flat), 0.0
        first = float(self.depths[0])
        if depth < first:
            radius, height, contact_radius = self.curve_at(first)
            return radius, height * (depth / first), contact_radius * (depth / first) ** 0.5
        nodes = self.nodes_at(depth)
        tolerance = contact_tolerance(self.mesh_size, self.wedge_angle)
        return surface_curve(nodes[0], nodes[1], depth, spacing=self.mesh_size, tolerance=tolerance)


@dataclass(frozen=True, kw_only=True)
class SolvedPress:
    """A press of one tip into one layer, in mm and N, at every depth up to the deepest solved one.

    Attributes
    ----------
    unit : the solution in tip radii and E R²
    tip_radius_mm : radius of the hemispherical tip [mm]
    youngs_modulus_mpa : modulus of the layer [MPa]; it scales the force only
    notes : what the user should know about this solution
    """

    unit: UnitPress
    tip_radius_mm: float
    youngs_modulus_mpa: float
    notes: tuple[str, ...] = ()

    @property
    def deepest_mm(self) -> float:
        """Deepest solved press [mm]."""
        return self.unit.deepest * self.tip_radius_mm

    @property
    def mesh_mm(self) -> float:
        """Node spacing under the tip [mm]."""
        return self.unit.mesh_size * self.tip_radius_mm

    def at(self, depth_mm: float) -> Indentation:
        """The press at a depth [mm]; a depth of 0 or less is the untouched pad.

        Raises
        ------
        ModelScopeError : deeper than solved
        """
        depth = depth_mm / self.tip_radius_mm
        if not depth <= self.unit.deepest * (1.0 + 1e-9):
            raise ModelScopeError(
                f"depth_mm: {depth_mm:g} is beyond the solved {self.deepest_mm:g} mm; "
                "raise operating.max_depth_mm or press less deep"
            )
        depth = min(depth, self.unit.deepest)
        radius, height, contact_radius = self.unit.curve_at(depth)
        return Indentation(
            depth_mm=depth_mm,
            tip_radius_mm=self.tip_radius_mm,
            radius_mm=radius * self.tip_radius_mm,
            height_mm=height * self.tip_radius_mm,
            contact_radius_mm=contact_radius * self.tip_radius_mm,
            force_n=self.unit.force_at(depth) * self.youngs_modulus_mpa * self.tip_radius_mm**2,
        )
