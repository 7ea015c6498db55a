"""The mold and the bodies of its parts as data for the page's three-dimensional view.

The mesh is the printed one, moved back into the coordinate system of the cavity. Coordinates are whole numbers of
steps; a step is 1/32 000 of the mesh's longest side. This is 2 µm for a mold of 66 mm, which is finer than the mesh
itself. Triangles and creases are given by vertex numbers. Arrays are little-endian and written in base 64. The lid of a
crowned pad is rotated from the orientation in its file onto the mold.
"""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.mold.outline import MoldOutline, bed_lift_mm, outline_of
from optopad.design.shape.cavity import TURN_RAD, cavity_of
from optopad.design.spec import SensorDesign

if TYPE_CHECKING:
    from optopad.cad.mesh import Mesh


STEPS = 32_000
"""Number of steps along the longest side of the mesh."""
MOLD_STL, LID_STL = "cad/mold.stl", "cad/lid.stl"


def mold_scene(design: SensorDesign, folder: Path) -> dict[str, Any] | None:
    """The mold of a bundle and its parts for the view; None if the bundle has no mold.

    Returns
    -------
    - step: size of a step [mm]; low: (3,) lowest corner of the mesh [mm]
    - points: (n, 3) in steps from low; triangles, creases: (m, 3) and (k, 2) vertex numbers
    - outer: low and high corner of the mold [mm]; bodies: kind and eight corners of each part [mm]
    - mouth: corners of the opening at the rim, and its z [mm]
    - lid: mesh of the lid in its position on the mold; None if there is no lid
    """
    stl = folder / MOLD_STL
    if not stl.is_file():
        return None
    from optopad.cad.mesh import read_stl

    mesh = read_stl(stl.read_bytes())
    places = mesh.vertices.astype(np.float64) - np.array([0.0, 0.0, bed_lift_mm(design)])
    outline = outline_of(design)
    return {
        **_solid(mesh, places),
        "bodies": [[part.kind, part.body_mm.tolist()] for part in cavity_of(design).parts],
        "mouth": {"ring": _mouth_mm(outline), "z": outline.top_mm},
        "lid": _lid(design, folder / LID_STL),
    }


def _solid(mesh: Mesh, places_mm: FloatArray) -> dict[str, Any]:
    from optopad.cad.mesh import creases

    low, high = places_mm.min(axis=0), places_mm.max(axis=0)
    step = float((high - low).max()) / STEPS
    return {
        "step": step,
        "low": low.tolist(),
        "points": _packed(np.rint((places_mm - low) / step), "<u2"),
        "triangles": _packed(mesh.triangles, "<u4"),
        "creases": _packed(creases(mesh), "<u4"),
        "outer": [low.tolist(), high.tolist()],
    }


def _lid(design: SensorDesign, stl: Path) -> dict[str, Any] | None:
    """Mesh of the lid, rotated onto the mold; None if the design or the bundle has none."""
    if not stl.is_file():
        return None
    from optopad.cad.lid import lid_size, turned_over
    from optopad.cad.mesh import read_stl

    size = lid_size(design)
    if size is None:
        return None
    mesh = turned_over(read_stl(stl.read_bytes()), design, size)
    return _solid(mesh, mesh.vertices.astype(np.float64))


def _mouth_mm(outline: MoldOutline) -> list[list[float]]:
    """Corners of the opening at the rim [mm]."""
    inner, box = outline.plan.outline, outline.mouth
    opened = inner.in_box((box.x0, box.y0, box.x1, box.y1)) if outline.mouth_out_mm else inner
    corners: list[list[float]] = opened.points(TURN_RAD).tolist()
    return corners


def _packed(numbers: NDArray[Any], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers).astype(kind).tobytes()).decode("ascii")
