"""What a pad can tell of a press at best: bounds of its place and depth in every voxel of the workspace.

For every (x, y, depth) the Cramér-Rao bounds of one frame of readings of all pairs (`sims.bounds.fisher`), from
derivatives by offset presses in two independent halves (`sims.bounds.stencil`); what of it is lost when an emitter or
receiver dies; the lightest press that is felt. Helps to compare layouts; a trained estimator does no better on
average, and usually worse.

Summaries are shares of the volume that the bounds' grid stands for: every place counts alike, every depth with the
distance half-way to its neighbours. Their low and high ends come from all bounds moved together by two standard
errors of the trace, which is the worst case (voxels' errors are nearly independent). They hold the error of the trace
only: not that of the models, nor the coarseness of the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.progress import OnShare
from design.shape.cavity import CavityGeometry, cavity_of
from design.shape.pairs import judged_pairs, mask_of
from design.spec import SensorDesign
from sims.bounds.defaults import (
    COARSE_DEPTHS_MM,
    COVERED_DEPTH_MM,
    COVERED_LOCATION_MM,
    DEAD_DEPTH_MM,
    DEAD_LOCATION_MM,
)
from sims.bounds.felt import FeltForce
from sims.bounds.figures import Figure, depth_weights, median_of, share_of
from sims.bounds.fisher import Bounds, bounds_of
from sims.bounds.losses import PartLoss, part_losses
from sims.bounds.pad_answers import pad_answers
from sims.bounds.stencil import Steps
from sims.optics.accuracy import MIRRORED_FINER, Accuracy
from sims.readings.readout import Readout, readout_of
from sims.verdict.pad_map import grid_inside, grid_places_mm, map_grid_mm, on_grid
from sims.verdict.presses import untouched_flux

BOUND_ACCURACIES = ("score", MIRRORED_FINER)
"""Settings of the light for derivatives, cheapest first: a common lattice takes most of the error out, and voxels
where that is not enough are traced again with the next. The first are those of a map, whose light is found again."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What counts as covered and as dead [mm]: see `sims.bounds.defaults`."""

    covered_location_mm: float = COVERED_LOCATION_MM
    covered_depth_mm: float = COVERED_DEPTH_MM
    dead_location_mm: float = DEAD_LOCATION_MM
    dead_depth_mm: float = DEAD_DEPTH_MM


@dataclass(frozen=True, kw_only=True)
class Voxel:
    """One voxel of the bounds: its centre, its bounds, and their standard errors; infinite where blind [mm]."""

    x_mm: float
    y_mm: float
    depth_mm: float
    location_mm: float
    location_error_mm: float
    depth_bound_mm: float
    depth_error_mm: float


@dataclass(frozen=True, kw_only=True)
class PadBounds:
    """Cramér-Rao bounds over the workspace, and what follows from them.

    Arrays have the axes (y, x, depth); a bound is infinite, and its error too, where the pad is blind, and NaN outside
    the workspace.

    Attributes
    ----------
    x_mm : (nx,), y_mm : (ny,), depth_mm : (nd,) centres of the voxels [mm]
    max_depth_mm : end of the range of use, to which the deepest voxel reaches [mm]
    location_mm : (ny, nx, nd) least standard deviation of the place, √(var x + var y) [mm]
    depth_bound_mm : (ny, nx, nd) least standard deviation of the depth, place unknown [mm]
    depth_alone_mm : (ny, nx, nd) the same, place known [mm]
    location_error_mm, depth_error_mm, depth_alone_error_mm : (ny, nx, nd) standard errors that the trace leaves [mm]
    losses : what is lost when a part dies, one row a part, emitters first; empty where not computed
    felt : lightest press that the pad answers to, place by place; None where not computed
    limits : what counts as covered and as dead
    pairs : names of the pairs that tell, as E1-R3
    steps : offsets of the presses behind the derivatives [mm]
    accuracies, seed, digest : settings of the light, cheapest first, and of what design; the second half has seed +
        `sims.bounds.stencil.SEED_GAP`
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
    felt: FeltForce | None
    limits: Limits
    pairs: tuple[str, ...]
    steps: Steps
    accuracies: tuple[str, ...]
    seed: int
    digest: str

    @property
    def is_blind(self) -> BoolArray:
        """(ny, nx, nd) whether some direction of (x, y, depth) cannot be told."""
        return np.isinf(self.location_mm)

    @property
    def weight(self) -> FloatArray:
        """(ny, nx, nd) share of the workspace's volume that each voxel stands for; sums to 1."""
        inside = self.inside
        shares = depth_weights(self.depth_mm, self.max_depth_mm) / inside.sum()
        return np.where(inside[:, :, None], shares, 0.0)

    @property
    def inside(self) -> BoolArray:
        """(ny, nx) which places of the grid lie in the workspace."""
        return ~np.isnan(self.location_mm[:, :, 0])

    @property
    def bounds(self) -> Bounds:
        """The arrays as `sims.bounds.fisher.Bounds`."""
        return Bounds(
            location_mm=self.location_mm,
            location_error_mm=self.location_error_mm,
            depth_mm=self.depth_bound_mm,
            depth_error_mm=self.depth_error_mm,
            depth_alone_mm=self.depth_alone_mm,
            depth_alone_error_mm=self.depth_alone_error_mm,
        )

    @property
    def median_location_mm(self) -> Figure:
        """Median location bound over the volume [mm]; infinite where half of it is blind."""
        return median_of(self.location_mm, self.location_error_mm, self.weight)

    @property
    def median_depth_mm(self) -> Figure:
        """Median depth bound over the volume, place unknown [mm]."""
        return median_of(self.depth_bound_mm, self.depth_error_mm, self.weight)

    @property
    def median_depth_alone_mm(self) -> Figure:
        """Median depth bound over the volume, place known [mm]."""
        return median_of(self.depth_alone_mm, self.depth_alone_error_mm, self.weight)

    @property
    def coverage(self) -> Figure:
        """Share of the volume with location and depth bounds below the limits [-]."""
        limits = self.limits
        return share_of(self.bounds, limits.covered_location_mm, limits.covered_depth_mm, self.weight)

    @property
    def dead_share(self) -> Figure:
        """Share of the volume whose location or depth bound is above its limit, blind voxels included [-]."""
        limits = self.limits
        return share_of(self.bounds, limits.dead_location_mm, limits.dead_depth_mm, self.weight).complement()

    @property
    def dead_depth_share(self) -> Figure:
        """Share of the volume whose depth bound, place unknown, is above its limit, blind voxels included [-]."""
        return share_of(self.bounds, np.inf, self.limits.dead_depth_mm, self.weight).complement()

    @property
    def blind_share(self) -> float:
        """Share of the volume where some direction cannot be told [-]."""
        return float(self.weight[self.is_blind].sum())

    @property
    def worst(self) -> Voxel:
        """The voxel with the largest location bound, blind ones first; among blind ones the deepest."""
        rank = np.where(np.isnan(self.location_mm), -np.inf, self.location_mm)
        deepest_first = np.broadcast_to(np.arange(len(self.depth_mm)), rank.shape)
        order = np.lexsort((-deepest_first.ravel(), -rank.ravel()))
        return self.voxel(*(int(k) for k in np.unravel_index(order[0], rank.shape)))

    @property
    def worst_loss(self) -> PartLoss | None:
        """The part whose death costs most: coverage first, then the median location bound."""
        if not self.losses:
            return None
        return min(self.losses, key=lambda loss: (loss.coverage.value, -loss.median_location_mm.value))

    def voxel(self, row: int, column: int, layer: int) -> Voxel:
        """The voxel at indices of y, x and depth."""
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
    """(n,) depths of the bounds [mm]: the wanted ones that a press `step_mm` deeper still reaches, the deepest such."""
    deepest = max(max_depth_mm - step_mm, 0.5 * max_depth_mm)
    inside = [depth for depth in wanted_mm if depth < deepest - 1.5 * step_mm]
    return np.array([*inside, deepest])


