"""The untouched pad's mean readings and their simulated values, and the form of a reported problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import BoolArray, FloatArray
from design.recordings import signals_of
from fabrication.driver.descriptor import Descriptor, PartArray

FLOOR_COUNTS = 8.0
"""Readings below this are equivalent: ambient light, noise, and light outside the model."""

SEEN_COUNTS = 24.0
"""A pair expected below this cannot show whether its parts work; a part at a fifth of its light still works."""

CLIP_SHARE = 0.95
"""Readings and expectations above this share of full scale may be clipped."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A fault, with the parts and pins to inspect.

    Attributes
    ----------
    kind : dead, swapped, saturated, dim, ambient, noisy, supply, program
    parts : names of the parts
    message : the observation and the way out
    is_error : False for a warning
    """

    kind: str
    parts: tuple[str, ...]
    message: str
    is_error: bool = True


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Mean readings and expected ones, all (emitter, receiver), with the names of the parts."""

    measured: FloatArray
    expected: FloatArray
    is_clipped: BoolArray
    is_meant_to_clip: BoolArray
    full_scale: int
    emitters: PartArray
    receivers: PartArray


def pattern_of(counts: NDArray[np.uint16], found: Descriptor) -> Pattern:
    """Mean readings of (n, state, receiver) counts, and the descriptor's expected ones, which must be present."""
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
    """An emitter's name and pin."""
    return f"{parts.names[i]} (pin {parts.pins[i]})"


def receiver_text(parts: PartArray, j: int) -> str:
    """A receiver's name and input."""
    return f"{parts.names[j]} (input {parts.pins[j]})"
