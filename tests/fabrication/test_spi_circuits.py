"""SPI converters and LED drivers: from each part through its chip to its reading, on every sheet alike."""

from __future__ import annotations

import csv
import io
import math
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lti, step

from optopad.design.circuit.circuit import Circuit, frame_bytes, sending_time_ms
from optopad.design.circuit.emitter_switch import current_sink, emitter_switch, supply_current
from optopad.design.circuit.transimpedance import (
    counts_per_flux_per_ohm,
    settling_findings,
)
from optopad.design.errors import DesignError
from optopad.design.pad import Pad
from optopad.design.parts.catalog import packaged
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.connections import connections_of
from optopad.fabrication.driver.link.protocol import Command, Kind, pack_command
from optopad.fabrication.driver.sensor import Sensor
from optopad.fabrication.driver_config import driver_config, dump_driver_config
from optopad.fabrication.driver_file import config_from_document
from optopad.fabrication.sheets.all_sheets import sheet_texts, wiring_csv
from optopad.fabrication.sheets.bom import bom_rows
from optopad.fabrication.sheets.schematic_svg import schematic_svg
from optopad.fabrication.sketch import config_header, firmware_settings
from optopad.sims.readings.signal_chain import reading_times_s
from tests.fabrication.simulated_board import (
    EMITTER_SWITCHED,
    INPUT_HELD,
    SUPPLY_MV,
    Run,
    board_on_a_port,
    portable_pad,
    quantised,
    random_table,
    simulate,
    unpack_self_test,
)
from tests.fabrication.test_multiplexers import disc, errors
from tests.said import says

CONVERTERS = {
    name: SUPPLY_MV if one.full_scale_v is None else round(1e3 * one.full_scale_v)
    for name, one in packaged().converters.items()
}
"""Full scale of each converter of the catalogue on the simulated board [mV]."""
MANY = {"pattern": "ring", "emitters": 30, "receivers": 32}
SAID = [
    (7_000.0, pack_command(Command.RATE, 0)),
    (8_000.0, pack_command(Command.START)),
    (150_000.0, pack_command(Command.STOP)),
    (170_000.0, pack_command(Command.START)),
    (300_000.0, pack_command(Command.SELF_TEST)),
]


def spi_disc(converter: str | None = "mcp3208", driver: str | None = None, **changes: object) -> SensorDesign:
    """The disc of `test_multiplexers` on a Teensy with a converter or else its multiplexers, and LED drivers."""
    circuits: dict[str, object] = {
        "board.receivers": {"multiplexer": "74hc4067"} if converter is None else {"converter": converter},
        "board.emitters": None if driver is None else {"driver": driver},
        "board.frame_rate_hz": 5.0,
    }
    return disc(**circuits).with_(**changes)


def ring_of_many(**changes: object) -> SensorDesign:
    """30 emitters and 32 receivers, two TLC5947 and four converters."""
    return spi_disc(driver="tlc5947", layout=[MANY], **changes)


def own(table: str, name: str, **changes: object) -> dict[str, Any]:
    """A copy of a packaged entry under the name `mine`."""
    entry = getattr(packaged(), table)[name].model_dump(mode="json")
    return {f"catalog.{table}": {"mine": entry | changes}}


def warnings(design: SensorDesign) -> list[str]:
    return [str(one) for one in check(design) if one.severity == "warning"]


# from each part to its reading


