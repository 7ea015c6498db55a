"""Presses in square pads solved in three dimensions, against the design's round model: force, surface, light.

    python -m tests.validation.contact.square_pad --solve    solve (20 minutes, resumable) and write square_pad.npz
    python -m tests.validation.contact.square_pad            the table of docs/validation/walls.md, a minute

The model takes the top from a layer with a round wall and its force from the same, with a factor for near walls; the
oracle (`block_oracle`) has the four bonded walls of the pad itself. Compared are absolute heights, so the oracle's
own mesh matters: every figure stands beside the one that elements of twice the size give.

* Surface: the curve as the light engine reads it, its ending included, less the oracle's height, at the nodes of a
  grid of 0.5 mm in the whole pad that are 0.3 mm or more outside the contact.
* Light: traced with the curve alone, or with `correction_fields`, less traced with curve and the field that makes it
  the oracle's top, over each pair's untouched signal. The oracle's field sets in over the 0.6 mm beside the contact,
  where its elements of 0.9 mm say little.

Left out: tips but the hemisphere of 3 mm, layers but 9 mm.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numba
import numpy as np
from numba import njit
from numpy.typing import NDArray

from design.geometry.cavity import cavity_of
from design.geometry.pairs import direct_path_pairs
from design.preset import preset
from design.spec import SensorDesign
from sims.contact import indent
from sims.contact.indentation import modulus_mpa
from sims.contact.walls.shape import contact_window
from sims.optics.accuracy import ACCURACIES, Accuracy
from sims.optics.scene.lower import scene_of
from sims.optics.scene.smooth_field import SmoothField, smooth_field
from sims.optics.surface.top import Top, surface_height
from sims.optics.surface.tops import stack_tops
from sims.optics.tracing import correction_fields, trace
from sims.press.indentation import Indentation
from tests.validation.contact.contact_reference import POISSON_RATIO, reference_state
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.contact.wall_reference import (
    DEPTHS,
    LAYER,
    heights,
    provenance,
    read_arrays,
    solve_block,
)
from tests.validation.elements.block_oracle import BlockGrading, BlockPress, Walls
from tests.validation.elements.continuation import interpolated

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Size = tuple[float, float]
"""Root mean square and largest of a difference."""

STORED = Path(__file__).with_name("square_pad.npz")
PAGE = Path(__file__).parents[3] / "docs" / "validation" / "walls.md"
MARKS = "<!-- made by tests/validation/contact/square_pad.py -->", "<!-- end of square pads -->"
TIP_RADIUS_MM = 3.0
DEPTHS_MM = tuple(TIP_RADIUS_MM * depth for depth in DEPTHS)
GRID_MM = 0.5
SAMPLES = 4
"""Points of the oracle's quadratic faces between two nodes."""
OFF_CONTACT_MM = 0.3
OFF_WALLS_MM = 1.0
"""Strip beside the walls that the second of the surface's figures leaves out."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """A published design and (x, y) of the press axis in its cavity [mm], in the middle of the width."""

    name: str
    at_mm: tuple[float, float]

    @property
    def design(self) -> SensorDesign:
        """The design."""
        return preset(self.name)

    @property
    def walls(self) -> Walls:
        """Distances of the walls [tip radii]; the third is the plane of symmetry."""
        cavity, (x, y) = self.design.cavity, self.at_mm
        east, north = cavity.length_mm - x, cavity.width_mm - y
        return x / TIP_RADIUS_MM, east / TIP_RADIUS_MM, 0.0, north / TIP_RADIUS_MM

    def grid_mm(self) -> tuple[FloatArray, FloatArray]:
        """(nx, 1) x and (1, ny) y of the compared nodes in the cavity frame [mm], walls included."""
        cavity = self.design.cavity
        x, y = (
            np.linspace(0.0, size, round(size / GRID_MM) + 1) for size in (cavity.length_mm, cavity.width_mm)
        )
        return x[:, None], y[None, :]

    def radius_mm(self) -> FloatArray:
        """(nx, ny) distance of the nodes from the press axis [mm]."""
        x, y = self.grid_mm()
        return np.hypot(x - self.at_mm[0], y - self.at_mm[1])


PLACES = {
    "pad middle": Place(name="piacenza2017-pad", at_mm=(16.0, 16.0)),
    "pair middle": Place(name="piacenza2017-pair", at_mm=(10.0, 10.0)),
    "pad near a wall": Place(name="piacenza2017-pad", at_mm=(6.0, 16.0)),
}


@dataclass(frozen=True, kw_only=True)
class SquarePress:
    """One press of the oracle.

    Attributes
    ----------
    force : of the whole pad [E R²]
    height_mm : (nx, ny) of the top over the undisturbed one, at the nodes of `Place.grid_mm` [mm]
    """

    force: float
    height_mm: FloatArray


@dataclass(frozen=True, kw_only=True)
class PressError:
    """The model over and less the oracle; sizes are (rms, largest).

    Attributes
    ----------
    force_ratio, mesh_force_ratio : modelled over the oracle's force, the oracle's coarser mesh over its finer one
    everywhere_um, off_walls_um : heights outside the contact, and those of them off the walls too [µm]
    mesh_um : the coarser mesh's heights less the finer one's, outside the contact [µm]
    """

    force_ratio: float
    everywhere_um: Size
    off_walls_um: Size
    mesh_force_ratio: float
    mesh_um: Size


@dataclass(frozen=True, kw_only=True)
class LightError:
    """Light of the curve less that of the oracle's top, over pairs and their untouched signals.

    Attributes
    ----------
    size, with_field, mesh : (rms, largest) [-]; of the curve, of the curve with `correction_fields`, and of the
        oracle's coarser mesh, all less that of its finer one
    claimed : root mean square of the standard errors of both traces [-]
    """

    size: Size
    with_field: Size
    mesh: Size
    claimed: float


def size_of(difference: FloatArray) -> Size:
    """Root mean square and largest."""
    return float(np.sqrt(np.mean(difference**2))), float(np.abs(difference).max())


def dense_top(rest: FloatArray, top: FloatArray) -> FloatArray:
    """(m, 3) points of the oracle's deformed top between its nodes, the elements' own polynomials.

    Parameters
    ----------
    rest : (2, n) places of the nodes at rest, a product of coordinates
    top : (n, 3) deformed nodes
    """
    axes = [np.unique(np.round(one, 9)) for one in rest]
    finer = [
        np.interp(np.arange(SAMPLES * (len(one) - 1) + 1) / SAMPLES, range(len(one)), one) for one in axes
    ]
    points = np.stack([one.ravel() for one in np.meshgrid(*finer, indexing="ij")])
    return np.stack([interpolated(rest, values, points, 2) for values in top.T], axis=1)


def heights_mm(place: Place, depth: float, points: FloatArray) -> FloatArray:
    """(nx, (ny + 1) / 2) height at the nodes from the plane of symmetry on [mm]: the exact tip in the contact.

    Parameters
    ----------
    depth : of the press [tip radii]
    points : (m, 3) of the deformed top from the press axis [tip radii]
    """
    x, y = place.grid_mm()
    y = y[:, y.shape[1] // 2 :]
    along, across = np.broadcast_arrays(
        (x - place.at_mm[0]) / TIP_RADIUS_MM, (y - place.at_mm[1]) / TIP_RADIUS_MM
    )
    found = heights(points, along, across, True)
    found[[0, -1]] = found[:, -1] = 0.0
    radius = np.hypot(along, across)
    tip = 1.0 - depth - np.sqrt(np.maximum(1.0 - radius**2, 0.0))
    return TIP_RADIUS_MM * np.where(radius < reference_state(LAYER, depth).contact_radius, tip, found)


def solve(place: Place, grading: BlockGrading) -> tuple[FloatArray, FloatArray]:
    """Forces (mesh, depth) [E R²] and heights (mesh, depth, nx, (ny + 1) / 2) [mm], the coarser mesh first."""
    tops = []
    solved = solve_block(place.walls, grading)
    for level, states in enumerate(solved):
        press = BlockPress(LAYER, place.walls, grading, POISSON_RATIO, level)
        rest = press.solid.nodes[:2, press.top_nodes]
        tops.append(
            [
                heights_mm(place, depth, dense_top(rest, top))
                for depth, top in zip(DEPTHS, states["top"], strict=True)
            ]
        )
    return np.array([states["force"] for states in solved]), np.array(tops)


def build(grading: BlockGrading, path: Path = STORED) -> None:
    """Solve everything and write the stored file."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for name, place in PLACES.items():
        arrays[f"{name}: force"], tops = solve(place, grading)
        arrays[f"{name}: height"] = tops.astype(np.float32)
    made_of = provenance(
        grading,
        "python -m tests.validation.contact.square_pad --solve",
        model="neo-Hookean block, hexahedra Q2/Q1, frictionless hemisphere with shank, bonded bottom and walls",
        axes="mesh (coarser, finer), depth, x, y from the plane of symmetry",
        depths_mm=DEPTHS_MM,
    )
    np.savez_compressed(path, provenance=made_of, **arrays)


