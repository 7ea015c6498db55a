"""Bounds at the places of a map: what a score adds to its map of deadbands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from design.spec import SensorDesign
from sims.bounds.defaults import COARSE_DEPTHS_MM, FINE_DEPTHS_MM
from sims.bounds.felt import FeltForce, felt_force
from sims.depths import NEAR_CONTACT_MM
from sims.observability import PadBounds, pad_bounds
from sims.optics.light_signals import LightSignals
from sims.readout import Readout
from sims.verdict.pad_map import PadMap
from sims.verdict.presses import pad_light

NEAR_MM = 0.4
"""Signals begin within this depth where a layout is any good [mm]; there the light is finer than a quick map's."""

NEAR_ACCURACY = "standard"


def map_bounds(
    design: SensorDesign,
    pad_map: PadMap,
    pad_signals: LightSignals,
    readout: Readout,
    *,
    fine: bool,
    seed: int,
    on_step: Callable[[float], None] | None = None,
) -> PadBounds:
    """What all readings together can tell, at the map's places and few depths; the lightest press felt there.

    Parameters
    ----------
    pad_map, pad_signals : the map and the light behind it
    readout : common gain
    fine : more depths
    seed : of the light's offsets
    on_step : called with the share that is done
    """
    return pad_bounds(
        design,
        x_mm=np.array(pad_map.x_mm),
        y_mm=np.array(pad_map.y_mm),
        depths_mm=FINE_DEPTHS_MM if fine else COARSE_DEPTHS_MM,
        seed=seed,
        readout=readout,
        felt=_felt(design, pad_map, pad_signals, readout, seed),
        on_step=on_step,
    )


def _felt(
    design: SensorDesign, pad_map: PadMap, pad_signals: LightSignals, readout: Readout, seed: int
) -> FeltForce:
    """By the map's light deeper than `NEAR_MM`, and finer light up to there, which decides where signals begin."""
    places_mm = np.array([(place.x_mm, place.y_mm) for place in pad_map.places])
    depth_mm = pad_signals.presses[: len(pad_signals.presses) // len(places_mm), 2]
    every_mm = np.unique(np.concatenate([NEAR_CONTACT_MM, depth_mm]))
    near_mm = every_mm[every_mm <= min(NEAR_MM, depth_mm[-1])]
    is_deeper = depth_mm > near_mm[-1]
    near = pad_light(design, places_mm, near_mm, accuracy=NEAR_ACCURACY, seed=seed)
    grid = (len(pad_map.y_mm), len(pad_map.x_mm))
    flux, error = (
        np.concatenate(
            [
                fine.reshape(*grid, len(near_mm), -1),
                coarse.reshape(*grid, len(depth_mm), -1)[:, :, is_deeper],
            ],
            axis=2,
        )
        for fine, coarse in (
            (near.flux, pad_signals.flux),
            (near.standard_error, pad_signals.standard_error),
        )
    )
    merged_mm = np.concatenate([near_mm, depth_mm[is_deeper]])
    return felt_force(design, flux, error, pad_map.x_mm, pad_map.y_mm, merged_mm, readout)
