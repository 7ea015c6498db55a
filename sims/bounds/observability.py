"""Best possible accuracy of a pad: bounds on the error of a press's location and depth, over the workspace.

A voxel is one combination (x, y, depth). Its Cramér-Rao bounds apply to one frame with all pairs. Derivatives of the
readings come from slightly offset presses (`optopad.sims.bounds.fisher`). The bounds serve to compare layouts; a
trained estimator is no better on average, and usually worse. The loss when an emitter or receiver fails follows from
the bounds without its pairs.

Summaries are medians and shares over the volume of the workspace. Every location has the same weight, and a depth
represents the range half-way to its neighbours. For the low and high ends of a summary, all bounds are shifted together
by two standard errors of the light trace. This is the worst case, since errors of voxels are nearly independent. The
errors of the models and of the coarse grid are not included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.progress import OnShare
from optopad.design.shape.cavity import CavityGeometry, judged_pairs, mask_of
from optopad.sims.bounds.detection_threshold import DetectionThreshold
from optopad.sims.bounds.fisher import (
    BAND,
    COARSE_DEPTHS_MM,
    COVERED_DEPTH_MM,
    COVERED_LOCATION_MM,
    DEAD_DEPTH_MM,
    DEAD_LOCATION_MM,
    Bounds,
    Sensitivity,
    Steps,
    bounds_of,
    sensitivities,
)
from optopad.sims.optics.accuracy import ACCURACIES, CONTACT_FINER, MIRRORED_FINER, Accuracy
from optopad.sims.readings.readout import Readout, readout_of
from optopad.sims.verdict.pad_map import grid_inside, grid_places_mm, map_grid_mm, on_grid
from optopad.sims.verdict.presses import untouched_flux

ROUND_OFF_DIGITS = 12
"""Number of decimals to which a share is rounded, to remove round-off."""


@dataclass(frozen=True, kw_only=True)
class BoundFigure:
    """A summary of the bounds, with the low and high end of its error band; infinite where not resolved."""

    value: float
    low: float
    high: float

    def percent(self) -> str:
        """The value as text in per cent, followed by the ends of its band unless they round to the same number."""
        same = round(100 * self.low) == round(100 * self.high)
        return f"{self.value:.0%}" if same else f"{self.value:.0%} ({self.low:.0%} to {self.high:.0%})"

    def complement(self) -> BoundFigure:
        """One minus this share, with the ends of the band swapped and round-off removed."""
        value, low, high = (
            max(0.0, round(1.0 - share, ROUND_OFF_DIGITS)) for share in (self.value, self.high, self.low)
        )
        return BoundFigure(value=value, low=low, high=high)


def depth_weights(depth_mm: Sequence[float] | FloatArray, max_depth_mm: float) -> FloatArray:
    """(n,) share of the depth range that each depth represents [-]; parts meet half-way between neighbouring depths.

    Parameters
    ----------
    depth_mm : (n,) increasing depths [mm]
    max_depth_mm : end of the range, which starts at 0 [mm]
    """
    depth = np.asarray(depth_mm, dtype=np.float64)
    edges = np.concatenate([[0.0], 0.5 * (depth[1:] + depth[:-1]), [max_depth_mm]])
    return np.asarray(np.diff(edges) / max_depth_mm)


def median_of(values: FloatArray, errors: FloatArray, weight: FloatArray) -> BoundFigure:
    """Weighted median of bounds; its low and high ends are the medians of all bounds shifted by `BAND` errors."""
    low, high = _ends(values, errors)
    return BoundFigure(
        value=_median(values, weight),
        low=_median(low, weight),
        high=_median(high, weight),
    )


def share_of(bounds: Bounds, location_mm: float, depth_mm: float, weight: FloatArray) -> BoundFigure:
    """Share of the volume that is resolved, with location and depth bounds below the given limits [-]."""
    location_low, location_high = _ends(bounds.location_mm, bounds.location_error_mm)
    depth_low, depth_high = _ends(bounds.depth_mm, bounds.depth_error_mm)

    def share(location: FloatArray, depth: FloatArray) -> float:
        is_inside = np.isfinite(location) & (location < location_mm) & (depth < depth_mm)
        return float(weight[is_inside].sum())

    return BoundFigure(
        value=share(bounds.location_mm, bounds.depth_mm),
        low=share(location_high, depth_high),
        high=share(location_low, depth_low),
    )


def _ends(values: FloatArray, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values lowered and raised by `BAND` errors; results below zero become 0, infinite values stay infinite."""
    is_known = np.isfinite(values)
    moved = BAND * np.where(is_known, errors, 0.0)
    return np.maximum(values - moved, 0.0), values + moved


