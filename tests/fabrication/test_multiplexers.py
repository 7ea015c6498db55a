"""Multiplexers: from each receiver through its channel and address to its reading, on every sheet alike."""

from __future__ import annotations

import csv
import io
import re
import tomllib
from pathlib import Path

import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import counts_per_flux_per_ohm
from optopad.design.errors import DesignError
from optopad.design.pad import Pad
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign
from optopad.fabrication.connections import connections_of
from optopad.fabrication.driver.link.protocol import Command, Kind, pack_command
from optopad.fabrication.driver_config import driver_config, dump_driver_config
from optopad.fabrication.driver_file import config_from_document
from optopad.fabrication.sheets.all_sheets import wiring_csv
from optopad.fabrication.sheets.bom import bom_rows
from optopad.fabrication.sheets.schematic_svg import schematic_svg
from optopad.fabrication.sketch import firmware_settings
from tests.fabrication.simulated_board import (
    INPUT_HELD,
    portable_pad,
    quantised,
    random_table,
    simulate,
    unpack_self_test,
)
from tests.said import says

RING = {"pattern": "ring", "emitters": 12, "receivers": 24, "sequence": "ERR"}


def disc(**changes: object) -> SensorDesign:
    """12 emitters and 24 receivers around a disc of 150 mm, on a Teensy with two multiplexers."""
    document = {
        "schema_version": 1,
        "name": "disc",
        "cavity": {"outline": "disc", "diameter_mm": 150.0, "clear_thickness_mm": 10.0},
        "mold": {"outer_diameter_mm": 176.0},
        "elastomer": {"mixing_ratio": 20.0},
        "emitters": {"part": "kingbright-apt2012zgc", "height_mm": 5.0},
        "receivers": {"part": "osram-sfh2400", "height_mm": 5.0},
        "board": {"kind": "teensy-41", "receivers": {"multiplexer": "74hc4067"}},
        "layout": [RING],
    }
    return SensorDesign.from_document(document, where="disc").with_(**changes)


def errors(design: SensorDesign) -> list[str]:
    return [str(one) for one in check(design) if one.severity == "error"]


def test_every_receiver_is_followed_to_its_reading() -> None:
    design = disc()
    assert not errors(design)
    config = config_from_document(tomllib.loads(dump_driver_config(design)), where="driver.toml")
    assert config == driver_config(design)
    wiring = {row["reference"]: row for row in csv.DictReader(io.StringIO(wiring_csv(design)))}
    drawing = schematic_svg(design)
    assert config.board.address_pins == Circuit.of(design).receiver_chips[0].pins == (29, 30, 31, 32)
    for column, entry in enumerate(config.receivers):
        channel, multiplexer = divmod(column, 2)
        label = f"M{multiplexer + 1}-C{channel}"
        assert entry.column == column
        assert (entry.channel, entry.channel_number, entry.address) == (label, multiplexer, channel)
        assert wiring[entry.name]["pin"] == label
        block = drawing[drawing.index(f"M{multiplexer + 1}: 74HC4067") :]
        names = re.findall(r">(R\d+)-A<", block)
        assert names[channel] == entry.name
    assert len({entry.channel for entry in config.receivers}) == 24
    pins = {one.path.number for one in connections_of(Circuit.of(design)).emitters}
    assert not pins & set(Circuit.of(design).receiver_chips[0].pins)
    assert [row.references for row in bom_rows(design) if row.catalogue_id == "74hc4067"] == [("M1", "M2")]


def test_an_address_settles_before_it_is_read() -> None:
    design = disc()
    circuit = Circuit.of(design)
    assert circuit.frame_ms - circuit.with_use(receivers=None).frame_ms == pytest.approx(
        13 * 12 * 1.0e-3
    )  # 13 states of 12 addresses of 1 us


