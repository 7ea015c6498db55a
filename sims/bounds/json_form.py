"""Bounds as plain data for JSON: summaries with the ends of their bands, maps by depth; blind is None."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from design.arrays import FloatArray
from sims.bounds.felt import FeltForce
from sims.bounds.figures import Figure
from sims.bounds.losses import PartLoss

if TYPE_CHECKING:
    from sims.bounds.observability import PadBounds, Voxel


def bounds_json(bounds: PadBounds) -> dict[str, Any]:
    """Everything that a `PadBounds` tells; maps are lists over depth of rows over y of values over x."""
    worst = bounds.worst_loss
    return {
        "x_mm": list(bounds.x_mm),
        "y_mm": list(bounds.y_mm),
        "depth_mm": list(bounds.depth_mm),
        "limits_mm": vars(bounds.limits),
        "median_location_mm": figure_json(bounds.median_location_mm),
        "median_depth_mm": figure_json(bounds.median_depth_mm),
        "median_depth_place_known_mm": figure_json(bounds.median_depth_alone_mm),
        "coverage": figure_json(bounds.coverage),
        "dead_share": figure_json(bounds.dead_share),
        "dead_depth_share": figure_json(bounds.dead_depth_share),
        "blind_share": _number(bounds.blind_share),
        "worst_voxel": _voxel_json(bounds.worst),
        "location_mm": _layers(bounds.location_mm),
        "location_error_mm": _layers(bounds.location_error_mm),
        "depth_bound_mm": _layers(bounds.depth_bound_mm),
        "depth_error_mm": _layers(bounds.depth_error_mm),
        "depth_place_known_mm": _layers(bounds.depth_alone_mm),
        "depth_place_known_error_mm": _layers(bounds.depth_alone_error_mm),
        "losses": [_loss_json(loss) for loss in bounds.losses],
        "worst_loss": None if worst is None else worst.part,
        "felt": None if bounds.felt is None else _felt_json(bounds.felt),
        "accuracies": list(bounds.accuracies),
        "steps_mm": vars(bounds.steps),
    }


def figure_json(figure: Figure) -> dict[str, float | None]:
    """Value and ends; infinite is None."""
    return {"value": _number(figure.value), "low": _number(figure.low), "high": _number(figure.high)}


def _number(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None


def _layers(values: FloatArray) -> list[list[list[float | None]]]:
    return [[[_number(value) for value in row] for row in layer] for layer in np.moveaxis(values, -1, 0)]


def _voxel_json(voxel: Voxel) -> dict[str, float | None]:
    return {name: _number(value) for name, value in vars(voxel).items()}


def _loss_json(loss: PartLoss) -> dict[str, Any]:
    return {
        "part": loss.part,
        "coverage": figure_json(loss.coverage),
        "median_location_mm": figure_json(loss.median_location_mm),
        "median_depth_mm": figure_json(loss.median_depth_mm),
        "blind_share": _number(loss.blind_share),
    }


def _felt_json(felt: FeltForce) -> dict[str, Any]:
    row, column = felt.worst
    maps = ("depth_mm", "force_n", "force_error_low_n", "force_error_high_n", "low_n", "high_n")
    return {
        "threshold_noise_units": felt.threshold,
        "worst_place_mm": [felt.x_mm[column], felt.y_mm[row]],
        "worst_force_n": _number(float(felt.force_n[row, column])),
        "median_force_n": _number(float(np.nanmedian(felt.force_n))),
    } | {name: [[_number(value) for value in values] for values in getattr(felt, name)] for name in maps}
