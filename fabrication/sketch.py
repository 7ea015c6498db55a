"""Writes a design's Arduino sketch: a folder with the firmware's sources and its settings in `config.h`.

The folder can be opened in the Arduino IDE. For AVR chips, avr-gcc compiles it together with `main.c`.

`config.h` contains the firmware's settings as C. Pins and inputs are those of `optopad.fabrication.connections`, which
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

from optopad.design.circuit.pins import (
    US_PER_S,
    adc_bits,
    address_pins,
    baud_divisor,
    board_of,
    converter_of,
    driver_of,
    multiplexer_of,
    select_pins,
    shift_register_of,
    switch_pins,
)
from optopad.design.errors import DesignError
from optopad.design.io import write_text_atomically
from optopad.design.parts.board_firmware import MUX5, SUPPLY_BITS, ArduinoProgram, BoardFirmware
from optopad.design.parts.catalog import Board
from optopad.design.rules.board import firmware_findings
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.connections import connections_of


@dataclass(frozen=True, kw_only=True)
class EmitterPin:
    """An emitter's name, and the number of its pin on the board."""

    name: str
    number: int


@dataclass(frozen=True, kw_only=True)
class ReceiverInput:
    """A receiver's name, its terminal, and the board input and multiplexer address at which it is read.

    Attributes
    ----------
    label : name of the terminal to which the receiver's amplifier is connected, as in the wiring table
    channel : name of the board input; "" with separate converters
    number : index of the board input, or of the separate converter
    address : channel of the multiplexer, or input of the separate converter; 0 if the receiver has neither
    """

    name: str
    label: str
    channel: str
    number: int
    address: int


@dataclass(frozen=True, kw_only=True)
class ConverterSettings:
    """Settings of separate analogue-to-digital converters on the SPI bus.

    Attributes
    ----------
    commands : name of the command set that the firmware sends, such as ``mcp3208``
    channels : number of inputs of one converter
    clock_hz, spi_mode : clock frequency [Hz] and mode of the bus
    gap_us : time for which chip select is high between two readings [us]
    range_code : value of the range registers; 0 for converters without them
    pins : chip select pin of each converter
    """

    commands: str
    channels: int
    clock_hz: int
    spi_mode: int
    gap_us: int
    range_code: int
    pins: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class DriverSettings:
    """Settings of a chain of LED drivers on the SPI bus.

    Attributes
    ----------
    outputs : number of outputs of the whole chain
    grayscale_bits : number of bits for each output
    clock_hz : clock frequency of the bus [Hz]
    turn_on_us : time from the end of blanking until an output is on [us]
    pins : latch pin and blank pin
    """

    outputs: int
    grayscale_bits: int
    clock_hz: int
    turn_on_us: int
    pins: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class FirmwareSettings:
    """All settings in `config.h`.

    Attributes
    ----------
    board_number : number with which the firmware identifies the type of board to the host
    settle_us : settling time of the design, rounded up to whole microseconds [us]
    frame_interval_us : frame interval at the design's frame rate, rounded up, so that the rate is not exceeded [us]
    digest : digest of the design, 32 bytes
    is_internal : whether the converter's full scale is the internal reference; otherwise it is the supply
    dark : when dark states occur, ``frame`` or ``each``; see `optopad.design.recordings.lit_emitters`
    """

    design: str
    digest: bytes
    board_number: int
    board_title: str
    chip: BoardFirmware | ArduinoProgram
    clock_hz: int
    adc_bits: int
    prescaler_exponent: int
    settle_us: int
    baud: int
    baud_divisor: int
    frame_interval_us: int
    emitters: tuple[EmitterPin, ...]
    receivers: tuple[ReceiverInput, ...]
    averages: int = 1
    is_internal: bool = False
    dark: str = "frame"
    shift_pins: tuple[int, ...] = ()
    shift_bits: int = 0
    address_pins: tuple[int, ...] = ()
    address_settle_us: int = 0
    converter: ConverterSettings | None = None
    driver: DriverSettings | None = None

    @property
    def more_pins(self) -> dict[str, tuple[int, ...]]:
        """Pins for circuits between board and parts, such as multiplexers, by their `config.h` name."""
        pins = {
            "SHIFT_PINS": self.shift_pins,
            "DRIVER_PINS": () if self.driver is None else self.driver.pins,
            "ADDRESS_PINS": self.address_pins,
            "SELECT_PINS": () if self.converter is None else self.converter.pins,
        }
        return {name: one for name, one in pins.items() if one}

    @property
    def has_addresses(self) -> bool:
        """Whether receivers are connected through multiplexers or separate converters, and so have an address."""
        return bool(self.address_pins) or self.converter is not None

    def config_block(self) -> bytes:
        """The settings as bytes, laid out as in the firmware, whose self-test returns their CRC-32."""
        head = [
            self.board_number,
            len(self.emitters),
            len(self.receivers),
            self.adc_bits | self.is_dark_around_each << 7,
            self.prescaler_exponent,
        ]
        times = self.settle_us.to_bytes(2, "little") + self.baud.to_bytes(4, "little")
        interval = self.frame_interval_us.to_bytes(4, "little")
        pins = [emitter.number for emitter in self.emitters]
        inputs = [receiver.number for receiver in self.receivers]
        return bytes(head) + times + interval + self.digest + bytes(pins) + bytes(inputs) + self._more()

    def _more(self) -> bytes:
        """Bytes that `config_block` has only with averaging, the internal reference, or pins in `more_pins`."""
        pins = [pin for group in self.more_pins.values() for pin in group]
        if self.averages == 1 and not self.is_internal and not pins:
            return b""
        addresses = bytes(receiver.address for receiver in self.receivers if self.has_addresses)
        return self.averages.to_bytes(2, "little") + bytes([self.is_internal, *pins]) + addresses

    @property
    def is_dark_around_each(self) -> bool:
        """Whether a frame has a dark state before and after each emitter's state."""
        return self.dark == "each"

    def config_crc(self) -> int:
        """CRC-32 of `config_block`, which the firmware's self-test also reports."""
        return zlib.crc32(self.config_block())


