"""Exports the printed parts: STL, STEP and 3MF of the mold, STL of the other parts, and the report `checks.json`.

In every file the print bed is at z = 0. The mold and its pieces have the x and y of the cavity's coordinate system
(`optopad.design.shape.cavity`). The lid is turned over, and each tool has its own coordinate system (see its module).
Equal designs give equal bytes, because STEP is written without time and counters.

A folder receives either all new files or none, because they are written to a temporary folder and then moved. If the
folder contains a tool or piece from an earlier export that the current design does not have, it is removed.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cadquery as cq
import numpy as np

from optopad.cad.checks import Checks, PartFile, check_parts, with_slices
from optopad.cad.lid import lid, lid_size, turned_over
from optopad.cad.mesh import (
    CHORD_MM,
    Mesh,
    mesh_of,
    mold_picture,
    read_stl,
    section_picture,
    stl_bytes,
    threemf_bytes,
)
from optopad.cad.mold import build_mold, part_mold
from optopad.cad.tools import indenter_tip, leveling_blade, pour_gauge, solder_jig
from optopad.design.file_sets import written_together
from optopad.design.files import temporary_folder
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.parts.assumptions import Bed
from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign

FILES = (
    "mold.stl",
    "mold.step",
    "mold.3mf",
    "mold_frame.stl",
    "mold_base.stl",
    "lid.stl",
    "leveling_blade.stl",
    "pour_gauge.stl",
    "solder_jig.stl",
    "indenter_tip.stl",
    "checks.json",
    "mold.png",
    "lid.png",
)

ADAPTIVE_SHARE = 1e-7
"""Relative accuracy with which the CAD kernel must compute a lid's volume.

Over a face between a cone and a cylinder, the kernel's default integration has a relative error of 3e-6. Its adaptive
integration has one of 1e-9.
"""
_STEP_TIME = "1970-01-01T00:00:00"


def export_parts(
    design: SensorDesign,
    folder: str | os.PathLike[str],
    *,
    bed_mm: Bed | None = None,
    slice_parts: bool = False,
) -> dict[str, Path]:
    """Write all files of a design's printed parts.

    Parameters
    ----------
    folder : created if missing; files of the same names are replaced
    bed_mm : build volume of the printer for the checks; if None, that of a typical printer
    slice_parts : whether PrusaSlicer also slices the parts, which takes a few seconds for each part

    Returns
    -------
    Path of each written file, by file name. `leveling_blade.stl` is written for a black layer that is levelled with it,
    `solder_jig.stl` for parts in walls, and `pour_gauge.stl` for a flat top with a rim around it. `lid.stl` is written
    for a crowned pad, and `mold_frame.stl` and `mold_base.stl` for a mold made in two pieces.

    Raises
    ------
    DesignError : the design breaks a rule, such as a web that is too thin; nothing has been written.
    OutputError : the folder, or temporary files, cannot be written.
    InputError : slicing is requested but the slicer is not installed; nothing has been written.
    """
    contents = part_files(design, bed_mm=bed_mm, slice_parts=slice_parts)
    target = Path(folder)
    with written_together(target, stale=set(FILES) - set(contents)) as hidden:
        for name, content in contents.items():
            (hidden / name).write_bytes(content)
    return {name: target / name for name in contents}


def part_files(
    design: SensorDesign, *, bed_mm: Bed | None = None, slice_parts: bool = False
) -> dict[str, bytes]:
    """Content of every file, by file name."""
    lift, mold = bed_lift_mm(design), build_mold(design)
    mold_mesh = mesh_of(mold, lift, chord_mm=_chord_mm(design))
    title = f"{design.name} mold {design.mold_digest[:8]}"
    files = {
        "mold.stl": stl_bytes(mold_mesh),
        "mold.step": step_bytes(mold.translate((0, 0, lift)), design.name),
        "mold.3mf": threemf_bytes(mold_mesh, title),
    }
    printed = [_part_file("mold", files["mold.stl"], mold)]
    for part in (*_pieces(design, mold), *_lid(design), *_tools(design)):
        content = stl_bytes(part.mesh or mesh_of(part.solid, part.lift_mm))
        files[f"{part.name}.stl"] = content
        printed.append(_part_file(part.name, content, part.solid))
    checks = check_parts(design, tuple(printed), bed_mm=bed_mm)
    if slice_parts:
        checks = with_slices(checks, design, tuple(printed), bed_mm)
    files["checks.json"] = checks_bytes(checks)
    return files | _pictures(design, files)


def _pictures(design: SensorDesign, files: Mapping[str, bytes]) -> dict[str, bytes]:
    """Pictures of the mold, and of the mold and its lid cut through the middle, as PNG files."""
    mold, size = read_stl(files["mold.stl"]), lid_size(design)
    found = {"mold.png": mold_picture(mold)}
    if size is not None:
        lift = np.array([0.0, 0.0, bed_lift_mm(design)], dtype=np.float32)
        closed = (
            Mesh(vertices=mold.vertices - lift, triangles=mold.triangles),
            turned_over(read_stl(files["lid.stl"]), design, size),
        )
        found["lid.png"] = section_picture(closed, design.cavity.width_mm / 2)
    return found


@dataclass(frozen=True, kw_only=True)
class _Part:
    """A solid to print; `lift_mm` is the height by which it is raised onto the print bed.

    If `mesh` is given, it is written instead of the solid; it is already on the bed.
    """

    name: str
    solid: cq.Workplane
    lift_mm: float = 0.0
    mesh: Mesh | None = None


def _chord_mm(design: SensorDesign) -> float | None:
    """Largest chord height of the mold's faces [mm]: `CHORD_MM` if walls are round, else None (the default)."""
    return CHORD_MM if plan_of(design).outline.arcs else None


