"""Feedback resistors and capacitors against numbers worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lti, step

from optopad.design.circuit.amplifier import Load, chosen_amplifier, least_feedback_pf, settles_us
from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import transistor_of
from optopad.design.circuit.transimpedance import (
    counts_per_flux_per_ohm,
    emitted_mw,
    feedbacks_of,
    fitted_counts_per_flux,
    responsivity_at,
)
from optopad.design.errors import DesignError
from optopad.design.parts.assumptions import E24, assumption, standard_nearest
from optopad.design.parts.catalog import Part, packaged
from optopad.design.preset import PRESETS, preset
from optopad.design.rules.check import check, require_valid
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec.properties import part_of, used_values
from tests.said import says

PAD = preset("piacenza2017-pad")


def measured(**values: float):
    return PAD.with_(
        **{f"part_measurements.sunled-xscwd23mb.{name}": value for name, value in values.items()}
    )


def test_light_follows_the_current_behind_the_series_resistor() -> None:
    # 120 ohm at 5 V and 3.0 V forward: 16.7 of the 20 mA at which the power holds
    power = emitted_mw(part_of(PAD, "sunled-xscwd23mb", "emitter"), Circuit.of(PAD).board)
    assert power is not None
    assert power.value == pytest.approx(10.0 * (2.0 / 120) / 0.020)
    assert power.confidence == "unverified"


def test_silicon_at_a_shorter_wavelength_keeps_its_quantum_efficiency_at_best() -> None:
    diode = part_of(PAD, "osram-sfh206k", "receiver")
    green = responsivity_at(diode, 550.0)
    assert green.value == pytest.approx(0.62 * 550 / 850)
    assert green.low == pytest.approx(green.value * (1 - assumption("silicon_blue_loss").value))
    assert green.confidence == "inferred"
    assert responsivity_at(diode, 860.0) == diode.responsivity_a_per_w  # within the band where it was stated


def test_an_ohm_s_counts_are_power_times_responsivity_over_the_supply() -> None:
    per_ohm = counts_per_flux_per_ohm(Circuit.of(PAD))
    assert per_ohm is not None
    by_hand = 10e-3 * (2.0 / 120 / 0.020) * 0.62 * 550 / 850 * 1024 / 5.0
    assert [one.value for one in per_ohm] == pytest.approx([by_hand] * 8)


def test_the_pad_s_resistor_is_the_standard_value_next_to_the_wanted_one() -> None:
    found = feedbacks_of(Circuit.of(PAD), [1e5] * 8)
    assert found is not None
    assert found[0].exact_ohm == pytest.approx(146_055, rel=1e-4)  # 1e5 / 0.68467
    assert found[0].standard_ohm == 150e3
    assert found[0].low_ohm < found[0].exact_ohm < found[0].high_ohm
    assert found[0].capacitor_pf == 15.0  # at most 20 us / (150 kohm ln 2048) = 17.5 pF
    assert found[0].amplifier_id == "mcp6004"  # the slowest: 45 degrees from 9.3 pF on
    assert found[0].settles_us < 20.0


@given(st.floats(1e3, 1e9))
def test_a_standard_resistor_is_never_further_than_half_a_step_off(ohm: float) -> None:
    assert abs(math.log(standard_nearest(ohm) / ohm)) <= math.log(1.5 / 1.3) / 2 + 1e-9  # E24's widest step


@given(gain=st.floats(1e3, 1e9), settle_us=st.floats(1.0, 1e4))
def test_a_capacitor_settles_in_time_or_says_that_it_does_not(gain: float, settle_us: float) -> None:
    (first, *_) = feedbacks_of(Circuit.of(PAD.with_(**{"board.settle_us": settle_us})), [gain] * 8) or ()
    assert first.is_in_time == (first.settles_us <= settle_us * (1 + 1e-9))
    input_f = (72 + assumption("amplifier_input_pf").value) * 1e-12
    hz = packaged().amplifiers[first.amplifier_id].bandwidth_mhz.value * 1e6
    least = math.sqrt(input_f / (2 * math.pi * first.standard_ohm * hz)) * 1e12
    assert first.capacitor_pf >= least * (1 - 1e-9)  # it does not ring
    if not first.is_in_time:  # then it is the fastest that there is
        assert first.amplifier_id == "opa4350"
        assert first.capacitor_pf < 10 * least


def test_ohms_set_the_gain_of_each_receiver_and_a_number_that_of_all() -> None:
    ohms = [1e5 * (k + 1) for k in range(8)]
    per_ohm = counts_per_flux_per_ohm(Circuit.of(PAD))
    assert per_ohm is not None
    each = fitted_counts_per_flux(Circuit.of(PAD.with_(**{"gain.feedback_ohm": ohms})))
    assert each == pytest.approx([per_ohm[0].value * ohm for ohm in ohms])
    assert fitted_counts_per_flux(Circuit.of(PAD.with_(**{"gain.feedback_ohm": 2e5}))) == pytest.approx(
        [each[1]] * 8
    )
    given = feedbacks_of(Circuit.of(PAD.with_(**{"gain.feedback_ohm": 1.23e5})), None)
    assert given is not None
    assert given[0].standard_ohm == 1.23e5  # what is fitted is not moved to a standard value


def test_a_measured_power_is_taken_in_place_of_the_catalogue_s() -> None:
    half = counts_per_flux_per_ohm(Circuit.of(measured(radiant_power_mw=5.0)))
    whole = counts_per_flux_per_ohm(Circuit.of(PAD))
    assert half is not None
    assert whole is not None
    assert half[0].value == pytest.approx(whole[0].value / 2)


def bare_led() -> dict[str, object]:
    entry = part_of(PAD, "sunled-xscwd23mb", "emitter").model_dump(mode="json")
    return {name: value for name, value in entry.items() if name != "radiant_power_mw"}


def test_without_a_power_there_is_no_resistor_and_ohms_are_refused() -> None:
    bare = PAD.with_(catalog={"parts": {"sunled-xscwd23mb": bare_led()}})
    assert feedbacks_of(Circuit.of(bare), [1e5] * 8) is None
    with pytest.raises(DesignError, match=r"gain\.feedback_ohm"):
        require_valid(bare.with_(**{"gain.feedback_ohm": 1e5}))


def test_another_number_of_resistors_than_receivers_is_refused() -> None:
    wrong = PAD.with_(**{"gain.feedback_ohm": [1e5, 2e5]})
    with pytest.raises(DesignError, match=r"gain\.feedback_ohm.*8 receivers.*for 2"):
        require_valid(wrong)
    with pytest.raises(DesignError, match="exactly 8"):
        fitted_counts_per_flux(Circuit.of(wrong))


@pytest.mark.parametrize("value", ["median", 50.0, [1e5, -1.0]])
def test_a_rule_or_ohms_of_no_kind_are_refused(value: object) -> None:
    with pytest.raises(DesignError, match=r"gain\.feedback_ohm"):
        PAD.with_(**{"gain.feedback_ohm": value})


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_has_a_gain_that_can_be_built(name: str) -> None:
    design = preset(name)
    assert not [one for one in check(design) if one.field == "gain.feedback_ohm"]
    found = feedbacks_of(Circuit.of(design), [1e6] * len(cavity_of(design).receivers))
    assert found is not None
    assert all(f"{one.standard_ohm:.1e}"[:3] in E24 for one in found)


def test_the_rule_is_left_out_of_a_design_that_does_not_say_it() -> None:
    assert "feedback_ohm" not in PAD.model_dump(mode="json")["gain"]
    assert PAD.with_(**{"gain.feedback_ohm": "each"}).digest == PAD.digest
    assert PAD.with_(**{"gain.feedback_ohm": "common"}).digest != PAD.digest


def test_a_part_without_a_power_keeps_its_digest() -> None:
    assert "radiant_power_mw" not in Part.model_validate(bare_led()).model_dump(mode="json")


def test_ohms_rest_on_power_and_responsivity_a_rule_does_not() -> None:
    names = {"radiant_power_mw", "responsivity_a_per_w"}
    fitted = used_values(PAD.with_(**{"gain.feedback_ohm": 1e6}))
    assert {one.path.rsplit(".", 1)[-1] for one in fitted} & names == names
    assert {one.path.rsplit(".", 1)[-1] for one in used_values(PAD)} & names == set()


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
