"""The pad as a whole: at every place of the workspace, the depths where no judged pair answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from design.geometry.cavity import CavityGeometry, Workspace
from sims.verdict.pair.trace_noise import TightWindow, samples_between

FloatArray = NDArray[np.float64]
Interval = tuple[float, float]

COARSE_PLACES = 5
FINE_PLACES = 11


@dataclass(frozen=True, kw_only=True)
class Place:
    """One press place of the map.

    Attributes
    ----------
    x_mm, y_mm : press centre in the cavity frame
    deadbands_mm : depth intervals in which no judged pair changes by the threshold
    answering_pairs : judged pairs that change by the threshold or more over the whole press
    largest_change : largest change of any judged pair over the whole press [noise units]
    margin : change of the most responsive pair over the least responsive 0.3 mm [noise units]; below 3 is a deadband
    tightest : the 0.3 mm in which the light trace's own error comes nearest to hiding a deadband
    open_mm : depth intervals, in order, in which it may hide one; they may overlap
    """

    x_mm: float
    y_mm: float
    deadbands_mm: tuple[Interval, ...]
    answering_pairs: int
    largest_change: float
    margin: float
    tightest: TightWindow
    open_mm: tuple[Interval, ...] = ()

    @property
    def deadband_total_mm(self) -> float:
        """Summed length of the deadbands [mm]."""
        return sum(end - start for start, end in self.deadbands_mm)


@dataclass(frozen=True, kw_only=True)
class PadMap:
    """All places of a rectangular grid over the workspace.

    Attributes
    ----------
    x_mm : (nx,) and y_mm : (ny,) grid lines [mm]
    places : ny rows of nx places, y outermost
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
        """The place nearest to a deadband, or deepest in one."""
        return min(self.places, key=lambda place: (-place.deadband_total_mm, place.margin))

    @property
    def most_doubtful(self) -> Place:
        """The place where the light trace's error comes nearest to hiding a deadband."""
        return min(self.places, key=lambda place: place.tightest.spare)

    @property
    def is_open(self) -> bool:
        """Whether no place has a deadband, but the light trace's own error may hide one."""
        return self.dead_share == 0.0 and self.most_doubtful.tightest.spare < 0.0

    @property
    def doubtful(self) -> list[int]:
        """Numbers of the places that leave the verdict open; none where a deadband settles it."""
        if not self.is_open:
            return []
        return [number for number, place in enumerate(self.places) if place.tightest.spare < 0.0]

    def open_depths(self, depth_mm: FloatArray) -> NDArray[np.bool_]:
        """(depth,) which of the traced depths the doubtful places are in doubt by."""
        found = np.zeros(len(depth_mm), dtype=np.bool_)
        for number in self.doubtful:
            for start_mm, end_mm in self.places[number].open_mm:
                found[samples_between(depth_mm, start_mm, end_mm)] = True
        return found

    def with_places(self, found: Mapping[int, Place]) -> PadMap:
        """The map with some places, by number, judged anew."""
        return replace(self, places=tuple(found.get(n, place) for n, place in enumerate(self.places)))

    @property
    def dead_share(self) -> float:
        """Share of places with a deadband [-]."""
        return sum(bool(place.deadbands_mm) for place in self.places) / len(self.places)

    def deadband_grid_mm(self) -> FloatArray:
        """(ny, nx) summed deadband at each place [mm]."""
        totals = [place.deadband_total_mm for place in self.places]
        return np.array(totals).reshape(len(self.y_mm), len(self.x_mm))


def map_grid_mm(cavity: CavityGeometry, places: int) -> tuple[FloatArray, FloatArray]:
    """Grid lines over the workspace: ``places`` along its longer side, the same pitch along the other [mm]."""
    space = cavity.workspace
    spans = (space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm)
    pitch = max(spans) / (places - 1) if max(spans) > 0 else 1.0
    return (
        _lines(space.x0_mm, spans[0], pitch),
        _lines(space.y0_mm, spans[1], pitch),
    )


def grid_places_mm(workspace: Workspace, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """(ny*nx, 2) press centres of a grid, y outermost, clamped to the workspace against round-off [mm]."""
    return np.array([workspace.clamped(float(x), float(y)) for y in y_mm for x in x_mm])


def _lines(start_mm: float, span_mm: float, pitch_mm: float) -> FloatArray:
    count = round(span_mm / pitch_mm) + 1
    if count < 2:
        return np.array([start_mm + span_mm / 2])
    return np.linspace(start_mm, start_mm + span_mm, count)
