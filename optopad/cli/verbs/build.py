"""Verbs that make things to hold: build."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from optopad.cli import options
from optopad.cli.output import print_json, say
from optopad.cli.progress import progress
from optopad.work.designs import read_design

if TYPE_CHECKING:
    from design.spec import SensorDesign


def build(
    design: options.Design,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    bed: Annotated[
        str | None, typer.Option(help="Room of the printer in mm, as 220,220,250; the usual one if left out.")
    ] = None,
    slice_parts: Annotated[
        bool, typer.Option("--slice", help="Ask PrusaSlicer for time, filament and its warnings, too.")
    ] = False,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Mold and tools as STL, STEP and 3MF, with their checks."""
    from design.mold.filling import is_cast_under_lid
    from design.parts.printer import bed_of
    from design.shape.plan import plan_of
    from optopad.jobs.pipeline import write_parts
    from optopad.screen.verdict import checks_line, finding_line

    read, room = read_design(design, set_), None if bed is None else bed_of(bed)
    with progress(quiet=as_json) as step:
        checks, folder = write_parts(read, out, seed=seed, on_step=step, bed_mm=room, slice_parts=slice_parts)
    if as_json:
        print_json({"bundle": str(folder), "checks": checks})
        return
    for finding in checks["findings"]:
        if finding["state"] != "ok":
            say(finding_line(finding))
    for part, printed in checks.get("prints", {}).items():
        say(f"{part:<15} {printed['minutes']:6.0f} min {printed['filament_g']:7.2f} g")
    say(checks_line(checks))
    if is_cast_under_lid(plan_of(read)):
        say("cast      upside down on the lid, by weight: " + ", then ".join(_weights(read)))
    say(f"files     {folder / 'cad'}")


def _weights(design: SensorDesign) -> Iterator[str]:
    from fabrication.sheets.silicone import pours

    return (f"{pour.net_g:.2f} g of {pour.layer} silicone" for pour in pours(design))
