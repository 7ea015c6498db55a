"""Writes a design's Arduino sketch: a folder with the firmware's sources and its settings in `config.h`.

The folder can be opened in the Arduino IDE. For AVR chips, avr-gcc compiles it together with `main.c`.

`config.h` contains the firmware's settings as C. Pins and inputs are those of `optopad.design.circuit.circuit`, which
the wiring table and `driver.toml` also use. The board's catalogue entry gives the port and multiplexer setting of a
pin, or the pin's name in the board's Arduino core.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from optopad.design.circuit.circuit import US_PER_S, Chips, Circuit, baud_divisor
from optopad.design.errors import DesignError
from optopad.design.io import write_text_atomically
from optopad.design.pad import Pad
from optopad.design.parts.board_firmware import MUX5, SUPPLY_BITS, ArduinoProgram, BoardFirmware
from optopad.design.parts.catalog import Converter, LedDriver, Multiplexer
from optopad.design.rules.board import firmware_findings

PIN_LISTS = {"S": "SHIFT_PINS", "L": "DRIVER_PINS", "M": "ADDRESS_PINS", "U": "SELECT_PINS"}
"""Name in `config.h` of the pins that control chips, by the letter of the chips."""


@dataclass(frozen=True, kw_only=True)
class FirmwareSettings:
    """The program of a circuit: its settings in `config.h`, and the board's chip or core that it is for."""

    circuit: Circuit
    chip: BoardFirmware | ArduinoProgram

    @property
    def board_title(self) -> str:
        """Name of the board."""
        return self.circuit.board.title

    @property
    def prescaler_exponent(self) -> int:
        """Exponent of two of the divider of the converter's clock; 0 for boards without one."""
        return self.circuit.use.adc_prescaler.bit_length() - 1 if self.circuit.board.divides_clock else 0

    @property
    def settle_us(self) -> int:
        """Settling time of the design, rounded up to whole microseconds [us]."""
        return math.ceil(self.circuit.use.settle_us)

    @property
    def frame_interval_us(self) -> int:
        """Frame interval at the design's frame rate, rounded up, so that the rate is not exceeded [us]."""
        return math.ceil(US_PER_S / self.circuit.use.frame_rate_hz)

    @property
    def is_internal(self) -> bool:
        """Whether the converter's full scale is the internal reference; otherwise it is the supply."""
        return self.circuit.use.reference == "internal"

    @property
    def is_dark_around_each(self) -> bool:
        """Whether a frame has a dark state before and after each emitter's state."""
        return self.circuit.use.dark == "each"

    def config_block(self) -> bytes:
        """The settings as bytes, laid out as in the firmware, whose self-test returns their CRC-32."""
        circuit = self.circuit
        head = [
            circuit.board.link_number,
            circuit.emitter_count,
            circuit.receiver_count,
            circuit.adc.bits | self.is_dark_around_each << 7,
            self.prescaler_exponent,
        ]
        times = self.settle_us.to_bytes(2, "little") + circuit.use.baud.to_bytes(4, "little")
        interval, digest = self.frame_interval_us.to_bytes(4, "little"), bytes.fromhex(circuit.design.digest)
        numbers = [one.number for one in (*circuit.emitters, *circuit.receivers)]
        return bytes(head) + times + interval + digest + bytes(numbers) + self._more()

    def _more(self) -> bytes:
        """Bytes that `config_block` has only with averaging, the internal reference, or chips."""
        circuit = self.circuit
        if circuit.use.averages == 1 and not self.is_internal and not circuit.chips:
            return b""
        pins = [pin for chips in circuit.chips for pin in chips.pins]
        addresses = bytes(one.terminal for one in circuit.receivers if one.terminal is not None)
        return circuit.use.averages.to_bytes(2, "little") + bytes([self.is_internal, *pins]) + addresses

    def config_crc(self) -> int:
        """CRC-32 of `config_block`, which the firmware's self-test also reports."""
        return zlib.crc32(self.config_block())


def firmware_settings(pad: Pad) -> FirmwareSettings:
    """The firmware's settings for a pad.

    Raises
    ------
    DesignError : the catalogue does not contain all data about the board.
    """
    circuit = pad.circuit
    gaps, chip = firmware_gaps(circuit), circuit.board.firmware or circuit.board.arduino
    if gaps or chip is None:
        lines = "\n".join(f"  {gap}" for gap in gaps)
        raise DesignError(f"{pad.design.name}: no firmware can be made\n{lines}")
    return FirmwareSettings(circuit=circuit, chip=chip)