def firmware_settings(design: SensorDesign) -> FirmwareSettings:
    """The firmware's settings for a valid design.

    Raises
    ------
    DesignError : the design breaks a rule, or the catalogue does not contain all data about the board.
    """
    require_valid(design)
    gaps = firmware_gaps(design)
    board, use = board_of(design), design.board
    chip = board.firmware or board.arduino
    if gaps or chip is None:
        raise DesignError(f"{design.name}: no firmware can be made\n" + "\n".join(f"  {gap}" for gap in gaps))
    connections, multiplexer = connections_of(design), multiplexer_of(design)
    register = shift_register_of(design)
    return FirmwareSettings(
        design=design.name,
        digest=bytes.fromhex(design.digest),
        board_number=board.link_number,
        board_title=board.title,
        chip=chip,
        clock_hz=board.clock_hz,
        adc_bits=adc_bits(design),
        prescaler_exponent=use.adc_prescaler.bit_length() - 1 if board.divides_clock else 0,
        settle_us=math.ceil(use.settle_us),
        baud=use.baud,
        baud_divisor=baud_divisor(board.clock_hz, use.baud),
        frame_interval_us=math.ceil(US_PER_S / use.frame_rate_hz),
        emitters=tuple(EmitterPin(name=one.part.name, number=one.pin_number) for one in connections.emitters),
        receivers=tuple(
            ReceiverInput(
                name=one.part.name,
                label=one.pin,
                channel="" if converter_of(design) else board.analog_channels[one.pin_number],
                number=one.pin_number,
                address=one.address or 0,
            )
            for one in connections.receivers
        ),
        averages=use.averages,
        is_internal=use.reference == "internal",
        dark=use.dark,
        shift_pins=() if register is None else switch_pins(design, board, len(connections.emitters)),
        shift_bits=0 if register is None else register.needed(len(connections.emitters)) * register.outputs,
        address_pins=address_pins(design),
        address_settle_us=0 if multiplexer is None else math.ceil(multiplexer.settle_us.value),
        converter=_converter_settings(design, board),
        driver=_driver_settings(design, board, len(connections.emitters)),
    )


def _converter_settings(design: SensorDesign, board: Board) -> ConverterSettings | None:
    entry = converter_of(design)
    if entry is None:
        return None
    return ConverterSettings(
        commands=entry.commands,
        channels=entry.channels,
        clock_hz=entry.clock_hz(board),
        spi_mode=entry.spi_mode,
        gap_us=math.ceil(entry.gap_us.value),
        range_code=entry.range_code or 0,
        pins=select_pins(design),
    )


def _driver_settings(design: SensorDesign, board: Board, emitter_count: int) -> DriverSettings | None:
    entry = driver_of(design)
    if entry is None:
        return None
    return DriverSettings(
        outputs=entry.needed(emitter_count) * entry.outputs,
        grayscale_bits=entry.grayscale_bits,
        clock_hz=entry.clock_hz(emitter_count),
        turn_on_us=entry.turn_on_wait_us,
        pins=switch_pins(design, board, emitter_count),
    )


def firmware_gaps(design: SensorDesign) -> tuple[str, ...]:
    """Reasons why no firmware can be made for the design's board; empty if there are none."""
    cavity = cavity_of(design)
    found = firmware_findings(design, board_of(design), len(cavity.emitters), len(cavity.receivers))
    return tuple(str(finding) for finding in found)


