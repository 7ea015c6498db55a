"""A scene's symmetries: which there are, that they carry pairs onto congruent pairs, and which states they make one."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import state_classes, symmetries_of
from optopad.sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm

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
