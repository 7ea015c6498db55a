"""The untouched pad's mean readings beside what the simulation expects of them, and how a problem is told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import BoolArray, FloatArray
from design.recordings import signals_of
from fabrication.driver.descriptor import Descriptor, PartArray

FLOOR_COUNTS = 8.0
"""Below this readings are alike: ambient light, noise, and light that the model does not follow."""

SEEN_COUNTS = 24.0
"""A pair expected below this cannot tell whether its parts live; at a fifth of it they still would."""

CLIP_SHARE = 0.95
"""Readings and expectations above this share of full scale may be clipped."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Something that is wrong, with the parts and pins to look at.

    Attributes
    ----------
    kind : dead, swapped, saturated, dim, ambient, noisy, supply, program
    parts : names of the parts
    message : what is seen and what to do
    is_error : False for what may be as it is
    """

    kind: str
    parts: tuple[str, ...]
    message: str
    is_error: bool = True


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Mean readings and what they should be, all (emitter, receiver), with the names of the parts."""

    measured: FloatArray
    expected: FloatArray
    is_clipped: BoolArray
    is_meant_to_clip: BoolArray
    full_scale: int
    emitters: PartArray
    receivers: PartArray


def pattern_of(counts: NDArray[np.uint16], found: Descriptor) -> Pattern:
    """Mean readings of (n, state, receiver) counts beside the descriptor's expected ones, which it must have."""
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
