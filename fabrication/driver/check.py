"""Check of a unit's wiring: compares measured with simulated readings of the untouched pad.

The check distinguishes exchanged wires from bright LEDs and manufacturing tolerances. It reports these faults:

- *dead*: an emitter that no receiver sees, or a receiver that sees no emitter.
- *saturated*: a receiver at full scale in the dark, or at full scale for most emitters although the simulation expects
  much less.
- *swapped*: two emitters or two receivers whose exchange explains the readings much better than the correct wiring.
- *dim*: an emitter or receiver whose readings, relative to the expected ones, are far below those of the others.

The check cannot detect an exchange that leaves the expected readings unchanged because the layout is symmetric. If two
exchanges explain the readings equally well, as on a pad with mirror symmetry, both are reported. Pairs that are
expected to be at full scale are not compared.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray
from optopad.design.errors import InputError
from optopad.fabrication.driver.descriptor import Descriptor
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.link.protocol import SelfTest
from optopad.fabrication.driver.wiring_check import (
    CLIP_SHARE,
    FLOOR_COUNTS,
    SEEN_COUNTS,
    Pattern,
    Problem,
    emitter_text,
    exchanged_wires,
    pattern_of,
    receiver_text,
)

DEAD_SHARE = 0.1
"""A part counts as dead if all its readings are below this fraction of the darkest part's largest expected reading
[-]."""

DIM_SHARE = 0.4
"""An emitter or receiver is reported as dim if its ratio of measured to expected readings is below this fraction of
the other parts' ratio [-]. Tolerances of resistors, brightness classes and seating explain about +-30 %."""

UNEXPECTED_SHARE = 0.5
"""A pair at full scale is reported if its expected reading is below this fraction of full scale [-]."""

AMBIENT_SHARE = 0.1
"""Ambient light, which reduces the range, is reported if dark readings exceed this fraction of full scale [-]."""

NOISE_COUNTS, NOISE_SHARE = 3.0, 0.02
"""A receiver is reported as noisy if the standard deviation of a reading is above NOISE_COUNTS [counts] plus
NOISE_SHARE [-] times the reading's mean."""

REFERENCE_V, SUPPLY_LOW_V, SUPPLY_HIGH_V = 1.1, 4.5, 5.5
"""Voltage of the AVR's internal reference (+-10 % by its data sheet), and limits of a USB port's voltage [V]."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Result of a wiring check.

    Attributes
    ----------
    problems : reported faults, errors first
    gain : ratio of measured to expected reading, median over the pairs [-]; None if no pair could be compared
    mismatch : relative deviation from `gain` times the expected readings, median over the pairs [-]; None if no pair
        could be compared
    compared : number of pairs that could be compared
    clipped_by_design : names of the pairs that are expected to be at full scale, such as E1-R1
    frames : number of frames in the check
    """

    problems: tuple[Problem, ...]
    gain: float | None
    mismatch: float | None
    compared: int
    clipped_by_design: tuple[str, ...]
    frames: int

    @property
    def is_good(self) -> bool:
        """Whether the check found no error; warnings do not count."""
        return not any(problem.is_error for problem in self.problems)

    def to_json(self) -> dict[str, Any]:
        """The result of the check as a dictionary for JSON."""
        return {"is_good": self.is_good, **asdict(self)}


def check_frames(frames: Iterable[Frame], found: Descriptor, self_test: SelfTest | None = None) -> Verdict:
    """Check a unit's wiring by comparing readings of the untouched pad with simulated ones.

    Parameters
    ----------
    frames : frames of the untouched pad; one second is enough
    found : descriptor of the sensor
    self_test : result of the board's self-test; if None, the supply and the program are not checked

    Raises
    ------
    InputError : the descriptor has no expected readings, or `frames` is empty.
    """
    taken = list(frames)
    if found.expected_counts is None:
        raise InputError(
            f"driver.toml of {found.design} has no expected pattern; run `optopad score`, then `optopad driver config`"
        )
    if not taken:
        raise InputError("no frame to check; is the board started?")
    counts = np.stack([frame.counts for frame in taken])
    pattern = pattern_of(counts, found)
    railed = _railed(counts[:, -1], found)
    problems = [*_railed_problems(railed, found), *_pattern_problems(pattern, railed)]
    problems += [
        *_ambient(counts[:, -1], railed, found),
        *_noisy(counts, railed, found),
        *_supply(self_test, found),
        *_program(self_test, found),
    ]
    gain, mismatch, compared = _agreement(pattern, railed)
    return Verdict(
        problems=tuple(sorted(problems, key=lambda problem: not problem.is_error)),
        gain=gain,
        mismatch=mismatch,
        compared=compared,
        clipped_by_design=tuple(_pair_names(pattern.is_meant_to_clip, pattern)),
        frames=len(taken),
    )