def _median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values, axis=None)
    total = np.cumsum(weight.ravel()[order])
    return float(values.ravel()[order[min(np.searchsorted(total, 0.5 * total[-1]), order.size - 1)]])


@dataclass(frozen=True, kw_only=True)
class PartLoss:
    """Summaries of a pad's bounds when one emitter or receiver has failed.

    Attributes
    ----------
    part : name of the component, such as E3
    coverage : share of the workspace's volume still covered [-]
    median_location_mm, median_depth_mm : median bounds without the component [mm]; infinite where half of the volume
        is not resolved
    blind_share : share of the volume where a press is not resolved [-]
    """

    part: str
    coverage: BoundFigure
    median_location_mm: BoundFigure
    median_depth_mm: BoundFigure
    blind_share: float


def part_losses(
    answers: Sensitivity,
    cavity: CavityGeometry,
    weight: FloatArray,
    covered_location_mm: float,
    covered_depth_mm: float,
) -> tuple[PartLoss, ...]:
    """Summaries of the bounds without each emitter and receiver in turn, emitters first.

    Parameters
    ----------
    answers : derivatives of the readings of all pairs, in emitter-major order
    weight : share of the volume that each voxel represents [-]; it has the axes of `answers` except that of the pairs
    """
    emitter, receiver = (index.ravel() for index in np.indices((len(cavity.emitters), len(cavity.receivers))))
    lost = [(part.name, emitter == k) for k, part in enumerate(cavity.emitters)]
    lost += [(part.name, receiver == k) for k, part in enumerate(cavity.receivers)]
    return tuple(
        _loss(name, answers.without(is_lost), weight, covered_location_mm, covered_depth_mm)
        for name, is_lost in lost
    )


def _loss(
    name: str,
    answers: Sensitivity,
    weight: FloatArray,
    covered_location_mm: float,
    covered_depth_mm: float,
) -> PartLoss:
    found = bounds_of(answers)
    return PartLoss(
        part=name,
        coverage=share_of(found, covered_location_mm, covered_depth_mm, weight),
        median_location_mm=median_of(found.location_mm, found.location_error_mm, weight),
        median_depth_mm=median_of(found.depth_mm, found.depth_error_mm, weight),
        blind_share=float(weight[found.is_blind].sum()),
    )


BOUND_ACCURACIES = ("score", MIRRORED_FINER, CONTACT_FINER)
"""Accuracy settings of the light model for derivatives, cheapest first. Voxels still uncertain with the first are
traced again with the second, and voxels not resolved with the second again with the third. The first is that of the
deadband map, so that its stored light can be used."""
MANY_PAIRS_BOUNDS = (ACCURACIES["draft"], MIRRORED_FINER)
"""The same settings for layouts with hundreds of pairs."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits on the bounds [mm]: a covered voxel is below both of its limits, a dead voxel above at least one."""

    covered_location_mm: float = COVERED_LOCATION_MM
    covered_depth_mm: float = COVERED_DEPTH_MM
    dead_location_mm: float = DEAD_LOCATION_MM
    dead_depth_mm: float = DEAD_DEPTH_MM


@dataclass(frozen=True, kw_only=True)
class Voxel:
    """Centre of a voxel, its bounds and their standard errors [mm]; if not resolved, both are infinite."""

    x_mm: float
    y_mm: float
    depth_mm: float
    location_mm: float
    location_error_mm: float
    depth_bound_mm: float
    depth_error_mm: float


