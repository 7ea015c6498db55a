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
from sims.verdict.presses import MAP_ACCURACY, pad_light


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
    """By the map's light, and that of the depths near contact which a coarse map leaves out."""
    places_mm = np.array([(place.x_mm, place.y_mm) for place in pad_map.places])
    depth_mm = pad_signals.presses[: len(pad_signals.presses) // len(places_mm), 2]
    light, depths = [pad_signals], [depth_mm]
    left_out = np.array([near for near in NEAR_CONTACT_MM if near < depth_mm[-1] and near not in depth_mm])
    if left_out.size:
        light.append(pad_light(design, places_mm, left_out, accuracy=MAP_ACCURACY, seed=seed))
        depths.append(left_out)
    order = np.argsort(np.concatenate(depths))
    shapes = [(len(pad_map.y_mm), len(pad_map.x_mm), len(depth), -1) for depth in depths]
    flux, error = (
        np.concatenate(
            [values.reshape(shape) for values, shape in zip(of_light, shapes, strict=True)], axis=2
        )[:, :, order]
        for of_light in ([part.flux for part in light], [part.standard_error for part in light])
    )
    merged_mm = np.concatenate(depths)[order]
    return felt_force(design, flux, error, pad_map.x_mm, pad_map.y_mm, merged_mm, readout)
