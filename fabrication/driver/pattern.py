"""Measured and simulated readings of the untouched pad, and the record of a reported fault."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.recordings import signals_of
from optopad.fabrication.driver.descriptor import Descriptor, PartArray

FLOOR_COUNTS = 8.0
"""Readings below this value are not compared, because ambient light, noise and light outside the model dominate them
[counts]."""

SEEN_COUNTS = 24.0
"""Expected reading below which a pair is too dark to be used in judging its parts [counts]."""

CLIP_SHARE = 0.95
"""A measured or expected reading counts as clipped if it is at least this fraction of full scale [-]."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A fault of the unit, with the parts and pins to inspect.

    Attributes
    ----------
    kind : type of fault: dead, swapped, saturated, dim, ambient, noisy, supply or program
    parts : names of the affected parts
    message : the observation, and what to do
    is_error : True for an error, False for a warning
    """

    kind: str
    parts: tuple[str, ...]
    message: str
    is_error: bool = True


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Measured and expected mean readings of all pairs, as arrays of shape (emitters, receivers) [counts]."""

    measured: FloatArray
    expected: FloatArray
    is_clipped: BoolArray
    is_meant_to_clip: BoolArray
    full_scale: int
    emitters: PartArray
    receivers: PartArray


def pattern_of(counts: NDArray[np.uint16], found: Descriptor) -> Pattern:
    """Means of readings of shape (n, states, receivers), and the descriptor's expected readings, which must exist."""
    assert found.expected_counts is not None, "requested by the caller"
    mean: FloatArray = counts.mean(axis=0)
    lit = mean[:-1]
    return Pattern(
        measured=signals_of(mean),
        expected=found.expected_counts,
        is_clipped=lit >= CLIP_SHARE * found.full_scale,
        is_meant_to_clip=found.expected_counts >= CLIP_SHARE * found.full_scale,
        full_scale=found.full_scale,
        emitters=found.emitters,
        receivers=found.receivers,
    )


def emitter_text(parts: PartArray, i: int) -> str:
    """Name and pin of emitter i (from 0), for messages."""
    return f"{parts.names[i]} (pin {parts.pins[i]})"


def receiver_text(parts: PartArray, j: int) -> str:
    """Name and input of receiver j (from 0), for messages."""
    return f"{parts.names[j]} (input {parts.pins[j]})"
