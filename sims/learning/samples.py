"""Training data for learners: checks, selection and splitting of samples, scaling, error measures, model header.

Data are checked, pairs that clip are left out, and samples are numbered by location. A *location* comprises all
positions within 0.15 mm of each other, over all sets. Samples are split for tuning by location, never by sample. The
paper presses the same grid four times, so a held-out press whose location is also in the training half would not test
new locations.
"""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.header import ModelHeader
from optopad.sims.learning.inference.touch_model import FeatureScaling
from optopad.sims.press import place_numbers
from optopad.sims.readings.dataset import PressData

FROM_DEPTH_MM = 1.0
"""Least depth of the samples on which errors are measured [mm]: lighter touches hardly have a signal, and would hide a
learner's error.
"""


def location_error_mm(estimated_mm: FloatArray, press_mm: FloatArray) -> FloatArray:
    """Distances (n,) in x and y between estimated and true presses (n, 3) [mm]."""
    return np.asarray(np.hypot(*(estimated_mm[:, :2] - press_mm[:, :2]).T))


def held_out_figures(estimated_mm: FloatArray, press_mm: FloatArray) -> dict[str, float]:
    """Median errors of location and of depth [mm], for a model's header; only for depths from `FROM_DEPTH_MM` on."""
    deep = press_mm[:, 2] >= FROM_DEPTH_MM
    if not deep.any():
        return {}
    estimated_mm, press_mm = estimated_mm[deep], press_mm[deep]
    return {
        "held_out_location_mm": float(np.median(location_error_mm(estimated_mm, press_mm))),
        "held_out_depth_mm": float(np.median(np.abs(estimated_mm[:, 2] - press_mm[:, 2]))),
    }


def mean_error_mm(estimated_mm: FloatArray, press_mm: FloatArray) -> float:
    """Mean distance in x and y plus mean absolute error of depth [mm], a single number that a search can minimise."""
    depth = np.abs(estimated_mm[:, 2] - press_mm[:, 2])
    return float(location_error_mm(estimated_mm, press_mm).mean() + depth.mean())


LEAST_SCALE_COUNTS = 1.0
"""Least scale of a pair [counts]: about the noise of a reading minus the off state (0.5 counts each, and rounding). It
prevents a pair whose signal varies less from being amplified.
"""


def counts_scaling(kept: NDArray[np.intp]) -> FeatureScaling:
    """Scaling that selects the pairs `kept` (feature,), and leaves their counts unchanged."""
    return FeatureScaling(kept=kept, centre=np.zeros(len(kept)), scale=np.ones(len(kept)))


def standard_scaling(kept: NDArray[np.intp], signals: NDArray[np.float32]) -> FeatureScaling:
    """Scaling by each pair's mean and standard deviation over samples (n, pair); the scale is at least 1 count.

    Parameters
    ----------
    kept : (feature,) indices of the pairs that are used
    """
    used = signals[:, kept].astype(np.float64)
    return FeatureScaling(
        kept=kept, centre=used.mean(axis=0), scale=np.maximum(used.std(axis=0), LEAST_SCALE_COUNTS)
    )


HELD_OUT_SHARE = 0.2
"""Share of the locations that are held out to measure the factors of a model's deviations [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PressSamples:
    """Samples in contact with the pad.

    Attributes
    ----------
    signals : (n, pair) readings minus those of the off state [counts]
    press_mm : (n, 3) x, y, depth [mm]
    is_held_out : (n,) whether the sample's location is held out, to measure the factors of the deviations
    """

    signals: FloatArray
    press_mm: FloatArray
    is_held_out: BoolArray

    def __len__(self) -> int:
        return len(self.press_mm)


def press_samples(data: TrainingData, most: int, rng: np.random.Generator) -> PressSamples:
    """At most `most` samples at depths of 0 and more, spread over presses and depths."""
    touched = np.flatnonzero(data.is_touched)
    chosen = touched[spread_samples(data.press[touched], data.press_mm[touched, 2], most, rng)]
    return PressSamples(
        signals=data.signals[chosen].astype(np.float64),
        press_mm=data.press_mm[chosen],
        is_held_out=held_out(data.location[chosen], HELD_OUT_SHARE, rng),
    )


def held_out(location: IntArray, share: float, rng: np.random.Generator) -> BoolArray:
    """Mask (sample,) of the samples to hold out: all samples of randomly chosen locations.

    Parameters
    ----------
    location : (sample,) number of each sample's location; give the numbers of presses to hold out whole presses
    share : share of the locations to hold out; at least one location is held out, and at least one is kept
    """
    numbers = np.unique(location)
    count = int(np.clip(round(share * len(numbers)), 1, len(numbers) - 1))
    return np.asarray(np.isin(location, rng.permutation(numbers)[:count]))


def spread_samples(press: IntArray, depth_mm: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Indices of at most ``count`` samples, spread over presses and depths, in increasing order.

    The number from each press is in proportion to its size. They are taken at even steps along its depths, with a
    random start, so that presses do not all have the same depths.
    """
    samples = len(press)
    if samples <= count:
        return np.arange(samples)
    order = np.lexsort((depth_mm, press))
    _, begins, sizes = np.unique(press[order], return_index=True, return_counts=True)
    wanted = _shares(sizes, count, rng)
    chosen = [
        order[begin + ((np.arange(take) + rng.random()) * size / take).astype(np.int64)]
        for begin, size, take in zip(begins, sizes, wanted, strict=True)
        if take
    ]
    return np.sort(np.concatenate(chosen))


