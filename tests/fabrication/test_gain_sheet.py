"""The gain on the sheets: the resistor to fit, what clips, what nobody can tell yet."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import settling_findings
from optopad.design.parts.catalog import find_part
from optopad.design.preset import preset
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of
from optopad.fabrication.driver_config import driver_config
from optopad.fabrication.gain import SimulatedGain, clipped_pairs
from optopad.fabrication.sheets.bom import bom_csv, bom_rows
from optopad.fabrication.sheets.casting import casting_md
from tests.said import says

PAD = preset("piacenza2017-pad")
FLUX = tuple(tuple(1e-3 * (1 + i + j) for j in range(8)) for i in range(8))
RESIN = {
    "title": "Grey resin",
    "wall_reflectance": {"value": 0.1, "unit": "1", "source": "assumed", "confidence": "unverified"},
    "density_g_per_cm3": {"value": 1.1, "unit": "g/cm3", "source": "assumed", "confidence": "unverified"},
}
GAIN = SimulatedGain(counts_per_flux=(1e5,) * 8, untouched_flux=FLUX)


def bill(gain: SimulatedGain | None = GAIN, **changes: object) -> dict[str, dict[str, str]]:
    rows = csv.DictReader(io.StringIO(bom_csv(bom_rows(PAD.with_(**changes), gain))))
    return {row["item"]: row for row in rows}


def test_sheet_bill_and_driver_name_the_same_resistor_and_capacitor() -> None:
    driver = driver_config(PAD, GAIN.counts_per_flux).gain
    assert driver.feedback_ohm == (150e3,) * 8
    assert driver.feedback_pf == (15.0,) * 8
    assert bill()["feedback resistor"]["value"] == "150 kohm"
    assert bill()["feedback capacitor"]["value"] == "15 pF"
    sheet = casting_md(PAD, GAIN)
    assert "| 146 kohm | " in sheet
    assert "| 150 kohm | +2.7% | 15 pF |" in sheet


def test_receivers_whose_rows_say_the_same_share_a_row() -> None:
    nearly = SimulatedGain(counts_per_flux=(1e5, 1.0000001e5) * 4, untouched_flux=FLUX)
    assert "| R1 R2 R3 R4 R5 R6 R7 R8 | 146 kohm | " in casting_md(PAD, nearly)
    halves = SimulatedGain(counts_per_flux=(1e5, 1.5e5) * 4, untouched_flux=FLUX)
    sheet = casting_md(PAD, halves)
    assert "| R1 R3 R5 R7 | 146 kohm | " in sheet
    assert "| R2 R4 R6 R8 | 219 kohm | " in sheet


def test_pairs_above_full_scale_are_listed_with_the_resistor_that_is_fitted() -> None:
    # 150 kohm for 146.05: 1.0270 x 1e5 x flux > 1023 from 9.96e-3 on: sums of places 9 to 14, 21 of 64 pairs
    found = clipped_pairs(PAD, GAIN)
    assert len(found) == 21
    assert found[0].name == "E8-R8"
    assert found[0].counts == pytest.approx(1.0270 * 1e5 * 15e-3, rel=1e-4)
    assert says(casting_md(PAD, GAIN), "21 of 64 ... 1023 counts")


def test_an_amplifier_that_is_too_slow_is_said_with_the_time_that_is_enough() -> None:
    hurried = PAD.with_(**{"board.settle_us": 3.0})
    sheet = casting_md(hurried, SimulatedGain(counts_per_flux=(3e6,) * 8, untouched_flux=FLUX))
    fitted = re.search(
        r"do not settle, so readings lag behind the light \(3 us; needs at least (\d+) us", sheet
    )
    assert fitted is not None
    assert 10 < int(fitted[1]) < 19  # 19 us at 10 MHz, and no amplifier of the catalogue has more than 38 MHz
    enough = hurried.with_(**{"board.settle_us": float(fitted[1])})
    assert list(settling_findings(Circuit.of(enough), (3e6,) * 8)) == []
    assert all(one.field != "board.settle_us" for one in check(hurried))  # no resistor without light
    fitted = hurried.with_(**{"gain.feedback_ohm": 2.2e6})
    (said,) = (str(one) for one in check(fitted) if one.field == "board.settle_us")
    assert "lower gain.feedback_ohm" in said
    assert said in casting_md(fitted).replace("\\", "")


@pytest.mark.parametrize(
    ("mark", "changes", "said"),
    [
        ("none fits", {"forward_voltage_v": {"value": 6.0}}, "the supply cannot light"),
        ("TOO MUCH", {"max_current_ma": {"value": 900.0}}, "much current"),
        ("(too slow)", {}, "do not settle"),
        ("is printed in resin", {}, "may stay tacky"),
    ],
)
def test_what_a_sheet_warns_of_is_a_finding_too(mark: str, changes: dict[str, Any], said: str) -> None:
    document = PAD.model_dump(mode="json")
    emitter = find_part(entries_of(PAD), PAD.emitters.part, "emitter").model_dump(mode="json")
    for name, change in changes.items():
        emitter[name] |= change | {"low": None, "high": None}
    document["catalog"] = {"parts": {"lamp": emitter}, "mold_materials": {"grey-resin": RESIN}}
    document["emitters"]["part"] = "lamp"
    if not changes:
        document["board"]["settle_us"], document["gain"]["feedback_ohm"] = 3.0, 2.2e6
        document["mold"]["material"] = "grey-resin"
    bad = SensorDesign.from_document(document, where="bad")
    assert mark in casting_md(bad)
    assert mark not in casting_md(PAD, GAIN)
    assert any(said in one.message for one in check(bad))
    assert not any(said in one.message for one in check(PAD))


@pytest.mark.parametrize(
    ("title", "cure", "tacky"),
    [
        ("Grey resin, printed by SLA", "Platinum cure.", True),
        ("Tough photopolymer", "Platinum cure.", True),
        ("Grey resin", "Tin cure (condensation).", False),
        ("PETG, filament printed", "Platinum cure.", False),
    ],
)
def test_a_resin_mold_warns_of_a_platinum_silicone(title: str, cure: str, tacky: bool) -> None:
    document = PAD.model_dump(mode="json")
    silicone = entries_of(PAD).elastomers[PAD.elastomer.material].model_dump(mode="json")
    own = {
        "mold_materials": {"own": RESIN | {"title": title}},
        "elastomers": {"gel": silicone | {"notes": [cure]}},
    }
    document |= {"catalog": own}
    document["mold"]["material"], document["elastomer"]["material"] = "own", "gel"
    design = SensorDesign.from_document(document, where="own")
    assert any("may stay tacky" in one.message for one in check(design)) is tacky
    sheet = casting_md(design)
    assert ("is printed in resin" in sheet) is tacky
    assert ("Keep to this material" in sheet) is not tacky
