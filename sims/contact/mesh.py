r"""Mesh of the elastic layer, forces of its elements, and contact forces on its nodes.

The mesh lies in the r-z half-plane: crossed triangles, fine under the tip and coarse towards the wall.

All lengths are in tip radii, so one mesh serves every press with the same ratio of layer thickness to tip radius. Every
rectangle of a graded grid is cut along both diagonals into four triangles that meet at a middle node. Linear triangles
from a single diagonal would lock in nearly incompressible materials, but crossed ones can deform at constant volume.

        r = 0                                r = wall
    z=0  +--+--+--+--+--+---+----+------+------+   free top
         |\/|\/|\/|\/|\/|
         |/\|/\|/\|/\|/\| ...                 bonded wall
    z=-h +--+--+--+--+--+---+----+------+------+   bonded bottom

Under a spherical top (`crown`), every column of the mesh is scaled to the local thickness: its bottom stays, and its
top lies on the sphere, whose apex is at height 0. At the rim, the angle between top and wall exceeds 90°, so stress is
singular there. Columns become narrower towards the rim; otherwise the force would be too large, by 3 % on a pad of 3.7
tip radii.

The tip slides on the top, so the spacing there limits the resolution of the contact radius. The fine zone extends
beyond the largest contact radius (one tip radius), and deeper than the steep strains of a deep press.

Every MuJoCo solution is checked with an independent model of stable neo-Hookean tetrahedra. MuJoCo computes the contact
force; `nodal_forces` computes the reaction of the bonded bottom and wall from the deformed shape alone. The two must
agree. This checks the equilibrium of the whole layer, not only that of the solver's own unknowns.

The energy density is (Smith, de Goes, Kim 2018, "Stable Neo-Hookean Flesh Simulation", without the logarithmic barrier)

    ψ = μ/2 (tr FᵀF - 3) - μ (J - 1) + (λ + μ)/2 (J - 1)²

with Lamé's λ and μ at small strains. Its forces equal those of MuJoCo 4.0's `elastic3d = 1` to 3e-16; a test repeats
the comparison.

The pressure under the tip is computed from the tip's force on each node of the top. The solver finds one normal force
per contact between the tip and an element of the layer. Each is distributed to the two adjacent nodes of the top by the
lever rule, so that the forces on the nodes add up to the sum of all contacts. The solver itself lets a contact act on
all corners of its element, so 1 to 2 % of the load acts on nodes below the top. This is left out here.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.contact.scope import crown_drop, require_rim

FINE_RADIUS = 4 / 3
"""Radius of the finely meshed zone under the tip [tip radii]."""
FINE_DEPTH = 0.5
"""Depth of the finely meshed zone under the tip [tip radii]."""
GROWTH = 1.08
"""Ratio of neighbouring spacings outside the fine zone [-]."""
LARGEST_RADIAL_SPACING = 0.25
"""Largest radial spacing [tip radii]."""
FEWEST_ROWS = 20
"""Layer thickness over the largest axial spacing [-], unless the spacing under the tip is larger than that."""

RIM_SPACING = 0.02
"""Radial spacing next to the wall of a crowned pad [tip radii]. Halving it changes a press by less than a micrometre.
"""
RIM_GROWTH = 1.3
"""Ratio of neighbouring radial spacings from the wall of a crowned pad inward [-]."""


@dataclass(frozen=True, kw_only=True)
class RadialMesh:
    """Mesh of triangles in the r-z half-plane; lengths in tip radii.

    Attributes
    ----------
    nodes : (node, 2) radius and height of the nodes at rest; the top's apex is at height 0
    triangles : (triangle, 3) indices of each triangle's nodes
    top : (top node,) indices of the top surface's nodes, from the axis outward
    is_bonded : (node,) True on the bottom and on the wall
    """

    nodes: FloatArray
    triangles: IntArray
    top: IntArray
    is_bonded: BoolArray


def graded_spacing(length: float, fine_length: float, fine: float, largest: float) -> FloatArray:
    """Coordinates from 0 to `length`: evenly spaced up to `fine_length`, then with increasing spacing.

    Parameters
    ----------
    length, fine_length : whole length, and length of the even part [any unit]
    fine, largest : spacing of the even part, and upper limit of the spacing [same unit]

    Returns
    -------
    (n,) increasing coordinates, scaled to end exactly at `length`.
    """
    even = min(fine_length, length)
    points = list(np.linspace(0.0, even, max(1, round(even / fine)) + 1))
    fine_count = len(points)
    step = fine
    while points[-1] < length - 1e-9:
        step = min(step * GROWTH, largest)
        points.append(points[-1] + step)
    coordinates = np.array(points)
    if len(coordinates) > fine_count:
        last_fine = coordinates[fine_count - 1]
        stretch = (length - last_fine) / (coordinates[-1] - last_fine)
        coordinates[fine_count:] = last_fine + (coordinates[fine_count:] - last_fine) * stretch
    return coordinates


def finer_towards_end(coordinates: FloatArray, last: float, growth: float) -> FloatArray:
    """Refine coordinates towards their end to a spacing of about `last`, unless they are already finer.

    Parameters
    ----------
    coordinates : (n,) increasing coordinates [any unit]
    last : spacing at the end [same unit]
    growth : ratio by which spacings grow from the end backwards, until they reach the original spacing [-]
    """
    largest = float(coordinates[-1] - coordinates[-2])
    if largest <= last:
        return coordinates
    steps = last * growth ** np.arange(np.ceil(np.log(largest / last) / np.log(growth)))
    kept = coordinates[coordinates <= coordinates[-1] - steps.sum()]
    steps *= (coordinates[-1] - kept[-1]) / steps.sum()
    return np.concatenate([kept, (coordinates[-1] - np.cumsum(steps)[:-1])[::-1], coordinates[-1:]])


def _crossed(columns: int, rows: int) -> IntArray:
    """Node indices (4 * cells, 3) of the triangles. The grid's nodes come first, then each cell's middle node."""
    column, row = np.meshgrid(np.arange(columns - 1), np.arange(rows - 1), indexing="ij")
    corner = (column * rows + row).ravel()
    middle = columns * rows + np.arange(corner.size)
    ring = [corner, corner + rows, corner + rows + 1, corner + 1]
    sides = [np.stack([ring[k], ring[(k + 1) % 4], middle], axis=1) for k in range(4)]
    return np.stack(sides, axis=1).reshape(-1, 3).astype(np.int64)


def radial_mesh(layer_depth: float, wall_radius: float, spacing: float, crown: float = 0.0) -> RadialMesh:
    """Mesh of a layer bonded at its bottom and at its cylindrical wall.

    Parameters
    ----------
    layer_depth, wall_radius : layer thickness on the axis, and wall radius [tip radii]
    spacing : node spacing in the fine zone under the tip [tip radii]
    crown : tip radius over the radius of the top's sphere; 0 is flat [-]

    Raises
    ------
    InputError, ModelScopeError : the crown is not finite or is negative, or leaves too thin a rim
    """
    require_rim(layer_depth, wall_radius, crown)
    radii = graded_spacing(wall_radius, FINE_RADIUS, spacing, LARGEST_RADIAL_SPACING)
    if crown > 0.0:
        radii = finer_towards_end(radii, RIM_SPACING, RIM_GROWTH)
    coarsest = max(spacing, layer_depth / FEWEST_ROWS)
    heights = -graded_spacing(layer_depth, FINE_DEPTH, spacing, coarsest)[::-1]
    grid = np.stack(np.meshgrid(radii, heights, indexing="ij"), axis=-1)
    if crown > 0.0:
        grid[..., 1] -= crown_drop(radii, crown)[:, None] * (1.0 + heights / layer_depth)
    middles = 0.25 * (grid[1:, 1:] + grid[1:, :-1] + grid[:-1, 1:] + grid[:-1, :-1])
    nodes = np.concatenate([grid.reshape(-1, 2), middles.reshape(-1, 2)])
    rows = len(heights)
    return RadialMesh(
        nodes=nodes,
        triangles=_crossed(len(radii), rows),
        top=np.arange(len(radii), dtype=np.int64) * rows + rows - 1,
        is_bonded=(nodes[:, 1] < -layer_depth + 1e-9) | (nodes[:, 0] > wall_radius - 1e-9),
    )


def lame_parameters(youngs_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Lamé's λ and μ, in the unit of the modulus."""
    shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio))
    first = youngs_modulus * poisson_ratio / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio))
    return first, shear


