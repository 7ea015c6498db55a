"""The pad as a whole: at every location of the workspace, the depths that all judged readings of a frame resolve.

Depth from one frame of all judged readings at a location: resolved, deadband, end of the range.

Model
-----
A frame is the readings of all judged pairs, limited at full scale, on the scale of noise units u. Two depths are
resolved if their frames are at least 3 noise units apart,

    D²(a, b) = Σ over pairs (u(b) - u(a))²  >=  3².

Depth is not resolved over an interval of at least 0.3 mm in which no two depths are resolved; overlapping intervals
are merged. If the signal comes back below, it is a deadband; if it runs to the deepest press (fade), the usable range
ends there. With one pair this is the pair's own deadband (`pair.deadbands`).

The numerical error would count as distance. Light traced twice with other random offsets gives independent halves A
and B, and Σ ΔA ΔB has the mean D²: errors average out. The halves' scatter, σ² = Σ (ΔA - ΔB)² / 4n over n pairs, gives
the standard deviation of that sum, 2 σ √(D² + n σ²); less than two of them from the threshold is open. Where light was
traced once, D² is between the sum of squares and that less 2 Σ (s²(a) + s²(b)), with its standard errors s: those of
two depths may add, though with common offsets they mostly cancel, so the sum itself is the best estimate.

Between the depths traced, frames are on straight lines; windows start every 0.02 mm.

Resolution of the pad at each depth of each location: the verdict's own rule, depth by depth.

The verdict tests whether a location has 0.3 mm of depth in which no two frames are 3 noise units apart
(`read_depths`). Here the largest distance of two frames is given for the 0.3 mm centred on each depth, and moved
inward at both ends of the press, read every 0.05 mm. The numerical error is included: where the verdict removes it by
a second trace, its margin can be smaller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.shape.cavity import CavityGeometry, cavity_of, direct_path_pairs
from design.shape.outline import Outline
from design.spec import SensorDesign
from sims.optics.light_signals import LightSignals
from sims.readings.readout import Readout
from sims.verdict.depth_curve import (
    DEADBAND_MIN_LENGTH_MM,
    DEADBAND_THRESHOLD,
    clipped,
    interpolated,
    noise_of,
    noise_units,
    samples_between,
    sigma_counts,
)

Interval = tuple[float, float]

STEPS = 15
"""Number of steps in a window of 0.3 mm."""
SURE = 2.0
"""Standard deviations from the threshold beyond which a distance is no longer open."""
BOUND = 2.0
"""Most trace variances subtracted from distances of light traced once: errors of two depths may add or cancel."""


@dataclass(frozen=True, kw_only=True)
class Frames:
    """The readings at a location against depth.

    Attributes
    ----------
    depth_mm : (n,) increasing depths from 0 [mm]
    halves : (2, n, pair) readings by independent traces, limited at full scale; twice the same where traced once
        [noise units]
    variance : (n,) variance of the trace, summed over pairs, where it was traced once; 0 elsewhere
    """

    depth_mm: FloatArray
    halves: FloatArray
    variance: FloatArray


@dataclass(frozen=True, kw_only=True)
class Blindness:
    """The depths that are not resolved at a location.

    Attributes
    ----------
    deadbands_mm : intervals after which the signal comes back [mm]
    usable_mm : start of the interval that runs to the deepest press, else the deepest press [mm]
    """

    deadbands_mm: tuple[Interval, ...]
    usable_mm: float


@dataclass(frozen=True, kw_only=True)
class DepthReading:
    """The resolution of depth by a location's frames.

    Attributes
    ----------
    blind : intervals by the best estimate of the distances
    least, most : the shortest and longest intervals that the numerical error allows
    margin, margin_error : distance of the most distant frames in the least resolved 0.3 mm before the range ends, and
        its possible numerical error [noise units]
    margin_mm : depths of that window [mm]
    open_mm : depths, in order, of windows that the numerical error leaves open; they may overlap [mm]
    """

    blind: Blindness
    least: Blindness
    most: Blindness
    margin: float
    margin_error: float
    margin_mm: Interval
    open_mm: tuple[Interval, ...]

    @property
    def is_open(self) -> bool:
        """Whether the numerical error may make or hide a deadband."""
        return bool(self.least.deadbands_mm) != bool(self.most.deadbands_mm)

    @property
    def usable_range_mm(self) -> Interval:
        """Least and most depth that may be usable [mm]."""
        return self.most.usable_mm, self.least.usable_mm


def read_depths(
    frames: Frames, *, threshold: float = DEADBAND_THRESHOLD, min_length_mm: float = DEADBAND_MIN_LENGTH_MM
) -> DepthReading:
    """Judge a location.

    Parameters
    ----------
    frames : frames at the location, to a deepest press of at least the shortest deadband
    threshold : distance at which two depths are resolved [noise units]
    min_length_mm : shortest interval that counts [mm]
    """
    deepest = float(frames.depth_mm[-1])
    step = min(min_length_mm, deepest) / STEPS
    starts = np.arange(0.0, deepest - STEPS * step + 0.5 * step, step)
    grid_mm = np.asarray(step * np.arange(len(starts) + STEPS), dtype=np.float64)
    low, mean, high = (_widest(distances) for distances in _square_distances(frames, grid_mm))
    limit = threshold**2
    blind, least, most = (
        _blindness(starts, STEPS * step, squares < limit, deepest) for squares in (mean, high, low)
    )
    told = starts < max(blind.usable_mm, step)
    at = int(np.argmin(np.where(told, mean, np.inf)))
    margin = float(np.sqrt(max(mean[at], 0.0)))
    is_open = (low < limit) & (high >= limit)
    return DepthReading(
        blind=blind,
        least=least,
        most=most,
        margin=margin,
        margin_error=float(np.sqrt(max(high[at], 0.0))) - margin,
        margin_mm=(float(starts[at]), float(starts[at] + STEPS * step)),
        open_mm=tuple((float(a), float(a + STEPS * step)) for a in starts[is_open]),
    )


def _square_distances(frames: Frames, at_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m, m) squared distances of the frames at some depths: at least, best estimate, at most."""
    one, two = (interpolated(frames.depth_mm, half, at_mm) for half in frames.halves)
    once = interpolated(frames.depth_mm, frames.variance[:, None], at_mm)[:, 0]
    pairs = one.shape[1]
    square = _from_products(one @ two.T)
    apart = 0.5 * (one - two)
    sigma2 = np.maximum(_from_products(apart @ apart.T), 0.0) / pairs
    deviation = 2.0 * np.sqrt(sigma2 * (np.maximum(square, 0.0) + pairs * sigma2))
    doubt = once[:, None] + once[None, :]
    return square - BOUND * doubt - SURE * deviation, square, square + SURE * deviation


