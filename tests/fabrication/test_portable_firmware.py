"""The program for boards with an Arduino core: how it averages, waits for a slow host, and compiles for their chips."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DesignError, DeviceError
from optopad.design.pad import Pad
from optopad.design.parts.catalog import find_board
from optopad.design.preset import preset
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of
from optopad.fabrication.driver.link.protocol import Command, Kind, pack_command
from optopad.fabrication.flash import compiled_image
from optopad.fabrication.sketch import (
    AVR_FILES,
    CONFIG,
    PORTABLE_FILES,
    SHARED_FILES,
    config_header,
    firmware_gaps,
    firmware_settings,
    write_sketch,
)
from tests.fabrication.simulated_board import (
    EMITTER_SWITCHED,
    LAYER,
    PORTABLE_OPTIONS,
    Run,
    portable_pad,
    quantised,
    random_table,
    simulate,
)
from tests.validation.driver.portable_soak import soak

AVR_PAD = preset("piacenza2017-pad")
PAD = portable_pad(AVR_PAD)
SETTINGS = firmware_settings(Pad.of(PAD))
TABLE = random_table(SETTINGS)
COUNTS = quantised(TABLE, SETTINGS.circuit.adc.bits)
SAID = [(7_000.0, pack_command(Command.RATE, 0)), (8_000.0, pack_command(Command.START))]


@pytest.fixture
def loop(native_harness: None, tmp_path: Path):
    """Runs the pad's program against a made-up table."""

    def run(*changes: str, said=SAID, duration_us: float = 30_000) -> Run:
        return simulate(None, tmp_path, PAD, TABLE, said, duration_us=duration_us, changes=changes)

    return run


def with_board(**changes: object) -> SensorDesign:
    """The pad on a changed copy of the board."""
    fields = find_board(entries_of(PAD), "my-board").model_dump(mode="json") | changes
    return PAD.with_(catalog={"boards": {"my-board": fields}})


def with_program(**changes: object) -> SensorDesign:
    """The pad on the board with changed words about its core."""
    program = find_board(entries_of(PAD), "my-board").model_dump(mode="json")["arduino"]
    return with_board(arduino=program | changes)


def test_a_value_is_the_rounded_mean_of_so_many_readings(loop):
    table = np.minimum(COUNTS, 4000)
    rising = loop("AVERAGES=4", "DITHER=4").frames.counts  # 0, 1, 2, 3 counts more: a mean of 1.5, rounded up
    assert len(rising) > 10
    assert (np.minimum(rising - 2, 4000) == table).all()
    assert (np.minimum(loop("AVERAGES=3", "DITHER=3").frames.counts - 1, 4000) == table).all()


def test_while_the_host_takes_nothing_no_emitter_is_lit_and_no_frame_is_lost(loop):
    from_us, to_us = 20_000, 60_000
    run = loop(f"STALL_FROM_US={from_us}", f"STALL_TO_US={to_us}", duration_us=90_000)
    assert run.frames.sequence.tolist() == list(range(len(run.frames.sequence)))
    assert (run.frames.counts == COUNTS).all()
    switched = run.log[run.log["kind"] == EMITTER_SWITCHED]
    at_us = switched["cycle"] / run.clock_hz * 1e6
    filled_us = from_us + 5_000  # both buffers wait by then
    assert not ((at_us > filled_us) & (at_us < to_us - 2_000)).any()
    lit = switched["number"][at_us <= filled_us]
    assert int((lit % 2).sum()) * 2 == len(lit)  # every one that was lit is off again


def test_a_core_that_never_tells_of_room_is_handed_whole_messages(loop):
    run = loop("ROOM_NEVER_TOLD", said=[*SAID, (25_000.0, pack_command(Command.SELF_TEST))])
    assert len(run.frames.counts) > 10
    assert (run.frames.counts == COUNTS).all()
    assert len(run.of(Kind.SELF_TEST)) == 1


def test_a_self_test_tells_configuration_and_late_frames_alone(loop):
    (found,) = loop(said=[(10_000.0, pack_command(Command.SELF_TEST))]).self_tests
    assert found.config_crc == SETTINGS.config_crc()
    assert (found.reference_counts, found.late_frames, found.least_free_ram_bytes) == (0, 0, 0)


@pytest.mark.slow
def test_the_driver_takes_and_records_a_thousand_frames_a_second_of_it(native_harness):
    found = soak(3.0)
    assert (found.lost, found.damaged, found.overrun, found.wrong) == (0, 0, 0, 0)
    assert found.recorded >= found.frames > 2_500


# config.h and the sketch folder


def test_the_header_names_inputs_as_the_core_does():
    pins = {f"A{k}": str(26 + k) for k in range(16)}
    chosen = with_program(analog_pins=pins).with_(
        **{"board.receiver_channels": [f"A{k}" for k in range(7, -1, -1)]}
    )
    text = config_header(firmware_settings(Pad.of(chosen)))
    assert re.findall(r"(\d+),? /\* R\d, (A\d+) \*/", text) == [
        (str(26 + k), f"A{k}") for k in range(7, -1, -1)
    ]
    assert re.findall(r"(\d+),? /\* (E\d) \*/", text)[0] == ("22", "E1")
    assert "#ifndef ARDUINO_OPTOPAD_TEST\n#error" in text
    assert "select the board optopad:test:board" in text


