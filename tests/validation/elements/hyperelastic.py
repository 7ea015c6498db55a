"""Nearly incompressible neo-Hookean solid, displacement and pressure: energy, residual and tangent.

Energy, minimal in the displacement u and maximal in the pressure-like field p:

    E(u, p) = ∫ [ μ/2 (tr FᵀF - 3) - μ ln J + κ/2 (J - 1)² + p (J - 1) - p²/(2(λ - κ)) ] dV,   J = det F

Stationary in p it is the compressible neo-Hookean solid μ/2 (I₁ - 3) - μ ln J + λ/2 (J - 1)² with Lamé's
constants of small strains, whatever the share κ of λ that acts pointwise: p enforces J on average over elements
and leaves J at a point free, which a very deep press on a coarse mesh would abuse; κ of a few μ prevents it.
Taylor-Hood elements (quadratic u, continuous linear p) satisfy the inf-sup condition, so that λ/μ may be large
without locking. Left out: viscosity, gravity, friction.

Source: Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2nd ed., ch. 6 and 8 (solid),
Brezzi and Fortin, Mixed and Hybrid Finite Element Methods, ch. VI (elements).

Unknowns are one vector: the displacements node by node, then p. Lengths are in tip radii, stresses in Young's modulus.
The components of F are listed in one axis: see `Axisymmetric` (5) and `Spatial` (9).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from scipy.sparse import csc_matrix
from skfem import Basis, ElementHex1, ElementHex2, ElementQuad1, ElementQuad2, Mesh

from optopad.design.arrays import FloatArray, IntArray
from tests.validation.elements.newton import InvertedElementError

QUADRATURE = 5
"""Polynomial order that the volume quadrature integrates exactly: 3 Gauss points an axis."""
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


class Kinematics(Protocol):
    """How displacements strain a solid."""

    dimension: int
    identity: FloatArray
    displacement_element: type
    pressure_element: type

    def weight(self, basis: Basis) -> FloatArray:
        """(element, point) volume at rest of the quadrature points."""

    def strain_operator(self, basis: Basis) -> FloatArray:
        """(element, point, component, unknown) derivative of F by the element's displacements."""

    def volume_ratio(self, gradient: FloatArray) -> FloatArray:
        """(...) J of deformation gradients (..., component)."""

    def cofactor(self, gradient: FloatArray) -> FloatArray:
        """(..., component) derivative of J by F."""

    def second_derivative(self, gradient: FloatArray) -> list[tuple[int, int, FloatArray]]:
        """Components i < j and the derivative (...) of J by F_i and F_j, where it is not zero."""


class Axisymmetric:
    """F_rr, F_rz, F_zr, F_zz, F_θθ = 1 + u_r/r of a body of revolution; volumes are those of the full turn."""

    dimension = 2
    identity = np.array([1.0, 0.0, 0.0, 1.0, 1.0])
    displacement_element = ElementQuad2
    pressure_element = ElementQuad1

    def weight(self, basis: Basis) -> FloatArray:
        """(element, point) volume at rest of the quadrature points."""
        return np.asarray(basis.dx * 2.0 * np.pi * basis.global_coordinates()[0])

    def strain_operator(self, basis: Basis) -> FloatArray:
        """(element, point, 5, 18) derivative of F by the element's displacements."""
        radius = basis.global_coordinates()[0]
        operator = np.zeros((*radius.shape, 5, 2 * len(basis.basis)))
        for index, (field,) in enumerate(basis.basis):
            operator[:, :, 0, 2 * index] = field.grad[0]
            operator[:, :, 1, 2 * index] = field.grad[1]
            operator[:, :, 2, 2 * index + 1] = field.grad[0]
            operator[:, :, 3, 2 * index + 1] = field.grad[1]
            operator[:, :, 4, 2 * index] = np.asarray(field) / radius
        return operator

    def volume_ratio(self, gradient: FloatArray) -> FloatArray:
        """(...) J of deformation gradients (..., 5)."""
        rr, rz, zr, zz, around = np.moveaxis(gradient, -1, 0)
        return np.asarray((rr * zz - rz * zr) * around)

    def cofactor(self, gradient: FloatArray) -> FloatArray:
        """(..., 5) derivative of J by F."""
        rr, rz, zr, zz, around = np.moveaxis(gradient, -1, 0)
        return np.stack([zz * around, -zr * around, -rz * around, rr * around, rr * zz - rz * zr], axis=-1)

    def second_derivative(self, gradient: FloatArray) -> list[tuple[int, int, FloatArray]]:
        """Components i < j and the derivative (...) of J by F_i and F_j, where it is not zero."""
        rr, rz, zr, zz, around = np.moveaxis(gradient, -1, 0)
        return [(0, 3, around), (1, 2, -around), (0, 4, zz), (1, 4, -zr), (2, 4, -rz), (3, 4, rr)]


