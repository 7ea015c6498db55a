"""Verbs of the laboratory bench: driver, doctor."""

from __future__ import annotations

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

driver = typer.Typer(help="The built sensor: its driver configuration.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add this group's verbs."""
    app.add_typer(driver, name="driver")
    app.command()(doctor)


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
