"""Amplifiers of the receivers and transistors of the emitters: entries of the catalogue's `electronics.toml`.

An amplifier's entry has the limits that a transimpedance circuit needs; `optopad.design.circuit.amplifier` compares
them with a design. A transistor's entry has the largest collector current at which its data sheet states the saturation
voltage with a base current of a tenth of it, which is how the base resistors are computed.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from optopad.design.fields.base import Model
from optopad.design.fields.quantity import (
    BiasCurrentPa,
    Confidence,
    CurrentMa,
    FrequencyMhz,
    Notes,
    OutputMarginMv,
    SlewVPerUs,
    Text,
    Title,
)
from optopad.design.parts.circuits import Chip


class Amplifier(Chip):
    """A package of operational amplifiers with one supply; each amplifier serves one receiver."""

    channels: Annotated[int, Field(ge=1, le=8, description="amplifiers in one package")]
    bandwidth_mhz: Annotated[FrequencyMhz, Field(description="gain-bandwidth product, typical")]
    slew_v_per_us: Annotated[SlewVPerUs, Field(description="slew rate, typical")]
    bias_current_pa: Annotated[
        BiasCurrentPa,
        Field(description="input bias current; its high end is compared with a count's current"),
    ]
    output_margin_mv: Annotated[OutputMarginMv, Field(description="supply less the largest output voltage")]
    supply_ma: Annotated[CurrentMa, Field(description="supply current of one amplifier")]

    @property
    def most_bias_pa(self) -> float:
        """Upper end of the input bias current [pA]."""
        bias = self.bias_current_pa
        return bias.value if bias.high is None else bias.high

    def needed(self, receiver_count: int) -> int:
        """Number of packages for this many receivers."""
        return math.ceil(receiver_count / self.channels)


class Transistor(Model):
    """A bipolar NPN transistor that switches one emitter."""

    title: Title
    source: Annotated[Text, Field(description="where the plain numbers of this entry come from")]
    confidence: Confidence
    saturation_ma: Annotated[
        CurrentMa,
        Field(description="most collector current with stated saturation at a base current of a tenth"),
    ]
    most_collector_v: Annotated[float, Field(gt=0.0, le=1000.0, description="most collector voltage [V]")]
    notes: Notes = ()

    @property
    def name(self) -> str:
        """The title up to its first comma, such as 2N3904."""
        return self.title.split(",")[0]
