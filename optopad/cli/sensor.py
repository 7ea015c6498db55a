"""Commands for the manufactured sensor on its port: read, record, check, export; and fake, a simulated board."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast

import typer

from optopad.cli import options
from optopad.cli.interrupts import answered
from optopad.design.errors import DeviceError, InputError, OutputError
from optopad.screen.output import print_json, progress, say, tell

if TYPE_CHECKING:
    from rich.console import RenderableType

    from optopad.design.progress import OnStep
    from optopad.fabrication.driver.recording.joined_log import JoinedLog
    from optopad.fabrication.driver.recording.lerobot import Take
    from optopad.fabrication.driver.recording.recorded import Recorded
    from optopad.fabrication.driver.sensor import Sensor
    from optopad.fabrication.driver.simulated.board import FakeBoard
    from optopad.fabrication.driver.simulated.finger import Finger, FingerPath
    from optopad.fabrication.driver.simulated.port import FakePort, Wire
    from optopad.fabrication.driver.simulated.press_table import PressTable
    from optopad.fabrication.driver.touch_reader import TouchReader
    from optopad.fabrication.driver_file import DriverConfig
    from optopad.fabrication.stage.fake_printer import FakePrinter
    from optopad.sensor.driver_view import DriverSource
    from optopad.sims.learning.inference.touch_model import TouchModel

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
            "--model", metavar="FILE", help="Show touch, location, depth and force by a trained model."
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
            "--guard",
            metavar="S",
            min=0.0,
            help="With --model: time around a touch without drift correction (0.5 if left out).",
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
        bool, typer.Option("--json", help="JSON lines on standard output, one object per frame.")
    ] = False,
) -> None:
    """Show the sensor live: its signals, or touches by a model. Do not touch the pad for the first half second."""
    _refuse_without_model(model, drift_time=drift_time, guard=guard)
    from optopad.fabrication.driver.sensor import BASELINE_S
    from optopad.sensor.driver_view import driver_source, fitting_model, link_line

    source = driver_source(config, set_, bundles)
    trained = None if model is None else fitting_model(model, source.config)
    baseline_s = BASELINE_S if trained is None else 0.0  # a model's reader measures its own baseline
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
            help="A new file (.optorec, or .mcap for ROS 2 and Foxglove); default: the design's name and the time.",
            callback=options.file_name(".optorec", ".mcap"),
        ),
    ] = None,
    rate: options.Rate = None,
    frames: options.Frames = None,
    seconds: options.Seconds = None,
    accept_digest: options.Accept = None,
    patience: options.Patience = None,
    netcdf: Annotated[
        bool, typer.Option("--netcdf/--no-netcdf", help="Also write the netCDF next to it at the end.")
    ] = True,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    as_json: options.Json = False,
) -> None:
    """Record raw frames into a file that stays readable after any interruption. Ctrl-C ends the recording."""
    if seconds is not None and not seconds > 0.0:
        raise InputError(
            f"--seconds: {seconds:g} is refused: give more than 0, or leave it out and end with Ctrl-C"
        )
    from optopad.sensor.driver_view import driver_source, link_json, link_line

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
            raise DeviceError(f"{err}; {file} has the {recorder.frames} frames before") from err
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
        float,
        typer.Option("--seconds", metavar="S", min=0.1, help="Duration of the test, with the pad untouched."),
    ] = CHECK_S,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="Also write the result as JSON.",
            callback=options.file_name(".json"),
        ),
    ] = None,
    set_: options.Set = None,
    bundles: options.Bundles = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Test every LED and photodiode of the untouched pad against the simulated pattern."""
    from optopad.design.io import write_text_atomically
    from optopad.fabrication.driver.check import check_frames
    from optopad.sensor.driver_view import check_lines, driver_source, link_json, with_expected_pattern

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
    from optopad.fabrication.driver.sensor import Sensor

    return Sensor(
        config, port, rate_hz=rate, accept_digest=accept_digest, patience_s=patience, baseline_s=baseline_s
    )


