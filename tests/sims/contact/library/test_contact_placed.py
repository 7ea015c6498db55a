"""Presses at a place: beyond the deepest solved one, fading, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.library.solved_press import FAR, LARGEST_CHANGE, PlacedPress

PAD = (32 / 3, 32 / 3)


def placed(at: tuple[float, float], size: tuple[float, float] = PAD, layer: float = 3.0) -> PlacedPress:
    return PlacedPress(smooth=shipped_library().press(layer, 6.018022225), size=size, at=at)


@pytest.mark.parametrize(
    "layer", [pytest.param(1.3, marks=pytest.mark.full), 3.0, pytest.param(6.0, marks=pytest.mark.slow)]
)
def test_force_and_surface_go_on_smoothly_beyond_the_deepest_solved_press(layer: float) -> None:
    press = placed((2.0, 2.5), layer=layer)
    deepest = press.smooth.deepest
    depths = np.linspace(deepest - 0.25, deepest, 26)
    inner = np.array([press.round_depth(float(depth)) for depth in depths])
    assert inner[-1] > deepest > inner[0]
    force = np.array([press.force_at(float(depth)) for depth in depths])
    # second differences of a smooth curve: no step where the extrapolation begins
    assert np.abs(np.diff(force, 2)).max() < 0.02 * np.diff(force).max() + 1e-3 * force[-1]
    x = np.linspace(1.5, 3.4, 20)
    tops = np.array([np.interp(x, *outline(press, float(depth))) for depth in depths])
    assert np.abs(np.diff(tops, 2, axis=0)).max() < 2e-3


def outline(press: PlacedPress, depth: float) -> tuple[np.ndarray, np.ndarray]:
    curve = press.near_at(depth)
    kept = curve.radius > 1.4
    return curve.radius[kept], curve.height[kept]


def test_the_near_curve_ends_flat_where_what_is_beside_it_has_taken_over() -> None:
    press = placed((2.0, 16 / 3))
    curve = press.near_at(1.0)
    assert (curve.radius[-1], curve.height[-1], curve.inclination[-1]) == (FAR, 0.0, 0.0)
    assert curve.height[0] == pytest.approx(-1.0)
    away = curve.radius > 1.3
    slope = np.gradient(curve.height[away], curve.radius[away])
    np.testing.assert_allclose(np.tan(curve.inclination[away])[2:-2], slope[2:-2], atol=5e-3)


def test_whole_tops_do_not_depend_on_where_the_near_curve_fades(monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.linspace(0.0, PAD[0], 41)

    def top() -> np.ndarray:
        press = placed((3.0, 5.0))
        radius = np.hypot(x[:, None] - 3.0, x[None, :] - 5.0)
        curve = press.near_at(1.0)
        return np.interp(radius, curve.radius, curve.height) + press.beside(1.0, x, x)

    first = top()
    monkeypatch.setattr("optopad.sims.contact.library.solved_press.NEAR", 1.8)
    monkeypatch.setattr("optopad.sims.contact.library.solved_press.FAR", 3.0)
    # the linear layer is the solved top to 3 µm of a 3 mm tip where it takes over
    assert np.abs(top() - first).max() < 2.5e-3


def test_places_that_are_not_covered_are_refused_by_name() -> None:
    with pytest.raises(ModelScopeError, match=r"1\.20 tip"):
        placed((5.0, 1.2))
    with pytest.raises(InputError, match="west = nan"):
        placed((float("nan"), 5.0))
    with pytest.raises(ModelScopeError, match=f"by more than {LARGEST_CHANGE:.0%}; use a larger pad"):
        placed((2.0, 2.0), size=(4.0, 4.0)).round_depth(1.0)
