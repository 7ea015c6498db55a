"""Every printed part of every preset against its record, and its files against themselves."""

import io
import json
import re
import zipfile

import pytest
import trimesh

from optopad.design.preset import FLAT_PRESETS, SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from tests.cad.golden_parts import RECORDED

MOLDS = FLAT_PRESETS + SHAPED_PRESETS
MM3 = 1e-3  # the record's own rounding, with room for another version of the kernel
MM = 2e-3  # the same, for lengths


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "piacenza2017-pair" else pytest.mark.slow) for name in MOLDS],
)
def test_volume_size_and_holes_are_those_on_record(name, built_of):
    files = built_of(name).files
    volumes = json.loads(files["checks.json"])["volumes_mm3"]
    assert set(volumes) == set(RECORDED[name])
    for part, (volume_mm3, size_mm, holes) in RECORDED[name].items():
        mesh = trimesh.load_mesh(io.BytesIO(files[f"{part}.stl"]), file_type="stl")
        assert volumes[part]["solid"] == pytest.approx(volume_mm3, abs=MM3), part
        assert mesh.extents == pytest.approx(size_mm, abs=MM), part
        assert (2 - mesh.euler_number) // 2 == holes, part


@pytest.mark.parametrize("name", MOLDS)
def test_a_mold_s_holes_are_its_fixing_lead_and_filling_holes(name):
    design = preset(name)
    leads = sum(p.part.lead_count for p in cavity_of(design).parts if p.part.mounting == "radial")
    filling = 4 if design.crown is not None else 0
    assert RECORDED[name]["mold"][2] == 4 + leads + filling


def test_step_and_3mf_hold_no_time_and_no_counter(built_of):
    files = built_of("piacenza2017-pair").files
    text = files["mold.step"].decode()
    assert re.findall(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", text) == ["1970-01-01T00:00:00"]
    assert "Open CASCADE STEP translator" not in text
    times = {entry.date_time for entry in zipfile.ZipFile(io.BytesIO(files["mold.3mf"])).infolist()}
    assert times == {(1980, 1, 1, 0, 0, 0)}
