"""The mold of a pad whose parts are all on the floor: a frame on their circuit board."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import Any

import pytest
import trimesh

from optopad.cad.checks import VOLUME_LIMIT, design_findings
from optopad.cad.export import export_parts
from optopad.cad.mold import build_mold
from optopad.cad.tools import blade_size, solder_jig
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.preset import FLOOR_PRESETS, preset
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from tests.cad.volumes import lip_volume_mm3
from tests.design.rules.rule_cases import BENCHMARK, about
from tests.design.spec.spec_fields import good, good_disc

BOARD = {"pattern": "checkerboard", "columns": 4, "rows": 4, "pitch_mm": 6.0}
CROWN = {"crown": {"shape": "sphere", "radius_mm": 60.0}, "operating.max_depth_mm": 2.0}


def frame(**changes: Any) -> SensorDesign:
    """A frame around a pad of 32 x 32 mm, 45 x 45 mm outside, on a black layer of 1 mm."""
    black = {"cavity.black_thickness_mm": 1.0, "operating.max_depth_mm": 2.0}
    return good(**({"layout": [BOARD]} | BENCHMARK | black | changes))


def dome(**changes: Any) -> SensorDesign:
    """A frame around a disc of 40 mm, 56 mm outside, with a convex top."""
    board = BOARD | {"columns": 3, "rows": 3}
    return good_disc(layout=[board], **(BENCHMARK | CROWN | {"cavity.black_thickness_mm": 1.0} | changes))


def test_a_frame_stands_on_the_board_without_a_floor() -> None:
    outline = outline_of(frame())
    assert outline.is_frame
    assert outline.bottom_mm == outline.cavity_bottom_mm == -1.0
    assert bed_lift_mm(frame()) == 1.0
    assert (outline.sockets, outline.numbers, outline.collars, outline.filling) == ((), (), (), ())
    assert len(outline.fixing_holes) == 4
    assert not outline_of(good()).is_frame


def test_the_volume_of_a_frame_is_that_of_its_walls() -> None:
    design = frame()
    outline = outline_of(design)
    area = 45.0**2 - 32.0**2 - sum(math.pi * hole.radius**2 for hole in outline.fixing_holes)
    area -= 3 * (1.0 - math.pi / 4) * outline.corner_radius_mm**2 + outline.origin_cut_mm**2 / 2
    by_hand = area * (1.0 + 8.0 + design.mold.rim_mm) - lip_volume_mm3(outline)
    assert build_mold(design).val().Volume() == pytest.approx(by_hand, rel=1e-9)


def test_a_domed_frame_has_passages_below_the_black_layer() -> None:
    design = dome()
    outline = outline_of(design)
    sprue, *vents = outline.passages
    low = min(sprue.size_mm, outline.plan.rim_mm[0])
    assert (sprue.size_mm, [vent.size_mm for vent in vents]) == (low, [low / 2] * 3)
    assert all(
        one.z0 == 0.0 and max(z for _, z in one.section_mm) <= outline.plan.rim_mm[0]
        for one in outline.passages
    )
    plain = math.pi / 4 * (56.0**2 - 40.0**2) - sum(math.pi * hole.radius**2 for hole in outline.fixing_holes)
    taken = plain * outline.height_mm - build_mold(design).val().Volume()
    straight = sum(one.area_mm2 * one.length_mm for one in outline.passages)
    assert taken == pytest.approx(straight, rel=0.01)


@pytest.mark.parametrize("name", FLOOR_PRESETS)
def test_the_presets_on_a_board_have_a_frame_and_no_jig(name: str) -> None:
    outline = outline_of(preset(name))
    assert outline.is_frame
    assert (outline.sockets, outline.numbers, solder_jig(preset(name))) == ((), (), None)
    assert all(one.state == "ok" for one in design_findings(preset(name)))


@pytest.mark.parametrize("design", [frame(), dome()], ids=["flat", "dome"])
def test_the_files_of_a_frame_are_printable(design: SensorDesign, tmp_path: Path) -> None:
    files = export_parts(design, tmp_path)
    checks = json.loads(files["checks.json"].read_text(encoding="utf-8"))
    assert checks["ok"]
    found = {one["name"]: one for one in checks["findings"]}
    assert found["mold: underside that seals on the board, against the design"]["value"] < 1e-3
    assert all(one["state"] == "ok" for name, one in found.items() if not name.startswith("lid"))
    part = trimesh.load_mesh(io.BytesIO(files["mold.stl"].read_bytes()), file_type="stl")
    assert part.bounds[0][2] == 0.0
    assert part.euler_number == (-8 if design.crown is None else -16)
    assert part.volume == pytest.approx(checks["volumes_mm3"]["mold"]["solid"], rel=VOLUME_LIMIT)
    assert "solder_jig.stl" not in files
    assert ("lid.stl" in files) == (design.crown is not None)


def test_a_blade_is_made_only_where_no_body_is_in_its_way() -> None:
    assert blade_size(frame()) is None
    flush = frame(**{"cavity.black_thickness_mm": 1.5})
    size = blade_size(flush)
    assert size is not None
    assert size.reach_mm == 8.0 + flush.mold.rim_mm
    assert solder_jig(flush) is None
    poured_first = blade_size(dome(**{"cavity.black_thickness_mm": 1.5}))
    assert poured_first is not None
    assert poured_first.reach_mm == outline_of(dome()).top_mm


def test_silicone_is_displaced_by_the_bodies() -> None:
    bodies = 8 * 3.0 * 3.0 + 8 * 4.0 * 4.0
    black, clear = cavity_of(frame()).layers_mm3
    assert black == pytest.approx(32.0**2 - bodies)
    assert clear == pytest.approx(8.0 * 32.0**2 - 0.5 * bodies)


def test_air_under_parts_is_reported() -> None:
    single = {"pattern": "single", "kind": "emitter", "wall": "floor", "x_mm": 3.0, "y_mm": 16.0}
    raised, leaning = single | {"height_mm": 1.0}, single | {"tilt_deg": 45.0, "y_mm": 20.0}
    both = frame(layout=[BOARD | {"columns": 2, "rows": 2}, raised, leaning])
    notes = {one.name: one.note for one in design_findings(both) if one.state == "warning"}
    assert notes["mold: parts above a gap to the board"].startswith("E3: air stays under them")
    assert notes["mold: parts that lean over the board"].startswith("E4: air stays under them")


def test_a_frame_has_no_place_for_a_label() -> None:
    finding = about(frame(**{"mold.label": "PAD 1"}), "no floor to engrave")
    assert (finding.severity, finding.field) == ("error", "mold.label")
    assert outline_of(frame(**{"mold.label": "PAD 1"})).label.strokes == ()


def test_a_dome_needs_room_for_its_sprue() -> None:
    assert not [one for one in check(dome()) if one.severity == "error"]
    thin = dome(**{"crown": {"shape": "sphere", "radius_mm": 30.0}, "cavity.clear_thickness_mm": 9.0})
    finding = about(thin, "no room for sprue and vents")
    assert (finding.severity, finding.limit.split(" at the edge")[0]) == ("error", "at least 2.00 mm")