def _from_products(products: FloatArray) -> FloatArray:
    """(m, m) products of differences a(j) - a(i) with b(j) - b(i), from those of a(i) with b(j)."""
    own = np.diag(products)
    return np.asarray(own[:, None] + own[None, :] - products - products.T)


def _widest(square: FloatArray) -> FloatArray:
    """(start,) largest squared distance of two frames within each window."""
    count = len(square) - STEPS
    widest = np.full(count, -np.inf)
    for lag in range(1, STEPS + 1):
        apart = np.diagonal(square, lag)
        windows = np.lib.stride_tricks.sliding_window_view(apart, STEPS + 1 - lag)[:count]
        widest = np.maximum(widest, windows.max(axis=1))
    return widest


def _blindness(starts: FloatArray, length: float, is_blind: BoolArray, deepest: float) -> Blindness:
    """Deadbands and usable depth, from the windows in which depth is not resolved."""
    merged: list[list[float]] = []
    for start in starts[is_blind]:
        if merged and start <= merged[-1][1] + 1e-9:
            merged[-1][1] = float(start + length)
        else:
            merged.append([float(start), float(start + length)])
    usable = deepest
    if merged and is_blind[-1]:
        usable = merged.pop()[0]
    return Blindness(deadbands_mm=tuple((a, b) for a, b in merged), usable_mm=usable)


COARSE_PLACES = 5
FINE_PLACES = 11


@dataclass(frozen=True, kw_only=True)
class Place:
    """One press location of the map.

    Attributes
    ----------
    x_mm, y_mm : press centre in the cavity frame
    depths : the resolution of depth by its frames
    answering_pairs : number of judged pairs that change by the threshold or more over the whole press
    """

    x_mm: float
    y_mm: float
    depths: DepthReading
    answering_pairs: int

    @property
    def deadbands_mm(self) -> tuple[Interval, ...]:
        """Intervals over which depth is not resolved, and after which it is resolved again [mm]."""
        return self.depths.blind.deadbands_mm

    @property
    def deadband_total_mm(self) -> float:
        """Summed length of the deadbands [mm]."""
        return sum(end - start for start, end in self.deadbands_mm)

    @property
    def usable_mm(self) -> float:
        """Depth from which on depth is not resolved any more, or the deepest press [mm]."""
        return self.depths.blind.usable_mm

    @property
    def margin(self) -> float:
        """Distance of frames over the least resolved 0.3 mm before the range ends [noise units]; below 3: deadband."""
        return self.depths.margin

    def is_blind(self, depth_mm: float) -> bool:
        """Whether a depth is in a deadband, or beyond the usable depth."""
        return depth_mm > self.usable_mm or any(start <= depth_mm <= end for start, end in self.deadbands_mm)


