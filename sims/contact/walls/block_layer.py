"""A rectangular incompressible layer: how its top moves when its four walls are moved; linear elasticity.

Model
-----
Stress -p 1 + 2 μ ε, div u = 0, u = 0 on the bottom, u given on the walls, the top free. Taylor-Hood elements on a
product grid (`elements`) whose steps are small beside the walls: inside, such a field is smooth on the scale of the
layer's depth. Two mirror planes part every field into four, even or odd across each, and a quarter of the block serves
them all. What is kept is the matrix from the walls' nodes to the top's: one product for every press that follows.

With walls moved as a press in a wide layer would move them, but the other way, the sum is that press between walls
that are held. Lengths in tip radii; displacements of any unit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import bmat, csr_matrix
from scipy.sparse.linalg import splu

from design.arrays import BoolArray, FloatArray
from sims.contact.walls.elements import QuadraticAxis, graded_ticks, product

Size = tuple[float, float]

STEP, STEP_SHARE, GROWTH = 0.7, 0.23, 1.4
"""First step beside a wall [tip radii], the same over the layer's depth [-], and growth. Against steps of half the size
the surface moves by 0.5 µm rms (tip of 3 mm, pressed by its radius, 6 mm from a wall)."""
HEIGHT_SHARES = 1.0 - np.linspace(1.0, 0.0, 4) ** 1.6
"""Ticks along the height, closer towards the top [layer's depth]."""
PARITIES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Even (1) or odd (-1) across the middle planes of x and y."""


@dataclass(frozen=True, kw_only=True)
class BlockLayer:
    """The top of a block over its walls.

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
    """The quarter next to the corner at (0, 0): its matrix, and what is held for each parity."""

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
