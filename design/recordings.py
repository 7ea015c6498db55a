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
