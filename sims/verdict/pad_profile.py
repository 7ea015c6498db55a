"""What the pad tells at each depth of each place: the verdict's own rule, depth by depth.

The verdict asks of a place whether some 0.3 mm of depth pass in which no two frames are 3 noise units apart
(`frame_depths`). Here the largest distance of two frames is given for the 0.3 mm centred on each depth, and moved
inward at both ends of the press, read every 0.05 mm. The light's own error is in it: where the verdict takes that out
by a second trace, its margin can be smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.shape.cavity import cavity_of
from design.shape.pairs import direct_path_pairs
from design.spec import SensorDesign
from sims.optics.light_signals import LightSignals
from sims.readings.readout import Readout
from sims.verdict.pad_map import PadMap
from sims.verdict.pair.defaults import DEADBAND_MIN_LENGTH_MM
from sims.verdict.pair.depth_curve import clipped, interpolated
from sims.verdict.pair.noise_units import noise_of, noise_units

READ_EVERY_MM = 0.05


@dataclass(frozen=True, kw_only=True)
class PadProfile:
    """The pad against depth.

    Attributes
    ----------
    depth_mm : (depth,) increasing [mm]
    change : (depth, place) largest distance of two frames within 0.3 mm around the depth [noise units]; None where the
        light of the places is not at hand
    is_dead : (depth, place) whether the depth lies in a deadband of the place, or beyond its usable depth
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
    light, readout : of the map's presses, places outermost; None leaves the change out
    depth_mm : (depth,) depths to tell of [mm]; of the light's own where there is light
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
    """(depth,) of one place, from the unlimited counts (depth, pair)."""
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