@pytest.mark.parametrize("converter", CONVERTERS)
def test_every_receiver_is_followed_to_its_reading(converter: str) -> None:
    design = spi_disc(converter)
    assert not errors(design)
    config = config_from_document(tomllib.loads(dump_driver_config(design)), where="driver.toml")
    assert config == driver_config(design)
    assert (config.board.converter, config.board.adc_bits) == (converter.upper(), Circuit.of(design).adc.bits)
    assert config.board.spi_pins == Circuit.of(design).spi_pins == (13, 11, 12)
    assert config.board.select_pins == Circuit.of(design).receiver_chips[0].pins
    known = packaged().converters[converter]
    assert config.frame.bits_per_reading == known.bits
    wiring = {row["reference"]: row for row in csv.DictReader(io.StringIO(wiring_csv(design)))}
    drawing, settings = schematic_svg(design), firmware_settings(Pad.of(design))
    for column, entry in enumerate(config.receivers):
        chip, channel = divmod(column, known.channels)
        label = f"U{chip + 1}-C{channel}"
        assert (entry.name, entry.column) == (f"R{column + 1}", column)
        assert (entry.channel, entry.channel_number, entry.address) == (label, chip, channel)
        assert wiring[entry.name]["pin"] == label
        block = drawing[drawing.index(f"<title>U{chip + 1}: {converter.upper()}") :]
        assert re.findall(r">(R\d+)-A<", block)[channel] == entry.name
        assert (settings.circuit.receivers[column].number, settings.circuit.receivers[column].terminal) == (
            chip,
            channel,
        )
    for chip, pin in enumerate(Circuit.of(design).receiver_chips[0].pins):
        block = drawing[drawing.index(f"<title>U{chip + 1}: ") :].partition("</g>")[0]
        assert re.findall(r">D(\d+)<", block) == ["13", "11", "12", str(pin)]
    pins = {one.path.number for one in connections_of(Circuit.of(design)).emitters}
    assert not pins & {*Circuit.of(design).receiver_chips[0].pins, *Circuit.of(design).spi_pins}
    chips = tuple(f"U{chip + 1}" for chip in range(known.needed(24)))
    assert [row.references for row in bom_rows(design) if row.catalogue_id == converter] == [chips]


def test_every_emitter_is_followed_from_its_led_driver() -> None:
    design = ring_of_many()
    assert not errors(design)
    config = config_from_document(tomllib.loads(dump_driver_config(design)), where="driver.toml")
    assert (config.board.led_driver, config.board.driver_pins, config.board.shift_pins) == (
        "TLC5947",
        (2, 3),
        None,
    )
    wiring = {row["reference"]: row for row in csv.DictReader(io.StringIO(wiring_csv(design)))}
    drawing = schematic_svg(design)
    for number, entry in enumerate(config.emitters):
        chip, output = divmod(number, 24)
        assert (entry.state, entry.pin, entry.output) == (number, number, f"L{chip + 1}-Q{output}")
        assert wiring[entry.name]["pin"] == entry.output
        assert "LED driver" in wiring[entry.name]["polarity"]
        block = drawing[drawing.index(f"<title>L{chip + 1}: TLC5947") :]
        assert re.findall(r">(E\d+|open)<", block)[output] == entry.name
    bill = {row.item: row for row in bom_rows(design)}
    assert "NPN transistor" not in bill
    assert "series resistor" not in bill
    assert bill["reference resistor"].references == ("L1-RI", "L2-RI")
    sheets = sheet_texts(design)
    assert "transistor" not in sheets["orientation.svg"] + sheets["casting.md"] + sheets["schematic.svg"]


def test_circuits_share_the_bus_and_no_pin_is_given_twice() -> None:
    design = ring_of_many()
    settings = firmware_settings(Pad.of(design))
    pins = [pin for chips in settings.circuit.chips for pin in chips.pins]
    assert len({*pins, *Circuit.of(design).spi_pins}) == 2 + 4 + 3
    text = config_header(settings)
    assert "#define DRIVER_HZ 15000000UL" in text  # two in a chain
    assert "#define CONVERTER_HZ 1000000UL" in text  # at 3.3 V
    one = config_header(firmware_settings(Pad.of(spi_disc("ads8688", "tlc5947"))))
    assert "#define DRIVER_HZ 30000000UL" in one
    assert "#define CONVERTER_MODE SPI_MODE1" in one


# time, range, current


def test_a_frame_is_the_sum_of_data_settling_and_readings() -> None:
    design = ring_of_many(**{"board.averages": 3, "board.settle_us": 30.0})
    board, states = Circuit.of(design).board, 31
    data_us = 2 * 24 * 12 / 15.0 + 4 + 3  # bits at 15 MHz, four edges, the slowest of the oscillators
    reading_us = 24 / 1.0 + 1 + 1  # clocks at 1 MHz, chip select high, calls
    state_us = data_us + 30.0 + 32 * 3 * reading_us
    line_ms = sending_time_ms(board, design.board, frame_bytes(30, 32, 12))
    found_ms = Circuit.of(design).frame_ms
    assert found_ms - line_ms == pytest.approx(states * state_us / 1e3, rel=1e-12)
    assert Circuit.of(design).frame_rate_hz == pytest.approx(1e3 / found_ms)
    timing = driver_config(design).timing
    assert (timing.switch_us, timing.conversion_us) == pytest.approx((data_us, reading_us))
    at = reading_times_s(design)
    assert at[0, 0] * 1e6 == pytest.approx(data_us + 30.0)
    assert at[-1, -1] * 1e6 == pytest.approx(states * state_us - 3 * reading_us)
    assert Circuit.of(design).lit_ms * 1e3 == pytest.approx(state_us - data_us)


