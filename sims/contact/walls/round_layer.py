"""A round incompressible layer, bonded at its bottom and its wall, under loads around its axis: linear elasticity.

Model
-----
Stress -p 1 + 2 μ ε, div u = 0, u = 0 on bottom and wall, the top free but for the load; axisymmetric. Weak form by
Taylor-Hood elements on a product grid (`elements`), factorised once. Shear modulus μ = 1 here: displacements are those
of a load over μ. Lengths in tip radii.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.sparse import bmat
from scipy.sparse.linalg import splu

from design.arrays import FloatArray
from sims.contact.walls.elements import QuadraticAxis, Weight, graded_ticks, product

FINE_RADIUS, FINE_STEP, LARGEST_STEP = 1.6, 0.1, 0.5
"""Grid along the radius: even under the loads, then growing [tip radii]."""
RING_GROWTH = 1.15
TOP_STEP, DEPTH_STEPS = 0.12, 10
"""Grid along the height: step at the top [tip radii], and number of steps."""


@dataclass(frozen=True, kw_only=True)
class LayerField:
    """Displacement of a layer under one load; it is 0 from the wall on.

    Attributes
    ----------
    wall : radius where the layer is bonded
    outward, upward : splines over radius and height above the bottom
    top : spline of the upward displacement of the top over the radius
    """

    wall: float
    outward: RectBivariateSpline
    upward: RectBivariateSpline
    top: CubicSpline

    def top_at(self, radius: FloatArray) -> FloatArray:
        """Upward displacement of the top at radii of any shape."""
        return np.where(radius < self.wall, self.top(np.minimum(radius, self.wall)), 0.0)

    def at(self, radius: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) outward and upward displacement at (n,) radii and heights above the bottom."""
        inside = radius < self.wall
        within = np.minimum(radius, self.wall)
        return (
            np.where(inside, self.outward.ev(within, height), 0.0),
            np.where(inside, self.upward.ev(within, height), 0.0),
        )


class RoundLayer:
    """The factorised layer."""

    def __init__(self, layer: float, wall: float) -> None:
        """Assemble a layer of a depth with its wall at a radius."""
        beyond = FINE_RADIUS + graded_ticks(wall - FINE_RADIUS, FINE_STEP * RING_GROWTH, RING_GROWTH, LARGEST_STEP)
        radial = np.linspace(0.0, FINE_RADIUS, round(FINE_RADIUS / FINE_STEP) + 1)
        self.wall = wall
        self._r = QuadraticAxis(np.concatenate([radial, beyond[1:]]))
        self._z = QuadraticAxis(layer - graded_ticks(layer, *_height_steps(layer))[::-1])
        self._assemble()

    def _assemble(self) -> None:
        r, z = self._r, self._z
        mass, stiff = z.matrix("value", "value"), z.matrix("slope", "slope")
        ring = r.matrix("value", "value", _radius)
        bent = r.matrix("slope", "slope", _radius)
        hoop = r.matrix("value", "value", lambda x: 1.0 / x)
        outward = 2.0 * product(bent + hoop, mass) + product(ring, stiff)
        upward = 2.0 * product(ring, stiff) + product(bent, mass)
        mixed = product(r.matrix("value", "slope", _radius), z.matrix("slope", "value"))
        spread = r.matrix("pressure", "slope", _radius) + r.matrix("pressure", "value")
        squeezed = -product(spread, z.matrix("pressure", "value"))
        raised = -product(r.matrix("pressure", "value", _radius), z.matrix("pressure", "slope"))
        matrix = bmat(
            [[outward, mixed, squeezed.T], [mixed.T, upward, raised.T], [squeezed, raised, None]],
            format="csc",
        )
        count = len(r.nodes), len(z.nodes)
        radial, vertical = np.indices(count).reshape(2, -1)
        held = (vertical == 0) | (radial == count[0] - 1)
        free = np.concatenate([~(held | (radial == 0)), ~held, np.ones(squeezed.shape[0], dtype=np.bool_)])
        self._free = np.flatnonzero(free)
        self._size = matrix.shape[0]
        self._solve = splu(matrix[self._free][:, self._free]).solve

    def field(self, pressure: Weight) -> LayerField:
        """The displacement under a downward pressure, a function of the radius, over the shear modulus."""
        count = len(self._r.nodes), len(self._z.nodes)
        nodes = count[0] * count[1]
        load = np.zeros(self._size)
        load[nodes : 2 * nodes].reshape(count)[:, -1] = -self._r.load(lambda x: x * pressure(x))
        moved = np.zeros(self._size)
        moved[self._free] = self._solve(load[self._free])
        outward, upward = moved[: 2 * nodes].reshape(2, *count)
        return LayerField(
            wall=self.wall,
            outward=RectBivariateSpline(self._r.nodes, self._z.nodes, outward),
            upward=RectBivariateSpline(self._r.nodes, self._z.nodes, upward),
            top=CubicSpline(self._r.nodes, upward[:, -1]),
        )


def _radius(x: FloatArray) -> FloatArray:
    return x


def _height_steps(layer: float) -> tuple[float, float, float]:
    """First step, growth and largest step of the heights, from the top down."""
    return min(TOP_STEP, layer / DEPTH_STEPS), 1.25, layer / 5.0
