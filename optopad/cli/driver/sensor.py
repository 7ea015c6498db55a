"""Verbs of the built sensor on its port: read, record, check."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from design.errors import DeviceError, InputError, OutputError
from optopad.cli import options
from optopad.cli.interrupts import answered
from optopad.cli.output import print_json, say, tell
from optopad.cli.progress import progress

if TYPE_CHECKING:
    from rich.console import RenderableType

    from fabrication.driver.sensor import Sensor
    from fabrication.driver.touch_reader import TouchReader
    from fabrication.driver_file import DriverConfig
    from optopad.sensor.driver_source import DriverSource
    from sims.learning.inference.touch_model import TouchModel

Answer = TypeVar("Answer")
LIVE_EVERY_S = 0.1
LINE_EVERY_S = 1.0
CHECK_S = 1.5


def read(
    config: options.Config,
    port: options.Port = None,
    rate: options.Rate = None,
    frames: options.Frames = None,
    seconds: options.Seconds = None,
    accept_digest: options.Accept = None,
    patience: options.Patience = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="FILE", help="Show touch, place, depth and force by a trained model."
        ),
    ] = None,
    drift_time: Annotated[
        float | None,
        typer.Option(
            "--drift-time",
            metavar="S",
            min=0.1,
            help="With --model: time constant of drift (10 if left out).",
        ),
    ] = None,
    guard: Annotated[
        float | None,
        typer.Option(
            "--guard", metavar="S", min=0.0, help="With --model: no drift so near a touch (0.5 if left out)."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Write the JSON lines into a new file (.jsonl).",
            callback=options.file_name(".jsonl", ".ndjson"),
        ),
    ] = None,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    as_json: Annotated[
        bool, typer.Option("--json", help="A JSON object a line on standard output, one a frame.")
    ] = False,
) -> None:
    """Show the sensor live: its signals, or touches by a model. Leave the pad alone for the first half second."""
    _refuse_without_model(model, drift_time=drift_time, guard=guard)
    from fabrication.driver.sensor import BASELINE_S
    from optopad.sensor.driver_source import driver_source, fitting_model
    from optopad.sensor.driver_view import link_line

    source = driver_source(config, set_, bundles)
    trained = None if model is None else fitting_model(model, source.config)
    baseline_s = BASELINE_S if trained is None else 0.0  # a model's reader takes its own
    with (
        _lines(out, as_json) as write,
        _sensor(source.config, port, rate, accept_digest, patience, baseline_s=baseline_s) as sensor,
    ):
        with _until_interrupted():
            if trained is None:
                _show(sensor, frames, seconds, write)
            else:
                reader = _touch_reader(sensor, trained, drift_time, guard)
                _show_touch(reader, frames, seconds, write)
        if not as_json:
            say(link_line(sensor))


def record(
    config: options.Config,
    port: options.Port = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="A new file (.optorec); by default the design's name and the time.",
            callback=options.file_name(".optorec"),
        ),
    ] = None,
    rate: options.Rate = None,
    frames: options.Frames = None,
    seconds: options.Seconds = None,
    accept_digest: options.Accept = None,
    patience: options.Patience = None,
    netcdf: Annotated[
        bool, typer.Option("--netcdf/--no-netcdf", help="Make the netCDF beside it at the end.")
    ] = True,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    as_json: options.Json = False,
) -> None:
    """Record raw frames into a file that no interruption can spoil. Ctrl-C is a clean end."""
    if seconds is not None and not seconds > 0.0:
        raise InputError(
            f"--seconds: {seconds:g} is refused: give more than 0, or leave it out and end with Ctrl-C"
        )
    from optopad.sensor.driver_source import driver_source
    from optopad.sensor.driver_view import link_json, link_line

    source = driver_source(config, set_, bundles)
    file = out or _default_file(source)
    with (
        _sensor(source.config, port, rate, accept_digest, patience) as sensor,
        sensor.record(file) as recorder,
    ):
        try:
            with _until_interrupted():
                _follow(
                    sensor,
                    None,
                    seconds,
                    quiet=as_json,
                    is_over=lambda: recorder.frames >= (frames or math.inf),
                )
        except DeviceError as err:
            raise DeviceError(f"{err}; {file} holds the {recorder.frames} frames before") from err
        recorder.close()
        link, line = link_json(sensor), link_line(sensor)
    made = _netcdf_beside(file) if netcdf else None
    if as_json:
        netcdf_name = None if made is None else str(made)
        print_json({"file": str(file), "netcdf": netcdf_name, "recorded": recorder.frames, "link": link})
        return
    say(line)
    say(f"files     {file} ({recorder.frames} frames){'' if made is None else f', {made}'}")


def check(
    config: options.Config,
    port: options.Port = None,
    rate: options.Rate = None,
    accept_digest: options.Accept = None,
    patience: options.Patience = None,
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", min=0.1, help="Of untouched pad.")
    ] = CHECK_S,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Write the outcome as JSON, too.",
            callback=options.file_name(".json"),
        ),
    ] = None,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Test every LED and photodiode of the untouched pad against the simulated pattern."""
    from design.io import write_text_atomically
    from fabrication.driver.check import check_frames
    from optopad.sensor.driver_source import driver_source, with_expected_pattern
    from optopad.sensor.driver_view import check_lines, link_json

    if out is not None:
        options.checked_out(out, config)
    source = driver_source(config, set_, bundles)
    with progress(quiet=as_json) as step:
        expected = with_expected_pattern(source, seed=seed, on_step=step)
    with _sensor(expected, port, rate, accept_digest, patience) as sensor:
        sensor.read()
        verdict = check_frames(sensor.frames(seconds=seconds), sensor.descriptor, sensor.self_test())
        document = {**verdict.to_json(), "link": link_json(sensor)}
    if out is not None:
        write_text_atomically(out, json.dumps(document, indent=2) + "\n")
    tell(as_json, lambda: document, lambda: check_lines(verdict))


