"""The interface of every trained model, and helpers that all models share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.header import LARGEST_NUMBER, ModelHeader


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Predictions for n frames.

    Attributes
    ----------
    is_touched : (n,) whether the model detects a touch
    touch_score : (n,) score of this decision [-]. Above 0 there is touch; the higher the score, the more certain. It is
        not a probability
    press_mm : (n, 3) x, y, depth [mm]; given for every frame, but meaningful only if there is touch
    sigma_mm : (n, 3) standard deviations of `press_mm` [mm]; NaN if the model has none. For a signal map they refer to
        the tip's true position, for other models to the position that the stage reports. `sigma_of` in the header's
        settings says which of the two
    force_n : (n,) force from the force curve in the model's header [N], 0 without touch. None if the header has no
        force curve
    """

    is_touched: BoolArray
    touch_score: FloatArray
    press_mm: FloatArray
    sigma_mm: FloatArray
    force_n: FloatArray | None


Arrays = Mapping[str, NDArray[np.generic]]
"""The arrays of a model by name; its file contains them and the header."""


class TouchModel(Protocol):
    """Interface of a trained model, which predicts touch and press from frames.

    Attributes
    ----------
    header : description of the model and its training data
    """

    @property
    def header(self) -> ModelHeader:
        """Description of the model and its training data."""
        ...

    def predict(self, signals: FloatArray) -> Prediction:
        """Predict touch, location, depth and force for n frames.

        Parameters
        ----------
        signals : (n, pair) readings minus those of the off state, in the order E1-R1, E1-R2, ... [counts]
        """
        ...

    def arrays(self) -> Arrays:
        """The model's arrays, by their names in its file."""
        ...


def checked_signals(header: ModelHeader, signals: FloatArray) -> FloatArray:
    """Check frames, and return them in double precision, (n, pair) [counts].

    Raises
    ------
    InputError : the number of pairs differs from the header's, or a value is not finite.
    """
    found = np.asarray(signals, dtype=np.float64)
    pairs = len(header.untouched_counts)
    if found.ndim != 2 or found.shape[1] != pairs:
        raise InputError(f"signals: have the shape {found.shape}, the model takes (frames, {pairs})")
    if not np.isfinite(found).all():
        rows, columns = np.nonzero(~np.isfinite(found))
        raise InputError(
            f"signals: {header.pair_names[columns[0]]} of frame {rows[0]} is no finite number; drop the frame"
        )
    return found


def prediction_of(
    header: ModelHeader, touch_score: FloatArray, press_mm: FloatArray, sigma_mm: FloatArray | None = None
) -> Prediction:
    """Make a `Prediction`: decide touch by the score, and add the force from the header's curve.

    Parameters
    ----------
    touch_score : (n,) score of the touch decision; above 0 there is touch
    press_mm, sigma_mm : (n, 3) x, y, depth and their standard deviations [mm]. If `sigma_mm` is None, the deviations
        are NaN
    """
    is_touched = touch_score > 0.0
    curve = header.force_curve
    return Prediction(
        is_touched=is_touched,
        touch_score=touch_score,
        press_mm=press_mm,
        sigma_mm=np.full_like(press_mm, np.nan) if sigma_mm is None else sigma_mm,
        force_n=None if curve is None else np.where(is_touched, curve.at(press_mm[:, 2]), 0.0),
    )


def taken(
    arrays: Arrays, name: str, axes: tuple[int | None, ...], *, largest: float = LARGEST_NUMBER
) -> FloatArray:
    """Check one array of numbers from a model file, and return it in double precision.

    Parameters
    ----------
    axes : required length of every axis; None accepts any length
    largest : largest accepted magnitude of a number

    Raises
    ------
    InputError : the array is missing, has another shape, or has a number that is not finite or too large.
    """
    if name not in arrays:
        raise InputError(f"{name}: is missing")
    found = arrays[name]
    fits = found.ndim == len(axes) and all(
        wanted in (None, length) for wanted, length in zip(axes, found.shape, strict=True)
    )
    if not fits or found.dtype.kind not in "fiub":
        raise InputError(f"{name}: is no array of finite numbers of the shape that the model needs")
    numbers = found.astype(np.float64)
    if not (np.abs(numbers) <= largest).all():
        raise InputError(f"{name}: is no array of finite numbers of the shape that the model needs")
    return numbers


def taken_whole(arrays: Arrays, name: str, axes: tuple[int | None, ...]) -> NDArray[np.int32]:
    """Check one array of whole numbers from a model file, and return it; raises `InputError` like `taken`."""
    return taken(arrays, name, axes, largest=np.iinfo(np.int32).max).astype(np.int32)


