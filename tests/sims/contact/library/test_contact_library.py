"""The shipped library: what it holds, how well it interpolates, and that it can be made anew."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.live_press import fit_press
from optopad.sims.contact.library.profile_library import (
    CORNER,
    FILE,
    LAYERS,
    Library,
    deepest_press,
    shipped_library,
)
from optopad.sims.contact.library.smooth_press import POISSON_RATIOS, SmoothPress, nearly_incompressible
from optopad.sims.contact.library.solved_press import FAR, LARGEST_CHANGE, PlacedPress, SolvedPress
from optopad.sims.contact.library.stored_press import PressInputs
from optopad.sims.contact.scope import contact_of
from tests.validation.contact.library_build import (
    assembled,
    crown_changes,
    entry_inputs,
    entry_press,
    library_depths,
    pack,
)
from tests.validation.contact.library_interpolation import distances_um


@pytest.fixture(scope="module")
def library() -> Library:
    return shipped_library()


def apart_um(left: SmoothPress, right: SmoothPress, depth: float) -> float:
    """Largest distance of one curve's points from the other curve, for a tip of 3 mm [um]."""
    return float(distances_um(left, right, depth).max())


def test_library_is_small(library: Library) -> None:
    assert (
        len(resources.files("optopad.sims.contact.library").joinpath("data", FILE).read_bytes()) < 8 * 2**20
    )
    assert library.recipe == stored_press.RECIPE


def test_library_spans_the_modelled_layers_and_depths(library: Library) -> None:
    np.testing.assert_allclose(library.layers, LAYERS)
    assert (LAYERS[0], LAYERS[-1]) == (1.3, 6.0)
    assert library.wall_radius == pytest.approx(16 / 3)
    for layer in (1.3, 1.7, 3.3, 6.0):
        press = library.press(layer)
        assert press.deepest == pytest.approx(min(0.8 * layer, 1.7))
        assert press.first <= 0.02 / 3 + 1e-9


def test_library_returns_its_entries_at_their_layers(library: Library) -> None:
    for index, layer in enumerate(LAYERS):
        np.testing.assert_allclose(library.press(layer).coefficients, library.coefficients[index], atol=1e-9)


def test_thin_and_thick_layers_meet_without_a_step(library: Library) -> None:
    below, above = library.press(CORNER - 1e-9), library.press(CORNER + 1e-9)
    # the other curve is sampled every fifth of a micrometre
    assert apart_um(below, above, 1.0) < 0.12
    assert below.force_at(1.0) == pytest.approx(above.force_at(1.0), rel=1e-7)


@pytest.mark.parametrize("left_out", [1, 2, 3, 5, 6, 7, 8, 9, 10])
def test_a_left_out_entry_is_found_again_from_its_neighbours(library: Library, left_out: int) -> None:
    kept = np.arange(len(LAYERS)) != left_out
    thinned = replace(
        library,
        layers=library.layers[kept],
        first=library.first[kept],
        coefficients=library.coefficients[kept],
        residual=library.residual[kept],
    )
    true, found = library.press(LAYERS[left_out]), thinned.press(LAYERS[left_out])
    for depth in np.array([0.1, 0.4, 0.7, 0.95]) * true.deepest:
        # twice the spacing of the real library: a cubic's error is sixteen times the real one. Where the surface
        # leaves the tip steeply its edge is found to 0.03 tip radii only, and wide gaps amplify that
        assert found.force_at(float(depth)) == pytest.approx(true.force_at(float(depth)), rel=0.01)
        apart = distances_um(found, true, float(depth))
        assert np.sqrt(np.mean(apart**2)) < 10.0
        assert apart.max() < 60.0


def test_force_and_contact_shrink_as_the_layer_thickens(library: Library) -> None:
    presses = [library.press(float(layer)) for layer in np.linspace(1.3, 6.0, 48)]
    force = np.array([press.force_at(0.8) for press in presses])
    assert np.all(np.diff(force) < 0.0)
    edge = np.array([press.edge_at(0.4) for press in presses])
    # edges are found to 0.03 tip radii
    assert np.all(np.diff(edge) < 0.03)
    assert edge[-1] < edge[0]


