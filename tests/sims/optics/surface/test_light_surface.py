"""The radial table against the curve that it comes from."""

from itertools import pairwise

import numpy as np
import pytest

from optopad.sims.optics.engine.straight import MIN_STEP_MM
from optopad.sims.optics.scene.optical_scene import smooth_field
from optopad.sims.optics.surface import curves as surface
from optopad.sims.optics.surface.curves import BEND, CELLS, PIECE_COLUMNS, WINDOW, node_radii_mm
from optopad.sims.optics.surface.tops import Top, stack_tops
from optopad.sims.press import Indentation
from tests.oracle.oracle_scenes import scene_of, shank_press
from tests.sims.optics.engine.called_kernels import (
    bend_at,
    first_chord,
    gradient_at,
    height,
    height_and_slope,
    height_at,
    height_slope_curvature,
    reach2,
    slope_bound,
    top_hit,
)
from tests.sims.optics.surface.analytic import compact_dimple

SCENE = scene_of([(0, 8.0, 4.0, 0.5, 0.5)], [(2, 8.0, 4.0, 1.3, 1.3)])


def lowered(indentation):
    """The row that kernels read, and the stack that it comes from."""
    (row,) = stack_tops([indentation], np.array([[16.0, 16.0]]), SCENE).rows
    return row, surface.stack_surfaces([indentation], np.array([[16.0, 16.0]]), SCENE)


def slope(r, row):
    """dh/dr at a radius."""
    return r * height_and_slope(r * r, row)[1]


def one_tip(row):
    return Top(row, np.zeros((0, 0, 16)))


@pytest.mark.parametrize("depth", [0.1, 0.5, 1.0, 2.0, 3.0, 4.5])
def test_table_follows_the_curve_within_a_micrometre(depth):
    curve = compact_dimple(depth, bulge_mm=0.15)
    row, _ = lowered(curve)
    found = np.array([height(r**2, row) for r in curve.radius_mm]) - 8.0
    assert np.abs(found - curve.height_mm).max() < 1e-3


def test_pile_up_above_the_undisturbed_top_is_kept():
    row, _ = lowered(compact_dimple(2.0, bulge_mm=0.15))
    highest = max(height(r**2, row) for r in np.linspace(3, 16, 400))
    assert highest - 8.0 == pytest.approx(0.15, abs=2e-3)
    assert row[surface.HIGHEST] >= highest - 1e-4


def test_height_and_slope_are_continuous_everywhere():
    row, _ = lowered(compact_dimple(2.0, bulge_mm=0.15))
    joints = list(node_radii_mm(row[surface.SPHERE_R], row[surface.OUTER_R])[0])
    for r in joints:
        below, above = (height_and_slope((r + side) ** 2, row) for side in (-1e-8, 1e-8))
        assert above == pytest.approx(below, abs=1e-5)


def test_slope_and_bend_are_the_derivatives_of_height():
    row, _ = lowered(compact_dimple(2.0, bulge_mm=0.15))
    for r in np.linspace(2.6, 19.0, 57):
        h, turn, bend = height_slope_curvature(r * r, row)
        step = 1e-5
        up, down = height((r + step) ** 2, row), height((r - step) ** 2, row)
        assert r * turn == pytest.approx((up - down) / (2 * step), abs=1e-6)
        more, less = (height_and_slope((r + s) ** 2, row)[1] for s in (step, -step))
        assert r * bend == pytest.approx((more - less) / (2 * step), abs=1e-3)
        assert height_and_slope(r * r, row) == pytest.approx((h, turn), abs=1e-12)


def test_slope_bound_holds_outward():
    row, _ = lowered(compact_dimple(3.0, bulge_mm=0.15))
    radii = np.linspace(0.01, 20.0, 2000)
    slopes = np.array([abs(slope(r, row)) for r in radii])
    outward = np.maximum.accumulate(slopes[::-1])[::-1]
    bounds = np.array([slope_bound(r * r, row) for r in radii])
    assert (bounds >= outward - 1e-9).all()


