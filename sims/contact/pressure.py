"""Contact pressure under the tip, from the forces that the solver found on the nodes of the top.

The pressure p is piecewise linear over the deformed nodes and has, with the hat functions N of the top,
the nodal forces f as its lumped load: p = f / A, A = ∫ N 2πr ds over the deformed surface. Then ∫ p dA is
the sum of the nodal forces exactly, and its vertical part ∫ p 2πr dr is the press force but for the mesh.

What it leaves out: anything finer than the mesh. The edge of the contact is smeared over one node spacing,
a singular edge (of a flat punch) is averaged over it, and a contact of fewer than `FEWEST_SPACINGS` node
spacings from axis to edge has no profile to speak of (`is_resolved` is False). Between solved depths the
nodal forces are interpolated like the nodes' positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from sims.contact.profiles import SolvedPress, UnitPress

FloatArray = NDArray[np.float64]

FEWEST_SPACINGS = 4.0
"""Contact radius over node spacing below which no pressure is quoted [-]."""
LEAST_SHARE = 1e-3
"""A node carries load if its force is at least this share of the greatest nodal force [-]."""


@dataclass(frozen=True, kw_only=True)
class ContactPressure:
    """Pressure of the tip on the layer at one depth.

    Attributes
    ----------
    radius_mm : (n,) radii of the deformed surface nodes, from the axis to the first node without load [mm]
    height_mm : (n,) their heights [mm]
    pressure_mpa : (n,) pressure there [MPa]; 0 at the last
    is_resolved : whether the contact spans enough of the mesh for the profile to mean something
    """

    radius_mm: FloatArray
    height_mm: FloatArray
    pressure_mpa: FloatArray
    is_resolved: bool

    @property
    def peak_mpa(self) -> float | None:
        """Greatest pressure [MPa]; None where the mesh does not resolve the contact."""
        return float(self.pressure_mpa.max()) if self.is_resolved else None

    @property
    def axial_force_n(self) -> float:
        """Vertical force of the pressure, ∫ p 2πr dr [N]: equal to the press force but for the mesh."""
        first, second = self.radius_mm[:-1], self.radius_mm[1:]
        near, far = self.pressure_mpa[:-1], self.pressure_mpa[1:]
        moment = near * (2.0 * first + second) + far * (first + 2.0 * second)
        return float(np.pi / 3.0 * np.sum(moment * (second - first)))


def tributary_areas(radius: FloatArray, height: FloatArray) -> FloatArray:
    """(node,) area of the full turn that belongs to each node of a polyline, ∫ N 2πr ds [length²]."""
    length = np.hypot(np.diff(radius), np.diff(height))
    areas = np.zeros_like(radius)
    areas[:-1] += 2.0 * np.pi * length * (radius[:-1] / 3.0 + radius[1:] / 6.0)
    areas[1:] += 2.0 * np.pi * length * (radius[:-1] / 6.0 + radius[1:] / 3.0)
    return areas


def nodal_forces_at(unit: UnitPress, depth: float) -> FloatArray:
    """(node,) force of the tip on the nodes of the top [E R²] at a depth within the solved ones [tip radii]."""
    flat = np.zeros((1, unit.rest_radii.size))
    course = PchipInterpolator(np.append(0.0, unit.depths), np.concatenate([flat, unit.normal_force]), axis=0)
    return np.maximum(np.asarray(course(depth), dtype=np.float64), 0.0)


def contact_pressure(press: SolvedPress, depth_mm: float) -> ContactPressure:
    """Pressure between tip and layer.

    Parameters
    ----------
    press : the solved press
    depth_mm : depth of the press [mm]; 0 or less: no contact

    Raises
    ------
    ModelScopeError : deeper than solved
    """
    contact_radius_mm = press.at(depth_mm).contact_radius_mm  # refuses what was not solved
    unit, radius_mm = press.unit, press.tip_radius_mm
    depth = min(max(depth_mm / radius_mm, 0.0), unit.deepest)
    nodes, force = unit.nodes_at(depth), nodal_forces_at(unit, depth)
    loaded = np.flatnonzero(force > LEAST_SHARE * force.max())
    count = int(loaded[-1]) + 2 if loaded.size else 1
    pressure = press.youngs_modulus_mpa * force / tributary_areas(nodes[0], nodes[1])
    pressure[count - 1 :] = 0.0
    return ContactPressure(
        radius_mm=nodes[0, :count] * radius_mm,
        height_mm=nodes[1, :count] * radius_mm,
        pressure_mpa=pressure[:count],
        is_resolved=contact_radius_mm >= FEWEST_SPACINGS * press.mesh_mm,
    )
