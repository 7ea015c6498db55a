"""A rigid tip on a bonded elastic layer in linear elasticity, as an integral equation: the tests' closed form.

The layer is bonded to a rigid base and has no wall; strains are small; contact is frictionless. With
E* = E / (1 - nu²), pressure and height under the tip are joined by the layer's compliance Y, which is 1 for
a half-space (Johnson, Contact Mechanics, 1985; Lebedev and Ufliand, 1958; Dimitriadis et al., 2002):

    Y(x) = ((3 - 4 nu) sinh x cosh x - x) / ((3 - 4 nu) cosh² x + (1 - 2 nu)² + x²)

Sneddon's function θ solves, for a tip f(r) at depth d with contact radius a,

    θ(t) = d - t ∫ f'(r) / sqrt(t² - r²) dr + ∫ K(t, s) θ(s) ds,
    K(t, s) = (2/π) ∫ (1 - Y(x h)) cos(x t) cos(x s) dx

over 0..t, 0..a and 0..infinity, and F = 2 E* ∫ θ dt. A smooth edge has θ(a) = 0. Lengths in tip radii, E = 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from optopad.design.arrays import FloatArray

Slope = Callable[[FloatArray], FloatArray]

POINTS = 48


def softness(x: FloatArray, poisson_ratio: float) -> FloatArray:
    """1 - Y, written so that nothing overflows."""
    k, decay = 3.0 - 4.0 * poisson_ratio, np.exp(-2.0 * x)
    sinh_cosh, cosh2 = 0.25 * (1.0 - decay**2), 0.25 * (1.0 + decay) ** 2
    return 1.0 - (k * sinh_cosh - x * decay) / (k * cosh2 + ((1.0 - 2.0 * poisson_ratio) ** 2 + x**2) * decay)


def _gauss(low: float, high: float, count: int) -> tuple[FloatArray, FloatArray]:
    node, weight = np.polynomial.legendre.leggauss(count)
    return low + 0.5 * (high - low) * (node + 1.0), 0.5 * (high - low) * weight


def _abel(slope: Slope, t: FloatArray) -> FloatArray:
    """t ∫ f'(r) / sqrt(t² - r²) dr with r = t sin u; many panels, because slopes may jump."""
    edges = np.linspace(0.0, 0.5 * np.pi, 201)
    node, weight = np.polynomial.legendre.leggauss(4)
    u = (edges[:-1, None] + 0.5 * np.diff(edges)[:, None] * (node + 1.0)).ravel()
    w = (0.5 * np.diff(edges)[:, None] * weight).ravel()
    return np.asarray(t * (slope(t[:, None] * np.sin(u)) @ w))


def _theta(
    radius: float, depth: float, slope: Slope, layer: float, poisson_ratio: float
) -> tuple[float, float]:
    """Force over E* and θ at the edge."""
    t, weight = _gauss(0.0, radius, POINTS)
    x, x_weight = _gauss(0.0, 40.0 / layer, 200)
    kept = 2.0 / np.pi * softness(x * layer, poisson_ratio) * x_weight
    at = np.append(t, radius)
    kernel = (np.cos(np.outer(at, x)) * kept) @ np.cos(np.outer(x, t))
    given = depth - _abel(slope, at)
    theta = np.linalg.solve(np.eye(POINTS) - kernel[:-1] * weight, given[:-1])
    return float(2.0 * weight @ theta), float(given[-1] + (kernel[-1] * weight) @ theta)


def layer_force(
    depth: float, slope: Slope, layer: float, poisson_ratio: float, *, radius: float | None = None
) -> tuple[float, float]:
    """Force [E R²] and contact radius [tip radii] of a tip with slope f'(r).

    Parameters
    ----------
    depth, layer : press depth, thickness of the layer [tip radii]
    radius : contact radius where it is given, as that of a sharp punch; else found from the smooth edge
    """
    if radius is None:
        radius = float(brentq(lambda a: _theta(a, depth, slope, layer, poisson_ratio)[1], 1e-3, 1.0 - 1e-9))
    return _theta(radius, depth, slope, layer, poisson_ratio)[0] / (1.0 - poisson_ratio**2), radius
