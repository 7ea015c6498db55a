"""The verb fake: a simulated board that read, record and check can talk to."""

from __future__ import annotations

import signal
import time
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from optopad.cli import options
from optopad.cli.output import print_json, say
from optopad.cli.progress import progress

if TYPE_CHECKING:
    from fabrication.driver.simulated.board import FakeBoard
    from fabrication.driver.simulated.finger import Finger, FingerPath
    from fabrication.driver.simulated.port import FakePort, Wire
    from fabrication.driver.simulated.press_table import PressTable
    from fabrication.driver_file import DriverConfig
    from fabrication.stage.fake_printer import FakePrinter


def fake(
    config: options.Config,
    path: Annotated[
        Path | None,
        typer.Option(
            "--path", metavar="CSV", help="Presses over time: t_s,x_mm,y_mm,depth_mm, over and over."
        ),
    ] = None,
    still: Annotated[bool, typer.Option("--still", help="No finger: the pad stays untouched.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault", metavar="KIND:PARTS", help="swap:E1,E2, dead:E3, dim:E4 or saturated:R5. Repeatable."
        ),
    ] = None,
    socket: Annotated[
        bool, typer.Option("--socket", help="A socket of this machine, not a pseudo-terminal.")
    ] = False,
    stage_link: Annotated[
        Path | None,
        typer.Option(
            "--stage-link",
            metavar="NAME",
            help="A simulated printer on a port of this name, whose tip is the finger.",
        ),
    ] = None,
    link: Annotated[
        Path | None, typer.Option("--link", metavar="NAME", help="A name for the port that stays the same.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="CSV",
            help="Write the finger's path, for `driver export --presses`.",
            callback=options.file_name(".csv"),
        ),
    ] = None,
    seconds: options.Seconds = None,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """A simulated board on a port, fed by the simulation, with a finger that moves. Ctrl-C ends it."""
    from fabrication.driver.simulated.board import FakeBoard
    from fabrication.driver.simulated.faults import faults_of
    from fabrication.stage.fake_printer import TipFinger
    from optopad.sensor.driver_source import driver_source, press_table

    if out is not None:
        options.checked_out(out, config, path)
    _require_free_names(link, stage_link)
    source = driver_source(config, set_, bundles)
    faults = faults_of(source.config, fault or [])
    with progress(quiet=as_json) as step:
        said, table = press_table(source, seed=seed, on_step=step)
    printer = None if stage_link is None else _printer(said, table, path, out, still)
    finger: Finger = TipFinger(printer) if printer else _path(said, table, path, still, out)
    board = FakeBoard(said, table, finger, faults=faults, seed=seed)
    wire, stage = _ports(printer, use_socket=socket, link=link, stage_link=stage_link)
    if as_json:
        document = {"port": wire.name, "design": said.design, "digest": said.digest, "faults": fault or []}
        print_json(document | ({} if stage is None else {"stage_port": stage.name}))
    else:
        say(f"port      {wire.name}")
        if stage is not None:
            say(f"stage     {stage.name}: its tip barely touches the middle of the pad")
        say(f"try       optopad driver read {config} --port {wire.name}")
    with stage or nullcontext():
        _serve(board, wire, seconds)


def _require_free_names(link: Path | None, stage_link: Path | None) -> None:
    """Refuse, before the light is simulated, a port's name that is another's."""
    from design.errors import InputError
    from fabrication.driver.simulated.port import require_free

    if link is not None:
        require_free(link)
    if stage_link is not None:
        require_free(stage_link, "--stage-link")
    if link is not None and stage_link is not None and link.absolute() == stage_link.absolute():
        raise InputError(
            f"--stage-link {stage_link}: is the board's --link, too; choose another name for one"
        )


def _ports(
    printer: FakePrinter | None, *, use_socket: bool, link: Path | None, stage_link: Path | None
) -> tuple[Wire, FakePort | None]:
    """The board's line and the printer's port; a name that is refused leaves no link of the other."""
    from design.errors import InputError
    from fabrication.driver.simulated.port import FakePort, new_wire

    wire = new_wire(use_socket=use_socket, link=link)
    try:
        return wire, None if printer is None else FakePort(printer, new_wire(link=stage_link))
    except InputError:
        wire.close()
        raise


def _printer(
    said: DriverConfig, table: PressTable, path: Path | None, out: Path | None, still: bool
) -> FakePrinter:
    """A printer whose tip barely touches the middle of the pad."""
    from design.errors import InputError
    from fabrication.stage.fake_printer import FakePrinter

    if path is not None or still or out is not None or not table.knows_presses:
        reason = (
            "the tip is the finger, --path, --still and --out say another"
            if table.knows_presses
            else "no press of this design was simulated; name the design, or run `score`"
        )
        raise InputError(f"--stage-link: {reason}")
    area = said.workspace
    return FakePrinter(((area.x0_mm + area.x1_mm) / 2, (area.y0_mm + area.y1_mm) / 2, 0.0))


def _path(
    said: DriverConfig, table: PressTable, path: Path | None, still: bool, out: Path | None
) -> FingerPath:
    from design.io import write_text_atomically

    finger = _finger(said, table, path, still)
    if out is not None:
        write_text_atomically(out, finger.csv_text())
    return finger


def _finger(said: DriverConfig, table: PressTable, path: Path | None, still: bool) -> FingerPath:
    from design.errors import InputError
    from fabrication.driver.simulated.finger import NO_FINGER, demo_path, read_path

    if path is not None and (still or not table.knows_presses):
        reason = (
            "--still was given"
            if still
            else "no press of this design was simulated; name the design, or run `score`"
        )
        raise InputError(f"--path: {reason}")
    if path is not None:
        return read_path(path)
    return NO_FINGER if still or not table.knows_presses else demo_path(said.workspace)


def _serve(board: FakeBoard, wire: Wire, seconds: float | None) -> None:
    from fabrication.driver.simulated.port import FakePort

    end = None if seconds is None else time.monotonic() + seconds
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a link is taken away, however it is ended
    try:
        with FakePort(board, wire):
            while end is None or time.monotonic() < end:
                time.sleep(0.1 if end is None else min(0.1, max(end - time.monotonic(), 0.0)))
    except KeyboardInterrupt:
        return
