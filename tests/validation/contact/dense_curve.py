"""A press as a denser curve, so that every tracer reads the same surface.

A press of the contact model is knots with inclinations, and ends where the model's wall was, with a slope. The engine
reads cubics of height over radius between the knots and ends them in a smooth tail; the oracle reads a monotone cubic
through the points alone and ends in a step of the slope. To compare tracers, not readings, both get this curve:
points on cubics through knots and inclinations, and the engine's tail (`optopad.sims.optics.surface.curves.TAIL_MM`) at
the end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from optopad.design.arrays import FloatArray
from optopad.sims.optics.surface.curves import TAIL_MM
from optopad.sims.press import Indentation

POINTS_A_PIECE = 8
TAIL_POINTS = 80


def dense_press(press: Indentation) -> Indentation:
    """The same press by more points, with a tail that ends flat; unchanged where it has no inclinations."""
    if press.inclination_deg is None:
        return press
    angle = np.deg2rad(press.inclination_deg)
    knots = np.column_stack([press.radius_mm, press.height_mm])
    chord = np.hypot(*np.diff(knots, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(chord)])
    curve = CubicHermiteSpline(along, knots, np.column_stack([np.cos(angle), np.sin(angle)]))
    free = int(np.argmax(press.radius_mm > press.contact_radius_mm - 1e-9))
    fine = [
        np.linspace(start, end, POINTS_A_PIECE, endpoint=False)
        for start, end in zip(along[free:-1], along[free + 1 :], strict=True)
    ]
    inside, beyond = knots[:free], curve(np.concatenate(fine))
    points = np.concatenate([inside, beyond, _tail(knots[-1], float(np.tan(angle[-1])))])
    return replace(press, radius_mm=points[:, 0], height_mm=points[:, 1], inclination_deg=None)


def _tail(end: FloatArray, slope: float) -> FloatArray:
    """(n, 2) radius and height from the last point, with its slope, to the undisturbed surface."""
    radius = end[0] + np.linspace(0.0, TAIL_MM, TAIL_POINTS)
    height = CubicHermiteSpline([end[0], end[0] + TAIL_MM], [end[1], 0.0], [slope, 0.0])(radius)
    return np.column_stack([radius, height])
