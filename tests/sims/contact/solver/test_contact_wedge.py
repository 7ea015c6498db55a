"""The wedge and its self-checks: a state that cannot be believed is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from optopad.sims.contact.mesh import (
    FINE_RADIUS,
    GROWTH,
    graded_spacing,
    lame_parameters,
    nodal_forces,
    radial_mesh,
    volumes,
)
from optopad.sims.contact.scope import ContactSolveError
from optopad.sims.contact.wedge import (
    WEDGE_ANGLE,
    WINDOW,
    History,
    PressState,
    check_press,
    compile_wedge,
    quiet_mujoco,
    settled_limit,
    solve_wedge,
    sweep,
)

MESH = radial_mesh(2.0, 16 / 3, 0.25)


def rest_state() -> PressState:
    wedge = sweep(MESH)
    return PressState(
        depth=0.0,
        rest=wedge.points,
        deformed=wedge.points.copy(),
        elements=wedge.elements,
        is_bonded=MESH.is_bonded[wedge.node],
        poisson_ratio=0.49,
        copies=60.0,
        contact_force=0.0,
        overlap=0.0,
        last_step=0.0,
        chatter=0.0,
        steps=4,
    )


def test_wedge_has_the_volume_of_its_share_of_the_cylinder() -> None:
    wedge = sweep(MESH)
    edges = wedge.points[wedge.elements[:, 1:]] - wedge.points[wedge.elements[:, :1]]
    volumes = np.linalg.det(edges) / 6.0
    assert volumes.min() > 0.0
    # chords instead of arcs: sin(angle) instead of angle
    assert volumes.sum() == pytest.approx(0.5 * np.sin(WEDGE_ANGLE) * (16 / 3) ** 2 * 2.0, rel=1e-12)


def test_rest_state_passes_its_checks() -> None:
    check = check_press(rest_state())
    assert check.force == 0.0
    assert check.volume_loss == pytest.approx(0.0, abs=1e-12)
    assert check.energy == pytest.approx(0.0, abs=1e-12)


def test_unsettled_state_is_refused() -> None:
    with pytest.raises(ContactSolveError, match="not settled"):
        check_press(replace(rest_state(), last_step=2e-4))


def test_wide_chatter_is_refused() -> None:
    with pytest.raises(ContactSolveError, match="chatter of"):
        check_press(replace(rest_state(), chatter=3e-3))


@pytest.mark.parametrize(
    ("drift", "amplitude", "accepted"), [(0.0, 5e-4, True), (0.0, 3e-3, False), (1e-5, 5e-4, False)]
)
def test_only_a_narrow_cycle_about_a_fixed_point_counts_as_rest(
    drift: float, amplitude: float, accepted: bool
) -> None:
    history = History()
    for step in range(2 * WINDOW):
        assert history.cycle() is None
        history.add(np.array([0.1, 0.2 + drift * step + amplitude * (-1.0) ** step]), 3.0 + (-1.0) ** step)
    cycle = history.cycle()
    assert (cycle is not None) is accepted
    if cycle is not None:
        np.testing.assert_allclose(cycle.mean, [0.1, 0.2], atol=1e-15)
        assert cycle.spread == pytest.approx(amplitude)
        assert cycle.force == pytest.approx(3.0)


def test_shallow_states_must_settle_in_proportion_to_their_depth() -> None:
    assert settled_limit(0.01) == pytest.approx(2e-6)
    assert settled_limit(0.1) == pytest.approx(4e-5)
    assert settled_limit(1.0) == 1e-4


@pytest.mark.parametrize("depth", [0.01, 0.1, 1.0])
def test_a_depth_out_of_an_array_settles_at_the_limit_of_the_plain_number(depth: float) -> None:
    assert settled_limit(np.array([depth])[0]) == settled_limit(depth)


def test_sunken_surface_is_refused() -> None:
    with pytest.raises(ContactSolveError, match=r"0\.030"):
        check_press(replace(rest_state(), overlap=0.03))


def test_a_layer_that_the_solver_missed_is_refused() -> None:
    with pytest.raises(ContactSolveError, match=r"0\.500"):
        check_press(replace(rest_state(), depth=0.5))


def test_force_without_reaction_is_refused() -> None:
    with pytest.raises(ContactSolveError, match="against reaction"):
        check_press(replace(rest_state(), contact_force=0.01))


def test_inverted_element_is_refused() -> None:
    state = rest_state()
    deformed = state.deformed.copy()
    inner = np.flatnonzero((np.abs(deformed[:, 2] + 0.5) < 0.2) & (deformed[:, 0] > 0.4))[0]
    deformed[inner, 2] += 1.0
    with pytest.raises(ContactSolveError, match="inverted element"):
        check_press(replace(state, deformed=deformed))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_positions_that_are_no_numbers_are_refused(value: float) -> None:
    state = rest_state()
    deformed = state.deformed.copy()
    deformed[3, 1] = value
    with pytest.raises(ContactSolveError, match="not finite"):
        check_press(replace(state, deformed=deformed))


def test_a_depth_step_far_too_large_raises_instead_of_returning_a_surface() -> None:
    with pytest.raises(ContactSolveError):
        solve_wedge(MESH, [1.5], 0.49)


def test_solving_twice_gives_the_same_bits_and_writes_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second time from an array, as callers that space their depths evenly have them."""
    monkeypatch.chdir(tmp_path)
    first, second = (solve_wedge(MESH, depths, 0.49) for depths in ([0.01, 0.03], np.array([0.01, 0.03])))
    np.testing.assert_array_equal(first.heights, second.heights)
    np.testing.assert_array_equal(first.force, second.force)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_far_top_moves_up_and_the_bonded_end_stays() -> None:
    solution = solve_wedge(MESH, [0.01, 0.03, 0.06], 0.49)
    assert solution.heights[-1, -1] == 0.0
    assert solution.radii[-1, -1] == pytest.approx(16 / 3, rel=1e-12)
    assert solution.heights[-1].max() > 0.0
    # facets touch the round tip in their middle: the vertex on the axis lies a sagitta deeper
    sagitta = 0.25**2 / 8
    assert -0.06 - 1.5 * sagitta < solution.heights[-1, 0] < -0.06


