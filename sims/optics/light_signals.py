"""Result of a light trace: the flux from every emitter to every receiver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from optopad.design.arrays import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True)
class LightSignals:
    """Flux from each emitter to each receiver in each state, divided by the emitter's power.

    A state is the untouched pad or one set of simultaneous presses.

    Attributes
    ----------
    flux : (state, emitter, receiver) sum over path classes [-]
    by_class : for each path class (direct, top, skirt, wall, diffuse) its (state, emitter, receiver) flux [-]; the sum
        of top and skirt is all light mirrored by the top
    standard_error : (state, emitter, receiver) standard error of `flux` [-]; `engine.trace_states` says what it covers
    change_error : (state, emitter, receiver) part of the standard error that differs from state to state [-], for the
        difference of two states. If None, this is all of the standard error
    presses : (state, 3) x, y and depth of the press, or (state, tip, 3) if some state has several tips [mm]; a depth of
        0 or less means untouched
    digest : hash of the design
    seed : seed of the random offsets
    relative_error : (state,) root mean square, over the requested pairs, of the ratio of standard error to untouched
        flux [-]
    is_met : (state,) whether `relative_error` is within the required error; True if no error was required
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
        """(state, emitter, receiver) error for comparing states [-]: `change_error`, or `standard_error` if None."""
        return self.standard_error if self.change_error is None else self.change_error
