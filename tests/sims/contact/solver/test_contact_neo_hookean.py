"""The second opinion: elastic forces from plain arrays."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from optopad.sims.contact.mesh import lame_parameters, nodal_forces, radial_mesh, volumes
from optopad.sims.contact.wedge import compile_wedge, quiet_mujoco, sweep

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
TETRAHEDRA = np.array([[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]])


def test_six_tetrahedra_fill_the_unit_cube() -> None:
    signed = volumes(CUBE, TETRAHEDRA)
    assert signed.sum() == pytest.approx(1.0)
    assert signed.min() > 0.0


def test_forces_and_moments_of_a_free_body_vanish() -> None:
    deformed = CUBE + np.random.default_rng(1).normal(scale=0.05, size=CUBE.shape)
    forces = nodal_forces(CUBE, deformed, TETRAHEDRA, 2.0, 0.4)
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(deformed, forces).sum(axis=0), 0.0, atol=1e-12)


def test_small_uniaxial_strain_gives_the_constrained_modulus_of_linear_elasticity() -> None:
    strain, modulus, poisson = 1e-6, 3.0, 0.3
    first, shear = lame_parameters(modulus, poisson)
    forces = nodal_forces(CUBE, CUBE * [1.0, 1.0, 1.0 + strain], TETRAHEDRA, modulus, poisson)
    top = CUBE[:, 2] > 0.5
    # error: quadratic in strain
    assert -forces[top, 2].sum() == pytest.approx((first + 2.0 * shear) * strain, rel=1e-5)


def test_rotation_makes_no_force() -> None:
    angle = 0.7
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    forces = nodal_forces(CUBE, CUBE @ rotation.T, TETRAHEDRA, 1.0, 0.49)
    np.testing.assert_allclose(forces, 0.0, atol=1e-13)


def test_forces_are_those_of_mujoco_for_a_large_random_deformation() -> None:
    mesh = radial_mesh(2.0, 16 / 3, 0.5)
    wedge = sweep(mesh)
    model = compile_wedge(mesh, wedge, 0.49)
    model.jnt_stiffness[:] = 0.0
    model.tendon_stiffness[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[:] = np.random.default_rng(0).normal(scale=0.02, size=model.nq)
    with quiet_mujoco():
        mujoco.mj_forward(model, data)
    ours = nodal_forces(wedge.points, np.array(data.flexvert_xpos), wedge.elements, 1.0, 0.49)
    free = np.flatnonzero(model.flex_vertbodyid > 0)
    first_dof = model.jnt_dofadr[model.body_jntadr[model.flex_vertbodyid[free]]]
    theirs = data.qfrc_passive[first_dof[:, None] + np.arange(3)]
    # same formula, other order of operations: round-off only
    np.testing.assert_allclose(ours[free], theirs, atol=1e-12 * np.abs(theirs).max())
