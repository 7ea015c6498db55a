"""The files of the printed parts: STL, STEP and 3MF of the mold, STL of the tools, the checks.

In every file the print bed is z = 0 and x, y are those of the cavity frame; the tools have frames of their
own (see their modules). Equal designs give equal bytes: STEP is written without time and counters.

A folder gets either all files or none of the new ones: they are written beside it and moved into
place. A blade left over from a design with a black layer is removed when the design has none.
"""

from __future__ import annotations

import json
import os
import re
import tempfile
from pathlib import Path

import cadquery as cq

from cad.checks import Checks, PartFile, check_parts
from cad.indenter_tip import indenter_tip, indenter_tip_volume_mm3
from cad.leveling_blade import blade_size, leveling_blade
from cad.mesh import mesh_of, stl_bytes, threemf_bytes
from cad.mold import build_mold
from cad.volume import mold_volume_mm3
from design.mold_outline import bed_lift_mm
from design.spec import SensorDesign

FILES = (
    "mold.stl",
    "mold.step",
    "mold.3mf",
    "leveling_blade.stl",
    "indenter_tip.stl",
    "checks.json",
)

_STEP_TIME = "1970-01-01T00:00:00"


def export_parts(design: SensorDesign, folder: str | os.PathLike[str]) -> dict[str, Path]:
    """Write all files of a design's printed parts.

    Parameters
    ----------
    folder : made if missing; files of the same names are replaced

    Returns
    -------
    path of each written file by its name; `leveling_blade.stl` only with a black layer

    Raises
    ------
    DesignError : the design breaks a rule, such as a web that is too thin; nothing has been written.
    """
    contents = part_files(design)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target, prefix=".partial-") as partial:
        for name, content in contents.items():
            (Path(partial) / name).write_bytes(content)
        for name in contents:
            os.replace(Path(partial) / name, target / name)
    for stale in set(FILES) - set(contents):
        (target / stale).unlink(missing_ok=True)
    return {name: target / name for name in contents}


def part_files(design: SensorDesign) -> dict[str, bytes]:
    """Content of every file by its name."""
    lift = bed_lift_mm(design)
    mold, blade, tip = build_mold(design), leveling_blade(design), indenter_tip(design)
    mold_mesh = mesh_of(mold, lift)
    title = f"{design.name} mold {design.digest[:8]}"
    files = {
        "mold.stl": stl_bytes(mold_mesh),
        "mold.step": step_bytes(mold.translate((0, 0, lift)), design.name),
        "mold.3mf": threemf_bytes(mold_mesh, title),
        "indenter_tip.stl": stl_bytes(mesh_of(tip)),
    }
    printed = [
        _part_file("mold", files, mold, mold_volume_mm3(design)),
        _part_file("indenter_tip", files, tip, indenter_tip_volume_mm3(design)),
    ]
    size = blade_size(design)
    if blade is not None and size is not None:
        files["leveling_blade.stl"] = stl_bytes(mesh_of(blade))
        printed.append(_part_file("leveling_blade", files, blade, size.volume_mm3))
    files["checks.json"] = checks_bytes(check_parts(design, tuple(printed)))
    return files


def checks_bytes(checks: Checks) -> bytes:
    """Text of checks.json."""
    return (json.dumps(checks.as_dict(), indent=2, allow_nan=False) + "\n").encode()


def step_bytes(part: cq.Workplane, name: str) -> bytes:
    """STEP text of a solid, without the time of writing and the process's counters."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.step"
        part.val().exportStep(str(path))  # type: ignore[union-attr]
        text = path.read_text(encoding="utf-8")
    text = re.sub(r"(FILE_NAME\()'[^']*','[^']*'", rf"\g<1>'{name}','{_STEP_TIME}'", text, count=1)
    return re.sub(r"Open CASCADE STEP translator [\d.]+( [\d.]+)?", "optopad mold", text).encode()


def _part_file(name: str, files: dict[str, bytes], part: cq.Workplane, formula_mm3: float) -> PartFile:
    solid_mm3 = float(part.val().Volume())  # type: ignore[union-attr]
    return PartFile(name=name, stl=files[f"{name}.stl"], solid_mm3=solid_mm3, formula_mm3=formula_mm3)
