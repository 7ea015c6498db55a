"""The command `collect`: collects a data set of a manufactured sensor, with presses by a stage."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optopad.cli import options
from optopad.cli.interrupts import answered
from optopad.design.errors import DeviceError, InputError, OutputError
from optopad.screen.output import print_json, progress, say

if TYPE_CHECKING:
    from optopad.design.recordings import SetEntry
    from optopad.fabrication.stage.collection import Collected, Collector
    from optopad.fabrication.stage.gcode_stage import GcodeStage
    from optopad.fabrication.stage.stage import Position, PressList
    from optopad.sensor.driver_view import DriverSource

STANDS = "give its present position, which the last run reported at its end, or home it (--origin)"


def collect(
    config: options.Config,
    stage_port: Annotated[
        str, typer.Option("--stage-port", metavar="NAME", help="Serial port of the printer that presses.")
    ],
    protocol: Annotated[
        str,
        typer.Option(
            "--protocol",
            metavar="NAME|FILE",
            help="Presses: a protocol's name or file (.toml), or a table (.csv).",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="FILE", help="The data set, netCDF (.nc).", callback=options.file_name(".nc")
        ),
    ],
    port: options.Port = None,
    tip_at: Annotated[
        str | None,
        typer.Option(
            "--tip-at",
            metavar="X,Y,DEPTH",
            help="Present position of the tip [mm]; default: the middle, at first contact.",
        ),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(
            "--origin",
            metavar="X,Y,Z",
            help="Home first. Printer coordinates of the cavity's corner at the surface.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="SET", help="Only this set. Repeatable.")
    ] = None,
    settle: Annotated[
        float,
        typer.Option(
            "--settle", metavar="S", min=0.0, help="Waiting time at each position before frames are recorded."
        ),
    ] = 0.3,
    frames: Annotated[int, typer.Option("--frames", metavar="N", min=1, help="Frames at each position.")] = 1,
    speed: Annotated[
        float,
        typer.Option("--speed", metavar="MM_PER_S", min=0.01, max=50.0, help="Speed near and in the pad."),
    ] = 5.0,
    stage_baud: Annotated[
        int, typer.Option("--stage-baud", min=1, help="Baud rate of the printer's serial port.")
    ] = 115200,
    rate: options.Rate = None,
    accept_digest: options.Accept = None,
    patience: options.Patience = None,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Press the pad unattended and record the frames of each press; the same command continues an interrupted run."""
    from optopad.fabrication.driver.link.ports import plain_name
    from optopad.fabrication.driver.sensor import Sensor
    from optopad.fabrication.stage.collection import Collector
    from optopad.fabrication.stage.gcode_stage import BOOT_S, GcodeStage
    from optopad.fabrication.stage.stage import limits_of
    from optopad.sensor.driver_view import driver_source

    if tip_at is not None and origin is not None:
        raise InputError("--tip-at and --origin: both give the position of the pad; give one")
    source = driver_source(config, set_, bundles)
    presses = _presses(source, protocol, seed)
    limits = limits_of(source.config.workspace)
    presses.require_within(limits)
    stand = _position("--tip-at", tip_at) if tip_at else _middle(source)
    home = None if origin is None else _position("--origin", origin)
    if port is not None and plain_name(port) == plain_name(stage_port):
        raise InputError(
            f"--port {port}: is also the printer's (--stage-port); name the sensor's, or leave it out"
        )
    boot_s = BOOT_S if patience is None else patience
    stage = GcodeStage(stage_port, limits, baud=stage_baud, press_speed_mm_s=speed, boot_s=boot_s)
    sensor = Sensor(
        source.config,
        port,
        rate_hz=rate,
        accept_digest=accept_digest,
        patience_s=patience,
        baseline_s=0.0,
        not_ports=[stage_port],
    )
    with sensor:
        collector = Collector(sensor, presses, out, settle_s=settle, frames=frames)
        numbers = collector.remaining(only or ())
        if collector.was_begun and tip_at is None and home is None:
            raise InputError(
                f"--tip-at: {out} has presses already, and the tip may have moved since: {STANDS}"
            )
        ask = _light(collector, numbers, as_json)
        begun = time.monotonic()
        there = len(presses.presses) - len(collector.remaining())
        with _failures_that_tell_the_place(stage, collector):
            _pressed(stage, collector, numbers, stand, home, ask, quiet=as_json)
        found = collector.finish(len(presses.presses) - len(collector.remaining()) - there)
    _tell(found, stage.left_at, time.monotonic() - begun, as_json)


