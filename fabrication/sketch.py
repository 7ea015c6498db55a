"""The sketch folder, which the Arduino IDE opens as it is, and which the compiler takes with `main.c` beside it.

What the firmware is told about one design: every number by construction from the wiring's own connections.

`fabrication.connections` says which pin lights which emitter and which input reads which receiver, for the
wiring table, `driver.toml` and the firmware alike; the board's entry says which port and multiplexer setting
that is. Nothing is typed twice.

`config.h`: a design's firmware settings as C.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from design.circuit.pins import US_PER_S, baud_divisor, board_of
from design.errors import DesignError
from design.io import write_text_atomically
from design.parts.board_firmware import MUX5, BoardFirmware
from design.rules.board import firmware_findings
from design.rules.check import require_valid
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from fabrication.connections import Connection, connections_of


@dataclass(frozen=True, kw_only=True)
class EmitterPin:
    """An emitter's name, its pin's number on the board, and the port's letter and bit of that pin."""

    name: str
    number: int
    port: str
    bit: int


@dataclass(frozen=True, kw_only=True)
class ReceiverInput:
    """A receiver's name, its input's name and place among the board's inputs, and the multiplexer's setting."""

    name: str
    channel: str
    number: int
    mux: int


@dataclass(frozen=True, kw_only=True)
class FirmwareSettings:
    """Everything in `config.h`.

    Attributes
    ----------
    board_number : how the board is named to the host
    settle_us : whole microseconds, rounded up from the design's
    frame_interval_us : 1 over the design's frame rate, rounded up, so that it is never exceeded
    digest : of the design, 32 bytes
    """

    design: str
    digest: bytes
    board_number: int
    board_title: str
    chip: BoardFirmware
    clock_hz: int
    adc_bits: int
    prescaler_exponent: int
    settle_us: int
    baud: int
    baud_divisor: int
    frame_interval_us: int
    emitters: tuple[EmitterPin, ...]
    receivers: tuple[ReceiverInput, ...]

    def config_block(self) -> bytes:
        """The bytes that the program holds about itself, and whose CRC-32 a self-test answers with."""
        head = [
            self.board_number,
            len(self.emitters),
            len(self.receivers),
            self.adc_bits,
            self.prescaler_exponent,
        ]
        times = self.settle_us.to_bytes(2, "little") + self.baud.to_bytes(4, "little")
        interval = self.frame_interval_us.to_bytes(4, "little")
        pins = [emitter.number for emitter in self.emitters]
        inputs = [receiver.number for receiver in self.receivers]
        return bytes(head) + times + interval + self.digest + bytes(pins) + bytes(inputs)

    def config_crc(self) -> int:
        """CRC-32 of the config block."""
        return zlib.crc32(self.config_block())


def firmware_settings(design: SensorDesign) -> FirmwareSettings:
    """The settings of a valid design.

    Raises
    ------
    DesignError : the design breaks a rule, or its board's entry does not say enough to program it.
    """
    require_valid(design)
    gaps = firmware_gaps(design)
    board, use = board_of(design), design.board
    if gaps or board.firmware is None:
        raise DesignError(f"{design.name}: no firmware can be made\n" + "\n".join(f"  {gap}" for gap in gaps))
    chip = board.firmware
    connections = connections_of(design)
    return FirmwareSettings(
        design=design.name,
        digest=bytes.fromhex(design.digest),
        board_number=board.link_number,
        board_title=board.title,
        chip=chip,
        clock_hz=board.clock_hz,
        adc_bits=board.adc_bits,
        prescaler_exponent=use.adc_prescaler.bit_length() - 1,
        settle_us=math.ceil(use.settle_us),
        baud=use.baud,
        baud_divisor=baud_divisor(board.clock_hz, use.baud),
        frame_interval_us=math.ceil(US_PER_S / use.frame_rate_hz),
        emitters=tuple(_emitter_pin(one, chip) for one in connections.emitters),
        receivers=tuple(_receiver_input(one, chip) for one in connections.receivers),
    )


def firmware_gaps(design: SensorDesign) -> tuple[str, ...]:
    """Why no firmware can be made for the design's board; empty when it can."""
    cavity = cavity_of(design)
    found = firmware_findings(design, board_of(design), len(cavity.emitters), len(cavity.receivers))
    return tuple(str(finding) for finding in found)


def _emitter_pin(one: Connection, chip: BoardFirmware) -> EmitterPin:
    port_bit = chip.pin_ports[one.pin_number]
    return EmitterPin(name=one.part.name, number=one.pin_number, port=port_bit[0], bit=int(port_bit[1]))


def _receiver_input(one: Connection, chip: BoardFirmware) -> ReceiverInput:
    return ReceiverInput(
        name=one.part.name, channel=one.pin, number=one.pin_number, mux=chip.channel_mux[one.pin]
    )


def plain(text: str) -> str:
    """A text that can stand in a comment or a string of C and end neither; other signs become spaces."""
    return re.sub(r"[^A-Za-z0-9 ._+():-]", " ", text)


