"""From the runs of `wall_runs` to the shipped data of the wall correction.

The difference of two surfaces is taken at fixed places although their nodes have moved apart: with u the
difference of node positions and ∇z the slope of the mean surface, dz = u_z - ∇z · (u_x, u_y), at the mean position,
which is exact to second order in u. What remains beside the carried height of the wall (see
`wall_superposition`) is fitted by splines with weights cos θ of the surface's slope: near the steep flank
it is the distance between the surfaces that counts, not the height.
All lengths in tip radii.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from sims.contact.scope import HALF_WIDTH
from sims.contact.tip import tip_gap
from sims.contact.walls.runs import (
    DEPTH_COUNT,
    DISTANCES,
    FAR_DISTANCE,
    LAYERS,
    PAIR_DISTANCE,
    PAIR_LAYERS,
    POISSON_RATIO,
    SPACING,
    Walls,
    WallSurfaces,
    all_runs,
    make_runs,
    pair_run,
    pair_walls,
    read_run,
    run_depths,
    single_run,
)
from sims.contact.walls.shape import (
    ACROSS_COUNT,
    ALONG_COUNT,
    RIM_RADII,
    across_basis,
    along_basis,
    contact_window,
    fade,
)
from sims.contact.walls.stored import DATA_FILE
from sims.contact.walls.superposition import WallField

FloatArray = NDArray[np.float64]

MOVED = (*DISTANCES, FAR_DISTANCE)
"""Distances of a single wall in the data [tip radii]."""
SMOOTHING = 1e-3
"""Weight of the squared second differences of the coefficients against squared misfits [-]."""
TOUCHING_GAP = 3e-3
"""Gap below which a point of a facet touches the tip [tip radii]."""
COUPLING_DEPTH = 1.3
"""Deepest press that enters the couplings [tip radii]."""
CLEAR_OF_CONTACT = 0.1
"""Distance from the contact edge from which nodes are compared [tip radii]: nearer ones belong to facets in contact."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Difference of two pads' surfaces at the nodes of the top that are free in both.

    Attributes
    ----------
    x, y : (n,) places, mean of both pads
    dz : (n,) height of the second above that of the first
    cosine : (n,) cosine of the surface's slope
    """

    x: FloatArray
    y: FloatArray
    dz: FloatArray
    cosine: FloatArray

    def beyond(self, radius: float) -> Difference:
        """Only places at a larger distance from the axis."""
        far = np.hypot(self.x, self.y) > radius
        return Difference(x=self.x[far], y=self.y[far], dz=self.dz[far], cosine=self.cosine[far])


def _slopes(points: FloatArray, facets: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """(node,) slopes of a triangulated surface, means over the facets around each node."""
    first, second = points[facets[:, 1]] - points[facets[:, 0]], points[facets[:, 2]] - points[facets[:, 0]]
    normal = np.cross(first, second)
    total = np.zeros_like(points)
    for corner in range(3):
        np.add.at(total, facets[:, corner], normal)
    return -total[:, 0] / total[:, 2], -total[:, 1] / total[:, 2]


def _reference_top(reference: WallSurfaces, pad: WallSurfaces, index: int) -> FloatArray:
    """(node, 3) the reference's surface at every top node of a pad.

    Half a reference is mirrored for a whole pad; places beyond the reference's walls are at rest.
    """
    mirror = np.where((pad.rest[:, 1] < 0.0) & reference.is_half, -1.0, 1.0)
    sides = np.column_stack([np.ones_like(mirror), mirror])
    place = {tuple(rest): number for number, rest in enumerate(np.round(reference.rest, 6).tolist())}
    numbers = np.array(
        [place.get(tuple(rest), -1) for rest in (np.round(pad.rest * sides, 6) + 0.0).tolist()]
    )
    top = np.column_stack([pad.rest, np.zeros(len(pad.rest))])
    known = numbers >= 0
    top[known] = reference.top[index][numbers[known]]
    top[known, 1] *= mirror[known]
    return top


def _everywhere(
    reference: WallSurfaces, pad: WallSurfaces, index: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean places (node, 2), difference of height (node,), cosine of slope (node,) of all top nodes."""
    before, after = _reference_top(reference, pad, index), pad.top[index]
    mean, moved = 0.5 * (before + after), after - before
    slope_x, slope_y = _slopes(mean, pad.facets)
    dz = moved[:, 2] - slope_x * moved[:, 0] - slope_y * moved[:, 1]
    return mean[:, :2], dz, 1.0 / np.sqrt(1.0 + slope_x**2 + slope_y**2)


