"""What a trace says: flux of every state, emitter and receiver, with its path classes and its error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LightSignals:
    """Flux as a fraction of an emitter's power. Axes run state, emitter, receiver.

    Attributes
    ----------
    flux : (state, emitter, receiver) sum over path classes [-]; 0 for pairs that were left out
    by_class : the same for `direct`, `top`, `skirt` and `diffuse` light; top + skirt is all that the top mirrors
    standard_error : (state, emitter, receiver) of flux [-]
    presses : (state, 3) x, y, depth of the press [mm]; depth 0 or less is untouched
    digest : of the design that was traced
    seed : of the random offsets
    """

    flux: FloatArray
    by_class: dict[str, FloatArray]
    standard_error: FloatArray
    presses: FloatArray
    digest: str
    seed: int
