"""Points of a disc's or crowned pad's top through which mirrored light is followed.

A grid covers the untouched top. Near the face of an emitter or receiver (*window*), a cell is divided into four as long
as it is larger than `GRADE` times its distance from the window. Around a press, where the top bends within a cell,
rings replace the grid. Cells that were divided for a window remain, except in the steep part of the press. Every cell
has one point, at the same relative position, and belongs to one of four batches, like the squares of a board with four
colours.

Light that a flat or cylindrical top mirrors several times is faint and varies slowly. It is followed through every
fourth point of the grid and every second point of the rings, which represent the others; between parts that look up,
through fewer. A sphere focuses such light,
so every point is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.engine.general.patches import is_in_plan
from optopad.sims.optics.engine.general.rays import CX, CY, CZ, HALF_U, HALF_V, NX, NY, NZ, UX, UY, VX, VY, VZ
from optopad.sims.optics.engine.general.top import CONTACT_EDGE, KIND, OUTER, SKIRT_EDGE, SPHERE, FormedTop
from optopad.sims.optics.scene.optical_scene import OpticalScene

GRADE = 0.35
"""Largest size of a cell, relative to its distance from a window."""
PITCH = 0.38
"""Size of cells at an image step of 1, relative to the mean of the narrowest emitter's and the narrowest receiver's
width; this mean is the width of an image half-way between them. At an image step of 0.7 the change of light by a press
on the dome has an error of 0.3 to 1.2 noise units rms with emitters of 0.3 mm, and of 0.4 to 1.7 with emitters of 1.1
mm."""
SKIN_PITCH, SKIN_STEP = 0.3, 0.2
"""Size of cells under a skin that scatters at an image step of 1, relative to the thickness of the layer; and least
image step there, as finer cells change less than other errors."""
DIVISIONS = 4
"""Largest number of times that a cell of the grid is divided."""
RINGS_TO_SKIRT, RINGS_TO_CONTACT = 1.3, 2.0
"""Outer radius of the rings: the larger of these multiples of the steep skirt's radius and of the contact radius."""
MOST_RINGS_TO_CONTACT = 4.0
"""Largest outer radius of the rings, relative to the contact radius. A dome's top is steep again near its wall, but
there the grid is as good with fewer points."""
CHAINS_EVERY, CHAINS_EVERY_UP = 2, 8
"""`TopGrid.chains_every`, and its value if all parts look up: light that a flat top mirrored once goes down to them."""
GOLDEN = 0.6180339887498949


@dataclass(frozen=True, kw_only=True)
class TopGrid:
    """Cells of the untouched top.

    Attributes
    ----------
    pitch_mm : size of undivided cells [mm]
    corner : (n, 2) smallest x and y of each cell [mm]
    size : (n,) size of each cell [mm]
    batch : (n,) batch of each cell's point, 0 to 3
    divided : (columns, rows) mask of the original grid's cells that were divided
    chains_every : light mirrored several times is followed through one cell in so many in each direction of a batch
    """

    pitch_mm: float
    corner: FloatArray
    size: FloatArray
    batch: FloatArray
    divided: BoolArray
    chains_every: int = 2

    @cached_property
    def is_part(self) -> BoolArray:
        """(n,) mask of the cells that are pieces of a divided one."""
        return np.asarray(self.size < 0.75 * self.pitch_mm)

    def is_divided(self, x_mm: FloatArray, y_mm: FloatArray) -> BoolArray:
        """Mask of the points (x, y) in plan that are in a divided cell."""
        columns, rows = self.divided.shape
        i = np.clip((x_mm / self.pitch_mm).astype(np.int64), 0, columns - 1)
        j = np.clip((y_mm / self.pitch_mm).astype(np.int64), 0, rows - 1)
        return np.asarray(self.divided[i, j])


