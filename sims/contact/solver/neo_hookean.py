"""Stable Neo-Hookean tetrahedra in plain arrays: the second opinion on every MuJoCo solution.

MuJoCo computes the contact force; this module computes, from the deformed shape alone, the reaction
of the bonded bottom and wall. Both must agree, which checks the equilibrium of the whole layer and
not only that of the solver's own unknowns.

Energy density (Smith, de Goes, Kim 2018, "Stable Neo-Hookean Flesh Simulation", without the
logarithmic barrier), with Lamé's λ and μ of small strains:

    ψ = μ/2 (tr FᵀF - 3) - μ (J - 1) + (λ + μ)/2 (J - 1)²

It equals the forces of MuJoCo 4.0's `elastic3d = 1` to 3e-16; a test repeats the comparison.
"""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray, IntArray


def lame_parameters(youngs_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Lamé's λ and μ, in the unit of the modulus."""
    shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    first = youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio))
    return first, shear


def _edges(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """(tetrahedron, 3, 3) edge vectors from the first corner, as columns."""
    return np.swapaxes(points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]], 1, 2)


def volumes(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """(tetrahedron,) signed volumes; an inverted element is negative."""
    return np.asarray(np.linalg.det(_edges(points, tetrahedra)) / 6.0, dtype=np.float64)


def elastic_energy(
    rest: FloatArray, deformed: FloatArray, tetrahedra: IntArray, youngs_modulus: float, poisson_ratio: float
) -> float:
    """Energy stored in the body [force · length]; arguments as for `nodal_forces`."""
    first, shear = lame_parameters(youngs_modulus, poisson_ratio)
    rest_edges = _edges(rest, tetrahedra)
    gradient = _edges(deformed, tetrahedra) @ np.linalg.inv(rest_edges)
    dilation = np.linalg.det(gradient) - 1.0
    squares = np.einsum("eij,eij->e", gradient, gradient)
    density = 0.5 * shear * (squares - 3.0) - shear * dilation + 0.5 * (first + shear) * dilation**2
    return float(np.abs(np.linalg.det(rest_edges)) @ density) / 6.0


def nodal_forces(
    rest: FloatArray, deformed: FloatArray, tetrahedra: IntArray, youngs_modulus: float, poisson_ratio: float
) -> FloatArray:
    """Forces that the elastic body exerts on its nodes.

    Parameters
    ----------
    rest, deformed : (node, 3) positions [length]
    tetrahedra : (tetrahedron, 4) node indices
    youngs_modulus, poisson_ratio : of small strains [force/length²], [-]

    Returns
    -------
    (node, 3) forces [force]; they sum to zero.
    """
    first, shear = lame_parameters(youngs_modulus, poisson_ratio)
    rest_edges = _edges(rest, tetrahedra)
    inverse = np.linalg.inv(rest_edges)
    gradient = _edges(deformed, tetrahedra) @ inverse
    ratio = np.linalg.det(gradient)[:, None, None]
    cofactor = ratio * np.swapaxes(np.linalg.inv(gradient), 1, 2)
    stress = shear * gradient + ((first + shear) * (ratio - 1.0) - shear) * cofactor
    volume = np.abs(np.linalg.det(rest_edges))[:, None, None] / 6.0
    corner = -volume * stress @ np.swapaxes(inverse, 1, 2)
    forces = np.zeros_like(rest)
    for column in range(3):
        np.add.at(forces, tetrahedra[:, column + 1], corner[:, :, column])
    np.add.at(forces, tetrahedra[:, 0], -corner.sum(axis=2))
    return forces
