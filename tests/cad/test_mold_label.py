"""A label is cut where it can be read, by formula, and into a mold that is still one closed body."""

import json

import numpy as np
import pytest
import trimesh

from optopad.cad.export import part_files
from optopad.cad.mesh import read_stl
from optopad.cad.mold import build_mold
from optopad.design.errors import DesignError
from optopad.design.mold.label import label_lines, letters, mold_label
from optopad.design.mold.outline import outline_of
from optopad.design.preset import preset
from optopad.design.rules.check import check, require_valid
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from tests.cad.agreement import cavity_agreement
from tests.cad.volumes import mold_volume_mm3

PAIR = preset("piacenza2017-pair")


def labelled(text: str) -> SensorDesign:
    return PAIR.with_(**{"mold.label": text})


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    return part_files(labelled("10.5"))


def test_a_labelled_mold_passes_every_check(files):
    checks = json.loads(files["checks.json"])
    assert checks["ok"]
    assert {finding["state"] for finding in checks["findings"] if "overhang" in finding["name"]} == {"ok"}
    part = trimesh.load_mesh(trimesh.util.wrap_as_stream(files["mold.stl"]), file_type="stl")
    assert part.is_watertight
    assert part.body_count == 1


EVERY_LETTER = "".join(sorted(letters())).strip()


@pytest.mark.parametrize(
    "text",
    [
        EVERY_LETTER[:14],
        pytest.param(EVERY_LETTER[14:28], marks=pytest.mark.slow),
        pytest.param(EVERY_LETTER[28:], marks=pytest.mark.slow),
    ],
)
def test_the_solid_has_the_volume_of_the_formula(text):
    design = labelled(text)
    assert build_mold(design).val().Volume() == pytest.approx(mold_volume_mm3(design), rel=1e-9)


def test_the_label_takes_its_area_times_its_depth_away():
    label = mold_label(labelled("8"))
    taken = mold_volume_mm3(PAIR) - mold_volume_mm3(labelled("8"))
    assert taken == pytest.approx(label.area_mm2 * label.depth_mm, rel=1e-9)


def test_the_cavity_of_a_labelled_mold_is_the_optical_one(files):
    agreement = cavity_agreement(labelled("10.5"), read_stl(files["mold.stl"]))
    assert agreement.worst_mm < 1e-4  # single precision of the file
    assert cavity_of(labelled("10.5")) == cavity_of(PAIR)


def test_the_label_lies_below_the_cavity_clear_of_sockets_and_holes():
    for name in ("piacenza2017-pair", "piacenza2017-pad", "oblong-60x40", "fingertip-16"):
        design = preset(name).with_(**{"mold.label": "8.5"})
        for stroke in outline_of(design).label.strokes:
            assert 0.8 - 1e-6 <= stroke.x0 < stroke.x1 <= design.cavity.length_mm - 0.8 + 1e-6
            assert 0.8 - 1e-6 <= stroke.y0 < stroke.y1 <= design.cavity.width_mm - 0.8 + 1e-6


def test_an_empty_label_leaves_design_and_mold_as_they_were():
    assert labelled("").digest == PAIR.digest
    assert "label" not in PAIR.model_dump(mode="json")["mold"]
    assert labelled("8").digest != PAIR.digest


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mold.label": "much too long for a cavity of 20 mm"}, "shorten the label"),
        ({"mold.label": "8", "mold.floor_mm": 1.3}, "sink a label"),
    ],
)
def test_a_label_that_cannot_be_printed_is_refused(changes, words):
    design = PAIR.with_(**changes)
    assert any(words in str(finding) and finding.severity == "error" for finding in check(design))
    with pytest.raises(DesignError, match=words):
        require_valid(design)


def test_strokes_never_touch_along_an_edge_only(files):
    mesh = read_stl(files["mold.stl"])
    edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert set(uses) == {2}


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("LAB 3 PAD 12", ["LAB 3", "PAD", "12"]),
        ("PAD 12", ["PAD", "12"]),
        ("PAIR 8 MM", ["PAIR", "8 MM"]),
        ("SIZE 9.5/MM + A", ["SIZE", "9.5/M", "M + A"]),  # 9.5/MM on a line of its own is too small to print
        ("8.5", ["8.5"]),
    ],
)
def test_a_label_is_broken_at_blanks_and_within_words_only_where_it_must(text, lines):
    assert label_lines(text, preset("piacenza2017-pair"))[0] == lines
