"""Opens a design in a browser: the page of `optopad.studio.view`, on a port of this machine."""

from __future__ import annotations

import sys
import time
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from optopad.cli.interrupts import answered
from optopad.cli.verb import Asked, typed, verb
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.screen.output import print_json, say
from optopad.studio.design_file import DesignFile
from optopad.studio.live import LiveSensor
from optopad.studio.session import Session
from optopad.work import OUT

QUICK_SWITCH_S = 0.001
"""Switch interval of Python's threads in the studio, which keeps page and sensor responsive during computations [s]."""


@verb(port=typed("NUMBER|NAME|fake"), model=typed("FILE"))
def studio(
    design: SensorDesign,
    *,
    port: Sequence[str] = (),
    model: Path | None = None,
    patience: float | None = None,
    no_open: bool = False,
    out: Path = Path(OUT),
    seed: int = 0,
    as_json: bool = False,
    asked: Asked,
) -> None:
    """Edit a design live in a browser: drag parts, press the pad, see the verdict. Ctrl-C ends it.

    Parameters
    ----------
    port : A number: port of the page. A name: serial port of the sensor; fake: a simulated sensor. Repeatable.
    model : With a sensor: show touches by a trained model.
    no_open : Print the address without opening a browser.
    """
    page_port, device = _ports(port)
    if model is not None and device is None:
        raise InputError(f"--model: {model} needs a sensor, as --port fake or --port /dev/ttyUSB0; add it")
    session = Session(DesignFile(asked.design), design)
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
    return LiveSensor(session.design, port=device, model=model, bundles=out, seed=seed, patience_s=patience)


def _ports(given: Sequence[str]) -> tuple[int | None, str | None]:
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
