"""Flux from every emitter to every receiver: the named result of a trace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from design.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class LightSignals:
    """Flux over emitted power, by state, emitter and receiver.

    Attributes
    ----------
    flux : (state, emitter, receiver) sum over path classes [-]
    by_class : path class (direct, top, skirt, wall, diffuse) to (state, emitter, receiver) [-];
        light mirrored by the top is top + skirt
    standard_error : (state, emitter, receiver) standard error of flux; for its scope see `engine.trace_states` [-]
    change_error : same shape, the part of it that states do not share, for differences of two states; None: all of it
    presses : (state, 3) x, y, depth of the press, or (state, tip, 3) where some state has several tips;
        depth 0 or less is untouched [mm]
    digest : digest of the design
    seed : seed of the offsets
    relative_error : (state,) root mean square over the requested pairs of standard error over untouched flux [-]
    is_met : (state,) whether that is within the required relative error; True where none was required
    """

    flux: FloatArray
    by_class: Mapping[str, FloatArray]
    standard_error: FloatArray
    presses: FloatArray
    digest: str
    seed: int
    relative_error: FloatArray | None = None
    is_met: BoolArray | None = None
    change_error: FloatArray | None = None

    @property
    def error_of_changes(self) -> FloatArray:
        """(state, emitter, receiver) error of a state when it is compared with others of the same trace [-]."""
        return self.standard_error if self.change_error is None else self.change_error
