"""What to order, the sum with what is missing, price lists and budgets."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import pytest

from optopad.design.errors import InputError
from optopad.design.parts.catalog import packaged
from optopad.design.parts.circuits import families
from optopad.design.parts.orders import ohm_code, order_of, orders
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.gain import SimulatedGain
from optopad.fabrication.sheets.bom import BomRow, bom_csv, bom_rows
from optopad.fabrication.sheets.casting import casting_md
from optopad.fabrication.sheets.prices import (
    bill_sum,
    held_against,
    parsed_budget,
    priced,
    read_prices,
    unused_words,
)
from optopad.fabrication.sheets.silicone import pours
from tests.said import says

PAD = preset("piacenza2017-pad")
PICOFARADS = ("tiny-capacitor", "small-capacitor", "capacitor")
COUNTS_PER_FLUX = {"piacenza2017-pad": 1.2e5, "gripper-teensy": 2.0e6, "fingertip-16": 2.3e5}
"""Near the simulated gains of these presets: 160 kohm to 1.5 Mohm, and down to 0.68 pF."""


def gain_of(design: SensorDesign) -> SimulatedGain:
    cavity = cavity_of(design)
    flux = tuple((1e-4,) * len(cavity.receivers) for _ in cavity.emitters)
    gain = COUNTS_PER_FLUX[design.name]
    return SimulatedGain(counts_per_flux=(gain,) * len(cavity.receivers), untouched_flux=flux)


def rows_of(name: str) -> tuple[BomRow, ...]:
    design = preset(name)
    return bom_rows(design, gain_of(design))


def filled(rows: tuple[BomRow, ...], folder: Path, **changes: str) -> Path:
    """A copy of the bill with a price of 2.50 EUR for every item that is bought."""
    table = list(csv.DictReader(io.StringIO(bom_csv(rows))))
    for row in table:
        if row["order_quantity"]:
            row |= {"unit_cost": "2.50", "currency": "EUR", "cost_date": "2026-11"} | changes
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    file = folder / "prices.csv"
    file.write_text(stream.getvalue())
    return file


@pytest.mark.parametrize("name", ["piacenza2017-pad", "gripper-teensy", "fingertip-16"])
def test_every_bought_row_of_a_simulated_design_has_a_part_number(name: str) -> None:
    rows = rows_of(name)
    assert bill_sum(rows).unnumbered == ()
    for row in rows:
        assert (row.order_quantity is not None and row.order_quantity >= 1) or not row.is_bought
    assert not [row.item for row in rows if row.item.startswith("printed") and row.is_bought]


def test_amplifiers_are_counted_in_packages_that_serve_every_receiver_once() -> None:
    (quads,) = (row for row in rows_of("piacenza2017-pad") if "quad op-amp" in row.item)
    assert (quads.quantity, quads.references, quads.order_quantity) == (2, ("A1", "A2"), 2)
    assert re.findall(r"R\d-A", quads.note) == [f"R{k}-A" for k in range(1, 9)]
    assert "(assumed)" not in quads.note + quads.value


def test_a_kit_of_500_g_is_ordered_for_15_g_and_all_sheets_say_the_same_amount() -> None:
    (silicone,) = (row for row in bom_rows(PAD) if row.catalogue_id == "sylgard-184")
    assert (silicone.order_quantity, silicone.order_unit) == (1, "kit of 500 g")
    mixed = sum(pour.mixed_g for pour in pours(PAD))
    assert silicone.quantity == pytest.approx(mixed)
    sheet = casting_md(PAD)
    for pour in pours(PAD):
        assert f"| {pour.mixed_g:.2f} | {pour.base_g:.2f} | {pour.agent_g:.2f} |" in sheet
        assert (
            f"{pour.layer.capitalize()} layer: mix {pour.base_g:.2f} g base and {pour.agent_g:.2f} g" in sheet
        )
        assert f"{pour.layer} layer {pour.base_g:.2f} g base and {pour.agent_g:.2f} g" in silicone.note
    assert f"| 4019862* | {silicone.quantity:.2f} g | 1 kit of 500 g |" in sheet
    assert "| A000067 | 1 | 1 |" in sheet  # a number that was read has no star


def test_codes_of_values_are_those_of_known_orders() -> None:
    assert [ohm_code(ohm) for ohm in (82.0, 820.0, 4700.0, 100e3, 3.6e6)] == [
        "82R",
        "820R",
        "4K7",
        "100K",
        "3M6",
    ]
    numbers = [order_of(PICOFARADS, pf) for pf in (0.68, 5.6, 8.2, 22.0, 470.0, 0.056)]
    assert [found and found[1] for found in numbers] == [
        "GRM1885C1HR68BA01D",
        "C317C569D5G5TA",
        "C317C829D5G5TA",
        "K220J15C0GF5TL2",
        "K471J15C0GF5TL2",
        None,
    ]


def test_every_order_belongs_to_an_entry_of_the_catalogue_or_a_kind_of_part() -> None:
    entries = packaged()
    known = {name for table in type(entries).model_fields for name in getattr(entries, table)}
    components = {item.replace(" ", "-") for one in families().values() for item, *_ in one.components}
    kinds = {"carbon-black", "resistor", "large-resistor", *PICOFARADS, "pin-header", "wire", "thin-wire"}
    assert set(orders()) <= known | kinds | {"supply-capacitor", *components}
    needed = {
        *entries.boards,
        *entries.amplifiers,
        *entries.transistors,
        *entries.converters,
        *entries.elastomers,
    }
    assert needed <= set(orders())


def test_a_filled_bill_is_a_price_list_and_its_sum_is_by_hand(tmp_path: Path) -> None:
    rows = rows_of("piacenza2017-pad")
    before = bill_sum(rows)
    assert (before.known, before.unpriced) == ({}, before.rows)
    own = priced(rows, read_prices(filled(rows, tmp_path)))
    total = bill_sum(own)
    units = sum(row.order_quantity or 0 for row in rows if row.is_bought)
    assert total.known == {"EUR": pytest.approx(2.5 * units)}
    assert total.unpriced == 0
    assert total.words == f"{2.5 * units:.2f} EUR, every row priced"
    assert f"Sum: {total.words}." in casting_md(PAD, None, own)
    amount = 2.5 * units
    assert held_against(own, parsed_budget(f"{amount + 1}EUR")).words.startswith("within")
    assert held_against(own, parsed_budget(f"{amount - 1:.2f} EUR")).words.endswith("1.00 too much")
    assert "not decided" in held_against(own, parsed_budget("900USD")).words
    assert says(held_against(own, parsed_budget("900USD")).words, f"{total.rows} ... in USD")


def test_a_price_of_the_catalogue_has_a_date_and_a_source() -> None:
    pico = PAD.with_(**{"board.kind": "raspberry-pi-pico-2"})
    (row,) = (one for one in bom_rows(pico) if one.catalogue_id == "raspberry-pi-pico-2")
    assert row.cost is not None
    assert (row.cost.value, row.cost.currency, row.cost.date) == (5.0, "USD", "2024-09")
    total = bill_sum(bom_rows(pico))
    assert total.words == f"5.00 USD, {total.rows - 1} of {total.rows} rows without a price"


@pytest.mark.parametrize("text", ["25", "25XYZ", "-25EUR", "0EUR", "EUR", "", "nanEUR", "1,000EUR"])
def test_a_budget_without_amount_or_known_currency_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^--budget"):
        parsed_budget(text)
    assert parsed_budget("25,50 eur") == parsed_budget("25.5EUR")


def test_a_price_list_may_have_small_letters_and_a_decimal_comma(tmp_path: Path) -> None:
    prices = read_prices(filled(rows_of("piacenza2017-pad"), tmp_path, unit_cost="2,50", currency=" eur"))
    assert {(price.cost.value, price.cost.currency) for price in prices.values()} == {(2.5, "EUR")}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"unit_cost": "cheap"}, "row 2: unit_cost"),
        ({"unit_cost": "-1"}, "row 2: unit_cost"),
        ({"currency": "XYZ"}, "row 2: currency"),
        ({"currency": ""}, "row 2: currency has no currency"),
        ({"cost_date": "soon"}, "row 2: cost_date"),
    ],
)
def test_a_bad_price_is_refused_with_its_row(changes: dict[str, str], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=re.escape(said)):
        read_prices(filled(bom_rows(PAD), tmp_path, **changes))


def test_a_price_list_needs_its_columns_and_one_price_for_each_item(tmp_path: Path) -> None:
    file = tmp_path / "prices.csv"
    file.write_text("item,unit_cost\nnut,1\n")
    with pytest.raises(InputError, match="cost_date"):
        read_prices(file)
    file.write_text("part_number,unit_cost,currency,cost_date\nA1,1,EUR,2026-11\nA1,2,EUR,2026-11\n")
    with pytest.raises(InputError, match="row 3: 'A1' has another price"):
        read_prices(file)


def renumbered(rows: tuple[BomRow, ...], folder: Path, number: str, **wanted: str) -> Path:
    """A filled copy of the bill with other part numbers: of the rows that have the wanted cells, or else of all."""
    file = filled(rows, folder)
    table = list(csv.DictReader(io.StringIO(file.read_text())))
    for place, row in enumerate(table):
        if row["unit_cost"] and wanted.items() <= row.items():
            row |= {"part_number": number or f"MINE-{place}", "manufacturer": "Mine"}
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(table[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    file.write_text(stream.getvalue())
    return file


@pytest.mark.parametrize("name", ["piacenza2017-pad", "gripper-teensy"])
def test_a_part_number_that_a_buyer_replaces_keeps_its_price_and_is_ordered(
    name: str, tmp_path: Path
) -> None:
    rows = rows_of(name)
    own = priced(rows, read_prices(renumbered(rows, tmp_path, "")))
    bought = [row for row in own if row.is_bought]
    assert [row.item for row in bought if row.cost is None] == []
    assert all(row.part_number.startswith("MINE-") and row.manufacturer == "Mine" for row in bought)


def test_a_resistor_of_another_value_does_not_get_the_number_of_the_old_one(tmp_path: Path) -> None:
    prices = read_prices(renumbered(bom_rows(PAD), tmp_path, "R-270", item="series resistor"))
    rows = tuple(replace(row, value="100 ohm") if row.value == "120 ohm" else row for row in bom_rows(PAD))
    rows = priced(rows, prices)
    assert "R-270" not in {row.part_number for row in rows}
    assert "R-270" in (unused_words(rows, prices) or "")


def test_a_price_that_matches_no_row_is_named(tmp_path: Path) -> None:
    file = tmp_path / "prices.csv"
    file.write_text(
        "part_number,unit_cost,currency,cost_date\nA00067,40,EUR,2026-11\nA000067,41,EUR,2026-11\n"
    )
    prices = read_prices(file)
    assert says(unused_words(priced(bom_rows(PAD), prices), prices), "1 of 2 ... A00067")
