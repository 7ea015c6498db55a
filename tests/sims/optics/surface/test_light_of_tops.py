"""Height fields, tables, smooth walls, symmetry and wanted errors in the engine."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.optics.engine.trace_states import CLASS_NAMES, trace_scene
from optopad.sims.optics.scene.optical_scene import lambertian_pattern, smooth_field
from optopad.sims.optics.scene.symmetry import symmetries_of
from tests.oracle.oracle_scenes import ring_scene, scene_of
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.sims.optics.form_factors import parallel_factor
from tests.sims.optics.surface.analytic import compact_dimple

DIRECT, TOP, SKIRT, WALL, DIFFUSE = range(5)
SCENE = ring_scene()
DIMPLE = compact_dimple(2.0)
PLACE = np.array([[11.0, 13.5]])


def light(scene=SCENE, places=PLACE, pressed=(DIMPLE,), **settings):
    return trace_scene(scene, places, list(pressed), **settings)


@pytest.mark.slow
def test_a_field_of_zeros_changes_nothing_but_the_route():
    flat = smooth_field(lambda x, y: np.zeros(np.broadcast_shapes(x.shape, y.shape)), 32.0, 32.0, 1.0)
    plain, with_field = light(accuracy="fine"), light(fields=[flat], accuracy="fine")
    scale = light(pressed=[None]).flux.sum(axis=0)
    assert with_field.flux[DIRECT] == pytest.approx(plain.flux[DIRECT], rel=1e-9)
    assert with_field.flux.sum(axis=0) == pytest.approx(plain.flux.sum(axis=0), abs=1e-3 * scale.max())


@pytest.mark.slow
def test_a_lifted_top_is_a_thicker_layer():
    """The field lifts the whole top by 0.3 mm: mirrored light is that of a layer of 8.3 mm."""
    lift = smooth_field(lambda x, y: np.full(np.broadcast_shapes(x.shape, y.shape), 0.3), 32.0, 32.0, 2.0)
    raw = light(
        pressed=[None], fields=[lift], accuracy="reference"
    )  # faint images get coarse lattices otherwise
    thicker = trace_scene(replace(SCENE, height_mm=8.3), PLACE, [None])
    across = SCENE.emitter_wall[:, None] != SCENE.receiver_wall
    mirrored = (raw.flux[TOP] + raw.flux[SKIRT])[0][across]
    assert mirrored == pytest.approx(
        thicker.flux[TOP, 0][across], rel=3e-3
    )  # paths near a corner are cut by the grid's end


def test_a_table_of_a_lambertian_emitter_is_the_order_one_emitter():
    table = np.tile(lambertian_pattern(1.0), (8, 1))
    by_order, by_table = light(), light(replace(SCENE, emitter_pattern=table))
    assert by_table.flux[DIRECT] == pytest.approx(by_order.flux[DIRECT], rel=1e-9)
    assert by_table.flux.sum(axis=0) == pytest.approx(by_order.flux.sum(axis=0), rel=1e-3)


def test_a_response_of_one_half_halves_all_light():
    half = light(replace(SCENE, receiver_response=np.full((8, 5), 0.5)))
    assert half.flux.sum(axis=0) == pytest.approx(0.5 * light().flux.sum(axis=0), rel=2e-3)


@pytest.mark.slow
def test_an_air_gap_mirrors_a_facing_pair_in_the_walls_beside_it():
    """Facing patches 4 mm apart in a block 40 mm wide and deep: one wall, 1 mm beside them, is near.

    Its image is seen at grazing angles beyond the critical one, so all of that light comes; no other is near.
    """
    scene = scene_of(
        [(0, 1.0, 20.0, 0.25, 0.25)], [(2, 1.0, 20.0, 0.25, 0.25)], length_mm=40.0, width_mm=4.0, height_mm=40.0,
        wall_reflectance=0.0, bottom_reflectance=0.0, wall_index=1.0,
    )  # fmt: skip
    settings = replace(ACCURACIES["standard"], reference_rays=2**20)
    raw = trace_scene(scene, np.zeros((1, 2)), [None], accuracy=settings)
    height = np.array([19.75, 20.25])
    image = parallel_factor(np.array([0.75, 1.25]), height, height, np.array([-1.25, -0.75]), 4.0)
    assert raw.flux[WALL, 0, 0, 0] == pytest.approx(image, rel=0.06)  # 3300 of 2^20 rays: 3 standard errors


@pytest.mark.slow
@pytest.mark.parametrize("wall_index", [None, 1.0])
def test_symmetric_presses_are_traced_once_and_come_back_renumbered(wall_index):
    scene = replace(SCENE, wall_index=wall_index)
    motions = symmetries_of(scene)
    places = np.concatenate([motion.image(PLACE) for motion in motions])
    raw = trace_scene(scene, places, [DIMPLE] * len(motions))
    for state, motion in enumerate(motions):
        moved = raw.flux[:, state][:, motion.emitters][:, :, motion.receivers]
        assert (moved == raw.flux[:, 0]).all()
    alone = trace_scene(scene, places[-1:], [DIMPLE])
    spread = 5 * np.hypot(alone.standard_error[0], raw.standard_error[-1]).max() + 1e-6
    assert alone.flux[:, 0].sum(axis=0) == pytest.approx(raw.flux[:, -1].sum(axis=0), abs=spread)


def test_the_ring_has_its_turns_and_diagonal_mirrors_or_none_once_a_part_moves():
    assert len(symmetries_of(SCENE)) >= 4
    patch = SCENE.emitter_patch.copy()
    patch[3, 1] += 0.1
    assert len(symmetries_of(replace(SCENE, emitter_patch=patch))) == 1


def test_a_wanted_error_is_met_or_said_not_to_be():
    easy = light(accuracy=0.05)
    assert easy.is_met.all()
    assert easy.relative_error.max() <= 0.05
    untouched = light(pressed=[None], accuracy=1e-9)
    assert untouched.is_met.all()


@pytest.mark.slow
def test_an_impossible_wanted_error_is_said_not_to_be_met():
    impossible = light(accuracy=1e-9)
    assert not impossible.is_met.any()
    assert impossible.relative_error.max() > 1e-9


@pytest.mark.full
def test_light_between_air_gap_walls_is_the_oracles():
    """Sums over pairs; both count hits, the engine's own wall light to 1.5 %, the oracle's to half a per cent."""
    scene = replace(SCENE, wall_index=1.0)
    raw = trace_scene(scene, PLACE, [DIMPLE])
    oracle = trace_oracle(scene, PLACE, [DIMPLE], rays=1_000_000, seed=3)
    for name in ("wall", "diffuse"):
        fast, slow = raw.flux[CLASS_NAMES.index(name)].sum(), oracle.flux[CLASSES.index(name)].sum()
        assert fast == pytest.approx(slow, rel=0.04)


def test_classes_have_their_names():
    assert CLASS_NAMES == ("direct", "top", "skirt", "wall", "diffuse")
    assert light().flux[WALL].max() == 0.0
