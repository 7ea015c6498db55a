"""Pins, frame time and serial rates: by hand and by the board's own numbers."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from optopad.design.circuit.circuit import (
    Circuit,
    baud_error,
    frame_bytes,
    link_time_ms,
    made_baud,
    state_count,
)
from optopad.design.circuit.emitter_switch import emitter_switch, most_drive_ma
from optopad.design.circuit.pin_rules import faster_boards
from optopad.design.circuit.transimpedance import counts_per_flux_per_ohm
from optopad.design.errors import DesignError
from optopad.design.parts.catalog import find_board, packaged
from optopad.design.rules.board import firmware_findings
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import BoardUse, SensorDesign
from optopad.fabrication.connections import connections_of
from optopad.fabrication.sheets.schematic_svg import schematic_svg
from tests.design.rules.rule_cases import only
from tests.design.spec.spec_fields import good, with_layout
from tests.said import pattern, says

MEGA = find_board(packaged(), "arduino-mega-2560")
CLOCK_HZ = 16_000_000


def pins_of(design: SensorDesign) -> tuple[tuple[int, ...], tuple[str, ...]]:
    circuit = Circuit.of(design)
    return tuple(path.number for path in circuit.emitters), tuple(path.channel for path in circuit.receivers)


def test_pins_and_channels_are_dealt_in_the_boards_order() -> None:
    pins, channels = pins_of(good())
    assert pins == MEGA.digital_pins[:8] == (22, 23, 24, 25, 26, 27, 28, 29)
    assert channels == ("A0", "A1", "A2", "A3", "A4", "A5", "A6", "A7")


def test_given_pins_and_channels_are_taken_in_their_order() -> None:
    design = good(
        **{
            "board.emitter_pins": list(range(29, 21, -1)),
            "board.receiver_channels": [f"A{k}" for k in range(8, 16)],
        }
    )
    assert pins_of(design) == (tuple(range(29, 21, -1)), tuple(f"A{k}" for k in range(8, 16)))
    assert check(design) == ()


@pytest.mark.parametrize(
    ("pins", "value", "words"),
    [
        ([22] * 2 + [24, 25, 26, 27, 28, 29], "22", "pin 22 is given to 2 emitters"),
        ([22, 23], "2 entries", "8 emitters ... for 2"),
        ([1, 23, 24, 25, 26, 27, 28, 29], "1", "pin 1 carries the serial line"),
        ([54, 23, 24, 25, 26, 27, 28, 29], "54", "54 is"),
    ],
)
def test_a_bad_pin_list_is_refused_by_rules_and_by_assignment(
    pins: list[int], value: str, words: str
) -> None:
    design = good(**{"board.emitter_pins": pins})
    finding = only(design)
    assert (finding.severity, finding.field, finding.value) == ("error", "board.emitter_pins", value)
    assert says(finding.message, words)
    with pytest.raises(DesignError, match=pattern(words)):
        connections_of(Circuit.of(design))


def test_a_channel_that_is_no_analogue_input_is_refused() -> None:
    design = good(**{"board.receiver_channels": ["A0", "A1", "A2", "A3", "A4", "A5", "A6", "22"]})
    assert "22 is" in only(design).message


def test_a_board_with_a_reserved_pin_keeps_it() -> None:
    board = MEGA.model_copy(update={"reserved_pins": (22,), "digital_pins": tuple(range(23, 40))})
    design = good(**{"board.emitter_pins": [22, 23, 24, 25, 26, 27, 28, 29]})
    design = design.with_(**{"catalog.boards": {"arduino-mega-2560": board.model_dump(mode="json")}})
    assert Circuit.of(design).board.reserved_pins == (22,)
    assert "pin 22 has another job" in only(design).message


def test_more_parts_than_the_board_has_inputs_for_is_an_error() -> None:
    layout = {"pattern": "per_side", "kind": "receiver", "south": 4, "east": 5, "north": 4, "west": 4}
    emitter = {"pattern": "single", "kind": "emitter", "wall": "south", "along_mm": 30.0}
    design = with_layout(layout, emitter)
    findings = [finding for finding in check(design) if finding.field == "board.receiver_channels"]
    assert [(finding.value, finding.limit) for finding in findings] == [("17", "at most 16")]


@given(st.integers(1, 64), st.integers(1, 16))
def test_dealt_pins_are_single_and_as_many_as_the_parts(emitters: int, receivers: int) -> None:
    room = min(emitters, len(MEGA.digital_pins))
    pins, channels = MEGA.digital_pins[:room], MEGA.analog_channels[:receivers]
    assert len(set(pins)) == room
    assert len(set(channels)) == receivers
    assert not set(pins) & {*MEGA.reserved_pins, *MEGA.uart_pins}


def test_a_frame_of_72_readings_is_105_bytes() -> None:
    assert state_count(8) == 9
    assert frame_bytes(8, 8, 10) == 15 + 90  # 72 x 10 bits
    assert frame_bytes(1, 1, 10) == 15 + 3  # 20 bits, rounded up


@pytest.mark.parametrize(("prescaler", "ms"), [(128, 7.488), (64, 3.744), (32, 1.872), (16, 0.936)])
def test_72_conversions_take_what_the_data_sheet_says(prescaler: int, ms: float) -> None:
    use = BoardUse(adc_prescaler=prescaler, settle_us=0.0)
    assert replace(Circuit.of(good()), use=use).frame_ms - link_time_ms(105, use.baud) == pytest.approx(
        ms, rel=1e-12
    )


def test_a_frame_is_states_then_line() -> None:
    # 9 x (20 us + 8 x 52 us) + 105 bytes x 10 bits at 1 Mbaud
    assert replace(Circuit.of(good()), use=BoardUse()).frame_ms == pytest.approx(
        9 * (0.020 + 8 * 0.052) + 1.05, rel=1e-12
    )


@pytest.mark.parametrize(("prescaler", "measured_hz"), [(128, 129.0), (64, 246.0), (32, 452.0), (16, 746.0)])
def test_the_sum_is_slower_than_the_firmware_measured(prescaler: int, measured_hz: float) -> None:
    """Rates with 20 us of settling at 1 Mbaud on a simulated ATmega2560, from docs/validation/firmware.md."""
    allowed_hz = 1000.0 / replace(Circuit.of(good()), use=BoardUse(adc_prescaler=prescaler)).frame_ms
    # sending takes 1.05 ms of the sum and none of the firmware's time: the more, the shorter the conversions
    assert 0.6 * measured_hz < allowed_hz < measured_hz


def test_a_rate_that_the_board_cannot_reach_is_an_error_with_the_rate_that_it_can() -> None:
    assert check(good(**{"board.frame_rate_hz": 201.0})) == ()
    finding = only(good(**{"board.frame_rate_hz": 202.0}))
    assert (finding.severity, finding.field) == ("error", "board.frame_rate_hz")
    assert "a frame takes 4.97 ms, which allows 201.0 frames a second" in finding.message


@pytest.mark.parametrize(
    ("baud", "error"),
    [
        (250_000, 0.0),
        (500_000, 0.0),
        (1_000_000, 0.0),
        (2_000_000, 0.0),
        (115_200, 2_000_000 / 17 / 115_200 - 1),  # +2.1 %
        (230_400, 2_000_000 / 9 / 230_400 - 1),  # -3.5 %
        (9600, 2_000_000 / 208 / 9600 - 1),  # +0.2 %
        (4_000_000, -0.5),
    ],
)
def test_the_clock_makes_the_rate_of_the_nearest_divisor(baud: int, error: float) -> None:
    assert baud_error(CLOCK_HZ, baud) == pytest.approx(error, abs=1e-12)


@given(st.integers(1200, 2_000_000))
def test_no_other_divisor_comes_nearer_than_half_a_step(baud: int) -> None:
    made = made_baud(CLOCK_HZ, baud)
    divisor = round(2_000_000 / made)
    assert made == 2_000_000 / divisor
    assert abs(2_000_000 / baud - divisor) <= 0.5


@pytest.mark.parametrize(
    ("baud", "severity"), [(1_000_000, None), (9600, None), (115_200, "warning"), (230_400, "error")]
)
def test_a_rate_is_judged_by_how_far_off_it_is(baud: int, severity: str | None) -> None:
    changes: dict[str, Any] = {"board.baud": baud, "board.frame_rate_hz": 5.0}
    findings = check(good(**changes))
    assert [finding.severity for finding in findings] == ([severity] if severity else [])


def test_the_rate_that_starts_a_boot_loader_is_a_warning_on_native_usb_alone() -> None:
    for kind, is_usb in (("raspberry-pi-pico", True), ("teensy-41", True), ("arduino-mega-2560", False)):
        for baud in (1200, 2400):
            changes: dict[str, Any] = {"board.kind": kind, "board.baud": baud, "board.frame_rate_hz": 1.0}
            said = [one for one in check(good(**changes)) if "boot" in one.message or "upload" in one.message]
            assert [(one.severity, one.field, one.value) for one in said] == (
                [("warning", "board.baud", "1200")] if is_usb and baud == 1200 else []
            )


def test_a_rate_that_is_off_names_what_the_board_makes_and_the_exact_ones() -> None:
    finding = only(good(**{"board.baud": 115_200}))
    assert "117647 baud instead, +2.1%" in finding.message
    assert "250000, 500000, 1000000, 2000000" in finding.way_out


def test_a_prescaler_that_the_board_lacks_is_an_error_with_those_that_it_has() -> None:
    finding = only(good(**{"board.adc_prescaler": 63}))
    assert (finding.field, finding.value, finding.limit) == (
        "board.adc_prescaler",
        "63",
        "one of 2, 4, 8, 16, 32, 64, 128",
    )


def test_a_board_of_3_3_volts_gets_a_circuit_that_its_pins_bear() -> None:
    pad = good(**{"board.kind": "teensy-40", "board.frame_rate_hz": 1000.0})
    assert not [one for one in check(pad) if one.severity == "error"]
    board, led = Circuit.of(pad).board, cavity_of(pad).emitters[0].part
    assert (board.emitter_v, board.pin_v, board.full_scale_v) == (5.0, 3.3, 3.3)
    mega, teensy = emitter_switch(led, MEGA), emitter_switch(led, board)
    assert teensy.series_ohm == mega.series_ohm
    assert teensy.base_ohm < mega.base_ohm
    assert teensy.base_current_ma == pytest.approx((3.3 - 0.7) / teensy.base_ohm * 1e3)
    assert teensy.base_current_ma <= most_drive_ma(Circuit.of(pad))[1]
    assert "3.3 V for the amplifiers" in schematic_svg(pad)
    per_ohm, of_mega = counts_per_flux_per_ohm(Circuit.of(pad)), counts_per_flux_per_ohm(Circuit.of(good()))
    assert per_ohm is not None
    assert of_mega is not None
    assert per_ohm[0].value / of_mega[0].value == pytest.approx(4096 / 3.3 / (1024 / 5.0))


def test_every_packaged_board_says_its_voltages_and_which_readings_it_is_slow_for() -> None:
    for name, board in packaged().boards.items():
        assert board.supply_v is not None, name
        assert board.logic_v is not None, name
        assert board.divides_clock == (board.firmware is not None), name


def test_no_two_packaged_boards_are_the_same_to_the_host_or_the_core() -> None:
    boards = packaged().boards.values()
    numbers = [board.link_number for board in boards]
    macros = [board.arduino.core_macro for board in boards if board.arduino]
    assert 0 not in numbers
    assert [len({*numbers}), len({*macros})] == [len(numbers), len(macros)]


def test_the_program_knows_each_pin_and_input_of_each_packaged_board() -> None:
    for name, board in packaged().boards.items():
        most = len(board.digital_pins), len(board.analog_channels)
        circuit = Circuit.of(good(**{"board.kind": name}))
        circuit = replace(circuit, emitter_count=most[0], receiver_count=most[1])
        assert list(firmware_findings(circuit)) == [], name


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"adc_reference_v": 5.0}, "adc_reference_v = 5 V is above logic_v = 3.3 V"),
        ({"conversion_us": None}, "conversion_us is missing"),
        ({"adc_prescalers": [16]}, "adc_clocks_per_conversion, adc_prescalers and exact_bauds of AVRs"),
        ({"digital_pins": [2, 2]}, "listed once"),
    ],
)
def test_an_entry_of_ones_own_is_refused_with_the_way_out(changes: dict[str, Any], words: str) -> None:
    table = packaged().boards["teensy-40"].model_dump(mode="json", exclude_none=True)
    table = {key: one for key, one in (table | changes).items() if one is not None}
    with pytest.raises(DesignError, match=re.escape(words)):
        good(catalog={"boards": {"mine": table}})


def test_a_board_without_voltages_is_warned_of() -> None:
    table = packaged().boards["teensy-40"].model_dump(mode="json", exclude_none=True)
    del table["supply_v"], table["logic_v"]
    found = [str(one) for one in check(good(catalog={"boards": {"mine": table}}, **{"board.kind": "mine"}))]
    assert any("give its voltages" in one for one in found)


def test_the_timing_model_gives_a_teensy_a_thousand_frames_a_second() -> None:
    pad = good(**{"board.kind": "teensy-40"})
    assert Circuit.of(pad).frame_rate_hz > 1000.0
    by_hand = 9 * (0.020 + 8 * 5.2e-3) + frame_bytes(8, 8, 12) / 5e6 * 1e3
    assert 1e3 / Circuit.of(pad).frame_rate_hz == pytest.approx(by_hand)
    names = [name for name, _ in faster_boards(Circuit.of(good()))]
    assert names[0] == "teensy-40"
    assert "raspberry-pi-pico" not in names


def test_averages_that_miss_the_rate_are_named() -> None:
    found = [str(one) for one in check(good(**{"board.averages": 20})) if one.severity == "error"]
    assert any(
        "allows 13.1 frames a second" in one and "lower it, board.averages," in one for one in found
    ), found
    teensy = good(**{"board.kind": "teensy-40", "board.averages": 200})
    assert any("faster board" in str(one) for one in check(teensy))