@pytest.mark.parametrize("depth", [0.3, 2.0, 4.5])
def test_bend_bound_holds_within_its_window_and_outward(depth):
    row, _ = lowered(compact_dimple(depth, bulge_mm=0.15))
    pieces = row[surface.PIECES : surface.PIECES + CELLS * PIECE_COLUMNS].reshape(CELLS, PIECE_COLUMNS)
    nodes = node_radii_mm(row[surface.SPHERE_R], row[surface.OUTER_R])[0]
    radii = np.concatenate([np.linspace(a, b, 9)[1:-1] for a, b in pairwise(nodes)])
    found = np.array([height_slope_curvature(r * r, row) for r in radii])
    # second derivatives across and along the radius, downward
    bends = np.maximum(-found[:, 1], -(found[:, 1] + found[:, 2] * radii**2))
    for piece, start in zip(pieces, nodes, strict=False):
        assert piece[BEND] >= bends[radii >= start - piece[WINDOW]].max()
    assert (pieces[:, BEND] >= 0.0).all()


@pytest.mark.parametrize("depth", [0.3, 1.0, 3.0, 4.5])
def test_a_march_finds_the_first_crossing_of_any_ray(depth):
    """Against a scan in steps of 2 µm, from places below the top in any direction; chords of a step may be missed."""
    row, _ = lowered(compact_dimple(depth, bulge_mm=0.15))
    top, generator = one_tip(row), np.random.default_rng(7)
    met = 0
    for _ in range(400):
        x, y = 16.0 + generator.uniform(-9.0, 9.0, 2)
        z = height((x - 16.0) ** 2 + (y - 16.0) ** 2, row) - 1e-6 - 2.0 * generator.uniform() ** 4
        direction = generator.normal(size=3) * [1.0, 1.0, 0.3]
        dx, dy, dz = direction / np.linalg.norm(direction)
        hit = top_hit(x, y, z, dx, dy, dz, 18.0, top)
        first, last = first_chord(x, y, z, dx, dy, dz, 18.0, 2e-3, top)
        if (hit < 0.0) != (first < 0.0) or abs(first - hit) > 2.1e-3:
            # a chord above the top that no step of the march need meet
            assert 0.0 <= first <= last < first + MIN_STEP_MM
        met += hit >= 0.0
    assert 50 < met < 350


@pytest.mark.parametrize("depth", [0.3, 3.0, 4.5, None])
@pytest.mark.parametrize("scale_mm", [0.02, 0.2])
def test_a_march_finds_the_first_crossing_on_a_field_too(depth, scale_mm):
    """As above, with a field of waves 12 mm long beside the tip, or alone."""
    field = smooth_field(
        lambda x, y: scale_mm * np.sin(0.52 * x + 0.3) * np.cos(0.4 * y), SCENE.length_mm, SCENE.width_mm, 1.0
    )
    press = None if depth is None else compact_dimple(depth, bulge_mm=0.15)
    (row,), cells = stack_tops([press], np.array([[16.0, 16.0]]), SCENE, [field]).part(np.arange(1))
    top, generator = Top(row, cells[0]), np.random.default_rng(11)
    met = 0
    for _ in range(400):
        x, y = 16.0 + generator.uniform(-9.0, 9.0, 2)
        z = height_at(x, y, top) - 1e-6 - 2.0 * generator.uniform() ** 4
        direction = generator.normal(size=3) * [1.0, 1.0, 0.3]
        dx, dy, dz = direction / np.linalg.norm(direction)
        hit = top_hit(x, y, z, dx, dy, dz, 12.0, top)
        first, last = first_chord(x, y, z, dx, dy, dz, 12.0, 2e-3, top)
        if (hit < 0.0) != (first < 0.0) or abs(first - hit) > 2.1e-3:
            assert 0.0 <= first <= last < first + MIN_STEP_MM
        met += hit >= 0.0
    assert 50 < met < 350


def test_the_cells_of_a_field_are_its_patches_with_their_slopes():
    field = smooth_field(lambda x, y: np.sin(0.3 * x) * np.cos(0.2 * y), SCENE.length_mm, SCENE.width_mm, 2.0)
    (row,), cells = stack_tops([None], np.array([[16.0, 16.0]]), SCENE, [field]).part(np.arange(1))
    top, generator = Top(row, cells[0]), np.random.default_rng(3)
    for x, y in generator.uniform(0.5, 31.5, (200, 2)):
        here = field.height_mm(np.array([x, x + 1e-5, x]), np.array([y, y, y + 1e-5]))
        h, gx, gy = gradient_at(x, y, top)
        assert h - SCENE.height_mm == pytest.approx(here[0], abs=1e-12)
        assert h == height_at(x, y, top)
        assert (gx, gy) == pytest.approx(((here[1] - here[0]) / 1e-5, (here[2] - here[0]) / 1e-5), abs=1e-5)
        _, bx, by, xx, xy, yy = bend_at(x, y, top)
        _, ax, ay = gradient_at(x + 1e-5, y, top)
        _, _, cy = gradient_at(x, y + 1e-5, top)
        assert (bx, by) == (gx, gy)
        assert (xx, xy, yy) == pytest.approx(((ax - gx) / 1e-5, (ay - gy) / 1e-5, (cy - gy) / 1e-5), abs=1e-5)