@dataclass(frozen=True, kw_only=True)
class PadBounds:
    """Cramér-Rao bounds over the workspace, and their summaries.

    Arrays have the axes (y, x, depth); a bound and its error are infinite where a press is not resolved, and NaN
    outside the workspace.

    Attributes
    ----------
    x_mm, y_mm, depth_mm : (nx,), (ny,) and (nd,) coordinates of the voxels' centres [mm]
    max_depth_mm : end of the usable range, to which the deepest voxel reaches [mm]
    location_mm : (ny, nx, nd) least standard deviation of the location, √(var x + var y) [mm]
    depth_bound_mm : (ny, nx, nd) least standard deviation of the depth if the location is unknown [mm]
    depth_alone_mm : (ny, nx, nd) least standard deviation of the depth if the location is known [mm]
    location_error_mm, depth_error_mm, depth_alone_error_mm : (ny, nx, nd) standard errors of these, due to the light
        trace [mm]
    losses : summaries without each emitter and receiver in turn, emitters first; empty if not computed
    detection : detection threshold at each location; None if not computed
    limits : limits of covered and of dead voxels
    pairs : names of the pairs that are used, such as E1-R3
    steps : offsets of the presses for the derivatives [mm]
    accuracies : names of the light model's accuracy settings, cheapest first
    seed : random seed of the first half of the presses; the second half has seed +
        `optopad.sims.bounds.fisher.SEED_GAP`
    digest : digest of the design
    """

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    depth_mm: tuple[float, ...]
    max_depth_mm: float
    location_mm: FloatArray
    location_error_mm: FloatArray
    depth_bound_mm: FloatArray
    depth_error_mm: FloatArray
    depth_alone_mm: FloatArray
    depth_alone_error_mm: FloatArray
    losses: tuple[PartLoss, ...]
    detection: DetectionThreshold | None
    limits: Limits
    pairs: tuple[str, ...]
    steps: Steps
    accuracies: tuple[str, ...]
    seed: int
    digest: str

    @property
    def is_blind(self) -> BoolArray:
        """(ny, nx, nd) whether a press is not resolved; False outside the workspace."""
        return np.isinf(self.location_mm)

    @property
    def weight(self) -> FloatArray:
        """(ny, nx, nd) share of the workspace's volume that each voxel represents; sums to 1."""
        inside = self.inside
        shares = depth_weights(self.depth_mm, self.max_depth_mm) / inside.sum()
        return np.where(inside[:, :, None], shares, 0.0)

    @property
    def inside(self) -> BoolArray:
        """(ny, nx) which locations of the grid are in the workspace."""
        return ~np.isnan(self.location_mm[:, :, 0])

    @property
    def bounds(self) -> Bounds:
        """The bounds and their errors as `optopad.sims.bounds.fisher.Bounds`."""
        return Bounds(
            location_mm=self.location_mm,
            location_error_mm=self.location_error_mm,
            depth_mm=self.depth_bound_mm,
            depth_error_mm=self.depth_error_mm,
            depth_alone_mm=self.depth_alone_mm,
            depth_alone_error_mm=self.depth_alone_error_mm,
        )

    @property
    def median_location_mm(self) -> BoundFigure:
        """Median location bound over the volume [mm]; infinite if half of it is not resolved."""
        return median_of(self.location_mm, self.location_error_mm, self.weight)

    @property
    def median_depth_mm(self) -> BoundFigure:
        """Median depth bound over the volume if the location is unknown [mm]; infinite if half is not resolved."""
        return median_of(self.depth_bound_mm, self.depth_error_mm, self.weight)

    @property
    def median_depth_alone_mm(self) -> BoundFigure:
        """Median depth bound over the volume if the location is known [mm]; infinite if half is not resolved."""
        return median_of(self.depth_alone_mm, self.depth_alone_error_mm, self.weight)

    @property
    def coverage(self) -> BoundFigure:
        """Share of the volume with location and depth bounds below the limits of a covered voxel [-]."""
        limits = self.limits
        return share_of(self.bounds, limits.covered_location_mm, limits.covered_depth_mm, self.weight)

    @property
    def dead_share(self) -> BoundFigure:
        """Share of the volume that is dead [-]: not resolved, or with a location or depth bound above its limit."""
        limits = self.limits
        return share_of(self.bounds, limits.dead_location_mm, limits.dead_depth_mm, self.weight).complement()

    @property
    def dead_depth_share(self) -> BoundFigure:
        """Share of the volume that is not resolved or whose depth bound (location unknown) is above its limit [-]."""
        return share_of(self.bounds, np.inf, self.limits.dead_depth_mm, self.weight).complement()

    @property
    def blind_share(self) -> float:
        """Share of the volume where presses are not resolved in some direction of (x, y, depth) [-]."""
        return float(self.weight[self.is_blind].sum())

    @property
    def worst(self) -> Voxel:
        """The voxel with the largest location bound, where unresolved counts as largest; of equal ones, the deepest."""
        rank = np.where(np.isnan(self.location_mm), -np.inf, self.location_mm)
        deepest_first = np.broadcast_to(np.arange(len(self.depth_mm)), rank.shape)
        order = np.lexsort((-deepest_first.ravel(), -rank.ravel()))
        return self.voxel(*(int(k) for k in np.unravel_index(order[0], rank.shape)))

    @property
    def worst_loss(self) -> PartLoss | None:
        """The failure that leaves the lowest coverage; None if no failures were computed.

        Of equal ones, it is the one with the largest median location bound.
        """
        if not self.losses:
            return None
        return min(self.losses, key=lambda loss: (loss.coverage.value, -loss.median_location_mm.value))

    def voxel(self, row: int, column: int, layer: int) -> Voxel:
        """The voxel at the given indices of y, x and depth."""
        at = (row, column, layer)
        return Voxel(
            x_mm=self.x_mm[column],
            y_mm=self.y_mm[row],
            depth_mm=self.depth_mm[layer],
            location_mm=float(self.location_mm[at]),
            location_error_mm=float(self.location_error_mm[at]),
            depth_bound_mm=float(self.depth_bound_mm[at]),
            depth_error_mm=float(self.depth_error_mm[at]),
        )