@contextmanager
def _failures_that_tell_the_place(stage: GcodeStage, collector: Collector) -> Iterator[None]:
    """Add the tip's position, which the next run needs, to the message of an error."""
    try:
        yield
    except DeviceError as err:
        found = collector.finish()
        raise DeviceError(
            f"{err}; {found.kept} of {found.wanted} presses are kept, run the command again for the others, with "
            f"--tip-at {_words(stage.left_at)} or --origin"
        ) from err
    except OutputError as err:  # a full disk: the earlier presses are stored in the folder
        raise OutputError(f"{err}, with --tip-at {_words(stage.left_at)} or --origin") from err


def _pressed(
    stage: GcodeStage,
    collector: Collector,
    numbers: list[int],
    stand: Position,
    home: Position | None,
    ask: Callable[[SetEntry], None],
    *,
    quiet: bool,
) -> None:
    if not numbers:
        return
    try:
        with stage, progress(quiet=quiet) as step:
            collector.begin()
            if home is None:
                stage.zero(*stand)
            else:
                stage.home(home)
            collector.run(stage, numbers, on_step=lambda share: step("presses", share), on_light=ask)
    except KeyboardInterrupt:
        answered()


def _presses(source: DriverSource, protocol: str, seed: int) -> PressList:
    from optopad.fabrication.stage.stage import read_press_list

    suffix = Path(protocol).suffix.lower()
    if suffix == ".csv" or (Path(protocol).is_file() and suffix != ".toml"):
        return read_press_list(Path(protocol))
    if source.design is None:
        raise InputError(
            f"--protocol {protocol}: needs the design, which driver.toml does not contain; name the "
            "design, or a CSV file"
        )
    from optopad.sensor.stage_protocol import protocol_presses

    return protocol_presses(source.design, protocol, seed=seed)


def _light(collector: Collector, numbers: list[int], as_json: bool) -> Callable[[SetEntry], None]:
    changes = collector.lights(numbers)
    if len(changes) < 2:
        return lambda _entry: None
    if as_json or not sys.stdin.isatty():
        names = ", ".join(f"{entry.name} ({_lit(entry)})" for entry in changes)
        raise InputError(
            f"the ambient light differs between these sets: {names}; without a terminal there is no "
            "prompt: choose sets with --only, switch the light, then run the command again for the others"
        )
    return lambda entry: _wait_for_light(entry)


def _wait_for_light(entry: SetEntry) -> None:
    input(f"set {entry.name}: the room must be {_lit(entry)}; press Enter to go on ")


def _lit(entry: SetEntry) -> str:
    return "lit" if entry.is_ambient else "dark"


def _position(option: str, text: str) -> Position:
    try:
        return options.parsed_press(text)
    except InputError as err:
        raise InputError(str(err).replace("--press", option, 1)) from None


def _words(tip: Position | None) -> str:
    return "X,Y,DEPTH" if tip is None else ",".join(f"{value:g}" for value in tip)


def _middle(source: DriverSource) -> Position:
    area = source.config.workspace
    return (area.x0_mm + area.x1_mm) / 2, (area.y0_mm + area.y1_mm) / 2, 0.0


def _tell(found: Collected, tip: Position | None, seconds: float, as_json: bool) -> None:
    if as_json:
        document: dict[str, Any] = {
            "file": None if found.file is None else str(found.file),
            "presses_made": found.made,
            "presses_kept": found.kept,
            "presses_wanted": found.wanted,
            "frames": found.frames,
            "complete": found.is_complete,
            "seconds": round(seconds, 1),
            "tip_at": None if tip is None else list(tip),
        }
        print_json(document)
        return
    say(
        f"{found.made} presses made in {seconds:.0f} s; {found.kept} of {found.wanted} are kept, {found.frames} frames"
    )
    if not found.is_complete:
        say(f"next      run the command again for the others, with --tip-at {_words(tip)} or --origin")
    if found.file is not None:
        say(f"files     {found.file}")