def _pieces(design: SensorDesign, mold: cq.Workplane) -> Iterator[_Part]:
    if design.mold.pieces == "one":
        return
    outline = outline_of(design)
    frame, base = part_mold(mold, outline)
    yield _Part(name="mold_frame", solid=frame, lift_mm=-outline.cavity_bottom_mm)
    yield _Part(name="mold_base", solid=base, lift_mm=bed_lift_mm(design))


def _lid(design: SensorDesign) -> Iterator[_Part]:
    solid, size = lid(design), lid_size(design)
    if solid is not None and size is not None:
        mesh = turned_over(mesh_of(solid, chord_mm=CHORD_MM), design, size)
        yield _Part(name="lid", solid=solid, mesh=mesh)


def _tools(design: SensorDesign) -> Iterator[_Part]:
    made = {
        "leveling_blade": leveling_blade(design),
        "pour_gauge": pour_gauge(design),
        "solder_jig": solder_jig(design),
        "indenter_tip": indenter_tip(design),
    }
    return (_Part(name=name, solid=solid) for name, solid in made.items() if solid is not None)


def checks_bytes(checks: Checks) -> bytes:
    """Content of `checks.json`."""
    return (json.dumps(checks.as_dict(), indent=2, allow_nan=False) + "\n").encode()


def step_bytes(part: cq.Workplane, name: str) -> bytes:
    """STEP text of a solid, without the time of writing and the kernel's counters."""
    with temporary_folder() as folder:
        path = Path(folder) / "part.step"
        part.val().exportStep(str(path))  # type: ignore[union-attr]
        text = path.read_text(encoding="utf-8")
    text = re.sub(r"(FILE_NAME\()'[^']*','[^']*'", rf"\g<1>'{name}','{_STEP_TIME}'", text, count=1)
    return re.sub(r"Open CASCADE STEP translator [\d.]+( [\d.]+)?", "optopad mold", text).encode()


def _part_file(name: str, stl: bytes, part: cq.Workplane) -> PartFile:
    tolerance = ADAPTIVE_SHARE if name == "lid" else None
    solid_mm3 = float(part.val().Volume(tolerance))  # type: ignore[union-attr]
    return PartFile(name=name, stl=stl, solid_mm3=solid_mm3)
