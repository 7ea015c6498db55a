"""Content that all recordings of presses share: the sets of presses, the dark state, and signals from readings.

The driver and the test stage record a manufactured unit. The simulation makes data in the same form. Learning programs
read both. The module needs numpy and the standard library only.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError

OFF = "off"
"""Name of the dark state, in which no emitter is lit."""
ROLES = ("train", "test")
PATTERNS = ("grid", "random", "unknown", "measured")
"""Permitted patterns of locations; older files have `measured` in place of `unknown`."""

Number = TypeVar("Number", bound=np.number[Any])


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


def lit_emitters(emitter_count: int, dark: str = "frame") -> tuple[int | None, ...]:
    """Index of the lit emitter in each state of a frame, None in a dark state.

    Parameters
    ----------
    dark : ``frame``: one dark state at the end; ``each``: one after each emitter's state
    """
    after = () if dark == "frame" else (None,)
    last = (None,) if dark == "frame" else ()
    return (*(state for number in range(emitter_count) for state in (number, *after)), *last)


def with_one_dark(counts: NDArray[Number], full_scale: float) -> NDArray[Number]:
    """Readings with one dark state, from readings with a dark state after each emitter's.

    Every emitter's row is reduced by the dark row after it, and raised by the largest dark reading of the frame. So
    `signals_of` gives the difference to the emitter's own dark state, and no reading is below 0. A row is at full scale
    where one of its readings was, or where the sum exceeds it.

    Parameters
    ----------
    counts : (..., 2 x emitter, receiver) readings in a signed number type: E1, dark, E2, dark, ... [counts]
    full_scale : largest reading [counts]

    Returns
    -------
    (..., emitter + 1, receiver) readings in the same number type; the last row has the largest dark readings [counts]
    """
    lit, dark = counts[..., 0::2, :], counts[..., 1::2, :]
    common = dark.max(axis=-2, keepdims=True)
    moved = np.where(lit >= full_scale, full_scale, np.minimum(lit - dark + common, full_scale))
    return np.concatenate([moved.astype(counts.dtype), common], axis=-2)


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
