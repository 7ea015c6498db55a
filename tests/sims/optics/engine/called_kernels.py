"""Kernels that tests call: in the engine they have no entry from Python (`optopad.sims.optics.surface.radial.UNSEEN`).

Compiled once for their sources and kept on disk, as the engine's own entry points are.
"""

from __future__ import annotations

import sys

import numpy as np

from optopad.sims.kernels import entry_points
from optopad.sims.optics.engine import mirrored
from optopad.sims.optics.engine import straight as rays
from optopad.sims.optics.engine.compiled import KERNEL_MODULES
from optopad.sims.optics.surface import radial
from optopad.sims.optics.surface import tops as top
from optopad.sims.optics.surface.tops import surface_height

entry = entry_points((*KERNEL_MODULES, sys.modules[__name__]), error_model="numpy")


def _with_an_entry(kernel):
    return entry(kernel.py_func)


height = _with_an_entry(radial.height)
height_and_slope = _with_an_entry(radial.height_and_slope)
height_slope_curvature = _with_an_entry(radial.height_slope_curvature)
reach2 = _with_an_entry(radial.reach2)
slope_bound = _with_an_entry(radial.slope_bound)
top_hit = _with_an_entry(rays.top_hit)
height_at = _with_an_entry(top.surface_height)
gradient_at = _with_an_entry(top.surface_gradient)
bend_at = _with_an_entry(top.surface_bend)
is_clear = _with_an_entry(rays.is_clear)
may_be_shaded = _with_an_entry(mirrored._may_be_shaded)


@entry
def first_chord(x, y, z, dx, dy, dz, length, step, pressed):
    """First and last of evenly spaced places on a ray's first stretch above the top; -1 if there is none."""
    first = -1.0
    for k in range(int(np.floor(length / step)) + 1):
        t = k * step
        is_above = surface_height(x + t * dx, y + t * dy, pressed) < z + t * dz
        if is_above and first < 0.0:
            first = t
        if first >= 0.0 and not is_above:
            return first, t - step
    return first, length
