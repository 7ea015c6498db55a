"""The curve made of surface nodes, against Hertz' closed form."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.contact.library.smooth_press import (
    contact_coordinate,
    contact_tolerance,
    hertz_gap,
    surface_curve,
)
from optopad.sims.contact.tip import outside_tip, tip_coordinate, tip_gap, tip_outline


def hertz_surface(radius: np.ndarray, depth: float) -> np.ndarray:
    """Height of a half-space under a unit sphere; the sphere instead of its parabola inside [tip radii]."""
    edge = np.sqrt(depth)
    outside = np.maximum(radius / edge, 1.0)
    parabola = radius**2 / 2 - depth
    return np.where(
        radius < edge,
        1 - depth - np.sqrt(1 - np.minimum(radius, 0.9) ** 2),
        parabola - depth * hertz_gap(outside),
    )


def test_hertz_gap_is_zero_at_the_edge_and_grows_with_the_power_three_halves() -> None:
    assert hertz_gap(np.array(1.0)) == pytest.approx(0.0, abs=1e-15)
    near, nearer = hertz_gap(np.array([1.02, 1.005]))
    # next term of the expansion is of relative order x - 1
    assert np.log(near / nearer) / np.log(4.0) == pytest.approx(1.5, abs=0.02)


def test_tip_coordinate_inverts_the_outline_on_sphere_and_shank() -> None:
    along = np.linspace(0.0, 2.5, 26)
    radius, height = tip_outline(along, 1.2)
    np.testing.assert_allclose(tip_coordinate(radius, height, 1.2), along, atol=1e-12)
    np.testing.assert_allclose(tip_gap(radius, height, 1.2), 0.0, atol=1e-12)


def test_points_inside_the_tip_are_moved_onto_it_and_others_stay() -> None:
    radius, height = outside_tip(np.array([0.1, 0.9, 2.0]), np.array([-0.2, 0.6, -0.1]), 0.5)
    assert tip_gap(radius[:2], height[:2], 0.5) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert (radius[2], height[2]) == (2.0, -0.1)


@pytest.mark.parametrize("spacing", [0.05, 0.1, 0.15])
@pytest.mark.parametrize("depth", [0.02, 0.05, 0.1])
def test_contact_radius_of_hertz_is_found_within_a_fifth_of_the_node_spacing(
    depth: float, spacing: float
) -> None:
    radius = np.append(np.arange(0.0, 3.0, spacing), 16 / 3)
    height = hertz_surface(radius, depth)
    height[-1] = 0.0
    tolerance = contact_tolerance(spacing, 0.1)
    edge, _ = contact_coordinate(radius, height, depth, tolerance)
    # the nodes follow Hertz' parabola, the tip is round: that and the chord s for r - a cost a little
    assert np.sin(edge) == pytest.approx(np.sqrt(depth), abs=0.2 * spacing)


def test_curve_starts_at_the_apex_ends_at_the_wall_and_stays_out_of_the_tip() -> None:
    radius = np.append(np.arange(0.0, 3.0, 0.1), 16 / 3)
    height = hertz_surface(radius, 0.1)
    height[-1] = 0.0
    curve = surface_curve(radius, height, 0.1, spacing=0.1, tolerance=contact_tolerance(0.1, 0.1))
    along_r, along_z, contact = curve.radius, curve.height, curve.contact_radius
    assert (along_r[0], along_z[0]) == (0.0, pytest.approx(-0.1))
    assert along_r[-1] == pytest.approx(16 / 3)
    assert along_z[-1] == pytest.approx(0.0, abs=1e-12)
    assert tip_gap(along_r, along_z, 0.1).min() > -1e-12
    inside = along_r <= contact + 1e-12
    np.testing.assert_allclose(tip_gap(along_r[inside], along_z[inside], 0.1), 0.0, atol=1e-12)


def test_inclination_is_the_slope_of_the_curve_and_continuous_at_the_edge() -> None:
    radius = np.append(np.arange(0.0, 3.0, 0.1), 16 / 3)
    height = hertz_surface(radius, 0.1)
    height[-1] = 0.0
    curve = surface_curve(radius, height, 0.1, spacing=0.1, tolerance=contact_tolerance(0.1, 0.1))
    contact_edge = curve.contact_radius
    inside = curve.radius <= contact_edge + 1e-12
    np.testing.assert_allclose(np.sin(curve.inclination[inside]), curve.radius[inside], atol=1e-12)
    chords = np.arctan2(np.diff(curve.height), np.diff(curve.radius))
    middles = 0.5 * (curve.inclination[1:] + curve.inclination[:-1])
    # the chord of a curve of curvature k and length s turns from its ends by k s / 2 each: third order is left
    assert np.abs(chords - middles)[curve.radius[1:] < 1.5].max() < 2e-3
    # beyond the edge Hertz' surface turns back with a vertical tangent of its slope (power 1/2): a spline through
    # nodes 0.1 apart rounds that off, but its first point is no further from the edge's angle than Hertz' next node
    edge = int(np.flatnonzero(inside)[-1])
    node = float(np.arange(0.0, 3.0, 0.1)[np.arange(0.0, 3.0, 0.1) > contact_edge][0])
    slope = (hertz_surface(np.array([node + 1e-4]), 0.1) - hertz_surface(np.array([node]), 0.1))[0] / 1e-4
    assert np.arctan(slope) < curve.inclination[edge + 1] < curve.inclination[edge]
