"""The checks see what is wrong with a file, and the picture shows the part."""

import json

import numpy as np
import pytest

from optopad.cad.checks import PartFile, check_parts, design_findings, overhang_area_mm2
from optopad.cad.mesh import Mesh, stl_bytes
from optopad.design.preset import preset
from tests.cad.agreement import cavity_agreement
from tests.cad.volumes import mold_volume_mm3

PAIR = preset("piacenza2017-pair")
CUBE_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float32)
CUBE_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def cube(lift=0.0, drop=0):
    triangles = [row for a, b, c, d in CUBE_QUADS for row in ((a, b, c), (a, c, d))]
    corners = CUBE_CORNERS + np.array([0, 0, lift], dtype=np.float32)
    return Mesh(vertices=corners, triangles=np.array(triangles[drop:], dtype=np.int64))


def joined(one, other):
    return Mesh(
        vertices=np.concatenate([one.vertices, other.vertices]),
        triangles=np.concatenate([one.triangles, other.triangles + len(one.vertices)]),
    )


def findings_of(mesh, solid_mm3=1.0, **options):
    part = PartFile(name="cube", stl=stl_bytes(mesh), solid_mm3=solid_mm3)
    checks = check_parts(PAIR, (part,), **options)
    return checks, {finding.name: finding for finding in checks.findings}


def test_a_sound_cube_passes():
    checks, found = findings_of(cube())
    assert checks.is_ok
    assert found["cube: bodies"].value == 1
    assert found["cube: volume of the file against the solid"].value == 0.0


def test_a_missing_triangle_is_an_error():
    checks, found = findings_of(cube(drop=1))
    assert not checks.is_ok
    assert found["cube: watertight"].state == "error"
    assert found["cube: manifold"].state == "error"
    assert found["cube: manifold"].note == "NotManifold"


def test_a_turned_triangle_is_an_error():
    mesh = cube()
    mesh.triangles[0] = mesh.triangles[0][::-1]
    assert findings_of(mesh)[1]["cube: consistent winding"].state == "error"


def test_a_floating_body_is_an_error():
    found = findings_of(joined(cube(), cube(lift=2.0)), solid_mm3=2.0)[1]
    assert found["cube: bodies"].value == 2
    assert found["cube: bodies"].state == "error"


def test_a_volume_two_thousandths_off_is_an_error():
    found = findings_of(cube(), solid_mm3=1.002)[1]
    assert found["cube: volume of the file against the solid"].state == "error"


def test_overhang_is_the_area_that_hangs():
    assert overhang_area_mm2(cube()) == 0.0
    assert overhang_area_mm2(joined(cube(), cube(lift=2.0))) == pytest.approx(1.0)


def test_a_part_larger_than_the_bed_is_a_warning():
    checks, found = findings_of(cube(), bed_mm=(0.5, 2.0, 2.0))
    assert found["cube: print bed"].state == "warning"
    assert checks.is_ok


def test_a_mold_that_is_not_the_designs_cavity_shows_in_rays_from_inside(pair):
    thicker = pair.design.with_(**{"cavity.length_mm": 31.5})
    assert cavity_agreement(thicker, pair.mold).worst_mm >= 0.5


def test_checks_file_says_ok_and_whose_it_is(built):
    checks = json.loads(built.files["checks.json"])
    assert checks["ok"] is True
    assert checks["digest"] == built.design.digest
    assert set(checks["volumes_mm3"]) == {
        "mold",
        "indenter_tip",
        "leveling_blade",
        "pour_gauge",
        "solder_jig",
    }
    for row in checks["findings"]:
        assert set(row) == {"name", "value", "limit", "unit", "state", "note"}
        assert row["state"] in {"ok", "warning", "error"}


def test_bodies_above_the_rim_are_a_warning_with_names():
    found = {row.name: row for row in design_findings(PAIR.with_(**{"mold.rim_mm": 0.5}))}
    tall = found["mold: bodies above the rim"]
    assert (tall.value, tall.state) == (3, "warning")
    assert tall.note.startswith("R1, R2, R3:")


def test_a_hole_in_the_mold_is_an_error_not_a_crash(pair):
    mesh = pair.mold
    keep = ~((mesh.corners[:, :, 2].max(axis=1) < 3.001) & (mesh.corners[:, :, 2].min(axis=1) > 2.999))
    holed = Mesh(vertices=mesh.vertices, triangles=mesh.triangles[keep])
    volume = mold_volume_mm3(pair.design)
    part = PartFile(name="mold", stl=stl_bytes(holed), solid_mm3=volume)
    checks = check_parts(pair.design, (part,))
    found = {finding.name: finding for finding in checks.findings}
    assert found["mold: watertight"].state == "error"
    json.dumps(checks.as_dict(), allow_nan=False)
