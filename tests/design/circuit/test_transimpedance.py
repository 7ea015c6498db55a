"""Feedback resistors and capacitors against numbers worked by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.circuit.circuit import Circuit
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
