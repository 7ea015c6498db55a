"""Helpers for long computations: processes, loading of designs, and a store of finished parts.

Programs of this package are started as processes with this interpreter and its import path. One of them draws plots
while this one computes: on a thread, the two would hinder each other.

Finished parts of long work are stored next to the bundle, so that an interrupted command continues from them. Each part
is one line of JSON, appended and flushed as soon as the part is finished. A line that a power cut left incomplete is
ignored. A store is valid for the same work only. Its file name contains a hash of the request (digests, seed, settings)
and of the program, so a changed program never reuses an old result. The file is
removed when the work is done.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any, TextIO, cast
from weakref import WeakSet

from optopad.design.errors import InputError, OptopadError
from optopad.design.files import temporary_folder, unwritable
from optopad.design.toml_text import parsed_toml
from optopad.fabrication.bundle import program_digest
from optopad.wire import packed, unpacked

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign

OUT = "outputs"
"""Default folder of the bundles, which are the output folders of designs."""

_STARTED: WeakSet[subprocess.Popen[str]] = WeakSet()


def started(
    arguments: Sequence[str],
    *,
    stdin: int = subprocess.DEVNULL,
    stdout: int = subprocess.DEVNULL,
    stderr: int = subprocess.PIPE,
) -> subprocess.Popen[str]:
    """Start ``python ARGUMENTS`` as a process with the import path of this one.

    Parameters
    ----------
    arguments : arguments of the interpreter, for example ``["-m", "optopad.cad", ...]``
    stdin, stdout, stderr : redirections, passed to `subprocess.Popen`
    """
    # -P: a user's own signal.py in the current folder must not replace Python's
    process = subprocess.Popen(
        [sys.executable, "-P", *arguments],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        text=True,
        errors="replace",
    )
    _STARTED.add(process)
    return process


def end_started() -> None:
    """End all running processes that `started` has started."""
    for process in tuple(_STARTED):
        if process.poll() is None:
            process.kill()
            process.wait()


class OtherProcess:
    """Another process of this program, which calls functions in the order in which it is asked to."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._requests = cast(TextIO, process.stdin).buffer
        self._results = cast(TextIO, process.stdout).buffer
        self._sender: Thread | None = None
        self._calls = 0
        self._arrived: list[tuple[Any, Exception | None]] = []

    def begin(self, function: str, *arguments: Any, **settings: Any) -> Callable[[], Any]:
        """Begin a call of one of the functions that the process serves.

        The returned function waits for the result and returns it, or raises the call's error.
        """
        if self._sender is not None:
            self._sender.join()
        request = packed((function, arguments, settings))
        self._sender = Thread(target=self._send, args=(request,), daemon=True)
        self._sender.start()
        self._calls += 1
        return partial(self._result, self._calls - 1)

    def _send(self, request: bytes) -> None:
        """Write a request, which waits until the other process has read it."""
        with suppress(OSError, ValueError):  # the process has ended: `_result` reports it
            self._requests.write(request)
            self._requests.flush()

    def _result(self, call: int) -> Any:
        try:
            while len(self._arrived) <= call:
                self._arrived.append(unpacked(self._results))
        except EOFError:
            _, message = self._process.communicate()
            raise RuntimeError(
                f"a process ended with {self._process.returncode}: {message.strip()}"
            ) from None
        made, failure = self._arrived[call]
        if failure is not None:
            raise failure
        return made


@contextmanager
def beside(module: str) -> Iterator[OtherProcess]:
    """`with` block with another process, which is killed at the end of the block.

    Parameters
    ----------
    module : name of the process's main module, which calls `serve`
    """
    process = started(["-m", module], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        yield OtherProcess(process)
    finally:
        process.kill()
        process.communicate()


def serve(*functions: Callable[..., Any]) -> None:
    """Call the functions that `OtherProcess.begin` names, until the process that asks for them ends."""
    by_name = {function.__name__: function for function in functions}
    requests, results = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    sys.stdout = sys.stderr  # what libraries print is not a result
    while True:
        try:
            name, arguments, settings = unpacked(requests)
        except EOFError:
            return
        outcome: tuple[Any, Exception | None]
        try:
            outcome = by_name[name](*arguments, **settings), None
        except (OSError, OptopadError) as err:
            outcome = None, err  # the other process raises it; any other error ends this process
        results.write(packed(outcome))
        results.flush()


def read_design(where: str, changes: Sequence[str] | None) -> SensorDesign:
    """Load a design file, a bundle's design, or a preset, and apply ``--set`` changes.

    Raises
    ------
    DesignError, InputError : the file or a change is invalid.
    """
    from optopad.design.fields.base import nearest
    from optopad.design.io import load_design
    from optopad.design.preset import PRESETS, preset

    path = Path(where)
    if not path.exists() and where in PRESETS:
        design = preset(where)
    elif not path.exists() and not path.suffix:
        near = nearest(where, PRESETS)
        hint = f"did you mean {near[0]}?" if near else f"presets: {', '.join(PRESETS)}"
        raise InputError(f"{where}: no such file, bundle or preset; {hint}")
    else:
        design = load_design(path / "design.toml" if (path / "manifest.json").is_file() else path)
    return design.with_(**dict(parsed_change(change) for change in changes)) if changes else design


def parsed_change(text: str, *, option: str = "--set") -> tuple[str, Any]:
    """Parse path and value from a text ``PATH=VALUE``; the value is TOML if possible, else plain text.

    Raises
    ------
    InputError : the text has no ``=`` or no path.
    """
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"{option}: {text!r} is refused: write PATH=VALUE, as cavity.clear_thickness_mm=10")
    return path.strip(), parsed_value(value.strip())


