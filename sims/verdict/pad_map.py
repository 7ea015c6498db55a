"""The pad as a whole: at every place of the workspace, what all judged readings of a frame tell of depth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.shape.cavity import CavityGeometry
from design.shape.outline import Outline
from design.spec import SensorDesign
from sims.verdict.frame_depths import DepthReading, Frames, Interval, read_depths
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD
from sims.verdict.pair.depth_curve import clipped, interpolated
from sims.verdict.pair.noise_units import noise_of, noise_units, sigma_counts
from sims.verdict.pair.trace_noise import samples_between

COARSE_PLACES = 5
FINE_PLACES = 11


@dataclass(frozen=True, kw_only=True)
class Place:
    """One press place of the map.

    Attributes
    ----------
    x_mm, y_mm : press centre in the cavity frame
    depths : what its frames tell of depth
    answering_pairs : judged pairs that change by the threshold or more over the whole press
    """

    x_mm: float
    y_mm: float
    depths: DepthReading
    answering_pairs: int

    @property
    def deadbands_mm(self) -> tuple[Interval, ...]:
        """Depth intervals over which depth cannot be told, and after which it can again [mm]."""
        return self.depths.blind.deadbands_mm

    @property
    def deadband_total_mm(self) -> float:
        """Summed length of the deadbands [mm]."""
        return sum(end - start for start, end in self.deadbands_mm)

    @property
    def usable_mm(self) -> float:
        """Depth from which on depth cannot be told any more, or the deepest press [mm]."""
        return self.depths.blind.usable_mm

    @property
    def margin(self) -> float:
        """Distance of frames over the least told 0.3 mm before the range ends [noise units]; below 3 is blind."""
        return self.depths.margin

    def is_blind(self, depth_mm: float) -> bool:
        """Whether a depth lies in a deadband, or beyond the usable depth."""
        return depth_mm > self.usable_mm or any(start <= depth_mm <= end for start, end in self.deadbands_mm)


@dataclass(frozen=True, kw_only=True)
class PadMap:
    """All places of a rectangular grid that lie in the workspace.

    Attributes
    ----------
    x_mm : (nx,) and y_mm : (ny,) grid lines [mm]
    places : those of the grid in the workspace, y outermost; in a rectangle ny rows of nx
    """

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    places: tuple[Place, ...]

    @property
    def worst(self) -> Place:
        """The place with the most deadband; ties go to the first."""
        return max(self.places, key=lambda place: place.deadband_total_mm)

    @property
    def weakest(self) -> Place:
        """The place deepest in a deadband, else with the least usable depth, else nearest to being blind."""
        return min(
            self.places, key=lambda place: (-place.deadband_total_mm, round(place.usable_mm, 6), place.margin)
        )

    @property
    def usable_depth_mm(self) -> float:
        """Least usable depth of any place [mm]."""
        return min(place.usable_mm for place in self.places)

    @property
    def usable_range_mm(self) -> Interval:
        """Between what depths the light trace's own error leaves that [mm]."""
        least, most = zip(*(place.depths.usable_range_mm for place in self.places), strict=True)
        return min(least), min(most)

    @property
    def is_open(self) -> bool:
        """Whether the light trace's own error may make or hide every deadband there is."""
        sure = any(place.depths.least.deadbands_mm for place in self.places)
        return not sure and any(place.depths.most.deadbands_mm for place in self.places)

    def doubtful(self, most: int) -> list[int]:
        """Numbers of the places that the light trace's error leaves open, the nearest to being blind first."""
        found = [number for number, place in enumerate(self.places) if place.depths.open_mm]
        return sorted(found, key=lambda number: self.places[number].margin)[:most]

    def open_depths(self, depth_mm: FloatArray, places: list[int]) -> BoolArray:
        """(depth,) which of the traced depths some places are in doubt by."""
        found = np.zeros(len(depth_mm), dtype=np.bool_)
        for number in places:
            for start_mm, end_mm in self.places[number].depths.open_mm:
                found[samples_between(depth_mm, start_mm, end_mm)] = True
        return found

    def with_places(self, found: Mapping[int, Place]) -> PadMap:
        """The map with some places, by number, judged anew."""
        return replace(self, places=tuple(found.get(n, place) for n, place in enumerate(self.places)))

    @property
    def dead_share(self) -> float:
        """Share of places with a deadband [-]."""
        return sum(bool(place.deadbands_mm) for place in self.places) / len(self.places)

    @property
    def cells(self) -> tuple[tuple[int, int], ...]:
        """Row and column of each place in the grid."""
        return tuple(
            (_nearest(self.y_mm, place.y_mm), _nearest(self.x_mm, place.x_mm)) for place in self.places
        )

    def grid(self, of_places: Sequence[float] | FloatArray) -> FloatArray:
        """(ny, nx, ...) what is known of every place, (place, ...); NaN outside the workspace."""
        values = np.asarray(of_places, dtype=np.float64)
        inside = np.zeros((len(self.y_mm), len(self.x_mm)), dtype=np.bool_)
        inside[tuple(np.array(self.cells).T)] = True
        return on_grid(values, inside)

    def deadband_grid_mm(self) -> FloatArray:
        """(ny, nx) summed deadband at each place [mm]."""
        return self.grid([place.deadband_total_mm for place in self.places])

    def usable_grid_mm(self) -> FloatArray:
        """(ny, nx) usable depth at each place [mm]."""
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
    """Judge one place.

    Parameters
    ----------
    counts : (2, depth, pair) unlimited counts of all judged pairs by independent traces, or twice by one
    errors : (depth, pair) standard errors where there is one trace, else 0 [counts]
    threshold : distance at which two depths are told apart [noise units]
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
    """Grid lines over the workspace: ``places`` along its longer side, nearly the same pitch along the other [mm].

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
    count += 1 - count % 2  # odd, so that the middle of the pad is a place
    return np.linspace(start_mm, start_mm + span_mm, count)
