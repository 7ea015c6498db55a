"""Shows the built sensor live: its signals, or touches by a trained model."""

from __future__ import annotations

import json
import math
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from optopad.cli.interrupts import answered
from optopad.cli.verb import file_name, typed, verb
from optopad.design.errors import InputError, OutputError
from optopad.fabrication.driver.drift import GUARD_S, TIME_CONSTANT_S
from optopad.fabrication.driver.frame_source import FrameSource
from optopad.fabrication.driver.sensor import BASELINE_S, Sensor
from optopad.fabrication.driver.touch_reader import TouchReader
from optopad.screen.live_sensor import (
    contacts_json,
    frame_json,
    link_line,
    live_table,
    start_note,
    strongest_change,
    touch_json,
    touch_view,
)
from optopad.screen.output import say
from optopad.sensor import driver_source, fitting_model
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.work import OUT

Answer = TypeVar("Answer")
LIVE_EVERY_S = 0.1
LINE_EVERY_S = 1.0


@verb(
    model=typed("FILE"),
    drift_time=typed("S", min=0.1),
    guard=typed("S", min=0.0),
    out=typed("FILE", type=Path, callback=file_name(".jsonl", ".ndjson")),
)
def read(
    config: str,
    *,
    port: str | None = None,
    rate: float | None = None,
    frames: int | None = None,
    seconds: float | None = None,
    accept_digest: str | None = None,
    patience: float | None = None,
    model: Path | None = None,
    touches: int | None = None,
    drift_time: float | None = None,
    guard: float | None = None,
    out: Path | None = None,
    set_: Sequence[str] = (),
    bundles: Path = Path(OUT),
    as_json: bool = False,
) -> None:
    """Show the sensor live: its signals, or touches by a model. Do not touch the pad for the first half second.

    Parameters
    ----------
    model : Show touch, location, depth and force by a trained model.
    touches : With --model: 2 for up to two touches in a frame, with numbers.
    drift_time : With --model: time constant of drift (10 if left out).
    guard : With --model: time around a touch without drift correction (0.5 if left out).
    out : Write the JSON lines into a new file (.jsonl).
    as_json : JSON lines on standard output, one object per frame.
    """
    drift = "whose drift correction it sets"
    _refuse_without_model(model, drift, drift_time=drift_time, guard=guard)
    _refuse_without_model(model, "which finds the touches", touches=touches)
    most = 1 if touches is None else touches
    source = driver_source(config, set_, bundles)
    trained = None if model is None else fitting_model(model, source.config, most)
    baseline_s = BASELINE_S if trained is None else 0.0  # a model's reader measures its own baseline
    with (
        _lines(out, as_json) as write,
        Sensor(
            source.config,
            port,
            rate_hz=rate,
            accept_digest=accept_digest,
            patience_s=patience,
            baseline_s=baseline_s,
        ) as sensor,
    ):
        with until_interrupted():
            if trained is None:
                _show(sensor, frames, seconds, write)
            else:
                reader = _touch_reader(sensor, trained, most, drift_time, guard)
                _show_touch(reader, frames, seconds, write)
        if not as_json:
            say(link_line(sensor))


def _show(
    sensor: Sensor, frames: int | None, seconds: float | None, write: Callable[[str], None] | None
) -> None:
    if write is not None:
        for frame in sensor.frames(frames, seconds):
            write(json.dumps(frame_json(frame)))
    elif sys.stdout.isatty():
        _live(sensor, frames, seconds)
    else:
        follow(sensor, frames, seconds, quiet=False)


def _refuse_without_model(model: Path | None, why: str, **given: float | None) -> None:
    for name, value in given.items():
        if model is None and value is not None:
            option = name.replace("_", "-")
            raise InputError(f"--{option}: {value:g} needs --model, {why}; add it, or drop --{option}")


def _touch_reader(
    sensor: Sensor, model: TouchModel, touches: int, drift_time: float | None, guard: float | None
) -> TouchReader:
    return TouchReader(
        sensor,
        model,
        touches=touches,
        time_constant_s=TIME_CONSTANT_S if drift_time is None else drift_time,
        guard_s=GUARD_S if guard is None else guard,
    )


def _show_touch(
    reader: TouchReader, frames: int | None, seconds: float | None, write: Callable[[str], None] | None
) -> None:
    touches = reader.touches(frames, seconds)
    if note := start_note(reader):
        print(note, file=sys.stderr)
    if write is not None:
        for touch in touches:
            document = touch_json(touch)
            write(json.dumps(document | contacts_json(touch) if reader.most_touches > 1 else document))
    elif sys.stdout.isatty():
        _drawn(reader.sensor, touches, lambda touch: touch_view(touch, reader))
    else:
        said_at = -math.inf
        for touch in touches:
            if (now := time.monotonic()) - said_at >= LINE_EVERY_S:
                said_at = now
                print(touch, file=sys.stderr)


def _live(sensor: Sensor, frames: int | None, seconds: float | None) -> None:
    _drawn(
        sensor,
        sensor.frames(frames, seconds),
        lambda frame: live_table(frame, sensor, shutil.get_terminal_size()),
    )


def _drawn(sensor: FrameSource, answers: Iterator[Answer], view: Callable[[Answer], RenderableType]) -> None:
    """Draw the latest answer ten times a second, and below it why none arrives."""
    latest: Answer | None = None

    def shown() -> RenderableType:
        return "" if latest is None else Group(view(latest), Text(sensor.fault, style="bold red"))

    with Live(get_renderable=shown, console=Console(), refresh_per_second=1 / LIVE_EVERY_S):
        for latest in answers:  # noqa: B007, drawn by `shown`
            pass


def follow(
    sensor: Sensor,
    frames: int | None,
    seconds: float | None,
    *,
    quiet: bool,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """Read frames, with a line a second on standard error about the link and the strongest change."""
    said_at = time.monotonic()
    for frame in sensor.frames(frames, seconds):
        if not quiet and (now := time.monotonic()) - said_at >= LINE_EVERY_S:
            said_at = now
            print(f"{link_line(sensor)}  {strongest_change(frame, sensor)}".rstrip(), file=sys.stderr)
        if is_over():
            return


@contextmanager
def _lines(out: Path | None, as_json: bool) -> Iterator[Callable[[str], None] | None]:
    """Yield a function that writes JSON lines to a new file or to standard output; None if neither is requested."""
    if out is None:
        yield _print_line if as_json else None
        return
    try:
        with out.open("x", encoding="utf-8") as stream:
            try:
                yield lambda line: print(line, file=stream)
            except BaseException:
                # it ended before the first line: the same command can be given again
                if not stream.tell():
                    out.unlink(missing_ok=True)
                raise
    except FileExistsError:
        raise InputError(f"--out {out}: exists already; choose another name") from None
    except OSError as err:
        raise OutputError(f"--out {out}: cannot be written: {err.strerror}; choose another folder") from None


def _print_line(line: str) -> None:
    try:
        print(line, flush=True)
    except BrokenPipeError:
        raise
    except OSError as err:
        _drop_output()
        raise OutputError(
            f"standard output: cannot be written: {err.strerror}; free some room, or redirect it"
        ) from None


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def until_interrupted() -> Iterator[None]:
    """End the `with` block without an error on Ctrl-C or a closed pipe, the normal ends of reading and recording."""
    try:
        yield
    except KeyboardInterrupt:
        answered()
    except BrokenPipeError:  # for example by `| head`
        _drop_output()