def _shares(sizes: IntArray, count: int, rng: np.random.Generator) -> IntArray:
    """Number of samples to take from each press, in proportion to its size; the remainder goes to random presses."""
    exact = sizes * (count / sizes.sum())
    shares: IntArray = np.floor(exact).astype(np.int64)
    order = rng.permutation(len(sizes))
    left = count - int(shares.sum())
    open_ones = order[shares[order] < sizes[order]][:left]
    shares[open_ones] += 1
    return shares


LIBRARIES = ("optopad", "numpy", "scipy", "scikit-learn")
SIGMA_OF_STAGE = "what the stage says, its errors included"
SIGMA_OF_TIP = "where the tip is, without the stage's errors"
"""Entry of a model's header on what `sigma_mm` refers to. Learners trained on data know only the stage's position."""


def trained_header(kind: str, data: TrainingData, settings: Mapping[str, Any], seed: int) -> ModelHeader:
    """Header with facts about the data and the fit's settings; a force curve is added later if the design is known."""
    source = data.source
    return ModelHeader(
        kind=kind,
        design_digest=source.design_digest,
        emitter_names=source.emitter_names,
        receiver_names=source.receiver_names,
        untouched_counts=data.untouched_counts,
        trained_on=data.facts(),
        settings={**settings, "seed": seed, "sigma_of": SIGMA_OF_STAGE},
        created_with={name: version(name) for name in LIBRARIES} | {"python": platform.python_version()},
    )


CLEARLY_UNTOUCHED_MM = -0.25
"""A frame at this depth [mm], or higher above the pad, has no contact whatever the error of the reference depth."""
FEWEST_LOCATIONS = 9
"""Least number of locations, three a side: fewer cannot show whether the signal's change is linear or curved."""
FEWEST_TOUCHED = 200
FEWEST_UNTOUCHED = 50
"""Least number of untouched samples; with fewer, the result on the held-out half would be a matter of chance."""
MOST_CLIPPED = 0.01
"""A pair is used if at most this share of its untouched frames is at full scale [-]. Beyond it, a pair does not detect
light touches, and its difference from the off state depends on the brightness of the room.
"""
FEWEST_PAIRS = 3
"""Least number of usable pairs, as x, y and depth are three unknowns."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingData:
    """Checked samples to train on.

    Attributes
    ----------
    source : the data before selection
    signals : (sample, pair) readings minus those of the off state [counts]
    press_mm : (sample, 3) x, y, depth [mm]
    location : (sample,) number of each sample's location, from 0
    press : (sample,) number of each sample's press over all sets, from 0
    kept : (feature,) indices of the pairs that learners are to use
    left_out : sentences about data that were left out
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
        """Mask (sample,) of depths of 0 and more, which count as touched, as in the paper."""
        return np.asarray(self.press_mm[:, 2] >= 0.0)

    @property
    def untouched_counts(self) -> FloatArray:
        """Mean signals (pair,) of the untouched samples [counts]."""
        return np.asarray(self.signals[~self.is_touched].mean(axis=0, dtype=np.float64))

    def facts(self) -> dict[str, Any]:
        """Facts about the data for a model's header; only locations and presses with depths above 0 are counted."""
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
    """Check data, and leave out pairs that clip while untouched or never change.

    Raises
    ------
    InputError : there are too few samples, locations or usable pairs, or values are not finite.
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
                f"training data: has {found} {name}, needs >= {fewest}; record more presses, above the "
                "surface and into it, at locations all over the workspace"
            )


def _usable_pairs(train: PressData, signals: NDArray[np.float32]) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """Indices of the pairs that change and do not clip while untouched, and sentences about the others."""
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
            f"training data: only {len(kept)} pairs can be used ({'; '.join(left_out)}); lower the gain, "
            "or check the wiring with `optopad driver check`"
        )
    return kept, tuple(left_out)


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the data's attributes that can be stored in a JSON header."""
    return {
        name: value
        for name, value in attributes.items()
        if value is None or isinstance(value, str | int | float | bool)
    }