def bound_depths_mm(wanted_mm: tuple[float, ...], max_depth_mm: float, step_mm: float) -> FloatArray:
    """(n,) depths of the voxels [mm]: the requested depths within the usable range, and the deepest possible one.

    The deepest voxel lies `step_mm` before the end of the range, because its derivative needs a press `step_mm` deeper.
    """
    deepest = max(max_depth_mm - step_mm, 0.5 * max_depth_mm)
    inside = [depth for depth in wanted_mm if depth < deepest - 1.5 * step_mm]
    return np.array([*inside, deepest])


def pad_bounds(
    draft: Draft,
    *,
    x_mm: FloatArray | None = None,
    y_mm: FloatArray | None = None,
    places: int = 5,
    depths_mm: tuple[float, ...] = COARSE_DEPTHS_MM,
    accuracies: Sequence[str | Accuracy] = BOUND_ACCURACIES,
    seed: int = 0,
    readout: Readout | None = None,
    detection: DetectionThreshold | None = None,
    limits: Limits | None = None,
    steps: Steps | None = None,
    with_losses: bool = True,
    on_step: OnShare | None = None,
) -> PadBounds:
    """Cramér-Rao bounds of location and depth over the workspace.

    Parameters
    ----------
    x_mm, y_mm : coordinates of the grid [mm]; if omitted, a grid of equal pitch in both directions
    places : number of locations of the default grid along the workspace's longer side
    depths_mm : depths of the voxels [mm]; depths beyond the usable range are left out, and its end is added
    accuracies : accuracy settings for `optopad.sims.optics.tracing.trace`, cheapest first
        (`optopad.sims.bounds.fisher.sensitivities`)
    seed : random seed of the first half of the presses
    readout : common gain; if omitted, it is set on the untouched pad, which takes one more trace
    detection : detection threshold, only copied into the result
    limits, steps : limits of covered and dead voxels, and offsets of the presses
    with_losses : whether to compute the summaries without each emitter and receiver in turn
    on_step : called with the share of the work done, 0 to 1

    Raises
    ------
    ModelScopeError : the contact or light model does not cover a press.
    """
    cavity, design = draft.cavity, draft.design
    steps, limits = steps or Steps(), limits or Limits()
    if x_mm is None or y_mm is None:
        x_mm, y_mm = map_grid_mm(cavity, places)
    readout = readout or own_readout(draft, seed=seed)
    max_depth_mm = design.operating.max_depth_mm
    depth_mm = bound_depths_mm(depths_mm, max_depth_mm, steps.depth_mm)
    answers = sensitivities(
        draft,
        grid_places_mm(cavity.workspace, x_mm, y_mm),
        depth_mm,
        readout,
        accuracies=accuracies,
        seed=seed,
        steps=steps,
        on_step=on_step,
    )
    found, inside = bounds_of(answers), grid_inside(cavity.workspace, x_mm, y_mm)
    columns = int(inside.sum())
    weight = (
        np.tile(depth_weights(depth_mm, max_depth_mm), columns).reshape(found.location_mm.shape) / columns
    )
    covered = limits.covered_location_mm, limits.covered_depth_mm
    losses = part_losses(answers, cavity, weight, *covered) if with_losses else ()
    return PadBounds(
        x_mm=tuple(float(x) for x in x_mm),
        y_mm=tuple(float(y) for y in y_mm),
        depth_mm=tuple(float(depth) for depth in depth_mm),
        max_depth_mm=max_depth_mm,
        location_mm=on_grid(found.location_mm, inside),
        location_error_mm=on_grid(found.location_error_mm, inside),
        depth_bound_mm=on_grid(found.depth_mm, inside),
        depth_error_mm=on_grid(found.depth_error_mm, inside),
        depth_alone_mm=on_grid(found.depth_alone_mm, inside),
        depth_alone_error_mm=on_grid(found.depth_alone_error_mm, inside),
        losses=losses,
        detection=detection,
        limits=limits,
        pairs=pair_names(cavity),
        steps=steps,
        accuracies=tuple(_name_of(accuracy) for accuracy in accuracies),
        seed=seed,
        digest=design.digest,
    )


