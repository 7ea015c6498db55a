"""Bill of materials, silicone and resistors, by hand and parsed back."""

from __future__ import annotations

import csv
import io
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import emitter_switch, most_drive_ma
from optopad.design.parts.assumptions import assumption, standard_at_least, standard_at_most
from optopad.design.parts.catalog import Part
from optopad.design.preset import PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import part_of
from optopad.fabrication.sheets.bom import COLUMNS, bom_csv, bom_rows
from optopad.fabrication.sheets.silicone import pours
from optopad.fabrication.sheets.template import csv_text, safe_text

PAD = preset("piacenza2017-pad")


def rows_of(design: SensorDesign) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(bom_csv(bom_rows(design)))))


def row(design: SensorDesign, item: str) -> dict[str, str]:
    (found,) = [row for row in rows_of(design) if row["item"] == item]
    return found


def led(**changes: dict[str, object]) -> Part:
    entry = part_of(PAD, "osram-lt-p4sg", "emitter").model_dump(mode="json")
    return Part.model_validate(entry | {name: entry[name] | change for name, change in changes.items()})


def test_the_pad_s_silicone_is_its_volume_times_density() -> None:
    black, clear = pours(PAD)
    assert clear.net_g == pytest.approx(32 * 32 * 8 / 1000 * 1.03)
    assert black.net_g == pytest.approx(32 * 32 * 1 / 1000 * 1.03)
    assert clear.used_g == pytest.approx(8.43776 * 1.25)
    assert (
        clear.used_g <= clear.mixed_g < clear.used_g + 0.01 * 21
    )  # one step of the scale in the curing agent


@pytest.mark.parametrize("ratio", [5.0, 10.0, 20.0, 30.0])
def test_base_and_agent_make_the_mix_in_the_design_s_ratio(ratio: float) -> None:
    for pour in pours(PAD.with_(**{"elastomer.mixing_ratio": ratio})):
        assert pour.base_g / pour.agent_g == pytest.approx(ratio)
        assert pour.base_g + pour.agent_g == pytest.approx(pour.mixed_g)


def test_a_pad_without_a_black_layer_needs_no_carbon_and_no_blade() -> None:
    bare = PAD.with_(**{"cavity.black_thickness_mm": 0.0})
    assert [pour.layer for pour in pours(bare)] == ["clear"]
    items = {row["item"] for row in rows_of(bare)}
    assert not {"carbon black", "printed leveling blade"} & items


@given(st.floats(1.0, 1e7))
def test_standard_resistors_enclose_the_computed_value(ohm: float) -> None:
    above, below = standard_at_least(ohm), standard_at_most(ohm)
    assert below <= ohm * (1 + 1e-9)
    assert above >= ohm * (1 - 1e-9)
    assert above / below <= 1.5 / 1.3 + 1e-9  # the widest step of E24


def test_the_pad_s_series_resistor_is_computed_at_the_lowest_forward_voltage() -> None:
    switch = emitter_switch(part_of(PAD, "sunled-xscwd23mb", "emitter"), Circuit.of(PAD).board)
    assert switch.series_ohm == 120.0  # the next above (5.0 - 2.7) V / 20 mA = 115 ohm
    assert switch.current_ma == pytest.approx(2.3 / 120 * 1e3)
    assert switch.series_mw == pytest.approx(2.3**2 / 120 * 1e3)
    assert switch.forward_v.confidence == "unverified"


@given(forward=st.floats(1.5, 4.8), most=st.floats(1.0, 100.0))
def test_no_emitter_gets_more_than_its_current(forward: float, most: float) -> None:
    part = led(
        forward_voltage_v={"value": forward, "low": forward, "high": None}, max_current_ma={"value": most}
    )
    switch = emitter_switch(part, Circuit.of(PAD).board)
    assert switch.series_ohm is not None
    assert switch.current_ma <= most * (1 + 1e-9)
    supply, base = assumption("supply_v").value, assumption("base_emitter_v").value
    assert switch.base_current_ma == pytest.approx((supply - base) / switch.base_ohm * 1e3)
    assert most / switch.base_current_ma <= assumption("forced_gain").value * (1 + 1e-9)


def test_an_emitter_beyond_the_supply_has_no_resistor() -> None:
    switch = emitter_switch(
        led(forward_voltage_v={"value": 6.0, "low": 5.5, "high": 7.0}), Circuit.of(PAD).board
    )
    assert switch.series_ohm is None
    assert switch.current_ma == 0.0


def test_a_base_current_that_a_pin_cannot_give_is_noticed() -> None:
    board = Circuit.of(PAD).board
    driver, most_ma = most_drive_ma(Circuit.of(PAD))
    assert driver == "a pin"
    assert emitter_switch(led(max_current_ma={"value": 150.0}), board).base_current_ma <= most_ma
    assert emitter_switch(led(max_current_ma={"value": 300.0}), board).base_current_ma > most_ma


