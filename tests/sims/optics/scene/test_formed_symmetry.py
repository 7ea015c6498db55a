"""Symmetries of discs and crowned pads: which there are, and that they keep walls, crown and pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import symmetries_of
from tests.oracle.form_scenes import disc_scene, rectangle_form, with_top

PAD = scene_of(preset("piacenza2017-pad"))


def crowned(axis, scene=PAD):
    form = rectangle_form(scene.length_mm, scene.width_mm, 60.0, axis)
    return replace(scene, form=form)


@pytest.mark.parametrize(("name", "count"), [("levi2013-disc", 16), ("fingertip-dome", 12)])
def test_facets_in_turn_give_a_disc_turns_and_mirrors(name, count):
    assert len(symmetries_of(scene_of(preset(name)))) == count


def test_a_cylinder_has_no_quarter_turns():
    assert len(symmetries_of(PAD)) == 4  # the alternating ring: quarter turns
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