def difference(reference: WallSurfaces, pad: WallSurfaces, walls: Walls, index: int) -> Difference:
    """Difference of a pad's surface from the reference's at one depth, inside the walls."""
    places, dz, cosine = _everywhere(reference, pad, index)
    x, y = pad.rest.T
    west, east, south, north = walls
    inside = (x > -west + 1e-6) & (x < east - 1e-6) & (y > -south + 1e-6) & (y < north - 1e-6)
    return Difference(x=places[inside, 0], y=places[inside, 1], dz=dz[inside], cosine=cosine[inside])


def touching_radius(surfaces: WallSurfaces, index: int) -> float:
    """Largest radius at which a facet touches the tip."""
    corners, depth = surfaces.top[index][surfaces.facets], float(surfaces.depths[index])
    found, count = 0.0, 6
    for first in range(count + 1):
        for second in range(count + 1 - first):
            share = np.array([first, second, count - first - second]) / count
            points = np.einsum("c,fcd->fd", share, corners)
            radius = np.hypot(points[:, 0], points[:, 1])
            touching = tip_gap(radius, points[:, 2], depth) < TOUCHING_GAP
            found = max(found, float(radius[touching].max(initial=0.0)))
    return min(found, 1.0)


def contact_radii(surfaces: WallSurfaces) -> FloatArray:
    """(depth,) contact radius, smooth in depth: Hertz' root times a quadratic, at most 1."""
    root = np.sqrt(surfaces.depths)
    measured = np.array([touching_radius(surfaces, index) for index in range(len(surfaces.depths))])
    partial = measured < 0.97
    shape = np.polyfit(surfaces.depths[partial], (measured / root)[partial], 2)
    fitted = np.where(partial, root * np.polyval(shape, surfaces.depths), measured)
    return np.asarray(np.minimum(fitted, 1.0), dtype=np.float64)


def rim_heights(surfaces: WallSurfaces, index: int) -> FloatArray:
    """Height of the centred press at `RIM_RADII`, from the nodes on the east axis."""
    on_axis = (np.abs(surfaces.rest[:, 1]) < 1e-9) & (surfaces.rest[:, 0] > 0.5)
    points = surfaces.top[index][on_axis]
    points = points[np.argsort(points[:, 0])]
    outer = points[:, 0] > 1.05
    curve = PchipInterpolator(points[outer, 0], points[outer, 2], extrapolate=True)
    return np.asarray(curve(RIM_RADII), dtype=np.float64)