def firmware_gaps(circuit: Circuit) -> tuple[str, ...]:
    """Reasons why no firmware can be made for the circuit's board; empty if there are none."""
    return tuple(str(finding) for finding in firmware_findings(circuit))


def plain(text: str) -> str:
    """A text that is safe inside a C comment or string; all unsafe characters are replaced by spaces."""
    return re.sub(r"[^A-Za-z0-9 ._+():-]", " ", text)


def config_header(settings: FirmwareSettings) -> str:
    """Text of the file `config.h` with these settings."""
    circuit, chip = settings.circuit, settings.chip
    use, emitters = circuit.use, zip(circuit.cavity.emitters, circuit.emitters, strict=True)
    own = _avr_lines(settings, chip) if isinstance(chip, BoardFirmware) else _arduino_lines(circuit, chip)
    sizes = {one.entry.letter: one.count * one.entry.size for one in circuit.emitter_chips}
    sizes |= {one.entry.letter: len(one.pins) for one in circuit.receiver_chips}
    lines = [
        *_heading(circuit),
        "#ifndef OPTOPAD_CONFIG_H",
        "#define OPTOPAD_CONFIG_H",
        "#define U16(n) (n) & 255, (n) >> 8 & 255",
        "#define U32(n) U16((n) & 65535), U16((n) >> 16)",
        "",
        f"#define BOARD_NUMBER {circuit.board.link_number}",
        f"#define ADC_BITS {circuit.adc.bits}",
        *_tunable(
            "PRESCALER_EXPONENT", f"{settings.prescaler_exponent}", "ADC clock = clock / 2 to this power"
        ),
        *_tunable("SETTLE_US", f"{settings.settle_us}UL", "wait after an emitter switches"),
        *_tunable("FRAME_INTERVAL_US", f"{settings.frame_interval_us}UL", "0: as fast as possible"),
        f"#define BAUD {use.baud}UL",
        f"#define N_EMITTERS {circuit.emitter_count}",
        *_commented_list("EMITTER_PINS", (f"{path.number} /* {plain(e.name)} */" for e, path in emitters)),
        f"#define N_RECEIVERS {circuit.receiver_count}",
        *_list("CHANNEL_NUMBERS", (str(one.number) for one in circuit.receivers)),
        *_tunable("AVERAGES", f"{use.averages}", "readings a value"),
        f"#define DARK_AROUND_EACH {int(settings.is_dark_around_each)} /* 1: dark before and after each emitter */",
        f"#define ADDRESS_BITS {sizes.get('M', 0)} /* of the multiplexers; 0: none */",
        f"#define SHIFT_BITS {sizes.get('S', 0)} /* of the shift registers; 0: none */",
        f"#define CONVERTERS {sizes.get('U', 0)} /* on the SPI bus; 0: the board's own */",
        f"#define DRIVER_OUTPUTS {sizes.get('L', 0)} /* of the LED drivers; 0: none */",
        *_more_hardware(settings),
        *_list("DESIGN_DIGEST", (f"0x{byte:02x}" for byte in bytes.fromhex(circuit.design.digest))),
        "",
        *own,
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _more_hardware(settings: FirmwareSettings) -> Iterable[str]:
    circuit = settings.circuit
    more = [PIN_LISTS[chips.entry.letter] for chips in circuit.chips]
    for name, chips in zip(more, circuit.chips, strict=True):
        yield from _list(name, map(str, chips.pins))
        if isinstance(chips.entry, Multiplexer):
            yield f"#define ADDRESS_SETTLE_US {math.ceil(chips.entry.settle_us.value)}UL"
    for chips in circuit.chips:
        yield from _chip_lines(chips, circuit)
    if circuit.receiver_chips:
        yield from _list("CHANNEL_ADDRESSES", (str(one.terminal) for one in circuit.receivers))
        more = [*more, "CHANNEL_ADDRESSES"]
    if more or circuit.use.averages > 1 or settings.is_internal:
        more = [f"U16({circuit.use.averages})", str(int(settings.is_internal)), *more]
    yield f"#define MORE_CONFIG {''.join(f', {one}' for one in more)}".rstrip()


def _chip_lines(chips: Chips, circuit: Circuit) -> Iterable[str]:
    match chips.entry:
        case LedDriver() as entry:
            yield f"#define GRAYSCALE_BITS {entry.grayscale_bits} /* of one output */"
            clock_hz = entry.clock_hz(circuit.emitter_count)
            yield from _tunable("DRIVER_HZ", f"{clock_hz}UL", "clock of the SPI bus to the LED drivers")
            yield from _tunable(
                "DRIVER_ON_US", f"{entry.turn_on_wait_us}", "until an output is on after blanking"
            )
        case Converter() as entry:
            yield f"#define CONVERTER_IS_{entry.commands.upper()} 1"
            yield f"#define CONVERTER_CHANNELS {entry.channels}"
            clock_hz, gap_us = entry.clock_hz(circuit.board), math.ceil(entry.gap_us.value)
            yield from _tunable("CONVERTER_HZ", f"{clock_hz}UL", "clock of the SPI bus to the converters")
            yield from _tunable("CONVERTER_MODE", f"SPI_MODE{entry.spi_mode}", "of the SPI bus")
            yield from _tunable("CONVERTER_GAP_US", f"{gap_us}", "chip select high between readings")
            yield f"#define CONVERTER_RANGE {entry.range_code or 0}"


def _avr_lines(settings: FirmwareSettings, chip: BoardFirmware) -> Iterable[str]:
    circuit = settings.circuit
    board, muxes = circuit.board, [chip.channel_mux[one.channel] for one in circuit.receivers]
    yield from _only_for(_chip_macro(chip.mcu), chip.mcu, chip)
    yield f"#define CLOCK_HZ {board.clock_hz}UL"
    yield from _tunable(
        "SWITCH_EARLY", "0", "1: switch during a state's last conversion, once its input is sampled"
    )
    divisor = baud_divisor(board.clock_hz, circuit.use.baud)
    yield f"#define BAUD_DIVISOR {divisor} /* of an eighth of the clock */"
    yield f"#define RECEIVE_VECTOR {chip.receive_vector}"
    yield f"#define TRANSMIT_VECTOR {chip.transmit_vector}"
    yield f"#define REFERENCE_MUX {chip.reference_mux}"
    yield f"#define FULL_SCALE_BITS {chip.internal_reference_bits if settings.is_internal else SUPPLY_BITS}"
    yield f"#define ANY_MUX5 {int(any(mux & MUX5 for mux in muxes))}"
    emitters = [
        (plain(part.name), path.number)
        for part, path in zip(circuit.cavity.emitters, circuit.emitters, strict=True)
    ]
    for chips in circuit.emitter_chips:
        yield from _commented_list("EMITTERS", (f"NO_LED /* {name} */" for name, _ in emitters))
        yield from _list("SHIFTS", _ports(chip, chips.pins))
    if not circuit.emitter_chips:
        ports = _ports(chip, [pin for _, pin in emitters])
        named = zip(ports, emitters, strict=True)
        yield from _commented_list(
            "EMITTERS", (f"{port} /* {name}, pin {pin} */" for port, (name, pin) in named)
        )
    inputs = zip(muxes, circuit.cavity.receivers, circuit.receivers, strict=True)
    yield from _commented_list(
        "CHANNEL_MUX", (f"{mux} /* {plain(r.name)}, {plain(path.pin)} */" for mux, r, path in inputs)
    )
    for chips in circuit.receiver_chips:
        yield from _list("ADDRESSES", _ports(chip, chips.pins))


def _ports(chip: BoardFirmware, pins: Iterable[int]) -> list[str]:
    return [f"LED({chip.pin_ports[pin][0]}, {chip.pin_ports[pin][1:]})" for pin in pins]


def _arduino_lines(circuit: Circuit, chip: ArduinoProgram) -> Iterable[str]:
    yield from _only_for(chip.core_macro, circuit.board.title, chip)
    if circuit.input_count:
        inputs = zip(circuit.cavity.receivers, circuit.receivers, strict=True)
        yield from _commented_list(
            "CHANNEL_PINS",
            (
                f"{chip.analog_pins[path.channel]} /* {plain(r.name)}, {plain(path.pin)} */"
                for r, path in inputs
            ),
        )


def _only_for(macro: str, name: str, chip: BoardFirmware | ArduinoProgram) -> Iterable[str]:
    yield f"#ifndef {macro}"
    yield f'#error "this program is for {plain(name)}: select the board {plain(chip.arduino_board)}"'
    yield "#endif"


def _heading(circuit: Circuit) -> Iterable[str]:
    design = circuit.design
    yield f"/* Written by optopad for the design {plain(design.name)} (digest {design.digest[:8]})"
    yield f"   on the board {plain(circuit.board.title)}."
    yield "   Change the design and write it again: the host refuses a program of another design. */"


def _chip_macro(mcu: str) -> str:
    number = mcu.removeprefix("atmega")
    return f"__AVR_ATmega{number.upper()}__"


def _tunable(name: str, value: str, comment: str) -> tuple[str, ...]:
    """Lines of C that define a setting unless a compiler option does, for example when frame rates are measured."""
    return (f"#ifndef {name}", f"#define {name} {value} /* {comment} */", "#endif")


def _list(name: str, items: Iterable[str]) -> Iterable[str]:
    yield f"#define {name} {', '.join(items)}"


def _commented_list(name: str, items: Iterable[str]) -> Iterable[str]:
    *most, last = items
    yield f"#define {name} \\"
    yield from (f"    {_with_comma(item)} \\" for item in most)
    yield f"    {last}"


def _with_comma(item: str) -> str:
    value, space, comment = item.partition(" /*")
    return f"{value},{space}{comment}"


SKETCH = "optopad"
"""Name of the sketch folder and of its .ino file; the Arduino IDE requires these names to be the same."""

IMAGE = f"{SKETCH}.hex"
CONFIG = "config.h"
SHARED_FILES = ("optopad.ino", "core.h", "crc.h", "session.h")
AVR_FILES = ("core.c", "clock.h", "line.h")
PORTABLE_FILES = ("core.cpp",)
"""Names of source files that are the same for every design: `SHARED_FILES` for all boards, `AVR_FILES` for AVR chips,
and `PORTABLE_FILES` for other boards."""

COMMAND_FILES = {"U": "converter.h", "L": "led_driver.h"}
"""Name in the sketch of the file with the commands of chips, by their letter. Its source has the name of the family."""

MAIN = "main.c"
"""File with the main function. It is not in the sketch folder, because an Arduino core has its own."""


def source_text(name: str) -> str:
    """Text of a source file of the firmware."""
    return files("optopad.fabrication").joinpath("firmware", "source", name).read_text(encoding="utf-8")


def sketch_texts(settings: FirmwareSettings) -> dict[str, str]:
    """Text of every file in the sketch folder, by file name."""
    is_avr = isinstance(settings.chip, BoardFirmware)
    fixed = {name: source_text(name) for name in SHARED_FILES + (AVR_FILES if is_avr else PORTABLE_FILES)}
    commands = {
        COMMAND_FILES[chips.entry.letter]: source_text(f"{chips.entry.family_name}.h")
        for chips in settings.circuit.chips
        if chips.entry.letter in COMMAND_FILES
    }
    return {**fixed, **commands, CONFIG: config_header(settings)}


def write_sketch(settings: FirmwareSettings, folder: Path) -> Path:
    """Write the sketch folder into `folder`; remove files for other boards and an outdated compiled program.

    Returns
    -------
    the sketch folder

    Raises
    ------
    OutputError : the folder cannot be written.
    """
    texts, sketch = sketch_texts(settings), folder / SKETCH
    sketch.mkdir(parents=True, exist_ok=True)
    if any(_is_other(sketch / name, text) for name, text in texts.items()):
        (folder / IMAGE).unlink(missing_ok=True)
    for name in {*AVR_FILES, *PORTABLE_FILES, *COMMAND_FILES.values()} - set(texts):
        (sketch / name).unlink(missing_ok=True)
    for name, text in texts.items():
        write_text_atomically(sketch / name, text)
    return sketch


def _is_other(file: Path, text: str) -> bool:
    return not file.is_file() or file.read_text(encoding="utf-8", errors="replace") != text
