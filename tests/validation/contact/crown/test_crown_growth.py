"""What flat presses say of crowned ones: exact at first touch, apart when deep; curvature is interpolated well."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.contact.crown.crown_growth import (
    FLAT,
    POLYNOMIALS,
    between,
    error,
    same_tip,
    smaller_tip,
    weights,
)
from tests.validation.contact.crown.crown_reference import DEPTHS, SERIES, SHARP, crown_state


def test_weights_reproduce_polynomials() -> None:
    share = weights(POLYNOMIALS["parabola"], 0.17)
    np.testing.assert_allclose(share @ np.array(POLYNOMIALS["parabola"]) ** 2, 0.17**2)
    np.testing.assert_allclose(weights(POLYNOMIALS["linear"], 0.25), [0.0, 1.0], atol=1e-15)


def test_a_guess_of_the_pad_itself_has_no_error() -> None:
    found = error(same_tip(FLAT, 1 / 3), FLAT, 1 / 3)
    assert found.force_ratio == pytest.approx(1.0)
    assert found.surface_rms_um < 0.1
    through = error(between(POLYNOMIALS["linear"])(SERIES[-1], 1 / 3), SERIES[-1], 1 / 3)
    assert through.force_ratio == pytest.approx(1.0)
    assert through.surface_rms_um < 0.1
    assert through.contact_radius_mm == pytest.approx(crown_state(SERIES[-1], 1 / 3).contact_radius * 3.0)


def test_the_smaller_tip_is_better_than_the_same_one_in_shallow_presses() -> None:
    for pad in SERIES[1:]:
        same, smaller = (error(guess(pad, DEPTHS[0]), pad, DEPTHS[0]) for guess in (same_tip, smaller_tip))
        assert abs(smaller.force_ratio - 1.0) < 0.5 * abs(same.force_ratio - 1.0)


def test_a_parabola_in_the_curvature_is_better_than_the_solver_is_known() -> None:
    for depth in DEPTHS:
        found = error(between(POLYNOMIALS["parabola"])(SHARP, depth), SHARP, depth)
        assert abs(found.force_ratio - 1.0) < 0.005
        assert found.surface_rms_um < 10.0