def _name_of(accuracy: str | Accuracy) -> str:
    """Name by which files refer to an accuracy setting."""
    if isinstance(accuracy, str):
        return accuracy
    for one, name in ((MIRRORED_FINER, "score, mirrored light as standard"), (CONTACT_FINER, "finer images")):
        if accuracy == one:
            return name
    return next((name for name, one in ACCURACIES.items() if one == accuracy), "own settings")


def own_readout(draft: Draft, *, seed: int, accuracy: str | Accuracy = "standard") -> Readout:
    """A design's common gain, set on its untouched pad."""
    flat = untouched_flux(draft, seed=seed, accuracy=accuracy)
    return readout_of(draft, flat, mask_of(judged_pairs(draft.cavity), draft.cavity))


def pair_names(cavity: CavityGeometry) -> tuple[str, ...]:
    """Names of all pairs, such as E1-R3, in emitter-major order."""
    return tuple(f"{e.name}-{r.name}" for e in cavity.emitters for r in cavity.receivers)


def bounds_json(bounds: PadBounds) -> dict[str, Any]:
    """All values of a `PadBounds` for JSON. Arrays become nested lists with the axes (depth, y, x), infinity None."""
    worst = bounds.worst_loss
    detection = None if bounds.detection is None else _detection_json(bounds.detection)
    unresolved = _number(bounds.blind_share)
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
        "unresolved_share": unresolved,
        "blind_share": unresolved,  # its earlier name, for one release
        "worst_voxel": _voxel_json(bounds.worst),
        "location_mm": _layers(bounds.location_mm),
        "location_error_mm": _layers(bounds.location_error_mm),
        "depth_bound_mm": _layers(bounds.depth_bound_mm),
        "depth_error_mm": _layers(bounds.depth_error_mm),
        "depth_place_known_mm": _layers(bounds.depth_alone_mm),
        "depth_place_known_error_mm": _layers(bounds.depth_alone_error_mm),
        "losses": [_loss_json(loss) for loss in bounds.losses],
        "worst_loss": None if worst is None else worst.part,
        "detection": detection,
        "felt": detection,  # its earlier name, for one release
        "accuracies": list(bounds.accuracies),
        "steps_mm": vars(bounds.steps),
    }


def figure_json(figure: BoundFigure) -> dict[str, float | None]:
    """Value, low and high end of a summary for JSON; infinity becomes None."""
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


def _detection_json(detection: DetectionThreshold) -> dict[str, Any]:
    row, column = detection.worst
    maps = ("depth_mm", "force_n", "force_error_low_n", "force_error_high_n", "low_n", "high_n")
    return {
        "threshold_noise_units": detection.threshold,
        "worst_place_mm": [detection.x_mm[column], detection.y_mm[row]],
        "worst_force_n": _number(float(detection.force_n[row, column])),
        "worst_force_range_n": [
            _number(float(end[row, column]))
            for end in (detection.force_error_low_n, detection.force_error_high_n)
        ],
        "median_force_n": _number(float(np.nanmedian(detection.force_n))),
    } | {name: [[_number(value) for value in values] for values in getattr(detection, name)] for name in maps}
