"""Commands for design files (new, check, schema), mold and tools (build), and editing in a browser
(studio)."""

from __future__ import annotations

import sys
import time
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optopad.cli import options
from optopad.cli.interrupts import answered
from optopad.design.errors import InputError
from optopad.design.preset import PRESETS
from optopad.screen.output import print_json, progress, say
from optopad.work import read_design

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign
    from optopad.studio.live import LiveSensor
    from optopad.studio.session import Session


def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Design file to write.")],
    preset: Annotated[
        str,
        typer.Option(help=f"{', '.join(PRESETS[:-1])} or {PRESETS[-1]}."),
    ] = "piacenza2017-pad",
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
    as_json: options.Json = False,
) -> None:
    """Write a commented design file to start from."""
    import re
    import tomllib

    from optopad.design.errors import InputError
    from optopad.design.fields.base import NAME_PATTERN
    from optopad.design.files import require_suffix
    from optopad.design.io import write_text_atomically
    from optopad.design.preset import new_text
    from optopad.design.spec import SensorDesign

    require_suffix(file, (".toml",))
    if not re.fullmatch(NAME_PATTERN, file.stem):
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem).strip("._-")[:63] or "my-pad"
        raise InputError(
            f"{file}: a design is named after its file, in plain letters, digits, dots, dashes and "
            f"underscores, 63 at most; use {file.with_name(plain + '.toml')}"
        )
    if file.exists() and not force:
        raise InputError(f"{file}: exists already; choose another name, or --force to replace it")
    text = new_text(file.stem, preset)
    design = SensorDesign.from_document(tomllib.loads(text), where=str(file))
    write_text_atomically(file, text)
    if as_json:
        print_json({"file": str(file), "preset": preset, "digest": design.digest})
    else:
        say(f"{file} written from {preset}. Next: optopad check {file}, then optopad run {file}")


def schema(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File to write (.json); default: standard output.",
            callback=options.file_name(".json"),
        ),
    ] = None,
) -> None:
    """Print the JSON Schema of design files, for completion and checks in an editor."""
    import json

    from optopad.design.io import file_schema, write_text_atomically

    text = json.dumps(file_schema(), indent=2) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        write_text_atomically(out, text)
        say(f'{out} written. In a design file: "#:schema {out}" as the first line')


def build(
    design: options.Design,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    bed: Annotated[
        str | None, typer.Option(help="Build volume of the printer in mm, as 220,220,250.")
    ] = None,
    slice_parts: Annotated[
        bool, typer.Option("--slice", help="Also slice with PrusaSlicer: time, filament, warnings.")
    ] = False,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Write mold and tools as STL, STEP and 3MF, and check them."""
    from optopad.design.mold.filling import is_cast_under_lid
    from optopad.design.parts.assumptions import bed_of
    from optopad.design.shape.cavity import plan_of
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
    from optopad.fabrication.sheets.silicone import pours

    return (f"{pour.net_g:.2f} g of {pour.layer} silicone" for pour in pours(design))


QUICK_SWITCH_S = 0.001
"""Switch interval of Python's threads in the studio, which keeps page and sensor responsive during computations [s]."""


def studio(
    design: options.Design,
    set_: options.Set = None,
    port: Annotated[
        list[str] | None,
        typer.Option(
            "--port",
            metavar="NUMBER|NAME|fake",
            help="A number: port of the page. A name: serial port of the sensor; fake: a simulated "
            "sensor. Repeatable.",
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="FILE", help="With a sensor: show touches by a trained model."),
    ] = None,
    patience: options.Patience = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Print the address without opening a browser.")
    ] = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Edit a design live in a browser: drag parts, press the pad, see the verdict. Ctrl-C ends it."""
    page_port, device = _ports(port or [])
    if model is not None and device is None:
        raise InputError(f"--model: {model} needs a sensor, as --port fake or --port /dev/ttyUSB0; add it")
    session = _session(design, set_)
    live = _sensor(session, device, model, out, seed, patience)
    try:
        from optopad.studio.view.page import Page
    except ModuleNotFoundError as err:
        if err.name != "viser":
            raise
        raise InputError(
            "studio: needs the package viser; run `make demo`, or `pip install '.[studio]'` in the checkout"
        ) from None
    sys.setswitchinterval(QUICK_SWITCH_S)
    page = Page(session, out=out, port=page_port, seed=seed, live=live)
    try:
        page.start()
        if as_json:
            print_json({"url": page.url, "design": session.design.name, "digest": session.design.digest})
        else:
            say(f"studio    {page.url}")
            say("          Ctrl-C ends it; only Save saves the design")
        sys.stdout.flush()
        if not no_open:
            webbrowser.open(page.url)
        while True:
            time.sleep(0.2)
    except KeyboardInterrupt:
        answered()  # Ctrl-C is the regular end
    finally:
        page.close()


def _session(design: str, changes: list[str] | None) -> Session:
    from optopad.studio.design_file import DesignFile
    from optopad.studio.session import Session
    from optopad.work import read_design

    start = read_design(design, changes)  # an unknown name is refused, with the nearest ones
    return Session(DesignFile(design), start)


def _sensor(
    session: Session,
    device: str | None,
    model: Path | None,
    out: Path,
    seed: int,
    patience: float | None,
) -> LiveSensor | None:
    if device is None:
        return None
    from optopad.studio.live import LiveSensor

    return LiveSensor(session.design, port=device, model=model, bundles=out, seed=seed, patience_s=patience)


def _ports(given: list[str]) -> tuple[int | None, str | None]:
    numbers = [one for one in given if one.isdigit()]
    names = [one for one in given if not one.isdigit()]
    for kind, found in (("number, the page's", numbers), ("name, the sensor's", names)):
        if len(found) > 1:
            raise InputError(f"--port: {' and '.join(found)} are refused: give one {kind}")
    if not numbers:
        return None, names[0] if names else None
    page = int(numbers[0])
    if not 1024 <= page <= 65535:
        raise InputError(f"--port: {page} is refused: a page's port is 1024 to 65535")
    return page, names[0] if names else None
