"""config.h: pins, ports and settings by construction from the connections that driver.toml has."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.errors import DesignError
from optopad.design.pad import Pad
from optopad.design.parts.catalog import packaged
from optopad.design.preset import PRESETS, preset
from optopad.design.rules.check import check
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.protocol import Command, pack_command
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.driver_file import config_from_document
from optopad.fabrication.flash import compiled_image
from optopad.fabrication.sketch import (
    AVR_FILES,
    CONFIG,
    IMAGE,
    SHARED_FILES,
    config_header,
    firmware_gaps,
    firmware_settings,
    plain,
    sketch_texts,
    source_text,
    write_sketch,
)
from tests.fabrication.simulated_board import missing_compiler, quantised, random_table, run_program

PAD = preset("piacenza2017-pad")
BOARDS = packaged().boards
VARIANTS = Path("/usr/share/arduino/hardware/arduino/avr/variants")
VARIANT_OF = {"arduino-mega-2560": "mega", "arduino-uno": "standard", "arduino-nano": "standard"}
SHUFFLED = PAD.with_(
    **{
        "board.emitter_pins": [40, 22, 41, 23, 42, 24, 43, 25],
        "board.receiver_channels": ["A15", "A0", "A14", "A1", "A13", "A2", "A12", "A3"],
    }
)


def with_board(name: str = "arduino-mega-2560", **changes: object) -> SensorDesign:
    """The pad on a changed copy of a board."""
    fields = BOARDS[name].model_dump(mode="json") | changes
    return PAD.with_(**{"catalog": {"boards": {"changed": fields}}, "board.kind": "changed"})


@pytest.mark.parametrize(
    "design",
    [*(preset(name) for name in PRESETS if Circuit.of(preset(name)).board.firmware), SHUFFLED],
    ids=lambda design: design.name,
)
def test_pins_and_inputs_are_those_of_the_driver_configuration(design):
    settings = firmware_settings(Pad.of(design))
    config = config_from_document(tomllib.loads(dump_driver_config(design)), where="driver.toml")
    assert [one.number for one in settings.circuit.emitters] == [one.pin for one in config.emitters]
    assert [one.channel for one in settings.circuit.receivers] == [one.channel for one in config.receivers]
    assert [one.number for one in settings.circuit.receivers] == [
        one.channel_number for one in config.receivers
    ]
    assert 2**settings.prescaler_exponent == config.board.adc_prescaler
    assert settings.config_crc() == config.board.config_crc


def test_ports_and_settings_of_the_header_are_the_boards():
    text = config_header(firmware_settings(Pad.of(SHUFFLED)))
    found = re.findall(r"LED\((\w), (\d)\),? /\* (E\d), pin (\d+) \*/", text)
    ports = [f"{port}{bit}" for port, bit, _, _ in found]
    assert ports == ["G1", "A0", "G0", "A1", "L7", "A2", "L6", "A3"]  # pins 40, 22, 41 ... of pins_arduino.h
    assert re.findall(r"(\d+),? /\* R\d, A\d+ \*/", text) == ["39", "0", "38", "1", "37", "2", "36", "3"]
    assert "#define ANY_MUX5 1" in text
    assert "#define ANY_MUX5 0" in config_header(firmware_settings(Pad.of(PAD)))


@pytest.mark.parametrize("kind", VARIANT_OF)
def test_ports_of_every_pin_are_those_of_the_arduino_core(kind):
    file = VARIANTS / VARIANT_OF[kind] / "pins_arduino.h"
    if not file.is_file():
        pytest.skip("arduino-core-avr is not installed")
    text = file.read_text(encoding="utf-8", errors="replace")
    letters = re.findall(r"^\s*P([A-L])\b", table_of(text, "digital_pin_to_port_PGM"), flags=re.MULTILINE)
    bits = re.findall(r"_BV\(\s*(\d)\s*\)", table_of(text, "digital_pin_to_bit_mask_PGM"))
    chip = BOARDS[kind].firmware
    assert chip is not None
    known = [f"{letter}{bit}" for letter, bit in zip(letters, bits, strict=True)]
    assert list(chip.pin_ports) == known[: len(chip.pin_ports)]
    assert set(BOARDS[kind].digital_pins) <= set(range(len(chip.pin_ports)))
    assert set(BOARDS[kind].analog_channels) == set(chip.channel_mux)


def table_of(text: str, name: str) -> str:
    return text[text.index(name) :].partition("};")[0]


def test_settle_time_and_interval_are_rounded_to_the_safe_side():
    settings = firmware_settings(Pad.of(PAD.with_(**{"board.settle_us": 20.2, "board.frame_rate_hz": 60.0})))
    assert settings.settle_us == 21
    assert settings.frame_interval_us == 16_667


def test_the_config_block_tells_designs_pins_and_settings_apart():
    blocks = {
        firmware_settings(Pad.of(one)).config_block() for one in (PAD, SHUFFLED, preset("oblong-60x40"))
    }
    assert len(blocks) == 3
    assert len(firmware_settings(Pad.of(PAD)).config_block()) == 47 + 8 + 8


def test_a_layout_with_more_receivers_than_the_uno_has_inputs_is_refused():
    with pytest.raises(DesignError, match="8 receivers"):
        firmware_settings(Pad.of(PAD.with_(**{"board.kind": "arduino-uno"})))
    assert len(firmware_settings(Pad.of(PAD.with_(**{"board.kind": "arduino-nano"}))).circuit.receivers) == 8


@pytest.mark.parametrize(
    ("changes", "severity", "words"),
    [
        ({"firmware": None}, "warning", "name its chip"),
        ({"adc_bits": 12}, "warning", "for AVR chips at 8 or 16 MHz with 10-bit converters"),
        ({"analog_channels": [f"X{k}" for k in range(8)]}, "warning", "channel_mux"),
        ({"digital_pins": [90, 91, 92, 93, 94, 95, 96, 97]}, "warning", "pin_ports"),
    ],
)
def test_a_board_that_cannot_be_programmed_is_said_to_be_one(changes, severity, words):
    design = with_board(**changes)
    (finding,) = check(design)
    assert (finding.severity, words in finding.message) == (severity, True)
    assert len(firmware_gaps(Circuit.of(design))) == 1
    with pytest.raises(DesignError, match="firmware can"):
        firmware_settings(Pad.of(design))


def test_frames_that_do_not_fit_the_memory_are_refused():
    chip = BOARDS["arduino-mega-2560"].firmware
    assert chip is not None
    small = chip.model_dump(mode="json") | {"ram_bytes": 700}
    (finding,) = check(with_board(firmware=small))
    assert (finding.severity, finding.value) == ("error", "722 bytes")  # 2 x 105 + 512
    assert check(with_board(firmware=small | {"ram_bytes": 722})) == ()


def test_a_board_of_ones_own_without_firmware_keeps_its_digest_form():
    document = with_board(firmware=None).model_dump(mode="json")
    assert "firmware" not in document["catalog"]["boards"]["changed"]
    assert Circuit.of(with_board(firmware=None)).board.firmware is None


# the sketch folder


def test_the_sketch_folder_has_what_the_arduino_ide_opens(tmp_path):
    sketch = write_sketch(firmware_settings(Pad.of(PAD)), tmp_path)
    assert sketch.name == "optopad"
    assert sorted(file.name for file in sketch.iterdir()) == sorted([*SHARED_FILES, *AVR_FILES, CONFIG])
    assert (sketch / "optopad.ino").read_text(encoding="utf-8").count("\n") == 3
    assert not (sketch / "main.c").exists()  # the Arduino core has a main of its own
    assert (sketch / CONFIG).read_text(encoding="utf-8") == sketch_texts(firmware_settings(Pad.of(PAD)))[
        CONFIG
    ]


def test_an_image_of_another_text_does_not_stay_beside_the_sketch(tmp_path):
    write_sketch(firmware_settings(Pad.of(PAD)), tmp_path)
    image = tmp_path / IMAGE
    image.write_text(":00000001FF\n", encoding="ascii")
    write_sketch(firmware_settings(Pad.of(PAD)), tmp_path)
    assert image.exists()
    write_sketch(firmware_settings(Pad.of(SHUFFLED)), tmp_path)
    assert not image.exists()


def test_the_program_repeats_the_checksum_table_of_zlib():
    # what the macro makes of eight constants, against the definition
    constants = [int(value, 16) for value in re.findall(r"0x([0-9a-f]{8})UL\)", source_text("crc.h"))]
    assert len(constants) == 8
    for bit, constant in enumerate(constants):
        value = 1 << bit
        for _ in range(8):
            value = value >> 1 ^ (0xEDB88320 if value & 1 else 0)
        assert constant == value


needs_compiler = pytest.mark.skipif(bool(missing_compiler()), reason=missing_compiler())


@needs_compiler
@pytest.mark.parametrize("name", [name for name in PRESETS if Circuit.of(preset(name)).board.firmware])
def test_every_preset_compiles_without_a_warning_and_fits(name):
    design = preset(name)
    chip, image = firmware_settings(Pad.of(design)).chip, compiled_image(firmware_settings(Pad.of(design)))
    assert image.flash_bytes < 8_000 < chip.flash_bytes
    assert image.ram_bytes < 1_000 < chip.ram_bytes
    assert image.hex_text.startswith(":")
    assert image.hex_text.endswith(":00000001FF\n")  # the record that ends a file


@needs_compiler
def test_the_same_design_makes_the_same_image():
    assert compiled_image(firmware_settings(Pad.of(PAD))) == compiled_image(firmware_settings(Pad.of(PAD)))


CORE = VARIANTS.parent / "cores" / "arduino"


@pytest.mark.slow
@needs_compiler
def test_the_sketch_compiles_as_the_arduino_ide_compiles_it(tmp_path, board_harness):
    if not CORE.is_dir() or not shutil.which("avr-g++"):
        pytest.skip("arduino-core-avr is not installed")
    sketch = write_sketch(firmware_settings(Pad.of(PAD)), tmp_path)
    program = "#include <Arduino.h>\n" + (sketch / "optopad.ino").read_text(encoding="utf-8")
    (tmp_path / "sketch.cpp").write_text(program, encoding="utf-8")
    of_core = [compiled(file, tmp_path, sketch) for file in sorted([*CORE.glob("*.c"), *CORE.glob("*.cpp")])]
    own = [compiled(file, tmp_path, sketch) for file in (tmp_path / "sketch.cpp", sketch / "core.c")]
    subprocess.run(["avr-ar", "rcs", "core.a", *of_core], cwd=tmp_path, check=True)
    link = ["avr-gcc", "-mmcu=atmega2560", "-Wl,--gc-sections", "-o", "image.elf", *own, "core.a", "-lm"]
    subprocess.run(link, cwd=tmp_path, check=True)
    settings, table = firmware_settings(Pad.of(PAD)), random_table(firmware_settings(Pad.of(PAD)))
    said = [(10_000.0, pack_command(Command.RATE, 0)), (11_000.0, pack_command(Command.START))]
    program = [str(board_harness), str(tmp_path / "image.elf")]
    run = run_program(program, tmp_path, settings, table, said, duration_us=60_000)
    assert len(run.frames.counts) >= 10
    assert (run.frames.counts == quantised(table)).all()


def compiled(file: Path, folder: Path, sketch: Path) -> Path:
    """An object as the Arduino core's build makes it, but for the link-time optimiser."""
    target = folder / f"{file.name}.o"
    of_c = ["avr-gcc", "-std=gnu11"]
    of_cpp = ["avr-g++", "-std=gnu++11", "-fpermissive", "-fno-exceptions", "-fno-threadsafe-statics"]
    options = ["-mmcu=atmega2560", "-DF_CPU=16000000L", "-DARDUINO=10819", "-DARDUINO_AVR_MEGA2560"]
    options += ["-DARDUINO_ARCH_AVR", "-DDECIMAL_DIG=__DECIMAL_DIG__", "-Os", "-w"]
    options += [
        "-ffunction-sections",
        "-fdata-sections",
        f"-I{CORE}",
        f"-I{VARIANTS / 'mega'}",
        f"-I{sketch}",
    ]
    language = of_cpp if file.suffix == ".cpp" else of_c
    subprocess.run([*language, *options, "-c", str(file), "-o", str(target)], check=True)
    return target


@pytest.mark.parametrize(
    "text", ["**// \nint injected;", 'x"\n#endif\nint injected;', "A0 */ }; int injected;", "trigraph ??/"]
)
def test_a_text_ends_neither_comment_nor_string_nor_line(text):
    found = plain(text)
    assert not set(found) & set('*/"\\\n\r?;#{}')
    assert len(found) == len(text)


def test_names_of_boards_and_inputs_stay_as_they_are():
    for text in ("Arduino Mega 2560", "arduino:avr:mega", "A15", "Nano (ATmega328)"):
        assert plain(text) == text
