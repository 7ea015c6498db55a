"""Wiring table, wiring drawing, build sheet, and the writing of them all."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError
from markupsafe import Markup

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import emitter_switch, supply_current
from optopad.design.parts.assumptions import assumption, ohm_text
from optopad.design.preset import PRESETS, SHAPED_PRESETS, WALL_PRESETS, preset
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import part_of
from optopad.fabrication.driver_file import load_driver_config
from optopad.fabrication.gain import SimulatedGain
from optopad.fabrication.sheets import all_sheets as sheets
from optopad.fabrication.sheets.all_sheets import sheet_texts, wiring_csv, write_sheets
from optopad.fabrication.sheets.bom import NO_PRICE, NOT_BOUGHT, bom_csv, bom_rows
from optopad.fabrication.sheets.casting import casting_md
from optopad.fabrication.sheets.schematic_svg import schematic_svg
from optopad.fabrication.sheets.silicone import pours
from optopad.fabrication.sheets.template import filled, plain, templates
from optopad.fabrication.sheets.wiring_svg import wiring_svg
from tests.said import says

PAD = preset("piacenza2017-pad")
SVG = "{http://www.w3.org/2000/svg}"


def crowded(per_side: list[int], length_mm: float, width_mm: float) -> SensorDesign:
    """An alternating ring on a board with inputs enough."""
    board = Circuit.of(PAD).board.model_dump(mode="json") | {"analog_channels": [f"A{k}" for k in range(64)]}
    design = PAD.with_(catalog={"boards": {"roomy": board}})
    return design.with_(
        **{
            "board.kind": "roomy",
            "cavity.length_mm": length_mm,
            "cavity.width_mm": width_mm,
            "mold.outer_length_mm": length_mm + 13,
            "mold.outer_width_mm": width_mm + 13,
            "layout": [{"pattern": "alternating_ring", "parts_per_side": per_side}],
        }
    )


DESIGNS = [*map(preset, PRESETS), crowded([14, 10, 14, 10], 90.0, 64.0)]


def table_of(design: SensorDesign) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(wiring_csv(design))))


def texts_of(design: SensorDesign) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(wiring_svg(design)).iter(f"{SVG}text"))


@pytest.mark.parametrize("design", DESIGNS, ids=lambda design: f"{design.name}-{design.digest[:4]}")
def test_the_wiring_table_has_every_part_with_its_own_pin_and_number(design: SensorDesign) -> None:
    cavity, circuit = cavity_of(design), Circuit.of(design)
    table = table_of(design)
    assert [row["reference"] for row in table] == [part.name for part in cavity.parts]
    assert [row["pin"] for row in table] == [path.pin for path in (*circuit.emitters, *circuit.receivers)]
    assert len({row["pin"] for row in table}) == len(table)
    lit = [row for row in table if row["kind"] == "emitter"]
    assert [row["state"] for row in lit] == [str(k) for k in range(len(lit))]
    assert [row["column"] for row in table[len(lit) :]] == [str(k) for k in range(len(table) - len(lit))]


@pytest.mark.parametrize("design", DESIGNS, ids=lambda design: f"{design.name}-{design.digest[:4]}")
def test_the_wiring_table_has_the_cavity_s_places(design: SensorDesign) -> None:
    for row, part in zip(table_of(design), cavity_of(design).parts, strict=True):
        assert row["wall"] == part.wall
        if not part.is_on_floor:
            assert float(row["along_mm"]) == pytest.approx(part.along_mm, abs=5e-5)  # written to 0.1 um
        assert float(row["height_mm"]) == pytest.approx(part.height_mm, abs=5e-5)


@pytest.mark.parametrize("design", DESIGNS, ids=lambda design: f"{design.name}-{design.digest[:4]}")
def test_the_drawing_names_every_part_and_pin_once(design: SensorDesign) -> None:
    shown = [element.text for element in texts_of(design)]
    for row in table_of(design):
        assert shown.count(row["reference"]) == 1
        assert shown.count(row["pin"]) == 1


def test_the_drawing_is_true_to_scale() -> None:
    root = ElementTree.fromstring(wiring_svg(PAD))
    widths = [float(r.attrib["width"]) for r in root.iter(f"{SVG}rect") if r.attrib["fill"] == "#f4f9ff"]
    assert max(widths) == pytest.approx(640)  # the cavity, 32 mm
    bodies = [r for r in root.iter(f"{SVG}rect") if r.attrib.get("stroke-width") == "1.5"]
    sizes = {tuple(sorted((float(r.attrib["width"]) / 20, float(r.attrib["height"]) / 20))) for r in bodies}
    assert sizes == {(1.9, 3.5), (4.1, 5.1)}


def test_a_description_cannot_break_the_drawing_or_the_sheet() -> None:
    entry = {"title": "</text><script>&\x00\x0b", "manufacturer": "x"}
    part = part_of(PAD, "osram-sfh206k", "receiver").model_dump(mode="json") | entry
    design = PAD.with_(catalog={"parts": {"osram-sfh206k": part}}, description="</svg>\n# <b>|`")
    root = ElementTree.fromstring(wiring_svg(design))
    assert any("</text><script>&" in (element.text or "") for element in root.iter(f"{SVG}text"))
    assert [element.tag for element in root.iter() if "script" in element.tag] == []
    assert "<b>" not in casting_md(design)


def test_a_part_with_a_third_lead_says_so() -> None:
    part = part_of(PAD, "osram-sfh206k", "receiver").model_dump(mode="json") | {"lead_count": 3}
    design = PAD.with_(catalog={"parts": {"osram-sfh206k": part}})
    notes = {row["kind"]: row["polarity"] for row in table_of(design)}
    assert "3 leads" in notes["receiver"]
    assert "data sheet" not in notes["emitter"]


@pytest.mark.parametrize("name", WALL_PRESETS)
def test_the_build_sheet_has_the_design_s_own_numbers(name: str) -> None:
    design = preset(name)
    sheet, plan = casting_md(design), cavity_of(design).plan
    net = plan.clear_volume_mm3 / 1000 * 1.03
    ratio = design.elastomer.mixing_ratio
    agent = max(math.ceil(net * 1.25 / (ratio + 1) * 100) / 100, 0.2)  # a scale of 0.01 g, 5 % error at most
    clear = f"{net:.2f} | {net * 1.25:.2f} | {agent * (ratio + 1):.2f} | {agent * ratio:.2f} | {agent:.2f}"
    assert clear in sheet
    assert design.digest in sheet
    for part in cavity_of(design).parts:
        assert re.search(rf"\b{part.name}\b", sheet)


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_the_build_sheet_of_a_crown_casts_it_on_its_lid(name: str) -> None:
    design = preset(name)
    sheet, items = casting_md(design), {row.item for row in bom_rows(design, None)}
    plan = plan_of(design)
    is_crowned = not plan.top.is_flat
    assert ("`cad/lid.stl`" in sheet, "Set the mold" in sheet, "printed lid" in items) == (is_crowned,) * 3
    assert ("leveling blade" in sheet, "printed leveling blade" in items) == (not is_crowned,) * 2
    assert ("across, cavity" in sheet) == any(one.is_diameter for one in plan.outline.dimensions)


def test_every_unverified_number_of_the_build_sheet_is_marked() -> None:
    sheet = casting_md(PAD)
    assert "1.03* g/cm3" in sheet
    assert "25%*" in sheet
    assert "| 25 | 48 h* | unverified |" in sheet
    assert "| osram-sfh206k | active_height_in_body_mm | 3.45 | unverified | yes |" in sheet


def test_a_measured_value_need_not_be_measured_again() -> None:
    design = PAD.with_(
        part_measurements={"osram-sfh206k": {"active_height_in_body_mm": 3.4}},
        measured=["receivers.height_mm"],
    )
    sheet = casting_md(design)
    assert "| osram-sfh206k | active_height_in_body_mm | 3.4 | measured |  |" in sheet
    assert "| receivers.height_mm | 6 | measured |" in sheet
    assert "| emitters.height_mm | 5 | not measured |" in sheet


def test_a_blade_that_cannot_pass_is_not_asked_for() -> None:
    assert "leveling blade" in casting_md(PAD)
    low = casting_md(PAD.with_(**{"mold.rim_mm": 0.5}))
    assert "R1 R2 R3 R4 R5 R6 R7 R8 protrude above the rim" in low
    assert "Rest the leveling blade" not in low


def test_too_little_curing_agent_for_the_scale_is_said_with_the_batch_that_is_enough() -> None:
    # 1.05 g x 1.25 / 21 = 0.063 g of agent: 0.01 g is 16 % of it; 5 % needs 0.2 g, thus a batch of 4.2 g
    assert says(casting_md(PAD), "4.20 g ... 1.32 g")
    thick = casting_md(PAD.with_(**{"cavity.black_thickness_mm": 5.0}))
    assert "little for" not in thick


@given(st.text(max_size=60))
def test_plain_text_stays_on_one_line_and_is_no_markup(text: str) -> None:
    shown = plain(text)
    assert "\n" not in shown
    assert "<" not in shown
    assert not re.search(r"(?<!\\)[`*_\[\]#|]", shown.replace("\\\\", ""))


def gain_of(design: SensorDesign) -> SimulatedGain:
    emitters, receivers = len(cavity_of(design).emitters), len(cavity_of(design).receivers)
    return SimulatedGain(counts_per_flux=(1e5,) * receivers, untouched_flux=((3e-3,) * receivers,) * emitters)


@pytest.mark.parametrize("design", DESIGNS[::3], ids=lambda design: f"{design.name}-{design.digest[:4]}")
def test_all_sheets_are_written_and_the_configuration_loads(design: SensorDesign, tmp_path: Path) -> None:
    files = write_sheets(design, tmp_path, gain_of(design))
    assert sorted(files) == [
        "bom.csv",
        "casting.md",
        "driver.toml",
        "orientation.svg",
        "schematic.svg",
        "wiring.csv",
        "wiring.svg",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)
    assert load_driver_config(files["driver.toml"], digest=design.digest).gain.counts_per_flux == 1e5
    assert b"\r" not in files["bom.csv"].read_bytes() + files["wiring.csv"].read_bytes()


def test_sheets_are_the_same_every_time() -> None:
    assert sheet_texts(PAD) == sheet_texts(preset("piacenza2017-pad"))


def test_nothing_is_written_when_a_sheet_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> NoReturn:
        raise RuntimeError

    monkeypatch.setattr(sheets, "casting_md", broken)
    with pytest.raises(RuntimeError):
        write_sheets(PAD, tmp_path)
    assert list(tmp_path.iterdir()) == []


GAIN = SimulatedGain(counts_per_flux=(1e6,) * 8, untouched_flux=((3e-4,) * 8,) * 8)


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize("name", PRESETS)
def test_every_part_is_on_the_schematic_with_its_pin_and_designators(name: str) -> None:
    design = preset(name)
    circuit = Circuit.of(design)
    shown = texts(schematic_svg(design))
    for part, pin in zip(circuit.cavity.emitters, circuit.emitters, strict=True):
        switch = (
            {f"{part.name}-{mark}" for mark in ("RB", "RS", "Q")} if circuit.led_driver is None else set()
        )
        assert {part.name, pin.pin} | switch <= set(shown)
    for part, channel in zip(circuit.cavity.receivers, circuit.receivers, strict=True):
        assert {part.name, channel.pin, f"{part.name}-A"} <= set(shown)
        assert f"{part.name}-RF set by gain" in shown


def test_schematic_and_bill_have_the_same_values() -> None:
    shown = texts(schematic_svg(PAD, GAIN))
    bill = {row.item: row.value for row in bom_rows(PAD, GAIN)}
    assert shown.count(bill["series resistor"]) == shown.count(bill["base resistor"]) == 8
    assert f"R8-RF {bill['feedback resistor']}" in shown
    assert f"R8-CF {bill['feedback capacitor']}" in shown


def test_the_supply_gives_one_lit_emitter_its_base_the_amplifiers_and_the_board() -> None:
    switch = emitter_switch(part_of(PAD, "sunled-xscwd23mb", "emitter"), Circuit.of(PAD).board)
    current = supply_current(Circuit.of(PAD))
    assert current.emitter_ma == pytest.approx(2.3 / 120 * 1e3 + (5.0 - 0.7) / 2000 * 1e3)
    assert ohm_text(switch.base_ohm) == "2 kohm"
    rest = 8 * assumption("amplifier_supply_ma").value + assumption("board_supply_ma").value
    assert current.full_power_ma == pytest.approx(current.emitter_ma + rest)
    assert current.fault_ma == pytest.approx(8 * current.emitter_ma + rest)
    known = supply_current(Circuit.of(PAD), "mcp604")
    assert known.amplifiers_ma == pytest.approx(2 * 4 * 0.23)
    assert "the amplifiers (8*)" in casting_md(PAD)
    named = PAD.with_(**{"board.amplifier": "mcp604"})
    assert "the amplifiers (1.8)" in casting_md(named)


def test_carbon_black_is_a_share_of_the_black_layer_alone() -> None:
    black, clear = pours(PAD)
    assert black.carbon_g == pytest.approx(black.mixed_g * assumption("carbon_black_share").value)
    assert clear.carbon_g == 0.0


def test_a_price_without_a_source_is_blank_and_said_so() -> None:
    lines = bom_csv(bom_rows(PAD)).splitlines()[1:]
    assert all(f",,,{NO_PRICE}," in line or f",,,{NOT_BOUGHT}," in line for line in lines)


def test_the_sheet_has_the_resistors_of_the_bill_and_the_supply_s_current() -> None:
    sheet = casting_md(PAD)
    assert "| sunled-xscwd23mb | 120 ohm | 2 kohm | 16.7 usual, 19.2 at most | 2.1 |" in sheet
    assert f"gives {supply_current(Circuit.of(PAD)).full_power_ma:.0f}* mA at full power" in sheet


ROOT = Path(__file__).parents[2]
PACKAGES = {
    "optopad.fabrication.sheets": "fabrication/sheets",
    "optopad.report": "optopad/report",
    "optopad.studio": "optopad/studio",
}
ATTACK = "<script>alert(1)</script> & \"double\" 'single' {{ 7 * 7 }}"


def table(cell: str) -> str:
    values = {"heads": [Markup("a"), Markup("b")], "rows": [["x", cell]], "numeric": []}
    return filled("optopad.report", "sheet_table.html.j2", values)


def test_html_escapes_text_once_and_leaves_markup_alone() -> None:
    said = table(ATTACK)
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &#34;double&#34; &#39;single&#39; {{ 7 * 7 }}" in said
    assert "<b>a &amp; b</b>" in table(Markup("<b>a &amp; b</b>"))


def test_a_name_without_a_value_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="heads"):
        filled("optopad.report", "sheet_table.html.j2", {})


def test_data_of_a_page_cannot_end_their_element_and_stay_what_they_are() -> None:
    data = templates("optopad.report").filters["data"]
    text = data({"label": ATTACK})
    assert "<" not in text
    assert json.loads(text) == {"label": ATTACK}
    with pytest.raises(ValueError, match="JSON"):
        data(float("nan"))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_template_compiles(package: str) -> None:
    names = {path.name for path in (ROOT / PACKAGES[package] / "templates").iterdir()}
    found = templates(package)
    assert set(found.list_templates()) == names
    assert [name for name in names if found.get_template(name).name != name] == []
