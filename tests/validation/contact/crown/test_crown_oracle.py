"""The crowned oracle against itself: a huge crown is flat, small presses follow Hertz, forces balance, meshes agree."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.contact.contact_reference import POISSON_RATIO, contact_edge
from tests.validation.contact.crown import crown_oracle
from tests.validation.contact.crown.crown_oracle import Crown, CrownedPress
from tests.validation.contact.crown.crown_reference import CROWNS, DEPTHS, SERIES, SHARP, Pad, crown_state
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.press_oracle import Press, PressedState, pressed_states

COARSE = Grading(size=0.2, axis_size=0.2, axis_radius=0.0)


def pressed(curvature: float, depth: float = 1 / 3) -> PressedState:
    [state] = pressed_states(CrownedPress(3.0, SHARP.wall, curvature, COARSE, POISSON_RATIO), [depth])
    return state


def test_the_crown_is_a_sphere() -> None:
    crown, radius = Crown(0.2), np.linspace(0.0, 4.0, 9)
    np.testing.assert_allclose(crown.drop(radius), 5.0 - np.sqrt(25.0 - radius**2), atol=1e-14)
    step = 1e-6
    slope = (crown.drop(radius + step) - crown.drop(radius - step)) / (2.0 * step)
    np.testing.assert_allclose(crown.slope(radius), slope, atol=1e-8)


def test_the_untouched_layer_has_the_volume_below_the_sphere() -> None:
    press = CrownedPress(3.0, SHARP.wall, SHARP.curvature, COARSE, POISSON_RATIO)
    sphere, drop = 1.0 / SHARP.curvature, float(press.crown.drop(np.array(SHARP.wall)))
    cap = np.pi * drop**2 * (sphere - drop / 3.0)
    below = np.pi * SHARP.wall**2 * (3.0 - drop)
    # three Gauss points an axis of a smooth chart on elements of at most 0.4
    assert press.rest_volume == pytest.approx(below + cap, rel=1e-6)


@pytest.mark.slow
def test_without_a_crown_it_is_the_flat_oracle(monkeypatch: pytest.MonkeyPatch) -> None:
    [flat] = pressed_states(Press(3.0, SHARP.wall, COARSE, POISSON_RATIO), [1 / 3])
    monkeypatch.setattr(crown_oracle, "_cut", lambda ticks, _: ticks)
    same = pressed(0.0)
    assert same.force == pytest.approx(flat.force, abs=1e-10)
    np.testing.assert_allclose(same.curve, flat.curve, atol=1e-10)


@pytest.mark.slow
def test_a_crown_of_ten_metres_presses_like_a_flat_layer_and_the_change_is_linear() -> None:
    flat, huge, twice = (pressed(curvature, 0.1) for curvature in (0.0, 3e-4, 6e-4))
    change = huge.force / flat.force - 1.0
    # Hertz: the root of the effective radius, -κ/2 = -1.5e-4; the finite layer changes that (1.4e-4 to 2.5e-4 by depth)
    assert -4e-4 < change < -1e-4
    assert twice.force / flat.force - 1.0 == pytest.approx(2.0 * change, rel=0.01)
    # the untouched top itself lies 0.002 lower at the wall
    moved = Crown(3e-4).drop(flat.curve[:, 0])
    np.testing.assert_allclose(huge.curve[:, 1] + moved, flat.curve[:, 1], atol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("curvature", [0.1, 0.2])
def test_small_presses_follow_hertz_with_the_relative_curvature(curvature: float) -> None:
    depth, wall = 0.004, 0.9 / curvature
    grading = Grading(
        size=0.0125,
        axis_size=0.0125,
        axis_radius=0.0,
        fine_radius=0.12,
        fine_depth=0.1,
        growth=1.4,
        largest_radial=2.0,
        largest_axial=10.0,
    )
    press = CrownedPress(40.0, wall, curvature, grading, POISSON_RATIO)
    [state] = pressed_states(press, [depth])
    hertz = 4 / 3 / (1 - POISSON_RATIO**2) * depth**1.5 / np.sqrt(1.0 + curvature)
    # walls at 75 and 150 contact radii: up to 1.3 % by Dimitriadis' leading term; five elements across the contact
    assert state.force == pytest.approx(hertz, rel=0.015)
    edge = contact_edge(state.curve, depth, 0.05)[0]
    assert edge == pytest.approx(np.sqrt(depth / (1.0 + curvature)), rel=0.02)


@pytest.mark.slow
def test_contact_force_balances_the_bonded_faces_and_is_the_slope_of_the_energy() -> None:
    press = CrownedPress(3.0, SHARP.wall, SHARP.curvature, COARSE, POISSON_RATIO)
    before, here, after = pressed_states(press, [0.33, 1 / 3, 2 / 3 - 0.33])
    assert here.force == pytest.approx(-here.reaction, abs=1e-7)
    slope = (after.energy - before.energy) / (after.depth - before.depth)
    # as for the flat oracle: central difference 1e-4, contact energy 1e-4
    assert slope == pytest.approx(here.force, rel=5e-4)
    pressure, area = here.contact[:, 2], here.contact[:, 3]
    normal = (1.0 - here.depth - here.contact[:, 1])[pressure > 0.0]
    # pressure times deformed area along the sphere's normal; penetrations of 1e-4 turn the normal a little
    assert (pressure * area)[pressure > 0.0] @ normal == pytest.approx(here.force, rel=1e-3)


@pytest.mark.parametrize("pad", CROWNS, ids=lambda pad: f"{pad.curvature:.3f}")
def test_elements_of_half_the_size_change_the_stored_forces_by_less_than_a_thousandth(pad: Pad) -> None:
    for depth in DEPTHS:
        state = crown_state(pad, depth)
        assert state.force == pytest.approx(state.half.force, rel=1e-3)


def test_a_sharper_crown_is_pressed_more_lightly() -> None:
    for depth in DEPTHS:
        force = [crown_state(pad, depth).force for pad in SERIES]
        assert np.all(np.diff(force) < 0.0)


def test_a_pad_that_was_not_solved_is_named() -> None:
    with pytest.raises(KeyError, match="no stored solution"):
        crown_state(Pad(0.123, 4.0), DEPTHS[0])


@pytest.mark.full
def test_the_stored_sharp_crown_is_found_again_on_a_coarser_mesh() -> None:
    [state] = pressed_states(CrownedPress(3.0, SHARP.wall, SHARP.curvature, Grading(), POISSON_RATIO), [1.0])
    assert state.force == pytest.approx(crown_state(SHARP, 1.0).force, rel=2e-3)
