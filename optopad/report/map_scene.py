"""Maps over the pad as data for the page: one value a place and depth, how it is coloured, and what it means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.cavity import CavityGeometry, cavity_of
from design.spec import SensorDesign
from optopad.report.pair_scene import plan_of
from sims.verdict.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD
from sims.verdict.pad_map import PadMap
from sims.verdict.pad_profile import PadProfile, pad_profile
from sims.verdict.result import ContinuityScore

FloatArray = NDArray[np.float64]

CHANGE = ("#f2f6f9", "#9cc9e6", "#0072b2", "#002e4a")
DEAD = ("#eef1f4", "#c24e00")
FORCE = ("#f7f4ef", "#f2b98a", "#c24e00", "#5c2200")
LEAST_CHANGE = 0.5
"""Smaller changes share the lightest colour [noise units]."""
BOUND = ("#00343f", "#00785a", "#8fc7a2", "#f6f2d8", "#f2b98a", "#a33f00")


@dataclass(frozen=True, kw_only=True)
class DepthMap:
    """One quantity over the pad and depth.

    Attributes
    ----------
    key, title, unit : short name, title, unit
    tells : what it means, a sentence or two
    values : (depth, place); NaN where there is none
    absent : the word for none
    colours : from the low to the high end of the scale
    low, high : ends of the scale; values beyond take the colour of the end
    is_logarithmic : scale
    digits : after the point
    names : words in place of numbers 0, 1 ...
    limit : what to note about the scale
    """

    key: str
    title: str
    unit: str
    tells: str
    values: FloatArray
    absent: str
    colours: Sequence[str]
    low: float
    high: float
    is_logarithmic: bool = False
    digits: int = 2
    names: tuple[str, ...] = ()
    limit: str = ""

    def data(self) -> dict[str, Any]:
        """For the page's script."""
        finite = self.values[np.isfinite(self.values)]
        return {
            "key": self.key,
            "title": self.title,
            "unit": self.unit,
            "tells": self.tells,
            "values": [[_number(value) for value in row] for row in self.values],
            "absent": self.absent,
            "colours": list(self.colours),
            "low": _number(self.low),
            "high": _number(self.high),
            "log": self.is_logarithmic,
            "digits": self.digits,
            "names": list(self.names) or None,
            "limit": self.limit or None,
            "more": bool(finite.size and finite.max() > self.high * 1.005),
        }


@dataclass(frozen=True, kw_only=True)
class MapScene:
    """All maps of a pad on one grid of depths and places."""

    cavity: CavityGeometry
    tip_mm: float
    pad_map: PadMap
    profile: PadProfile
    maps: tuple[DepthMap, ...]

    def data(self) -> dict[str, Any]:
        """For the page's script."""
        depth, pad = self.profile.depth_mm, self.pad_map
        weakest = pad.places.index(pad.weakest)
        dead = pad.weakest.deadbands_mm
        at_mm = 0.5 * sum(dead[0]) if dead else 0.4 * float(depth[-1])
        return {
            "x": [round(value, 4) for value in pad.x_mm],
            "y": [round(value, 4) for value in pad.y_mm],
            "pitch": _pitch_mm(pad),
            "depth": [round(float(value), 4) for value in depth],
            "first": weakest,
            "at": int(np.abs(depth - at_mm).argmin()),
            "plan": plan_of(self.cavity, self.tip_mm),
            "dead": self.profile.is_dead.astype(int).tolist(),
            "bands": [[list(span) for span in place.deadbands_mm] for place in pad.places],
            "maps": [one.data() for one in self.maps],
        }


def map_scene(design: SensorDesign, score: ContinuityScore) -> MapScene | None:
    """The maps that a score has data for; None without a pad map."""
    if score.pad_map is None or not score.pairs:
        return None
    depth_mm = score.pairs[0].curves.depth_mm
    profile = pad_profile(design, score.pad_map, score.pad_signals, score.readout, depth_mm)
    return MapScene(
        cavity=cavity_of(design),
        tip_mm=design.indenter.tip_radius_mm,
        pad_map=score.pad_map,
        profile=profile,
        maps=tuple(_maps(profile)),
    )


def _maps(profile: PadProfile) -> list[DepthMap]:
    found = [_dead_zones(profile)]
    if profile.change is not None:
        found.insert(0, _change(profile.change))
    return found


def _change(change: FloatArray) -> DepthMap:
    return DepthMap(
        key="change",
        title="Change of the signals",
        unit="noise units",
        tells=(
            f"Change of the most responsive pair over {DEADBAND_MIN_LENGTH_MM:g} mm of depth around this one. "
            f"Below {DEADBAND_THRESHOLD:g} noise units depth cannot be told there: a deadband."
        ),
        values=change,
        absent="not computed",
        colours=CHANGE,
        low=LEAST_CHANGE,
        high=max(float(change.max()), 4 * DEADBAND_THRESHOLD),
        is_logarithmic=True,
        digits=1,
        limit=f"below {DEADBAND_THRESHOLD:g} is a deadband",
    )


def _dead_zones(profile: PadProfile) -> DepthMap:
    return DepthMap(
        key="dead",
        title="Dead zones",
        unit="",
        tells="Places where no judged pair answers at this depth, all pairs taken together.",
        values=profile.is_dead.astype(np.float64),
        absent="not computed",
        colours=DEAD,
        low=0.0,
        high=1.0,
        names=("some pair answers", "deadband"),
    )


def _pitch_mm(pad: PadMap) -> float:
    for lines in (pad.x_mm, pad.y_mm):
        if len(lines) > 1:
            return round(lines[1] - lines[0], 6)
    return 4.0


def _number(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None