def _railed(dark: NDArray[np.uint16], found: Descriptor) -> BoolArray:
    is_railed: BoolArray = dark.mean(axis=0) >= CLIP_SHARE * found.full_scale
    return is_railed


def _railed_problems(railed: BoolArray, found: Descriptor) -> list[Problem]:
    return [
        Problem(
            kind="saturated",
            parts=(found.receivers.names[j],),
            message=f"{receiver_text(found.receivers, j)}: at full scale even in the dark: its amplifier is "
            "saturated; look for an open feedback resistor, a shorted or reversed diode, or bright light",
        )
        for j in map(int, np.flatnonzero(railed))
    ]


def _pattern_problems(pattern: Pattern, railed: BoolArray) -> list[Problem]:
    """Faults, in this order: dead parts, exchanged wires, dim parts, pairs unexpectedly at full scale."""
    dead_e, dead_r = _dead(pattern, railed)
    usable = ~(dead_e[:, None] | (dead_r | railed)[None, :])
    problems = _dead_problems(pattern, dead_e, dead_r)
    rows, columns, swaps = exchanged_wires(pattern, usable)
    problems += swaps
    mended = replace(pattern, expected=pattern.expected[rows][:, columns])
    mended = replace(mended, is_meant_to_clip=pattern.is_meant_to_clip[rows][:, columns])
    return [*problems, *_dim(mended, usable), *_clipped(mended, usable)]


