"""The pad as a whole: the depths that one frame resolves at each location of the workspace.

Model
-----
A frame is the readings of all judged pairs, limited at full scale, in noise units u. Two depths a and b are resolved if
their frames are at least 3 noise units apart:

    D²(a, b) = Σ over pairs (u(b) - u(a))²  >=  3².

Depth is not resolved over an interval if no two depths in it are resolved from each other and it is at least 0.3 mm
long; overlapping intervals are merged. An interval is a deadband if depth is resolved again below it. If it extends to
the deepest press, the usable range ends at its start. A single pair has the same deadbands by this rule as in
`optopad.sims.verdict.pair_score`.

The numerical error of the light model adds to the distance. If light is traced twice with different seeds, the two
results A and B are independent, and Σ ΔA ΔB is an unbiased estimate of D². The scatter of the results over n pairs,
σ² = Σ (ΔA - ΔB)² / 4n, gives the standard deviation of that sum, 2 σ √(D² + n σ²). A distance is undecided if its
square is less than two standard deviations from that of the threshold. If light is traced once, D² is at most the sum
of squares, and at least this sum less 2 Σ (s²(a) + s²(b)), where s are the standard errors. The best estimate is then
the sum itself, because most of the error is common to both depths.

Frames are interpolated linearly between the traced depths; windows of 0.3 mm start every 0.02 mm.

A profile (`pad_profile`) applies the same rule depth by depth: it has the largest distance of two frames within 0.3 mm
around each depth, sampled every 0.05 mm. Near both ends of the press the window is moved inward. The profile includes
the numerical error, so the margin of the verdict can be smaller where a second trace has removed this error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.shape.cavity import CavityGeometry, direct_path_pairs
from optopad.design.shape.outline import Outline
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.depth_curve import (
    DEADBAND_MIN_LENGTH_MM,
    DEADBAND_THRESHOLD,
    clipped,
    interpolated,
    noise_units,
    samples_between,
    sigma_counts,
)

Interval = tuple[float, float]

STEPS = 15
"""Number of steps in a window of the shortest deadband length, 0.3 mm."""
SURE = 2.0
"""Number of standard deviations around the threshold within which a squared distance is undecided."""
BOUND = 2.0
"""Multiple of the numerical variance that is subtracted from squared distances if light is traced once, since the
errors of two depths may add."""


@dataclass(frozen=True, kw_only=True)
class Frames:
    """The readings at one location against depth.

    Attributes
    ----------
    depth_mm : (n,) increasing depths from 0 [mm]
    halves : (2, n, pair) readings from two independent traces, limited at full scale [noise units]; equal where light
        was traced once
    variance : (n,) numerical variance, summed over pairs [noise units²]; 0 where light was traced twice
    """

    depth_mm: FloatArray
    halves: FloatArray
    variance: FloatArray


@dataclass(frozen=True, kw_only=True)
class Blindness:
    """The depths at a location that are not resolved.

    Attributes
    ----------
    deadbands_mm : (from, to) of intervals below which depth is resolved again [mm]
    usable_mm : start of the unresolved interval that extends to the deepest press [mm]; the deepest press if none does
    """

    deadbands_mm: tuple[Interval, ...]
    usable_mm: float


@dataclass(frozen=True, kw_only=True)
class DepthReading:
    """Which depths the frames at one location resolve, and how certain this is.

    Attributes
    ----------
    blind : unresolved depths by the best estimate of the distances
    least, most : shortest and longest unresolved depths that the numerical error allows
    margin, margin_error : largest distance of two frames within the least resolved 0.3 mm of the usable range, and its
        possible numerical error [noise units]
    margin_mm : (from, to) of the least resolved 0.3 mm [mm]
    open_mm : (from, to) of windows that the numerical error leaves undecided, in order of depth [mm]; they may overlap
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
        """Whether the numerical error decides if there is a deadband."""
        return bool(self.least.deadbands_mm) != bool(self.most.deadbands_mm)

    @property
    def usable_range_mm(self) -> Interval:
        """Smallest and largest usable depth within the numerical error [mm]."""
        return self.most.usable_mm, self.least.usable_mm