class Spatial:
    """F_xx, F_xy, F_xz, F_yx, ... of a body in space."""

    dimension = 3
    identity = np.eye(3).ravel()
    displacement_element = ElementHex2
    pressure_element = ElementHex1

    def weight(self, basis: Basis) -> FloatArray:
        """(element, point) volume at rest of the quadrature points."""
        return np.asarray(basis.dx)

    def strain_operator(self, basis: Basis) -> FloatArray:
        """(element, point, 9, 81) derivative of F by the element's displacements."""
        operator = np.zeros((*basis.dx.shape, 9, 3 * len(basis.basis)))
        for index, (field,) in enumerate(basis.basis):
            for row, column in product(range(3), repeat=2):
                operator[:, :, 3 * row + column, 3 * index + row] = field.grad[column]
        return operator

    def volume_ratio(self, gradient: FloatArray) -> FloatArray:
        """(...) J of deformation gradients (..., 9)."""
        return np.asarray((gradient[..., :3] * self.cofactor(gradient)[..., :3]).sum(axis=-1))

    def cofactor(self, gradient: FloatArray) -> FloatArray:
        """(..., 9) derivative of J by F."""
        rows = gradient.reshape(*gradient.shape[:-1], 3, 3)
        turned = [np.cross(rows[..., (k + 1) % 3, :], rows[..., (k + 2) % 3, :]) for k in range(3)]
        return np.concatenate(turned, axis=-1)

    def second_derivative(self, gradient: FloatArray) -> list[tuple[int, int, FloatArray]]:
        """Components i < j and the derivative (...) of J by F_i and F_j, where it is not zero."""
        found = []
        for (i, j), (k, m) in product(product(range(3), repeat=2), repeat=2):
            if i < k and j != m:
                sign = 1.0 if ((k - i) % 3 == 1) == ((m - j) % 3 == 1) else -1.0
                found.append((3 * i + j, 3 * k + m, sign * gradient[..., 3 * (3 - i - k) + 3 - j - m]))
        return found