def test_a_folder_that_changes_its_board_holds_the_files_of_the_new_one(tmp_path):
    for design, own in ((AVR_PAD, AVR_FILES), (PAD, PORTABLE_FILES), (AVR_PAD, AVR_FILES)):
        sketch = write_sketch(firmware_settings(Pad.of(design)), tmp_path)
        assert sorted(file.name for file in sketch.iterdir()) == sorted([*SHARED_FILES, *own, CONFIG])


def test_an_image_is_arduino_clis_to_make():
    with pytest.raises(DeviceError, match=r"is compiled by arduino-cli .* for the board optopad:test:board"):
        compiled_image(firmware_settings(Pad.of(PAD)))


@pytest.mark.parametrize(
    ("design", "severity", "words"),
    [
        (with_board(adc_bits=17), "warning", "readings are"),
        (with_program(analog_pins={"A0": "A0"}), "warning", "analog_pins"),
        (with_program(ram_bytes=700), "error", "Test board"),
    ],
)
def test_a_board_that_cannot_run_the_program_is_said_to_be_one(design, severity, words):
    (finding,) = check(design)
    assert (finding.severity, words in finding.message) == (severity, True)
    assert len(firmware_gaps(Circuit.of(design))) == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"analog_pins": {"A0": "A0); injected("}}, "analog_pins"),
        ({"fqbn": "teensy40"}, "fqbn"),
        ({"core_macro": "A\n#endif"}, "core_macro"),
        ({"serial": "can"}, "serial"),
    ],
)
def test_words_that_would_not_compile_are_refused(changes, words):
    with pytest.raises(DesignError, match=words):
        with_program(**changes)


def test_a_board_has_one_program():
    mega = find_board(entries_of(AVR_PAD), "arduino-mega-2560").model_dump(mode="json")
    with pytest.raises(DesignError, match="board has one"):
        with_board(firmware=mega["firmware"])


# compiled for the boards' chips

COMPILER = "arm-none-eabi-g++"
CORES = {"cortex-m7": "-O2", "cortex-m4": "-Os", "cortex-m0plus": "-Os"}
"""Chips of Teensy 4, of Uno R4 and Nucleo-L432KC, and of the Pico; how their Arduino cores optimise."""

OF_THE_CORE = {
    *("micros", "pinMode", "digitalWrite", "analogRead", "analogReadResolution", "Serial"),
    *("SerialLine::begin", "SerialLine::available", "SerialLine::read", "SerialLine::write"),
    *("SerialLine::availableForWrite", "delayMicroseconds", "memcpy", "memset"),
    *("SPI", "SpiBus::begin", "SpiBus::beginTransaction", "SpiBus::transfer", "SpiBus::endTransaction"),
}
"""All that the program may need: no memory of a heap, no exceptions, no numbers with a point."""


WITH_CIRCUITS = {
    "own": PAD,
    "mcp3208": PAD.with_(**{"board.receivers": {"converter": "mcp3208"}}),
    "ads8688": PAD.with_(
        **{"board.receivers": {"converter": "ads8688"}, "board.emitters": {"driver": "tlc5947"}}
    ),
}
"""The pad with the board's own converter and transistors, and with circuits on the SPI bus."""


def compiled(folder: Path, core: str, *changes: str, design: SensorDesign = PAD) -> Path:
    """The program's object for a chip."""
    sketch, target = write_sketch(firmware_settings(Pad.of(design)), folder), folder / "core.o"
    command = [
        COMPILER,
        f"-mcpu={core}",
        "-mthumb",
        CORES[core],
        "-ffreestanding",
        *PORTABLE_OPTIONS,
        f"-I{LAYER}",
    ]
    command += [*(f"-D{one}" for one in changes), "-c", str(sketch / "core.cpp"), "-o", str(target)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return target


def said_of(tool: str, *arguments: str) -> str:
    """What a tool of the compiler says."""
    return subprocess.run(
        [f"arm-none-eabi-{tool}", *arguments], check=True, capture_output=True, text=True
    ).stdout


needs_arm = pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"{COMPILER} is not installed")


@needs_arm
@pytest.mark.parametrize("circuits", WITH_CIRCUITS)
@pytest.mark.parametrize("core", CORES)
def test_it_compiles_for_the_chip_without_a_warning_and_needs_the_core_alone(core, circuits, tmp_path):
    found = compiled(tmp_path, core, "ARDUINO_OPTOPAD_TEST", design=WITH_CIRCUITS[circuits])
    needed = {
        line.split(maxsplit=1)[1].partition("(")[0] for line in said_of("nm", "-uC", str(found)).splitlines()
    }
    assert {name for name in needed if not name.startswith("__aeabi_mem")} <= OF_THE_CORE
    text, data, bss = map(int, said_of("size", str(found)).splitlines()[1].split()[:3])
    assert text < 5_000
    assert data + bss < 512


@needs_arm
def test_it_compiles_for_no_other_board(tmp_path):
    with pytest.raises(subprocess.CalledProcessError) as refused:
        compiled(tmp_path, "cortex-m7")
    assert "Test board" in refused.value.stderr
