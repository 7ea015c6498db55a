"""The denser curve is the press that it stands for."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.optics.surface.curves import TAIL_MM
from tests.bench.measures.benchmark_states import surface_of
from tests.sims.optics.surface.analytic import compact_dimple
from tests.validation.contact.dense_curve import dense_press


@pytest.mark.parametrize("depth_mm", [0.5, 2.0, 5.0])
def test_every_knot_stays_and_the_curve_leaves_it_with_its_inclination(depth_mm: float) -> None:
    """A chord to the next point, an eighth of a piece on, turns by less than the piece does."""
    press = surface_of("contact")(depth_mm)
    dense = dense_press(press)
    assert press.inclination_deg is not None
    knots = np.column_stack([press.radius_mm, press.height_mm])
    points = np.column_stack([dense.radius_mm, dense.height_mm])
    distance = np.hypot(*(knots[:, None] - points[None]).transpose(2, 0, 1)).min(axis=1)
    assert distance.max() < 1e-12
    last = np.flatnonzero(np.hypot(*(points - knots[-2]).T) < 1e-12)[0]
    rise, run = np.diff(dense.height_mm)[last], np.diff(dense.radius_mm)[last]
    assert np.rad2deg(np.arctan2(rise, run)) == pytest.approx(press.inclination_deg[-2], abs=0.1)


def test_the_tail_ends_flat_at_the_undisturbed_surface() -> None:
    press = surface_of("contact")(3.0)
    dense = dense_press(press)
    assert dense.radius_mm[-1] == pytest.approx(press.radius_mm[-1] + TAIL_MM)
    assert dense.height_mm[-1] == 0.0
    assert np.diff(dense.height_mm)[-1] == pytest.approx(0.0, abs=1e-4)


def test_a_press_of_points_only_stays_as_it_is() -> None:
    press = compact_dimple(2.0)
    assert dense_press(press) is press