class Solid:
    """One mesh with everything that does not depend on the state."""

    def __init__(self, mesh: Mesh, poisson_ratio: float, kinematics: Kinematics | None = None) -> None:
        self.mesh = mesh
        self.kinematics: Kinematics = kinematics or Axisymmetric()
        self.lam, self.mu = lame(poisson_ratio)
        self.pointwise = POINTWISE_SHARE * self.mu
        self.mixed = self.lam - self.pointwise
        dimension = self.kinematics.dimension
        displacement = Basis(mesh, self.kinematics.displacement_element(), intorder=QUADRATURE)
        pressure = displacement.with_element(self.kinematics.pressure_element())
        self.displacement = displacement
        self.nodes: FloatArray = displacement.doflocs
        self.node_count = int(displacement.N)
        self.displacement_size = dimension * self.node_count
        self.size = self.displacement_size + int(pressure.N)
        self.weight = self.kinematics.weight(displacement)
        self.strain = self.kinematics.strain_operator(displacement)
        values = [np.broadcast_to(np.asarray(one[0]), self.weight.shape) for one in pressure.basis]
        self.pressure_values: FloatArray = np.stack(values, axis=-1)
        nodes = displacement.element_dofs.T[..., None]
        self.u_dofs: IntArray = (dimension * nodes + np.arange(dimension)).reshape(len(nodes), -1)
        self.p_dofs: IntArray = self.displacement_size + pressure.element_dofs.T

    def moved(self, state: FloatArray) -> FloatArray:
        """(node, dimension) displacements."""
        return state[: self.displacement_size].reshape(self.node_count, -1)

    def deformation(self, state: FloatArray) -> FloatArray:
        """(element, point, component) deformation gradient."""
        gradient = np.matmul(self.strain, state[self.u_dofs][:, None, :, None])[..., 0]
        return np.asarray(gradient + self.kinematics.identity)

    def pressure(self, state: FloatArray) -> FloatArray:
        """(element, point) the field p."""
        return np.asarray(np.matmul(self.pressure_values, state[self.p_dofs][:, :, None])[..., 0])

    def volume(self, state: FloatArray) -> float:
        """Deformed volume."""
        return float((self.weight * self.kinematics.volume_ratio(self.deformation(state))).sum())

    def assemble(self, state: FloatArray, with_tangent: bool) -> Assembled:
        """Energy, its gradient and its second derivative.

        Raises
        ------
        InvertedElementError : J <= 0 somewhere
        """
        gradient, pressure = self.deformation(state), self.pressure(state)
        ratio = self.kinematics.volume_ratio(gradient)
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
        gradient : (element, point, component) deformation gradient
        pressure : (element, point) the field p
        """
        ratio, cofactor = self.kinematics.volume_ratio(gradient), self.kinematics.cofactor(gradient)
        stress = self.mu * gradient + self._spherical(ratio, pressure)[..., None] * cofactor
        weighted = (self.weight[..., None] * stress)[..., None]
        dilation = self.weight * (ratio - 1.0 - pressure / self.mixed)
        variation = np.zeros(self.size)
        np.add.at(variation, self.u_dofs, np.matmul(self.strain.swapaxes(2, 3), weighted).sum(axis=1)[..., 0])
        np.add.at(variation, self.p_dofs, (self.pressure_values * dilation[..., None]).sum(axis=1))
        return variation

    def _tangent(self, gradient: FloatArray, pressure: FloatArray) -> csc_matrix:
        """Sparse second derivative of the energy, symmetric and indefinite."""
        ratio, cofactor = self.kinematics.volume_ratio(gradient), self.kinematics.cofactor(gradient)
        spherical = self._spherical(ratio, pressure)
        twice_by_ratio = (self.pointwise + self.mu / ratio**2)[..., None, None]
        stiffness = twice_by_ratio * cofactor[..., :, None] * cofactor[..., None, :]
        components = range(cofactor.shape[-1])
        stiffness[..., components, components] += self.mu
        for i, j, value in self.kinematics.second_derivative(gradient):
            stiffness[..., i, j] += spherical * value
            stiffness[..., j, i] += spherical * value
        weight = self.weight[..., None]
        flat = self.strain.reshape(len(ratio), -1, self.strain.shape[-1])
        loaded = np.matmul(weight[..., None] * stiffness, self.strain).reshape(flat.shape)
        uu = np.matmul(flat.swapaxes(1, 2), loaded)
        dilation = np.matmul(self.strain.swapaxes(2, 3), (weight * cofactor)[..., None])[..., 0]
        up = np.matmul(dilation.swapaxes(1, 2), self.pressure_values)
        pp = np.matmul((weight * self.pressure_values).swapaxes(1, 2), self.pressure_values) / -self.mixed
        local = np.block([[uu, up], [up.swapaxes(1, 2), pp]])
        return scattered(local, np.concatenate([self.u_dofs, self.p_dofs], axis=1), self.size)


def scattered(local: FloatArray, dofs: IntArray, size: int) -> csc_matrix:
    """Sum of element matrices, (element, n, n), at their unknowns, (element, n)."""
    rows, columns = (
        np.broadcast_to(dofs[:, :, None], local.shape),
        np.broadcast_to(dofs[:, None, :], local.shape),
    )
    return csc_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
