"""Light of tops given as heights on a grid: a ball through this path agrees with the engine of balls."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.sims.contact.pad_surface import PadSurface, pad_surface
from optopad.sims.kernels import entry_points
from optopad.sims.optics.accuracy import accuracy_of
from optopad.sims.optics.engine.general.grid import divided, patch_areas
from optopad.sims.optics.engine.general.kernels import KERNEL_MODULES
from optopad.sims.optics.engine.general.lower import stack_formed
from optopad.sims.optics.engine.general.pad import formed_ways
from optopad.sims.optics.engine.general.top import FormedTop, above, top_hit
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import block_form, scene_of
from optopad.sims.optics.tracing import trace
from optopad.sims.press import GridTop

entry = entry_points((*KERNEL_MODULES, sys.modules[__name__]), error_model="numpy")


@entry
def way_out_mm(x, y, z, dx, dy, dz, limit, origin, axes, numbers, row, grid):
    """Where a ray leaves through the top; and where its height above the top first exceeds 1 µm."""
    top = FormedTop(origin, axes, numbers, row, grid)
    found = top_hit(top, x, y, z, dx, dy, dz, limit)
    t = 0.0
    while t < limit and above(top, x + t * dx, y + t * dy, z + t * dz) < 1e-3:
        t += 0.01
    return found, t, above(top, x + found * dx, y + found * dy, z + found * dz) if found < limit else 0.0


DESIGN = preset("gripper-teensy")
SCENE = scene_of(DESIGN)
AT, DEPTH = (14.0, 12.0), 0.8


def grid_of_ball(surface: PadSurface, step_mm: float = 0.2) -> GridTop:
    """The top under a ball as heights on a grid."""
    x, y = (np.arange(-1, int(size / step_mm) + 3) * step_mm for size in surface.size_mm)
    at, near = surface.at_mm, surface.near
    radius = np.hypot(x[:, None] - at[0], y - at[1])
    return GridTop(
        at_mm=at,
        x_mm=x - at[0],
        y_mm=y - at[1],
        height_mm=surface.height_mm(x, y),
        level=near.contact_radius_mm - radius,
    )


@pytest.fixture(scope="module")
def ball() -> GridTop:
    return grid_of_ball(pad_surface(DESIGN, DEPTH, AT))


@pytest.fixture(scope="module")
def formed():
    return replace(SCENE, form=block_form(SCENE))


def test_a_ball_on_a_grid_changes_the_light_as_the_engine_of_balls_says(ball):
    known = trace(Pad.of(DESIGN), np.array([[0.0, 0.0, 0.0], [*AT, DEPTH]]), accuracy="score")
    found = trace_scene(SCENE, np.array([AT, AT]), [None, ball], accuracy="score")
    flux = found.flux.sum(axis=0)
    change = (flux[1] - flux[0]) / flux[0]
    expected = (known.flux[1] - known.flux[0]) / known.flux[0]
    error = np.hypot(found.standard_error[1] / flux[0], known.standard_error[1] / known.flux[0])
    assert np.sqrt(np.mean(expected**2)) > 0.05
    assert np.sqrt(np.mean((change - expected) ** 2)) < 0.005
    assert np.abs(change - expected).max() < 4.0 * error.max()
    assert np.sqrt(np.mean(((change - expected) / error) ** 2)) < 1.5


def test_a_flat_grid_is_the_untouched_pad_and_a_turned_press_the_turned_light(formed, ball):
    flat = replace(ball, height_mm=np.zeros_like(ball.height_mm), level=np.full_like(ball.level, -1.0))
    middle = (0.5 * SCENE.length_mm, 0.5 * SCENE.width_mm)
    surface = grid_of_ball(pad_surface(DESIGN, DEPTH, middle))
    untouched, same, pressed = trace_scene(
        formed, np.zeros((3, 2)), [None, flat, surface], accuracy="draft"
    ).flux.sum(axis=0)
    np.testing.assert_array_equal(same, untouched)
    turned = GridTop(
        at_mm=middle,
        x_mm=-surface.x_mm[::-1],
        y_mm=-surface.y_mm[::-1],
        height_mm=surface.height_mm[::-1, ::-1],
        level=surface.level[::-1, ::-1],
    )
    again = trace_scene(formed, np.zeros((1, 2)), [turned], accuracy="draft").flux.sum(axis=0)[0]
    np.testing.assert_allclose(again, pressed, atol=1e-4 * untouched.max())


def test_rays_leave_through_a_grid_where_close_steps_find_the_top(formed, ball):
    top = stack_formed(formed, np.zeros((1, 2)), [ball]).top(0)
    random, tested = np.random.default_rng(3), 0
    for _ in range(200):
        start = np.array([*random.uniform(-6.0, 6.0, 2), random.uniform(-4.5, -1.0)])
        way = random.normal(size=3)
        way[2] = 0.3 * abs(way[2])
        way /= np.linalg.norm(way)
        found, stepped, off = way_out_mm(*start, *way, 8.0, *top)
        if stepped == 0.0:
            continue
        tested += 1
        if stepped < 8.0:
            assert abs(found - stepped) < 0.05
        assert abs(off) < 1e-6
    assert tested > 150


def test_cells_are_divided_where_the_top_bends_and_cover_the_same_area(formed, ball):
    top = stack_formed(formed, np.zeros((1, 2)), [ball]).top(0)
    cells = formed_ways(formed, accuracy_of("draft"), 0).grid
    is_divided, pieces = divided(cells, top)
    assert 0 < is_divided.sum() < len(is_divided)
    assert (pieces.size**2).sum() == pytest.approx((cells.size[is_divided] ** 2).sum())
    edge = pad_surface(DESIGN, DEPTH, AT).near.contact_radius_mm
    reach = np.hypot(*(pieces.corner + 0.5 * pieces.size[:, None] - AT).T)
    assert pieces.size[np.abs(reach - edge) < 0.05].max() < 0.3 * cells.pitch_mm
    areas = patch_areas(top)
    assert areas.sum() == pytest.approx(2.0 * np.pi * 1.5 * (1.5 - np.sqrt(1.5**2 - edge**2)), rel=0.05)


def test_a_grid_that_is_no_top_is_refused(ball):
    bad = [
        (replace(ball, level=ball.level[1:]), InputError, "one of each per node"),
        (replace(ball, height_mm=np.where(ball.level > 0.0, np.nan, 0.0)), InputError, "not finite"),
        (replace(ball, x_mm=ball.x_mm**3), InputError, "space them equally"),
        (replace(ball, height_mm=20.0 * ball.height_mm), ModelScopeError, "press less"),
    ]
    for press, error, words in bad:
        with pytest.raises(error, match=words):
            trace_scene(SCENE, np.array([AT]), [press], accuracy="draft")
