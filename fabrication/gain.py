"""The simulated gain from light to counts, which all sheets use, and the pairs that exceed full scale with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import Feedback, feedbacks_of
from optopad.design.shape.cavity import pair_name
from optopad.design.spec import SensorDesign

Floats = FloatArray


@dataclass(frozen=True, kw_only=True)
class SimulatedGain:
    """Gains of the receivers from light to counts, and the simulated light of the untouched pad.

    Attributes
    ----------
    counts_per_flux : reading of each receiver if it got all of an emitter's power [counts]
    untouched_flux : fraction of the emitter's power that reaches the receiver without contact [emitter][receiver] [-]
    """

    counts_per_flux: tuple[float, ...]
    untouched_flux: tuple[tuple[float, ...], ...]

    def untouched_counts(self, factors: Sequence[float] | None = None) -> Floats:
        """Readings of the untouched pad, not limited to full scale; shape (emitters, receivers) [counts].

        Parameters
        ----------
        factors : ratio of each receiver's actual gain to its required gain [-]; if None, 1 for all receivers
        """
        gains = np.array(self.counts_per_flux) * (1.0 if factors is None else np.array(factors))
        counts: Floats = np.array(self.untouched_flux) * gains
        return counts

    def untouched_readings(self, design: SensorDesign) -> Floats:
        """Readings of the untouched pad, limited to full scale; shape (emitters, receivers) [counts]."""
        readings: Floats = np.minimum(self.untouched_counts(), Circuit.of(design).adc.full_scale_counts)
        return readings


@dataclass(frozen=True, kw_only=True)
class ClippedPair:
    """A pair that would read above full scale on the untouched pad: its name and unlimited reading [counts]."""

    name: str
    counts: float


def gain_of(score: Mapping[str, Any]) -> SimulatedGain | None:
    """The gains and light of a score's plain data, as in `score.json`; None if the models do not cover the design.

    Raises
    ------
    KeyError, TypeError, ValueError : the data are not those of a score.
    """
    if score["counts_per_flux"] is None:
        return None
    return SimulatedGain(
        counts_per_flux=tuple(map(float, score["receiver_counts_per_flux"])),
        untouched_flux=tuple(tuple(map(float, row)) for row in score["untouched_flux"]),
    )


def feedbacks_for(circuit: Circuit, gain: SimulatedGain | None) -> tuple[Feedback, ...] | None:
    """Feedback components of each receiver's amplifier; None if they depend on a simulated gain and `gain` is None."""
    return feedbacks_of(circuit, None if gain is None else gain.counts_per_flux)


def clipped_pairs(design: SensorDesign, gain: SimulatedGain) -> tuple[ClippedPair, ...]:
    """Pairs that would read above full scale on the untouched pad with standard resistors, the brightest first."""
    circuit = Circuit.of(design)
    cavity, feedbacks = circuit.cavity, feedbacks_for(circuit, gain)
    factors = None if feedbacks is None else [one.gain_factor for one in feedbacks]
    counts = gain.untouched_counts(factors)
    full_scale = Circuit.of(design).adc.full_scale_counts
    found = [
        ClippedPair(name=pair_name(cavity, (i, j)), counts=float(counts[i, j]))
        for i, j in np.argwhere(counts > full_scale)
    ]
    return tuple(sorted(found, key=lambda one: -one.counts))