def read_depths(
    frames: Frames, *, threshold: float = DEADBAND_THRESHOLD, min_length_mm: float = DEADBAND_MIN_LENGTH_MM
) -> DepthReading:
    """Find the depths that the frames at a location resolve.

    Parameters
    ----------
    frames : frames at the location
    threshold : distance at which two depths are resolved [noise units]
    min_length_mm : shortest unresolved interval that counts [mm]
    """
    deepest = float(frames.depth_mm[-1])
    step = min(min_length_mm, deepest) / STEPS
    starts = np.arange(0.0, deepest - STEPS * step + 0.5 * step, step)
    grid_mm = np.asarray(step * np.arange(len(starts) + STEPS), dtype=np.float64)
    low, mean, high = _widest_squares(frames, grid_mm)
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


def _widest_squares(frames: Frames, at_mm: FloatArray) -> FloatArray:
    """(3, start) largest squared distance of two frames within each window: smallest, best estimate, largest possible.

    Parameters
    ----------
    at_mm : depths of the frames; a window is `STEPS` of their steps [mm]
    """
    one, two = (interpolated(frames.depth_mm, half, at_mm) for half in frames.halves)
    once = interpolated(frames.depth_mm, frames.variance[:, None], at_mm)[:, 0]
    pairs, count = one.shape[1], len(at_mm) - STEPS
    widest = np.full((3, count), -np.inf)
    for lag in range(1, STEPS + 1):
        moved, moved_too = one[lag:] - one[:-lag], two[lag:] - two[:-lag]
        square = np.einsum("ij,ij->i", moved, moved_too)
        apart = 0.5 * (moved - moved_too)
        sigma2 = np.einsum("ij,ij->i", apart, apart) / pairs
        deviation = SURE * 2.0 * np.sqrt(sigma2 * (np.maximum(square, 0.0) + pairs * sigma2))
        doubt = BOUND * (once[lag:] + once[:-lag])
        squares = np.stack([square - doubt - deviation, square, square + deviation])
        windows = np.lib.stride_tricks.sliding_window_view(squares, STEPS + 1 - lag, axis=1)[:, :count]
        np.maximum(widest, windows.max(axis=2), out=widest)
    return widest


def _blindness(starts: FloatArray, length: float, is_blind: BoolArray, deepest: float) -> Blindness:
    """Deadbands and usable depth, from the starts of the windows in which depth is not resolved."""
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
    """One press location of the map, with the depths that are resolved there.

    Attributes
    ----------
    x_mm, y_mm : press centre in the coordinate system of the cavity [mm]
    depths : the depths that are resolved there, and how certain this is
    answering_pairs : number of judged pairs whose reading changes by 3 noise units or more over the whole press
    """

    x_mm: float
    y_mm: float
    depths: DepthReading
    answering_pairs: int

    @property
    def deadbands_mm(self) -> tuple[Interval, ...]:
        """(from, to) of intervals without resolution below which depth is resolved again [mm]."""
        return self.depths.blind.deadbands_mm

    @property
    def deadband_total_mm(self) -> float:
        """Summed length of the deadbands [mm]."""
        return sum(end - start for start, end in self.deadbands_mm)

    @property
    def usable_mm(self) -> float:
        """Depth from which depth is no longer resolved, or the deepest press [mm]."""
        return self.depths.blind.usable_mm

    @property
    def margin(self) -> float:
        """Distance of frames over the least resolved 0.3 mm of the usable range [noise units]; below 3: a deadband."""
        return self.depths.margin

    def is_blind(self, depth_mm: float) -> bool:
        """Whether a depth is in a deadband, or beyond the usable depth."""
        return depth_mm > self.usable_mm or any(start <= depth_mm <= end for start, end in self.deadbands_mm)


