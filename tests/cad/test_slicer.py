"""What PrusaSlicer says of sound and of broken parts; these tests skip where it is not installed."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh

from optopad.cad import slicer
from optopad.cad.checks import PartFile, check_parts, with_slices
from optopad.cad.export import export_parts, part_files
from optopad.cad.slicer import minutes_of, sliced, slicer_command
from optopad.design.errors import InputError
from optopad.design.preset import preset
from tests.cad.volumes import mold_volume_mm3

PAIR = preset("piacenza2017-pair")
BED = (250.0, 210.0, 210.0)
needs_slicer = pytest.mark.skipif(slicer_command() is None, reason="PrusaSlicer is not installed")


def stl_of(*boxes: tuple[tuple[float, float, float], tuple[float, float, float]], drop: int = 0) -> bytes:
    """Boxes (size, low corner) as one STL, without its first triangles."""
    meshes = []
    for size, corner in boxes:
        mesh = trimesh.creation.box(size)
        mesh.apply_translation(np.array(corner) + np.array(size) / 2)
        meshes.append(mesh)
    whole = trimesh.util.concatenate(meshes)
    whole.update_faces(np.arange(len(whole.faces)) >= drop)
    stream = io.BytesIO()
    whole.export(stream, file_type="stl")
    return stream.getvalue()


def findings_of(stl: bytes, solid_mm3: float) -> dict[str, tuple[float, str]]:
    part = PartFile(name="box", stl=stl, solid_mm3=solid_mm3)
    checks = with_slices(check_parts(PAIR, ()), PAIR, (part,), BED)
    return {one.name: (one.value, one.state) for one in checks.findings if one.name.startswith("box: ")}


@needs_slicer
def test_a_sound_box_is_sliced_with_its_volume_time_and_filament() -> None:
    one = sliced(stl_of(((20, 20, 10), (0, 0, 0))), density_g_per_cm3=1.04, bed_mm=BED)
    assert one.is_manifold
    assert one.volume_mm3 == pytest.approx(4000, rel=1e-6)
    assert one.extruded_mm3 == pytest.approx(4000, rel=0.03)  # lines of a finite width at the faces
    assert 0.2 * 4 * 1.04 < one.filament_g < 4 * 1.04  # between a fifth and all of it
    assert 5 < one.minutes < 60
    assert one.warnings == ()


@needs_slicer
def test_a_floating_body_is_a_warning_in_the_slicers_words() -> None:
    found = findings_of(stl_of(((10, 10, 5), (0, 0, 0)), ((3, 3, 3), (4, 4, 20))), 527.0)
    assert found["box: warnings of the slicer"] == (1, "warning")


@needs_slicer
def test_a_missing_triangle_that_the_slicer_mends_in_silence_shows_in_its_volume() -> None:
    found = findings_of(stl_of(((10, 10, 5), (0, 0, 0)), drop=1), 500.0)
    assert found["box: volume in the slicer against the solid"][1] == "error"


@needs_slicer
def test_a_wall_that_no_nozzle_makes_is_not_extruded_with_its_volume() -> None:
    found = findings_of(stl_of(((20, 0.2, 10), (0, 0, 0))), 40.0)
    assert found["box: extruded by a solid print"][1] == "warning"


@needs_slicer
@pytest.mark.slow
def test_the_smallest_preset_s_mold_slices_without_a_warning() -> None:
    design = preset("fingertip-16")
    stl, volume = part_files(design)["mold.stl"], mold_volume_mm3(design)
    mold = PartFile(name="mold", stl=stl, solid_mm3=volume)
    checks = with_slices(check_parts(design, (mold,)), design, (mold,), BED)
    assert [row for row in checks.findings if row.state != "ok"] == []
    assert 10 < checks.prints["mold"]["minutes"] < 120
    assert 0.2 * volume / 1e3 * 1.04 < checks.prints["mold"]["filament_g"] < volume / 1e3 * 1.04


@pytest.mark.slow
def test_without_a_slicer_nothing_is_written(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(slicer, "COMMANDS", ("no-such-slicer",))
    with pytest.raises(InputError, match="--slice: PrusaSlicer"):
        export_parts(PAIR, tmp_path / "cad", slice_parts=True)
    assert not (tmp_path / "cad").exists()


def test_durations_are_read_as_the_slicer_writes_them() -> None:
    assert minutes_of("1h 46m 59s") == pytest.approx(106 + 59 / 60)
    assert minutes_of("1d 2h 3m 4s") == pytest.approx(1440 + 123 + 4 / 60)