def plain(text: str) -> str:
    """A text that is safe inside a C comment or string; all unsafe characters are replaced by spaces."""
    return re.sub(r"[^A-Za-z0-9 ._+():-]", " ", text)


def config_header(settings: FirmwareSettings) -> str:
    """Text of the file `config.h` with these settings."""
    chip = settings.chip
    own = _avr_lines(settings, chip) if isinstance(chip, BoardFirmware) else _arduino_lines(settings, chip)
    lines = [
        *_heading(settings),
        "#ifndef OPTOPAD_CONFIG_H",
        "#define OPTOPAD_CONFIG_H",
        "#define U16(n) (n) & 255, (n) >> 8 & 255",
        "#define U32(n) U16((n) & 65535), U16((n) >> 16)",
        "",
        f"#define BOARD_NUMBER {settings.board_number}",
        f"#define ADC_BITS {settings.adc_bits}",
        *_tunable(
            "PRESCALER_EXPONENT", f"{settings.prescaler_exponent}", "ADC clock = clock / 2 to this power"
        ),
        *_tunable("SETTLE_US", f"{settings.settle_us}UL", "wait after an emitter switches"),
        *_tunable("FRAME_INTERVAL_US", f"{settings.frame_interval_us}UL", "0: as fast as possible"),
        f"#define BAUD {settings.baud}UL",
        f"#define N_EMITTERS {len(settings.emitters)}",
        *_commented_list("EMITTER_PINS", (f"{e.number} /* {plain(e.name)} */" for e in settings.emitters)),
        f"#define N_RECEIVERS {len(settings.receivers)}",
        *_list("CHANNEL_NUMBERS", (str(r.number) for r in settings.receivers)),
        *_tunable("AVERAGES", f"{settings.averages}", "readings a value"),
        f"#define DARK_AROUND_EACH {int(settings.is_dark_around_each)} /* 1: dark before and after each emitter */",
        f"#define ADDRESS_BITS {len(settings.address_pins)} /* of the multiplexers; 0: none */",
        f"#define SHIFT_BITS {settings.shift_bits} /* of the shift registers; 0: none */",
        f"#define CONVERTERS {len(settings.more_pins.get('SELECT_PINS', ()))} /* on the SPI bus; 0: the board's own */",
        f"#define DRIVER_OUTPUTS {settings.driver.outputs if settings.driver else 0} /* of the LED drivers; 0: none */",
        *_more_hardware(settings),
        *_list("DESIGN_DIGEST", (f"0x{byte:02x}" for byte in settings.digest)),
        "",
        *own,
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _more_hardware(settings: FirmwareSettings) -> Iterable[str]:
    more, driver, converter = list(settings.more_pins), settings.driver, settings.converter
    for name, pins in settings.more_pins.items():
        yield from _list(name, map(str, pins))
    if settings.address_pins:
        yield f"#define ADDRESS_SETTLE_US {settings.address_settle_us}UL"
    if driver is not None:
        yield f"#define GRAYSCALE_BITS {driver.grayscale_bits} /* of one output */"
        yield from _tunable("DRIVER_HZ", f"{driver.clock_hz}UL", "clock of the SPI bus to the LED drivers")
        yield from _tunable("DRIVER_ON_US", f"{driver.turn_on_us}", "until an output is on after blanking")
    if converter is not None:
        yield f"#define CONVERTER_IS_{converter.commands.upper()} 1"
        yield f"#define CONVERTER_CHANNELS {converter.channels}"
        yield from _tunable(
            "CONVERTER_HZ", f"{converter.clock_hz}UL", "clock of the SPI bus to the converters"
        )
        yield from _tunable("CONVERTER_MODE", f"SPI_MODE{converter.spi_mode}", "of the SPI bus")
        yield from _tunable("CONVERTER_GAP_US", f"{converter.gap_us}", "chip select high between readings")
        yield f"#define CONVERTER_RANGE {converter.range_code}"
    if settings.has_addresses:
        yield from _list("CHANNEL_ADDRESSES", (str(one.address) for one in settings.receivers))
        more.append("CHANNEL_ADDRESSES")
    if more or settings.averages > 1 or settings.is_internal:
        more = [f"U16({settings.averages})", str(int(settings.is_internal)), *more]
    yield f"#define MORE_CONFIG {''.join(f', {one}' for one in more)}".rstrip()


def _avr_lines(settings: FirmwareSettings, chip: BoardFirmware) -> Iterable[str]:
    muxes = [chip.channel_mux[one.channel] for one in settings.receivers]
    yield from _only_for(_chip_macro(chip.mcu), chip.mcu, chip)
    yield f"#define CLOCK_HZ {settings.clock_hz}UL"
    yield from _tunable(
        "SWITCH_EARLY", "0", "1: switch during a state's last conversion, once its input is sampled"
    )
    yield f"#define BAUD_DIVISOR {settings.baud_divisor} /* of an eighth of the clock */"
    yield f"#define RECEIVE_VECTOR {chip.receive_vector}"
    yield f"#define TRANSMIT_VECTOR {chip.transmit_vector}"
    yield f"#define REFERENCE_MUX {chip.reference_mux}"
    yield f"#define FULL_SCALE_BITS {chip.internal_reference_bits if settings.is_internal else SUPPLY_BITS}"
    yield f"#define ANY_MUX5 {int(any(mux & MUX5 for mux in muxes))}"
    if settings.shift_pins:
        yield from _commented_list("EMITTERS", (f"NO_LED /* {plain(e.name)} */" for e in settings.emitters))
        lines = [chip.pin_ports[pin] for pin in settings.shift_pins]
        yield from _list("SHIFTS", (f"LED({line[0]}, {line[1:]})" for line in lines))
    else:
        ports = [(chip.pin_ports[one.number], one) for one in settings.emitters]
        yield from _commented_list(
            "EMITTERS",
            (f"LED({port[0]}, {port[1:]}) /* {plain(e.name)}, pin {e.number} */" for port, e in ports),
        )
    inputs = zip(muxes, settings.receivers, strict=True)
    yield from _commented_list(
        "CHANNEL_MUX", (f"{mux} /* {plain(r.name)}, {plain(r.label)} */" for mux, r in inputs)
    )
    lines = [chip.pin_ports[pin] for pin in settings.address_pins]
    if lines:
        yield from _list("ADDRESSES", (f"LED({line[0]}, {line[1:]})" for line in lines))


def _arduino_lines(settings: FirmwareSettings, chip: ArduinoProgram) -> Iterable[str]:
    yield from _only_for(chip.core_macro, settings.board_title, chip)
    if settings.converter is not None:
        return
    yield from _commented_list(
        "CHANNEL_PINS",
        (
            f"{chip.analog_pins[r.channel]} /* {plain(r.name)}, {plain(r.label)} */"
            for r in settings.receivers
        ),
    )


def _only_for(macro: str, name: str, chip: BoardFirmware | ArduinoProgram) -> Iterable[str]:
    yield f"#ifndef {macro}"
    yield f'#error "this program is for {plain(name)}: select the board {plain(chip.arduino_board)}"'
    yield "#endif"


def _heading(settings: FirmwareSettings) -> Iterable[str]:
    yield f"/* Written by optopad for the design {plain(settings.design)} (digest {settings.digest.hex()[:8]})"
    yield f"   on the board {plain(settings.board_title)}."
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

MAIN = "main.c"
"""File with the main function. It is not in the sketch folder, because an Arduino core has its own."""


def source_text(name: str) -> str:
    """Text of a source file of the firmware."""
    return files("optopad.fabrication").joinpath("firmware", "source", name).read_text(encoding="utf-8")


def sketch_texts(design: SensorDesign) -> dict[str, str]:
    """Text of every file in the sketch folder, by file name.

    Raises
    ------
    DesignError : the design breaks a rule, or the catalogue does not contain all data about the board.
    """
    settings = firmware_settings(design)
    is_avr = isinstance(settings.chip, BoardFirmware)
    fixed = {name: source_text(name) for name in SHARED_FILES + (AVR_FILES if is_avr else PORTABLE_FILES)}
    return {**fixed, CONFIG: config_header(settings)}


def write_sketch(design: SensorDesign, folder: Path) -> Path:
    """Write the sketch folder into `folder`; remove files for other boards and an outdated compiled program.

    Returns
    -------
    the sketch folder

    Raises
    ------
    DesignError : the design breaks a rule, or the catalogue lacks data about the board; nothing is written.
    OutputError : the folder cannot be written.
    """
    texts, sketch = sketch_texts(design), folder / SKETCH
    sketch.mkdir(parents=True, exist_ok=True)
    if any(_is_other(sketch / name, text) for name, text in texts.items()):
        (folder / IMAGE).unlink(missing_ok=True)
    for name in {*AVR_FILES, *PORTABLE_FILES} - set(texts):
        (sketch / name).unlink(missing_ok=True)
    for name, text in texts.items():
        write_text_atomically(sketch / name, text)
    return sketch


def _is_other(file: Path, text: str) -> bool:
    return not file.is_file() or file.read_text(encoding="utf-8", errors="replace") != text
