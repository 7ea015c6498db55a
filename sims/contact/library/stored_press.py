"""Solved presses into one layer: cached in memory and on disk, and solved if they are in neither cache.

On disk there is one .npz file per entry, named by a hash of all inputs of the solution. A file contains only plain
arrays, so reading it runs no code. It is written completely or not at all, even if several processes write it at once.
A file that cannot be read, or does not match its name, counts as missing and is replaced.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import OutputError
from optopad.design.files import whole_file
from optopad.design.plain_arrays import plain_arrays
from optopad.sims.cache import CACHE_VARIABLE
from optopad.sims.cache import cache_folder as folder_of_all
from optopad.sims.contact.scope import WALL_RADIUS
from optopad.sims.contact.tip import HEMISPHERE, TipOutline


@dataclass(frozen=True, kw_only=True)
class UnitPress:
    """Solved equilibrium states of one layer under one tip; lengths in tip radii R, forces in E R².

    Attributes
    ----------
    layer_depth, wall_radius : layer thickness on the axis, and radius of the bonded wall
    mesh_size : node spacing under the tip
    wedge_angle : opening angle of the solved wedge about the axis [rad]
    poisson_ratio : Poisson's ratio of the layer [-]
    tip_rows : (piece, 7) outline of the tip, one array row per line or arc; see `TipOutline`
    depths : (depth,) solved press depths, increasing, without 0
    rest_radii : (node,) radii of the top nodes at rest, from the axis to the wall
    radii, heights : (depth, node) points of the deformed top; heights are above the undeformed apex
    normal_force : (depth, node) force of the tip on each top node, for the full circle; positive where the tip presses
    force, contact_radius : (depth,) force on the tip, and radius of the contact edge
    reaction : (depth,) vertical reaction of the bonded surfaces, computed from the deformed shape alone
    penetration, last_step : (depth,) deepest overlap with the tip, and largest motion of a vertex in the last solver
        step
    chatter : (depth,) spread of the iterates if the solver ended in a cycle; 0 if it came to rest
    smallest_stretch : (depth,) smallest volume ratio of an element [-]
    volume_loss : (depth,) volume lost by compression [R³]
    energy : (depth,) elastic energy of the layer [E R³]
    versions : names and versions of the programs that computed the states
    crown : tip radius over the radius of the top's sphere; 0 is flat [-]
    """

    layer_depth: float
    wall_radius: float
    mesh_size: float
    wedge_angle: float
    poisson_ratio: float
    tip_rows: FloatArray
    depths: FloatArray
    rest_radii: FloatArray
    radii: FloatArray
    heights: FloatArray
    normal_force: FloatArray
    force: FloatArray
    contact_radius: FloatArray
    reaction: FloatArray
    penetration: FloatArray
    last_step: FloatArray
    chatter: FloatArray
    smallest_stretch: FloatArray
    volume_loss: FloatArray
    energy: FloatArray
    versions: tuple[str, ...]
    crown: float = 0.0

    @property
    def deepest(self) -> float:
        """Deepest solved press [tip radii]."""
        return float(self.depths[-1])

    @cached_property
    def tip(self) -> TipOutline:
        """Outline of the pressing tip."""
        return TipOutline.from_rows(self.tip_rows)


RECIPE = 13
"""Version of the solver that computes stored solutions. Raise it when results change."""

_SOLVED: dict[str, UnitPress] = {}
"""Solutions known to this process, by the hash of their inputs, on which alone they depend."""


@cache
def _mujoco_version() -> str:
    """Version of MuJoCo; looked up only once, because this reads the package's metadata from disk."""
    return version("mujoco")


@dataclass(frozen=True, kw_only=True)
class PressInputs:
    """All inputs of a solution; lengths in tip radii.

    Attributes
    ----------
    layer : layer thickness
    mesh_size : node spacing under the tip in the mesh
    depths : increasing depths to solve
    poisson_ratio : Poisson's ratio of the layer [-]
    tip : outline of the pressing tip
    wall_radius : radius of the bonded wall
    crown : tip radius over the radius of the top's sphere; 0 is flat [-]
    """

    layer: float
    mesh_size: float
    depths: tuple[float, ...]
    poisson_ratio: float
    tip: TipOutline = HEMISPHERE
    wall_radius: float = WALL_RADIUS
    crown: float = 0.0

    def key(self) -> str:
        """Name of the stored solution: a hash of all inputs, leaving out a `crown` of 0."""
        return entry_key(
            {
                "layer": round(self.layer, 9),
                "mesh": round(self.mesh_size, 9),
                "depths": self.depths,
                "poisson": self.poisson_ratio,
                "tip": self.tip.rows,
                "wall": round(self.wall_radius, 9),
                "recipe": RECIPE,
                "mujoco": _mujoco_version(),
                **({"crown": round(self.crown, 9)} if self.crown else {}),
            }
        )


def stored_press(
    inputs: PressInputs, on_step: Callable[[float], None] | None = None
) -> tuple[UnitPress, tuple[str, ...]]:
    """A press's solved states, from a cache or else solved and stored now, and notes for the user.

    Parameters
    ----------
    inputs : all inputs of the solution
    on_step : called with the fraction done (0 to 1) while solving

    Raises
    ------
    ContactSolveError : a state fails its checks
    """
    key = inputs.key()
    notes: tuple[str, ...] = ()
    if key not in _SOLVED:
        press = read_entry(key)
        if press is None:
            press = _solve(inputs, on_step)
            note = write_entry(key, press)
            notes = (note,) if note else ()
        _SOLVED[key] = press
    return _SOLVED[key], notes


