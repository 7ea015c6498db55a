"""Bounds at the places of a map: what a score adds to its map of deadbands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from design.spec import SensorDesign
from sims.bounds.defaults import COARSE_DEPTHS_MM, FINE_DEPTHS_MM
from sims.bounds.felt import FeltForce, felt_force
from sims.bounds.observability import PadBounds, pad_bounds
from sims.optics.light_signals import LightSignals
from sims.readings.readout import Readout
from sims.verdict.pad_map import PadMap


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
        felt=map_felt(design, pad_map, pad_signals, readout),
        on_step=on_step,
    )


def map_felt(design: SensorDesign, pad_map: PadMap, pad_signals: LightSignals, readout: Readout) -> FeltForce:
    """The lightest press felt at a map's places, by the map's light."""
    depth_mm = pad_signals.presses[: len(pad_signals.presses) // len(pad_map.places), 2]
    flux, error = (
        pad_map.grid(light.reshape(len(pad_map.places), len(depth_mm), -1))
        for light in (pad_signals.flux, pad_signals.error_of_changes)
    )
    return felt_force(design, flux, error, pad_map.x_mm, pad_map.y_mm, depth_mm, readout)
