"""Axisymmetric near-incompressible neo-Hookean solid, displacement and pressure: energy, residual and tangent.

Total energy of the full turn, minimal in the displacement u and maximal in the pressure-like field p:

    E(u, p) = ∫ [ μ/2 (tr FᵀF - 3) - μ ln J + κ/2 (J - 1)² + p (J - 1) - p²/(2(λ - κ)) ] 2πr dr dz
    F = I + ∂(u_r, u_z)/∂(r, z) in the plane, 1 + u_r/r around the axis;  J = det F

Stationary in p it is the compressible neo-Hookean solid μ/2 (I₁ - 3) - μ ln J + λ/2 (J - 1)² with Lamé's
constants of small strains, whatever the share κ of λ that acts pointwise: p enforces J on average over elements
and leaves J at a point free, which a very deep press on a coarse mesh would abuse; κ of a few μ prevents it.
Taylor-Hood elements (biquadratic u, continuous bilinear p) satisfy the inf-sup condition, so that λ/μ may be
large without locking. Left out: viscosity, gravity, friction.

Source: Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2nd ed., ch. 6 and 8 (solid),
Brezzi and Fortin, Mixed and Hybrid Finite Element Methods, ch. VI (elements).

Unknowns are one vector: u_r and u_z node by node, then p. Lengths are in tip radii, stresses in Young's modulus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from skfem import Basis, ElementQuad1, ElementQuad2, MeshQuad

from tests.validation.newton import InvertedElementError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

QUADRATURE = 5
"""Polynomial order that the volume quadrature integrates exactly: 3 x 3 points."""

POINTWISE_SHARE = 10.0
"""Part of λ that acts at each quadrature point [μ]."""


@dataclass(frozen=True, kw_only=True)
class Assembled:
    """Energy, residual and tangent at one state."""

    energy: float
    residual: FloatArray
    tangent: csc_matrix | None


def lame(poisson_ratio: float) -> tuple[float, float]:
    """Lamé's λ and μ for Young's modulus 1."""
    mu = 0.5 / (1.0 + poisson_ratio)
    return 2.0 * mu * poisson_ratio / (1.0 - 2.0 * poisson_ratio), mu


class Solid:
    """One mesh with everything that does not depend on the state."""

    def __init__(self, mesh: MeshQuad, poisson_ratio: float) -> None:
        self.mesh = mesh
        self.lam, self.mu = lame(poisson_ratio)
        self.pointwise = POINTWISE_SHARE * self.mu
        self.mixed = self.lam - self.pointwise
        displacement = Basis(mesh, ElementQuad2(), intorder=QUADRATURE)
        pressure = displacement.with_element(ElementQuad1())
        self.displacement = displacement
        self.nodes: FloatArray = displacement.doflocs
        self.node_count = int(displacement.N)
        self.size = 2 * self.node_count + int(pressure.N)
        radius = displacement.global_coordinates()[0]
        self.weight: FloatArray = displacement.dx * 2.0 * np.pi * radius
        self.strain = self._strain_operator(displacement, radius)
        values = np.array([np.asarray(one[0]) for one in pressure.basis])
        self.pressure_values: FloatArray = np.ascontiguousarray(
            np.broadcast_to(values, (4, *radius.shape)).transpose(1, 2, 0)
        )
        nodes = displacement.element_dofs.T
        self.u_dofs: IntArray = np.stack([2 * nodes, 2 * nodes + 1], axis=-1).reshape(len(nodes), 18)
        self.p_dofs: IntArray = 2 * self.node_count + pressure.element_dofs.T

    @staticmethod
    def _strain_operator(basis: Basis, radius: FloatArray) -> FloatArray:
        """(element, point, 5, 18) derivative of F_rr, F_rz, F_zr, F_zz, F_θθ by the element's displacements."""
        elements, points = radius.shape
        operator = np.zeros((elements, points, 5, 18))
        for index, (field,) in enumerate(basis.basis):
            operator[:, :, 0, 2 * index] = field.grad[0]
            operator[:, :, 1, 2 * index] = field.grad[1]
            operator[:, :, 2, 2 * index + 1] = field.grad[0]
            operator[:, :, 3, 2 * index + 1] = field.grad[1]
            operator[:, :, 4, 2 * index] = np.asarray(field) / radius
        return operator

    def deformation(self, state: FloatArray) -> FloatArray:
        """(element, point, 5) deformation gradient F_rr, F_rz, F_zr, F_zz, F_θθ."""
        gradient = np.matmul(self.strain, state[self.u_dofs][:, None, :, None])[..., 0]
        return np.asarray(gradient + np.array([1.0, 0.0, 0.0, 1.0, 1.0]))

    def pressure(self, state: FloatArray) -> FloatArray:
        """(element, point) the field p."""
        return np.asarray(np.matmul(self.pressure_values, state[self.p_dofs][:, :, None])[..., 0])

    def volume(self, state: FloatArray) -> float:
        """Deformed volume of the full turn."""
        return float((self.weight * volume_ratio(self.deformation(state))).sum())

    def assemble(self, state: FloatArray, with_tangent: bool) -> Assembled:
        """Energy, its gradient and its second derivative.

        Raises
        ------
        InvertedElementError : J <= 0 somewhere
        """
        gradient, pressure = self.deformation(state), self.pressure(state)
        ratio = volume_ratio(gradient)
        if not ratio.min() > 0.0:
            raise InvertedElementError("an element has no positive volume")
        density = (
            0.5 * self.mu * ((gradient**2).sum(axis=-1) - 3.0 - 2.0 * np.log(ratio))
            + 0.5 * self.pointwise * (ratio - 1.0) ** 2
            + pressure * (ratio - 1.0)
            - pressure**2 / (2.0 * self.mixed)
        )
        return Assembled(
            energy=float((self.weight * density).sum()),
            residual=self.weak_form(gradient, pressure),
            tangent=self._tangent(gradient, pressure) if with_tangent else None,
        )

    def _spherical(self, ratio: FloatArray, pressure: FloatArray) -> FloatArray:
        """Derivative of the energy density by J."""
        return pressure + self.pointwise * (ratio - 1.0) - self.mu / ratio

    def weak_form(self, gradient: FloatArray, pressure: FloatArray) -> FloatArray:
        """First variation of the energy at any fields given at the quadrature points.

        Parameters
        ----------
        gradient : (element, point, 5) deformation gradient
        pressure : (element, point) the field p
        """
        ratio = volume_ratio(gradient)
        stress = self.mu * gradient + self._spherical(ratio, pressure)[..., None] * cofactor(gradient)
        weighted = (self.weight[..., None] * stress)[..., None]
        dilation = self.weight * (ratio - 1.0 - pressure / self.mixed)
        variation = np.zeros(self.size)
        np.add.at(variation, self.u_dofs, np.matmul(self.strain.swapaxes(2, 3), weighted).sum(axis=1)[..., 0])
        np.add.at(variation, self.p_dofs, (self.pressure_values * dilation[..., None]).sum(axis=1))
        return variation

    def _tangent(self, gradient: FloatArray, pressure: FloatArray) -> csc_matrix:
        """Sparse second derivative of the energy, symmetric and indefinite."""
        rr, rz, zr, zz, around = np.moveaxis(gradient, -1, 0)
        ratio, by_gradient = volume_ratio(gradient), cofactor(gradient)
        spherical = self._spherical(ratio, pressure)
        twice_by_ratio = (self.pointwise + self.mu / ratio**2)[..., None, None]
        stiffness = twice_by_ratio * by_gradient[..., :, None] * by_gradient[..., None, :]
        stiffness[..., range(5), range(5)] += self.mu
        second = [(0, 3, around), (1, 2, -around), (0, 4, zz), (1, 4, -zr), (2, 4, -rz), (3, 4, rr)]
        for i, j, value in second:
            stiffness[..., i, j] += spherical * value
            stiffness[..., j, i] += spherical * value
        elements, points = ratio.shape
        weight = self.weight[..., None]
        flat = self.strain.reshape(elements, points * 5, 18)
        loaded = np.matmul(weight[..., None] * stiffness, self.strain).reshape(flat.shape)
        uu = np.matmul(flat.swapaxes(1, 2), loaded)
        dilation = np.matmul(self.strain.swapaxes(2, 3), (weight * by_gradient)[..., None])[..., 0]
        up = np.matmul(dilation.swapaxes(1, 2), self.pressure_values)
        pp = np.matmul((weight * self.pressure_values).swapaxes(1, 2), self.pressure_values) / -self.mixed
        local = np.block([[uu, up], [up.swapaxes(1, 2), pp]])
        return scattered(local, np.concatenate([self.u_dofs, self.p_dofs], axis=1), self.size)


def volume_ratio(gradient: FloatArray) -> FloatArray:
    """(...) J of deformation gradients F_rr, F_rz, F_zr, F_zz, F_θθ."""
    rr, rz, zr, zz, around = np.moveaxis(gradient, -1, 0)
    return np.asarray((rr * zz - rz * zr) * around)


def cofactor(gradient: FloatArray) -> FloatArray:
    """(..., 5) derivative of J by the deformation gradient."""
    rr, rz, zr, zz, around = np.moveaxis(gradient, -1, 0)
    return np.stack([zz * around, -zr * around, -rz * around, rr * around, rr * zz - rz * zr], axis=-1)


def scattered(local: FloatArray, dofs: IntArray, size: int) -> csc_matrix:
    """Sum of element matrices, (element, n, n), at their unknowns, (element, n)."""
    rows, columns = (
        np.broadcast_to(dofs[:, :, None], local.shape),
        np.broadcast_to(dofs[:, None, :], local.shape),
    )
    return csc_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