def pad_bounds(
    design: SensorDesign,
    *,
    x_mm: FloatArray | None = None,
    y_mm: FloatArray | None = None,
    places: int = 5,
    depths_mm: tuple[float, ...] = COARSE_DEPTHS_MM,
    accuracies: Sequence[str | Accuracy] = BOUND_ACCURACIES,
    seed: int = 0,
    readout: Readout | None = None,
    felt: FeltForce | None = None,
    limits: Limits | None = None,
    steps: Steps | None = None,
    with_losses: bool = True,
    on_step: OnShare | None = None,
) -> PadBounds:
    """Bounds of place and depth over the workspace.

    Parameters
    ----------
    x_mm, y_mm : lines of the grid [mm]; by default ``places`` along the workspace's longer side, at equal pitch
    depths_mm : depths of the voxels; those beyond the range of use are left out, its end is added [mm]
    accuracies : settings of the light, each as `sims.optics.trace` takes it; voxels whose bounds the first leaves
        open are traced again with the next
    seed : of the first half's offsets
    readout : common gain; by default set on the untouched pad, at a trace more
    felt : lightest press felt, passed through to the result
    limits, steps : what counts as covered; offsets of the presses
    with_losses : whether to tell what is lost with each part
    on_step : called with the share that is done

    Raises
    ------
    ModelScopeError : a press that contact or light model does not cover.
    """
    cavity = cavity_of(design)
    steps, limits = steps or Steps(), limits or Limits()
    if x_mm is None or y_mm is None:
        x_mm, y_mm = map_grid_mm(cavity, places)
    readout = readout or own_readout(design, seed=seed)
    max_depth_mm = design.operating.max_depth_mm
    depth_mm = bound_depths_mm(depths_mm, max_depth_mm, steps.depth_mm)
    answers = pad_answers(
        design,
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
        felt=felt,
        limits=limits,
        pairs=pair_names(cavity),
        steps=steps,
        accuracies=tuple(_name_of(accuracy) for accuracy in accuracies),
        seed=seed,
        digest=design.digest,
    )


def _name_of(accuracy: str | Accuracy) -> str:
    """What settings are called in files."""
    if isinstance(accuracy, str):
        return accuracy
    return "score, mirrored light as standard" if accuracy == MIRRORED_FINER else "own settings"


def own_readout(design: SensorDesign, *, seed: int, accuracy: str | Accuracy = "standard") -> Readout:
    """The gain that goes with a design, set on its untouched pad."""
    cavity = cavity_of(design)
    flat = untouched_flux(design, cavity, seed=seed, accuracy=accuracy)
    return readout_of(design, flat, mask_of(judged_pairs(cavity), cavity))


def pair_names(cavity: CavityGeometry) -> tuple[str, ...]:
    """Names of all pairs as E1-R3, emitter outermost."""
    return tuple(f"{e.name}-{r.name}" for e in cavity.emitters for r in cavity.receivers)