@dataclass(frozen=True, kw_only=True)
class PadMap:
    """All locations of a rectangular grid that are in the workspace.

    Attributes
    ----------
    x_mm : (nx,) and y_mm : (ny,) grid lines [mm]
    places : locations of the grid in the workspace, y outermost; in a rectangle ny rows of nx
    """

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    places: tuple[Place, ...]

    @property
    def worst(self) -> Place:
        """The location with the most deadband; the first one of equals."""
        return max(self.places, key=lambda place: place.deadband_total_mm)

    @property
    def weakest(self) -> Place:
        """The location with the most deadband, then the least usable depth, then the least margin."""
        return min(
            self.places, key=lambda place: (-place.deadband_total_mm, round(place.usable_mm, 6), place.margin)
        )

    @property
    def usable_depth_mm(self) -> float:
        """Least usable depth of any location [mm]."""
        return min(place.usable_mm for place in self.places)

    @property
    def usable_range_mm(self) -> Interval:
        """Usable depth at least and at most, by the numerical error of the light model [mm]."""
        least, most = zip(*(place.depths.usable_range_mm for place in self.places), strict=True)
        return min(least), min(most)

    @property
    def is_open(self) -> bool:
        """Whether the numerical error of the light model may make or hide every deadband."""
        sure = any(place.depths.least.deadbands_mm for place in self.places)
        return not sure and any(place.depths.most.deadbands_mm for place in self.places)

    def doubtful(self, most: int) -> list[int]:
        """Numbers of the locations that the numerical error leaves open, the least margin first."""
        found = [number for number, place in enumerate(self.places) if place.depths.open_mm]
        return sorted(found, key=lambda number: self.places[number].margin)[:most]

    def open_depths(self, depth_mm: FloatArray, places: list[int]) -> BoolArray:
        """(depth,) which of the traced depths leave some locations open."""
        found = np.zeros(len(depth_mm), dtype=np.bool_)
        for number in places:
            for start_mm, end_mm in self.places[number].depths.open_mm:
                found[samples_between(depth_mm, start_mm, end_mm)] = True
        return found

    def with_places(self, found: Mapping[int, Place]) -> PadMap:
        """The map with some locations, by number, judged anew."""
        return replace(self, places=tuple(found.get(n, place) for n, place in enumerate(self.places)))

    @property
    def dead_share(self) -> float:
        """Share of locations with a deadband [-]."""
        return sum(bool(place.deadbands_mm) for place in self.places) / len(self.places)

    @property
    def cells(self) -> tuple[tuple[int, int], ...]:
        """Row and column of each location in the grid."""
        return tuple(
            (_nearest(self.y_mm, place.y_mm), _nearest(self.x_mm, place.x_mm)) for place in self.places
        )

    def grid(self, of_places: Sequence[float] | FloatArray) -> FloatArray:
        """(ny, nx, ...) from values of every location, (place, ...); NaN outside the workspace."""
        values = np.asarray(of_places, dtype=np.float64)
        inside = np.zeros((len(self.y_mm), len(self.x_mm)), dtype=np.bool_)
        inside[tuple(np.array(self.cells).T)] = True
        return on_grid(values, inside)

    def deadband_grid_mm(self) -> FloatArray:
        """(ny, nx) summed deadband at each location [mm]."""
        return self.grid([place.deadband_total_mm for place in self.places])

    def usable_grid_mm(self) -> FloatArray:
        """(ny, nx) usable depth at each location [mm]."""
        return self.grid([place.usable_mm for place in self.places])


def place_of(
    design: SensorDesign,
    place_mm: tuple[float, float],
    depth_mm: FloatArray,
    counts: FloatArray,
    errors: FloatArray,
    full_scale_counts: float,
    *,
    threshold: float = DEADBAND_THRESHOLD,
) -> Place:
    """Judge one location.

    Parameters
    ----------
    counts : (2, depth, pair) unlimited counts of all judged pairs by independent traces, or twice by one
    errors : (depth, pair) standard errors where there is one trace, else 0 [counts]
    threshold : distance at which two depths are resolved [noise units]
    """
    noise = noise_of(design)
    knots_mm, readings = clipped(depth_mm, np.concatenate(list(counts), axis=1), full_scale_counts)
    units = noise_units(readings, **noise).reshape(len(knots_mm), 2, -1).swapaxes(0, 1)
    once = np.where(counts[0] < full_scale_counts, errors / sigma_counts(counts[0], **noise), 0.0)
    frames = Frames(
        depth_mm=knots_mm,
        halves=units,
        variance=interpolated(depth_mm, (once**2).sum(axis=1, keepdims=True), knots_mm)[:, 0],
    )
    change = np.ptp(units.mean(axis=0), axis=0)
    return Place(
        x_mm=place_mm[0],
        y_mm=place_mm[1],
        depths=read_depths(frames, threshold=threshold),
        answering_pairs=int((change >= DEADBAND_THRESHOLD).sum()),
    )