@pytest.mark.parametrize(
    ("board", "converter", "us"),
    [
        ("teensy-41", "mcp3208", 24 / 1.0 + 2),
        ("arduino-uno-r4-minima", "mcp3208", 24 / 2.0 + 2),
        ("teensy-41", "ads8688", 32 / 17.0 + 3),
        ("teensy-41", "ads7953", 48 / 20.0 + 3 * 2),
    ],
)
def test_a_reading_takes_its_clocks_at_the_supplys_speed(board: str, converter: str, us: float) -> None:
    found = Circuit.of(spi_disc(converter, **{"board.kind": board})).adc.reading_ms * 1e3
    assert found == pytest.approx(us)


def test_the_boards_own_circuits_take_no_time_for_switching() -> None:
    assert Circuit.of(disc()).switch_ms == 0.0


def test_full_scale_is_the_converters_and_ends_at_the_amplifiers_supply() -> None:
    own_adc, mcp, ads = disc(), spi_disc("mcp3208"), spi_disc("ads8688")
    assert [Circuit.of(one).adc.full_scale_v for one in (own_adc, mcp, ads)] == [3.3, 3.3, 5.12]
    assert [Circuit.of(one).adc.supply_v for one in (own_adc, mcp, ads)] == [3.3, 3.3, 5.0]
    assert [Circuit.of(one).adc.full_scale_counts for one in (own_adc, mcp, ads)] == [4095, 4095, 64000]
    assert driver_config(mcp).board.adc_reference == "MCP3208, its supply, 3.3 V"
    assert driver_config(ads).board.adc_reference == "ADS8688, its own range, 5.12 V"
    per_ohm = [counts_per_flux_per_ohm(Circuit.of(one)) for one in (mcp, ads)]
    assert per_ohm[0] is not None
    assert per_ohm[1] is not None
    assert per_ohm[1][0].value / per_ohm[0][0].value == pytest.approx(2**16 / 2**12 * 3.3 / 5.12)
    amplifier = next(row for row in bom_rows(ads) if row.item == "transimpedance amplifier")
    assert amplifier.value.startswith("single supply of 5 V")


def test_a_target_of_ten_bits_is_warned_of_at_sixteen() -> None:
    (found,) = [one for one in warnings(spi_disc("ads8688")) if one.startswith("gain.target_counts")]
    assert says(found, "300 counts, 0.5% ... 5%, 3277 counts")
    assert "set gain.target_counts = 19661 or so" in found
    for design in (spi_disc("mcp3208"), spi_disc("ads8688", **{"gain.target_counts": 19661.0}), disc()):
        assert not [one for one in warnings(design) if one.startswith("gain.target_counts")]


def test_an_input_filter_settles_to_half_a_count() -> None:
    entry = packaged().converters["ads8688"]
    w = 2 * math.pi * 15e3
    t, answer = step(lti([w**2], [1, math.sqrt(2) * w, w**2]), T=np.linspace(0, 400e-6, 40_001))
    off = np.abs(answer - 1) * 2**16
    late = off[t * 1e6 >= entry.filter_settles_us]
    assert late.max() < 0.75  # the envelope's factor of sqrt 2 is left out
    assert off[t * 1e6 >= 0.9 * entry.filter_settles_us].max() > 0.75
    assert packaged().converters["mcp3208"].filter_settles_us == 0.0


def test_the_amplifiers_have_what_the_filter_leaves_of_the_settle_time() -> None:
    short = [str(one) for one in settling_findings(Circuit.of(spi_disc("ads8688")))]
    assert len(short) == 1
    assert "ADS8688" in short[0]
    assert "more than 177 us" in short[0]
    assert not list(settling_findings(Circuit.of(spi_disc("ads8688", **{"board.settle_us": 250.0}))))
    ohms = {"gain.feedback_ohm": 1e8, "board.settle_us": 200.0}
    slow = [str(one) for one in settling_findings(Circuit.of(spi_disc("ads8688", **ohms)))]
    fitted = re.search(r"at least (\d+) us", slow[0])
    assert fitted is not None
    enough = {**ohms, "board.settle_us": float(fitted[1])}
    late = [
        one
        for one in settling_findings(Circuit.of(spi_disc("ads8688", **enough)))
        if one.field == "board.settle_us"
    ]
    assert not late
    assert "177 us" in " ".join(row.note for row in bom_rows(spi_disc("ads8688")))