def signed_areas(mesh_nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (mesh_nodes[triangles[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


@pytest.mark.parametrize(("layer", "spacing"), [(1.3, 0.2), (3.0, 0.1), (6.0, 0.15)])
def test_triangles_fill_the_layer_without_overlap(layer: float, spacing: float) -> None:
    mesh = radial_mesh(layer, 16 / 3, spacing)
    areas = signed_areas(mesh.nodes, mesh.triangles)
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(layer * 16 / 3, rel=1e-12)


def test_every_node_belongs_to_a_triangle_and_none_is_doubled() -> None:
    mesh = radial_mesh(3.0, 16 / 3, 0.15)
    assert np.unique(mesh.triangles).size == len(mesh.nodes)
    assert len(np.unique(np.round(mesh.nodes, 9), axis=0)) == len(mesh.nodes)


def test_top_runs_from_the_axis_to_the_bonded_wall_at_height_zero() -> None:
    mesh = radial_mesh(3.0, 16 / 3, 0.15)
    radius, height = mesh.nodes[mesh.top].T
    assert radius[0] == 0.0
    assert radius[-1] == pytest.approx(16 / 3)
    assert np.all(np.diff(radius) > 0)
    np.testing.assert_allclose(height, 0.0, atol=1e-12)
    assert mesh.is_bonded[mesh.top].tolist() == [False] * (len(mesh.top) - 1) + [True]


def test_spacing_is_even_under_the_tip_and_grows_by_a_fixed_ratio_outside() -> None:
    steps = np.diff(graded_spacing(16 / 3, FINE_RADIUS, 0.1, 2 / 3))
    fine = round(FINE_RADIUS / 0.1)
    np.testing.assert_allclose(steps[:fine], FINE_RADIUS / fine, rtol=1e-12)
    growing = steps[fine:]
    ratios = growing[1:] / growing[:-1]
    assert ratios.max() <= GROWTH + 1e-9
    assert ratios.min() >= 1.0 - 1e-9


def test_bottom_and_wall_are_bonded_and_nothing_else() -> None:
    mesh = radial_mesh(3.0, 16 / 3, 0.2)
    radius, height = mesh.nodes.T
    np.testing.assert_array_equal(mesh.is_bonded, (height < -3.0 + 1e-9) | (radius > 16 / 3 - 1e-9))


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
