"""The wide layer under the published tips: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.held.published import TIPS, WidePress, floor_share, footprint


def test_a_round_tip_on_a_thick_layer_presses_like_hertz() -> None:
    """The layer is 20 radii thick; the grid resolves the contact's radius of 0.22 mm by eleven nodes."""
    press = WidePress(10.0, (0.5, 0.5), 0.02)
    force = press.pressure(TIPS["cylinder d1"].bottoms(press.x, press.y), 0.1).sum() * 0.02**2
    # a sphere, not the parabola of Hertz: 3 % at this depth
    assert force == pytest.approx(16.0 / 9.0 * np.sqrt(0.5 * 0.1**3), rel=0.05)


def test_the_floor_bears_the_whole_force_and_smooths_it() -> None:
    shares = floor_share(np.array([0.0, 0.1, 0.5, 1.0, 3.0]), 8.5)
    assert shares[0] == 1.0
    assert (np.diff(shares) < 0.0).all()
    k = 3.0 * 8.5
    assert shares[-1] == pytest.approx(2.0 * (1.0 + k) * np.exp(-k), rel=1e-6)  # twice a half-space's


def test_a_footprint_spreads_with_the_thickness() -> None:
    thin, thick = (footprint(0.0, 1.0, thickness) for thickness in (5.0, 8.5))
    assert thin[0] == thick[0] == 1.0
    assert (np.diff(thin) < 0.0).all()
    assert (thin[1:] < thick[1:]).all()