@dataclass(frozen=True, kw_only=True)
class GridPoints:
    """One point of the untouched top in each cell of a grid.

    Attributes
    ----------
    place : (n, 3) position [mm]
    normal : (n, 3) unit normal out of the elastomer [-]
    area : (n,) area of the cell in plan [mm²]
    batch : (n,) batch, 0 to 3
    cell : (n,) number of the cell
    is_part : (n,) whether the cell is a piece of a divided one
    chains : (n,) number of points that this one represents for light mirrored several times
    """

    place: FloatArray
    normal: FloatArray
    area: FloatArray
    batch: FloatArray
    cell: IntArray
    is_part: BoolArray
    chains: FloatArray

    def in_frame(self, top: FormedTop) -> FloatArray:
        """(n, 5) the points in press coordinates: x, y, area in that x-y plane [mm²], batch, `chains`."""
        at = (self.place - top.origin) @ top.axes[:2].T
        element = self.area * (self.normal @ top.axes[2]) / self.normal[:, 2]
        return np.column_stack([at, element, self.batch, self.chains])


def pitch_of(settings: Accuracy, scene: OpticalScene, emitters: FloatArray, receivers: FloatArray) -> float:
    """Size of the grid's cells [mm], small relative to an emitter's image at a receiver.

    Under a skin that scatters, it is small relative to the thickness of the layer, over which light on the top varies.
    """
    if scene.top_finish == "diffuse":
        return float(SKIN_PITCH * np.sqrt(max(settings.image_step, SKIN_STEP)) * scene.height_mm)
    narrowest = [2.0 * float(windows[:, [HALF_U, HALF_V]].min()) for windows in (emitters, receivers)]
    return float(PITCH * np.sqrt(settings.image_step) * np.mean(narrowest))


