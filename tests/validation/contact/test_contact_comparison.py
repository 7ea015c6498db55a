"""The measures of the contact table, on curves whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.press import Indentation
from tests.validation.contact.contact_comparison import curve_errors, free_surface, press_error
from tests.validation.contact.contact_reference import ReferenceState, reference_state
from tests.validation.elements.tip_outlines import sphere_tip

RADIUS_MM = 3.0
MODULUS_MPA = 0.8
STATES = [(2.0, 4 / 3), (3.0, 0.2 / 3), (3.0, 1.0), (16 / 3, 5 / 3)]


def as_press(state: ReferenceState, *, lift: float = 0.0, more_force: float = 1.0) -> Indentation:
    """The oracle's own curve as if a model had made it."""
    r, z = state.curve(32)
    return Indentation(
        depth_mm=state.depth * RADIUS_MM,
        tip_radius_mm=RADIUS_MM,
        radius_mm=r * RADIUS_MM,
        height_mm=(z + lift) * RADIUS_MM,
        contact_radius_mm=state.contact_radius * RADIUS_MM,
        force_n=more_force * state.force * MODULUS_MPA * RADIUS_MM**2,
    )


@pytest.mark.parametrize(("layer", "depth"), STATES)
def test_the_oracle_has_no_error_against_itself(layer: float, depth: float) -> None:
    state = reference_state(layer, depth)
    error = press_error(as_press(state), state, MODULUS_MPA)
    assert error.force_ratio == pytest.approx(1.0, abs=1e-12)
    # quadratic edges meet at small angles that the comparing spline rounds off: below 0.1 um and 0.05 degrees
    assert error.surface_largest_um < 0.5
    assert error.wall_rms_um < 0.1
    assert error.slope_rms_deg < 0.05


def test_a_lifted_surface_is_off_by_the_lift_along_the_normal() -> None:
    state = reference_state(3.0, 2 / 3)
    lift = 0.002
    surface = free_surface(state)
    r, z = state.curve(32)
    distance, angle = curve_errors(surface, r, z + lift)
    # |lift * normal_z|: the tangent's radial part; curvature changes it by lift times curvature (below 1 %)
    assert distance == pytest.approx(lift * surface.tangents[:, 0], rel=0.02)
    far = surface.points[:, 0] > 2.0
    assert angle[far].max() < 0.05


def test_a_tilted_surface_is_off_by_the_tilt() -> None:
    state = reference_state(3.0, 2 / 3)
    surface = free_surface(state)
    r, z = state.curve(32)
    tilt = np.radians(0.4)
    turned_r, turned_z = r * np.cos(tilt) - z * np.sin(tilt), r * np.sin(tilt) + z * np.cos(tilt)
    _, angle = curve_errors(surface, turned_r, turned_z)
    inner = (surface.points[:, 0] > 1.2) & (surface.points[:, 0] < 3.0)
    # the foot lies up to 0.02 radii along the curve from the turned point; times curvature below 0.3: 0.3 degrees
    assert angle[inner] == pytest.approx(0.4, abs=0.35)
    assert angle[inner].mean() == pytest.approx(0.4, abs=0.05)


def test_force_is_compared_at_the_modulus_of_the_model() -> None:
    state = reference_state(3.0, 1 / 3)
    error = press_error(as_press(state, more_force=1.02), state, MODULUS_MPA)
    assert error.force_ratio == pytest.approx(1.02, abs=1e-12)


@pytest.mark.parametrize(("layer", "depth"), STATES)
def test_the_compared_surface_starts_at_the_contact_edge_and_ends_at_the_wall(
    layer: float, depth: float
) -> None:
    state = reference_state(layer, depth)
    surface = free_surface(state)
    gap = sphere_tip().gap(surface.points[:, 0], surface.points[:, 1], depth).distance
    assert gap.min() > -1e-4
    assert surface.from_edge[0] < 0.06
    assert surface.points[-1, 0] == pytest.approx(16 / 3, abs=0.1)
    # arc length from the edge to the wall, summed in two ways
    assert surface.share.sum() == pytest.approx(surface.from_edge[-1], abs=0.1)
