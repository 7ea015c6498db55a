"""Quadratic finite elements along one axis: the one-dimensional integrals of layers on product grids.

On a grid that is a product of axes every integral of products of shape functions is a Kronecker product of these.
Displacements take the quadratic shape functions (a node at the ends and in the middle of every element), pressures the
linear ones: together the Taylor-Hood element, stable for incompressible solids (Elman, Silvester and Wathen, Finite
Elements and Fast Iterative Solvers, 2014, section 3.3).

A rectangular incompressible layer: motion of its top when its four walls are moved; linear elasticity.

Model
-----
Stress -p 1 + 2 μ ε, div u = 0, u = 0 on the bottom, u given on the walls, the top free. Taylor-Hood elements on a
product grid (`elements`) whose steps are small near the walls: inside, such a field is smooth on the scale of the
layer's depth. Two mirror planes split every field into four, even or odd across each, and a quarter of the block serves
them all. The matrix from the walls' nodes to the top's is kept, so every further press is one product.

Walls moved opposite to their motion by a press in a wide layer, added to that press, give the press between fixed
walls. Lengths in tip radii; displacements of any unit.

A round incompressible layer, bonded at its bottom and its wall, under loads around its axis: linear elasticity.

Model
-----
Stress -p 1 + 2 μ ε, div u = 0, u = 0 on bottom and wall, the top free except for the load; axisymmetric. Weak form by
Taylor-Hood elements on a product grid (`elements`), factorised once. Shear modulus μ = 1 here: displacements are those
of a load over μ. Lengths in tip radii.

Change of a press at one location by the walls of a rectangular pad, from its loads: linear elasticity.

With loads q of the press (`far_press`), G the top of a layer under them, and ρ the round pad it was solved in,

    D = Σ q (G_block - G_ρ) = Σ q (G_wide + C - G_ρ),

where C is the addition by the block when its walls undo the motion by the loads in a wide layer (`block_layer`). C is
smooth in the whole pad, though every G is steep at the axis. Lengths in tip radii.

A press in the far field: loads on a linear layer that raise its top as the solved press does outside the dimple.

Model
-----
Outside the dimple strains are small, so the top there is that of a linear incompressible layer (`RoundLayer`) under
loads near the axis. Two of them, p(r) = 5 / (2 π w²) (1 - r²/w²)^(3/2) with w of `LOAD_RADII`, have any force and
spread. Their amplitudes are fitted to the solved round pad's top from `START` beyond the contact to its wall, by least
squares. Their rise in a layer of another outline, less that in the round pad, is the change of the press by that
outline: it is small and smooth, hence linear too (`surroundings`). Nothing is fitted to results in three dimensions.

Lengths in tip radii, amplitudes in tip radii times the layer's shear modulus over it.
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

from design.arrays import BoolArray, FloatArray, IntArray

Weight = Callable[[FloatArray], FloatArray]
Shape = Literal["value", "slope", "pressure"]
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(5)


class QuadraticAxis:
    """Elements between ticks.

    Attributes
    ----------
    ticks : (n + 1,) increasing ends of the elements
    nodes : (2 n + 1,) ticks and middles
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
        """(element, shape) numbers of an element's nodes."""
        step, count = (1, 2) if shape == "pressure" else (2, 3)
        return step * np.arange(len(self.ticks) - 1)[:, None] + np.arange(count)

    def matrix(self, left: Shape, right: Shape, weight: Weight | None = None) -> csr_matrix:
        """(left, right) integrals of products of shape functions or their slopes, times a weight of the position."""
        weights = self._weights if weight is None else self._weights * weight(self._points)
        found = np.einsum("ngk,nhk,nk->ngh", self._shapes[left], self._shapes[right], weights)
        rows, columns = self._places(left), self._places(right)
        each = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
        size = rows.max() + 1, columns.max() + 1
        return csr_matrix((found.ravel(), (each[0].ravel(), each[1].ravel())), shape=size)

    def load(self, density: Weight) -> FloatArray:
        """(node,) integrals of the quadratic shape functions times a density of the position."""
        found = np.einsum("ngk,nk->ng", self._shapes["value"], self._weights * density(self._points))
        out = np.zeros(len(self.nodes))
        np.add.at(out, self._places("value"), found)
        return out


def product(*factors: csr_matrix) -> csr_matrix:
    """Kronecker product, the last axis fastest."""
    out = factors[0]
    for factor in factors[1:]:
        out = kron(out, factor, format="csr")
    return out