@dataclass(frozen=True, kw_only=True)
class PadMap:
    """Judged locations: all points of a rectangular grid that are in the workspace.

    Attributes
    ----------
    x_mm, y_mm : (nx,) and (ny,) coordinates of the grid [mm]
    places : locations, one row of the grid after the other, in increasing y; a rectangular workspace has ny rows of nx
    """

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    places: tuple[Place, ...]

    @property
    def worst(self) -> Place:
        """The location with the most deadband; if several have it, the first."""
        return max(self.places, key=lambda place: place.deadband_total_mm)

    @property
    def weakest(self) -> Place:
        """The location with the most deadband; if several have it, that with least usable depth, then least margin."""
        return min(
            self.places, key=lambda place: (-place.deadband_total_mm, round(place.usable_mm, 6), place.margin)
        )

    @property
    def usable_depth_mm(self) -> float:
        """Least usable depth of any location [mm]."""
        return min(place.usable_mm for place in self.places)

    @property
    def usable_range_mm(self) -> Interval:
        """Smallest and largest usable depth of the pad within the numerical error of the light model [mm]."""
        least, most = zip(*(place.depths.usable_range_mm for place in self.places), strict=True)
        return min(least), min(most)

    @property
    def is_open(self) -> bool:
        """Whether the numerical error of the light model leaves the pad's verdict undecided."""
        sure = any(place.depths.least.deadbands_mm for place in self.places)
        return not sure and any(place.depths.most.deadbands_mm for place in self.places)

    def doubtful(self, most: int) -> list[int]:
        """Indices of at most `most` locations that the numerical error leaves undecided, the least margin first."""
        found = [number for number, place in enumerate(self.places) if place.depths.open_mm]
        return sorted(found, key=lambda number: self.places[number].margin)[:most]

    def open_depths(self, depth_mm: FloatArray, places: list[int]) -> BoolArray:
        """(depth,) whether each traced depth is in an undecided window at any of the given locations."""
        found = np.zeros(len(depth_mm), dtype=np.bool_)
        for number in places:
            for start_mm, end_mm in self.places[number].depths.open_mm:
                found[samples_between(depth_mm, start_mm, end_mm)] = True
        return found

    def with_places(self, found: Mapping[int, Place]) -> PadMap:
        """The map with the given locations, by index, replaced."""
        return replace(self, places=tuple(found.get(n, place) for n, place in enumerate(self.places)))

    @property
    def dead_share(self) -> float:
        """Share of locations with a deadband [-]."""
        return sum(bool(place.deadbands_mm) for place in self.places) / len(self.places)

    @property
    def cells(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of each location in the grid; the row is the index in y, the column the index in x."""
        return tuple(
            (_nearest(self.y_mm, place.y_mm), _nearest(self.x_mm, place.x_mm)) for place in self.places
        )

    def grid(self, of_places: Sequence[float] | FloatArray) -> FloatArray:
        """(ny, nx, ...) grid of the values of all locations (place, ...); NaN outside the workspace."""
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
    place_mm: tuple[float, float],
    depth_mm: FloatArray,
    counts: FloatArray,
    errors: FloatArray,
    readout: Readout,
    *,
    threshold: float = DEADBAND_THRESHOLD,
) -> Place:
    """Judge one location: find the depths that its readings resolve.

    Parameters
    ----------
    place_mm : (x, y) of the location [mm]
    depth_mm : (depth,) traced depths [mm]
    counts : (2, depth, pair) counts of all judged pairs from two independent traces, or one trace given twice; not
        clipped
    errors : (depth, pair) standard errors [counts]; 0 where there are two traces
    threshold : distance at which two depths are resolved [noise units]
    """
    noise, full_scale = readout.noise, readout.full_scale_counts
    knots_mm, readings = clipped(depth_mm, np.concatenate(list(counts), axis=1), full_scale)
    units = noise_units(readings, **noise).reshape(len(knots_mm), 2, -1).swapaxes(0, 1)
    once = np.where(counts[0] < full_scale, errors / sigma_counts(counts[0], **noise), 0.0)
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
    """x and y coordinates of a grid over the workspace [mm], with nearly the same pitch in both directions.

    The longer side has `places` coordinates. Both numbers are odd, so the grid includes the centre lines.
    """
    space = cavity.workspace
    spans = (space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm)
    pitch = max(spans) / (places - 1) if max(spans) > 0 else 1.0
    return (
        _lines(space.x0_mm, spans[0], pitch),
        _lines(space.y0_mm, spans[1], pitch),
    )


def grid_inside(workspace: Outline, x_mm: FloatArray, y_mm: FloatArray) -> BoolArray:
    """(ny, nx) whether each point of a grid is in the workspace; points outside only by rounding count as inside."""
    return workspace.contains(x_mm[None, :], y_mm[:, None], 1e-6)


def grid_places_mm(workspace: Outline, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """(place, 2) press centres of a grid in the workspace, row by row in increasing y [mm].

    Points outside only by rounding are moved to the edge of the workspace.
    """
    inside = grid_inside(workspace, x_mm, y_mm)
    return np.array([workspace.clamped(float(x_mm[k]), float(y_mm[n])) for n, k in np.argwhere(inside)])


def on_grid(of_places: FloatArray, inside: BoolArray) -> FloatArray:
    """(ny, nx, ...) grid from values (place, ...) in the order of `grid_places_mm`; NaN outside the workspace."""
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
    """Resolution of a pad at each depth and location.

    Attributes
    ----------
    depth_mm : (depth,) increasing depths [mm]
    change : (depth, place) largest distance of two frames within 0.3 mm around the depth [noise units]; None if the
        light is not available
    is_dead : (depth, place) whether the depth is in a deadband of the location, or beyond its usable depth
    """

    depth_mm: FloatArray
    change: FloatArray | None
    is_dead: BoolArray


def pad_profile(
    cavity: CavityGeometry,
    pad_map: PadMap,
    light: LightSignals | None,
    readout: Readout | None,
    depth_mm: FloatArray,
) -> PadProfile:
    """Resolution of a pad at each depth and location.

    Parameters
    ----------
    light, readout : light of the map's presses (all depths of the first location, then the next), and gains. If either
        is None, the result's `change` is None
    depth_mm : (depth,) depths of the profile if light or gains are None [mm]; otherwise the light's depths are used
    """
    change = None
    if light is not None and readout is not None:
        places = len(pad_map.places)
        depth_mm = np.asarray(light.presses).reshape(places, -1, 3)[0, :, 2]
        mask = direct_path_pairs(cavity)
        counts = (light.flux[:, mask] * readout.of_mask(mask)).reshape(places, len(depth_mm), -1)
        change = np.stack([_change(depth_mm, readings, readout) for readings in counts], axis=1)
    dead = np.array([[place.is_blind(float(depth)) for place in pad_map.places] for depth in depth_mm])
    return PadProfile(depth_mm=depth_mm, change=change, is_dead=dead)


def _change(depth_mm: FloatArray, counts: FloatArray, readout: Readout) -> FloatArray:
    """(depth,) largest distance of two frames within 0.3 mm around each depth, at one location [noise units].

    `counts` are (depth, pair) readings before clipping.
    """
    knots_mm, readings = clipped(depth_mm, counts, readout.full_scale_counts)
    units = noise_units(readings, **readout.noise)
    length = min(DEADBAND_MIN_LENGTH_MM, float(depth_mm[-1]))
    first = np.clip(depth_mm - length / 2, depth_mm[0], depth_mm[-1] - length)
    steps = round(length / READ_EVERY_MM) + 1
    windows = np.stack(
        [interpolated(knots_mm, units, first + share * length) for share in np.linspace(0.0, 1.0, steps)]
    )
    apart = windows[:, None] - windows[None, :]
    found: FloatArray = np.sqrt((apart**2).sum(axis=-1)).max(axis=(0, 1))
    return found
