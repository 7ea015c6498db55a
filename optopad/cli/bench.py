"""Verbs of the laboratory bench: contact, driver, doctor."""

from __future__ import annotations

from typing import Annotated

import typer

from optopad.cli.common import (
    DEFAULT_OUT,
    DesignArgument,
    JsonOption,
    OutOption,
    SeedOption,
    SetOption,
    print_json,
    read_design,
    say,
)
from optopad.cli.progress import progress

contact = typer.Typer(help="The contact model: press, surface, force.", no_args_is_help=True)
driver = typer.Typer(help="The built sensor: its driver configuration.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add this group's verbs."""
    app.add_typer(contact, name="contact")
    app.add_typer(driver, name="driver")
    app.command()(doctor)


@contact.command()
def show(
    design: DesignArgument,
    depth: Annotated[float, typer.Option(help="Depth of the press [mm].")] = 2.0,
    set_: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Force, contact radius and surface of a centred press."""
    from sims.contact.indentation import indent, mesh_note, solved_press, wall_note

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        solved_press(
            read, max(depth, read.operating.max_depth_mm), on_step=lambda share: step("contact", share)
        )
    press = indent(read, depth)
    notes = [note for note in (wall_note(read), mesh_note(read)) if note]
    if as_json:
        print_json(
            {
                "depth_mm": press.depth_mm,
                "force_n": press.force_n,
                "contact_radius_mm": press.contact_radius_mm,
                "radius_mm": press.radius_mm.tolist(),
                "height_mm": press.height_mm.tolist(),
                "warnings": notes,
            }
        )
        return
    say(
        f"depth {press.depth_mm:g} mm: force {press.force_n:.2f} N, contact radius {press.contact_radius_mm:.2f} mm"
    )
    say(
        f"highest pile-up {press.height_mm.max() * 1000:.0f} um at {press.radius_mm[press.height_mm.argmax()]:.1f} mm"
    )
    for note in notes:
        say(f"warning   {note}")


@driver.command()
def config(
    design: DesignArgument,
    set_: SetOption = None,
    out: OutOption = DEFAULT_OUT,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """driver.toml, wiring table and bill of materials for exactly this geometry."""
    from optopad.pipeline import write_driver_config

    folder = write_driver_config(read_design(design, set_), out, seed=seed) / "fabrication"
    if as_json:
        print_json({"files": sorted(str(file) for file in folder.iterdir() if file.is_file())})
    else:
        say(f"files     {folder}")


def doctor(as_json: JsonOption = False) -> None:
    """What this machine can and cannot do."""
    from dataclasses import asdict

    from optopad.doctor import examine

    findings = examine()
    if as_json:
        print_json({"findings": [asdict(finding) for finding in findings]})
    else:
        for finding in findings:
            way_out = f"  -> {finding.way_out}" if finding.way_out else ""
            say(f"{finding.state:<8} {finding.name:<16} {finding.detail}{way_out}")
