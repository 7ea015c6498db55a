"""Simulates a board on a port, with the signals of a moving finger."""

from __future__ import annotations

import signal
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from optopad.cli.verb import checked_out, file_name, typed, verb
from optopad.design.errors import InputError
from optopad.design.io import write_text_atomically
from optopad.fabrication.driver.simulated.board import FakeBoard, faults_of
from optopad.fabrication.driver.simulated.finger import NO_FINGER, Finger, FingerPath, demo_path, read_path
from optopad.fabrication.driver.simulated.port import FakePort, Wire, new_wire, require_free
from optopad.fabrication.driver.simulated.press_table import PressTable
from optopad.fabrication.driver_file import DriverConfig
from optopad.fabrication.stage.fake_printer import FakePrinter, TipFinger
from optopad.screen.answer import as_typed
from optopad.screen.output import print_json, progress, say
from optopad.sensor import driver_source, press_table
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
    path : Presses over time, repeated: t_s,x_mm,y_mm,depth_mm.
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
    if path is not None:
        read_path(path)  # refuses the file before the light is simulated
    source = driver_source(config, set_, bundles)
    faults = faults_of(source.config, fault)
    with progress(quiet=as_json) as step:
        is_still = still and stage_link is None
        said, table = press_table(source, is_still=is_still, seed=seed, on_step=step)
    printer = None if stage_link is None else _printer(said, table, path, out, still)
    finger: Finger = TipFinger(printer) if printer else _path(said, table, path, still, out)
    board = FakeBoard(said, table, finger, faults=faults, seed=seed)
    wire, stage = _ports(printer, use_socket=socket, link=link, stage_link=stage_link)
    if as_json:
        document = {"port": wire.name, "design": said.design, "digest": said.digest, "faults": list(fault)}
        print_json(document | ({} if stage is None else {"stage_port": stage.name}))
    else:
        say(f"port      {wire.name}")
        if stage is not None:
            say(f"stage     {stage.name}: its tip barely touches the middle of the pad")
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


def _printer(
    said: DriverConfig, table: PressTable, path: Path | None, out: Path | None, still: bool
) -> FakePrinter:
    if path is not None or still or out is not None or not table.knows_presses:
        reason = (
            "the tip is the finger; --path, --still and --out contradict that"
            if table.knows_presses
            else NO_PRESS
        )
        raise InputError(f"--stage-link: {reason}")
    area = said.workspace
    return FakePrinter(((area.x0_mm + area.x1_mm) / 2, (area.y0_mm + area.y1_mm) / 2, 0.0))


def _path(
    said: DriverConfig, table: PressTable, path: Path | None, still: bool, out: Path | None
) -> FingerPath:
    is_still = still or not table.knows_presses
    if path is not None and is_still:
        raise InputError(f"--path: {'--still was given' if still else NO_PRESS}")
    finger = read_path(path) if path is not None else NO_FINGER if is_still else demo_path(said.workspace)
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