@pytest.mark.parametrize("name", PRESETS)
def test_the_bill_counts_every_part_once(name: str) -> None:
    design = preset(name)
    cavity, rows, circuit = cavity_of(design), rows_of(design), Circuit.of(design)
    references = [reference for row in rows for reference in row["references"].split()]
    assert len(set(references)) == len(references)
    chips = {
        path.pin.partition("-")[0] for path in (*circuit.receivers, *circuit.emitters) if "-" in path.pin
    }
    couplers = {part.coupler for part in cavity.parts} - {None}
    once = [f"OC{k}" for k in range(1, len(couplers) + 1)] + [
        p.name for p in cavity.parts if p.coupler is None
    ]
    assert [r for r in references if "-" not in r and r not in chips] == once
    for one in rows:
        if one["references"]:
            assert float(one["quantity"]) == len(one["references"].split())
    for mark in ("Q", "RB", "RS") if circuit.led_driver is None else ():
        assert [r for r in references if r.endswith(f"-{mark}")] == [
            f"{p.name}-{mark}" for p in cavity.emitters
        ]
    for mark in ("A", "RF", "CF"):  # the amplifier's type is not known before a simulation
        assert [r for r in references if r.endswith(f"-{mark}")] == [
            f"{p.name}-{mark}" for p in cavity.receivers
        ]


def test_a_known_cost_comes_with_currency_and_date() -> None:
    entry = part_of(PAD, "osram-sfh206k", "receiver").model_dump(mode="json")
    entry["cost"] = {"value": 0.79, "currency": "EUR", "date": "2024-05", "source": "a quote"}
    priced = PAD.with_(catalog={"parts": {"osram-sfh206k": entry}})
    found = next(row for row in rows_of(priced) if row["catalogue_id"] == "osram-sfh206k")
    assert (found["unit_cost"], found["currency"], found["cost_date"]) == ("0.79", "EUR", "2024-05")


def test_grams_and_values_of_the_pad() -> None:
    # curing agent: 10.547 / 21 = 0.502 g, thus 0.51 g; the black layer's 0.063 g are 0.2 g on a scale of 0.01 g
    assert float(row(PAD, "Dow Sylgard 184")["quantity"]) == pytest.approx((0.51 + 0.2) * 21)
    assert row(PAD, "series resistor")["value"] == "120 ohm"
    assert row(PAD, "feedback resistor")["value"] == "set by gain"
    assert float(row(PAD, "carbon black")["quantity"]) == pytest.approx(4.2 * 0.03, abs=0.005)
    assert row(PAD, "printed mold")["quantity"] == "1"


@pytest.mark.parametrize(("most_ma", "is_ordered"), [(20.0, True), (150.0, False)])
def test_a_series_resistor_above_a_quarter_watt_has_no_part_number(most_ma: float, is_ordered: bool) -> None:
    entry = part_of(PAD, "sunled-xscwd23mb", "emitter").model_dump(mode="json")
    entry["max_current_ma"] |= {"value": most_ma}
    design = PAD.with_(catalog={"parts": {"sunled-xscwd23mb": entry}})
    found = row(design, "series resistor")
    switch = emitter_switch(part_of(design, "sunled-xscwd23mb", "emitter"), Circuit.of(design).board)
    assert (switch.series_mw <= 250.0) == is_ordered
    assert bool(found["part_number"]) == is_ordered
    assert (f"more than {switch.series_mw:.0f} mW" in found["note"]) != is_ordered
    assert found["order_quantity"] == found["quantity"]


def test_a_mold_s_weight_is_its_volume_in_its_plastic() -> None:
    (known,) = [row for row in bom_rows(PAD, mold_mm3=13_547.9532) if row.item == "printed mold"]
    assert known.note == "cad/mold.stl; 14.1 g when printed solid"  # ABS of 1.04 g/cm3
    assert row(PAD, "printed mold")["note"] == "cad/mold.stl"


def test_a_bill_parsed_back_is_the_bill() -> None:
    rows, parsed = bom_rows(PAD), rows_of(PAD)
    assert [one["item"] for one in parsed] == [one.item for one in rows]
    assert tuple(parsed[0]) == COLUMNS
    assert "\r" not in bom_csv(bom_rows(PAD))


@given(st.text(max_size=40))
def test_no_text_starts_a_formula_or_a_new_line(text: str) -> None:
    cell = safe_text(text)
    assert not cell.startswith(("=", "+", "-", "@", "\t", "\r", "\n"))
    assert cell.isprintable()
    assert list(csv.reader(io.StringIO(csv_text(["a"], [[text or "x"]])))) == [
        ["a"],
        [safe_text(text or "x")],
    ] or (not safe_text(text or "x"))


@pytest.mark.parametrize("start", ["=", "+", "-", "@"])
def test_a_title_that_looks_like_a_formula_is_defused(start: str) -> None:
    entry = part_of(PAD, "osram-sfh206k", "receiver").model_dump(mode="json")
    entry |= {"title": f'{start}HYPERLINK("http://x","y")', "manufacturer": f"{start}1+1"}
    design = PAD.with_(catalog={"parts": {"osram-sfh206k": entry}})
    found = next(row for row in rows_of(design) if row["catalogue_id"] == "osram-sfh206k")
    assert found["item"] == f'\'{start}HYPERLINK("http://x","y")'
    assert found["manufacturer"] == f"'{start}1+1"


def test_negative_numbers_stay_numbers() -> None:
    assert csv_text(["a", "b", "c"], [[-1.5, 0.1 + 0.2, None]]) == "a,b,c\n-1.5,0.3,\n"
    assert math.isclose(float(csv_text(["a"], [[1e-4]]).splitlines()[1]), 1e-4)
