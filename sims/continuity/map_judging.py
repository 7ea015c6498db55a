"""The readings of a map's places, and which of the places are traced again.

map's light, once ──► what is open by the light's own error ──► a second, independent trace
                 │                                └─► finer ones, two each, while it stays open
                 └──► of a draft: what is close to the threshold ──► a finer trace
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.progress import OnShare
from design.spec import SensorDesign
from sims.optics.accuracy import Accuracy
from sims.optics.light_signals import LightSignals
from sims.press.depths import COARSE_STEP_MM, depth_schedule_mm
from sims.readings.readout import Readout
from sims.verdict.pad_map import PadMap, Place, place_of
from sims.verdict.pair.defaults import DEADBAND_THRESHOLD
from sims.verdict.presses import MOST_TRACED_AGAIN, SECOND_SEED, pad_light

CLOSE_UNITS = 1.0
"""Places of a draft whose margin is this near to the threshold are traced again [noise units]: a draft's margins were
off by 0.3 there, enough to hide the deadband in the middle of the paper's pad of 10 mm."""
MOST_CLOSE = 3
"""So many of them, the nearest first."""


def settled_open(
    design: SensorDesign,
    pad_map: PadMap,
    frames: MapFrames,
    doubts: Sequence[Accuracy],
    seed: int,
    on_step: OnShare,
) -> PadMap:
    """The map with its open places judged by two independent traces, and by finer ones while they stay open.

    Parameters
    ----------
    doubts : settings of the light, tried in turn; the first are the map's own
    """
    for settings in doubts:
        doubtful = pad_map.doubtful(MOST_TRACED_AGAIN)
        if not doubtful:
            break
        again = pad_map.open_depths(frames.depth_mm, doubtful)
        for half in (0, 1):
            if half == 0 and settings == doubts[0]:
                continue  # the map itself
            finer = pad_light(
                design,
                frames.places_mm[doubtful],
                frames.depth_mm[again],
                accuracy=settings,
                seed=seed + half * SECOND_SEED,
                on_step=on_step,
            )
            frames.put(half, doubtful, again, finer)
        frames.errors[np.ix_(np.array(doubtful), np.flatnonzero(again))] = 0.0
        pad_map = pad_map.with_places({number: frames.place(design, number) for number in doubtful})
    return pad_map


def settled_close(
    design: SensorDesign,
    pad_map: PadMap,
    frames: MapFrames,
    doubts: Sequence[Accuracy],
    seed: int,
    on_step: OnShare,
) -> PadMap:
    """The map with the places closest to the threshold judged by one finer trace, whose settings are the first."""
    away = [abs(place.margin - DEADBAND_THRESHOLD) for place in pad_map.places]
    close = [number for number in np.argsort(away, kind="stable").tolist() if away[number] <= CLOSE_UNITS]
    close = close[:MOST_CLOSE]
    if not close:
        return pad_map
    places_mm = np.array([[pad_map.places[number].x_mm, pad_map.places[number].y_mm] for number in close])
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, COARSE_STEP_MM)
    light = pad_light(design, places_mm, depth_mm, accuracy=doubts[0], seed=seed, on_step=on_step)
    finer = MapFrames.traced_once(frames.mask, depth_mm, places_mm, light, frames.readout)
    return pad_map.with_places({number: finer.place(design, k) for k, number in enumerate(close)})


@dataclass(frozen=True, kw_only=True)
class MapFrames:
    """The frames of a map's places.

    Attributes
    ----------
    counts : (2, place, depth, pair) unlimited readings of two halves, the same where light was traced once
    errors : (place, depth, pair) standard errors of light traced once; 0 elsewhere [counts]
    """

    mask: BoolArray
    readout: Readout
    places_mm: FloatArray
    depth_mm: FloatArray
    counts: FloatArray
    errors: FloatArray

    @classmethod
    def traced_once(
        cls,
        mask: BoolArray,
        depth_mm: FloatArray,
        places_mm: FloatArray,
        light: LightSignals,
        readout: Readout,
    ) -> MapFrames:
        """From a map's light, whose states run through depths first, and the (emitter, receiver) pairs to judge."""
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

    def put(self, half: int, places: list[int], depths: BoolArray, light: LightSignals) -> None:
        """Replace a half's readings at some places and depths."""
        counts = light.flux[:, self.mask] * self.readout.of_mask(self.mask)
        rows = np.ix_(np.array(places), np.flatnonzero(depths))
        self.counts[half][rows] = counts.reshape(len(places), int(depths.sum()), -1)

    def place(self, design: SensorDesign, number: int) -> Place:
        """One place judged."""
        x_mm, y_mm = self.places_mm[number].tolist()
        return place_of(
            design,
            (x_mm, y_mm),
            self.depth_mm,
            self.counts[:, number],
            self.errors[number],
            self.readout.full_scale_counts,
        )