@pytest.mark.parametrize("board", ["arduino-mega-2560", "my-board"])
@pytest.mark.parametrize("averages", [1, 3])
def test_the_firmware_reads_every_receiver_through_its_multiplexer(
    board: str, averages: int, board_harness: Path, native_harness: None, tmp_path: Path
) -> None:
    design = disc(
        **{"board.kind": "arduino-mega-2560", "board.frame_rate_hz": 5.0, "board.averages": averages}
    )
    if board == "my-board":
        design = portable_pad(design)
    settings = firmware_settings(Pad.of(design))
    table = random_table(settings)
    said = [(7_000.0, pack_command(Command.RATE, 0)), (8_000.0, pack_command(Command.START))]
    run = simulate(
        board_harness if board != "my-board" else None,
        tmp_path,
        design,
        table,
        said,
        duration_us=400_000 * averages,
    )
    frames = run.frames.counts
    assert len(frames) >= 3
    assert (frames == quantised(table, settings.circuit.adc.bits)).all()
    conversions = (run.log["kind"] == INPUT_HELD).sum()
    begun = conversions / (table.size * averages)
    assert len(frames) <= begun < len(frames) + 3  # one begins, two are still to be sent


def test_without_multiplexers_check_proposes_them() -> None:
    found = errors(disc(**{"board.receivers": None}))
    assert any(
        'set board.receivers.multiplexer = "74hc4067": 24 receivers need 2 of them on A0 and A1, and 4 pins'
        in one
        for one in found
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"board.receivers.address_pins": [2, 29, 30, 31]}, "4 pins"),
        ({"board.receivers.address_pins": [29, 29, 30, 31]}, "4 pins"),
        ({"board.receivers.address_pins": [29, 30]}, "4 pins"),
        ({"board.receiver_channels": ["A0"]}, "2 multiplexers ... for 1"),
        ({"board.kind": "teensy-40"}, "pins left"),
    ],
)
def test_wrong_pins_are_refused_with_the_way_out(changes: dict[str, object], words: str) -> None:
    assert any(says(one, words) for one in errors(disc(**changes)))


def test_an_unknown_multiplexer_and_a_wrong_supply_are_refused() -> None:
    with pytest.raises(DesignError, match="'cd4097'"):
        Circuit.of(disc(**{"board.receivers.multiplexer": "cd4097"}))
    for field, name in (("receivers.multiplexer", "cd4097"), ("emitters.shift_register", "cd4094")):
        found = errors(disc(**{f"board.{field}": name}))
        assert [one for one in found if one.startswith(f"board.{field}:") and "the catalogue" in one]
    mine = {
        "title": "of 12 V", "source": "made up", "confidence": "unverified", "channels": 16, "supply_low_v": 9.0,
        "supply_high_v": 15.0, "enable": "ground",
        "on_resistance_ohm": {"value": 100.0, "unit": "ohm", "source": "made up", "confidence": "unverified"},
        "settle_us": {"value": 1.0, "unit": "us", "source": "made up", "confidence": "unverified"},
    }  # fmt: skip
    design = disc(**{"catalog.multiplexers": {"mine": mine}, "board.receivers.multiplexer": "mine"})
    assert any(says(one, "12 V does ... pins (3.3 V") for one in errors(design))


