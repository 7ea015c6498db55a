"""How far a model's own spread may be trusted: measured at locations that it was not trained on.

The learner is fitted without a share of the locations; what it says there is compared with the truth, by depth said:

    factor = rms(error) / rms(raw spread)

as a table over depth (`SigmaTable`). The final model is fitted with all locations and keeps the table. A location held
out lies a grid step from the nearest trained one, a press at random only part of a step: the table errs to the side of
caution.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from design.arrays import FloatArray
from sims.learning.inference.sigma_table import SigmaTable
from sims.learning.samples.errors_mm import held_out_figures
from sims.learning.samples.press_samples import PressSamples

BINS = 10
"""Depth said is cut into so many shares of equal numbers of samples."""
LEAST_FACTOR = 1e-3


class KnowsSpread(Protocol):
    """A model that says how far its parts are apart."""

    def press_and_spread_mm(self, signals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n, 3) presses and (n, 3) raw deviations of signals (n, pair) [mm]."""
        ...


def trust_of(model: KnowsSpread, samples: PressSamples) -> tuple[SigmaTable, dict[str, float]]:
    """Table and figures for the header, of a model that was fitted without the samples held out."""
    held_out = samples.is_held_out
    press_mm = samples.press_mm[held_out]
    told_mm, spread_mm = model.press_and_spread_mm(samples.signals[held_out])
    return sigma_table(told_mm, spread_mm, press_mm), held_out_figures(told_mm, press_mm)


def sigma_table(
    told_mm: FloatArray, spread_mm: FloatArray, press_mm: FloatArray, bins: int = BINS
) -> SigmaTable:
    """Factors from held-out samples.

    Parameters
    ----------
    told_mm, spread_mm : (n, 3) what the model said, and its raw deviation, above 0 [mm]
    press_mm : (n, 3) the truth [mm]
    bins : of depth, with equal numbers of samples
    """
    order = np.argsort(told_mm[:, 2], kind="stable")
    parts = [part for part in np.array_split(order, bins) if len(part)]
    depth_mm = np.array([told_mm[part, 2].mean() for part in parts])
    factor = np.array([_factor(told_mm[part], spread_mm[part], press_mm[part]) for part in parts])
    rising = np.concatenate([[True], np.diff(depth_mm) > 0.0])
    return SigmaTable(depth_mm=depth_mm[rising], factor=factor[rising])


def _factor(told_mm: FloatArray, spread_mm: FloatArray, press_mm: FloatArray) -> FloatArray:
    error = np.sqrt(np.mean((told_mm - press_mm) ** 2, axis=0))
    spread = np.sqrt(np.mean(spread_mm**2, axis=0))
    return np.asarray(np.maximum(error / spread, LEAST_FACTOR))
