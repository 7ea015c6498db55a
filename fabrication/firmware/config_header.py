"""`config.h`: a design's firmware settings as C."""

from __future__ import annotations

import re
from collections.abc import Iterable

from design.parts.board_firmware import MUX5
from fabrication.firmware.settings import FirmwareSettings


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
        f'#error "this program is for {chip.mcu}: choose the board {plain(chip.arduino_board)}"',
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
        *_tunable("SWITCH_EARLY", "0", "1: switch during a state's last conversion, once its input is held"),
        *_tunable("FRAME_INTERVAL_US", f"{settings.frame_interval_us}UL", "0: as fast as it can"),
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
    yield "   Change the design and write it anew: the host refuses a program that is not its design's. */"


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
