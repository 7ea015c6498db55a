"""How much of the walls a press has torn loose, and the signals in between.

The paper: elastomer and wall bond and unbond over 5 to 10 s, which shows as hysteresis; it gives no magnitude. Here
a press of depth d unbonds at least the share s d / d_max of all walls, and what is loose heals:

    du/dt = -u / T,   u >= s max(d, 0) / d_max

with s = `noise.wall_unbonded_share` (0 by default) and T = `noise.wall_heal_s`. Signals are (1 - u) times those of
the design's bonded walls plus u times those of walls with an air gap, both from the light model: light adds up over
patches of wall, so this is right for what meets walls once and a first order for the rest.

With a black layer the bottom is silicone cast on silicone and stays. Without one the mold's floor may come loose too;
the light model has no smooth floor, so only the walls are followed there too. Left out: where along the
walls the bond goes, and the change of force and shape.
"""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from design.errors import ModelScopeError
from design.spec import SensorDesign


def unbonded_share(
    depth_mm: FloatArray, time_s: FloatArray, *, deepest_mm: float, share: float, heal_s: float
) -> FloatArray:
    """(n,) share of the walls that is loose at each of a series of samples, whole at the first [-].

    Parameters
    ----------
    depth_mm, time_s : (n,) of the samples, times rising [mm], [s]
    deepest_mm : press that unbonds `share` [mm]
    heal_s : time constant [s]
    """
    forced = share * np.clip(depth_mm / deepest_mm, 0.0, 1.0)
    found = np.empty(len(forced))
    left = 0.0
    kept = np.exp(-np.diff(time_s, prepend=time_s[:1]) / heal_s)
    for k, least in enumerate(forced):
        left = max(left * kept[k], least)
        found[k] = left
    return found


def with_loose_walls(design: SensorDesign) -> SensorDesign:
    """The design with an air gap at all walls.

    Raises
    ------
    ModelScopeError : its walls have one already, so nothing can come loose.
    """
    if design.surfaces.wall_finish == "air_gap":
        raise ModelScopeError(
            "noise.wall_unbonded_share: the walls have an air gap already (surfaces.wall_finish), nothing is left to "
            "come loose; set it to 0, or take a bonded finish"
        )
    return design.with_(**{"surfaces.wall_finish": "air_gap", "surfaces.wall_index": None})


def blended(bonded: FloatArray, loose: FloatArray, share: FloatArray) -> FloatArray:
    """(n, emitter, receiver) flux where a share (n,) of the walls is loose."""
    u = share[:, None, None]
    return np.asarray((1.0 - u) * bonded + u * loose)