def test_library_serves_every_modulus_and_scale(check_design: SensorDesign) -> None:
    press = solved_press(contact_of(check_design), 3.0)
    assert press.unit is None
    assert press.smooth.layer_depth == pytest.approx(8 / 3)
    stiff = solved_press(contact_of(check_design.with_(**{"elastomer.youngs_modulus_mpa": 3.0})), 3.0)
    assert stiff.force_n(2.0) == pytest.approx(3.0 * press.force_n(2.0), rel=1e-12)


def test_depths_of_all_entries_are_the_same_shares_of_the_deepest() -> None:
    for layer in LAYERS:
        depths = np.array(library_depths(layer))
        np.testing.assert_allclose(
            depths / deepest_press(layer), np.array(library_depths(6.0)) / 1.7, rtol=1e-6
        )
        assert np.all(np.diff(depths) > 0.0)
        assert np.diff(depths).max() <= 1 / 30 + 1e-9


def test_packing_the_library_gives_the_shipped_file(library: Library) -> None:
    held = np.load(resources.files("optopad.sims.contact.library").joinpath("data", FILE))
    packed = pack(library)
    assert set(held) == set(packed)
    for name, array in packed.items():
        np.testing.assert_array_equal(held[name], array)


def test_finished_solves_are_not_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, coarse_press: SolvedPress
) -> None:
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setattr(stored_press, "_SOLVED", {})
    solved: list[tuple[float, float]] = []

    def solve(inputs: PressInputs, *_: object) -> object:
        solved.append((inputs.layer, inputs.poisson_ratio))
        return replace(coarse_press.unit, layer_depth=inputs.layer)

    monkeypatch.setattr(stored_press, "_solve", solve)
    first = [entry_press(layer) for layer in LAYERS[:2]]
    monkeypatch.setattr(stored_press, "_SOLVED", {})
    again = [entry_press(layer) for layer in LAYERS[:3]]
    assert solved == [(layer, ratio) for layer in LAYERS[:3] for ratio in POISSON_RATIOS]
    np.testing.assert_array_equal(first[1].coefficients, again[1].coefficients)
    pad = (LAYERS[0], again[0].wall_radius)
    crowns = [replace(again[0], crown=0.1), replace(again[0], crown=0.2)]
    changes = crown_changes({pad: again[0]}, {pad: crowns}, pad)
    library = assembled(again, [[replace(again[0], wall_radius=6.0)]], changes)
    assert library.coefficients.shape[0] == 3
    assert (library.wall_layers.tolist(), library.pad_radii.tolist()) == ([LAYERS[0]], [6.0])
    np.testing.assert_array_equal(library.wall_changes, 0.0)
    assert (library.crowned.layers.tolist(), library.crowned.radii.tolist()) == ([pad[0]], [pad[1]])
    np.testing.assert_array_equal(library.crowned.slopes, 0.0)
    np.testing.assert_array_equal(library.crowned.bow, 0.0)


def test_compressibility_is_extrapolated_in_a_straight_line(library: Library) -> None:
    stiff = library.press(3.0)
    rise = np.linspace(-1.0, 1.0, stiff.coefficients.size).reshape(stiff.coefficients.shape)
    soft = replace(stiff, coefficients=stiff.coefficients - 0.02 * rise)
    found = nearly_incompressible(soft, stiff)
    # 1 - 2 nu falls from 0.04 by 0.02, and from there by 0.018 more
    np.testing.assert_allclose(found.coefficients - stiff.coefficients, 0.018 * rise, atol=1e-12)


@pytest.mark.full
def test_an_entry_solved_live_is_the_shipped_one(library: Library) -> None:
    layer = LAYERS[2]
    depths = library_depths(layer)
    # the first part of the depths; the spline through them differs from the whole one near its end only
    soft, stiff = (
        stored_press.stored_press(replace(entry_inputs(layer, ratio), depths=depths[:24]))[0]
        for ratio in POISSON_RATIOS
    )
    live, shipped = nearly_incompressible(fit_press(soft), fit_press(stiff)), library.press(layer)
    assert stiff.mesh_size == pytest.approx(library.mesh_size)
    for depth in depths[2:18:3]:
        # another processor rounds differently and may leave a facet in or out of contact
        assert live.force_at(depth) == pytest.approx(shipped.force_at(depth), rel=5e-3)
        assert apart_um(live, shipped, depth) < 3.0


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
