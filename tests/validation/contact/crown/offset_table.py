"""Presses beside the apex of a crowned pad: the model of local thickness against three dimensions.

    python -m tests.validation.contact.crown.offset_table

finds the model's presses (in the shipped library, or, in pads too narrow for it, solved by MuJoCo and kept in
`build/validation/`: ten minutes), adds them to `offset_oracle.npz`, and prints the tables, which `offset_table.md`
holds too. The oracle's solutions are those of `offset_oracle`.

The model takes a press beside the apex for one at the apex of a pad of the same crown and wall, as thick there as this
one is at the place (`thicknesses_mm`), and lays that surface around the axis of the press. Heights are those above the
untouched top along that axis, followed to the nearest wall and run out to the farthest one (`run_out`).

Errors are the model's surface less the oracle's, along the normal of the oracle's, as means over its rest area. They
count from 0.3 mm outside the model's contact, to 3 tip radii from the axis or to the wall. A side is the quarter turn
about its direction, within 3 tip radii.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.rules.shape import WALL_RADIUS_RANGE
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.library.smooth_press import TopCurve, run_out
from optopad.sims.contact.library.stored_press import CACHE_VARIABLE
from tests.validation.contact.contact_reference import BUILD
from tests.validation.contact.contact_table import markdown_table
from tests.validation.contact.crown.crown_oracle import Crown
from tests.validation.contact.crown.crown_reference import SHARP, crown_state
from tests.validation.contact.crown.crowned_press import CrownedPad, CrownedPress, crowned_press
from tests.validation.contact.crown.offset_oracle import (
    PADS,
    STORED,
    OffsetPad,
    StoredState,
    offset_state,
    read_arrays,
)
from tests.validation.contact.pad_oracle import dense_top
from tests.validation.elements.continuation import interpolated

Size = tuple[float, float]
"""Root mean square and largest of a difference."""

FRAGMENT = STORED.with_name("offset_table.md")
OFF_CONTACT_MM = 0.3
NEAR = 3.0
"""Radius to which surfaces are compared [tip radii]."""
FLAT_CROWN_MM = 1e6
"""Crown radius that stands for a flat top where one must be given [mm]."""
FIELDS = ("radius_mm", "height_mm", "contact_radius_mm", "force_n")


@dataclass(frozen=True, kw_only=True)
class Surface:
    """The oracle's deformed top in the frame of the press, a grid over half the pad.

    Attributes
    ----------
    points_mm, normals : (nx, ny, 3)
    share : (nx, ny) rest area that each point stands for
    """

    points_mm: FloatArray
    normals: FloatArray
    share: FloatArray

    @property
    def radius_mm(self) -> FloatArray:
        """(nx, ny) distance from the axis of the press [mm]."""
        return np.asarray(np.hypot(self.points_mm[..., 0], self.points_mm[..., 1]))

    def side(self, sign: float) -> BoolArray:
        """(nx, ny) points of the quarter turn towards the rim (1) or the apex (-1)."""
        along, across = self.points_mm[..., 0], self.points_mm[..., 1]
        return np.asarray(sign * along > np.abs(across))


@dataclass(frozen=True, kw_only=True)
class ModelPress:
    """One press of the model; heights above the untouched top, along the axis of the press."""

    radius_mm: FloatArray
    height_mm: FloatArray
    contact_radius_mm: float
    force_n: float


@dataclass(frozen=True, kw_only=True)
class OffsetError:
    """The model over and less the oracle; sizes are (rms, largest) [µm].

    Attributes
    ----------
    force_ratio : modelled over the oracle's force
    near_um, pad_um : surface to 3 tip radii from the axis, and to the wall
    apex_um, rim_um : mean on the side of the apex, and of the rim
    """

    force_ratio: float
    near_um: Size
    pad_um: Size
    apex_um: float
    rim_um: float


def thicknesses_mm(pad: OffsetPad) -> dict[str, float]:
    """What the model may take for the thickness of the layer [mm]: at the place, upright or along the normal."""
    upright = pad.layer_mm + float(pad.chart.origin[2]) * pad.tip_mm
    slanting = upright / float(pad.chart.frame[2, 2])
    return {"local": upright} | ({"along the normal": slanting} if slanting > upright else {})


def solved_press(pad: OffsetPad, layer_mm: float) -> CrownedPress:
    """The model's presses of a layer of this thickness [mm]: the library's, or live in pads too narrow for it."""
    whole = CrownedPad(
        tip_radius_mm=pad.tip_mm,
        crown_radius_mm=min(pad.crown_mm, FLAT_CROWN_MM),
        elastic_depth_mm=layer_mm,
        pad_radius_mm=pad.wall_mm,
        youngs_modulus_mpa=1.0,
    )
    if whole.wall_radius < WALL_RADIUS_RANGE[0]:
        return crowned_press(whole, pad.depths_mm[-1])
    smooth = shipped_library().press(whole.layer, whole.wall_radius, pad.tip_mm / pad.crown_mm)
    return CrownedPress(pad=whole, smooth=smooth)


def solve(path: Path = STORED) -> None:
    """Solve the model's presses and write them beside the oracle's."""
    os.environ[CACHE_VARIABLE] = str(BUILD)
    held = {name: array for name, array in read_arrays(path).items() if not name.startswith("model/")}
    for name, pad in PADS.items():
        for kind, layer_mm in thicknesses_mm(pad).items():
            press = solved_press(pad, layer_mm)
            for depth_mm in pad.depths_mm:
                found = press.at(depth_mm)
                for key in FIELDS:
                    held[f"{_name(name, kind, depth_mm)}/{key}"] = np.float32(getattr(found, key))
            print(f"{name}, {kind}: {layer_mm:.3f} mm thick, solved", flush=True)
    held["model/versions"] = np.array([f"mujoco {version('mujoco')}"])
    np.savez_compressed(path, **held)  # type: ignore[arg-type]


def _name(name: str, kind: str, depth_mm: float) -> str:
    return f"model/{name}/{kind}/{depth_mm:g}"


def model_press(name: str, kind: str, depth_mm: float, path: Path = STORED) -> ModelPress:
    """A stored press of the model; KeyError where there is none."""
    with np.load(path, allow_pickle=False) as stored:
        held = {key: stored[f"{_name(name, kind, depth_mm)}/{key}"].astype(float) for key in FIELDS}
    return ModelPress(
        radius_mm=held["radius_mm"],
        height_mm=held["height_mm"],
        contact_radius_mm=float(held["contact_radius_mm"]),
        force_n=float(held["force_n"]),
    )


def _points_mm(pad: OffsetPad, flat: FloatArray, moved_mm: FloatArray) -> FloatArray:
    """(n, 3) deformed points in the frame of the press [mm], of (n, 3) points of the block and displacements."""
    rest = pad.chart.places(flat.T).T
    return pad.tip_mm * pad.chart.in_press(rest + moved_mm / pad.tip_mm)


def run_out_to_walls(pad: OffsetPad, press: ModelPress) -> ModelPress:
    """The press as light sees it: followed to the nearest wall, run out to the farthest one."""
    is_further = np.diff(np.maximum.accumulate(press.radius_mm), prepend=-1.0) > 1e-9
    radius, height = press.radius_mm[is_further], press.height_mm[is_further]
    curve = TopCurve(
        radius=radius,
        height=height,
        inclination=np.arctan(np.gradient(height, radius)),
        contact_radius=press.contact_radius_mm,
    )
    if pad.offset_mm > 0.0:
        curve = run_out(curve, pad.wall_mm - pad.offset_mm, 2.0 * pad.offset_mm)
    return replace(press, radius_mm=curve.radius, height_mm=curve.height)


def surface(pad: OffsetPad, state: StoredState) -> tuple[Surface, FloatArray]:
    """The oracle's top between its nodes, and its points (n, 3) in the block."""
    nodes = state.flat.T
    flat = dense_top(nodes, np.column_stack([state.flat, np.zeros(len(state.flat))]))
    ticks = [np.unique(np.round(one, 9)) for one in flat.T[:2]]
    shape = tuple(len(one) for one in ticks)
    points = _points_mm(pad, flat, dense_top(nodes, state.moved_mm)).reshape(*shape, 3)
    across = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    jacobian = pad.chart.jacobian(flat.T)
    area = np.linalg.norm(np.cross(jacobian[..., 0], jacobian[..., 1]), axis=-1).reshape(shape)
    lengths = [np.convolve(np.diff(one), [0.5, 0.5]) for one in ticks]
    normals = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
    return Surface(points_mm=points, normals=normals, share=area * np.outer(*lengths)), flat