def graded_ticks(length: float, first: float, growth: float, largest: float) -> FloatArray:
    """(n + 1,) ticks from 0 to a length, their steps growing from about the first to the largest."""
    steps = [first]
    while sum(steps) < length - 1e-9:
        steps.append(min(steps[-1] * growth, largest))
    ticks = np.append(0.0, np.cumsum(steps))
    return np.asarray(ticks * (length / ticks[-1]), dtype=np.float64)


Size = tuple[float, float]

STEP, STEP_SHARE, GROWTH = 0.7, 0.23, 1.4
"""First step at a wall [tip radii], the same over the layer's depth [-], and growth. Against steps of half the size
the surface moves by 0.5 µm rms (tip of 3 mm, pressed by its radius, 6 mm from a wall)."""
HEIGHT_SHARES = 1.0 - np.linspace(1.0, 0.0, 4) ** 1.6
"""Ticks along the height, closer towards the top [layer's depth]."""
PARITIES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Even (1) or odd (-1) across the middle planes of x and y."""


@dataclass(frozen=True, kw_only=True)
class BlockLayer:
    """The response of a block's top to motion of its walls.

    Attributes
    ----------
    size : length and width
    x, y : (nx,), (ny,) nodes of the top from one wall to the other
    wall_nodes : (wall, 3) x, y and height above the bottom of a quarter's nodes on the walls
    answers : (parity, nx / 2, ny / 2, 3 wall) upward displacement of the quarter's top per displacement of its walls
    """

    size: Size
    x: FloatArray
    y: FloatArray
    wall_nodes: FloatArray
    answers: FloatArray

    def top(self, moved: FloatArray) -> FloatArray:
        """(nx, ny) upward displacement of the top.

        Parameters
        ----------
        moved : (2, 2, 3, wall) displacement of the walls' nodes by the cause itself and by its images in the
            middle planes of x and y
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
    """The block of a depth, length and width; half a second or less, then remembered."""
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
    """The quarter next to the corner at (0, 0): its matrix, and the fixed unknowns for each parity."""

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
        """Unknowns that are not prescribed: three displacements of every node, then pressures."""
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
        """(nx, ny, 3 wall) the quarter's top per displacement of its walls, by reciprocity: unit forces there."""
        nodes = len(self.places)
        free = np.flatnonzero(self._free(parity))
        walls = (nodes * np.arange(3)[:, None] + np.flatnonzero(self.is_wall)).ravel()
        top = np.flatnonzero(self.places[:, 2] == self.axes[2].nodes[-1])
        asked = np.isin(2 * nodes + top, free)
        forces = np.zeros((len(free), int(asked.sum())))
        forces[np.searchsorted(free, 2 * nodes + top[asked]), np.arange(forces.shape[1])] = 1.0
        rows = self.matrix[free]
        moved = splu(rows[:, free].tocsc()).solve(forces)
        answer = np.zeros((len(top), len(walls)))
        answer[asked] = -(rows[:, walls].T @ moved).T
        on_wall = self.is_wall[top]
        answer[on_wall, np.searchsorted(walls, 2 * nodes + top[on_wall])] = 1.0
        return answer.reshape(*self.count[:2], len(walls))


def _with(factors: list[csr_matrix], changed: dict[int, csr_matrix]) -> list[csr_matrix]:
    return [changed.get(k, factor) for k, factor in enumerate(factors)]


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


