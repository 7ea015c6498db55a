"""The oracle's own tips: distance, normal and curvature agree with each other and with the shapes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.elements.tip_outlines import Tip, cone_tip, flat_tip, sphere_tip

TIPS = [sphere_tip(), flat_tip(0.2), cone_tip(45.0, 0.15, 0.2)]


def points_outside(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points around the lower end of a tip pressed 0.8 deep, at distances of up to one radius."""
    generator = np.random.default_rng(7)
    r, z = generator.uniform(0.0, 1.8, 40 * count), generator.uniform(-1.6, 0.6, 40 * count)
    return r, z


@pytest.mark.parametrize("tip", TIPS, ids=lambda tip: tip.name)
def test_normals_and_curvatures_are_derivatives_of_the_distance(tip: Tip) -> None:
    r, z = points_outside(20)
    gap = tip.gap(r, z, 0.8)
    chosen = gap.distance > 0.02
    r, z = r[chosen], z[chosen]
    gap, step = tip.gap(r, z, 0.8), 1e-5
    by_r, by_z = (
        (
            tip.gap(r + step * a, z + step * b, 0.8).distance
            - tip.gap(r - step * a, z - step * b, 0.8).distance
        )
        / (2 * step)
        for a, b in ((1, 0), (0, 1))
    )
    # central differences: step² / distance² = 2.5e-7; points within a step of a joint are not C2
    assert gap.normal == pytest.approx(np.stack([by_r, by_z]), abs=1e-5)
    along = np.stack([-gap.normal[1], gap.normal[0]])
    step = 1e-4
    around = [tip.gap(r + s * step * along[0], z + s * step * along[1], 0.8).distance for s in (1, 0, -1)]
    second = (around[0] - 2 * around[1] + around[2]) / step**2
    smooth = np.abs(second - gap.curvature) < 1e-3 * (1.0 + 1.0 / gap.distance)
    assert smooth.mean() > 0.99


def test_a_sphere_is_a_sphere_below_its_center_and_a_cylinder_above() -> None:
    gap = sphere_tip().gap(np.array([0.0, 0.6, 2.0, 0.9]), np.array([-1.5, -0.8, 1.0, 3.0]), 1.0)
    assert gap.distance == pytest.approx([0.5, 0.0, 1.0, -0.1], abs=1e-12)


@pytest.mark.parametrize("tip", TIPS, ids=lambda tip: tip.name)
def test_every_tip_touches_the_surface_at_its_apex_and_ends_in_a_shank_of_radius_one(tip: Tip) -> None:
    gap = tip.gap(np.array([0.0, 1.3]), np.array([-0.25, 5.0]), 0.0)
    assert gap.distance == pytest.approx([0.25, 0.3], abs=1e-12)


def test_outlines_have_no_gaps_between_their_pieces() -> None:
    # the flank of the 45 degree cone: its tangent continues the apex arc, so a point on the flank has distance 0
    tip = cone_tip(45.0, 0.15, 0.2)
    flank = tip.pieces[1]
    middle = 0.5 * np.add(flank.start, flank.end)
    assert tip.gap(middle[:1], middle[1:], 0.0).distance == pytest.approx([0.0], abs=1e-12)
    assert np.arctan2(flank.end[0] - flank.start[0], flank.end[1] - flank.start[1]) == pytest.approx(
        np.pi / 4
    )