@dataclass(frozen=True, kw_only=True, eq=False)
class SigmaTable:
    """Factors from a model's raw deviation to its standard deviation, by depth.

    They are measured at locations on which the model was not trained, interpolated linearly between the table's depths,
    and constant outside them.

    Attributes
    ----------
    depth_mm : (depth,) increasing depths [mm]
    factor : (depth, 3) factors for x, y, depth [-]
    """

    depth_mm: FloatArray
    factor: FloatArray

    def sigma_mm(self, depth_mm: FloatArray, raw_mm: FloatArray) -> FloatArray:
        """Standard deviations (n, 3) [mm] from raw deviations (n, 3) [mm] at estimated depths (n,) [mm]."""
        factors = [np.interp(depth_mm, self.depth_mm, column) for column in self.factor.T]
        return np.asarray(raw_mm * np.stack(factors, axis=1))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The table's arrays, by their names in a model file."""
        return {"sigma_depth_mm": self.depth_mm, "sigma_factor": self.factor}


UNIT_SIGMA = SigmaTable(depth_mm=np.zeros(1), factor=np.ones((1, 3)))
"""Table with factors of 1, for a model whose factors were not measured."""


def sigma_table_of_arrays(arrays: Arrays) -> SigmaTable:
    """Make the table from its arrays in a model file; raises `InputError` if they are inconsistent."""
    depth_mm = taken(arrays, "sigma_depth_mm", (None,))
    factor = taken(arrays, "sigma_factor", (len(depth_mm), 3))
    if not len(depth_mm) or (np.diff(depth_mm) <= 0.0).any() or factor.min() < 0.0:
        raise InputError("sigma_depth_mm: needs rising depths and factors of 0 or more")
    return SigmaTable(depth_mm=depth_mm, factor=factor)


@dataclass(frozen=True, kw_only=True, eq=False)
class FeatureScaling:
    """Conversion of the used pairs' counts to features: (counts - centre) / scale.

    There are three scalings (docs/how-to/train-learner.md says which learner uses which):

    * `counts`: centre 0 and one common scale, so that distances between features are proportional to those between
      readings.
    * `standard`: each pair's mean and standard deviation over the training samples.
    * `untouched`: each pair's mean and its spread over the training samples, at least the reading noise, so that the
      noise of weak pairs is not amplified.

    Attributes
    ----------
    kept : (feature,) indices in a frame of the pairs that are used
    centre, scale : (feature,) offset and divisor of each feature [counts]
    """

    kept: NDArray[np.intp]
    centre: FloatArray
    scale: FloatArray

    def features(self, signals: NDArray[np.floating[Any]]) -> FloatArray:
        """Features (n, feature) of frames (n, pair) [-]."""
        return np.asarray((signals[:, self.kept] - self.centre) / self.scale)

    def arrays(self, prefix: str) -> dict[str, NDArray[np.generic]]:
        """The scaling's arrays for a model file, by name; all names start with `prefix`."""
        return {
            f"{prefix}_kept": self.kept.astype(np.int32),
            f"{prefix}_centre": self.centre,
            f"{prefix}_scale": self.scale,
        }


def scaling_of_arrays(arrays: Arrays, prefix: str, pairs: int) -> FeatureScaling:
    """Make the scaling from its arrays in a model file.

    Parameters
    ----------
    arrays : arrays of the file by name
    prefix : common start of the names of the three arrays
    pairs : number of pairs in a frame

    Raises
    ------
    InputError : an array is missing or malformed, a pair is not in the frame, or a scale is not above 0.
    """
    kept = taken_whole(arrays, f"{prefix}_kept", (None,)).astype(np.intp)
    centre = taken(arrays, f"{prefix}_centre", kept.shape)
    scale = taken(arrays, f"{prefix}_scale", kept.shape)
    if not kept.size or kept.min() < 0 or kept.max() >= pairs or scale.min() <= 0.0:
        raise InputError(
            f"{prefix}: names pairs that the frame does not have, or scales that are not above 0"
        )
    return FeatureScaling(kept=kept, centre=centre, scale=scale)


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchSvm:
    """The paper's touch classifier: the plane of a linear support vector machine in the space of the features.

    Source: Cortes and Vapnik, Support-vector networks, Machine Learning 20 (1995).

    Attributes
    ----------
    scaling : scaling of counts to features
    weights : (feature,) w, normal of the plane [-]
    bias : b, offset of the plane [-]
    """

    scaling: FeatureScaling
    weights: FloatArray
    bias: float

    def score(self, signals: FloatArray) -> FloatArray:
        """Score (n,) of frames (n, pair); above 0 means touch [-].

        It is the signed distance from the plane, in units of the margin.
        """
        return np.asarray(self.scaling.features(signals) @ self.weights + self.bias)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The classifier's arrays, by their names in a model file."""
        return self.scaling.arrays("touch") | {
            "touch_weights": self.weights,
            "touch_bias": np.array([self.bias]),
        }


def touch_svm_of_arrays(arrays: Arrays, pairs: int) -> TouchSvm:
    """Make the classifier from its arrays in a model file; raises `InputError` if they are inconsistent."""
    scaling = scaling_of_arrays(arrays, "touch", pairs)
    weights = taken(arrays, "touch_weights", scaling.kept.shape)
    return TouchSvm(scaling=scaling, weights=weights, bias=float(taken(arrays, "touch_bias", (1,))[0]))
