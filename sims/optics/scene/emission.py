"""Angular patterns as tables over the cosine: grid, power, and the power laws.

A pattern is the radiance over power and area L(c) [1/sr] of a flat patch at the cosines
`np.linspace(0, 1, n)`, linear between. Its power into the half space is 2 pi int_0^1 c L(c) dc, here
integrated exactly: a cell of width h from node a to node b adds h / 6 (c_a (2 L_a + L_b) + c_b (L_a + 2 L_b)).

A sheet's table of the intensity I over the angle becomes L(c) = I / c at every node but c = 0. That node gets the
value, 0 or more, with which the first cell holds the sheet's power there: the limit where I vanishes at 90 degrees, and
a bounded value where a sheet shows light at 90 degrees, which a flat face cannot emit. The pattern is then scaled to
unit power. It is taken as it stands in the elastomer, as a half angle is: how a package shines into air, sheets say;
refraction at its face is left out (a Lambertian source behind a flat face stays one but for Fresnel losses).
"""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from design.errors import InputError
from design.parts.angular import AngularTable

COSINE_NODES = 129
GRAZING_NODES = 32


def cosine_nodes(count: int = COSINE_NODES) -> FloatArray:
    """(count,) cosines from 0, grazing, to 1, along the normal [-]."""
    return np.linspace(0.0, 1.0, count)


def pattern_power(radiance: FloatArray) -> FloatArray:
    """(...,) power of (..., n) patterns: 1 where they are normalised [-]."""
    c = cosine_nodes(np.shape(radiance)[-1])
    low, high = radiance[..., :-1], radiance[..., 1:]
    cells = c[:-1] * (2 * low + high) + c[1:] * (low + 2 * high)
    return np.asarray(2 * np.pi * np.sum(cells, axis=-1) * (c[1] - c[0]) / 6)


def normalised_pattern(radiance: FloatArray) -> FloatArray:
    """(..., n) patterns of unit power from patterns of any.

    Raises
    ------
    InputError : a pattern without power, or with a negative or undefined value.
    """
    values = np.asarray(radiance, dtype=np.float64)
    power = pattern_power(values)
    if not (np.isfinite(values).all() and (values >= 0).all() and (power > 0).all()):
        raise InputError("pattern: must be finite, not negative, and above 0 somewhere; correct its table")
    return values / power[..., None]


def lambertian_pattern(order: float, count: int = COSINE_NODES) -> FloatArray:
    """(count,) pattern of the intensity c^order, order 1 or more; exact at order 1 and 2, else to the table's step.

    Raises
    ------
    InputError : an order below 1, whose radiance has no bound at grazing angles.
    """
    if not 1.0 <= order < np.inf:
        raise InputError(f"order: {order:g}, a table needs 1 or more; give emitter_order instead")
    return normalised_pattern(cosine_nodes(count) ** (order - 1.0))


def table_pattern(table: AngularTable, count: int = COSINE_NODES) -> FloatArray:
    """(count,) pattern of unit power of a sheet's intensity over the angle, at the cosine's nodes."""
    c = cosine_nodes(count)
    radiance = np.zeros(count)
    radiance[1:] = table.at(np.degrees(np.arccos(c[1:]))) / c[1:]
    within, weights = np.polynomial.legendre.leggauss(GRAZING_NODES)
    grazing = c[1] * (within + 1) / 2
    power = c[1] / 2 * np.sum(weights * table.at(np.degrees(np.arccos(grazing))))
    radiance[0] = max(0.0, 6 * power / c[1] ** 2 - 2 * radiance[1])
    return normalised_pattern(radiance)
