"""Light between straight walls and several round ones: exits, patches and symmetries of a stadium, and its light."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import Plan, facet
from optopad.design.shape.outline import Line, Outline, stadium
from optopad.sims.optics.engine.general import deposits as formed_deposits
from optopad.sims.optics.engine.general import rays as formed_rays
from optopad.sims.optics.engine.general.lower import walls_of
from optopad.sims.optics.engine.general.patches import PatchLayout, is_in_plan, patch_layout
from optopad.sims.optics.engine.trace_states import CLASS_NAMES, trace_scene
from optopad.sims.optics.scene.lower import form_of
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.optics.scene.symmetry import symmetries_of
from tests.oracle import scene as oracle_scene
from tests.oracle.form_scenes import block, crown_press, parts, top_of
from tests.oracle.scene import outline_mm, wall_runs
from tests.oracle.tracer import trace_oracle
from tests.sims.optics.surface.analytic import compact_dimple

LENGTH, WIDTH, HEIGHT = 32.0, 20.0, 8.0
RADIUS = WIDTH / 2
BARE = stadium((0.0, 0.0, LENGTH, WIDTH))


def with_facets(*angles_deg: float) -> Outline:
    return stadium(BARE.box_mm, [facet(BARE.arc_towards(angle), angle, 1.5) for angle in angles_deg])


OUTLINE = with_facets(180.0, 230.0, 0.0, 50.0)
SOUTH, NORTH, NORTH_WEST, WEST, EAST, NORTH_EAST = 0, 1, 3, 2, 4, 5
RANDOM = np.random.default_rng(8)


def pad(crown_mm: float = math.inf, **changes: float) -> OpticalScene:
    """A stadium with an emitter on a straight wall and one in each end, and receivers across."""
    form = form_of(Plan(outline=OUTLINE, top=top_of(LENGTH / 2, WIDTH / 2, crown_mm)))
    small, large = (0.5, 0.5), (1.3, 1.3)
    given = parts(
        [(SOUTH, 4.0, 4.0, *small), (WEST, 1.5, 4.0, *small), (NORTH_EAST, 1.5, 4.0, *small)],
        [(NORTH, 6.0, 4.0, *large), (EAST, 1.5, 4.0, *large), (NORTH_WEST, 1.5, 4.0, *large)],
    )
    return block(form, (LENGTH, WIDTH), **(given | changes))


SCENE = pad()
WALLS, ARCS = walls_of(SCENE)


def rays(count: int) -> list[tuple[float, ...]]:
    """Places inside and unit directions."""
    places = OUTLINE.spread(RANDOM.random((count, 2)))
    ways = RANDOM.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    return [tuple(row) for row in np.column_stack([places, RANDOM.uniform(0.1, 7.9, count), ways]).tolist()]


def way_out(x: float, y: float, dx: float, dy: float) -> float:
    """Distance to the border in plan along (dx, dy): the last of rectangle and circles, which overlap, or a facet."""
    far = [0.0]
    low, high = RADIUS, LENGTH - RADIUS
    spans = [sorted(((a - p) / d, (b - p) / d)) for p, d, a, b in ((x, dx, low, high), (y, dy, 0.0, WIDTH))]
    begin, end = max(span[0] for span in spans), min(span[1] for span in spans)
    if begin <= end:
        far.append(end)
    for cx in (low, high):
        square, along = dx * dx + dy * dy, (x - cx) * dx + (y - RADIUS) * dy
        root = along**2 - square * ((x - cx) ** 2 + (y - RADIUS) ** 2 - RADIUS**2)
        if root >= 0.0:
            far.append((math.sqrt(root) - along) / square)
    facets = [wall for wall in OUTLINE.lines if wall.name not in ("south", "north")]
    ways = [(wall, wall.outward[0] * dx + wall.outward[1] * dy) for wall in facets]
    return min([max(far), *(-wall.along_and_outward_mm(x, y)[1] / way for wall, way in ways if way > 0.0)])


def test_a_ray_leaves_by_the_wall_of_the_closed_form_in_engine_and_oracle() -> None:
    lowered = oracle_scene.lower_scene(SCENE)
    met = set()
    for x, y, z, dx, dy, dz in rays(1500):
        truth, wall = way_out(x, y, dx, dy), True
        if dz < 0.0 and -z / dz < truth:
            truth, wall = -z / dz, False
        t, which = formed_rays.plan_exit.py_func(x, y, z, dx, dy, dz, WALLS, ARCS)
        other, face = oracle_scene.face_hit.py_func(lowered, x, y, z, dx, dy, dz)
        assert (t, other) == pytest.approx((truth, truth), abs=1e-9)
        x, y = x + t * dx, y + t * dy
        assert (which >= 0) == (face != oracle_scene.BOTTOM_FACE) == wall
        if which >= 0:
            assert which == (face if face >= 0 else len(WALLS) + oracle_scene.ROUND_FACE - face)
            normal = formed_rays.inward.py_func(which, x, y, WALLS, ARCS)
            assert oracle_scene.inward_normal(lowered, face, x, y) == pytest.approx(normal, abs=1e-9)
            assert float(OUTLINE.gap_mm(x + 0.01 * normal[0], y + 0.01 * normal[1])) == pytest.approx(
                0.01, abs=2e-3
            ) or is_by_a_corner(x, y)
        met.add(which)
    assert met == {formed_rays.BOTTOM, *range(len(WALLS) + 2)}


def is_by_a_corner(x: float, y: float) -> bool:
    ends = np.array([end for wall in OUTLINE.lines for end in wall.ends])
    return bool(np.hypot(*(ends - (x, y)).T).min() < 0.05)


def test_arcs_of_one_end_are_one_round_wall_and_a_disc_s_counts_whole() -> None:
    assert len(OUTLINE.arcs) == 6
    assert pytest.approx(ARCS[:, :3]) == [(LENGTH - RADIUS, RADIUS, RADIUS), (RADIUS, RADIUS, RADIUS)]
    bare = form_of(Plan(outline=BARE, top=SCENE.form.top))
    assert bare.arcs[:, 3:] == pytest.approx(np.array([(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]), abs=2e-9)


def test_walls_run_as_far_as_the_outline_s() -> None:
    runs = wall_runs(SCENE.form.walls, SCENE.form.arcs)
    assert runs == pytest.approx(np.array([(0.0, wall.length_mm) for wall in OUTLINE.lines]), abs=1e-6)
    border = outline_mm(SCENE.form)
    assert np.abs(OUTLINE.gap_mm(*border.T)).max() < 1e-6
    assert (border.min(axis=0), border.max(axis=0)) == (
        pytest.approx((OUTLINE.lines[WEST].origin[0], 0.0), abs=1e-5),
        pytest.approx((OUTLINE.lines[EAST].origin[0], WIDTH), abs=1e-5),
    )


def areas(layout: PatchLayout) -> tuple[FloatArray, FloatArray]:
    """Areas of bottom and wall patches [mm2]."""
    split, weight = int(layout.numbers[3] * layout.numbers[4]), layout.weight[: -formed_deposits.TIP_PATCHES]
    per_weight = np.divide(1.0, weight, out=np.zeros(len(weight)), where=weight > 0.0)
    return per_weight[:split] * SCENE.bottom_reflectance, per_weight[split:] * SCENE.wall_reflectance


UPRIGHT = replace(
    SCENE,
    length_mm=WIDTH,
    width_mm=LENGTH,
    form=replace(
        SCENE.form,
        walls=SCENE.form.walls[:, [1, 0, 3, 2, 5, 4]],
        arcs=SCENE.form.arcs[:, [1, 0, 2, 4, 3, 5]],
        top=top_of(WIDTH / 2, LENGTH / 2),
    ),
)


@pytest.mark.parametrize("scene", [SCENE, UPRIGHT], ids=["lying", "upright"])
@pytest.mark.parametrize("patch_mm", [2.0, 0.5])
def test_areas_of_patches_add_up_to_those_of_bottom_and_walls(scene: OpticalScene, patch_mm: float) -> None:
    bottom, side = areas(patch_layout(scene, *walls_of(scene), patch_mm))
    around = sum(
        one.length_mm if isinstance(one, Line) else one.radius_mm * one.turn_rad for one in OUTLINE.loop
    )
    assert bottom.sum() == pytest.approx(OUTLINE.area_mm2, rel=3e-4)
    assert side.sum() == pytest.approx(around * HEIGHT, rel=3e-4)


def test_every_place_that_light_meets_lies_on_a_patch_that_has_an_area() -> None:
    layout = patch_layout(SCENE, WALLS, ARCS)
    area = np.concatenate(areas(layout))
    for x, y, z, dx, dy, dz in rays(300):
        t, which = formed_rays.plan_exit.py_func(x, y, z, dx, dy, dz, WALLS, ARCS)
        z = min(z + t * dz, HEIGHT)
        assert area[formed_deposits.patch_of.py_func(which, x + t * dx, y + t * dy, z, layout.numbers)] > 0.0


def test_places_are_in_the_plan_where_the_outline_says_so() -> None:
    x, y = RANDOM.uniform((-1.0, -1.0), (LENGTH + 1.0, WIDTH + 1.0), (4000, 2)).T
    assert np.array_equal(is_in_plan(x, y, WALLS, ARCS), OUTLINE.contains(x, y))


def test_a_stadium_has_the_half_turn_and_the_mirrors_that_its_facets_leave() -> None:
    none = parts([], [])
    whole = form_of(Plan(outline=with_facets(0.0, 180.0), top=SCENE.form.top))
    turned = form_of(Plan(outline=with_facets(50.0, 230.0), top=SCENE.form.top))
    moved = replace(whole, arcs=whole.arcs + np.array([[0.0] * 6, [0.0, 0.0, 0.01, 0.0, 0.0, 0.0]]))
    counts = [len(symmetries_of(replace(SCENE, form=form, **none))) for form in (whole, turned, moved)]
    assert counts == [4, 2, 2]


def test_a_press_is_refused_by_its_gap_to_the_nearest_wall() -> None:
    with pytest.raises(Exception, match="outside the pad"):
        trace_scene(SCENE, np.array([[1.0, 1.0]]), [compact_dimple(2.0)], accuracy="draft")


@pytest.mark.slow
@pytest.mark.parametrize("crown_mm", [math.inf, 60.0], ids=["flat", "crowned"])
@pytest.mark.parametrize("place", [(8.0, 9.0), (16.0, 10.0)], ids=["in an end", "in the middle"])
def test_light_of_a_stadium_is_the_oracle_s(crown_mm: float, place: tuple[float, float]) -> None:
    scene = pad(crown_mm, tip_reflectance=0.2)
    press = compact_dimple(2.0) if crown_mm == math.inf else crown_press(2.0, crown_mm)
    for one in (None, press):
        found = trace_scene(scene, np.array([place]), [one], accuracy="standard")
        known = trace_oracle(scene, [list(place)], [one], rays=300_000, seed=6)
        total = known.flux[: len(CLASS_NAMES), 0].sum(axis=0)
        off = (found.flux.sum(axis=0)[0] - total) / np.hypot(known.standard_error[0], found.standard_error[0])
        assert np.abs(off).max() < 4.0
        direct, error = known.flux[0, 0], known.class_standard_error[0, 0]
        lit = error > 0.0
        assert lit[0, 0]  # across
        assert lit[1, 1]  # from end to end
        rules = np.hypot(error, found.standard_error[0])
        assert np.abs((found.flux[0, 0] - direct)[lit] / rules[lit]).max() < 4.0
