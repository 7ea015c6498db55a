"""Properties of a board that are needed to generate and upload firmware.

There are two programs. Boards with an AVR chip that has the ATmega's converter and timer run a program that accesses
registers (`BoardFirmware`). Their entries list the port of every pin and the multiplexer setting of every input. Every
other board with an Arduino core runs a portable program, which names pins as the core does (`ArduinoProgram`).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from optopad.design.fields.base import Model
from optopad.design.fields.quantity import Confidence, Notes, Text

PortBit = Annotated[str, Field(pattern=r"^[A-L][0-7]$")]
"""Letter of a port and number of a bit, such as H3."""

VectorName = Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9_]*_vect$")]

AnalogPin = Annotated[str, Field(pattern=r"^A?[0-9]{1,3}$")]
"""Name of an analogue input in the Arduino core, such as A0 or 26."""

SUPPLY_BITS = 64
"""Bits of the ADC multiplexer's register that select the supply as the full-scale reference."""

MUX5 = 32
"""The sixth bit of an ADC multiplexer setting, which is in a different register from the other bits."""


class BoardFirmware(Model):
    """Chip, registers, memory and upload of a board that runs the program for AVR chips."""

    source: Annotated[Text, Field(description="source of the entry's values")]
    confidence: Confidence
    mcu: Annotated[str, Field(pattern=r"^atmega[0-9a-z]+$", description="as the compiler names the chip")]
    signature: Annotated[str, Field(pattern=r"^[0-9a-f]{6}$", description="of the chip, hexadecimal")]
    flash_bytes: Annotated[int, Field(gt=0, description="program memory without the boot loader")]
    ram_bytes: Annotated[int, Field(gt=0, description="memory of the chip")]
    programmer: Annotated[Text, Field(description="avrdude's name of the boot loader's protocol")]
    upload_baud: Annotated[int, Field(ge=1200, description="baud rate of the boot loader")]
    arduino_board: Annotated[Text, Field(description="as the Arduino IDE names the board")]
    pin_ports: Annotated[tuple[PortBit, ...], Field(description="port and bit by pin number, from 0")]
    channel_mux: Annotated[
        dict[str, Annotated[int, Field(ge=0, le=63)]], Field(description="multiplexer setting by input")
    ]
    reference_mux: Annotated[int, Field(ge=0, le=31, description="setting of the internal 1.1 V reference")]
    internal_reference_bits: Annotated[
        int, Field(ge=0, le=255, description="of the multiplexer's register, for the reference at full scale")
    ] = 128
    receive_vector: Annotated[VectorName, Field(description="interrupt: the serial line has received a byte")]
    transmit_vector: Annotated[VectorName, Field(description="interrupt: the serial line can send a byte")]


class BootDrive(Model):
    """The drive that a board in boot mode appears as: copying a UF2 file to it programs the board."""

    source: Annotated[Text, Field(description="where the entry's values come from")]
    confidence: Confidence
    board_id: Annotated[Text, Field(description="Board-ID in the drive's INFO_UF2.TXT")]
    families: Annotated[
        tuple[Annotated[int, Field(ge=0, lt=2**32)], ...],
        Field(min_length=1, description="family identifiers of the UF2 files that its boot loader takes"),
    ]


class ArduinoProgram(Model):
    """Arduino core, pins and memory of a board that runs the portable program."""

    unsaid = ("spi_pins", "boot_drive")

    source: Annotated[Text, Field(description="where the entry's values come from")]
    confidence: Confidence
    fqbn: Annotated[
        str,
        Field(
            pattern=r"^[A-Za-z0-9_.-]+(:[A-Za-z0-9_.-]+){2}(:[A-Za-z0-9_.,=-]+)?$",
            description="core and board as arduino-cli names them, such as teensy:avr:teensy40",
        ),
    ]
    core_macro: Annotated[
        str,
        Field(
            pattern=r"^[A-Z_][A-Za-z0-9_]*$", description="macro that the core defines for this board alone"
        ),
    ]
    serial: Annotated[
        Literal["usb", "uart"], Field(description="what the core's `Serial` is: USB has no baud rate")
    ]
    analog_pins: Annotated[dict[str, AnalogPin], Field(description="the core's name of each input")]
    spi_pins: Annotated[
        tuple[int, int, int] | None,
        Field(description="pins of the core's `SPI`: clock, data out (MOSI), data in (MISO); absent: none"),
    ] = None
    flash_bytes: Annotated[int, Field(gt=0, description="left for the program by the boot loader")]
    ram_bytes: Annotated[int, Field(gt=0, description="memory of the chip")]
    boot_drive: Annotated[
        BootDrive | None, Field(description="of a board that takes UF2 files; absent: none")
    ] = None
    notes: Notes = ()

    @property
    def arduino_board(self) -> str:
        """Name of the board as arduino-cli expects it (FQBN)."""
        return self.fqbn
