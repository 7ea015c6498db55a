"""Simulates a board on a port, with the signals of a moving finger."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from optopad.cli.verb import checked_out, file_name, typed, verb
from optopad.design.errors import InputError
from optopad.design.io import write_text_atomically
from optopad.fabrication.driver.simulated.board import FakeBoard, faults_of
from optopad.fabrication.driver.simulated.finger import (
    NO_FINGER,
    Finger,
    FingerPath,
    demo_path,
    read_path,
    two_finger_path,
)
from optopad.fabrication.driver.simulated.port import FakePort, Wire, new_wire, require_free
from optopad.fabrication.driver.simulated.press_table import SignalTable
from optopad.fabrication.driver_file import DriverConfig
from optopad.fabrication.stage.fake_printer import FakePrinter, TipFinger
from optopad.screen.answer import as_typed
from optopad.screen.output import print_json, progress, say
from optopad.sensor import DriverSource, driver_source, press_table
from optopad.work import OUT

NO_PRESS = "no press of this design was simulated; name the design, or run `score`"


@verb(
    path=typed("CSV"),
    fault=typed("KIND:PARTS"),
    stage_link=typed("NAME"),
    link=typed("NAME"),
    out=typed("CSV", type=Path, callback=file_name(".csv")),
)
def fake(
    config: str,
    *,
    path: Path | None = None,
    fingers: int | None = None,
    still: bool = False,
    fault: Sequence[str] = (),
    socket: bool = False,
    stage_link: Path | None = None,
    link: Path | None = None,
    out: Path | None = None,
    seconds: float | None = None,
    set_: Sequence[str] = (),
    bundles: Path = Path(OUT),
    seed: int = 0,
    as_json: bool = False,
) -> None:
    """Start a simulated board on a port, with simulated signals of a moving finger. Ctrl-C ends it.

    Parameters
    ----------
    path : Presses over time, repeated: t_s,x_mm,y_mm,depth_mm; a second finger: x2_mm,y2_mm,depth2_mm.
    fingers : 2: a demonstration with two fingers that pass each other.
    still : No finger: the pad stays untouched.
    fault : swap:E1,E2, dead:E3, dim:E4 or saturated:R5. Repeatable.
    socket : A socket of this machine instead of a pseudo-terminal.
    stage_link : A simulated printer on a port of this name, whose tip is the finger.
    link : A fixed name for the port.
    out : Write the finger's path, for `driver export --presses`.
    """
    if out is not None:
        checked_out(out, config, path)
    _require_free_names(link, stage_link)
    source = driver_source(config, set_, bundles)
    given = _given(source, path, fingers)  # refused before the light is simulated
    faults = faults_of(source.config, fault)
    with progress(quiet=as_json) as step:
        number = 0 if still and stage_link is None else 1 if given is None else given.fingers
        said, table = press_table(source, fingers=number, seed=seed, on_step=step)
    is_own = given is None and not still and out is None
    printer = None if stage_link is None else _printer(said, table, is_own=is_own)
    option = "--fingers" if path is None else "--path"
    finger: Finger = TipFinger(printer) if printer else _path(said, table, given, option, still, out)
    board = FakeBoard(said, table, finger, faults=faults, seed=seed)
    wire, stage = _ports(printer, use_socket=socket, link=link, stage_link=stage_link)
    apart_mm = None if given is None else _apart_mm(given)
    if as_json:
        document = {"port": wire.name, "design": said.design, "digest": said.digest, "faults": list(fault)}
        document |= {} if stage is None else {"stage_port": stage.name}
        print_json(document | ({} if apart_mm is None else {"nearest_mm": apart_mm}))
    else:
        say(f"port      {wire.name}")
        if stage is not None:
            say(f"stage     {stage.name}: its tip barely touches the middle of the pad")
        if apart_mm is not None:
            say(f"fingers   two, which come within {apart_mm:g} mm of each other")
        say(f"try       optopad driver read {as_typed(config, set_)} --port {wire.name}")
    with stage or nullcontext():
        _serve(board, wire, seconds)


def _require_free_names(link: Path | None, stage_link: Path | None) -> None:
    """Raise an error if a port name is already in use; called before the light is simulated."""
    if link is not None:
        require_free(link)
    if stage_link is not None:
        require_free(stage_link, "--stage-link")
    if link is not None and stage_link is not None and link.absolute() == stage_link.absolute():
        raise InputError(
            f"--stage-link {stage_link}: is also the board's --link; choose another name for one"
        )


def _ports(
    printer: FakePrinter | None, *, use_socket: bool, link: Path | None, stage_link: Path | None
) -> tuple[Wire, FakePort | None]:
    wire = new_wire(use_socket=use_socket, link=link)
    try:
        return wire, None if printer is None else FakePort(printer, new_wire(link=stage_link))
    except InputError:
        wire.close()
        raise


def _given(source: DriverSource, path: Path | None, fingers: int | None) -> FingerPath | None:
    """The path that the options ask for; None for the usual demonstration.

    A driver.toml does not have the tip. So fingers that overlap are refused only if the design itself is named.
    """
    if fingers not in (None, 1, 2):
        raise InputError(f"--fingers: {fingers} is refused; give 1 or 2")
    tip_radius_mm = 0.0 if source.design is None else source.design.indenter.tip_radius_mm
    if path is not None:
        if fingers is not None:
            raise InputError(
                "--fingers: --path was given, which has its own fingers; leave one of the two out"
            )
        return read_path(path, tip_radius_mm)
    return two_finger_path(source.config.workspace, tip_radius_mm) if fingers == 2 else None


def _apart_mm(path: FingerPath) -> float | None:
    """Least distance of two fingers [mm]; None if the path has one, or if they never touch together."""
    nearest_mm = float(path.nearest_mm().min(initial=math.inf))
    return round(nearest_mm, 2) if math.isfinite(nearest_mm) else None


def _printer(said: DriverConfig, table: SignalTable, *, is_own: bool) -> FakePrinter:
    if not is_own or not table.knows_presses:
        reason = (
            "the tip is the finger; --path, --fingers, --still and --out contradict that"
            if table.knows_presses
            else NO_PRESS
        )
        raise InputError(f"--stage-link: {reason}")
    area = said.workspace
    return FakePrinter(((area.x0_mm + area.x1_mm) / 2, (area.y0_mm + area.y1_mm) / 2, 0.0))


def _path(
    said: DriverConfig,
    table: SignalTable,
    given: FingerPath | None,
    option: str,
    still: bool,
    out: Path | None,
) -> FingerPath:
    is_still = still or not table.knows_presses
    if given is not None and is_still:
        raise InputError(f"{option}: {'--still was given' if still else NO_PRESS}")
    finger = given or (NO_FINGER if is_still else demo_path(said.workspace))
    if out is not None:
        write_text_atomically(out, finger.csv_text())
    return finger


def _serve(board: FakeBoard, wire: Wire, seconds: float | None) -> None:
    end = None if seconds is None else time.monotonic() + seconds
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the link is removed, however it ends
    try:
        with FakePort(board, wire):
            while end is None or time.monotonic() < end:
                time.sleep(0.1 if end is None else min(0.1, max(end - time.monotonic(), 0.0)))
    except KeyboardInterrupt:
        return
