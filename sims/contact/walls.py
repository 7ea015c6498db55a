"""How the walls of a rectangular pad change a press that was solved in a round pad, by linear elasticity.

Lengths are in tip radii. Displacements are in units of load over shear modulus, which is 1 here.

Quadratic finite elements along one axis (`QuadraticAxis`)
----------------------------------------------------------
On a grid that is a product of axes, every integral over products of shape functions is a Kronecker product of
one-dimensional integrals. Displacements have quadratic shape functions (with nodes at the ends and in the middle of
every element), pressures have linear ones. Together they form the Taylor-Hood element, which is stable for
incompressible solids (Elman, Silvester and Wathen, Finite Elements and Fast Iterative Solvers, 2014, section 3.3).

A rectangular incompressible layer whose four walls are moved (`BlockLayer`)
----------------------------------------------------------------------------
The stress is -p 1 + 2 μ ε, and div u = 0. The displacement u is 0 on the bottom and given on the walls, and the top is
free. The grid's steps are small near the walls; elsewhere the field is smooth on the scale of the layer's thickness.
Every field is the sum of four parts, each even or odd across each of the two middle planes, so a quarter of the block
is enough. The matrix that gives the motion of the top's nodes from that of the walls' nodes is stored, so every further
press takes one matrix product.

A press into a wide layer moves the points at which the pad has its walls. Moving the walls back by this motion, and
adding the result to the press into the wide layer, gives the press between fixed walls.

A round incompressible layer under axisymmetric loads (`RoundLayer`)
--------------------------------------------------------------------
The stress is -p 1 + 2 μ ε, and div u = 0. The displacement u is 0 on bottom and wall, and the top is free except for
the load. The matrix of the Taylor-Hood elements is factorised once.

Loads that replace a press far from the tip (`FarPress`)
--------------------------------------------------------
Outside the dimple, strains are small, so the top there is that of a `RoundLayer` under loads near the axis. Two loads,
p(r) = 5 / (2 π w²) (1 - r²/w²)^(3/2) with the widths w in `LOAD_RADII`, can represent any force and spread. Their
amplitudes are fitted by least squares to the solved round pad's top, from `START` beyond the contact to the wall.
Nothing is fitted to three-dimensional results. Amplitudes are forces over the shear modulus.

Change of a press at one location by the walls (`Surroundings`)
---------------------------------------------------------------
Let q be the loads of the press, G the top of a layer under unit loads, and ρ the round pad in which the press was
solved. The change of the top is

    D = Σ q (G_block - G_ρ) = Σ q (G_wide + C - G_ρ),

where C is the block's response when its walls undo the motion that the loads cause in a wide layer. C is smooth in the
whole pad, although every G is steep at the axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator, RectBivariateSpline
from scipy.sparse import bmat, csr_matrix, kron
from scipy.sparse.linalg import splu
from threadpoolctl import threadpool_limits

from optopad.design.arrays import BoolArray, FloatArray, IntArray

Weight = Callable[[FloatArray], FloatArray]
Shape = Literal["value", "slope", "pressure"]
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(5)


class QuadraticAxis:
    """One-dimensional quadratic finite elements along one axis of a product grid.

    Attributes
    ----------
    ticks : (n + 1,) increasing coordinates of the element boundaries
    nodes : (2 n + 1,) coordinates of the nodes: ends and middles of the elements
    """

    def __init__(self, ticks: FloatArray) -> None:
        self.ticks = np.asarray(ticks, dtype=np.float64)
        count, t = len(self.ticks) - 1, POINTS
        self.nodes = np.interp(np.arange(2 * count + 1) / 2.0, np.arange(count + 1), self.ticks)
        half = 0.5 * np.diff(self.ticks)[:, None]
        self._points = self.ticks[:-1, None] + half * (1.0 + t)
        self._weights = half * WEIGHTS
        values = np.stack([0.5 * t * (t - 1.0), 1.0 - t * t, 0.5 * t * (t + 1.0)])
        slopes = np.stack([t - 0.5, -2.0 * t, t + 0.5])
        hats = np.stack([0.5 * (1.0 - t), 0.5 * (1.0 + t)])
        each = np.ones((count, 1))
        self._shapes: dict[Shape, FloatArray] = {
            "value": values[None] * each[:, None],
            "slope": slopes[None] / half[:, None],
            "pressure": hats[None] * each[:, None],
        }

    def _places(self, shape: Shape) -> IntArray:
        """Indices (element, shape function) of the nodes of every element."""
        step, count = (1, 2) if shape == "pressure" else (2, 3)
        return step * np.arange(len(self.ticks) - 1)[:, None] + np.arange(count)

    def matrix(self, left: Shape, right: Shape, weight: Weight | None = None) -> csr_matrix:
        """Matrix of the integrals of products of a `left` and a `right` shape function, times a weight if given.

        `left` and `right` are "value" (quadratic functions), "slope" (their derivatives) or "pressure" (linear
        functions). The weight is a function of position.
        """
        weights = self._weights if weight is None else self._weights * weight(self._points)
        found = np.einsum("ngk,nhk,nk->ngh", self._shapes[left], self._shapes[right], weights)
        rows, columns = self._places(left), self._places(right)
        each = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
        size = rows.max() + 1, columns.max() + 1
        return csr_matrix((found.ravel(), (each[0].ravel(), each[1].ravel())), shape=size)

    def load(self, density: Weight) -> FloatArray:
        """Integrals (node,) of the quadratic shape functions times a density, which is a function of position."""
        found = np.einsum("ngk,nk->ng", self._shapes["value"], self._weights * density(self._points))
        out = np.zeros(len(self.nodes))
        np.add.at(out, self._places("value"), found)
        return out


def product(*factors: csr_matrix) -> csr_matrix:
    """Kronecker product of the factors; the index of the last axis runs fastest."""
    out = factors[0]
    for factor in factors[1:]:
        out = kron(out, factor, format="csr")
    return out


def graded_ticks(length: float, first: float, growth: float, largest: float) -> FloatArray:
    """Boundaries (n + 1,) of elements from 0 to `length`; their sizes grow from about `first` to at most `largest`."""
    steps = [first]
    while sum(steps) < length - 1e-9:
        steps.append(min(steps[-1] * growth, largest))
    ticks = np.append(0.0, np.cumsum(steps))
    return np.asarray(ticks * (length / ticks[-1]), dtype=np.float64)


Size = tuple[float, float]

STEP, STEP_SHARE, GROWTH = 0.7, 0.23, 1.4
"""Limits of the first step at a wall, in tip radii and over the layer's thickness [-], and growth ratio of the steps
[-]. Steps of half the size move the surface by 0.5 µm rms (3 mm tip, pressed 3 mm deep, 6 mm from a wall).
"""
HEIGHT_SHARES = 1.0 - np.linspace(1.0, 0.0, 4) ** 1.6
"""Heights of the element boundaries over the layer's thickness [-], closer together towards the top."""
PARITIES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Symmetry of a field across the middle plane of x and of y: 1 is even, -1 is odd."""


@dataclass(frozen=True, kw_only=True)
class BlockLayer:
    """The response of a rectangular layer's top to a motion of its four walls; lengths in tip radii.

    Attributes
    ----------
    size : length (x) and width (y)
    x, y : (nx,), (ny,) coordinates of the top's nodes, from one wall to the other
    wall_nodes : (wall node, 3) x, y and height above the bottom, of the wall nodes in the quarter next to (0, 0)
    answers : (parity, nx / 2, ny / 2, 3 wall nodes) upward displacement of the quarter's top nodes, those on the middle
        planes included, per displacement of a wall node in x, y or z, for each symmetry in `PARITIES`
    """

    size: Size
    x: FloatArray
    y: FloatArray
    wall_nodes: FloatArray
    answers: FloatArray

    def top(self, moved: FloatArray) -> FloatArray:
        """Upward displacement (nx, ny) of the top for a given motion of the walls.

        Parameters
        ----------
        moved : (2, 2, 3, wall node) displacements (x, y, z) of the quarter's wall nodes. Those at [0, 0] are due to the
            press itself, the others to its mirror images across the middle plane of x [1, 0], of y [0, 1] and of both
            [1, 1]
        """
        total = np.zeros((len(self.x), len(self.y)))
        half = self.answers.shape[1:3]
        for (even_x, even_y), answer in zip(PARITIES, self.answers, strict=True):
            signs = np.array([[1.0, even_y], [even_x, even_x * even_y]])
            part = answer @ (0.25 * np.einsum("ab,abkn->kn", signs, moved)).ravel()
            wide = np.concatenate([part, even_x * part[half[0] - 2 :: -1]])
            total += np.concatenate([wide, even_y * wide[:, half[1] - 2 :: -1]], axis=1)
        return total


@lru_cache(maxsize=4)
def block_layer(layer: float, size: Size) -> BlockLayer:
    """The `BlockLayer` of a thickness and a size (length, width). It is computed within half a second, then cached."""
    first = min(STEP, STEP_SHARE * layer)
    x, y = (QuadraticAxis(graded_ticks(0.5 * side, first, GROWTH, layer)) for side in size)
    quarter = _Quarter(x, y, QuadraticAxis(layer * HEIGHT_SHARES))
    return BlockLayer(
        size=size,
        x=np.concatenate([x.nodes, size[0] - x.nodes[-2::-1]]),
        y=np.concatenate([y.nodes, size[1] - y.nodes[-2::-1]]),
        wall_nodes=quarter.places[quarter.is_wall],
        answers=np.stack([quarter.answer(parity) for parity in PARITIES]),
    )


class _Quarter:
    """Finite elements of the block's quarter next to the corner (0, 0): nodes, matrix and boundary conditions."""

    def __init__(self, x: QuadraticAxis, y: QuadraticAxis, z: QuadraticAxis) -> None:
        self.axes = (x, y, z)
        self.count = tuple(len(axis.nodes) for axis in self.axes)
        grids = np.meshgrid(*(axis.nodes for axis in self.axes), indexing="ij")
        self.places = np.stack([grid.ravel() for grid in grids], axis=1)
        on_bottom = self.places[:, 2] == 0.0
        self.is_wall = ((self.places[:, 0] == 0.0) | (self.places[:, 1] == 0.0)) & ~on_bottom
        self.is_held = on_bottom | self.is_wall
        self.on_planes = [self.places[:, axis] == self.axes[axis].nodes[-1] for axis in range(2)]
        corners = np.meshgrid(*(axis.ticks for axis in self.axes), indexing="ij")
        self.pressures = np.stack([grid.ravel() for grid in corners], axis=1)
        self.matrix = self._assembled()

    def _assembled(self) -> bmat:
        mass = [axis.matrix("value", "value") for axis in self.axes]
        stiff = [axis.matrix("slope", "slope") for axis in self.axes]
        value_slope = [axis.matrix("value", "slope") for axis in self.axes]
        blocks: list[list[object]] = [[None] * 4 for _ in range(4)]
        for i in range(3):
            parts = [(2.0 if k == i else 1.0) * product(*_with(mass, {k: stiff[k]})) for k in range(3)]
            blocks[i][i] = parts[0] + parts[1] + parts[2]
            for j in range(3):
                if i != j:
                    blocks[i][j] = product(*_with(mass, {i: value_slope[i], j: value_slope[j].T.tocsr()}))
            pressed = [
                axis.matrix("pressure", "slope" if k == i else "value") for k, axis in enumerate(self.axes)
            ]
            blocks[3][i] = -product(*pressed)
            blocks[i][3] = blocks[3][i].T  # type: ignore[attr-defined]
        return bmat(blocks, format="csc")

    def _free(self, parity: tuple[int, int]) -> BoolArray:
        """Mask of the unknowns that are not fixed for a symmetry: three displacements of every node, then pressures."""
        held = [self.is_held.copy() for _ in range(3)]
        pressed = np.ones(len(self.pressures), dtype=np.bool_)
        for axis, even in enumerate(parity):
            on_plane = self.on_planes[axis]
            for k in range(3):
                if (k == axis) == (even == 1):
                    held[k] |= on_plane
            if even == -1:
                pressed &= self.pressures[:, axis] != self.axes[axis].ticks[-1]
        return np.concatenate([*(~one for one in held), pressed])

    def answer(self, parity: tuple[int, int]) -> FloatArray:
        """Upward displacement (nx, ny, 3 wall nodes) of the quarter's top per displacement of a wall node in x, y or z.

        Thanks to reciprocity, it is computed from unit forces on the top instead.
        """
        nodes = len(self.places)
        free = np.flatnonzero(self._free(parity))
        walls = (nodes * np.arange(3)[:, None] + np.flatnonzero(self.is_wall)).ravel()
        top = np.flatnonzero(self.places[:, 2] == self.axes[2].nodes[-1])
        asked = np.isin(2 * nodes + top, free)
        forces = np.zeros((len(free), int(asked.sum())))
        forces[np.searchsorted(free, 2 * nodes + top[asked]), np.arange(forces.shape[1])] = 1.0
        rows = self.matrix[free]
        with threadpool_limits(1, user_api="blas"):  # two threads take six times the processor time
            moved = splu(rows[:, free].tocsc()).solve(forces)
        answer = np.zeros((len(top), len(walls)))
        answer[asked] = -(rows[:, walls].T @ moved).T
        on_wall = self.is_wall[top]
        answer[on_wall, np.searchsorted(walls, 2 * nodes + top[on_wall])] = 1.0
        return answer.reshape(*self.count[:2], len(walls))