def mesh_difference_um(pad: OffsetPad, fine: StoredState, half: StoredState) -> FloatArray:
    """(nx, ny) the coarser mesh's surface less the finer one's, along its normal [µm]."""
    top, flat = surface(pad, fine)
    moved = np.stack([interpolated(half.flat.T, values, flat.T[:2], 2) for values in half.moved_mm.T], axis=1)
    other = _points_mm(pad, flat, moved).reshape(top.points_mm.shape)
    return 1e3 * np.asarray(((other - top.points_mm) * top.normals).sum(axis=-1))


def model_difference_um(pad: OffsetPad, top: Surface, press: ModelPress) -> FloatArray:
    """(nx, ny) the model's surface less the oracle's, along its normal [µm]."""
    radius = top.radius_mm
    untouched = -pad.tip_mm * Crown(pad.chart.curvature).drop(radius / pad.tip_mm)
    outward = np.maximum.accumulate(press.radius_mm)
    modelled = untouched + np.interp(radius, outward, press.height_mm, right=0.0)
    return 1e3 * (modelled - top.points_mm[..., 2]) * top.normals[..., 2]


def _size(difference: FloatArray, share: FloatArray) -> Size:
    return float(np.sqrt(np.average(difference**2, weights=share))), float(np.abs(difference).max())