def _show(
    sensor: Sensor, frames: int | None, seconds: float | None, write: Callable[[str], None] | None
) -> None:
    from optopad.sensor.driver_view import frame_json

    if write is not None:
        for frame in sensor.frames(frames, seconds):
            write(json.dumps(frame_json(frame)))
    elif sys.stdout.isatty():
        _live(sensor, frames, seconds)
    else:
        _follow(sensor, frames, seconds, quiet=False)


def _sensor(
    config: DriverConfig,
    port: str | None,
    rate: float | None,
    accept_digest: str | None,
    patience: float | None,
    *,
    baseline_s: float = 0.0,
) -> Sensor:
    """A sensor as the options name it."""
    from fabrication.driver.sensor import Sensor

    return Sensor(
        config, port, rate_hz=rate, accept_digest=accept_digest, patience_s=patience, baseline_s=baseline_s
    )


def _refuse_without_model(model: Path | None, **given: float | None) -> None:
    for name, value in given.items():
        if model is None and value is not None:
            option = name.replace("_", "-")
            raise InputError(
                f"--{option}: {value:g} needs --model, whose drift it is for; add it, or drop --{option}"
            )


def _touch_reader(
    sensor: Sensor, model: TouchModel, drift_time: float | None, guard: float | None
) -> TouchReader:
    from fabrication.driver.drift import GUARD_S, TIME_CONSTANT_S
    from fabrication.driver.touch_reader import TouchReader

    return TouchReader(
        sensor,
        model,
        time_constant_s=TIME_CONSTANT_S if drift_time is None else drift_time,
        guard_s=GUARD_S if guard is None else guard,
    )


