"""Readings of a sensor under presses whose place and depth are known: what learners are trained and tested on.

One sample is one frame: every state (each emitter alone, then all off) read by every receiver, and where the stage
says that the tip was. Samples belong to presses (one approach and retraction at one place), presses to sets (one
session of one pattern). Splits keep presses whole: samples of one press are too alike to stand on both sides.

numpy only; files are read and written by `sims.readings.dataset`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError
from design.recordings import OFF, ROLES, SetEntry, signals_of
from sims.readings.label_checks import require_finite

CONVERTED = "converted"
"""Attribute of data that says what was done to the unit of their readings."""


@dataclass(frozen=True, kw_only=True)
class PressData:
    """Samples of one or several sets, in the order in which they were taken.

    Attributes
    ----------
    counts : (sample, state, receiver) float32 readings; the last state is ``off`` [ADC counts]
    press_mm : (sample, 3) x, y, depth as the stage reports them; depth 0 or less is untouched [mm]
    time_s : (sample,) of each frame within its set [s]
    set_number : (sample,) index into `sets`
    place_number : (sample,) which press of its set
    sets : the sessions
    state_names, receiver_names : in the order of the axes
    full_scale_counts : reading at which the converter clips; None where the file does not say [counts]
    design_digest : of the design that was built or simulated; None where the file does not say
    attributes : what else is known: protocol, parameters of the signal chain, seed
    true_press_mm : (sample, 3) where the tip really was; simulated sets only [mm]
    """

    counts: NDArray[np.float32]
    press_mm: FloatArray
    time_s: FloatArray
    set_number: IntArray
    place_number: IntArray
    sets: tuple[SetEntry, ...]
    state_names: tuple[str, ...]
    receiver_names: tuple[str, ...]
    full_scale_counts: float | None = None
    design_digest: str | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    true_press_mm: FloatArray | None = None

    def __post_init__(self) -> None:
        _require_shapes(self)
        arrays = {name: getattr(self, name) for name in ("counts", "press_mm", "time_s", "true_press_mm")}
        require_finite(arrays, where="data", row="sample")

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def emitter_names(self) -> tuple[str, ...]:
        """Names of the states but ``off``."""
        return self.state_names[:-1]

    @property
    def pair_names(self) -> tuple[str, ...]:
        """Names of the features, emitter outermost: ``E1-R1``, ``E1-R2``, ..."""
        return tuple(f"{e}-{r}" for e in self.emitter_names for r in self.receiver_names)

    def signals(self) -> NDArray[np.float32]:
        """(sample, emitter, receiver) readings less those of the off state [counts]."""
        return signals_of(self.counts)

    def features(self) -> NDArray[np.float32]:
        """(sample, pair) the same, emitter outermost [counts]."""
        return self.signals().reshape(len(self), -1)

    def only(self, mask: BoolArray | IntArray) -> PressData:
        """The samples that a mask (sample,) picks, or of the numbers (n,) given."""
        picked = {
            name: getattr(self, name)[mask]
            for name in ("counts", "press_mm", "time_s", "set_number", "place_number")
        }
        truth = None if self.true_press_mm is None else self.true_press_mm[mask]
        return replace(self, **picked, true_press_mm=truth)

    def role(self, name: str) -> PressData:
        """Samples of all sets with a role, ``train`` or ``test``.

        Raises
        ------
        InputError : no such role.
        """
        if name not in ROLES:
            raise InputError(f"role: {name!r} is refused: give {' or '.join(ROLES)}")
        wanted = np.array([one.role == name for one in self.sets], dtype=np.bool_)
        return self.only(wanted[self.set_number])

    def press_numbers(self) -> IntArray:
        """(sample,) one number a press over all sets, rising from 0 without gaps: what splits keep whole."""
        presses = np.stack([self.set_number, self.place_number], axis=1)
        return np.asarray(np.unique(presses, axis=0, return_inverse=True)[1], dtype=np.int64).reshape(-1)

    def clipped_share(self) -> FloatArray:
        """(state, receiver) share of the readings at full scale [-]; zeros where that is not known."""
        if self.full_scale_counts is None or len(self) == 0:
            return np.zeros(self.counts.shape[1:])
        return np.asarray((self.counts >= self.full_scale_counts).mean(axis=0), dtype=np.float64)


def joined(parts: Sequence[PressData]) -> PressData:
    """Sets of several files as one; set numbers are counted on.

    Raises
    ------
    InputError : no part, or parts of other designs, states, receivers or converters.
    """
    if not parts:
        raise InputError("data: none given; name at least one file")
    first = parts[0]
    for number, part in enumerate(parts[1:], start=2):
        for name in ("state_names", "receiver_names", "full_scale_counts", "design_digest"):
            if getattr(part, name) != getattr(first, name):
                raise InputError(
                    f"data: {name} of file {number} is {getattr(part, name)}, of the first {getattr(first, name)}; "
                    "join recordings of one sensor only"
                )
    starts = np.cumsum([0, *(len(part.sets) for part in parts)])
    truths = [part.true_press_mm for part in parts]
    return replace(
        first,
        counts=np.concatenate([part.counts for part in parts]),
        press_mm=np.concatenate([part.press_mm for part in parts]),
        time_s=np.concatenate([part.time_s for part in parts]),
        set_number=np.concatenate(
            [part.set_number + start for part, start in zip(parts, starts, strict=False)]
        ),
        place_number=np.concatenate([part.place_number for part in parts]),
        sets=tuple(one for part in parts for one in part.sets),
        true_press_mm=np.concatenate([one for one in truths if one is not None])
        if all(one is not None for one in truths)
        else None,
    )


def data_notes(data: PressData) -> tuple[str, ...]:
    """What a result must say of the data that it rests on, as sentences: simulated, converted, clipped."""
    simulated = "the data are simulated, not recorded" if data.true_press_mm is not None else None
    notes = (simulated, data.attributes.get(CONVERTED), clipped_note(data))
    return tuple(str(note) for note in notes if note is not None)


def clipped_note(data: PressData) -> str | None:
    """Which channels clip, in a sentence; None where none does.

    The off state's readings are named as ``off-R1``; a pair that clips tells less, or nothing, of a press.
    """
    share = data.clipped_share()
    at = np.argwhere(share > 0)
    if not len(at):
        return None
    worst = sorted(at.tolist(), key=lambda place: -share[tuple(place)])
    named = ", ".join(
        f"{data.state_names[s]}-{data.receiver_names[r]} ({_percent(share[s, r])})" for s, r in worst[:6]
    )
    more = f" and {len(worst) - 6} more" if len(worst) > 6 else ""
    return f"{len(worst)} of {share.size} channels clip at {data.full_scale_counts:g} counts: {named}{more}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.01 else "< 1 %"


def _require_shapes(data: PressData) -> None:
    samples, states, receivers = len(data.counts), len(data.state_names), len(data.receiver_names)
    wanted = {
        "counts": (samples, states, receivers),
        "press_mm": (samples, 3),
        "time_s": (samples,),
        "set_number": (samples,),
        "place_number": (samples,),
        "true_press_mm": (samples, 3),
    }
    for one in fields(data):
        values = getattr(data, one.name)
        if one.name in wanted and values is not None and values.shape != wanted[one.name]:
            raise InputError(f"data: {one.name} has shape {values.shape}, needs {wanted[one.name]}")
    if states < 2 or data.state_names[-1] != OFF:
        raise InputError(
            f"data: the states are {', '.join(data.state_names)}; needs emitters and last {OFF!r}, the reading with "
            "every emitter dark, which is taken from the others"
        )
    if samples and not (data.set_number.min() >= 0 and data.set_number.max() < len(data.sets)):
        raise InputError(
            f"data: set_number runs from {data.set_number.min()} to {data.set_number.max()}, "
            f"there are {len(data.sets)} sets"
        )
