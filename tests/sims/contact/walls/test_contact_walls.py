"""What near walls add: limits, symmetry, smoothness, and the walls' own condition."""

from __future__ import annotations

import numpy as np
import pytest

from design.errors import InputError, ModelScopeError
from design.preset import preset
from sims.contact.scope import HALF_WIDTH
from sims.contact.walls.near_walls import WallCorrection, wall_correction, walls_of
from sims.contact.walls.superposition import Walls, amplitudes, coupling

CENTRED: Walls = (HALF_WIDTH,) * 4
NEAR: Walls = (2.0, 26 / 3, HALF_WIDTH, HALF_WIDTH)
CORNER: Walls = (7 / 3, 25 / 3, 8 / 3, 8.0)
SMALL: Walls = (4.0, 4.0, 4.0, 4.0)


def field(found: WallCorrection, x: object, y: object) -> np.ndarray:
    return found.height(np.asarray(x, dtype=float), np.asarray(y, dtype=float))


def test_a_centred_press_in_the_reference_pad_is_not_corrected() -> None:
    found = wall_correction(8 / 3, 1.0, CENTRED)
    assert found.force_factor == 1.0
    assert not field(found, [0.0, 2.0, -4.0], [1.5, 1.0, 4.0]).any()
    assert not found.azimuthal_mean(np.linspace(0.0, 5.0, 9)).any()


def test_an_untouched_pad_is_not_corrected() -> None:
    assert wall_correction(3.0, 0.0, NEAR).force_factor == 1.0


def test_the_tip_stays_exact_inside_the_contact() -> None:
    found = wall_correction(3.0, 1.0, CORNER)
    assert found.field is not None
    angle = np.linspace(0.0, 2.0 * np.pi, 17)
    inside = 0.999 * found.field.contact_radius
    assert not field(found, inside * np.cos(angle), inside * np.sin(angle)).any()


@pytest.mark.parametrize("walls", [NEAR, CORNER, SMALL])
def test_the_corrected_surface_is_zero_at_every_near_wall_and_corner(walls: Walls) -> None:
    radius = np.linspace(1.0, HALF_WIDTH, 50)
    height = 0.05 * (1.0 - radius / HALF_WIDTH) * radius
    found = wall_correction(3.0, 1.0, walls, (radius, height))
    west, east, south, north = walls
    along_x, along_y = np.linspace(-west, min(east, 8.0), 23), np.linspace(-south, min(north, 8.0), 23)
    edges = [(np.full(23, -west), along_y), (along_x, np.full(23, -south))]
    if walls == SMALL:
        edges += [(np.full(23, east), along_y), (along_x, np.full(23, north))]
    for x, y in edges:
        centred = np.interp(np.hypot(x, y), radius, height, right=0.0)
        # the rim is interpolated by cubics here and by lines there: a second difference of 0.05 * 0.09² / 8
        np.testing.assert_allclose(centred + field(found, x, y), 0.0, atol=1e-4)


