"""The interface of every trained model, and helpers that all models share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.header import LARGEST_NUMBER, ModelHeader
from optopad.sims.learning.inference.prediction import Prediction

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