FORMAT = 1
"""Version of the entry file's layout."""
MOST_BYTES = 50_000_000
"""Largest accepted size of an entry file [bytes]; the largest in use take a few hundred kB."""
_SCALARS = ("layer_depth", "wall_radius", "crown", "mesh_size", "wedge_angle", "poisson_ratio")
_MAY_LACK = {"crown": 0.0}
"""Fields that may be missing from the entry of a flat layer, and the values that they then have."""
_CHECKS = ("reaction", "penetration", "last_step", "chatter", "smallest_stretch", "volume_loss", "energy")
_PER_STATE = ("radii", "heights", "normal_force")


def cache_folder() -> Path:
    """Cache folder of the stored presses."""
    return folder_of_all() / "contact"


def entry_key(inputs: Mapping[str, object]) -> str:
    """SHA-256 over the inputs of a solution, as 64 hexadecimal digits."""
    text = json.dumps({"format": FORMAT, **inputs}, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def entry_path(key: str) -> Path:
    """Path of the file in which the press with a key is stored."""
    return cache_folder() / f"{key}.npz"


def _is_whole(press: UnitPress) -> bool:
    """Whether all arrays of a press are finite and their shapes agree."""
    depths, nodes = press.depths.size, press.rest_radii.size
    shapes = dict.fromkeys(_PER_STATE, (depths, nodes)) | {
        "rest_radii": (nodes,),
        "tip_rows": (len(press.tip_rows), 7),
    }
    arrays = {f.name: getattr(press, f.name) for f in fields(press) if f.name not in (*_SCALARS, "versions")}
    return depths > 0 and all(
        array.shape == shapes.get(name, (depths,)) and bool(np.isfinite(array).all())
        for name, array in arrays.items()
    )


def read_entry(key: str) -> UnitPress | None:
    """The press stored under a key; None if there is none, or if its file cannot be used."""
    try:
        entry = plain_arrays(entry_path(key), most_bytes=MOST_BYTES)
        if str(entry["key"]) != key:
            return None
        found: dict[str, object] = {
            f.name: entry[f.name] for f in fields(UnitPress) if f.name in entry or f.name not in _MAY_LACK
        }
    except (OSError, ValueError, KeyError):
        return None
    found = _MAY_LACK | found
    found |= {name: float(np.asarray(found[name])) for name in _SCALARS}
    found["versions"] = tuple(str(text) for text in np.atleast_1d(np.asarray(found["versions"])))
    press = UnitPress(**found)  # type: ignore[arg-type]
    return press if _is_whole(press) else None


def _arrays(press: UnitPress) -> dict[str, np.ndarray[Any, Any]]:
    return {field.name: np.array(getattr(press, field.name)) for field in fields(press)}


def write_entry(key: str, press: UnitPress) -> str | None:
    """Store a press under a key; return None, or a note for the user that says why it could not be stored."""
    path = entry_path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as hidden, hidden.open("wb") as file:
            np.savez(file, allow_pickle=False, key=np.array(key), **_arrays(press))
    except (OSError, OutputError) as err:
        cause = err.__cause__ or err
        reason = getattr(cause, "strerror", None) or str(cause)
        return f"contact solution not stored in {path.parent} ({reason}); set {CACHE_VARIABLE} to a writable folder"
    return None


def _solve(inputs: PressInputs, on_step: Callable[[float], None] | None) -> UnitPress:
    """Press a tip of radius 1 into a layer of modulus 1 with MuJoCo.

    Raises
    ------
    InputError, ModelScopeError : the crown is not finite or is negative, or leaves too thin a rim
    ContactSolveError : a state fails its checks
    """
    # MuJoCo is imported only here, so that reading stored solutions does not need it
    from optopad.sims.contact.library.smooth_press import contact_tolerance, surface_curve
    from optopad.sims.contact.mesh import radial_mesh
    from optopad.sims.contact.wedge import WEDGE_ANGLE, solve_wedge

    layer_depth, wall_radius, crown = (round(x, 9) for x in (inputs.layer, inputs.wall_radius, inputs.crown))
    mesh = radial_mesh(layer_depth, wall_radius, round(inputs.mesh_size, 9), crown)
    solution = solve_wedge(mesh, inputs.depths, inputs.poisson_ratio, on_step, inputs.tip)
    spacing = float(mesh.nodes[mesh.top[1], 0])
    tolerance = contact_tolerance(spacing, WEDGE_ANGLE)
    contact = [
        surface_curve(
            radius, height, float(depth), spacing=spacing, tolerance=tolerance, tip=inputs.tip, crown=crown
        ).contact_radius
        for radius, height, depth in zip(solution.radii, solution.heights, solution.depths, strict=True)
    ]
    checks = {name: np.array([getattr(check, name) for check in solution.checks]) for name in _CHECKS}
    return UnitPress(
        layer_depth=layer_depth,
        wall_radius=wall_radius,
        crown=crown,
        mesh_size=spacing,
        wedge_angle=WEDGE_ANGLE,
        poisson_ratio=inputs.poisson_ratio,
        tip_rows=np.array(inputs.tip.rows),
        depths=solution.depths,
        rest_radii=mesh.nodes[mesh.top, 0],
        radii=solution.radii,
        heights=solution.heights,
        normal_force=solution.normal_force,
        force=solution.force,
        contact_radius=np.array(contact),
        versions=(f"mujoco {version('mujoco')}",),
        **checks,
    )
