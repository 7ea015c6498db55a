"""The choice of amplifier and transistor, against an independent step response and limits worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lti, step

from optopad.design.circuit.amplifier import Load, chosen_amplifier, least_feedback_pf, settles_us
from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import transistor_of
from optopad.design.circuit.transimpedance import feedbacks_of
from optopad.design.parts.catalog import packaged
from optopad.design.preset import preset
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec.properties import part_of
from tests.said import says

PAD = preset("piacenza2017-pad")
QUADS = packaged().amplifiers


def step_response(load: Load, bandwidth_mhz: float, time_s: np.ndarray) -> np.ndarray:
    """Response of op-amp and feedback by nodal analysis, with the polynomials multiplied out by NumPy."""
    w, r, cf, c = 2e6 * math.pi * bandwidth_mhz, load.ohm, load.feedback_pf * 1e-12, load.input_pf * 1e-12
    feedback = [cf, 1 / r]  # its admittance
    node = np.polyadd(np.polymul([1 / w, 1], feedback), [c / w, 0, 0])  # current per output voltage
    return np.asarray(step(lti([1 / r], node), T=time_s)[1])


@pytest.mark.parametrize("feedback_pf", [1.8, 2.7, 5.6, 15.0])
def test_the_settle_time_is_that_of_the_step_response(feedback_pf: float) -> None:
    load = Load(ohm=430e3, feedback_pf=feedback_pf, input_pf=82.0)
    quad = QUADS["mcp6284"].model_copy(
        update={"slew_v_per_us": QUADS["mcp6284"].slew_v_per_us.model_copy(update={"value": 1e4})}
    )
    found_us = settles_us(quad, load, 10, 5.0)
    time_us = np.linspace(0, 2 * found_us, 20_001)
    off = np.abs(step_response(load, 5.0, time_us * 1e-6) - 1)
    assert off[time_us >= found_us].max() < 1.02 / 2**11
    assert off[time_us >= 0.6 * found_us].max() > 1 / 2**11  # and not much earlier


def test_a_slow_slew_rate_adds_the_time_that_the_output_lags() -> None:
    load = Load(ohm=30e3, feedback_pf=82.0, input_pf=82.0)
    slow, fast = (settles_us(QUADS[name], load, 10, 5.0) for name in ("mcp6004", "opa4350"))
    assert fast == pytest.approx(2.46 * math.log(2**11), rel=0.02)  # RF CF = 2.46 us and no slewing
    lagging = 5.0 / 0.6 - 2.46 + 2.46 * math.log(2**11 * 2.46 * 0.6 / 5.0)
    assert slow == pytest.approx(lagging, rel=0.05)
    assert slow > fast + 1.0


def test_the_slowest_that_fits_is_chosen_and_never_one_that_breaks_a_limit() -> None:
    chosen = []
    for ohm in (1e5, 4.3e5, 1e6, 3e6):
        found = feedbacks_of(Circuit.of(PAD.with_(**{"gain.feedback_ohm": ohm})), None)
        assert found is not None
        one = found[0]
        entry = QUADS[one.amplifier_id]
        assert one.is_in_time
        assert one.capacitor_pf >= least_feedback_pf(entry, ohm, 82.0)
        slower = [quad for quad in QUADS.values() if quad.bandwidth_mhz.value < entry.bandwidth_mhz.value]
        load = Load(ohm=ohm, feedback_pf=one.capacitor_pf, input_pf=82.0)
        for quad in slower:
            late = settles_us(quad, load, 10, 5.0) > 20.0
            rings = one.capacitor_pf < least_feedback_pf(quad, ohm, 82.0)
            assert late or rings or quad.name == "LM324"
        chosen.append(one.amplifier_id)
    assert len(set(chosen)) > 2  # the choice follows the resistor
    assert "lm324" not in chosen


def test_an_amplifier_of_one_s_own_is_held_against_the_same_limits() -> None:
    by_name = {
        (one.field, one.severity): str(one) for one in check(PAD.with_(**{"board.amplifier": "lm324"}))
    }
    assert says(by_name["board.amplifier", "warning"], "3.5 V at ... 95% of 5 V")
    fitted = PAD.with_(**{"board.amplifier": "lm324", "gain.feedback_ohm": 1e6})
    assert any("2.5e+05 pA; needs at most 4.88e+03 pA" in str(one) for one in check(fitted))
    (unsupplied,) = (
        one
        for one in check(preset("gripper-teensy").with_(**{"board.amplifier": "high"} | high_supply()))
        if one.field == "board.amplifier"
    )
    assert (unsupplied.severity, unsupplied.value, unsupplied.limit) == ("error", "3.3 V", "5 to 30 V")
    slow = PAD.with_(**{"board.amplifier": "mcp6004", "gain.feedback_ohm": 3e6})
    (late,) = (one for one in check(slow) if one.field == "board.settle_us")
    assert "remove board.amplifier" in late.way_out


def high_supply() -> dict[str, object]:
    entry = QUADS["mcp604"].model_dump(mode="json") | {"supply_low_v": 5.0, "supply_high_v": 30.0}
    return {"catalog": {"amplifiers": {"high": entry}}}


def test_before_the_resistors_are_known_supply_and_swing_choose() -> None:
    found = chosen_amplifier(Circuit.of(PAD), None, 20.0)
    assert not found.shortfalls
    assert found.amplifier_id == "mcp6004"


@pytest.mark.parametrize(("current_ma", "name"), [(20.0, "2n3904"), (60.0, "pn2222a"), (300.0, "bc337-40")])
def test_the_smallest_transistor_that_carries_the_current_is_chosen(current_ma: float, name: str) -> None:
    entry = part_of(PAD, "sunled-xscwd23mb", "emitter").model_dump(mode="json")
    entry["max_current_ma"] |= {"value": current_ma, "low": None, "high": None}
    design = PAD.with_(catalog={"parts": {"sunled-xscwd23mb": entry}})
    assert transistor_of(Circuit.of(design), cavity_of(design).emitters[0].part).transistor_id == name
    named = [
        one
        for one in check(design.with_(**{"board.transistor": "2n3904"}))
        if one.field == "board.transistor"
    ]
    assert [(one.value, one.limit) for one in named] == (
        [] if current_ma <= 50 else [(f"{current_ma:g} mA", "at most 50 mA")]
    )
