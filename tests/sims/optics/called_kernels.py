"""Kernels that tests call: in the engine they have no entry from Python (`sims.optics.radial.UNSEEN`)."""

from __future__ import annotations

from numba import njit

from sims.optics import radial, rays


def _with_an_entry(kernel):
    return njit(error_model="numpy")(kernel.py_func)


height = _with_an_entry(radial.height)
height_and_turn = _with_an_entry(radial.height_and_turn)
height_turn_bend = _with_an_entry(radial.height_turn_bend)
reach2 = _with_an_entry(radial.reach2)
slope_bound = _with_an_entry(radial.slope_bound)
top_hit = _with_an_entry(rays.top_hit)
is_clear = _with_an_entry(rays.is_clear)
