"""Kernels of the oracle that tests call one by one, compiled once for their sources and kept on disk.

The oracle's own entry points hold these inside; asked from Python, each would be compiled again in every run.
"""

from __future__ import annotations

import sys

from sims.kernels import entry_points
from sims.optics.oracle import march, surface, top
from sims.optics.oracle.tracer import MODULES

_entry = entry_points((*MODULES, sys.modules[__name__]))


def _with_an_entry(kernel):
    return _entry(kernel.py_func)


is_submerged = _with_an_entry(surface.is_submerged)
surface_entry = _with_an_entry(surface.surface_entry)
surface_hit = _with_an_entry(surface.surface_hit)
is_under_sum = _with_an_entry(march.is_under_sum)
summed_height = _with_an_entry(march.summed_height)
summed_hit = _with_an_entry(march.summed_hit)
tip_hit = _with_an_entry(top.tip_hit)


@_entry
def is_in_elastomer(pressed, x, y, z):
    return top.is_in_elastomer(pressed, x, y, z)


@_entry
def top_exit(pressed, x, y, z, dx, dy, dz, limit):
    return top.top_exit(pressed, x, y, z, dx, dy, dz, limit)


@_entry
def top_entry(pressed, x, y, z, dx, dy, dz, limit):
    return top.top_entry(pressed, x, y, z, dx, dy, dz, limit)


@_entry
def tip_met(pressed, x, y, z, dx, dy, dz, limit):
    return top.tip_met(pressed, x, y, z, dx, dy, dz, limit)
