"""Kernels of the oracle that tests call one by one, compiled once for their sources and kept on disk.

The oracle's own entry points hold these inside; asked from Python, each would be compiled again in every run.
"""

from __future__ import annotations

import sys

from optopad.sims.kernels import entry_points
from tests.oracle import surface
from tests.oracle.tracer import MODULES

_entry = entry_points((*MODULES, sys.modules[__name__]))


is_in_elastomer = _entry(surface.is_in_elastomer.py_func)
top_height = _entry(surface.top_height.py_func)


@_entry
def top_hit(top, side, x, y, z, dx, dy, dz, limit):
    return surface.top_hit(top, side, (x, y, z, dx, dy, dz), limit)


@_entry
def top_exit(top, x, y, z, dx, dy, dz, limit):
    return surface.top_hit(top, surface.INSIDE, (x, y, z, dx, dy, dz), limit)


@_entry
def top_entry(top, x, y, z, dx, dy, dz, limit):
    return surface.top_hit(top, surface.OUTSIDE, (x, y, z, dx, dy, dz), limit)


@_entry
def tip_hit(top, x, y, z, dx, dy, dz, limit):
    return surface.tip_hit(top, (x, y, z, dx, dy, dz), limit)