def test_the_reference_resistor_sets_the_emitters_current() -> None:
    design = spi_disc(None, "tlc5947")
    sink, part = current_sink(Circuit.of(design)), cavity_of(design).emitters[0].part
    assert sink is not None
    assert part.max_current_ma is not None
    exact_ohm = 41 * 1.2 / (part.max_current_ma.value / 1e3)
    assert exact_ohm <= sink.reference_ohm < exact_ohm * 1.1
    assert sink.current_ma == pytest.approx(41 * 1.2 / sink.reference_ohm * 1e3)
    supply = supply_current(Circuit.of(spi_disc("ads8688", "tlc5947")))
    assert supply.emitter_ma == pytest.approx(sink.current_ma)
    assert supply.circuits_ma == pytest.approx(3 * 13.0 + 20.0)
    assert supply.full_power_ma == pytest.approx(
        sink.current_ma + 59.0 + supply.amplifiers_ma + supply.board_ma
    )
    assert "59 for converters and LED drivers" in schematic_svg(spi_disc("ads8688", "tlc5947"))
    by_transistor, by_driver = (counts_per_flux_per_ohm(Circuit.of(one)) for one in (disc(), design))
    assert by_transistor is not None
    assert by_driver is not None
    usual_ma = emitter_switch(part, Circuit.of(design).board).usual_current_ma
    assert by_driver[0].value / by_transistor[0].value == pytest.approx(sink.current_ma / usual_ma)


def test_an_output_gives_thirty_milliamperes_and_one_current_for_all() -> None:
    led = packaged().parts["kingbright-apt2012zgc"].model_dump(mode="json")
    strong = led | {"max_current_ma": led["max_current_ma"] | {"value": 50.0}}
    design = spi_disc(None, "tlc5947", **{"catalog.parts": {"strong": strong}, "emitters.part": "strong"})
    sink = current_sink(Circuit.of(design))
    assert sink is not None
    assert sink.current_ma == pytest.approx(49.2 / 1.8)  # 1.64 kohm is no E24 value
    assert sink.current_ma <= 30.0
    notes = [str(one) for one in check(design) if one.severity == "note"]
    assert any("an output of TLC5947 limits the emitters' current (27.3 mA of 50 mA" in one for one in notes)
    mixed = [
        {**MANY, "emitters": 12},
        {"pattern": "at_angles", "kind": "emitter", "angles_deg": [1.0], "part": "strong"},
    ]
    both = spi_disc(None, "tlc5947", **{"catalog.parts": {"strong": strong}, "layout": mixed})
    assert current_sink(Circuit.of(both)) == current_sink(Circuit.of(spi_disc(None, "tlc5947")))
    notes = [str(one) for one in check(both) if one.severity == "note"]
    assert any("all outputs of TLC5947 have one current" in one for one in notes)


# the firmware on the simulated board


def run_of(
    design: SensorDesign, folder: Path, *changes: str, duration_us: float = 400_000
) -> tuple[Any, Run]:
    """The voltages of a made-up table, and what the simulated board did with them."""
    table = random_table(firmware_settings(Pad.of(design)))
    return table, simulate(None, folder, design, table, SAID, duration_us=duration_us, changes=changes)


def settled_us(run: Run) -> float:
    """Shortest time from the light of an emitter to a held input, of all states with an emitter on [us]."""
    shortest, on_us = math.inf, None
    for cycle, kind, number, _ in run.log.tolist():
        at_us = cycle / run.clock_hz * 1e6
        if kind == EMITTER_SWITCHED:
            on_us = at_us if number % 2 else None
        elif kind == INPUT_HELD and on_us is not None:
            shortest = min(shortest, at_us - on_us)
    return shortest