def test_the_internal_reference_is_full_scale_everywhere(board_harness: Path, tmp_path: Path) -> None:
    design = disc(
        **{
            "board.kind": "arduino-mega-2560",
            "board.frame_rate_hz": 5.0,
            "board.reference": "internal",
            "board.receivers": {"multiplexer": "74hc4067"},
        }
    )
    assert Circuit.of(design).adc.full_scale_v == 1.1
    assert driver_config(design).board.adc_reference == "internal reference, 1.1 V"
    by_supply = counts_per_flux_per_ohm(Circuit.of(design.with_(**{"board.reference": "supply"})))
    per_ohm = counts_per_flux_per_ohm(Circuit.of(design))
    assert per_ohm is not None
    assert by_supply is not None
    assert per_ohm[0].value / by_supply[0].value == pytest.approx(5.0 / 1.1)
    settings = firmware_settings(Pad.of(design))
    table = random_table(settings) * 1100 // 5000
    said = [(7_000.0, pack_command(Command.RATE, 0)), (8_000.0, pack_command(Command.START))]
    run = simulate(board_harness, tmp_path, design, table, said, duration_us=300_000)
    assert len(run.frames.counts) >= 3
    assert (run.frames.counts == table * 1023 // 1100).all()
    teensy = errors(disc(**{"board.reference": "internal"}))
    assert any("internal reference" in one for one in teensy)


def test_every_emitter_is_followed_from_the_shift_registers() -> None:
    design = disc(**{"board.emitters": {"shift_register": "74hc595"}})
    assert not errors(design)
    config = config_from_document(tomllib.loads(dump_driver_config(design)), where="driver.toml")
    assert config == driver_config(design)
    assert config.board.shift_pins == (2, 3, 4)
    assert config.board.address_pins == (5, 6, 7, 8)
    wiring = {row["reference"]: row for row in csv.DictReader(io.StringIO(wiring_csv(design)))}
    drawing = schematic_svg(design)
    for number, entry in enumerate(config.emitters):
        register, output = divmod(number, 8)
        assert (entry.state, entry.pin, entry.output) == (number, number, f"S{register + 1}-Q{output}")
        assert wiring[entry.name]["pin"] == entry.output
        names = re.findall(r">(E\d+)-RB<", drawing[drawing.index(f"S{register + 1}: 74HC595") :])
        assert names[output] == entry.name
    assert [row.references for row in bom_rows(design) if row.catalogue_id == "74hc595"] == [("S1", "S2")]


@pytest.mark.parametrize("board", ["arduino-mega-2560", "my-board"])
def test_the_firmware_walks_through_the_shift_registers(
    board: str, board_harness: Path, native_harness: None, tmp_path: Path
) -> None:
    design = disc(
        **{
            "board.kind": "arduino-mega-2560",
            "board.frame_rate_hz": 5.0,
            "board.emitters": {"shift_register": "74hc595"},
        }
    )
    if board == "my-board":
        design = portable_pad(design)
    settings = firmware_settings(Pad.of(design))
    table = random_table(settings)
    said = [
        (7_000.0, pack_command(Command.RATE, 0)),
        (8_000.0, pack_command(Command.START)),
        (150_000.0, pack_command(Command.STOP)),
        (170_000.0, pack_command(Command.START)),
        (300_000.0, pack_command(Command.SELF_TEST)),
    ]
    run = simulate(
        board_harness if board != "my-board" else None, tmp_path, design, table, said, duration_us=400_000
    )
    assert len(run.frames.counts) >= 5
    assert (run.frames.counts == quantised(table, settings.circuit.adc.bits)).all()
    (answer,) = run.of(Kind.SELF_TEST)
    assert unpack_self_test(answer).config_crc == settings.config_crc()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"board.emitters.pins": [2, 2, 4]}, "3 pins"),
        ({"board.emitters.pins": [2, 3, 99]}, "3 pins"),
        ({"board.emitter_pins": [*range(2, 13), 28]}, "leave the list out"),
        ({"board.receivers.address_pins": [2, 5, 6, 7]}, "4 pins"),
    ],
)
def test_wrong_pins_of_shift_registers_are_refused(changes: dict[str, object], words: str) -> None:
    design = disc(**{"board.emitters": {"shift_register": "74hc595"}}).with_(**changes)
    assert any(words in one for one in errors(design))


def test_too_few_pins_propose_shift_registers() -> None:
    many = {"pattern": "ring", "emitters": 30, "receivers": 32}
    found = errors(disc(layout=[many]))
    assert any(
        'set board.emitters.shift_register = "74hc595": 30 emitters need 4 of them and 3 pins' in one
        for one in found
    )
    fitted = disc(layout=[many], **{"board.emitters": {"shift_register": "74hc595"}})
    assert not [one for one in errors(fitted) if one.startswith("board.")]