def error_of(
    pad: OffsetPad, top: Surface, difference_um: FloatArray, force_ratio: float, edge_mm: float
) -> OffsetError:
    """The measures of a difference (nx, ny) [µm] outside a contact of radius `edge_mm` [mm]."""
    radius = top.radius_mm
    outside = radius >= edge_mm + OFF_CONTACT_MM
    near = outside & (radius <= NEAR * pad.tip_mm)
    apex, rim = (near & top.side(sign) for sign in (-1.0, 1.0))
    return OffsetError(
        force_ratio=force_ratio,
        near_um=_size(difference_um[near], top.share[near]),
        pad_um=_size(difference_um[outside], top.share[outside]),
        apex_um=float(np.average(difference_um[apex], weights=top.share[apex])),
        rim_um=float(np.average(difference_um[rim], weights=top.share[rim])),
    )


@cache
def errors(name: str, depth_mm: float) -> dict[str, OffsetError]:
    """Errors of the model by what it takes for the thickness, and of the oracle's coarser mesh ("mesh")."""
    pad, fine, half = PADS[name], offset_state(name, depth_mm), offset_state(name, depth_mm, half=True)
    top, _ = surface(pad, fine)
    force_n = float(fine.force_n[2])
    presses = {kind: run_out_to_walls(pad, model_press(name, kind, depth_mm)) for kind in thicknesses_mm(pad)}
    found = {
        kind: error_of(
            pad, top, model_difference_um(pad, top, one), one.force_n / force_n, one.contact_radius_mm
        )
        for kind, one in presses.items()
    }
    meshes = mesh_difference_um(pad, fine, half), float(half.force_n[2]) / force_n
    return found | {"mesh": error_of(pad, top, *meshes, presses["local"].contact_radius_mm)}


def rise_of(name: str, depth_mm: float) -> OffsetError:
    """The oracle's surface less the untouched top, in the measures of an error, outside the model's contact."""
    pad, edge_mm = PADS[name], model_press(name, "local", depth_mm).contact_radius_mm
    top, _ = surface(pad, offset_state(name, depth_mm))
    untouched = ModelPress(
        radius_mm=np.zeros(1), height_mm=np.zeros(1), contact_radius_mm=edge_mm, force_n=0.0
    )
    return error_of(pad, top, -model_difference_um(pad, top, untouched), 0.0, edge_mm)


