"""The map of the pad, judged: what all readings of a frame tell of depth at each place.

places of the workspace ──► light, once ──► what is open by the light's own error ──► a second, independent trace
                                                                 └─► finer ones, two each, while it stays open
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.geometry.cavity import CavityGeometry
from design.geometry.pairs import direct_path_pairs
from design.spec import SensorDesign
from sims.optics.accuracy import ACCURACIES, Accuracy
from sims.optics.light_signals import LightSignals
from sims.press.depths import COARSE_STEP_MM, STEP_MM
from sims.readings.readout import Readout
from sims.verdict.builds import noise_of
from sims.verdict.frame_depths import Frames, read_depths
from sims.verdict.pad_map import COARSE_PLACES, FINE_PLACES, PadMap, Place, grid_places_mm, map_grid_mm
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD
from sims.verdict.pair.depth_curve import clipped, interpolated
from sims.verdict.pair.noise_units import noise_units, sigma_counts
from sims.verdict.presses import (
    DOUBT_ACCURACIES,
    MAP_ACCURACY,
    MOST_TRACED_AGAIN,
    SECOND_SEED,
    map_depths_mm,
    map_light,
    pad_light,
)

FloatArray = NDArray[np.float64]
OnStep = Callable[[str, float], None]


def judged_map(
    design: SensorDesign,
    cavity: CavityGeometry,
    readout: Readout,
    *,
    fine: bool,
    full: bool,
    seed: int,
    tell: OnStep,
) -> tuple[PadMap, LightSignals]:
    """The map, and the light it was traced with; places that this leaves open are judged by more light (`_settled`)."""
    places, step_mm = (FINE_PLACES, STEP_MM) if fine or full else (COARSE_PLACES, COARSE_STEP_MM)
    x_mm, y_mm = map_grid_mm(cavity, places)
    depth_mm = map_depths_mm(design.operating.max_depth_mm, step_mm)
    places_mm = grid_places_mm(cavity.workspace, x_mm, y_mm)
    accuracy = ACCURACIES["standard"] if fine else MAP_ACCURACY
    light = map_light(
        design, places_mm, depth_mm, accuracy=accuracy, seed=seed, on_step=lambda s: tell("map", s)
    )
    frames = MapFrames.traced_once(cavity, depth_mm, places_mm, light, readout)
    pad_map = PadMap(
        x_mm=tuple(x_mm.tolist()),
        y_mm=tuple(y_mm.tolist()),
        places=tuple(frames.place(design, number) for number in range(len(places_mm))),
    )
    return _settled(design, pad_map, frames, accuracy, seed, tell), light


def places_judged(
    design: SensorDesign,
    cavity: CavityGeometry,
    readout: Readout,
    places_mm: FloatArray,
    depth_mm: FloatArray,
    light: LightSignals,
) -> tuple[Place, ...]:
    """Places judged by light that was traced once.

    Parameters
    ----------
    places_mm : (place, 2); depth_mm : (depth,)
    light : of all of them, depths innermost
    """
    frames = MapFrames.traced_once(cavity, depth_mm, places_mm, light, readout)
    return tuple(frames.place(design, number) for number in range(len(places_mm)))


def _settled(
    design: SensorDesign, pad_map: PadMap, frames: MapFrames, accuracy: Accuracy, seed: int, tell: OnStep
) -> PadMap:
    """The map with its open places judged by two independent traces, and by finer ones while they stay open."""
    for settings in (accuracy, *DOUBT_ACCURACIES):
        doubtful = pad_map.doubtful(MOST_TRACED_AGAIN)
        if not doubtful:
            break
        again = pad_map.open_depths(frames.depth_mm, doubtful)
        for half in (0, 1):
            if half == 0 and settings == accuracy:
                continue  # the map itself
            finer = pad_light(
                design,
                frames.places_mm[doubtful],
                frames.depth_mm[again],
                accuracy=settings,
                seed=seed + half * SECOND_SEED,
                on_step=lambda s: tell("open places", s),
            )
            frames.put(half, doubtful, again, finer)
        frames.errors[np.ix_(np.array(doubtful), np.flatnonzero(again))] = 0.0
        pad_map = pad_map.with_places({number: frames.place(design, number) for number in doubtful})
    return pad_map


@dataclass(frozen=True, kw_only=True)
class MapFrames:
    """The frames of a map's places.

    Attributes
    ----------
    counts : (2, place, depth, pair) unlimited readings of two halves, the same where light was traced once
    errors : (place, depth, pair) standard errors of light traced once; 0 elsewhere [counts]
    """

    mask: NDArray[np.bool_]
    readout: Readout
    places_mm: FloatArray
    depth_mm: FloatArray
    counts: FloatArray
    errors: FloatArray

    @classmethod
    def traced_once(
        cls,
        cavity: CavityGeometry,
        depth_mm: FloatArray,
        places_mm: FloatArray,
        light: LightSignals,
        readout: Readout,
    ) -> MapFrames:
        """From a map's light, whose states run through depths first."""
        mask = direct_path_pairs(cavity)
        shape = (len(places_mm), len(depth_mm), -1)
        counts, errors = (
            (values[:, mask] * readout.of_mask(mask)).reshape(shape)
            for values in (light.flux, light.error_of_changes)
        )
        return cls(
            mask=mask,
            readout=readout,
            places_mm=places_mm,
            depth_mm=depth_mm,
            counts=np.stack([counts, counts]),
            errors=errors,
        )

    def put(self, half: int, places: list[int], depths: NDArray[np.bool_], light: LightSignals) -> None:
        """Replace a half's readings at some places and depths."""
        counts = light.flux[:, self.mask] * self.readout.of_mask(self.mask)
        rows = np.ix_(np.array(places), np.flatnonzero(depths))
        self.counts[half][rows] = counts.reshape(len(places), int(depths.sum()), -1)

    def place(self, design: SensorDesign, number: int) -> Place:
        """One place judged."""
        return pad_place(
            design,
            self.places_mm[number],
            self.depth_mm,
            self.counts[:, number],
            self.errors[number],
            self.readout.full_scale_counts,
        )


def pad_place(
    design: SensorDesign,
    place_mm: FloatArray,
    depth_mm: FloatArray,
    counts: FloatArray,
    errors: FloatArray,
    full_scale_counts: float,
) -> Place:
    """Judge one place.

    Parameters
    ----------
    counts : (2, depth, pair) unlimited counts of all judged pairs by independent traces, or twice by one
    errors : (depth, pair) standard errors where there is one trace, else 0 [counts]
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
        x_mm=float(place_mm[0]),
        y_mm=float(place_mm[1]),
        depths=read_depths(frames),
        answering_pairs=int((change >= DEADBAND_THRESHOLD).sum()),
    )