def map_grid_mm(cavity: CavityGeometry, places: int) -> tuple[FloatArray, FloatArray]:
    """Grid lines over the workspace: ``places`` along its longer side, at nearly the same pitch along the other [mm].

    Both numbers are odd, so that the lines through the middle are among them.
    """
    space = cavity.workspace
    spans = (space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm)
    pitch = max(spans) / (places - 1) if max(spans) > 0 else 1.0
    return (
        _lines(space.x0_mm, spans[0], pitch),
        _lines(space.y0_mm, spans[1], pitch),
    )


def grid_inside(workspace: Outline, x_mm: FloatArray, y_mm: FloatArray) -> BoolArray:
    """(ny, nx) which crossings of a grid's lines are press centres; round-off counts as inside."""
    return workspace.contains(x_mm[None, :], y_mm[:, None], 1e-6)


def grid_places_mm(workspace: Outline, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """(place, 2) press centres of a grid, y outermost, clamped to the workspace against round-off [mm]."""
    inside = grid_inside(workspace, x_mm, y_mm)
    return np.array([workspace.clamped(float(x_mm[k]), float(y_mm[n])) for n, k in np.argwhere(inside)])


def on_grid(of_places: FloatArray, inside: BoolArray) -> FloatArray:
    """(ny, nx, ...) from (place, ...) in the order of `grid_places_mm`; NaN outside."""
    found = np.full((*inside.shape, *of_places.shape[1:]), np.nan)
    found[inside] = of_places
    return found


def _nearest(lines: tuple[float, ...], value: float) -> int:
    return min(range(len(lines)), key=lambda number: abs(lines[number] - value))


def _lines(start_mm: float, span_mm: float, pitch_mm: float) -> FloatArray:
    count = round(span_mm / pitch_mm) + 1
    if count < 2:
        return np.array([start_mm + span_mm / 2])
    count += 1 - count % 2  # odd, so that the middle of the pad is a location
    return np.linspace(start_mm, start_mm + span_mm, count)


READ_EVERY_MM = 0.05


@dataclass(frozen=True, kw_only=True)
class PadProfile:
    """The pad against depth.

    Attributes
    ----------
    depth_mm : (depth,) increasing [mm]
    change : (depth, place) largest distance of two frames within 0.3 mm around the depth [noise units]; None where the
        light of the locations is not available
    is_dead : (depth, place) whether the depth is in a deadband of the location, or beyond its usable depth
    """

    depth_mm: FloatArray
    change: FloatArray | None
    is_dead: BoolArray


def pad_profile(
    design: SensorDesign,
    pad_map: PadMap,
    light: LightSignals | None,
    readout: Readout | None,
    depth_mm: FloatArray,
) -> PadProfile:
    """The pad against depth.

    Parameters
    ----------
    light, readout : of the map's presses, locations outermost; None leaves the change out
    depth_mm : (depth,) depths of the profile [mm]; some of the light's own where there is light
    """
    change = None
    if light is not None and readout is not None:
        places = len(pad_map.places)
        depth_mm = np.asarray(light.presses).reshape(places, -1, 3)[0, :, 2]
        mask = direct_path_pairs(cavity_of(design))
        counts = (light.flux[:, mask] * readout.of_mask(mask)).reshape(places, len(depth_mm), -1)
        change = np.stack(
            [_change(design, depth_mm, readings, readout.full_scale_counts) for readings in counts], axis=1
        )
    dead = np.array([[place.is_blind(float(depth)) for place in pad_map.places] for depth in depth_mm])
    return PadProfile(depth_mm=depth_mm, change=change, is_dead=dead)


def _change(
    design: SensorDesign, depth_mm: FloatArray, counts: FloatArray, full_scale_counts: float
) -> FloatArray:
    """(depth,) change at one location, from the unlimited counts (depth, pair)."""
    knots_mm, readings = clipped(depth_mm, counts, full_scale_counts)
    units = noise_units(readings, **noise_of(design))
    length = min(DEADBAND_MIN_LENGTH_MM, float(depth_mm[-1]))
    first = np.clip(depth_mm - length / 2, depth_mm[0], depth_mm[-1] - length)
    steps = round(length / READ_EVERY_MM) + 1
    windows = np.stack(
        [interpolated(knots_mm, units, first + share * length) for share in np.linspace(0.0, 1.0, steps)]
    )
    apart = windows[:, None] - windows[None, :]
    found: FloatArray = np.sqrt((apart**2).sum(axis=-1)).max(axis=(0, 1))
    return found
