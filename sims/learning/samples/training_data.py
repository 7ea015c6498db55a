"""Training data as learners take them: checked, clipped pairs set aside, samples numbered by location.

A *location* is all places within 0.15 mm of each other, over all sets: the paper presses the same grid four times, and
a press held out while its location stays in the training half would be no test of places never pressed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.arrays import BoolArray, FloatArray, IntArray
from design.errors import InputError
from sims.press.same_places import place_numbers
from sims.readings.dataset import PressData

CLEARLY_UNTOUCHED_MM = -0.25
"""Frames above this depth touch nothing, whatever the reference depth's error."""
FEWEST_LOCATIONS = 9
"""Three a side: fewer cannot tell a slope of the signal from a curve."""
FEWEST_TOUCHED = 200
FEWEST_UNTOUCHED = 50
"""With fewer, the held-out half decides by chance."""
MOST_CLIPPED = 0.01
"""A pair that reads full scale in more of the untouched frames than this is left out: it says nothing of light touches,
and its difference to the off state says how bright the room is."""
FEWEST_PAIRS = 3
"""x, y and depth cannot come from fewer readings."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingData:
    """Samples to learn from.

    Attributes
    ----------
    source : what they were made of
    signals : (sample, pair) readings less the off state [counts]
    press_mm : (sample, 3) x, y, depth [mm]
    location : (sample,) number of the location, from 0
    press : (sample,) number of the press (set and place), from 0
    kept : (feature,) pairs that learners look at
    left_out : what was left out, as sentences
    """

    source: PressData
    signals: NDArray[np.float32]
    press_mm: FloatArray
    location: IntArray
    press: IntArray
    kept: NDArray[np.intp]
    left_out: tuple[str, ...]

    @property
    def is_touched(self) -> BoolArray:
        """(sample,) depth 0 or more, as the paper counts."""
        return np.asarray(self.press_mm[:, 2] >= 0.0)

    @property
    def untouched_counts(self) -> FloatArray:
        """(pair,) mean signals of the untouched frames [counts]."""
        return np.asarray(self.signals[~self.is_touched].mean(axis=0, dtype=np.float64))

    def facts(self) -> dict[str, Any]:
        """What the model's header says of them; locations and presses are those in contact, deeper than 0."""
        pressed = self.press_mm[:, 2] > 0.0
        return {
            "is_simulated": self.source.true_press_mm is not None,
            "sets": [self.source.sets[k].name for k in np.unique(self.source.set_number)],
            "samples": len(self.press_mm),
            "touched_samples": int(self.is_touched.sum()),
            "locations": len(np.unique(self.location[pressed])),
            "presses": len(np.unique(self.press[pressed])),
            "left_out": list(self.left_out),
            "data": _plain(self.source.attributes),
        }


def prepared(train: PressData) -> TrainingData:
    """Check data and set aside what tells nothing.

    Raises
    ------
    InputError : too few samples, locations or usable pairs; values that are no numbers.
    """
    signals = np.asarray(train.features(), dtype=np.float32)
    if not np.isfinite(signals).all() or not np.isfinite(train.press_mm).all():
        raise InputError("training data: some readings or presses are no finite numbers; drop these samples")
    location = place_numbers(train.press_mm[:, :2])
    _require_enough(train.press_mm[:, 2] >= 0.0, location)
    kept, left_out = _usable_pairs(train, signals)
    return TrainingData(
        source=train,
        signals=signals,
        press_mm=train.press_mm,
        location=location,
        press=train.press_numbers(),
        kept=kept,
        left_out=left_out,
    )


def _require_enough(is_touched: BoolArray, location: IntArray) -> None:
    touched, untouched = int(is_touched.sum()), int((~is_touched).sum())
    for name, found, fewest in (
        ("touched samples", touched, FEWEST_TOUCHED),
        ("untouched samples", untouched, FEWEST_UNTOUCHED),
        ("locations", len(np.unique(location[is_touched])), FEWEST_LOCATIONS),
    ):
        if found < fewest:
            raise InputError(
                f"training data: has {found} {name}, needs >= {fewest}; record more presses, "
                "above the surface and into it, at places all over the workspace"
            )


def _usable_pairs(train: PressData, signals: NDArray[np.float32]) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Pairs that neither clip while untouched nor stand still, and sentences about the others."""
    untouched = train.press_mm[:, 2] < 0.0
    share = train.only(untouched).clipped_share()
    clipped = ((share[:-1] > MOST_CLIPPED) | (share[-1:] > MOST_CLIPPED)).reshape(-1)
    still = signals.max(axis=0) == signals.min(axis=0)
    left_out = []
    for mask, why in ((clipped, "at full scale while untouched"), (still & ~clipped, "without any change")):
        if mask.any():
            names = [name for name, is_out in zip(train.pair_names, mask, strict=True) if is_out]
            left_out.append(f"{len(names)} of {len(mask)} pairs {why}: {', '.join(names)}")
    kept = np.flatnonzero(~(clipped | still))
    if len(kept) < FEWEST_PAIRS:
        raise InputError(
            f"training data: only {len(kept)} pairs tell anything ({'; '.join(left_out)}); "
            "lower the gain, or check the wiring with `optopad driver check`"
        )
    return kept, tuple(left_out)


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """What of the data's attributes a JSON header can hold."""
    return {
        name: value
        for name, value in attributes.items()
        if value is None or isinstance(value, str | int | float | bool)
    }