@cache
def _stored() -> dict[str, FloatArray]:
    return read_arrays(STORED)


def square_press(name: str, depth_mm: float, *, half: bool = False) -> SquarePress:
    """The stored press of a place, one of `PLACES`, and depth, one of `DEPTHS_MM`; `half` takes the coarser mesh."""
    level, row = -2 if half else -1, DEPTHS_MM.index(depth_mm)
    top = _stored()[f"{name}: height"][level, row].astype(np.float64)
    return SquarePress(
        force=float(_stored()[f"{name}: force"][level, row]),
        height_mm=np.concatenate([top[:, :0:-1], top], axis=1),
    )


@njit(error_model="numpy")
def _heights(x, y, top):  # type: ignore[no-untyped-def]
    """(n,) height above the bottom at places (n,): the kernels cannot be called from Python."""
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = surface_height(x[i], y[i], top)
    return out


def engine_height_mm(place: Place, press: Indentation, field: SmoothField | None = None) -> FloatArray:
    """(nx, ny) height of the top over the undisturbed one that the light engine makes of a press [mm]."""
    scene = scene_of(place.design)
    fields = None if field is None else [field]
    rows, nodes = stack_tops([press], np.array([place.at_mm]), scene, fields).part(np.arange(1))
    x, y = np.broadcast_arrays(*place.grid_mm())
    found = _heights(x.ravel(), y.ravel(), Top(rows[0], nodes[0]))
    return np.reshape(found, x.shape) - scene.height_mm