def _refuse_without_model(model: Path | None, **given: float | None) -> None:
    for name, value in given.items():
        if model is None and value is not None:
            option = name.replace("_", "-")
            raise InputError(
                f"--{option}: {value:g} needs --model, whose drift correction it sets; add it, or drop --{option}"
            )


def _touch_reader(
    sensor: Sensor, model: TouchModel, drift_time: float | None, guard: float | None
) -> TouchReader:
    from optopad.fabrication.driver.drift import GUARD_S, TIME_CONSTANT_S
    from optopad.fabrication.driver.touch_reader import TouchReader

    return TouchReader(
        sensor,
        model,
        time_constant_s=TIME_CONSTANT_S if drift_time is None else drift_time,
        guard_s=GUARD_S if guard is None else guard,
    )


def _show_touch(
    reader: TouchReader, frames: int | None, seconds: float | None, write: Callable[[str], None] | None
) -> None:
    from optopad.sensor.touch_view import start_note, touch_json, touch_view

    touches = reader.touches(frames, seconds)
    if note := start_note(reader):
        print(note, file=sys.stderr)
    if write is not None:
        for touch in touches:
            write(json.dumps(touch_json(touch)))
    elif sys.stdout.isatty():
        _drawn(reader.sensor, touches, lambda touch: touch_view(touch, reader))
    else:
        said_at = -math.inf
        for touch in touches:
            if (now := time.monotonic()) - said_at >= LINE_EVERY_S:
                said_at = now
                print(touch, file=sys.stderr)


def _live(sensor: Sensor, frames: int | None, seconds: float | None) -> None:
    import shutil

    from optopad.sensor.driver_view import live_table

    _drawn(
        sensor,
        sensor.frames(frames, seconds),
        lambda frame: live_table(frame, sensor, shutil.get_terminal_size()),
    )


def _drawn(sensor: Sensor, answers: Iterator[Answer], view: Callable[[Answer], RenderableType]) -> None:
    """Draw the latest answer ten times a second, and below it why none arrives."""
    from rich.console import Console, Group
    from rich.live import Live
    from rich.text import Text

    latest: Answer | None = None

    def shown() -> RenderableType:
        return "" if latest is None else Group(view(latest), Text(sensor.fault, style="bold red"))

    with Live(get_renderable=shown, console=Console(), refresh_per_second=1 / LIVE_EVERY_S):
        for latest in answers:  # noqa: B007, drawn by `shown`
            pass