def test_the_top_lies_nowhere_below_a_level_beyond_its_reach():
    row, _ = lowered(compact_dimple(3.0, bulge_mm=0.15))
    for z in np.linspace(5.01, 7.99, 60):
        reach = np.sqrt(reach2(z, row))
        beyond = np.linspace(reach, row[surface.OUTER_R], 500)
        assert min(height(r * r, row) for r in beyond) >= z - 1e-9
        # a level is 3/64 mm high; within the sphere no reach is told
        if reach > row[surface.SPHERE_R]:
            assert height((reach - 0.1) ** 2, row) < z + 3 / 64


def test_overhang_near_the_shank_keeps_the_lowest_surface():
    radius = np.concatenate([np.linspace(0, 3, 30), [3.05, 3.02, 3.0, 3.1, 3.4, 4.0, 6.0, 9.0]])
    inside = -4.5 + 3 - np.sqrt(np.maximum(9 - np.linspace(0, 3, 30) ** 2, 0))
    curve_mm = np.concatenate([inside, [-1.2, -0.9, -0.7, -0.5, -0.3, -0.1, -0.01, 0.0]])
    curve = Indentation(
        depth_mm=4.5,
        tip_radius_mm=3.0,
        radius_mm=radius,
        height_mm=curve_mm,
        contact_radius_mm=3.0,
        force_n=1.0,
    )
    row, stack = lowered(curve)
    assert stack.moved_mm[0] == pytest.approx(0.05, abs=0.02)
    assert height(3.4**2, row) - 8.0 == pytest.approx(-0.3, abs=0.01)
    assert slope_bound(0.0, row) <= 1.5 * surface.MAX_SLOPE


def test_the_contact_ends_where_the_curve_leaves_the_shank():
    """Half the sphere and 0.5 mm of the shank; once points of the skirt within 0.03 mm of the tip counted, 5 % more."""
    row, stack = lowered(shank_press())
    assert row[surface.CONTACT_AREA] == pytest.approx(np.pi * (2.0 * 3.0**2 + 2.0 * 3.0 * 0.5), rel=1e-3)
    # up a wall as steep as the table allows
    assert row[surface.CONTACT_R] == pytest.approx(3.0 + 0.5 / surface.MAX_SLOPE, abs=2e-3)
    assert height(row[surface.CONTACT_R] ** 2, row) - 8.0 == pytest.approx(-1.1, abs=0.02)
    assert stack.moved_mm[0] < 0.02


def test_ray_meets_the_sphere_where_geometry_says():
    row, _ = lowered(compact_dimple(2.0))
    hit = top_hit(4.0, 16.0, 6.5, 1.0, 0.0, 0.0, 28.0, one_tip(row))
    expected = 12.0 - np.sqrt(9.0 - (row[surface.SPHERE_Z] - 6.5) ** 2)
    assert hit == pytest.approx(expected, abs=1e-8)


def test_ray_over_the_rim_meets_the_pile_up():
    row, _ = lowered(compact_dimple(2.0, bulge_mm=0.2))
    hit = top_hit(0.0, 16.0, 7.999, 1.0, 0.0, 0.002, 28.0, one_tip(row))
    r = 16.0 - hit
    assert height(r**2, row) == pytest.approx(7.999 + 0.002 * hit, abs=1e-9)


def test_a_grazing_chord_of_a_twentieth_millimetre_is_seen():
    row, _ = lowered(compact_dimple(2.0))
    z = 6.0 + 0.025**2 / (2 * 3.0)
    hit = top_hit(1.0, 16.0, z, 1.0, 0.0, 0.0, 30.0, one_tip(row))
    assert hit == pytest.approx(15.0 - 0.025, abs=1e-4)