def base_of(heights: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Height of the centred press as a function of radius, zero from 16/3 on."""
    curve = PchipInterpolator(RIM_RADII, heights)
    return lambda radius: np.where(radius < HALF_WIDTH, curve(np.clip(radius, RIM_RADII[0], HALF_WIDTH)), 0.0)


def _roughness() -> FloatArray:
    """Squared second differences of the coefficients in both directions, as a matrix."""

    def one(count: int) -> FloatArray:
        step = np.diff(np.eye(count), 2, axis=0)
        return step.T @ step

    across, along = np.eye(ACROSS_COUNT), np.eye(ALONG_COUNT)
    return np.asarray(np.kron(one(ACROSS_COUNT), along) + np.kron(across, one(ALONG_COUNT)), dtype=np.float64)


def single_coefficients(
    reference: WallSurfaces, pad: WallSurfaces, distance: float, index: int, contact_radius: float
) -> FloatArray:
    """(ACROSS_COUNT, ALONG_COUNT) splines of one wall's rest at one depth."""
    places, dz, _ = _everywhere(reference, pad, index)
    at_wall = np.abs(pad.rest[:, 0] + distance) < 1e-6
    order = np.argsort(places[at_wall, 1])
    carried = PchipInterpolator(places[at_wall, 1][order], -dz[at_wall][order])
    walls = (distance, HALF_WIDTH, HALF_WIDTH, HALF_WIDTH)
    free = difference(reference, pad, walls, index).beyond(contact_radius)
    window = contact_window(np.hypot(free.x, free.y), contact_radius)
    wanted = free.dz + window * fade(free.x + distance, distance) * carried(np.clip(free.y, 0.0, HALF_WIDTH))
    basis = across_basis(free.x, distance)[:, :, None] * along_basis(free.y)[:, None, :]
    matrix = (window * free.cosine)[:, None] * basis.reshape(len(free.x), -1)
    normal = matrix.T @ matrix + SMOOTHING * _roughness() + 1e-9 * np.eye(matrix.shape[1])
    solution = np.linalg.solve(normal, matrix.T @ (free.cosine * wanted))
    return np.asarray(solution.reshape(ACROSS_COUNT, ALONG_COUNT), dtype=np.float64)


def _fit_layer(layer: float, folder: Path) -> dict[str, FloatArray]:
    """Arrays of one layer: by depth, and by distance and depth."""
    reference = read_run(single_run(layer, HALF_WIDTH), folder)
    contact = contact_radii(reference)
    pads = [read_run(single_run(layer, distance), folder) for distance in MOVED]
    coefficients = [
        [single_coefficients(reference, pad, distance, k, float(contact[k])) for k in range(DEPTH_COUNT)]
        for pad, distance in zip(pads, MOVED, strict=True)
    ]
    return {
        "contact_radius": contact,
        "rim": np.array([rim_heights(reference, k) for k in range(DEPTH_COUNT)]),
        "force_ratio": np.array([pad.force / reference.force - 1.0 for pad in pads]),
        "coefficients": np.array(coefficients),
    }


def _field_amplitude(field: WallField, free: Difference) -> float:
    """By how much the sum of the single walls' rests falls short of a pad with two walls."""
    without = WallField(
        walls=field.walls,
        coefficients=np.zeros_like(field.coefficients),
        contact_radius=field.contact_radius,
        base=field.base,
    )
    carried = without.height(free.x, free.y)
    shape = free.cosine * (field.height(free.x, free.y) - carried)
    return float(shape @ (free.cosine * (free.dz - carried)) / (shape @ shape))


def _pair_effect(
    layer: float, kind: str, single: dict[str, FloatArray], folder: Path, distance: float = PAIR_DISTANCE
) -> FloatArray:
    """(2, depth) of a pad of the two-wall mesh: force added, and amplitude of the single walls' rests."""
    reference = read_run(pair_run(layer, "reference", distance), folder)
    pad = read_run(pair_run(layer, kind, distance), folder)
    walls = pair_walls(kind, distance)
    height = []
    for index in range(DEPTH_COUNT):
        contact = float(single["contact_radius"][index])
        field = WallField(
            walls=walls,
            coefficients=np.repeat(single["coefficients"][MOVED.index(distance), index][None], 4, axis=0),
            contact_radius=contact,
            base=base_of(single["rim"][index]),
        )
        free = difference(reference, pad, walls, index).beyond(contact + CLEAR_OF_CONTACT)
        height.append(_field_amplitude(field, free))
    return np.array([pad.force / reference.force - 1.0, height])


def _coupling_of(
    layer: float, kind: str, single: dict[str, FloatArray], folder: Path, distance: float = PAIR_DISTANCE
) -> FloatArray:
    """(2,) coupling of two walls, of force and of height: 1 - 1/amplitude.

    Amplitudes are those of two walls over that of one on the same mesh, whose error cancels. They hardly depend on
    depth up to `COUPLING_DEPTH`; beyond, where the shank touches, the small differences of force scatter.
    """
    alone = _pair_effect(layer, "single", single, folder, distance) * np.array([[2.0], [1.0]])
    both = _pair_effect(layer, kind, single, folder, distance)
    depths = np.array(run_depths(layer))
    weight = np.where(depths <= COUPLING_DEPTH, depths, 0.0)
    return np.asarray(np.average(1.0 - alone / both, axis=1, weights=weight), dtype=np.float64)


def fit_all(folder: Path) -> dict[str, NDArray[np.generic]]:
    """Everything that is shipped, by name."""
    layers = {layer: _fit_layer(layer, folder) for layer in LAYERS}
    couplings = np.array(
        [
            np.stack(
                [_coupling_of(layer, kind, layers[layer], folder) for kind in ("corner", "channel")], axis=1
            )
            for layer in PAIR_LAYERS
        ]
    )
    with np.load(folder / f"{single_run(LAYERS[0], HALF_WIDTH).name}.npz", allow_pickle=False) as entry:
        solver = str(entry["mujoco"])
    return {
        "layers": np.array(LAYERS),
        "distances": np.array(MOVED),
        "pair_layers": np.array(PAIR_LAYERS),
        "pair_distance": np.array(PAIR_DISTANCE),
        "couplings": couplings,
        **{
            name: np.array([layers[layer][name] for layer in LAYERS])
            for name in ("contact_radius", "force_ratio")
        },
        **{
            name: np.array([layers[layer][name] for layer in LAYERS], dtype=np.float32)
            for name in ("rim", "coefficients")
        },
        "provenance": np.array(
            f"sims.contact.walls.runs and wall_fit; MuJoCo {solver}, flex tetrahedra, 24 a hexahedron of {SPACING} tip "
            f"radii, Stable Neo-Hookean, Poisson's ratio {POISSON_RATIO}; lengths in tip radii"
        ),
    }


def write_data(folder: Path, path: Path) -> None:
    """Fit the runs and write the shipped file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, allow_pickle=False, **fit_all(folder))


if __name__ == "__main__":
    runs_folder = Path(sys.argv[1])
    make_runs(all_runs(), runs_folder, int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    write_data(runs_folder, DATA_FILE)
