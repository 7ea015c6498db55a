"""Connections of emitters and receivers to pins, which all manufacturing sheets take from this list.

Order, positions and names come from `optopad.design.shape.cavity`, pins and channels from
`optopad.design.circuit.pins`. In state i only emitter i is lit; in the last state no emitter is lit. Column j of a
state's readings is receiver j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from optopad.design.circuit.pins import (
    ReceiverPath,
    assigned_pins,
    board_of,
    converter_of,
    driver_of,
    emitter_label,
    multiplexer_of,
    receiver_paths,
    shift_register_of,
)
from optopad.design.shape.cavity import PlacedPart, cavity_of
from optopad.design.spec import SensorDesign

EMITTER_POLARITY = "anode to the series resistor, cathode to the transistor's collector"
SINK_POLARITY = "anode to the supply, cathode to the output of the LED driver"
RECEIVER_POLARITY = "cathode to the amplifier's inverting input, anode to ground"
TWO_LEADS = 2


@dataclass(frozen=True, kw_only=True)
class Connection:
    """An emitter or receiver, and how it is connected.

    Attributes
    ----------
    part : the part with its position and orientation
    pin : name of the pin, such as "D22" (digital pin of the board), "A0" (its analogue input), "S1-Q3" (output 3 of
        shift register S1), "L1-Q3" (output 3 of LED driver L1), "M1-C3" (channel 3 of multiplexer M1), or "U1-C3"
        (channel 3 of converter U1)
    pin_number : number of the digital pin, of the output along the chain of shift registers or LED drivers, of the
        board's analogue input, or of the converter
    address : channel of the multiplexer, or input of the converter, at which the receiver is connected; None if the
        part has neither
    polarity : how the part's own leads are connected, in words
    number : index of an emitter among the emitters, or of a receiver among the columns of the readings; from 0
    position_mm : centre of the active area (x, y, z) in the cavity's coordinate system [mm]
    normal : unit vector from the wall into the cavity (x, y, z) [-]
    """

    part: PlacedPart
    pin: str
    pin_number: int
    number: int
    position_mm: tuple[float, float, float]
    normal: tuple[float, float, float]
    polarity: str
    address: int | None = None


@dataclass(frozen=True, kw_only=True)
class Connections:
    """Connections of all emitters, in the order in which they are lit, and of all receivers, in column order."""

    emitters: tuple[Connection, ...]
    receivers: tuple[Connection, ...]

    @property
    def all(self) -> tuple[Connection, ...]:
        """All connections: emitters, then receivers."""
        return self.emitters + self.receivers


def pin_words(design: SensorDesign) -> str:
    """Explanation of a design's pin names, such as "S1-Q0: output 0 of shift register S1"."""
    words = ["D: digital pin", "A: analogue input"]
    if multiplexer_of(design) is not None:
        words.append("M1-C0: channel 0 of multiplexer M1")
    if shift_register_of(design) is not None:
        words.append("S1-Q0: output 0 of shift register S1")
    if converter_of(design) is not None:
        words[1] = "U1-C0: channel 0 of converter U1"
    if driver_of(design) is not None:
        words.append("L1-Q0: output 0 of LED driver L1")
    return ", ".join(words)


def polarity_of(part: PlacedPart, design: SensorDesign) -> str:
    """How the anode and cathode of a part are connected, in words; its data sheet shows which lead is which."""
    emitter = EMITTER_POLARITY if driver_of(design) is None else SINK_POLARITY
    polarity = emitter if part.kind == "emitter" else RECEIVER_POLARITY
    leads = part.part.lead_count
    return polarity if leads == TWO_LEADS else f"{polarity}; {leads} leads, see the data sheet for the others"


def _inward(part: PlacedPart) -> tuple[float, float, float]:
    x, y = part.line.outward
    return 0.0 - x, 0.0 - y, 0.0


def _number(path: ReceiverPath, channels: Sequence[str]) -> int:
    return channels.index(path.channel) if path.converter is None else path.converter


def connections_of(design: SensorDesign) -> Connections:
    """Connections of all parts of a design.

    Raises
    ------
    DesignError : a part is not in the catalogue, or the board lacks a required pin.
    """
    cavity = cavity_of(design)
    (pins, _), paths = assigned_pins(design), receiver_paths(design)
    known = board_of(design).analog_channels

    def connection(
        part: PlacedPart, number: int, pin: str, pin_number: int, address: int | None = None
    ) -> Connection:
        return Connection(
            part=part,
            pin=pin,
            pin_number=pin_number,
            number=number,
            position_mm=part.position_mm,
            normal=_inward(part),
            polarity=polarity_of(part, design),
            address=address,
        )

    lit = zip(cavity.emitters, pins, strict=True)
    read = zip(cavity.receivers, paths, strict=True)
    return Connections(
        emitters=tuple(
            connection(part, i, emitter_label(design, pin), pin) for i, (part, pin) in enumerate(lit)
        ),
        receivers=tuple(
            connection(part, j, path.label, _number(path, known), path.address)
            for j, (part, path) in enumerate(read)
        ),
    )
