"""Uses PrusaSlicer for an independent check of printed parts: extruded volume, print time, filament and warnings.

The slicer's exit code does not suffice, because it is 0 even with missing triangles, omitted thin walls or floating
bodies. The module therefore also reads the `print warning` lines. From ``--info`` it reads whether the mesh is
manifold, and the mesh's volume after the slicer's silent repair. It also reads the extruded volume of a print with full
infill, which is too small if thin walls are omitted. Time and filament mass are those of a print with 20 % infill.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from optopad.design.errors import InputError
from optopad.design.files import temporary_folder
from optopad.design.parts.assumptions import Bed

COMMANDS = ("prusa-slicer", "PrusaSlicer", "prusa-slicer-console")
USUAL_FILL = 0.2
EXTRUDED_LOW, EXTRUDED_HIGH = 0.95, 1.08
"""Accepted range of the ratio of extruded volume (with full infill) to part volume.

Good parts have 1.01 to 1.03, because overlaps of short lines add volume.
"""
VOLUME_LIMIT = 1e-3
"""Limit of the relative difference between the slicer's volume and the solid; a repaired mesh exceeds it."""
TIMEOUT_S = 300
MM3_PER_CM3 = 1e3


@dataclass(frozen=True, kw_only=True)
class Sliced:
    """The slicer's results for one part.

    Attributes
    ----------
    minutes, filament_g : print time and filament mass with 20 % infill
    volume_mm3 : volume of the mesh after the slicer's repair
    extruded_mm3 : extruded volume with full infill
    is_manifold : whether the slicer finds the mesh closed
    warnings : texts of the slicer's warnings
    """

    minutes: float
    filament_g: float
    volume_mm3: float
    extruded_mm3: float
    is_manifold: bool
    warnings: tuple[str, ...]


def slicer_command() -> str | None:
    """Path of the PrusaSlicer program on this computer; None if it is not installed."""
    return next((path for name in COMMANDS if (path := shutil.which(name))), None)


def require_slicer() -> str:
    """Path of the PrusaSlicer program on this computer.

    Raises
    ------
    InputError : the slicer is not installed.
    """
    command = slicer_command()
    if command is None:
        raise InputError(
            "--slice: PrusaSlicer is not installed; install it (Debian and Ubuntu: apt-get install prusa-slicer), "
            "or leave --slice out"
        )
    return command


def sliced(stl: bytes, *, density_g_per_cm3: float, bed_mm: Bed, command: str | None = None) -> Sliced:
    """Slice a part twice, with 20 % and with full infill, and read the slicer's data about its mesh.

    Raises
    ------
    InputError : no slicer is installed, or the slicer gave no result within `TIMEOUT_S` seconds.
    """
    program = command or require_slicer()
    with temporary_folder() as folder:
        part = Path(folder) / "part.stl"
        part.write_bytes(stl)
        info = _run([program, "--info", "--loglevel", "1", str(part)])
        usual, said = _gcode(program, part, USUAL_FILL, density_g_per_cm3, bed_mm)
        solid, _ = _gcode(program, part, 1.0, density_g_per_cm3, bed_mm)
    return Sliced(
        minutes=minutes_of(_field(usual, r"estimated printing time \(normal mode\) = (.+)")),
        filament_g=float(_field(usual, r"total filament used \[g\] = ([\d.]+)")),
        volume_mm3=float(_field(info, r"volume = ([\d.]+)")),
        extruded_mm3=float(_field(solid, r"filament used \[cm3\] = ([\d.]+)")) * MM3_PER_CM3,
        is_manifold="manifold = yes" in info and "open_edges" not in info,
        warnings=tuple(line.strip() for line in re.findall(r"print warning: (.+)", said)),
    )


def minutes_of(duration: str) -> float:
    """Minutes of a duration in the slicer's notation, such as "1d 2h 3m 4s"."""
    per_unit = {"d": 1440.0, "h": 60.0, "m": 1.0, "s": 1 / 60}
    return sum(float(count) * per_unit[unit] for count, unit in re.findall(r"(\d+)([dhms])", duration))


def _gcode(program: str, part: Path, fill: float, density: float, bed_mm: Bed) -> tuple[str, str]:
    """Slice a part with the infill fraction `fill`; return the end of its G-code, and the slicer's output."""
    target, settings = part.with_suffix(".gcode"), part.with_suffix(".ini")
    x, y, z = bed_mm
    usual = (files("optopad.cad") / "data" / "slicer.ini").read_text(encoding="utf-8")
    settings.write_text(
        f"{usual}fill_density = {fill:.0%}\nfilament_density = {density:g}\n"
        f"bed_shape = 0x0,{x:g}x0,{x:g}x{y:g},0x{y:g}\nmax_print_height = {z:g}\n",
        encoding="utf-8",
    )
    target.unlink(missing_ok=True)
    said = _run(
        [
            program,
            "--export-gcode",
            "--load",
            str(settings),
            "--loglevel",
            "1",
            "--output",
            str(target),
            str(part),
        ]
    )
    if not target.is_file():
        raise InputError(f"--slice: PrusaSlicer could not slice a part: {said.strip()[-300:]}")
    return target.read_text(encoding="utf-8", errors="replace")[-20_000:], said


def _run(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as err:
        raise InputError(f"--slice: PrusaSlicer did not run: {err}; leave --slice out") from None
    return done.stdout + done.stderr


def _field(text: str, pattern: str) -> str:
    found = re.search(pattern, text)
    if found is None:
        raise InputError(
            f"--slice: PrusaSlicer's output has no {pattern.split(' =')[0]!r}; use version 2.5 or newer"
        )
    return found[1]
