"""Designs become scenes: options that are absent leave the scene as it was, options that are given fill it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.preset import SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.optics.scene.lower import check_scene, scene_of
from optopad.sims.optics.scene.optical_scene import COSINE_NODES, pattern_power, response_nodes
from optopad.sims.optics.scene.symmetry import state_classes, symmetries_of
from optopad.sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm
from tests.design.parts.own_parts import SHEET, own_part, quantity, with_own_part
from tests.design.spec.spec_fields import good
from tests.oracle.form_scenes import disc_scene, rectangle_form, with_top

SHEET_TABLE = {"angle_deg": [0.0, 30.0, 60.0, 90.0], "relative": [1.0, 0.9, 0.4, 0.0], **SHEET}


@pytest.mark.parametrize("name", ["piacenza2017-pad", "piacenza2017-pair", "oblong-60x40", "fingertip-16"])
def test_presets_have_bare_receivers_cosine_emitters_and_scattering_walls(name):
    scene = scene_of(preset(name))
    assert (scene.emitter_pattern, scene.receiver_response, scene.wall_index) == (None, None, None)


def test_a_pattern_is_lowered_to_unit_power_for_every_emitter():
    scene = scene_of(with_own_part("emitter", angular_pattern=SHEET_TABLE))
    check_scene(scene)
    assert scene.emitter_pattern.shape == (len(scene.emitter_wall), COSINE_NODES)
    assert np.abs(pattern_power(scene.emitter_pattern) - 1).max() < 1e-12


def test_emitters_without_a_pattern_keep_their_order_beside_others():
    base = good().model_dump(mode="json")["layout"]
    more = {"pattern": "single", "kind": "emitter", "wall": "north", "along_mm": 16.0, "part": "mine"}
    parts = {"parts": {"mine": own_part("emitter", angular_pattern=SHEET_TABLE)}}
    scene = scene_of(good(catalog=parts, layout=[*base, more]))
    check_scene(scene)
    by_order = np.isnan(scene.emitter_pattern).all(axis=1)
    assert by_order.tolist() == [True] * (len(by_order) - 1) + [False]


def test_epoxy_on_one_kind_of_receiver_leaves_the_others_bare():
    base = good().model_dump(mode="json")["layout"]
    more = {"pattern": "single", "kind": "receiver", "wall": "north", "along_mm": 16.0, "part": "mine"}
    parts = {"parts": {"mine": own_part("receiver", epoxy_index=quantity(1.53, "1"))}}
    design = good(catalog=parts, layout=[*base, more])
    scene = scene_of(design)
    check_scene(scene)
    assert (scene.receiver_response[:-1] == 1.0).all()
    expected = response_nodes(design.catalog.parts["mine"], scene.refractive_index)
    assert (scene.receiver_response[-1] == expected).all()


@pytest.mark.parametrize(("finish", "index"), [("diffuse", None), ("glossy", 1.54), ("air_gap", 1.0)])
def test_the_finish_sets_the_index_behind_the_walls(finish, index):
    assert scene_of(good(**{"surfaces.wall_finish": finish})).wall_index == index
    check_scene(scene_of(good(**{"surfaces.wall_finish": finish})))


def test_a_spectrum_sets_the_index():
    blue = {"wavelength_nm": [440.0, 460.0], "weight": [1.0, 1.0], **SHEET}
    red = {"wavelength_nm": [620.0, 640.0], "weight": [1.0, 1.0], **SHEET}
    indices = [scene_of(with_own_part("emitter", spectrum=colour)).refractive_index for colour in (blue, red)]
    assert indices[0] - indices[1] == pytest.approx(1.4159 - 1.4055, abs=5e-4)  # 20:1 at 0.45 and 0.63 um


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_a_shaped_pad_has_the_walls_top_and_windows_of_its_cavity(name: str) -> None:
    design = preset(name)
    scene, cavity = scene_of(design), cavity_of(design)
    form = scene.form
    assert form is not None
    walls = np.concatenate([scene.emitter_wall, scene.receiver_wall])
    patches = np.vstack([scene.emitter_patch, scene.receiver_patch])
    for part, wall, patch in zip(cavity.parts, form.walls[walls], patches, strict=True):
        place = wall[:2] + patch[0] * wall[2:4]
        assert (*place, patch[1]) == pytest.approx(part.position_mm)
        assert tuple(wall[4:]) == part.line.outward
    x, y = np.random.default_rng(3).uniform(0.2, 0.8, (2, 50)) * [[scene.length_mm], [scene.width_mm]]
    wanted = [cavity.plan.top_mm(*place) for place in zip(x, y, strict=True)]
    assert form.top.height_mm(x, y) == pytest.approx(wanted)
    normals = [cavity.plan.normal(*place) for place in zip(x, y, strict=True)]
    assert form.top.normal(x, y) == pytest.approx(np.array(normals))


def test_a_window_of_no_wall_of_its_form_is_refused() -> None:
    scene = scene_of(preset("fingertip-dome"))
    check_scene(scene)
    with pytest.raises(InputError, match=r"emitter_wall\[0\]: 40.*form.walls, 0 to 11"):
        check_scene(replace(scene, emitter_wall=np.full(6, 40)))


def test_a_flat_rectangle_has_no_form() -> None:
    assert scene_of(preset("oblong-60x40")).form is None


PAD = preset("piacenza2017-pad")


@pytest.mark.parametrize(
    ("name", "count"),
    [("piacenza2017-pad", 4), ("piacenza2017-pair", 2), ("oblong-60x40", 4)],
)
def test_number_of_symmetries(name, count):
    # alternating ring on a square: quarter turns; facing rows: mirror along the rows;
    # oblong with odd counts on every wall: half turn and both mirrors
    assert len(symmetries_of(scene_of(preset(name)))) == count


def test_the_identity_comes_first():
    first = symmetries_of(scene_of(PAD))[0]
    assert first.emitters.tolist() == list(range(8))
    assert first.receivers.tolist() == list(range(8))
    assert first.image(np.array([3.0, 4.0])).tolist() == [3.0, 4.0]


def test_a_symmetry_keeps_the_distance_of_every_pair():
    cavity = cavity_of(PAD)
    emitters, receivers = (
        np.array([part.position_mm for part in parts]) for parts in (cavity.emitters, cavity.receivers)
    )
    distance = np.linalg.norm(emitters[:, None] - receivers, axis=2)
    for symmetry in symmetries_of(scene_of(PAD)):
        moved = distance[np.ix_(symmetry.emitters, symmetry.receivers)]
        assert moved == pytest.approx(distance, abs=1e-9)


def test_one_more_part_breaks_every_symmetry_but_the_identity():
    document = PAD.model_dump(mode="json")
    document["layout"] += [
        {"pattern": "single", "kind": "emitter", "wall": "south", "along_mm": 15.0, "height_mm": 5.0}
    ]
    assert len(symmetries_of(scene_of(type(PAD).from_document(document, where="test")))) == 1


def test_a_part_of_another_height_or_pattern_breaks_every_symmetry_but_the_identity():
    scene = scene_of(PAD)
    higher, wider = scene.receiver_patch.copy(), scene.emitter_order.copy()
    higher[2, 1] -= 0.01
    wider[5] += 0.01
    assert len(symmetries_of(replace(scene, receiver_patch=higher))) == 1
    assert len(symmetries_of(replace(scene, emitter_order=wider))) == 1


def test_quarter_turns_leave_seven_of_the_map_s_25_places_to_trace():
    """The middle stays where it is; the other 24 places go round in fours."""
    cavity = cavity_of(PAD)
    places = grid_places_mm(cavity.workspace, *map_grid_mm(cavity, COARSE_PLACES))
    classes = state_classes(scene_of(PAD), places[:, None], [[2.0]] * len(places))
    assert len(places) == 25
    assert len(classes.first) == 7


FORMED_PAD = scene_of(preset("piacenza2017-pad"))


def crowned(axis, scene=FORMED_PAD):
    form = rectangle_form(scene.length_mm, scene.width_mm, 60.0, axis)
    return replace(scene, form=form)


@pytest.mark.parametrize(("name", "count"), [("levi2013-disc", 16), ("fingertip-dome", 12)])
def test_facets_in_turn_give_a_disc_turns_and_mirrors(name, count):
    assert len(symmetries_of(scene_of(preset(name)))) == count


def test_a_cylinder_has_no_quarter_turns():
    assert len(symmetries_of(FORMED_PAD)) == 4  # the alternating ring: quarter turns
    assert len(symmetries_of(crowned("none"))) == 4
    assert len(symmetries_of(crowned("x"))) == len(symmetries_of(crowned("y"))) == 2


def test_an_apex_off_the_middle_leaves_the_mirror_through_it():
    scene = scene_of(preset("piacenza2017-pair"))
    form = crowned("none", scene).form
    whole = symmetries_of(replace(scene, form=form))
    moved = symmetries_of(replace(scene, form=with_top(form, apex_mm=(7.0, 8.0))))
    assert len(moved) == 1 < len(whole) + 1


def test_a_facet_that_is_missing_breaks_the_disc():
    scene = disc_scene(8)
    walls = scene.form.walls.copy()
    walls[7, :2] += 0.05 * walls[7, 4:6]
    broken = replace(scene, form=replace(scene.form, walls=walls))
    # 4 emitters and 4 receivers in turn on 8 facets; the moved facet's own mirror is left
    assert len(symmetries_of(scene)) == 8
    assert len(symmetries_of(broken)) == 2


def test_a_symmetry_carries_walls_onto_walls_and_keeps_the_distance_of_every_pair():
    scene = scene_of(preset("fingertip-dome"))
    form = scene.form

    def places(walls, patches):
        rows = form.walls[walls]
        return rows[:, :2] + patches[:, :1] * rows[:, 2:4]

    emitters = places(scene.emitter_wall, scene.emitter_patch)
    receivers = places(scene.receiver_wall, scene.receiver_patch)
    distance = np.linalg.norm(emitters[:, None] - receivers, axis=2)
    for motion in symmetries_of(scene):
        assert motion.image(np.array(form.top.apex_mm)) == pytest.approx(form.top.apex_mm)
        assert motion.image(emitters) == pytest.approx(emitters[motion.emitters])
        assert motion.image(receivers) == pytest.approx(receivers[motion.receivers])
        assert distance[np.ix_(motion.emitters, motion.receivers)] == pytest.approx(distance)
