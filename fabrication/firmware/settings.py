"""What the firmware is told about one design: every number by construction from the wiring's own connections.

`fabrication.connections` says which pin lights which emitter and which input reads which receiver, for the
wiring table, `driver.toml` and the firmware alike; the board's entry says which port and multiplexer setting
that is. Nothing is typed twice.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

from design.circuit.pins import board_of
from design.circuit.timing import US_PER_S, baud_divisor
from design.errors import DesignError
from design.parts.board_firmware import BoardFirmware
from design.rules.check import require_valid
from design.rules.firmware import firmware_findings
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