def oracle_field(place: Place, press: Indentation, height_mm: FloatArray) -> SmoothField:
    """What has to be added to a press's curve for the (nx, ny) heights [mm], from its contact edge outward."""
    window = contact_window(place.radius_mm() / TIP_RADIUS_MM, press.contact_radius_mm / TIP_RADIUS_MM)
    added = window * (height_mm - engine_height_mm(place, press))
    cavity = place.design.cavity
    return smooth_field(lambda _x, _y: added, cavity.length_mm, cavity.width_mm, GRID_MM)


def is_outside_contact(place: Place, press: Indentation) -> BoolArray:
    """(nx, ny) nodes that are compared."""
    return np.asarray(place.radius_mm() >= press.contact_radius_mm + OFF_CONTACT_MM)


def is_off_walls(place: Place) -> BoolArray:
    """(nx, ny) nodes off the strip beside the walls."""
    cavity, (x, y) = place.design.cavity, place.grid_mm()
    room = np.minimum(np.minimum(x, cavity.length_mm - x), np.minimum(y, cavity.width_mm - y))
    return np.asarray(room > OFF_WALLS_MM - 1e-9)


def press_error(place: Place, press: Indentation, oracle: SquarePress, half: SquarePress) -> PressError:
    """A modelled press against the oracle's, and the oracle against its coarser mesh."""
    outside = is_outside_contact(place, press)
    off_um = 1e3 * (engine_height_mm(place, press) - oracle.height_mm)
    unit_n = modulus_mpa(place.design) * TIP_RADIUS_MM**2
    return PressError(
        force_ratio=press.force_n / (oracle.force * unit_n),
        everywhere_um=size_of(off_um[outside]),
        off_walls_um=size_of(off_um[outside & is_off_walls(place)]),
        mesh_force_ratio=half.force / oracle.force,
        mesh_um=size_of(1e3 * (half.height_mm - oracle.height_mm)[outside]),
    )