def _show_touch(
    reader: TouchReader, frames: int | None, seconds: float | None, write: Callable[[str], None] | None
) -> None:
    from optopad.sensor.touch_view import start_note, touch_json, touch_line, touch_view

    touches = reader.touches(frames, seconds)
    if note := start_note(reader):
        print(note, file=sys.stderr)
    if write is not None:
        for touch in touches:
            write(json.dumps(touch_json(touch)))
    elif sys.stdout.isatty():
        _drawn(touches, lambda touch: touch_view(touch, reader))
    else:
        said_at = -math.inf
        for touch in touches:
            if (now := time.monotonic()) - said_at >= LINE_EVERY_S:
                said_at = now
                print(touch_line(touch), file=sys.stderr)


def _live(sensor: Sensor, frames: int | None, seconds: float | None) -> None:
    from optopad.sensor.driver_view import live_table

    _drawn(sensor.frames(frames, seconds), lambda frame: live_table(frame, sensor))


def _drawn(answers: Iterator[Answer], view: Callable[[Answer], RenderableType]) -> None:
    """Draw ten of them a second, in one place."""
    from rich.console import Console
    from rich.live import Live

    drawn_at = 0.0
    with Live(console=Console(), auto_refresh=False) as live:
        for answer in answers:
            if (now := time.monotonic()) - drawn_at >= LIVE_EVERY_S:
                drawn_at = now
                live.update(view(answer), refresh=True)


def _follow(
    sensor: Sensor,
    frames: int | None,
    seconds: float | None,
    *,
    quiet: bool,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """A line a second while frames come, until so many or so long or `is_over`."""
    from optopad.sensor.driver_view import link_line, strongest_change

    said_at = time.monotonic()
    for frame in sensor.frames(frames, seconds):
        if not quiet and (now := time.monotonic()) - said_at >= LINE_EVERY_S:
            said_at = now
            print(f"{link_line(sensor)}  {strongest_change(frame, sensor)}".rstrip(), file=sys.stderr)
        if is_over():
            return


@contextmanager
def _lines(out: Path | None, as_json: bool) -> Iterator[Callable[[str], None] | None]:
    """Where JSON lines go: a new file, standard output, or nowhere."""
    if out is None:
        yield _print_line if as_json else None
        return
    try:
        with out.open("x", encoding="utf-8") as stream:
            try:
                yield lambda line: print(line, file=stream)
            except BaseException:
                # ended before the first line: the same command can be given again
                if not stream.tell():
                    out.unlink(missing_ok=True)
                raise
    except FileExistsError:
        raise InputError(f"--out {out}: exists already; choose another name") from None
    except OSError as err:
        raise OutputError(f"--out {out}: cannot be written: {err.strerror}; choose another folder") from None


def _print_line(line: str) -> None:
    """A line on standard output, at once; OutputError where it goes to a full disk."""
    try:
        print(line, flush=True)
    except BrokenPipeError:
        raise
    except OSError as err:
        _drop_output()
        raise OutputError(
            f"standard output: cannot be written: {err.strerror}; free some room, or send it elsewhere"
        ) from None


def _drop_output() -> None:
    """What Python would still write to standard output at its end goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _until_interrupted() -> Iterator[None]:
    """Ctrl-C, or a closed pipe, is how reading and recording end when no other end was asked for."""
    try:
        yield
    except KeyboardInterrupt:
        answered()
    except BrokenPipeError:  # as `| head` leaves it
        _drop_output()


def _default_file(source: DriverSource) -> Path:
    from fabrication.driver.recording.raw import SUFFIX

    return Path(f"{source.config.design}-{time.strftime('%Y%m%d-%H%M%S')}{SUFFIX}")


def _netcdf_beside(file: Path) -> Path | None:
    """The netCDF of a recording that ended well; None where it cannot be made, or a file of its name exists."""
    from fabrication.driver.recording.export import can_export, read_recorded, write_netcdf

    target = file.with_suffix(".nc")
    if not can_export() or target.exists():  # another recording's is not overwritten
        return None
    try:
        write_netcdf(read_recorded(file), target, file.name)
    except InputError:
        return None  # not one frame came before the end
    return target