@pytest.mark.slow
@pytest.mark.parametrize(
    ("converter", "driver"),
    [
        *((name, None) for name in CONVERTERS),
        *(("mcp3208", "tlc5947"), ("ads8688", "tlc5947"), (None, "tlc5947")),
    ],
)
@pytest.mark.parametrize("averages", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_the_firmware_reads_every_receiver_under_every_emitter(
    converter: str | None, driver: str | None, averages: int, native_harness: None, tmp_path: Path
) -> None:
    design = portable_pad(spi_disc(converter, driver, **{"board.averages": averages}))
    settings = firmware_settings(Pad.of(design))
    table, run = run_of(design, tmp_path)
    frames = run.frames.counts
    assert len(frames) >= 15
    bits = settings.circuit.adc.bits
    counts = quantised(table, bits, CONVERTERS.get(converter or "", SUPPLY_MV))
    assert (frames == np.minimum(counts, 2**bits - 1)).all()
    assert settled_us(run) >= design.board.settle_us
    conversions = (run.log["kind"] == INPUT_HELD).sum()
    held = 1 if converter is None else packaged().converters[converter].family.frames  # for each reading
    assert len(frames) <= conversions / (table.size * averages * held) < len(frames) + 4
    (answer,) = run.of(Kind.SELF_TEST)
    assert unpack_self_test(answer).config_crc == settings.config_crc()


@pytest.mark.slow
def test_a_chain_of_two_drivers_and_four_converters_is_read_whole(
    native_harness: None, tmp_path: Path
) -> None:
    design = portable_pad(ring_of_many())
    table, run = run_of(design, tmp_path)
    assert len(run.frames.counts) >= 8
    assert (run.frames.counts == quantised(table, 12)).all()
    held = run.log[run.log["kind"] == INPUT_HELD]["number"] % 256
    assert set(held) == set(range(32))


def test_a_range_of_ones_own_is_written_to_every_channel(native_harness: None, tmp_path: Path) -> None:
    entry = own(
        "converters", "ads8688", range_code=5, full_scale_v=10.24, title="ADS8688 to 10.24 V, 8 inputs"
    )
    design = portable_pad(spi_disc("ads8688"))
    boards = design.model_dump(mode="json")["catalog"]["boards"]
    both = {"boards": boards, "converters": entry["catalog.converters"]}
    table, run = run_of(design.with_(catalog=both, **{"board.receivers.converter": "mine"}), tmp_path)
    assert (run.frames.counts == quantised(table, 16, 10240)).all()


def test_an_emitter_stays_on_through_its_state_and_only_one_is_on(
    native_harness: None, tmp_path: Path
) -> None:
    design = portable_pad(spi_disc("mcp3208", "tlc5947"))
    _, run = run_of(design, tmp_path, duration_us=60_000)
    on, held_lit = set(), []
    for _, kind, number, _ in run.log.tolist():
        if kind == EMITTER_SWITCHED:
            on = on | {number // 2} if number % 2 else on - {number // 2}
            assert len(on) <= 1
        elif kind == INPUT_HELD:
            held_lit.append(len(on))
    assert held_lit[: 13 * 24] == [1] * 12 * 24 + [0] * 24


def test_a_state_beyond_the_pwm_period_is_warned_of_and_is_dark_in_between(
    native_harness: None, tmp_path: Path
) -> None:
    short, long = spi_disc("mcp3208", "tlc5947"), spi_disc("mcp3208", "tlc5947", **{"board.averages": 2})
    assert Circuit.of(short).lit_ms * 1e3 == pytest.approx(20 + 24 * 26)
    assert not [one for one in warnings(short) if "PWM period" in one]
    (found,) = [one for one in warnings(long) if "PWM period" in one]
    assert says(found, "1271 us ... 731 us")
    design = portable_pad(spi_disc("mcp3208", "tlc5947", **{"board.averages": 6}))
    _, run = run_of(design, tmp_path, duration_us=60_000)
    switched = run.log[run.log["kind"] == EMITTER_SWITCHED]
    off_ns = np.diff(switched["cycle"])[switched["number"][:-1] % 2 == 0]
    assert (off_ns == 250).any()  # one step of 4 MHz


@pytest.mark.slow
def test_a_settle_time_that_leaves_out_the_drivers_delay_is_caught(
    native_harness: None, tmp_path: Path
) -> None:
    """The slowest oscillator of the TLC5947, 2.4 MHz, is on 2.1 us after blanking."""
    design, slow = portable_pad(spi_disc("ads8688", "tlc5947")), "GRAY_STEP_NS=417"
    _, run = run_of(design, tmp_path, slow, duration_us=30_000)
    assert settled_us(run) >= design.board.settle_us
    _, run = run_of(design, tmp_path, slow, "DRIVER_ON_US=0", duration_us=30_000)
    assert settled_us(run) < design.board.settle_us


@pytest.mark.slow
@pytest.mark.parametrize(
    ("converter", "change"),
    [
        ("mcp3208", "CONVERTER_HZ=2100000UL"),
        ("mcp3208", "CONVERTER_MODE=SPI_MODE1"),
        ("mcp3208", "CONVERTER_GAP_US=0"),
        ("ads8688", "CONVERTER_HZ=20000000UL"),
        ("ads8688", "CONVERTER_MODE=SPI_MODE0"),
        ("ads8688", "CONVERTER_GAP_US=0"),
        ("ads8688", "DRIVER_HZ=40000000UL"),
    ],
)
def test_a_program_that_breaks_a_limit_of_a_chip_is_refused_by_the_simulation(
    converter: str, change: str, native_harness: None, tmp_path: Path
) -> None:
    design = portable_pad(spi_disc(converter, "tlc5947"))
    with pytest.raises(subprocess.CalledProcessError):
        run_of(design, tmp_path, change, duration_us=30_000)


@pytest.mark.slow
def test_the_hosts_driver_reads_sixteen_bits(native_harness: None, tmp_path: Path) -> None:
    design = portable_pad(spi_disc("ads8688", "tlc5947"))
    table = random_table(firmware_settings(Pad.of(design)), seed=3)
    file = tmp_path / "driver.toml"
    file.write_text(dump_driver_config(design), encoding="utf-8")
    with (
        board_on_a_port(None, tmp_path, design, table) as port,
        Sensor(file, port, baseline_s=0.0) as sensor,
    ):
        frames = [sensor.read() for _ in range(3)]
        crc = sensor.self_test().config_crc
    assert all((frame.counts == quantised(table, 16, 5120)).all() for frame in frames)
    assert crc == firmware_settings(Pad.of(design)).config_crc()


# refusals, and what check proposes


def test_too_few_inputs_and_pins_propose_the_circuits_on_the_bus() -> None:
    found = errors(disc(**{"board.receivers": None, "layout": [MANY]}))
    assert any(
        'or set board.receivers.converter = "mcp3208", of 12 bits: 4 of them, the SPI bus and 4 select pins'
        in one
        for one in found
    )
    assert any(
        'or set board.emitters.driver = "tlc5947", of constant current: 2 of them, the SPI bus and 2 pins'
        in one
        for one in found
    )
    assert not errors(ring_of_many())
    avr = errors(disc(**{"board.kind": "arduino-uno", "board.receivers": None}))
    assert avr
    assert not any("converter =" in one or "driver =" in one for one in avr)


FIVE_VOLT = {"logic_low_v": None, "logic_high_v": None}
"""Changes that make a converter of one supply of 5 V."""


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"board.kind": "arduino-mega-2560"}, ["Arduino Mega 2560", "teensy-41"]),
        ({"board.receivers.select_pins": [2, 29, 30]}, ["no emitter", "choose among"]),
        ({"board.receivers.select_pins": [29, 30]}, ["MCP3208 needs 3 pins", "leave the list out"]),
        ({"board.receivers.select_pins": [13, 29, 30]}, ["MCP3208 needs 3 pins", "leave the list out"]),
        ({"board.emitter_pins": [*range(2, 13), 28]}, ["pin 11 has another job", "choose another pin"]),
        ({"board.receiver_channels": ["A0"]}, ["board's own converter", "remove it"]),
        ({"board.reference": "internal"}, ["board's own converter", "remove it"]),
        ({"board.kind": "nucleo-l432kc"}, ["board has pins", "set board.emitters"]),
        ({"board.receivers.converter": "mcp3209"}, ["the catalogue", "did you mean mcp3208"]),
        ({"board.frame_rate_hz": 5000.0}, ["lower it", "name a faster converter"]),
    ],
)  # fmt: skip
def test_a_wrong_use_of_a_converter_is_refused_with_the_way_out(
    changes: dict[str, object], words: list[str]
) -> None:
    found = errors(spi_disc().with_(**changes))
    assert any(all(word in one for word in words) for one in found), found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"board.kind": "arduino-mega-2560"}, ["Arduino Mega 2560", "teensy-41"]),
        ({"board.emitters.pins": [2, 3, 4]}, ["TLC5947"]),
        ({"board.emitters.pins": [2, 13]}, ["TLC5947 needs 2 pins", "leave them out"]),
        ({"board.emitter_pins": list(range(2, 12))}, ["switched by LED drivers", "latch and blank"]),
        ({"board.emitters.driver": "tlc5974"}, ["the catalogue", "did you mean tlc5947?"]),
        (own("led_drivers", "tlc5947", supply_low_v=4.5), ["the level", "choose another one"]),
        (own("led_drivers", "tlc5947", max_led_v=4.0), ["TLC5947", "lower supply_v"]),
        (
            own("led_drivers", "tlc5947", least_output_ma={
                "value": 29.0, "unit": "mA", "source": "made up", "confidence": "unverified"}),
            ["TLC5947", "remove board.emitters.driver"],
        ),
    ],
)  # fmt: skip
def test_a_wrong_use_of_a_driver_is_refused_with_the_way_out(
    changes: dict[str, object], words: list[str]
) -> None:
    chosen = {"board.emitters.driver": "mine"} if "catalog.led_drivers" in changes else {}
    found = errors(spi_disc(None, "tlc5947").with_(**changes, **chosen))
    assert any(all(word in one for word in words) for one in found), found


