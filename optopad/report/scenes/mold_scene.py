"""The mold and the bodies of its parts as data for the page's three-dimensional view.

The mesh is the one that is printed, moved back into the cavity frame. Places are whole steps of a box's
longest side over 32 000, that is 2 µm for a mold of 66 mm: finer than the mesh itself. Triangles and creases
are vertex numbers. Arrays are little-endian and written in base 64.
"""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from design.geometry.cavity import CavityGeometry, PlacedPart, cavity_of
from design.geometry.mold_outline import bed_lift_mm, outline_of
from design.spec import SensorDesign

STEPS = 32_000
"""Steps that the longest side of the mesh is divided into."""
MOLD_STL = "cad/mold.stl"


def mold_scene(design: SensorDesign, folder: Path) -> dict[str, Any] | None:
    """The mold of a bundle and its parts for the view; None where the bundle has no mold.

    Returns
    -------
    step [mm], low (3) [mm], points (n, 3) in steps above low, triangles (m, 3) and creases (k, 2) as vertex numbers;
    bodies: kind, low corner, high corner [mm]; mouth: the opening at the rim, low and high x, y and its z [mm];
    outer: low and high corner of the mold [mm]
    """
    stl = folder / MOLD_STL
    if not stl.is_file():
        return None
    from cad.mesh import read_stl
    from cad.picture import creases

    mesh = read_stl(stl.read_bytes())
    places = mesh.vertices.astype(np.float64) - np.array([0.0, 0.0, bed_lift_mm(design)])
    low, high = places.min(axis=0), places.max(axis=0)
    step = float((high - low).max()) / STEPS
    mouth = outline_of(design).mouth
    cavity = cavity_of(design)
    return {
        "step": step,
        "low": low.tolist(),
        "points": _packed(np.rint((places - low) / step), "<u2"),
        "triangles": _packed(mesh.triangles, "<u4"),
        "creases": _packed(creases(mesh), "<u4"),
        "bodies": [[part.kind, *body_mm(part, cavity)] for part in cavity.parts],
        "mouth": [mouth.x0, mouth.x1, mouth.y0, mouth.y1, mouth.z1],
        "outer": [low.tolist(), high.tolist()],
    }


def _packed(numbers: NDArray[Any], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers).astype(kind).tobytes()).decode("ascii")


def body_mm(part: PlacedPart, cavity: CavityGeometry) -> tuple[list[float], list[float]]:
    """Low and high corner of a part's body; its face lies in the wall's inner plane [mm]."""
    half, deep = part.part.body_width_mm.value / 2, part.part.body_depth_mm.value
    inner = {"south": 0.0, "west": 0.0, "north": cavity.width_mm, "east": cavity.length_mm}[part.wall]
    outer = inner - deep if part.wall in ("south", "west") else inner + deep
    along = [part.along_mm - half, part.along_mm + half]
    across = sorted((inner, outer))
    x, y = (along, across) if part.wall in ("south", "north") else (across, along)
    return [x[0], y[0], part.body_base_mm], [x[1], y[1], part.body_top_mm]