@cache
def apex_errors(depth_mm: float) -> dict[str, OffsetError]:
    """Errors of both meshes at the apex, "fine" and "half", against the axisymmetric oracle."""
    pad, found = PADS["apex"], {}
    state = crown_state(SHARP, depth_mm / pad.tip_mm)
    radius, height = (pad.tip_mm * one for one in state.curve())
    untouched = -pad.tip_mm * Crown(pad.chart.curvature).drop(np.minimum(radius / pad.tip_mm, SHARP.wall))
    force_n = pad.tip_mm**2 * state.force
    exact = ModelPress(
        radius_mm=radius,
        height_mm=height - untouched,
        contact_radius_mm=pad.tip_mm * state.contact_radius,
        force_n=force_n,
    )
    for mesh in ("fine", "half"):
        one = offset_state("apex", depth_mm, half=mesh == "half")
        top, _ = surface(pad, one)
        difference = -model_difference_um(pad, top, exact)
        found[mesh] = error_of(pad, top, difference, float(one.force_n[2]) / force_n, exact.contact_radius_mm)
    return found


HEAD = [
    "press",
    "depth mm",
    "thickness",
    "mm",
    "force N",
    "the oracle's rise: towards the apex, the rim µm",
    "force %",
    "surface to 3 radii: rms, largest µm",
    "to the wall: rms, largest µm",
    "mean: towards the apex, the rim µm",
]
APEX_HEAD = [HEAD[1], "elements", *HEAD[6:9]]


def figures(error: OffsetError) -> list[str]:
    return [
        f"{100.0 * (error.force_ratio - 1.0):+.1f}",
        *(f"{rms:.0f}, {largest:.0f}" for rms, largest in (error.near_um, error.pad_um)),
    ]


def _rows(name: str, depth_mm: float) -> list[list[str]]:
    thickness, force_n = thicknesses_mm(PADS[name]), offset_state(name, depth_mm).force_n[2]
    rise = rise_of(name, depth_mm)
    return [
        [
            name,
            f"{depth_mm:g}",
            "the oracle's coarser mesh" if kind == "mesh" else kind,
            f"{thickness[kind]:.2f}" if kind in thickness else "",
            f"{force_n:.3f}",
            f"{rise.apex_um:.0f}, {rise.rim_um:.0f}",
            *figures(error),
            f"{error.apex_um:+.0f}, {error.rim_um:+.0f}",
        ]
        for kind, error in errors(name, depth_mm).items()
    ]


def markdown() -> str:
    """The pads, the oracle at the apex, and the model against the oracle."""
    pads = [
        f"* {name}: crown {pad.crown_mm:g} mm, {pad.layer_mm:g} mm thick at the apex, wall {pad.wall_mm:g} mm, tip "
        f"{pad.tip_mm:g} mm, pressed {pad.offset_mm:g} mm off the apex"
        for name, pad in PADS.items()
    ]
    apex = [
        [f"{depth:g}", {"fine": "0.25 radii", "half": "0.5"}[mesh], *figures(error)]
        for depth in PADS["apex"].depths_mm
        for mesh, error in apex_errors(depth).items()
    ]
    body = [row for name, pad in PADS.items() for depth in pad.depths_mm for row in _rows(name, depth)]
    return "\n\n".join(
        [
            f"Made with mujoco {version('mujoco')} and scikit-fem {version('scikit-fem')}. Modulus 1 MPa.",
            "\n".join(pads),
            "The oracle of three dimensions at the apex against the axisymmetric one:",
            markdown_table(APEX_HEAD, apex),
            "The model, and the oracle's coarser mesh, against the finer one:",
            markdown_table(HEAD, body),
        ]
    )


def main() -> None:
    """Solve what is missing, compare, write."""
    solve()
    text = markdown()
    FRAGMENT.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