def test_a_supply_below_forward_voltage_and_dropout_is_warned_of() -> None:
    led = packaged().parts["kingbright-apt2012zgc"].model_dump(mode="json")
    high = led | {"forward_voltage_v": led["forward_voltage_v"] | {"value": 3.9, "low": None, "high": 4.1}}
    design = spi_disc(None, "tlc5947", **{"catalog.parts": {"high": high}, "emitters.part": "high"})
    (found,) = [one for one in warnings(design) if "constant current at every forward voltage" in one]
    assert says(found, "5.1 V with ... 1 V at ... TLC5947 ... supply's 5 V")
    assert not [one for one in warnings(spi_disc(None, "tlc5947")) if "forward voltage" in one]


def test_a_converter_of_five_volts_drives_no_pin_of_three() -> None:
    changes = own("converters", "ads8688", **FIVE_VOLT)
    found = errors(spi_disc().with_(**changes, **{"board.receivers.converter": "mine"}))
    assert any(says(one, "3.3 V; needs ... 4.75 to 5.25 V ... mcp3208") for one in found)
    five = {"board.kind": "arduino-uno-r4-minima", "board.emitters": {"shift_register": "74hc595"}}
    assert not errors(spi_disc().with_(**changes, **five, **{"board.receivers.converter": "mine"}))
    teensy = packaged().boards["teensy-41"].model_dump(mode="json") | {"supply_v": 3.3}
    low = spi_disc("ads8688").with_(**{"catalog.boards": {"low": teensy}, "board.kind": "low"})
    assert any("3.3 V and 3.3 V; needs 4.75 to 5.25 V and 1.65 to 5.25 V" in one for one in errors(low))


