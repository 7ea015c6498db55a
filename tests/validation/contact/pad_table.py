"""The design's presses against those solved in three dimensions: force, surface, light.

    python -m tests.validation.contact.pad_table    the table of docs/validation/walls.md, two minutes

Compared are absolute heights, so the oracle's own mesh matters: every figure stands beside the one that elements of
twice the size give.

* Surface: the top that the light engine reads, less the oracle's height, at the nodes of a grid of 0.5 mm in the whole
  pad that are 0.3 mm or more outside the contact.
* Light: traced on that top less traced on the oracle's, over each pair's untouched signal, pairs of different walls.
  The oracle's field sets in over the 0.6 mm beside the contact, where its elements of 0.9 mm say little.

Left out: tips but the hemisphere of 3 mm, layers but 9 mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from numba import njit

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.draft import Draft
from optopad.design.shape.cavity import cavity_of, direct_path_pairs
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.accuracy import ACCURACIES, Accuracy
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import SmoothField, smooth_field
from optopad.sims.optics.surface.tops import Top, stack_tops, surface_height
from optopad.sims.optics.tracing import trace
from optopad.sims.press import Indentation
from tests.oracle.pressed import pressed_tops
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.contact.pad_oracle import (
    DEPTHS_MM,
    GRID_MM,
    PLACES,
    TIP_RADIUS_MM,
    PadPress,
    Place,
    pad_press,
)

Size = tuple[float, float]
"""Root mean square and largest of a difference."""

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "walls.md"
MARKS = "<!-- made by tests/validation/contact/pad_table.py -->", "<!-- end of pads -->"
OFF_CONTACT_MM = 0.3
SET_IN_MM = 0.6
"""Width beside the contact over which the oracle's height replaces the model's."""


@dataclass(frozen=True, kw_only=True)
class ModelTop:
    """The top that light is traced on.

    Attributes
    ----------
    near : the curve around the axis, with force and contact
    field : what is added to it
    """

    near: Indentation
    field: SmoothField


@dataclass(frozen=True, kw_only=True)
class PressError:
    """The model over and less the oracle; sizes are (rms, largest).

    Attributes
    ----------
    force_ratio, mesh_force_ratio : modelled over the oracle's force, the oracle's coarser mesh over its finer one
    surface_um : heights outside the contact [µm]
    mesh_um : the coarser mesh's heights less the finer one's, there [µm]
    """

    force_ratio: float
    surface_um: Size
    mesh_force_ratio: float
    mesh_um: Size


@dataclass(frozen=True, kw_only=True)
class LightError:
    """Light on the model's top less that on the oracle's, over pairs and their untouched signals.

    Attributes
    ----------
    size, mesh : (rms, largest) [-]; of the model's top, and of the oracle's coarser mesh, both less the finer one's
    claimed : root mean square of the standard errors of both traces [-]
    """

    size: Size
    mesh: Size
    claimed: float


def size_of(difference: FloatArray) -> Size:
    """Root mean square and largest."""
    return float(np.sqrt(np.mean(difference**2))), float(np.abs(difference).max())


def modelled(place: Place, depth_mm: float) -> ModelTop:
    """The design's press at a place."""
    tops = pressed_tops(place.design, np.array([[*place.at_mm, depth_mm]]))
    near, field = tops.near[0], tops.fields[0]
    assert near is not None
    assert field is not None
    return ModelTop(near=near, field=field)


@njit(error_model="numpy")
def _heights(x, y, top):  # type: ignore[no-untyped-def]
    """(n,) height above the bottom at places (n,): the kernels cannot be called from Python."""
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = surface_height(x[i], y[i], top)
    return out


def engine_height_mm(place: Place, near: Indentation, field: SmoothField | None = None) -> FloatArray:
    """(nx, ny) height of the top over the undisturbed one that the light engine makes of a press [mm]."""
    scene = scene_of(place.design)
    (row,), cells = stack_tops([near], np.array([place.at_mm]), scene, [field]).part(np.arange(1))
    x, y = np.meshgrid(*place.grid_mm(), indexing="ij")
    found = _heights(x.ravel(), y.ravel(), Top(row, cells[0]))
    return np.reshape(found, x.shape) - scene.height_mm


