"""The common content of recordings of presses, whichever program wrote them: sets, the dark state, signals.

The driver and the stage record a manufactured unit, the simulation makes data of the same form, and learners read both.
The module needs numpy and the standard library only.
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
"""Older files have the last one in place of `unknown`."""

Number = TypeVar("Number", bound=np.number[Any])


@dataclass(frozen=True, kw_only=True)
class SetEntry:
    """One session of presses.

    Attributes
    ----------
    name : as ``grid-ambient-1``
    role : its use by a learner, ``train`` or ``test``
    pattern : ``grid``, ``random`` or ``unknown``
    is_ambient : whether it was recorded in ambient light

    Raises
    ------
    InputError : another role or pattern, or `is_ambient` is neither true nor false.
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
"""The only set of a recording that names no sets."""


def sets_json(sets: Iterable[SetEntry]) -> str:
    """The sets as the attribute `sets` of a netCDF file."""
    return json.dumps([asdict(entry) for entry in sets])


def signals_of(counts: NDArray[Number]) -> NDArray[Number]:
    """Readings of every emitter less those of the dark state, which is the last state.

    Parameters
    ----------
    counts : (..., state, receiver) readings, of a signed type [counts]

    Returns
    -------
    (..., emitter, receiver) of the same type [counts].
    """
    return np.asarray(counts[..., :-1, :] - counts[..., -1:, :])
