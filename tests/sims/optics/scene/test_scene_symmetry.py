"""A scene's symmetries: which there are, that they carry pairs onto congruent pairs, and which states they make one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import state_classes, symmetries_of
from optopad.sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm
from tests.oracle.form_scenes import disc_scene, rectangle_form, with_top

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