def _edges(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Edge vectors (tetrahedron, 3, 3) from each tetrahedron's first corner, as columns."""
    return np.swapaxes(points[tetrahedra[:, 1:]] - points[tetrahedra[:, :1]], 1, 2)


def volumes(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Signed volumes (tetrahedron,) of the tetrahedra; negative for an inverted one."""
    return np.asarray(np.linalg.det(_edges(points, tetrahedra)) / 6.0, dtype=np.float64)


def elastic_energy(
    rest: FloatArray, deformed: FloatArray, tetrahedra: IntArray, youngs_modulus: float, poisson_ratio: float
) -> float:
    """Elastic energy stored in the body [force · length]; arguments are those of `nodal_forces`."""
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
    rest, deformed : (node, 3) positions at rest and deformed [length]
    tetrahedra : (tetrahedron, 4) node indices
    youngs_modulus, poisson_ratio : elastic constants at small strain [force/length²], [-]

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


def contact_forces(data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
    """Positions and normal forces of all frictionless contacts in the last solver step.

    Returns
    -------
    (contact, 2) radius and height of the contacts, and (contact,) their normal forces, for this wedge and not the full
    circle
    """
    count = data.ncon
    address = np.asarray(data.contact.efc_address[:count], dtype=np.int64)
    kept = address >= 0
    place = np.asarray(data.contact.pos[:count], dtype=np.float64).reshape(-1, 3)[kept]
    at = np.stack([np.hypot(place[:, 0], place[:, 1]), place[:, 2]], axis=1)
    return at, np.asarray(data.efc_force, dtype=np.float64)[address[kept]]


def shared_out(at: FloatArray, force: FloatArray, nodes: FloatArray) -> FloatArray:
    """Distribute point forces to the nodes of a polyline: each to both ends of the segment nearest to it.

    Parameters
    ----------
    at : (force, 2) points at which the forces act, in the coordinate system of `nodes`
    force : (force,) magnitudes of the forces
    nodes : (node, 2) nodes of the polyline

    Returns
    -------
    (node,) forces on the nodes, with the same sum as `force`
    """
    side = np.diff(nodes, axis=0)
    offset = at[:, None, :] - nodes[None, :-1, :]
    share = np.clip(np.einsum("fsk,sk->fs", offset, side) / np.einsum("sk,sk->s", side, side), 0.0, 1.0)
    distance = np.linalg.norm(offset - share[:, :, None] * side[None], axis=2)
    nearest = distance.argmin(axis=1)
    far = share[np.arange(len(force)), nearest]
    count = len(nodes)
    return np.asarray(
        np.bincount(nearest, weights=(1.0 - far) * force, minlength=count)
        + np.bincount(nearest + 1, weights=far * force, minlength=count),
        dtype=np.float64,
    )
