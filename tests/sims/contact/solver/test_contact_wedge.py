"""The wedge and its self-checks: a state that cannot be believed is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.sims.contact.mesh import radial_mesh
from optopad.sims.contact.scope import ContactSolveError
from optopad.sims.contact.wedge import (
    WEDGE_ANGLE,
    WINDOW,
    History,
    PressState,
    check_press,
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