def _with(factors: list[csr_matrix], changed: dict[int, csr_matrix]) -> list[csr_matrix]:
    return [changed.get(k, factor) for k, factor in enumerate(factors)]


FINE_RADIUS, FINE_STEP, LARGEST_STEP = 1.6, 0.1, 0.5
"""Radial grid [tip radii]: up to `FINE_RADIUS`, even steps of `FINE_STEP`; then steps that grow to `LARGEST_STEP`."""
RING_GROWTH = 1.15
TOP_STEP, DEPTH_STEPS = 0.12, 10
"""First step of the grid at the top: `TOP_STEP` [tip radii], or the layer thickness over `DEPTH_STEPS` if smaller."""


@dataclass(frozen=True, kw_only=True)
class LayerField:
    """Displacement field of a round layer under one load; 0 at and beyond its wall.

    Attributes
    ----------
    wall : radius where the layer is bonded
    outward, upward : splines for the displacement components, over radius and height above the bottom
    top : spline for the upward displacement of the top, over the radius
    """

    wall: float
    outward: RectBivariateSpline
    upward: RectBivariateSpline
    top: CubicSpline

    def top_at(self, radius: FloatArray) -> FloatArray:
        """Upward displacement (...) of the top at radii (...)."""
        return np.where(radius < self.wall, self.top(np.minimum(radius, self.wall)), 0.0)

    def at(self, radius: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Outward and upward displacement, each (n,), at radii (n,) and heights (n,) above the bottom."""
        inside = radius < self.wall
        within = np.minimum(radius, self.wall)
        return (
            np.where(inside, self.outward.ev(within, height), 0.0),
            np.where(inside, self.upward.ev(within, height), 0.0),
        )


class RoundLayer:
    """Finite elements of a round layer that is bonded at its bottom and wall, with a factorised matrix."""

    def __init__(self, layer: float, wall: float) -> None:
        """Assemble and factorise a layer of thickness `layer` with its wall at radius `wall` [tip radii]."""
        beyond = FINE_RADIUS + graded_ticks(
            wall - FINE_RADIUS, FINE_STEP * RING_GROWTH, RING_GROWTH, LARGEST_STEP
        )
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
        """Displacement field under a downward pressure on the top, divided by the shear modulus as `pressure`."""
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
    """First step, growth ratio and largest step of the grid in height, from the top down."""
    return min(TOP_STEP, layer / DEPTH_STEPS), 1.25, layer / 5.0


MOST_PLACES = 4096
"""Largest number of locations per pad size for which the walls' response is cached; each takes 10 kB."""


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """Responses of the pad around one press location to unit loads; the module docstring defines C, D and the loads.

    Attributes
    ----------
    at : (x, y) of the press axis from the pad's corner
    block : the rectangular pad
    added : (load, nx, ny) C at the block's top nodes: the effect of holding the walls fixed
    wide, round_pad : displacement fields of the loads in a layer without walls, and in the round pad
    """

    at: tuple[float, float]
    block: BlockLayer
    added: FloatArray
    wide: tuple[LayerField, ...]
    round_pad: tuple[LayerField, ...]

    @cached_property
    def on_axis(self) -> FloatArray:
        """Height (load,) by which the walls lift the top on the press axis, for one unit of each load."""
        zero = np.zeros(1)
        splines = [RectBivariateSpline(self.block.x, self.block.y, one) for one in self.added]
        return np.array(
            [
                spline.ev(*self.at) + wide.top_at(zero)[0] - near.top_at(zero)[0]
                for spline, wide, near in zip(splines, self.wide, self.round_pad, strict=True)
            ]
        )

    def change(self, amplitudes: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
        """Lift D (nx, ny) of the top by the walls under loads (load,), at x (nx,) and y (ny,) from the pad's corner."""
        spline = RectBivariateSpline(self.block.x, self.block.y, np.tensordot(amplitudes, self.added, axes=1))
        radius = np.hypot(x[:, None] - self.at[0], y[None, :] - self.at[1])
        change = np.asarray(spline(x, y), dtype=np.float64)
        for size, wide, near in zip(amplitudes, self.wide, self.round_pad, strict=True):
            change += size * (wide.top_at(radius) - near.top_at(radius))
        return change


def surroundings(layer: float, wall: float, size: Size, at: tuple[float, float]) -> Surroundings:
    """Responses of a pad to unit loads at a location; those of the most recently used pads are cached.

    Parameters
    ----------
    layer : layer thickness [tip radii]
    wall : wall radius of the round pad in which the press was solved [tip radii]
    size, at : (length, width) of the pad, and (x, y) of the press axis from its corner [tip radii]
    """
    places = _places(layer, wall, size)
    if at not in places:
        if len(places) >= MOST_PLACES:
            places.clear()
        places[at] = _found(layer, wall, size, at)
    return places[at]


@lru_cache(maxsize=4)
def _places(layer: float, wall: float, size: Size) -> dict[tuple[float, float], Surroundings]:  # noqa: ARG001
    """Cache of one pad's responses, by location. The least recently used pad is dropped with all its locations."""
    return {}


def _found(layer: float, wall: float, size: Size, at: tuple[float, float]) -> Surroundings:
    block, wide = block_layer(layer, size), wide_fields(layer)
    images = [
        [_from(block.wall_nodes, (x, y)) for y in (at[1], size[1] - at[1])] for x in (at[0], size[0] - at[0])
    ]
    added = np.stack(
        [block.top(-np.stack([[_moved(field, *far) for far in row] for row in images])) for field in wide]
    )
    return Surroundings(at=at, block=block, added=added, wide=wide, round_pad=load_fields(layer, wall))


def _from(nodes: FloatArray, at: tuple[float, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Radius (n,), horizontal unit direction (2, n) and height (n,) of nodes, seen from a press axis at (x, y)."""
    way = nodes[:, :2].T - np.array(at)[:, None]
    radius = np.hypot(*way)
    return radius, way / radius, nodes[:, 2]


def _moved(field: LayerField, radius: FloatArray, direction: FloatArray, height: FloatArray) -> FloatArray:
    """Displacement (3, n) in x, y, z of nodes at the given radii, directions and heights."""
    outward, upward = field.at(radius, height)
    return np.stack([*(outward * direction), upward])


Top = Callable[[float], tuple[FloatArray, FloatArray, float]]
"""Function from press depth to the radii and heights of the top, from the axis to the wall, and the contact radius."""

LOAD_RADII = (0.75, 1.5)
"""Widths w of the loads [tip radii]. Any two or more widths between 0.4 and 2.0 agree within 1 µm rms (3 mm tip)."""
START = 0.6
"""Distance beyond the contact or the tip, whichever is wider, from which loads are fitted to the top [tip radii]."""
SAMPLES = 60
DEPTHS = 32
"""Number of depths with fitted amplitudes, evenly spaced in √depth, because amplitudes rise steeply near 0."""
WIDE = 4.0
"""Radius over thickness of a layer whose wall has no effect [-]; a load's motion decays as exp(-2 r / thickness)."""


@lru_cache(maxsize=32)
def load_fields(layer: float, wall: float) -> tuple[LayerField, ...]:
    """Displacement field of each unit load in a round layer of thickness `layer`, bonded at radius `wall`."""
    solved = RoundLayer(layer, wall)
    return tuple(solved.field(_load(width)) for width in LOAD_RADII)


def wide_fields(layer: float) -> tuple[LayerField, ...]:
    """Displacement field of each unit load in a layer without walls; numerically, the wall is far away."""
    return load_fields(layer, max(WIDE * layer, 3.0 * LOAD_RADII[-1]))


def _load(width: float) -> Callable[[FloatArray], FloatArray]:
    return lambda r: 2.5 / (np.pi * width**2) * np.maximum(1.0 - (r / width) ** 2, 0.0) ** 1.5


@dataclass(frozen=True, kw_only=True)
class FarPress:
    """Amplitudes of the loads that replace a press far from the tip, at every depth; lengths in tip radii.

    Attributes
    ----------
    layer, wall : layer thickness, and radius of the round pad's wall
    deepest : deepest fitted press; beyond it, amplitudes are extrapolated linearly
    residual : (depth,) root mean square difference between the linear layer's top and the solved top, in the fitted
        part
    """

    layer: float
    wall: float
    deepest: float
    residual: FloatArray
    _by_root: CubicSpline

    def amplitudes(self, depth: float) -> FloatArray:
        """Amplitudes (load,) of the loads at a depth; 0 for depths of 0 or less."""
        if depth <= 0.0:
            return np.zeros(len(LOAD_RADII))
        root = np.sqrt(min(depth, self.deepest))
        found = np.asarray(self._by_root(root), dtype=np.float64)
        if depth > self.deepest:
            found = found + (depth - self.deepest) * self._by_root(root, 1) / (2.0 * root)
        return np.asarray(found, dtype=np.float64)


def far_press(layer: float, wall: float, deepest: float, top: Top) -> FarPress:
    """Fit the loads that, far from the tip, replace presses of every depth into a round pad.

    Parameters
    ----------
    layer, wall, deepest : layer thickness, wall radius and deepest press [tip radii]
    top : function from depth to the solved top and its contact radius
    """
    roots = np.sqrt(deepest) * np.arange(1, DEPTHS + 1) / DEPTHS
    fields = load_fields(layer, wall)
    rows = [_matched(fields, *top(float(root**2))) for root in roots]
    amplitudes = np.concatenate([np.zeros((1, len(LOAD_RADII))), [row for row, _ in rows]])
    return FarPress(
        layer=layer,
        wall=wall,
        deepest=deepest,
        residual=np.array([residual for _, residual in rows]),
        _by_root=CubicSpline(np.append(0.0, roots), amplitudes),
    )


def _matched(
    fields: tuple[LayerField, ...], radius: FloatArray, height: FloatArray, contact: float
) -> tuple[FloatArray, float]:
    """Amplitudes (load,) fitted to a solved top outside its contact, and the fit's root mean square residual."""
    places = np.linspace(max(contact, 1.0) + START, fields[0].wall, SAMPLES)
    wanted = PchipInterpolator(radius, height)(places)
    columns = np.stack([field.top_at(places) for field in fields], axis=1)
    found, *_ = np.linalg.lstsq(columns, wanted, rcond=None)
    return np.asarray(found, dtype=np.float64), float(np.sqrt(np.mean((columns @ found - wanted) ** 2)))