def test_turning_and_mirroring_the_walls_turns_and_mirrors_the_field() -> None:
    x, y = np.array([-1.8, 1.3, 0.4, 3.0]), np.array([0.7, -1.6, 2.1, 1.0])
    west, east, south, north = CORNER
    straight = wall_correction(3.0, 1.2, CORNER)
    mirrored = wall_correction(3.0, 1.2, (east, west, south, north))
    turned = wall_correction(3.0, 1.2, (south, north, west, east))
    np.testing.assert_allclose(field(mirrored, -x, y), field(straight, x, y), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(field(turned, y, x), field(straight, x, y), rtol=1e-9, atol=1e-12)
    assert mirrored.force_factor == pytest.approx(straight.force_factor, rel=1e-12)


def test_force_grows_as_a_wall_comes_nearer() -> None:
    distances = np.linspace(1.5, 8.0, 40)
    for layer in (1.3, 2.2, 3.0, 6.0):
        depth = 0.5 * min(0.8 * layer, 1.7)
        factors = [
            wall_correction(layer, depth, (d, HALF_WIDTH, HALF_WIDTH, HALF_WIDTH)).force_factor
            for d in distances
        ]
        # a thin layer hardly feels a wall beyond 3 tip radii: 0.2 % is what its runs resolve
        assert (np.diff(factors) < 2e-3).all()
        assert factors[0] > 1.02


def test_more_walls_press_harder_than_their_sum() -> None:
    one = wall_correction(3.0, 1.0, (8 / 3, HALF_WIDTH, HALF_WIDTH, HALF_WIDTH)).force_factor - 1.0
    four = wall_correction(3.0, 1.0, (8 / 3,) * 4).force_factor - 1.0
    assert four > 4.0 * one


def test_amplitudes_are_one_for_a_single_wall_and_the_sum_of_all_reflections_for_several() -> None:
    assert amplitudes(coupling(0.1, 0.2, np.array([1.0, 0.0, 0.0, 0.0])))[0] == pytest.approx(1.0)
    # four equal walls: A = 1 + (2a + o) A
    np.testing.assert_allclose(amplitudes(coupling(0.1, 0.2, np.ones(4))), 1.0 / (1.0 - 0.4))


@pytest.mark.parametrize("walls", [NEAR, CORNER, SMALL])
def test_the_field_is_continuously_differentiable_across_the_pad(walls: Walls) -> None:
    found = wall_correction(3.0, 1.0, walls)
    step = 1e-3
    for turn in (0.0, 0.9, 2.4):
        # through the contact, the window's end, the axis and the cells of the splines, up to 3.9 from the axis
        limit = 0.97 * min(walls) if turn == 0.0 else 1.9
        s = np.arange(-limit, limit, step)
        slope = np.diff(field(found, s * np.cos(turn), s * np.sin(turn))) / step
        # a kink would be a jump of the slope however small the step; curvature changes it by |d²z/ds²| * step
        assert np.abs(np.diff(slope)).max() < 40.0 * step


def test_the_field_is_continuously_differentiable_in_depth_and_place() -> None:
    def at_depth(depth: float) -> float:
        return float(field(wall_correction(3.0, depth, CORNER), 1.6, -0.9))

    def at_place(shift: float) -> float:
        walls = (2.6 + shift, HALF_WIDTH - shift, 3.0, HALF_WIDTH)
        return float(field(wall_correction(3.0, 1.0, walls), 1.6 - shift, -0.9))

    for function, low, high in ((at_depth, 0.2, 1.69), (at_place, -1.0, 2.0)):
        step = 1e-3
        at = np.arange(low, high, 0.05)
        before = np.array([(function(a) - function(a - step)) / step for a in at])
        after = np.array([(function(a + step) - function(a)) / step for a in at])
        # a field of 0.1 over lengths of 0.2 has second derivatives below 5
        assert np.abs(after - before).max() < 5.0 * step


def test_azimuthal_mean_is_the_mean_of_the_field_on_circles_that_fit_the_pad() -> None:
    found = wall_correction(3.0, 1.0, CORNER)
    angle = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    mean = field(found, 1.9 * np.cos(angle), 1.9 * np.sin(angle)).mean()
    # 48 directions against 720 of a field with few harmonics
    assert found.azimuthal_mean(np.array([1.9]))[0] == pytest.approx(mean, rel=0.02)


@pytest.mark.parametrize(
    ("layer", "depth", "walls", "words"),
    [
        (3.0, 1.0, (1.4, 6.0, 6.0, 6.0), "the west wall is 1.40 tip radii .* press farther from it"),
        (1.2, 0.5, NEAR, "layer: 1.2 tip radii; the wall correction covers 1.3 to 6"),
        (2.0, 1.7, NEAR, "depth: 1.7 tip radii; the wall correction covers up to 1.6"),
        (3.0, 1.0, (1.6, 1.6, 1.6, 1.6), "too near together .* use a larger pad or a smaller tip"),
    ],
)
def test_what_the_data_does_not_cover_is_refused_by_name(
    layer: float, depth: float, walls: Walls, words: str
) -> None:
    with pytest.raises(ModelScopeError, match=words):
        wall_correction(layer, depth, walls)


def test_a_distance_that_is_no_number_is_refused() -> None:
    with pytest.raises(InputError, match="south = nan must be a finite number"):
        wall_correction(3.0, 1.0, (3.0, 3.0, float("nan"), 3.0))


def test_walls_of_a_design_are_measured_from_the_press_axis_in_tip_radii() -> None:
    paper = preset("piacenza2017-pad")
    assert walls_of(paper) == pytest.approx((16 / 3,) * 4)
    assert walls_of(paper, (6.0, 16.0)) == pytest.approx((2.0, 26 / 3, 16 / 3, 16 / 3))
    assert walls_of(preset("fingertip-16")) == pytest.approx((4.0,) * 4)
