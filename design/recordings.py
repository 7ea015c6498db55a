"""Content that all recordings of presses share: the sets of presses, the dark state, and signals from readings.

The driver and the test stage record a manufactured unit, and the simulation makes data in the same form. Learning
programs read both. A frame consists of states: in each, one emitter is lit, or none in a dark state. The module needs
numpy and the standard library only.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError

OFF = "off"
"""Name of a dark state, in which no emitter is lit."""
LOSSES = "losses"
"""Name of the attribute of a netCDF file that says what is missing of the recording, in words."""
ROLES = ("train", "test")
PATTERNS = ("grid", "random", "unknown", "measured")
"""Permitted patterns of locations; older files have `measured` in place of `unknown`."""

Number = TypeVar("Number", bound="np.number[Any]")


@dataclass(frozen=True, kw_only=True)
class SetEntry:
    """Description of one set of presses in a recording.

    Attributes
    ----------
    name : name of the set, such as ``grid-ambient-1``
    role : use in machine learning, ``train`` or ``test``
    pattern : pattern of the press locations: ``grid``, ``random`` or ``unknown`` (``measured`` in older files)
    is_ambient : whether the set was recorded in ambient light

    Raises
    ------
    InputError : the role or the pattern is not permitted, or `is_ambient` is neither true nor false.
    """

    name: str
    role: str
    pattern: str
    is_ambient: bool

    def __post_init__(self) -> None:
        for field, value, allowed in (("role", self.role, ROLES), ("pattern", self.pattern, PATTERNS)):
            if value not in allowed:
                raise InputError(
                    f"set {self.name!r}: {field} is {value!r}, needs one of {', '.join(allowed)}"
                )
        if not isinstance(self.is_ambient, bool):
            raise InputError(f"set {self.name!r}: is_ambient is {self.is_ambient!r}, needs true or false")


UNNAMED = SetEntry(name="unnamed", role="train", pattern="unknown", is_ambient=True)
"""Entry for all presses of a recording that names no sets."""


def sets_json(sets: Iterable[SetEntry]) -> str:
    """The sets as JSON text for the attribute `sets` of a netCDF file."""
    return json.dumps([asdict(entry) for entry in sets])


@cache
def lit_emitters(emitter_count: int, dark: str = "frame") -> tuple[int | None, ...]:
    """Index of the lit emitter in each state of a frame, None in a dark state.

    Parameters
    ----------
    dark : ``frame`` for one dark state at the end; ``each`` for a dark state before and after every emitter's state
    """
    between = () if dark == "frame" else (None,)
    return (*(state for number in range(emitter_count) for state in (*between, number)), None)


@cache
def nearest_dark_states(states: tuple[int | None, ...]) -> IntArray:
    """The dark states nearest to each emitter's state: two if they are equally near, else the nearest one twice.

    Parameters
    ----------
    states : emitter that is lit in each state of a frame, None in a dark state; at least one state is dark

    Returns
    -------
    (emitter, 2) indices of dark states, the earlier one first; read-only
    """
    dark = np.array([state for state, emitter in enumerate(states) if emitter is None])
    found = []
    for state, emitter in enumerate(states):
        if emitter is not None:
            apart = np.abs(dark - state)
            found.append(dark[apart == apart.min()][[0, -1]])
    rows = np.array(found, dtype=np.int64).reshape(-1, 2)
    rows.flags.writeable = False
    return rows


def with_one_dark(
    counts: NDArray[Number], states: tuple[int | None, ...], full_scale: float
) -> NDArray[np.float64]:
    """Convert frames with any number of dark states to frames with one, at the end; results are not rounded.

    Each emitter's reading is reduced by the mean of its nearest dark readings, and raised by the largest dark reading
    of its receiver. `signals_of` then gives the difference from the nearest dark readings, and no reading is below 0. A
    reading at full scale stays there, and a sum above full scale becomes full scale. If the only dark state is already
    the last one, the readings do not change.

    Parameters
    ----------
    counts : (..., state, receiver) readings [counts]
    states : emitter that is lit in each state, None in a dark state
    full_scale : largest reading [counts]

    Returns
    -------
    (..., emitter + 1, receiver) readings; the last state has each receiver's largest dark reading [counts]
    """
    read = counts.astype(np.float64)
    lit = read[..., [emitter is not None for emitter in states], :]
    common = read[..., [emitter is None for emitter in states], :].max(axis=-2, keepdims=True)
    dark = read[..., nearest_dark_states(states), :].mean(axis=-2)
    moved = np.where(lit >= full_scale, full_scale, np.minimum(lit - dark + common, full_scale))
    return np.concatenate([moved, common], axis=-2)


def kept_share(since_s: FloatArray, *, residue: float, decay_s: float) -> FloatArray:
    """Share of a press's signal change that the pad keeps at times since its release [-].

    It is `residue` at the release, half of that after `decay_s`, and then falls with 1 / time
    (`optopad.sims.readings.signal_chain` has its source and limits).

    Parameters
    ----------
    since_s : (...) times since the release, 0 or more [s]
    residue, decay_s : `noise.release_residue` [-] and `noise.release_decay_s` [s] of the design
    """
    return np.asarray(residue / (1.0 + since_s / decay_s))


def signals_of(counts: NDArray[Number]) -> NDArray[Number]:
    """Signals: the readings with each emitter lit, minus the readings in the dark state, which is the last state.

    Parameters
    ----------
    counts : (..., state, receiver) readings in a signed number type [counts]

    Returns
    -------
    (..., emitter, receiver) signals in the same number type [counts].
    """
    return np.asarray(counts[..., :-1, :] - counts[..., -1:, :])