def _dead(pattern: Pattern, railed: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Whether each emitter gives no light, and whether each receiver sees none; shapes (emitters,) and (receivers,).

    Exchanged wires do not conceal a dead part, because they only permute the readings. `railed` says for each receiver
    whether it is at full scale in the dark; its shape is (receivers,).
    """
    strong = _strong_reading(pattern)
    shows = pattern.measured > strong
    is_lit = shows[:, ~railed].any(axis=1) if not railed.all() else np.ones(len(shows), dtype=bool)
    return np.logical_not(is_lit), np.logical_not(shows.any(axis=0) | railed)


def _strong_reading(pattern: Pattern) -> float:
    """Threshold that the largest reading of every working emitter or receiver exceeds [counts]."""
    best = np.concatenate([pattern.expected.max(axis=0), pattern.expected.max(axis=1)])
    return max(float(DEAD_SHARE * best.min()), FLOOR_COUNTS)


def _dead_problems(pattern: Pattern, dead_e: BoolArray, dead_r: BoolArray) -> list[Problem]:
    if dead_e.all() or dead_r.all():
        return [
            Problem(
                kind="dead",
                parts=(*pattern.emitters.names, *pattern.receivers.names),
                message="no receiver reads light of any emitter: the supply of the emitters or of the "
                "amplifiers is missing, or the connector is not plugged in",
            )
        ]
    silent = (
        (pattern.emitters, dead_e, emitter_text, "no receiver reads its light: a dead or reversed LED, "
                                                 "or an open wire, resistor, transistor or driver"),
        (pattern.receivers, dead_r, receiver_text, "reads light of no emitter: a dead or reversed "
                                                   "photodiode, or an open wire or amplifier"),
    )  # fmt: skip
    return [
        Problem(kind="dead", parts=(parts.names[k],), message=f"{called(parts, k)}: {why}")
        for parts, dead, called, why in silent
        for k in map(int, np.flatnonzero(dead))
    ]


def _dim(pattern: Pattern, usable: BoolArray) -> list[Problem]:
    told = usable & ~pattern.is_clipped & ~pattern.is_meant_to_clip & (pattern.expected >= SEEN_COUNTS)
    ratio = np.where(told, np.maximum(pattern.measured, 0.0) / np.maximum(pattern.expected, 1.0), np.nan)
    problems = []
    for axis, parts, called in ((1, pattern.emitters, emitter_text), (0, pattern.receivers, receiver_text)):
        for k, name in enumerate(parts.names):
            own = ratio[k] if axis == 1 else ratio[:, k]
            others = np.delete(ratio, k, axis=1 - axis)
            if np.isfinite(own).sum() < 2 or not np.isfinite(others).any():
                continue
            share = float(np.nanmedian(own) / np.nanmedian(others))
            if share < DIM_SHARE:
                message = (
                    f"{called(parts, k)}: {share:.0%} of its expected reading relative to the others; "
                    "check its resistor, its seat and the silicone in front of it"
                )
                problems.append(Problem(kind="dim", parts=(name,), message=message, is_error=False))
    return problems


def _clipped(pattern: Pattern, usable: BoolArray) -> list[Problem]:
    """One problem for each receiver with pairs that are at full scale although they should be well below it.

    The problem is an error if it concerns more than half of the receiver's usable pairs.
    """
    may_be_read = usable & ~pattern.is_meant_to_clip & (pattern.expected >= SEEN_COUNTS)
    odd = usable & pattern.is_clipped & (pattern.expected < UNEXPECTED_SHARE * pattern.full_scale)
    problems = []
    for j in map(int, np.flatnonzero(odd.any(axis=0))):
        pairs = [
            f"{pattern.emitters.names[i]}-{pattern.receivers.names[j]}" for i in np.flatnonzero(odd[:, j])
        ]
        message = (
            f"{receiver_text(pattern.receivers, j)}: at full scale under {', '.join(pairs)}, expected at most "
            f"{pattern.expected[odd[:, j], j].max():.0f} counts; its gain is too high, or stray light comes in"
        )
        is_error = 2 * int(odd[:, j].sum()) > int(may_be_read[:, j].sum())
        parts = (pattern.receivers.names[j],)
        problems.append(Problem(kind="saturated", parts=parts, message=message, is_error=is_error))
    return problems


def _ambient(dark: NDArray[np.uint16], railed: BoolArray, found: Descriptor) -> list[Problem]:
    level = dark.mean(axis=0)
    bright = np.flatnonzero((level > AMBIENT_SHARE * found.full_scale) & ~railed)
    if not bright.size:
        return []
    names = tuple(found.receivers.names[j] for j in bright)
    level_text = f"{level[bright].max():.0f} counts in the dark"
    message = f"{', '.join(names)}: {level_text}; cover the pad, or repair its black layer"
    return [Problem(kind="ambient", parts=names, message=message, is_error=False)]


def _noisy(counts: NDArray[np.uint16], railed: BoolArray, found: Descriptor) -> list[Problem]:
    scatter, mean = counts.std(axis=0), counts.mean(axis=0)
    noisy = (scatter > NOISE_COUNTS + NOISE_SHARE * mean).any(axis=0) & ~railed
    if not noisy.any():
        return []
    names = tuple(found.receivers.names[j] for j in np.flatnonzero(noisy))
    message = (
        f"{', '.join(names)}: readings scatter by up to {scatter[:, noisy].max():.0f} counts; was the pad "
        "touched? If not, check contacts and shielding, and remove mains-powered lamps"
    )
    return [Problem(kind="noisy", parts=names, message=message, is_error=False)]


def _supply(self_test: SelfTest | None, found: Descriptor) -> list[Problem]:
    if self_test is None or self_test.reference_counts == 0:
        return []
    supply_v = REFERENCE_V * (found.full_scale + 1) / self_test.reference_counts
    if SUPPLY_LOW_V <= supply_v <= SUPPLY_HIGH_V:
        return []
    message = (
        f"the board's supply reads {supply_v:.2f} V (its reference is good to 10 %), should be {SUPPLY_LOW_V} to "
        f"{SUPPLY_HIGH_V} V; use a shorter cable or a powered port"
    )
    return [Problem(kind="supply", parts=(), message=message, is_error=False)]


def _program(self_test: SelfTest | None, found: Descriptor) -> list[Problem]:
    """A problem if the firmware's checksum of pins, inputs and times differs from the design's; otherwise empty."""
    if self_test is None or found.config_crc is None or self_test.config_crc == found.config_crc:
        return []
    message = (
        "the board's program has other pins or times than driver.toml, or its memory is damaged "
        f"(checksum {self_test.config_crc:08x}, should be {found.config_crc:08x}); upload it again with "
        "`optopad driver flash DESIGN`"
    )
    return [Problem(kind="program", parts=(), message=message)]


def _agreement(pattern: Pattern, railed: BoolArray) -> tuple[float | None, float | None, int]:
    told = ~pattern.is_clipped & ~pattern.is_meant_to_clip & (pattern.expected >= SEEN_COUNTS) & ~railed
    if not told.any():
        return None, None, 0
    ratio = np.maximum(pattern.measured[told], 1.0) / pattern.expected[told]
    gain = float(np.median(ratio))
    return gain, float(np.exp(np.median(np.abs(np.log(ratio / gain)))) - 1.0), int(told.sum())


def _pair_names(mask: BoolArray, pattern: Pattern) -> list[str]:
    return [f"{pattern.emitters.names[i]}-{pattern.receivers.names[j]}" for i, j in np.argwhere(mask)]
