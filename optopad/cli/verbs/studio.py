"""The verb that opens the studio: a design live in a browser."""

from __future__ import annotations

import sys
import time
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from design.errors import InputError
from optopad.cli import options
from optopad.cli.interrupts import answered
from optopad.cli.output import print_json, say

if TYPE_CHECKING:
    from optopad.studio.live import LiveSensor
    from optopad.studio.session import Session

QUICK_SWITCH_S = 0.001
"""How soon the page and a sensor get their turn beside the work [s]."""


def studio(
    design: options.Design,
    set_: options.Set = None,
    port: Annotated[
        list[str] | None,
        typer.Option(
            "--port",
            metavar="NUMBER|NAME|fake",
            help="A number: of the page. A name: serial port of the built sensor; fake: a simulated one. Repeatable.",
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="FILE", help="With a sensor: show touches by a trained model."),
    ] = None,
    patience: options.Patience = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Open no browser; the address is printed.")
    ] = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """The design live in a browser: drag parts, press the pad, see the verdict. Ctrl-C ends it."""
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
            "studio: needs the package viser; install it (pip install 'optopad[studio]', or pip install viser)"
        ) from None
    sys.setswitchinterval(QUICK_SWITCH_S)
    page = Page(session, out=out, port=page_port, seed=seed, live=live)
    try:
        page.start()
        if as_json:
            print_json({"url": page.url, "design": session.design.name, "digest": session.design.digest})
        else:
            say(f"studio    {page.url}")
            say("          Ctrl-C ends it; nothing is saved but by Save")
        sys.stdout.flush()
        if not no_open:
            webbrowser.open(page.url)
        while True:
            time.sleep(0.2)
    except KeyboardInterrupt:
        answered()  # that is how it ends
    finally:
        page.close()


def _session(design: str, changes: list[str] | None) -> Session:
    from optopad.studio.design_file import DesignFile
    from optopad.studio.session import Session
    from optopad.work.designs import read_design

    start = read_design(design, changes)  # a name that is none is refused with the nearest ones
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
    """The page's port and the sensor's, of what was given."""
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