def oracle_field(place: Place, model: ModelTop, height_mm: FloatArray) -> SmoothField:
    """What is added to a press's curve for the (nx, ny) heights [mm], from its contact edge outward."""
    cavity = place.design.cavity
    share = np.clip((place.radius_mm() - model.near.contact_radius_mm) / SET_IN_MM, 0.0, 1.0)
    weight = share * share * (3.0 - 2.0 * share)
    own = engine_height_mm(place, model.near, model.field)
    wanted = own + weight * (height_mm - own) - engine_height_mm(place, model.near)
    return smooth_field(lambda _x, _y: wanted, cavity.length_mm, cavity.width_mm, GRID_MM)


def is_outside_contact(place: Place, near: Indentation) -> BoolArray:
    """(nx, ny) nodes that are compared."""
    return np.asarray(place.radius_mm() >= near.contact_radius_mm + OFF_CONTACT_MM)


def press_error(place: Place, model: ModelTop, oracle: PadPress, half: PadPress) -> PressError:
    """A modelled press against the oracle's, and the oracle against its coarser mesh."""
    outside = is_outside_contact(place, model.near)
    off_um = 1e3 * (engine_height_mm(place, model.near, model.field) - oracle.height_mm)
    unit_n = contact_of(place.design).draft.modulus.value * TIP_RADIUS_MM**2
    return PressError(
        force_ratio=model.near.force_n / (oracle.force * unit_n),
        surface_um=size_of(off_um[outside]),
        mesh_force_ratio=half.force / oracle.force,
        mesh_um=size_of(1e3 * (half.height_mm - oracle.height_mm)[outside]),
    )


def light_errors(
    place: Place,
    models: list[ModelTop],
    tops_mm: list[FloatArray],
    halves_mm: list[FloatArray],
    accuracy: Accuracy = ACCURACIES["standard"],
) -> list[LightError]:
    """Light of presses against that of the oracle's tops, and of its coarser mesh, all (nx, ny) heights [mm]."""
    design, pairs = place.design, direct_path_pairs(cavity_of(place.design))
    near = [model.near for model in models]
    rows = np.array([[*place.at_mm, press.depth_mm] for press in near])
    untouched = trace(Draft.of(design), np.array([[*place.at_mm, 0.0]]), accuracy=accuracy).flux[0][pairs]
    fields = [
        [model.field for model in models],
        *(
            [oracle_field(place, model, top) for model, top in zip(models, tops, strict=True)]
            for tops in (tops_mm, halves_mm)
        ),
    ]
    own, whole, half = (
        trace(Draft.of(design), rows, profile=near, accuracy=accuracy, fields=of_states)
        for of_states in fields
    )
    error = (own.flux - whole.flux)[:, pairs] / untouched
    mesh = (half.flux - whole.flux)[:, pairs] / untouched
    claimed = np.hypot(own.standard_error, whole.standard_error)[:, pairs] / untouched
    return [
        LightError(size=size_of(error[row]), mesh=size_of(mesh[row]), claimed=size_of(claimed[row])[0])
        for row in range(len(models))
    ]


HEAD = [
    "press",
    "depth mm",
    "force %",
    "surface: rms, largest µm",
    "light: rms, largest %",
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
        _pair(error.surface_um, 1.0, 0),
        _pair(light.size, 100.0, 1),
        f"{100.0 * light.claimed:.1f}",
        f"{100.0 * (error.mesh_force_ratio - 1.0):+.1f}",
        _pair(error.mesh_um, 1.0, 0),
        _pair(light.mesh, 100.0, 1),
    ]


def table() -> str:
    """One line a press."""
    body = []
    for name, place in PLACES.items():
        models = [modelled(place, depth_mm) for depth_mm in DEPTHS_MM]
        oracles, halves = (
            [pad_press(name, depth_mm, half=half) for depth_mm in DEPTHS_MM] for half in (False, True)
        )
        lights = light_errors(place, models, *([one.height_mm for one in tops] for tops in (oracles, halves)))
        for model, oracle, half, light in zip(models, oracles, halves, lights, strict=True):
            body.append(_cells(name, model.near.depth_mm, press_error(place, model, oracle, half), light))
    return markdown_table(HEAD, body)


def main() -> None:
    """Make the table."""
    numba.set_num_threads(1)
    text = table()
    print(text)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main()