def config_header(settings: FirmwareSettings) -> str:
    """Text of `config.h`."""
    chip = settings.chip
    lines = [
        *_heading(settings),
        "#ifndef OPTOPAD_CONFIG_H",
        "#define OPTOPAD_CONFIG_H",
        f"#ifndef {_chip_macro(chip.mcu)}",
        f'#error "this program is for {chip.mcu}: select the board {plain(chip.arduino_board)}"',
        "#endif",
        "#define U16(n) (n) & 255, (n) >> 8 & 255",
        "#define U32(n) U16((n) & 65535), U16((n) >> 16)",
        "",
        f"#define BOARD_NUMBER {settings.board_number}",
        f"#define CLOCK_HZ {settings.clock_hz}UL",
        f"#define ADC_BITS {settings.adc_bits}",
        *_tunable(
            "PRESCALER_EXPONENT", f"{settings.prescaler_exponent}", "ADC clock = clock / 2 to this power"
        ),
        *_tunable("SETTLE_US", f"{settings.settle_us}UL", "wait after an emitter switches"),
        *_tunable(
            "SWITCH_EARLY", "0", "1: switch during a state's last conversion, once its input is sampled"
        ),
        *_tunable("FRAME_INTERVAL_US", f"{settings.frame_interval_us}UL", "0: as fast as possible"),
        f"#define BAUD {settings.baud}UL",
        f"#define BAUD_DIVISOR {settings.baud_divisor} /* of an eighth of the clock */",
        f"#define RECEIVE_VECTOR {chip.receive_vector}",
        f"#define TRANSMIT_VECTOR {chip.transmit_vector}",
        f"#define REFERENCE_MUX {chip.reference_mux}",
        f"#define ANY_MUX5 {int(any(one.mux & MUX5 for one in settings.receivers))}",
        "",
        f"#define N_EMITTERS {len(settings.emitters)}",
        *_commented_list(
            "EMITTERS",
            (f"LED({e.port}, {e.bit}) /* {plain(e.name)}, pin {e.number} */" for e in settings.emitters),
        ),
        *_list("EMITTER_PINS", (str(e.number) for e in settings.emitters)),
        f"#define N_RECEIVERS {len(settings.receivers)}",
        *_commented_list(
            "CHANNEL_MUX", (f"{r.mux} /* {plain(r.name)}, {plain(r.channel)} */" for r in settings.receivers)
        ),
        *_list("CHANNEL_NUMBERS", (str(r.number) for r in settings.receivers)),
        *_list("DESIGN_DIGEST", (f"0x{byte:02x}" for byte in settings.digest)),
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _heading(settings: FirmwareSettings) -> Iterable[str]:
    yield f"/* Written by optopad for the design {plain(settings.design)} (digest {settings.digest.hex()[:8]})"
    yield f"   on the board {plain(settings.board_title)}."
    yield "   Change the design and write it again: the host refuses a program of another design. */"


def _chip_macro(mcu: str) -> str:
    """The macro that the compiler defines for a chip: __AVR_ATmega2560__, __AVR_ATmega328P__."""
    number = mcu.removeprefix("atmega")
    return f"__AVR_ATmega{number.upper()}__"


def _tunable(name: str, value: str, comment: str) -> tuple[str, ...]:
    """A setting that a compiler's option may replace, for the tables of rates."""
    return (f"#ifndef {name}", f"#define {name} {value} /* {comment} */", "#endif")


def _list(name: str, items: Iterable[str]) -> Iterable[str]:
    """A list without braces in one line."""
    yield f"#define {name} {', '.join(items)}"


def _commented_list(name: str, items: Iterable[str]) -> Iterable[str]:
    """A list without braces, an item with its comment a line."""
    *most, last = items
    yield f"#define {name} \\"
    yield from (f"    {_with_comma(item)} \\" for item in most)
    yield f"    {last}"


def _with_comma(item: str) -> str:
    value, space, comment = item.partition(" /*")
    return f"{value},{space}{comment}"


SKETCH = "optopad"
"""Name of the folder and of the .ino in it: the Arduino IDE wants them alike."""

IMAGE = f"{SKETCH}.hex"
CONFIG = "config.h"
FIXED_FILES = ("optopad.ino", "core.c", "core.h", "clock.h", "crc.h", "line.h")
"""The same for every design."""

MAIN = "main.c"
"""What the Arduino core would bring; not in the sketch folder, where there would then be two."""


def source_text(name: str) -> str:
    """A packaged source file."""
    return files("fabrication").joinpath("firmware", "source", name).read_text(encoding="utf-8")


def sketch_texts(design: SensorDesign) -> dict[str, str]:
    """Text of every file of the sketch folder by name.

    Raises
    ------
    DesignError : the design breaks a rule, or its board's entry does not say enough to program it.
    """
    fixed = {name: source_text(name) for name in FIXED_FILES}
    return {**fixed, CONFIG: config_header(firmware_settings(design))}


def write_sketch(design: SensorDesign, folder: Path) -> Path:
    """Write the sketch folder into a folder; an image of a former text beside it is removed.

    Returns
    -------
    the sketch folder

    Raises
    ------
    DesignError : as `sketch_texts`; nothing is written.
    OutputError : the folder cannot be written.
    """
    texts, sketch = sketch_texts(design), folder / SKETCH
    sketch.mkdir(parents=True, exist_ok=True)
    if any(_is_other(sketch / name, text) for name, text in texts.items()):
        (folder / IMAGE).unlink(missing_ok=True)
    for name, text in texts.items():
        write_text_atomically(sketch / name, text)
    return sketch


def _is_other(file: Path, text: str) -> bool:
    return not file.is_file() or file.read_text(encoding="utf-8", errors="replace") != text
