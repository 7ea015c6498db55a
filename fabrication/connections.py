"""Connections of emitters and receivers, which all manufacturing sheets take from this list.

Order, positions and names come from `optopad.design.shape.cavity`, pins and channels from
`optopad.design.circuit.circuit`. In state i only emitter i is lit; in the last state no emitter is lit. Column j of a
state's readings is receiver j.
"""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.circuit.circuit import Circuit, Path
from optopad.design.circuit.pin_rules import pin_findings
from optopad.design.errors import DesignError
from optopad.design.parts.circuits import Converter
from optopad.design.shape.cavity import PlacedPart

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
    path : its terminal, and the way from there to the board
    number : index of an emitter among the emitters, or of a receiver among the columns of the readings; from 0
    polarity : how the part's own leads are connected, in words
    """

    part: PlacedPart
    path: Path
    number: int
    polarity: str

    @property
    def pin(self) -> str:
        """Name of the terminal, such as D22, A0, S1-Q3, L1-Q3, M1-C3 or U1-C3."""
        return self.path.pin

    @property
    def normal(self) -> tuple[float, float, float]:
        """Unit vector in which the part looks, into the cavity (x, y, z) [-]."""
        x, y, z = self.part.axis
        return x + 0.0, y + 0.0, z + 0.0


@dataclass(frozen=True, kw_only=True)
class Connections:
    """Connections of all emitters, in the order in which they are lit, and of all receivers, in column order."""

    emitters: tuple[Connection, ...]
    receivers: tuple[Connection, ...]

    @property
    def all(self) -> tuple[Connection, ...]:
        """All connections: emitters, then receivers."""
        return self.emitters + self.receivers


def pin_words(circuit: Circuit) -> str:
    """Explanation of a circuit's pin names, such as "S1-Q0: output 0 of shift register S1"."""
    words = ["D: digital pin", "A: analogue input"]
    for chips in reversed(circuit.chips):
        one, chip = chips.entry, chips.names[0]
        name = f"{chip}-{one.terminal}0: {one.size_field[:-1]} 0 of {one.noun} {chip}"
        words = [words[0], name] if isinstance(one, Converter) else [*words, name]
    return ", ".join(words)


def polarity_of(part: PlacedPart, circuit: Circuit) -> str:
    """How the anode and cathode of a part are connected, in words; its data sheet shows which lead is which."""
    emitter = EMITTER_POLARITY if circuit.led_driver is None else SINK_POLARITY
    polarity = emitter if part.kind == "emitter" else RECEIVER_POLARITY
    leads = part.part.lead_count
    return polarity if leads == TWO_LEADS else f"{polarity}; {leads} leads, see the data sheet for the others"


def connections_of(circuit: Circuit) -> Connections:
    """Connections of all parts of a circuit.

    Raises
    ------
    DesignError : a part is not in the catalogue, or the board lacks a required pin.
    """
    findings = [str(finding) for finding in pin_findings(circuit)]
    if findings:
        raise DesignError("\n".join(findings))
    emitters, receivers = (
        tuple(
            Connection(part=part, path=path, number=number, polarity=polarity_of(part, circuit))
            for number, (part, path) in enumerate(zip(parts, paths, strict=True))
        )
        for parts, paths in (
            (circuit.cavity.emitters, circuit.emitters),
            (circuit.cavity.receivers, circuit.receivers),
        )
    )
    return Connections(emitters=emitters, receivers=receivers)