@pytest.mark.parametrize(
    ("circuits", "words"),
    [
        ({"board.receivers": {"converter": "mcp3208", "multiplexer": "74hc4067"}}, "both are given, 74hc4067 and"),
        ({"board.receivers": {}}, "name a multiplexer"),
        ({"board.receivers": {"multiplexer": "74hc4067", "select_pins": [1]}}, "remove select_pins"),
        ({"board.receivers": {"converter": "mcp3208", "address_pins": [1]}}, "remove address_pins"),
        ({"board.emitters": {"driver": "tlc5947", "shift_register": "74hc595"}}, "remove shift_register or driver"),
        ({"board.emitters": {}}, "name a shift_register or a driver"),
        (own("converters", "ads8688", range_code=None), "give both, as 6 and 5.12 for 0 to 5.12 V"),
        (own("converters", "ads8688", logic_low_v=None), "give both, or neither"),
        (own("converters", "mcp3208", channels=16), "must be at most 8"),
        (own("converters", "ads7953", channels=17), "must be at most 16"),
        (own("converters", "ads7953", range_code=None), "give both, as 0 and 2.5 for 0 to 2.5 V"),
        (own("converters", "mcp3208", bits=10), "the frames of mcp3208 have 12 bits; set bits = 12"),
    ],
)  # fmt: skip
def test_a_contradiction_is_refused_with_the_way_out(circuits: dict[str, object], words: str) -> None:
    with pytest.raises(DesignError, match=re.escape(words)):
        disc(**circuits)
