"""Coulomb friction of a deformed surface on a rigid object: force and tangent at the contact's quadrature points.

The traction τ that the pad exerts on the object along its surface, per rest area, follows from that of the last state
by a return mapping (Simo and Laursen, Comput. Struct. 42, 1992, 97-116; Wriggers, Computational Contact Mechanics,
2nd ed., 2006, section 5.2):

    w = τ_last + k (Δu - Δs),   τ* = (1 - n nᵀ) w,   τ = τ* min(1, f t / |τ*|),

where Δu is the way of the point and Δs that of the object since the last state, n the present normal, t the present
normal force per rest area, and k a stiffness: a point that sticks creeps by τ/k. Friction has no energy, so its tangent
is not symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from optopad.design.arrays import BoolArray, FloatArray
from tests.validation.contact.contact_surface import ContactSurface, GapFunction
from tests.validation.elements.hyperelastic import scattered


@dataclass(frozen=True, kw_only=True)
class Past:
    """The last state.

    Attributes
    ----------
    points, traction : (f, q, dimension) deformed points, traction τ
    place : (dimension,) displacement of the object
    """

    points: FloatArray
    traction: FloatArray
    place: FloatArray


@dataclass(frozen=True, kw_only=True)
class Sliding:
    """A surface on a moved object with friction.

    Attributes
    ----------
    top, gap, penalty : contact, as of `ContactSurface.assemble`
    stiffness : k
    past : the last state
    place : (dimension,) displacement of the object
    friction : Coulomb's coefficient f [-]
    """

    top: ContactSurface
    gap: GapFunction
    penalty: float
    stiffness: float
    past: Past
    place: FloatArray
    friction: float

    def traction(self, state: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(f, q, dimension) traction τ, and (f, q) whether a point slips."""
        points = self.top.points(state)
        distance, normal, _ = self.gap(points)
        _, trial, bound = self._trial(state, points, distance, normal)
        length = np.linalg.norm(trial, axis=-1)
        share = np.minimum(1.0, bound / np.maximum(length, 1e-300))
        return share[..., None] * trial, (length > bound) & (bound > 0.0)

    def _trial(
        self, state: FloatArray, points: FloatArray, distance: FloatArray, normal: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """w, τ* and f t."""
        way = points - self.past.points - (self.place - self.past.place)
        load = self.past.traction + self.stiffness * way
        trial = load - (load * normal).sum(axis=-1, keepdims=True) * normal
        return load, trial, self.friction * self.top.traction(state, distance, self.penalty)

    def assemble(self, state: FloatArray) -> tuple[FloatArray, csc_matrix]:
        """Residual of the friction, and its derivative by all unknowns."""
        top, points = self.top, self.top.points(state)
        distance, normal, hessian = self.gap(points)
        load, trial, bound = self._trial(state, points, distance, normal)
        length = np.maximum(np.linalg.norm(trial, axis=-1), 1e-300)
        slips, closed = length > bound, bound > 0.0
        share = np.where(slips, bound / length, 1.0)
        along = trial / length[..., None]
        eye = np.eye(normal.shape[-1])
        by_point = self.stiffness * (eye - normal[..., :, None] * normal[..., None, :])
        by_point = by_point - (load * normal).sum(axis=-1)[..., None, None] * hessian
        by_point -= normal[..., :, None] * np.einsum("fqi,fqij->fqj", load, hessian)[..., None, :]
        turned = eye - slips[..., None, None] * along[..., :, None] * along[..., None, :]
        by_point = (share * closed)[..., None, None] * (turned @ by_point)
        by_bound = (slips & closed)[..., None] * self.friction * along
        by_point -= self.penalty * by_bound[..., :, None] * normal[..., None, :]
        weight, size = top.weight, len(top.weight)
        residual = np.zeros(len(state))
        traction = (share * closed)[..., None] * trial
        force = np.einsum("fq,fqa,fqi->fai", weight, top.shape, traction).reshape(size, -1)
        np.add.at(residual, top.dofs, force)
        uu = np.einsum("fq,fqa,fqb,fqij->faibj", weight, top.shape, top.shape, by_point, optimize=True)
        um = np.einsum("fq,fqa,fqi,fqm->faim", weight, top.shape, by_bound, top.hats, optimize=True)
        unknowns, multipliers = top.dofs.shape[1], top.multiplier_dofs.shape[1]
        local = np.zeros((size, unknowns + multipliers, unknowns + multipliers))
        local[:, :unknowns, :unknowns] = uu.reshape(size, unknowns, unknowns)
        local[:, :unknowns, unknowns:] = um.reshape(size, unknowns, multipliers)
        return residual, scattered(local, np.concatenate([top.dofs, top.multiplier_dofs], axis=1), len(state))
