"""The sheets of a pad on a circuit board: frame, board and pours in place of sockets, wires and mold."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

import pytest

from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.sheets.all_sheets import sheet_texts
from optopad.fabrication.sheets.bom import bom_rows
from optopad.fabrication.sheets.silicone import pours
from tests.design.rules.rule_cases import BENCHMARK
from tests.design.spec.spec_fields import good_disc, with_layout

CHECKERED = {"pattern": "checkerboard", "columns": 4, "rows": 4, "pitch_mm": 6.0}
COUPLERS = {"pattern": "grid", "kind": "coupler", "columns": 3, "rows": 3, "pitch_mm": 8.0, "apart_mm": 2.6}
CHIP = {"emitters.part": "vishay-vcnl4040-emitter", "receivers.part": "vishay-vcnl4040-receiver"}
LAYERS = {"cavity.black_thickness_mm": 1.0, "operating.max_depth_mm": 2.0}


def board(*patterns: dict[str, Any], **changes: Any) -> SensorDesign:
    return with_layout(*(patterns or (CHECKERED,)), **(BENCHMARK | LAYERS | changes))


def dome() -> SensorDesign:
    crown = {"crown": {"shape": "sphere", "radius_mm": 60.0}}
    return good_disc(layout=[CHECKERED | {"columns": 3, "rows": 3}], **(BENCHMARK | LAYERS | crown))


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture(scope="module")
def sheets() -> dict[str, str]:
    return sheet_texts(board())


def test_the_wiring_table_has_positions_on_the_floor(sheets: dict[str, str]) -> None:
    rows = table(sheets["wiring.csv"])
    for row, part in zip(rows, cavity_of(board()).parts, strict=True):
        assert (row["reference"], row["wall"], row["along_mm"]) == (part.name, "floor", "")
        assert (float(row["x_mm"]), float(row["y_mm"])) == pytest.approx(part.position_mm[:2])
    assert "normal = [0.0, 0.0, 1.0]" in sheets["driver.toml"]


def test_the_wiring_drawing_has_each_part_at_its_place(sheets: dict[str, str]) -> None:
    drawing = sheets["wiring.svg"]
    width, height = (float(one) for one in re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', drawing).groups())
    names = re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>([ER]\d+)<', drawing)
    assert {name for _, _, name in names} == {part.name for part in cavity_of(board()).parts}
    at = {name: (float(x), float(y)) for x, y, name in names}
    assert all(0.0 < x < width and 0.0 < y < height for x, y in at.values())
    assert at["R1"][0] - at["E1"][0] == pytest.approx(at["E2"][0] - at["R1"][0], abs=0.02)
    assert at["E1"][1] - at["R3"][1] == pytest.approx(at["R1"][0] - at["E1"][0], abs=0.02)


def test_the_sections_show_the_parts_on_the_board(sheets: dict[str, str]) -> None:
    drawing = sheets["orientation.svg"]
    assert "parts on the circuit board" in drawing
    assert drawing.count("active face looks up, centre 1.5 above the board") == 2


def test_the_sheet_prepares_the_board_and_pours_on_it(sheets: dict[str, str]) -> None:
    sheet = " ".join(sheets["casting.md"].split())
    for said in (
        "residues of solder flux (US patent 5,346,723",
        "primer for silicones, such as DOWSIL 1200 OS*",
        "Mask every connector",
        "stands on the circuit board and stays there",
        f"let {pours(board())[0].net_g:.2f} g flow from a syringe",
        "each of which is 0.50 above it",
        'measured = ["cavity.black_thickness_mm"]',
        "| cavity.black_thickness_mm | 1 | not measured |",
    ):
        assert said in sheet, said
    for absent in ("socket", "solder_jig", "leveling_blade", "wires to surface parts", "Skin:"):
        assert absent not in sheet, absent


def test_a_skin_is_applied_last() -> None:
    top = {"skin": "gelsight-aluminium", "black_outside": True}
    sheet = sheet_texts(board(top=top))["casting.md"]
    assert "Skin: cover the cured top with Aluminium powder in silicone" in sheet
    assert sheet.index("Clear layer: mix") < sheet.index("Skin: cover") < sheet.index("Black coat:")
    assert "Black coat" not in sheet_texts(board(top=top | {"black_outside": False}))["casting.md"]


def test_a_dome_is_filled_through_the_wall_of_its_frame() -> None:
    black, clear = pours(dome())
    assert (black.layer, clear.layer) == ("black", "clear")
    sheet = sheet_texts(dome())["casting.md"]
    assert f"Inject {clear.net_g:.2f} g through the wide passage in the wall of the frame" in sheet
    assert sheet.index("Black layer: mix") < sheet.index("Put the lid on")


def test_silicone_is_weighed_without_the_bodies() -> None:
    black, clear = pours(board())
    volume = 32.0**2 - 8 * 9.0 - 8 * 16.0
    assert black.net_g == pytest.approx(volume / 1000 * 1.03)
    assert clear.net_g == pytest.approx((8.0 * 32.0**2 - 0.5 * (8 * 9.0 + 8 * 16.0)) / 1000 * 1.03)


def test_a_coupler_is_one_line_of_the_bill() -> None:
    rows = {row.item: row for row in bom_rows(board(COUPLERS, **CHIP))}
    (coupler,) = (row for item, row in rows.items() if item.startswith("coupler: "))
    assert (coupler.quantity, coupler.part_number) == (9, "VCNL4040M3OE")
    assert coupler.references == tuple(f"OC{k}" for k in range(1, 10))
    assert coupler.note.startswith("OC1: E1 R1; OC2: E2 R2")
    assert not any(item.startswith("Vishay VCNL4040") for item in rows)
    assert not {"hook-up wire", "pin header, 2.54 mm", "printed solder jig", "printed mold"} & set(rows)
    assert rows["screw with nut"].note == "hold the frame on the circuit board"
    assert rows["printed frame"].note == "cad/mold.stl"
