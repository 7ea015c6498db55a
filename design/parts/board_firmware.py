"""What the generated firmware needs to know of a board's AVR chip, and what it takes to upload it.

Ports and multiplexer settings of pins and inputs live here and nowhere else, so that an index map is
never written by hand. Left out: boards whose chip is no AVR with the ATmega's converter and timer.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from design.fields.base import Model
from design.fields.quantity import Confidence, Text

PortBit = Annotated[str, Field(pattern=r"^[A-L][0-7]$")]
"""Letter of a port and number of a bit, as H3."""

VectorName = Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9_]*_vect$")]

MUX5 = 32
"""The multiplexer's sixth bit, which lies in another register than the rest."""


class BoardFirmware(Model):
    """Chip, registers, memory and upload of a board."""

    source: Annotated[Text, Field(description="source of the entry's values")]
    confidence: Confidence
    mcu: Annotated[str, Field(pattern=r"^atmega[0-9a-z]+$", description="as the compiler names the chip")]
    signature: Annotated[str, Field(pattern=r"^[0-9a-f]{6}$", description="of the chip, hexadecimal")]
    flash_bytes: Annotated[int, Field(gt=0, description="program memory without the boot loader")]
    ram_bytes: Annotated[int, Field(gt=0)]
    programmer: Annotated[Text, Field(description="avrdude's name of the boot loader's protocol")]
    upload_baud: Annotated[int, Field(ge=1200)]
    arduino_board: Annotated[Text, Field(description="as the Arduino IDE names the board")]
    pin_ports: Annotated[tuple[PortBit, ...], Field(description="port and bit by pin number, from 0")]
    channel_mux: Annotated[
        dict[str, Annotated[int, Field(ge=0, le=63)]], Field(description="multiplexer setting by input")
    ]
    reference_mux: Annotated[int, Field(ge=0, le=31, description="setting of the internal 1.1 V reference")]
    receive_vector: Annotated[VectorName, Field(description="interrupt: the serial line has received a byte")]
    transmit_vector: Annotated[VectorName, Field(description="interrupt: the serial line can send a byte")]
