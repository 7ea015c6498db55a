"""A layout's symmetries: which there are, and that they carry pairs onto congruent pairs."""

import math

import pytest

from design.cavity import cavity_of
from design.preset import preset
from design.symmetry import symmetries


@pytest.mark.parametrize(
    ("name", "count"),
    [("piacenza2017-pad", 4), ("piacenza2017-pair", 2), ("oblong-60x40", 4)],
)
def test_number_of_symmetries(name, count):
    # alternating ring on a square: quarter turns; facing rows: mirror along the rows;
    # oblong with odd counts on every wall: half turn and both mirrors
    assert len(symmetries(cavity_of(preset(name)))) == count


def test_the_identity_comes_first():
    first = symmetries(cavity_of(preset("piacenza2017-pad")))[0]
    assert first.emitters == tuple(range(8))
    assert first.receivers == tuple(range(8))


def test_a_symmetry_keeps_the_distance_of_every_pair():
    cavity = cavity_of(preset("piacenza2017-pad"))

    def distance(i, j):
        return math.dist(
            cavity.emitters[i].position_mm(cavity.length_mm, cavity.width_mm),
            cavity.receivers[j].position_mm(cavity.length_mm, cavity.width_mm),
        )

    for symmetry in symmetries(cavity):
        for i in range(8):
            for j in range(8):
                assert distance(*symmetry.pair((i, j))) == pytest.approx(distance(i, j), abs=1e-9)


def test_one_moved_part_breaks_every_symmetry_but_the_identity():
    document = preset("piacenza2017-pad").model_dump(mode="json")
    document["layout"] += [
        {"pattern": "single", "kind": "emitter", "wall": "south", "along_mm": 15.0, "height_mm": 5.0}
    ]
    cavity = cavity_of(type(preset("piacenza2017-pad")).from_document(document, where="test"))
    assert len(symmetries(cavity)) == 1
