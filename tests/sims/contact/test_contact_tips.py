"""Presses of other tips than a hemisphere, through the same solver.

All on a coarse mesh (0.15 tip radii), whose facets stand off a round tip and so make it blunter: against
the linear theory of a bonded layer a hemisphere of this mesh is too stiff as well.
"""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.spec import Indenter
from optopad.sims.contact.mesh import radial_mesh
from optopad.sims.contact.tip import HEMISPHERE, TipOutline, tip_of
from optopad.sims.contact.wedge import WedgeSolution, solve_wedge

SPACING = 0.15
POISSON_RATIO = 0.49
DEPTHS = (0.02 / 3, 0.05 / 3, 0.1 / 3, 0.2 / 3, 0.1, 0.4 / 3)
WAVY = ((0.0, 0.0), (0.6, 0.02), (1.2, 0.5), (1.8, 0.55), (2.4, 1.2), (3.0, 1.3))

pytestmark = pytest.mark.full


def pressed(tip: TipOutline, depths: tuple[float, ...] = DEPTHS) -> WedgeSolution:
    mesh = radial_mesh(8.0 / 3.0, 16.0 / 3.0, SPACING)
    return solve_wedge(mesh, depths, POISSON_RATIO, tip=tip)


def polygon(count: int) -> Indenter:
    """A hemisphere of 3 mm as a profile of points."""
    angle = np.linspace(0.0, 0.5 * np.pi, count + 1)[1:-1]
    points = [(float(3.0 * np.sin(a)), float(3.0 - 3.0 * np.cos(a))) for a in angle]
    return Indenter(shape="profile", profile_mm=((0.0, 0.0), *points, (3.0, 3.0)))


def test_a_sphere_given_as_points_presses_like_the_hemisphere() -> None:
    ball, points = pressed(HEMISPHERE), pressed(tip_of(polygon(200)))
    # the points' chords lie up to 8e-6 inside the sphere, and contact may chatter by 5e-4 (`settling`)
    np.testing.assert_allclose(points.force[2:], ball.force[2:], rtol=0.005)
    np.testing.assert_allclose(points.heights, ball.heights, atol=1e-3)


@pytest.mark.parametrize(
    "tip",
    [
        Indenter(shape="flat_punch"),
        Indenter(shape="cone"),
        Indenter(shape="profile", profile_mm=WAVY),
    ],
    ids=["punch", "cone", "wavy"],
)
def test_every_state_of_another_tip_passes_the_checks_with_room(tip: Indenter) -> None:
    solution = pressed(tip_of(tip))
    assert np.all(np.diff(solution.force) > 0.0)
    for check in solution.checks:
        assert check.penetration < 0.01
        assert check.reaction == pytest.approx(check.force, rel=0.01)
