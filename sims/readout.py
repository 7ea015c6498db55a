"""From light to counts: one common transimpedance gain, then a converter that clips.

counts = gain x flux, flux as a fraction of the emitted power. The gain is set so that the median
judged pair of the untouched pad reads `gain.target_counts`. Left out for now: gain per receiver,
ambient light, drift (they belong to the signal chain).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.catalog import find_board
from design.errors import ModelScopeError
from design.properties import entries_of
from design.spec import SensorDesign

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Readout:
    """The common gain and the converter's range.

    Attributes
    ----------
    counts_per_flux : ADC counts for all of an emitter's power on one receiver [counts]
    full_scale_counts : largest reading [counts]
    """

    counts_per_flux: float
    full_scale_counts: float

    def counts(self, flux: FloatArray) -> FloatArray:
        """Readings of a flux array of any shape, clipped at full scale [counts]."""
        return np.minimum(flux * self.counts_per_flux, self.full_scale_counts)


def readout_of(design: SensorDesign, untouched_flux: FloatArray, reference: BoolArray) -> Readout:
    """Set the common gain on the untouched pad.

    Parameters
    ----------
    untouched_flux : (emitter, receiver) flux as a fraction of emitted power [-]
    reference : (emitter, receiver) pairs whose median is brought to the target

    Raises
    ------
    ModelScopeError : the reference pairs receive no light, so no gain exists.
    """
    median = float(np.median(untouched_flux[reference])) if reference.any() else 0.0
    if not median > 0.0:
        raise ModelScopeError(
            f"gain.target_counts: the median judged pair receives {median:.1e} of the emitted power; "
            "no gain makes a signal of that: raise the emitters and receivers into the clear layer"
        )
    return Readout(
        counts_per_flux=design.gain.target_counts / median, full_scale_counts=full_scale_counts(design)
    )


def full_scale_counts(design: SensorDesign) -> float:
    """Largest reading of the board's converter [counts]."""
    return float(2 ** find_board(entries_of(design), design.board.kind).adc_bits - 1)
