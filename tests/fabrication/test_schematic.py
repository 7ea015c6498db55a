"""Schematic, orientation drawing, supply current, and what the build sheet says of the mold's options."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import emitter_switch, supply_current
from optopad.design.parts.assumptions import assumption, ohm_text
from optopad.design.preset import PRESETS, preset
from optopad.design.spec.properties import part_of
from optopad.fabrication.gain import SimulatedGain
from optopad.fabrication.sheets.bom import NO_PRICE, NOT_BOUGHT, bom_csv, bom_rows
from optopad.fabrication.sheets.casting import casting_md
from optopad.fabrication.sheets.schematic_svg import schematic_svg
from optopad.fabrication.sheets.silicone import pours

PAD = preset("piacenza2017-pad")
SVG = "{http://www.w3.org/2000/svg}"
GAIN = SimulatedGain(counts_per_flux=(1e6,) * 8, untouched_flux=((3e-4,) * 8,) * 8)


def texts(svg: str) -> list[str]:
    return [element.text or "" for element in ElementTree.fromstring(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize("name", PRESETS)
def test_every_part_is_on_the_schematic_with_its_pin_and_designators(name: str) -> None:
    design = preset(name)
    circuit = Circuit.of(design)
    shown = texts(schematic_svg(design))
    for part, pin in zip(circuit.cavity.emitters, circuit.emitters, strict=True):
        assert {part.name, pin.pin, f"{part.name}-RB", f"{part.name}-RS", f"{part.name}-Q"} <= set(shown)
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