def top_grid(scene: OpticalScene, windows: FloatArray, pitch_mm: float) -> TopGrid:
    """Cells that cover the box around the pad in plan, smaller near windows (n, 12 or more)."""
    form = scene.form
    assert form is not None
    columns, rows = (int(np.ceil(side / pitch_mm)) for side in (scene.length_mm, scene.width_mm))
    index = np.stack(np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"), axis=-1).reshape(-1, 2)
    size, kept = pitch_mm, []
    divided = np.zeros((columns, rows), dtype=np.bool_)
    for level in range(DIVISIONS + 1):
        middle = (index + 0.5) * size
        height = form.top.height_mm(middle[:, 0], middle[:, 1])
        height = np.where(np.isfinite(height), height, 0.0)
        near = _distance_mm(np.column_stack([middle, height]), windows)
        is_large = (size > GRADE * near) & (level < DIVISIONS)
        if level == 0:
            divided[:] = is_large.reshape(columns, rows)
        whole = index[~is_large]
        batch = (whole[:, 0] % 2 + 2 * (whole[:, 1] % 2)).astype(np.float64)
        kept.append((whole * size, np.full(len(whole), size), batch))
        index, size = quartered(index[is_large]), size / 2.0
    corner, sizes, batches = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    every = CHAINS_EVERY_UP if (windows[:, NZ] == -1.0).all() else CHAINS_EVERY
    return TopGrid(
        pitch_mm=pitch_mm, corner=corner, size=sizes, batch=batches, divided=divided, chains_every=every
    )


def quartered(index: IntArray) -> IntArray:
    """(4 n, 2) numbers of the quarters of square cells with numbers (n, 2), counted from the origin in cells."""
    return np.asarray((2 * index[:, None] + np.array([[0, 0], [0, 1], [1, 0], [1, 1]])).reshape(-1, 2))


def _distance_mm(places: FloatArray, windows: FloatArray) -> FloatArray:
    """(n,) distance of (n, 3) points from the nearest window [mm]."""
    nearest = np.full(len(places), np.inf)
    for w in windows:
        off = places - w[[CX, CY, CZ]]
        along = np.maximum(np.abs(off[:, 0] * w[UX] + off[:, 1] * w[UY]) - w[HALF_U], 0.0)
        above = np.maximum(np.abs(off @ w[[VX, VY, VZ]]) - w[HALF_V], 0.0)
        away = off @ w[[NX, NY, NZ]]
        nearest = np.minimum(nearest, np.sqrt(along**2 + above**2 + away**2))
    return nearest


def points_of(
    grid: TopGrid,
    scene: OpticalScene,
    walls: FloatArray,
    arcs: FloatArray,
    shift: FloatArray,
    *,
    all_chains: bool,
) -> GridPoints:
    """Points of a grid that are in the pad.

    shift : (2,) position of each point in its cell, as a share of the cell's size
    all_chains : whether light mirrored several times is followed through all points
    """
    form = scene.form
    assert form is not None
    x, y = (grid.corner + np.asarray(shift) * grid.size[:, None]).T
    inside = is_in_plan(x, y, walls, arcs)
    x, y, size = x[inside], y[inside], grid.size[inside]
    return GridPoints(
        place=np.column_stack([x, y, form.top.height_mm(x, y)]),
        normal=form.top.normal(x, y),
        area=size**2,
        batch=grid.batch[inside],
        cell=np.flatnonzero(inside),
        is_part=grid.is_part[inside],
        chains=np.ones(len(x)) if all_chains else _stands_for(grid)[inside],
    )


def _stands_for(grid: TopGrid) -> FloatArray:
    """(n,) number of points that each point represents for light mirrored several times; 0 for most."""
    number = np.round(grid.corner / grid.size[:, None]).astype(np.int64) // 2
    return np.where((number % grid.chains_every == 0).all(axis=1), float(grid.chains_every**2), 0.0)


def ring_zone_mm(top: FormedTop) -> tuple[float, float]:
    """Radii within which rings replace the grid [mm]: one for its divided cells, one for all others."""
    steep, contact = float(top.numbers[SKIRT_EDGE]), float(top.numbers[CONTACT_EDGE])
    most = min(MOST_RINGS_TO_CONTACT * contact, float(top.numbers[OUTER]))
    wide = max(RINGS_TO_SKIRT * steep, RINGS_TO_CONTACT * contact)
    return min(steep, most), min(wide, most)


def ring_points(
    top: FormedTop, outer_mm: float, pitch_mm: float, settings: Accuracy, shift: FloatArray
) -> FloatArray:
    """(n, 5) points on rings around the press, denser near the contact; columns as from `GridPoints.in_frame`."""
    contact, all_chains = float(top.numbers[CONTACT_EDGE]), top.numbers[KIND] == SPHERE
    within, needed = max(settings.rings // 3, 4), int(np.ceil(contact / pitch_mm))
    beyond = max(settings.rings, int(1.5 * (outer_mm - contact) / pitch_mm))
    share = np.arange(beyond + 1) / beyond
    # rings of equal area, or, where an image of a part is narrow, of equal width
    inner = np.sqrt(np.arange(within) / within) if needed <= within else np.arange(needed) / needed
    edges = np.concatenate(
        [
            contact * inner,
            contact + (outer_mm - contact) * (0.25 * share + 0.75 * share**2),
        ]
    )
    parts = []
    for ring, (low, high) in enumerate(pairwise(edges)):
        count = max(settings.columns // 2, 2 * int(np.pi * high / pitch_mm))
        radius = np.sqrt(low**2 + shift[0] * (high**2 - low**2))
        column = np.arange(count)
        turn = 2.0 * np.pi * (column + shift[1] + GOLDEN * ring) / count
        element = np.full(count, np.pi * (high**2 - low**2) / count)
        batch = ring % 2 + 2.0 * (column % 2)
        chains = np.ones(count) if all_chains else (ring // 2 + column // 2) % 2 * 1.0
        chains *= count / chains.sum()
        parts.append(np.column_stack([radius * np.cos(turn), radius * np.sin(turn), element, batch, chains]))
    return np.concatenate(parts)
