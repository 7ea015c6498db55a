"""The gain on the sheets: the resistor to fit, what clips, what nobody can tell yet."""

from __future__ import annotations

import csv
import io

import pytest

from design.preset import preset
from fabrication.driver_config import driver_config
from fabrication.gain import SimulatedGain, clipped_pairs
from fabrication.sheets.bom import bom_csv
from fabrication.sheets.casting import casting_md

PAD = preset("piacenza2017-pad")
FLUX = tuple(tuple(1e-3 * (1 + i + j) for j in range(8)) for i in range(8))
GAIN = SimulatedGain(counts_per_flux=(1e5,) * 8, untouched_flux=FLUX)


def bill(gain: SimulatedGain | None = GAIN, **changes: object) -> dict[str, dict[str, str]]:
    rows = csv.DictReader(io.StringIO(bom_csv(PAD.with_(**changes), gain)))
    return {row["item"]: row for row in rows}


def test_sheet_bill_and_driver_name_the_same_resistor_and_capacitor() -> None:
    driver = driver_config(PAD, GAIN.counts_per_flux)["gain"]
    assert driver["feedback_ohm"] == [150e3] * 8
    assert driver["feedback_pf"] == [15.0] * 8
    assert bill()["feedback resistor"]["value"] == "150 kohm"
    assert bill()["feedback capacitor"]["value"] == "15 pF"
    sheet = casting_md(PAD, GAIN)
    assert "| 146 kohm | " in sheet
    assert "| 150 kohm | +2.7% | 15 pF |" in sheet


def test_pairs_above_full_scale_are_listed_with_the_resistor_that_is_fitted() -> None:
    # 150 kohm for 146.05: 1.0270 x 1e5 x flux > 1023 from 9.96e-3 on: sums of places 9 to 14, 21 of 64 pairs
    found = clipped_pairs(PAD, GAIN)
    assert len(found) == 21
    assert found[0].name == "E8-R8"
    assert found[0].counts == pytest.approx(1.0270 * 1e5 * 15e-3, rel=1e-4)
    assert "21 of 64 pairs read above full scale (1023 counts)" in casting_md(PAD, GAIN)


def test_no_clipped_pair_is_said_too() -> None:
    dim = SimulatedGain(counts_per_flux=(1e4,) * 8, untouched_flux=FLUX)
    assert clipped_pairs(PAD, dim) == ()
    assert "No pair reads above full scale" in casting_md(PAD, dim)


def test_a_rule_without_a_simulation_leaves_the_resistor_open() -> None:
    assert bill(None)["feedback resistor"]["value"] == "set by gain"
    assert "nothing has been simulated yet" in casting_md(PAD)
    assert "feedback_ohm" not in driver_config(PAD)["gain"]


def test_given_ohms_are_known_without_a_simulation() -> None:
    fitted = PAD.with_(**{"gain.feedback_ohm": 2.2e6})
    driver = driver_config(fitted)["gain"]
    assert driver["rule"] == "ohms"
    assert driver["feedback_ohm"] == [2.2e6] * 8
    assert driver["counts_per_flux"] == pytest.approx(0.6846745 * 2.2e6, rel=1e-6)
    assert bill(None, **{"gain.feedback_ohm": 2.2e6})["feedback resistor"]["value"] == "2.2 Mohm"


def test_an_amplifier_that_is_too_slow_is_said_with_the_time_that_is_enough() -> None:
    hurried = PAD.with_(**{"board.settle_us": 3.0})
    sheet = casting_md(hurried, SimulatedGain(counts_per_flux=(3e6,) * 8, untouched_flux=FLUX))
    assert "do NOT settle within `board.settle_us` = 3 us: set it to 18 or more" in sheet
