"""Maps of the pad as data for the page: one value per location and depth, its colour, and its meaning.

The module also draws the maps at a few depths side by side, for print and for browsers without scripts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
from matplotlib.patches import Patch

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.shape.cavity import CavityGeometry
from optopad.report.scenes.pair_scene import plan_of
from optopad.sims.plots.maps import HATCH, add_scale, draw_map, map_sheet
from optopad.sims.plots.style import INK
from optopad.sims.verdict.depth_curve import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD
from optopad.sims.verdict.pad_map import PadMap, PadProfile

CHANGE = ("#f2f6f9", "#9cc9e6", "#0072b2", "#002e4a")
DEAD = ("#eef1f4", "#c24e00")
IN_DEADBAND = "in a deadband: no pair resolves depth"
LEAST_CHANGE = 0.5
"""Limit below which all changes have the lightest colour [noise units]."""


@dataclass(frozen=True, kw_only=True)
class DepthMap:
    """Map of one quantity over locations and depths.

    Attributes
    ----------
    key, title, unit : short name, title, unit
    tells : meaning of the quantity, in a sentence or two
    depth_mm : (depth,) depths [mm]; a single NaN if the quantity does not depend on depth
    values : (depth, location) values; NaN where there is none
    is_hatched : (depth, location) whether to hatch a location; locations without a value are always hatched
    hatched : meaning of a hatched location
    ends : (depth, location, 2) limits of each value, and their meaning; None if not known
    absent : text for a missing value
    colours : colours from the low to the high end of the scale
    low, high : ends of the scale; values beyond an end have its colour
    is_logarithmic : whether the scale of colours is logarithmic
    digits : number of digits after the decimal point
    names : words that the page shows instead of the values 0, 1, ...; empty for numbers
    limit : a note about the scale
    """

    key: str
    title: str
    unit: str
    tells: str
    depth_mm: FloatArray
    values: FloatArray
    is_hatched: BoolArray
    hatched: str
    absent: str
    colours: Sequence[str]
    low: float
    high: float
    is_logarithmic: bool = False
    digits: int = 2
    names: tuple[str, ...] = ()
    limit: str = ""
    ends: FloatArray | None = None
    ends_of: str = ""

    def data(self) -> dict[str, Any]:
        """The map as data for the page's script."""
        finite = self.values[np.isfinite(self.values)]
        return {
            "key": self.key,
            "title": self.title,
            "unit": self.unit,
            "tells": self.tells,
            "depth": [_number(depth) for depth in self.depth_mm],
            "values": [[_number(value) for value in row] for row in self.values],
            "dead": self.is_hatched.astype(int).tolist(),
            "hatched": self.hatched,
            "ends": None
            if self.ends is None
            else [[[_number(end) for end in ends] for ends in row] for row in self.ends],
            "endsOf": self.ends_of,
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
    """All maps of a pad on one grid of depths and locations."""

    cavity: CavityGeometry
    tip_mm: float
    pad_map: PadMap
    profile: PadProfile
    maps: tuple[DepthMap, ...]

    @property
    def pitch_mm(self) -> float:
        """Side of a cell, for a grid that has only one line of locations [mm]."""
        return _pitch_mm(self.pad_map)

    def data(self) -> dict[str, Any]:
        """The maps as data for the page's script; `cells` holds the grid's row and column of each location."""
        pad, deepest = self.pad_map, float(self.profile.depth_mm[-1])
        weakest = pad.places.index(pad.weakest)
        dead = pad.weakest.deadbands_mm
        at_mm = 0.5 * sum(dead[0]) if dead else 0.4 * deepest
        return {
            "x": [round(value, 4) for value in pad.x_mm],
            "y": [round(value, 4) for value in pad.y_mm],
            "cells": [list(cell) for cell in pad.cells],
            "pitch": self.pitch_mm,
            "deepest": deepest,
            "first": weakest,
            "at": at_mm,
            "plan": plan_of(self.cavity, self.tip_mm),
            "bands": [[list(span) for span in place.deadbands_mm] for place in pad.places],
            "maps": [one.data() for one in self.maps],
        }


def depth_maps(profile: PadProfile) -> list[DepthMap]:
    """Maps by depth of the signals' change and of the dead zones, as the verdict defines them."""
    found = [_dead_zones(profile)]
    if profile.change is not None:
        found.insert(0, _change(profile, profile.change))
    return found


def _change(profile: PadProfile, change: FloatArray) -> DepthMap:
    return DepthMap(
        key="change",
        title="Change of the signals",
        unit="sigma",
        tells=(
            f"Change of all readings of a frame over {DEADBAND_MIN_LENGTH_MM:g} mm of depth around this "
            f"one. Below {DEADBAND_THRESHOLD:g} sigma depth is not resolved."
        ),
        depth_mm=profile.depth_mm,
        values=change,
        is_hatched=profile.is_dead,
        hatched=IN_DEADBAND,
        absent="not computed",
        colours=CHANGE,
        low=LEAST_CHANGE,
        high=max(float(change.max()), 4 * DEADBAND_THRESHOLD),
        is_logarithmic=True,
        digits=1,
        limit=f"below {DEADBAND_THRESHOLD:g} not resolved",
    )


def _dead_zones(profile: PadProfile) -> DepthMap:
    return DepthMap(
        key="dead",
        title="Dead zones",
        unit="",
        tells="Locations where all readings of a frame together do not resolve depth: a deadband, or "
        "beyond the range.",
        depth_mm=profile.depth_mm,
        values=profile.is_dead.astype(np.float64),
        is_hatched=profile.is_dead,
        hatched=IN_DEADBAND,
        absent="not computed",
        colours=DEAD,
        low=0.0,
        high=1.0,
        names=("depth is resolved", "not resolved"),
    )


def _pitch_mm(pad: PadMap) -> float:
    for lines in (pad.x_mm, pad.y_mm):
        if len(lines) > 1:
            return round(lines[1] - lines[0], 6)
    return 4.0


def _number(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None


MOST = 6
"""Largest number of depths that are drawn side by side."""
PANEL_IN = 1.45
"""Width of the map at one depth [inch]."""


def plot_by_depth(scene: MapScene, one: DepthMap) -> Axes:
    """Draw one quantity at up to six depths, with a common colour scale; returns the axes of the first depth."""
    chosen, pad = _chosen(one), scene.pad_map
    depths = [one.depth_mm[layer] for layer in chosen]
    titles = [f"{depth:.2f} mm" if np.isfinite(depth) else one.title for depth in depths]
    figure, panels = map_sheet(scene.cavity, titles, PANEL_IN)
    colours = LinearSegmentedColormap.from_list(one.key, list(one.colours))
    scale = (LogNorm if one.is_logarithmic else Normalize)(one.low, one.high)
    for layer, ax in zip(chosen, panels, strict=True):
        values = pad.grid(one.values[layer].clip(one.low, one.high))
        is_hatched = pad.grid(one.is_hatched[layer] | ~np.isfinite(one.values[layer])) == 1.0
        draw_map(
            ax,
            scene.cavity,
            (pad.x_mm, pad.y_mm),
            values,
            colours,
            scale,
            hatched=is_hatched,
            is_numbered=False,
        )
        ax.set_axis_off()
    if not one.names:
        add_scale(figure, panels, f"{one.title.lower()} [{one.unit}]", colours, scale)
    key = Patch(facecolor="white", edgecolor=INK, hatch=HATCH, label=one.hatched, linewidth=0.5)
    figure.legend(handles=[key], loc="outside lower left")
    return panels[0]


def _chosen(one: DepthMap) -> list[int]:
    """Indices of the depths to draw: evenly spread, with the deepest included."""
    count = len(one.depth_mm)
    if count <= MOST:
        return list(range(count))
    wanted = np.linspace(one.depth_mm[0], one.depth_mm[-1], MOST + 1)[1:]
    return sorted({int(np.abs(one.depth_mm - depth).argmin()) for depth in wanted})