def parsed_value(text: str) -> Any:
    """Parse a value as in a design file (TOML); words without quotes are strings."""
    try:
        return parsed_toml(f"value = {text}")["value"]
    except ValueError:  # not TOML, an integer of thousands of digits, or nested too deep
        return text


class FinishedWork:
    """A store of a long computation's finished results by name, in memory and in one file.

    Parameters
    ----------
    out : folder of the bundles; created if missing
    title : beginning of the store's file name, such as ``piacenza2017-pair-0123abcd.sweep``
    asked : request (digests, seed, settings) as plain data; the store is valid for equal requests only
    """

    def __init__(self, out: Path, title: str, asked: object) -> None:
        text = json.dumps([asked, program_digest()], sort_keys=True)
        self.path = out / f".{title}.{hashlib.sha256(text.encode()).hexdigest()[:16]}.jsonl"
        self._results = _read(self.path)

    def __len__(self) -> int:
        return len(self._results)

    def get(self, name: str) -> Any | None:
        """The stored result of this name; None if there is none."""
        return self._results.get(name)

    def put(self, name: str, result: Any) -> None:
        """Store a result in memory and on the disk.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        self._results[name] = result
        line = json.dumps({"name": name, "result": result}, allow_nan=False) + "\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write("\n" + line)  # the line before may be incomplete
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as err:
            raise unwritable(self.path, err, "choose another folder with --out") from err

    def forget(self) -> None:
        """Remove the file; to be called when the work is done and the result is in the bundle."""
        self._results = {}
        self.path.unlink(missing_ok=True)


def _read(path: Path) -> dict[str, Any]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    found: dict[str, Any] = {}
    for line in lines:
        try:
            piece = json.loads(line)
            found[piece["name"]] = piece["result"]
        except (ValueError, KeyError, TypeError):
            continue  # incomplete, because the program was interrupted
    return found


def is_recording(file: Path) -> bool:
    """Whether a path is a recording of the driver, or a ROS 2 bag (file or folder, but no bundle), by its names."""
    from optopad.fabrication.driver.recording.bag import is_bag
    from optopad.fabrication.driver.recording.raw import SUFFIX

    is_bundle = (file / "manifest.json").is_file()
    return file.suffix.lower() == SUFFIX or (is_bag(file) and not is_bundle)


@contextmanager
def as_netcdf(file: Path, topic: str | None = None, press_topic: str | None = None) -> Iterator[Path]:
    """Convert a recording to netCDF, in a temporary folder; other files are given as they are.

    An `InputError` that is raised in the `with` block names the recording, not the temporary file.

    Parameters
    ----------
    topic, press_topic : topics of frames and presses in a bag of several sensors

    Raises
    ------
    InputError : the recording cannot be read, or a topic is given for another file.
    """
    if not is_recording(file):
        if topic is not None or press_topic is not None:
            option = f"--topic {topic}" if topic is not None else f"--press-topic {press_topic}"
            raise InputError(f"{option}: {file} is not a bag or MCAP file; leave it out")
        yield file
        return
    from optopad.fabrication.driver.recording.export import read_recorded, write_netcdf

    with temporary_folder() as folder:
        made = Path(folder) / f"{file.stem or 'bag'}.nc"
        write_netcdf(read_recorded(file, topic=topic, press_topic=press_topic), made, file.name)
        try:
            yield made
        except InputError as err:
            raise InputError(str(err).replace(str(made), str(file))) from None
