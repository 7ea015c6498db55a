"""The kind "signal-map": presses by least squares against the simulated signals of the design; numpy only.

    signal of a pair = its untouched signal x (spline of √ratio over x, y, √depth)²,    limited at full scale

The untouched signals are those of the sensor that is read, so gains need not be known; the ratio is the light model's.
Touch is decided by the ratio of likelihoods of the best press and of none, both under the same noise and with the same
unknown gains (`press_search`, `reading_noise`):

    score = ½ (χ²(no press) - χ²(best press)) - threshold

The threshold is what untouched training frames rarely exceed. `sigma_mm` is of where the tip is, told by one frame: by
the curvature of χ² there, times a factor by depth (`sigma_table`), since the map's own error, an average over depths in
the noise, grows with depth. Errors of the stage are not in it, nor those of contact and light model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from sims.learning.inference.header import ModelHeader
from sims.learning.inference.prediction import Prediction
from sims.learning.inference.sigma_table import UNIT_SIGMA, SigmaTable, sigma_table_of_arrays
from sims.learning.inference.signal_map.press_search import Box, CoarseTable, Found, found_presses
from sims.learning.inference.signal_map.reading_noise import ReadingNoise
from sims.learning.inference.signal_map.tensor_spline import FEWEST_NODES, TensorSpline
from sims.learning.inference.touch_model import Arrays, checked_signals, prediction_of, taken

KIND = "signal-map"
FRAMES_AT_ONCE = 200
"""Frames searched side by side: their products stay within a few megabytes."""
TABLE_PITCH_MM = 2.0
LARGEST_BOX_MM = 1_000.0
"""Of presses that are considered: no pad is larger, and the table of starts grows with its area."""
LARGEST_TABLE = 50_000_000
"""Signals of the table of starts, 0.4 GB; a pad of 100 x 100 mm with 256 pairs has 7 million."""
TABLE_DEPTHS = 10
"""Of the presses that a search may start from; the search itself bridges the gaps between them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalMapModel:
    """A map of signals and how to invert it.

    Attributes
    ----------
    header : what it is of; its untouched counts are what the sensor reads, clipped as they are
    ratio_root : √(signal / untouched signal) of every pair
    full_counts : (pair,) untouched signals as they would be without full scale [counts]
    noise : of the readings, the map's own error included
    box : presses that are considered
    threshold : of the touch decision [half units of χ²]
    sigma : factors of the deviations by depth
    """

    header: ModelHeader
    ratio_root: TensorSpline
    full_counts: FloatArray
    noise: ReadingNoise
    box: Box
    threshold: float
    sigma: SigmaTable = UNIT_SIGMA

    def __post_init__(self) -> None:
        """Make the table of starts once."""
        press_mm = table_presses_mm(self.box)
        table = CoarseTable(press_mm=press_mm, signals=self.signals(press_mm))
        object.__setattr__(self, "_table", table)

    def predict(self, signals: FloatArray) -> Prediction:
        """Answers to frames (n, pair) [counts]."""
        signals = checked_signals(self.header, signals)
        parts = [
            self.found(signals[first : first + FRAMES_AT_ONCE])
            for first in range(0, max(len(signals), 1), FRAMES_AT_ONCE)
        ]
        score = np.concatenate([0.5 * (one.untouched_square - one.square) for one in parts]) - self.threshold
        press_mm = np.concatenate([one.press_mm for one in parts])
        raw_mm = np.sqrt(np.concatenate([np.einsum("nii->ni", one.covariance) for one in parts]))
        return prediction_of(self.header, score, press_mm, self.sigma.sigma_mm(press_mm[:, 2], raw_mm))

    def found(self, signals: FloatArray) -> Found:
        """The best press of each of (n, pair) frames [counts]."""
        table: CoarseTable = self._table  # type: ignore[attr-defined]
        return found_presses(
            self.answers,
            table,
            self.box,
            signals,
            np.minimum(self.full_counts, self.noise.clip_counts),
            self.noise.seen_in(signals),
        )

    def signals(self, press_mm: FloatArray) -> FloatArray:
        """(n, pair) signals of presses (n, 3), limited at full scale [counts]."""
        ratio = self.ratio_root.values(press_mm) ** 2
        return np.asarray(np.minimum(ratio * self.full_counts, self.noise.clip_counts))

    def answers(self, press_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signals of presses, limited, and their slopes [counts/mm], which are 0 at full scale."""
        root, slopes = self.ratio_root.with_gradient(press_mm)
        signals = root**2 * self.full_counts
        slopes *= (2.0 * root * self.full_counts)[:, None, :]
        is_clipped = signals >= self.noise.clip_counts
        return np.where(is_clipped, self.noise.clip_counts, signals), np.where(
            is_clipped[:, None, :], 0.0, slopes
        )

    def arrays(self) -> Arrays:
        """The numbers that its file keeps."""
        noise = self.noise
        return {
            "map_coefficients": self.ratio_root.coefficients,
            "map_start": self.ratio_root.start,
            "map_step": self.ratio_root.step,
            "full_counts": self.full_counts,
            "floor_counts": noise.floor_counts,
            "clip_counts": np.minimum(noise.clip_counts, np.finfo(np.float64).max),
            "noise_shares": np.array([noise.shot, noise.relative, noise.emitter_drift, noise.receiver_drift]),
            "box_mm": np.stack([self.box.low, self.box.high]),
            "threshold": np.array([self.threshold]),
            **self.sigma.arrays(),
        }


def table_presses_mm(box: Box) -> FloatArray:
    """(t, 3) presses all over a box to start from [mm]; depths at equal steps of their root."""
    sides = [
        np.linspace(low, high, int(np.ceil((high - low) / TABLE_PITCH_MM)) + 1)
        for low, high in zip(box.low[:2], box.high[:2], strict=True)
    ]
    depths = np.linspace(0.0, np.sqrt(box.high[2]), TABLE_DEPTHS + 1)[1:] ** 2
    x, y, depth = np.meshgrid(*sides, depths, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), depth.ravel()], axis=1)


def signal_map_of_arrays(header: ModelHeader, arrays: Arrays) -> SignalMapModel:
    """What `SignalMapModel.arrays` wrote.

    Raises
    ------
    InputError : arrays that are missing or do not fit each other.
    """
    pairs = len(header.untouched_counts)
    full = taken(arrays, "full_counts", (pairs,))
    floor, clip = (
        taken(arrays, "floor_counts", (pairs,)),
        taken(arrays, "clip_counts", (pairs,), largest=np.finfo(np.float64).max),
    )
    box = taken(arrays, "box_mm", (2, 3))
    shot, relative, emitter_drift, receiver_drift = taken(arrays, "noise_shares", (4,))
    if full.min() <= 0.0 or floor.min() <= 0.0 or not (box[0] < box[1]).all():
        raise InputError(
            "full_counts, floor_counts, box_mm: need numbers above 0, and a box that is not empty"
        )
    if np.abs(box).max() > LARGEST_BOX_MM or box[1, 2] <= 0.0:
        raise InputError(f"box_mm: reaches beyond {LARGEST_BOX_MM:g} mm, or holds no depth above 0")
    sides = np.ceil((box[1, :2] - box[0, :2]) / TABLE_PITCH_MM) + 1
    if (table := sides.prod() * TABLE_DEPTHS * pairs) > LARGEST_TABLE:
        raise InputError(f"box_mm: needs a table of {table:.3g} signals, reads at most {LARGEST_TABLE:.3g}")
    if min(shot, relative, emitter_drift, receiver_drift) < 0.0:
        raise InputError("noise_shares: are deviations, none is below 0")
    return SignalMapModel(
        header=header,
        ratio_root=_spline_of(arrays, pairs),
        full_counts=full,
        noise=ReadingNoise(
            floor_counts=floor,
            shot=float(shot),
            relative=float(relative),
            emitter_drift=float(emitter_drift),
            receiver_drift=float(receiver_drift),
            emitters=len(header.emitter_names),
            clip_counts=clip,
        ),
        box=Box(low=box[0], high=box[1]),
        threshold=float(taken(arrays, "threshold", (1,))[0]),
        # files from before factors were measured have none
        sigma=sigma_table_of_arrays(arrays) if "sigma_factor" in arrays else UNIT_SIGMA,
    )


def _spline_of(arrays: Arrays, pairs: int) -> TensorSpline:
    coefficients = taken(arrays, "map_coefficients", (None, None, None, pairs))
    start, step = taken(arrays, "map_start", (3,)), taken(arrays, "map_step", (3,))
    if min(coefficients.shape[:3]) < FEWEST_NODES + 2 or step.min() <= 0.0:
        raise InputError(f"map_coefficients, map_step: need {FEWEST_NODES} nodes an axis and steps above 0")
    return TensorSpline(coefficients=coefficients.astype(np.float32), start=start, step=step)