MOST_PLACES = 4096
"""Most locations of a pad that are remembered: 10 kB each."""


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """The response to the loads between the walls around one location.

    Attributes
    ----------
    at : x and y of the axis from the pad's corner
    block : the pad
    added : (load, nx, ny) C on the block's nodes
    wide, round_pad : the loads in a wide layer and in the round pad
    """

    at: tuple[float, float]
    block: BlockLayer
    added: FloatArray
    wide: tuple[LayerField, ...]
    round_pad: tuple[LayerField, ...]

    @cached_property
    def on_axis(self) -> FloatArray:
        """(load,) D on the axis for a unit of each load."""
        zero = np.zeros(1)
        splines = [RectBivariateSpline(self.block.x, self.block.y, one) for one in self.added]
        return np.array(
            [
                spline.ev(*self.at) + wide.top_at(zero)[0] - near.top_at(zero)[0]
                for spline, wide, near in zip(splines, self.wide, self.round_pad, strict=True)
            ]
        )

    def change(self, amplitudes: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
        """(nx, ny) D of loads (load,) at x (nx,) and y (ny,) from the pad's corner, within its walls."""
        spline = RectBivariateSpline(self.block.x, self.block.y, np.tensordot(amplitudes, self.added, axes=1))
        radius = np.hypot(x[:, None] - self.at[0], y[None, :] - self.at[1])
        change = np.asarray(spline(x, y), dtype=np.float64)
        for size, wide, near in zip(amplitudes, self.wide, self.round_pad, strict=True):
            change += size * (wide.top_at(radius) - near.top_at(radius))
        return change


def surroundings(layer: float, wall: float, size: Size, at: tuple[float, float]) -> Surroundings:
    """The walls of a pad around a location; those of the last pads are remembered by location.

    Parameters
    ----------
    layer : depth of the layer
    wall : radius of the round pad that the press was solved in
    size, at : length and width of the pad, and x, y of the axis from its corner
    """
    places = _places(layer, wall, size)
    if at not in places:
        if len(places) >= MOST_PLACES:
            places.clear()
        places[at] = _found(layer, wall, size, at)
    return places[at]


@lru_cache(maxsize=4)
def _places(layer: float, wall: float, size: Size) -> dict[tuple[float, float], Surroundings]:  # noqa: ARG001
    """The remembered locations of a pad; pads are dropped whole, so that only the last ones are kept."""
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
    """Radius (n,), direction (2, n) and height (n,) of nodes from an axis."""
    way = nodes[:, :2].T - np.array(at)[:, None]
    radius = np.hypot(*way)
    return radius, way / radius, nodes[:, 2]


def _moved(field: LayerField, radius: FloatArray, direction: FloatArray, height: FloatArray) -> FloatArray:
    """(3, n) displacement at nodes."""
    outward, upward = field.at(radius, height)
    return np.stack([*(outward * direction), upward])


Top = Callable[[float], tuple[FloatArray, FloatArray, float]]
"""Depth to (radius, height) of the top from the axis to the wall, and contact radius."""

LOAD_RADII = (0.75, 1.5)
"""Of one to four loads, 0.4 to 2.0 wide, two or more give the same surface in a pad within 1 µm rms (tip of 3 mm)."""
START = 0.6
"""Distance beyond the contact, or the tip's radius, from which the linear layer is compared with the solved top."""
SAMPLES = 60
DEPTHS = 32
"""Number of depths for amplitudes, evenly spaced in their root: denser near 0, where amplitudes rise steeply."""
WIDE = 4.0
"""Radius over depth of a layer whose wall has no effect [-]: the motion by a load decays as exp(-2 r / depth)."""


@lru_cache(maxsize=32)
def load_fields(layer: float, wall: float) -> tuple[LayerField, ...]:
    """Displacement by each load in a round layer of a depth, bonded at a radius."""
    solved = RoundLayer(layer, wall)
    return tuple(solved.field(_load(width)) for width in LOAD_RADII)


def wide_fields(layer: float) -> tuple[LayerField, ...]:
    """Displacement by each load in a layer without walls."""
    return load_fields(layer, max(WIDE * layer, 3.0 * LOAD_RADII[-1]))


def _load(width: float) -> Callable[[FloatArray], FloatArray]:
    return lambda r: 2.5 / (np.pi * width**2) * np.maximum(1.0 - (r / width) ** 2, 0.0) ** 1.5


@dataclass(frozen=True, kw_only=True)
class FarPress:
    """Amplitudes of the loads at every depth.

    Attributes
    ----------
    layer, wall : depth of the layer, radius of the round pad's wall
    deepest : deepest known press; beyond it amplitudes continue in a straight line
    residual : (depth,) root mean square of the linear layer's top less the solved one where they are compared
    """

    layer: float
    wall: float
    deepest: float
    residual: FloatArray
    _by_root: CubicSpline

    def amplitudes(self, depth: float) -> FloatArray:
        """(load,) at a depth."""
        if depth <= 0.0:
            return np.zeros(len(LOAD_RADII))
        root = np.sqrt(min(depth, self.deepest))
        found = np.asarray(self._by_root(root), dtype=np.float64)
        if depth > self.deepest:
            found = found + (depth - self.deepest) * self._by_root(root, 1) / (2.0 * root)
        return np.asarray(found, dtype=np.float64)


def far_press(layer: float, wall: float, deepest: float, top: Top) -> FarPress:
    """The loads of a family of presses into a round pad.

    Parameters
    ----------
    layer, wall, deepest : depth of the layer, radius of the wall, deepest press
    top : the top of the solved presses
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
    """Amplitudes (load,) that give a top, and the root mean square of the residual."""
    places = np.linspace(max(contact, 1.0) + START, fields[0].wall, SAMPLES)
    wanted = PchipInterpolator(radius, height)(places)
    columns = np.stack([field.top_at(places) for field in fields], axis=1)
    found, *_ = np.linalg.lstsq(columns, wanted, rcond=None)
    return np.asarray(found, dtype=np.float64), float(np.sqrt(np.mean((columns @ found - wanted) ** 2)))
