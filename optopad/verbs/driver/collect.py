"""Collects a data set of a manufactured sensor, with presses by a stage."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from optopad.cli.interrupts import answered
from optopad.cli.verb import file_name, parsed_press, typed, verb
from optopad.design.errors import DeviceError, InputError, OutputError
from optopad.design.press_protocol import load_protocol_file
from optopad.design.recordings import SetEntry
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.ports import plain_name
from optopad.fabrication.driver.sensor import Sensor
from optopad.fabrication.stage.collection import Collected, Collector
from optopad.fabrication.stage.gcode_stage import BOOT_S, GcodeStage
from optopad.fabrication.stage.stage import Position, PressList, limits_of, press_list, read_press_list
from optopad.screen.output import Told, progress
from optopad.sensor import DriverSource, driver_source
from optopad.work import OUT

STANDS = "give its present position, which the last run reported at its end, or home it (--origin)"


@verb(
    stage_port=typed("NAME"),
    protocol=typed("NAME|FILE"),
    out=typed("FILE", callback=file_name(".nc")),
    tip_at=typed("X,Y,DEPTH"),
    origin=typed("X,Y,Z"),
    only=typed("SET"),
    settle=typed("S", min=0.0),
    frames=typed("N", min=1),
    speed=typed("MM_PER_S", min=0.01, max=50.0),
    stage_baud=typed(min=1),
)
def collect(
    config: str,
    *,
    stage_port: str,
    protocol: str,
    out: Path,
    port: str | None = None,
    tip_at: str | None = None,
    origin: str | None = None,
    only: Sequence[str] = (),
    settle: float = 0.3,
    frames: int = 1,
    speed: float = 5.0,
    stage_baud: int = 115200,
    rate: float | None = None,
    accept_digest: str | None = None,
    patience: float | None = None,
    set_: Sequence[str] = (),
    bundles: Path = Path(OUT),
    seed: int = 0,
    as_json: bool = False,
) -> Told:
    """Press the pad unattended and record the frames of each press; the same command continues an interrupted run.

    Parameters
    ----------
    stage_port : Serial port of the printer that presses.
    protocol : Presses: a protocol's name or file (.toml), or a table (.csv).
    out : The data set, netCDF (.nc).
    tip_at : Present position of the tip [mm]; default: the middle, at first contact.
    origin : Home first. Printer coordinates of the cavity's corner at the surface.
    only : Only this set. Repeatable.
    settle : Waiting time at each position before frames are recorded.
    frames : Frames at each position.
    speed : Speed near and in the pad.
    stage_baud : Baud rate of the printer's serial port.
    """
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
        numbers = collector.remaining(only)
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
    return _told(found, stage.left_at, time.monotonic() - begun)


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
    suffix = Path(protocol).suffix.lower()
    if suffix == ".csv" or (Path(protocol).is_file() and suffix != ".toml"):
        return read_press_list(Path(protocol))
    if source.design is None:
        raise InputError(
            f"--protocol {protocol}: needs the design, which driver.toml does not contain; name the "
            "design, or a CSV file"
        )
    return protocol_presses(source.design, protocol, seed=seed)


def protocol_presses(design: SensorDesign, protocol: str, *, seed: int = 0) -> PressList:
    """The presses of a protocol on a design.

    Parameters
    ----------
    protocol : name of a packaged protocol, or a file
    seed : seed of the order of locations within each set

    Raises
    ------
    DesignError, InputError, ModelScopeError : the protocol does not exist or does not suit this design.
    """
    said = load_protocol_file(protocol)
    depths = said.depth_mm.tolist()

    def rows() -> Iterator[tuple[SetEntry, int, Position]]:
        for number, (one, places) in enumerate(zip(said.sets, said.places_mm(design), strict=True)):
            order = np.random.default_rng([seed, number]).permutation(len(places))
            for place, (x, y) in enumerate(places[order].tolist()):
                yield from ((one.info, place, (x, y, depth)) for depth in depths)

    return press_list(rows())


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
        return parsed_press(text)
    except InputError as err:
        raise InputError(str(err).replace("--press", option, 1)) from None


def _words(tip: Position | None) -> str:
    return "X,Y,DEPTH" if tip is None else ",".join(f"{value:g}" for value in tip)


def _middle(source: DriverSource) -> Position:
    area = source.config.workspace
    return (area.x0_mm + area.x1_mm) / 2, (area.y0_mm + area.y1_mm) / 2, 0.0


def _told(found: Collected, tip: Position | None, seconds: float) -> Told:
    document = {
        "file": None if found.file is None else str(found.file),
        "presses_made": found.made,
        "presses_kept": found.kept,
        "presses_wanted": found.wanted,
        "frames": found.frames,
        "complete": found.is_complete,
        "seconds": round(seconds, 1),
        "tip_at": None if tip is None else list(tip),
    }
    lines = [
        f"{found.made} presses made in {seconds:.0f} s; {found.kept} of {found.wanted} are kept, {found.frames} frames"
    ]
    if not found.is_complete:
        lines.append(
            f"next      run the command again for the others, with --tip-at {_words(tip)} or --origin"
        )
    if found.file is not None:
        lines.append(f"files     {found.file}")
    return Told(document, lines)
