"""Frictionless contact of a deformed surface with a rigid tip: energy, residual and tangent.

Contact adds to the energy of the solid, at quadrature points of the surface (rest area dA),

    C(u, t) = ∫ [ <t - k g>² - t² ] / (2k) dA,     g = signed distance of the deformed point to the tip,

with <x> = max(x, 0), penalty k and multiplier t (Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991).
Minimal in u and maximal in t: inside the contact the mean gap vanishes, outside t does, whatever k is. <t - k g>
is the contact force per rest area; over the ratio of deformed to rest area it is the contact pressure.
t is continuous and linear, an order less than u, which satisfies the inf-sup condition; multipliers at the
quadrature points do not, and their pressure oscillates from element to element.

One class serves the axisymmetric top (dimension 2) and that of a block (dimension 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from optopad.design.arrays import FloatArray, IntArray
from tests.validation.elements.hyperelastic import scattered

GapFunction = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Points (..., dimension) -> distance (...), its gradient (..., dimension), its Hessian (..., dimension, dimension)."""


@dataclass(frozen=True, kw_only=True)
class ContactSurface:
    """The part of a surface that may touch; f facets with q quadrature points.

    Attributes
    ----------
    shape : (f, q, n) values of the displacement's shape functions
    hats : (f, q, m) values of the multiplier's
    weight : (f, q) rest area
    rest : (f, q, dimension) points at rest
    nodes : (f, n) displacement nodes; unknowns of a node are node * dimension + axis
    multiplier_dofs : (f, m) unknowns of the multiplier
    """

    shape: FloatArray
    hats: FloatArray
    weight: FloatArray
    rest: FloatArray
    nodes: IntArray
    multiplier_dofs: IntArray

    @property
    def dofs(self) -> IntArray:
        """(f, n * dimension) displacement unknowns."""
        dimension = self.rest.shape[-1]
        return (self.nodes[..., None] * dimension + np.arange(dimension)).reshape(len(self.nodes), -1)

    def points(self, state: FloatArray) -> FloatArray:
        """(f, q, dimension) deformed points."""
        moved = state[self.dofs].reshape(*self.nodes.shape, -1)
        return np.asarray(self.rest + np.matmul(self.shape, moved))

    def multiplier(self, state: FloatArray) -> FloatArray:
        """(f, q) multiplier."""
        return np.asarray(np.matmul(self.hats, state[self.multiplier_dofs][..., None])[..., 0])

    def traction(self, state: FloatArray, distance: FloatArray, penalty: float) -> FloatArray:
        """(f, q) contact force per rest area."""
        return np.maximum(self.multiplier(state) - penalty * distance, 0.0)

    def assemble(self, state: FloatArray, gap: GapFunction, penalty: float) -> tuple[FloatArray, csc_matrix]:
        """First and second derivative of the contact energy by all unknowns."""
        distance, normal, hessian = gap(self.points(state))
        traction = self.traction(state, distance, penalty)
        closed = traction > 0.0
        weight = self.weight[..., None]
        along = (self.shape[..., None] * normal[..., None, :]).reshape(*distance.shape, -1)
        residual = np.zeros(len(state))
        np.add.at(residual, self.dofs, -(weight * traction[..., None] * along).sum(axis=1))
        excess = (traction - self.multiplier(state)) / penalty
        np.add.at(residual, self.multiplier_dofs, (weight * excess[..., None] * self.hats).sum(axis=1))
        touching = weight * closed[..., None]
        uu = np.matmul((penalty * touching * along).swapaxes(1, 2), along)
        load = self.weight * traction
        uu -= np.einsum(
            "fq,fqa,fqb,fqij->faibj", load, self.shape, self.shape, hessian, optimize=True
        ).reshape(uu.shape)
        um = -np.matmul((touching * along).swapaxes(1, 2), self.hats)
        mm = np.matmul((weight * (closed - 1.0)[..., None] * self.hats).swapaxes(1, 2), self.hats) / penalty
        local = np.block([[uu, um], [um.swapaxes(1, 2), mm]])
        return residual, scattered(
            local, np.concatenate([self.dofs, self.multiplier_dofs], axis=1), len(state)
        )


def facet_nodes(points: FloatArray, element_dofs: IntArray, is_on: FloatArray) -> tuple[IntArray, IntArray]:
    """Nodes of an element basis that lie on a facet, and their places in the element.

    Parameters
    ----------
    points : (dimension, node) positions
    element_dofs : (n, f) nodes of the elements behind the facets
    is_on : (node,) whether a node lies on the surface

    Returns
    -------
    (f, k) nodes, (f, k) indices into the n, sorted by radius, then by the other axes.
    """
    nodes = element_dofs.T
    place = np.array([np.flatnonzero(is_on[row]) for row in nodes])
    kept = np.take_along_axis(nodes, place, axis=1)
    order = np.array([np.lexsort(points[::-1, row]) for row in kept])
    place = np.take_along_axis(place, order, axis=1)
    return np.take_along_axis(nodes, place, axis=1), place