def _follow(
    sensor: Sensor,
    frames: int | None,
    seconds: float | None,
    *,
    quiet: bool,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
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
def _until_interrupted() -> Iterator[None]:
    """End the `with` block without an error on Ctrl-C or a closed pipe, the normal ends of reading and recording."""
    try:
        yield
    except KeyboardInterrupt:
        answered()
    except BrokenPipeError:  # for example by `| head`
        _drop_output()


def _default_file(source: DriverSource) -> Path:
    from optopad.fabrication.driver.recording.raw import SUFFIX

    return Path(f"{source.config.design}-{time.strftime('%Y%m%d-%H%M%S')}{SUFFIX}")


def _netcdf_beside(file: Path) -> Path | None:
    """Convert a complete recording to netCDF in the same folder; None if that fails or the file exists."""
    from optopad.fabrication.driver.recording.export import can_export, read_recorded, write_netcdf

    target = file.with_suffix(".nc")
    if not can_export() or target.exists():  # of another recording: not overwritten
        return None
    try:
        write_netcdf(read_recorded(file), target, file.name)
    except InputError:
        return None  # no frame arrived before the end
    return target


def fake(
    config: options.Config,
    path: Annotated[
        Path | None,
        typer.Option("--path", metavar="CSV", help="Presses over time, repeated: t_s,x_mm,y_mm,depth_mm."),
    ] = None,
    still: Annotated[bool, typer.Option("--still", help="No finger: the pad stays untouched.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault", metavar="KIND:PARTS", help="swap:E1,E2, dead:E3, dim:E4 or saturated:R5. Repeatable."
        ),
    ] = None,
    socket: Annotated[
        bool, typer.Option("--socket", help="A socket of this machine instead of a pseudo-terminal.")
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
        Path | None, typer.Option("--link", metavar="NAME", help="A fixed name for the port.")
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
    """Start a simulated board on a port, with simulated signals of a moving finger. Ctrl-C ends it."""
    from optopad.fabrication.driver.simulated.board import FakeBoard
    from optopad.fabrication.driver.simulated.faults import faults_of
    from optopad.fabrication.driver.simulated.finger import read_path
    from optopad.fabrication.stage.fake_printer import TipFinger
    from optopad.screen.answer import as_typed
    from optopad.sensor.driver_view import driver_source, press_table

    if out is not None:
        options.checked_out(out, config, path)
    _require_free_names(link, stage_link)
    if path is not None:
        read_path(path)  # refuses the file before the light is simulated
    source = driver_source(config, set_, bundles)
    faults = faults_of(source.config, fault or [])
    with progress(quiet=as_json) as step:
        is_still = still and stage_link is None
        said, table = press_table(source, is_still=is_still, seed=seed, on_step=step)
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
        say(f"try       optopad driver read {as_typed(str(config), set_)} --port {wire.name}")
    with stage or nullcontext():
        _serve(board, wire, seconds)


def _require_free_names(link: Path | None, stage_link: Path | None) -> None:
    """Raise an error if a port name is already in use; called before the light is simulated."""
    from optopad.design.errors import InputError
    from optopad.fabrication.driver.simulated.port import require_free

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
    from optopad.design.errors import InputError
    from optopad.fabrication.driver.simulated.port import FakePort, new_wire

    wire = new_wire(use_socket=use_socket, link=link)
    try:
        return wire, None if printer is None else FakePort(printer, new_wire(link=stage_link))
    except InputError:
        wire.close()
        raise


def _printer(
    said: DriverConfig, table: PressTable, path: Path | None, out: Path | None, still: bool
) -> FakePrinter:
    from optopad.design.errors import InputError
    from optopad.fabrication.stage.fake_printer import FakePrinter

    if path is not None or still or out is not None or not table.knows_presses:
        reason = (
            "the tip is the finger; --path, --still and --out contradict that"
            if table.knows_presses
            else "no press of this design was simulated; name the design, or run `score`"
        )
        raise InputError(f"--stage-link: {reason}")
    area = said.workspace
    return FakePrinter(((area.x0_mm + area.x1_mm) / 2, (area.y0_mm + area.y1_mm) / 2, 0.0))


def _path(
    said: DriverConfig, table: PressTable, path: Path | None, still: bool, out: Path | None
) -> FingerPath:
    from optopad.design.io import write_text_atomically

    finger = _finger(said, table, path, still)
    if out is not None:
        write_text_atomically(out, finger.csv_text())
    return finger


def _finger(said: DriverConfig, table: PressTable, path: Path | None, still: bool) -> FingerPath:
    from optopad.design.errors import InputError
    from optopad.fabrication.driver.simulated.finger import NO_FINGER, demo_path, read_path

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
    from optopad.fabrication.driver.simulated.port import FakePort

    end = None if seconds is None else time.monotonic() + seconds
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the link is removed, however it ends
    try:
        with FakePort(board, wire):
            while end is None or time.monotonic() < end:
                time.sleep(0.1 if end is None else min(0.1, max(end - time.monotonic(), 0.0)))
    except KeyboardInterrupt:
        return


def export(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING",
            help="A file of `driver record`, or a ROS 2 bag (.mcap, .db3, folder); several with --lerobot.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="netCDF (.nc), a table (.csv) or ROS 2 messages (.mcap); default: .nc, next to the recording.",
            callback=options.file_name(".nc", ".csv", ".mcap"),
        ),
    ] = None,
    presses: Annotated[
        Path | None,
        typer.Option(
            "--presses",
            metavar="CSV",
            help="Positions of the tip, repeated: t_s (the board's clock), x_mm, y_mm, depth_mm.",
        ),
    ] = None,
    stage: Annotated[
        Path | None,
        typer.Option(
            "--stage",
            metavar="CSV",
            help="A stage's log: time, x_mm, y_mm, depth_mm; optionally 'set', 'place'.",
        ),
    ] = None,
    offset: options.Offset = None,
    topic: options.Topic = None,
    press_topic: options.PressTopic = None,
    lerobot: Annotated[
        Path | None,
        typer.Option("--lerobot", metavar="FOLDER", help="Write the episodes of a LeRobot data set instead."),
    ] = None,
    append: Annotated[
        bool, typer.Option("--append", help="LeRobot: add the episodes to the data set in the folder.")
    ] = False,
    fps: Annotated[
        float, typer.Option("--fps", help="LeRobot: steps a second, as of the robot's cameras.")
    ] = 30.0,
    take: Annotated[
        str, typer.Option("--take", help="LeRobot: mean, last, or all of the frames of a step.")
    ] = "mean",
    task: Annotated[
        list[str] | None,
        typer.Option(
            "--task",
            metavar="TEXT",
            help="LeRobot: what the episodes show ('touch'); once, or once a recording.",
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Export the whole frames of a recording: netCDF or CSV for `compare` and `train`, MCAP, or LeRobot."""
    from optopad.fabrication.driver.recording.export import read_recorded, write_export
    from optopad.fabrication.driver.recording.joined_log import joined
    from optopad.fabrication.driver.recording.lerobot import Source, write_episodes
    from optopad.fabrication.driver.recording.position_log import read_position_log
    from optopad.fabrication.driver.simulated.finger import read_path

    target = lerobot or out or options.named(recordings[0]).with_suffix(".nc")
    tasks = _tasks_of(recordings, task)
    _require_one_result(recordings, target, lerobot, out, append=append)
    if lerobot is None:
        options.checked_out(target, presses, stage)
    if presses is not None and stage is not None:
        raise InputError("--presses and --stage: two sources of positions; give one")
    if offset is not None and stage is None:
        raise InputError("--offset: shifts a stage's log; give --stage, too")
    for option, value in (("--presses", presses), ("--stage", stage)):
        if value is not None and len(recordings) > 1:
            raise InputError(f"{option} {value}: is of one recording; export each with --append")
    shift = options.parsed_offset(offset)
    log = None if stage is None else read_position_log(stage)
    path = None if presses is None else read_path(presses)
    told: list[tuple[Path, dict[str, Any], list[str]]] = []

    def read_one(recording: Path, step: OnStep) -> Recorded:
        found = read_recorded(recording, path, topic, press_topic, with_presses=log is None, on_step=step)
        join = None if log is None else joined(found, log, shift)
        found = found if join is None else join.recorded
        document, lines = _told(found, join)
        if path is not None and (rounds := float(found.device_s.max()) / max(path.time_s[-1], 1e-9)) > 1.0:
            lines.append(
                f"presses   the path of {path.time_s[-1]:g} s was repeated, {rounds:.3g} times in all"
            )
        told.append((recording, document, lines))
        return found

    with progress(quiet=as_json or not sys.stderr.isatty()) as step:
        if lerobot is not None:
            sources = (
                Source(recorded=read_one(recording, step), task=text, name=str(recording))
                for recording, text in zip(recordings, tasks, strict=True)
            )
            made = write_episodes(sources, lerobot, fps=fps, take=cast("Take", take), is_appended=append)
        else:
            write_export(read_one(recordings[0], step), target, recordings[0].name, on_step=step)
            made = None
    if as_json:
        documents = [document for _, document, _ in told]
        found = documents[0] if len(told) == 1 else {"recordings": documents}
        of_set = {} if made is None else {"lerobot": made.to_json()}
        print_json({"file": str(target)} | found | of_set)
        return
    for recording, _, lines in told:
        say("\n".join([f"{recording}: {lines[0]}" if len(told) > 1 else lines[0], *lines[1:]]))
    if made is not None:
        say(f"episodes  {made.sentence}")
    say(f"files     {target}")


def _tasks_of(recordings: list[Path], task: list[str] | None) -> list[str]:
    texts = task or ["touch"]
    if len(texts) not in (1, len(recordings)):
        raise InputError(
            f"--task: {len(texts)} for {len(recordings)} recordings; give one, or one a recording"
        )
    return texts * len(recordings) if len(texts) == 1 else texts


def _require_one_result(
    recordings: list[Path], target: Path, lerobot: Path | None, out: Path | None, *, append: bool
) -> None:
    if lerobot is not None and out is not None:
        raise InputError("--lerobot and --out: two results; give one")
    if append and lerobot is None:
        raise InputError("--append: adds episodes to a LeRobot data set; give --lerobot, too")
    if len(recordings) > 1 and lerobot is None:
        raise InputError(
            f"{recordings[1]}: a second recording, and a file has one; export each, or give --lerobot"
        )
    names = [os.path.realpath(recording) for recording in recordings]
    for number, name in enumerate(names):
        if name in names[:number]:
            raise InputError(f"{recordings[number]}: is given twice; give each recording once")
    result = os.path.realpath(target)
    if result in names or os.path.dirname(result) in names:
        raise InputError(f"--out {target}: is the recording itself, or in its folder; choose another name")


def _told(found: Recorded, join: JoinedLog | None) -> tuple[dict[str, Any], list[str]]:
    """What is said of a recording, as JSON and as lines."""
    document: dict[str, Any] = {
        "frames": len(found.sequence),
        "lost": found.lost,
        "doubled": found.doubled,
        "connections": int(found.connection[-1]),
        "ended_cleanly": found.ended_cleanly,
        "stray_bytes": found.stray_bytes,
        "left_out": found.left_out,
        "missing_files": list(found.missing_files),
        "has_presses": found.press_mm is not None,
    }
    lines = [f"{len(found.sequence)} frames, {found.losses}"]
    if join is not None:
        document["stage"] = _join_json(join)
        lines.append(_join_line(join))
    if found.press_mm is None:
        lines.append(
            "presses   none; `optopad compare` needs them (--presses, --stage, or the recorder's press())"
        )
    return document, lines


def _join_json(join: JoinedLog) -> dict[str, Any]:
    match = join.match
    has_edges = math.isfinite(match.spread_s)
    return {
        "offset_s": round(join.offset_s, 4),
        "edges": match.edges,
        "edges_met": round(match.share, 4),
        "lag_s": round(match.offset_s - join.offset_s, 4) if has_edges else None,
        "spread_s": round(match.spread_s, 4) if has_edges else None,
        "left_out": join.left_out,
    }


def _join_line(join: JoinedLog) -> str:
    match, text = join.match, f"log       offset {join.offset_s:.3f} s"
    if math.isfinite(match.spread_s):
        lag = match.offset_s - join.offset_s
        text += f"; {match.share:.0%} of {match.edges} touch edges match"
        text += f", {lag:+.3f} s late, scatter {match.spread_s:.3f} s"
    return text + f"; {join.left_out} frames without a known position left out"


def ros2(
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="The src folder of a ROS 2 workspace.",
            callback=options.require_folder,
        ),
    ],
    as_json: options.Json = False,
) -> None:
    """Write the ROS 2 packages of a sensor's node and its messages into a workspace."""
    from optopad.fabrication.ros2.workspace import write_packages

    made = write_packages(out)
    if as_json:
        print_json({"packages": [str(package) for package in made]})
        return
    say(f"packages  {', '.join(str(package) for package in made)}")
    say("next      python3 -m colcon build --packages-select optopad_msgs optopad_ros")
    say("          ros2 launch optopad_ros sensor.launch.py config:=driver.toml")