def light_errors(
    place: Place,
    presses: list[Indentation],
    tops_mm: list[FloatArray],
    halves_mm: list[FloatArray],
    accuracy: Accuracy = ACCURACIES["standard"],
) -> list[LightError]:
    """Light of presses against that of the oracle's tops, and of its coarser mesh, all (nx, ny) heights [mm]."""
    design, pairs = place.design, direct_path_pairs(cavity_of(place.design))
    rows = np.array([[*place.at_mm, press.depth_mm] for press in presses])
    untouched = trace(design, np.array([[*place.at_mm, 0.0]]), accuracy=accuracy).flux[0][pairs]
    plain = trace(design, rows, profile=presses, accuracy=accuracy)
    fields = [
        [oracle_field(place, press, top) for press, top in zip(presses, tops, strict=True)]
        for tops in (tops_mm, halves_mm)
    ]
    whole, half, corrected = (
        trace(design, rows, profile=presses, accuracy=accuracy, fields=of_states)
        for of_states in (*fields, correction_fields(design, rows))
    )
    error = (plain.flux - whole.flux)[:, pairs] / untouched
    with_field = (corrected.flux - whole.flux)[:, pairs] / untouched
    mesh = (half.flux - whole.flux)[:, pairs] / untouched
    claimed = np.hypot(plain.standard_error, whole.standard_error)[:, pairs] / untouched
    return [
        LightError(
            size=size_of(error[row]),
            with_field=size_of(with_field[row]),
            mesh=size_of(mesh[row]),
            claimed=size_of(claimed[row])[0],
        )
        for row in range(len(presses))
    ]


def modelled(place: Place, depth_mm: float) -> Indentation:
    """The design's press at a place."""
    return indent(place.design, depth_mm, place.at_mm)


HEAD = [
    "press",
    "depth mm",
    "force %",
    "surface: rms, largest µm",
    f"{OFF_WALLS_MM:g} mm off the walls",
    "light: rms, largest %",
    "with the walls' field",
    "claimed %",
    "oracle's meshes: force %",
    "surface µm",
    "light %",
]


def _pair(size: Size, scale: float, digits: int) -> str:
    return ", ".join(f"{scale * value:.{digits}f}" for value in size)


def _cells(name: str, depth_mm: float, error: PressError, light: LightError) -> list[str]:
    return [
        name,
        f"{depth_mm:g}",
        f"{100.0 * (error.force_ratio - 1.0):+.1f}",
        _pair(error.everywhere_um, 1.0, 0),
        _pair(error.off_walls_um, 1.0, 0),
        _pair(light.size, 100.0, 1),
        _pair(light.with_field, 100.0, 1),
        f"{100.0 * light.claimed:.1f}",
        f"{100.0 * (error.mesh_force_ratio - 1.0):+.1f}",
        _pair(error.mesh_um, 1.0, 0),
        _pair(light.mesh, 100.0, 1),
    ]


def table() -> str:
    """One line a press."""
    body = []
    for name, place in PLACES.items():
        presses = [modelled(place, depth_mm) for depth_mm in DEPTHS_MM]
        oracles, halves = (
            [square_press(name, depth_mm, half=half) for depth_mm in DEPTHS_MM] for half in (False, True)
        )
        lights = light_errors(
            place, presses, *([one.height_mm for one in tops] for tops in (oracles, halves))
        )
        for press, oracle, half, light in zip(presses, oracles, halves, lights, strict=True):
            body.append(_cells(name, press.depth_mm, press_error(place, press, oracle, half), light))
    return markdown_table(HEAD, body)


def main(arguments: list[str]) -> None:
    """Solve, or make the table."""
    if "--solve" in arguments:
        build(BlockGrading())
        return
    numba.set_num_threads(1)
    text = table()
    print(text)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
