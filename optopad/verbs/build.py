"""Makes the mold and its tools, and checks them."""

from __future__ import annotations

from pathlib import Path

from optopad.bundle_parts import checks_of, mold_part
from optopad.cli.verb import typed, verb
from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.parts.assumptions import bed_of
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.fabrication.sheets.silicone import pours
from optopad.screen.answer import checks_line
from optopad.screen.output import Told
from optopad.screen.verdict import finding_line
from optopad.work import OUT


@verb(slice_parts=typed(flag="--slice"))
def build(
    design: SensorDesign,
    *,
    out: Path = Path(OUT),
    bed: str | None = None,
    slice_parts: bool = False,
    seed: int = 0,
    on_step: OnStep,
) -> Told:
    """Write mold and tools as STL, STEP and 3MF, and check them.

    Parameters
    ----------
    bed : Build volume of the printer in mm, as 220,220,250.
    slice_parts : Also slice with PrusaSlicer: time, filament, warnings.
    """
    from optopad.cad.export import export_parts

    require_valid(design)
    room = None if bed is None else bed_of(bed)
    on_step("mold", 0.0)
    with bundle(design, out, seed=seed, parts=(mold_part(design, room, slice_parts=slice_parts),)) as staging:
        (staging / "cad").mkdir(exist_ok=True)
        export_parts(design, staging / "cad", bed_mm=room, slice_parts=slice_parts)
        checks = checks_of(staging / "cad")
        on_step("mold", 1.0)
    folder = out / bundle_name(design)
    lines = [finding_line(one) for one in checks["findings"] if one["state"] != "ok"]
    for part, printed in checks.get("prints", {}).items():
        lines.append(f"{part:<15} {printed['minutes']:6.0f} min {printed['filament_g']:7.2f} g")
    lines.append(checks_line(checks))
    if is_cast_under_lid(plan_of(design)):
        weights = (f"{pour.net_g:.2f} g of {pour.layer} silicone" for pour in pours(design))
        way = (
            "black on the board, clear upside down on the lid"
            if design.is_on_board
            else "upside down on the lid"
        )
        lines.append(f"cast      {way}, by weight: " + ", then ".join(weights))
    return Told({"bundle": str(folder), "checks": checks}, [*lines, f"files     {folder / 'cad'}"])
