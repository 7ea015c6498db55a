"""A simulated board as a process of its own, for want of a real one: `optopad driver fake`, which ends with us."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from design.errors import DeviceError, InputError
from design.io import save_design
from design.spec import SensorDesign
from design.whole_file import temporary_folder
from optopad.work.program import started

STARTING_BOARD = "starting the simulated board"

GENTLE_S = 1.0
"""How long it may take to end before it is killed."""

BOARD_PROGRAM = """
import os, signal, threading
def follow():
    while os.read(0, 64):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
threading.Thread(target=follow, daemon=True).start()
from optopad.cli import main
main()
"""
"""`optopad`, which ends when the other end of its standard input does, however that came about."""


class BoardProcess:
    """`optopad driver fake` of a design as a process that ends with this one.

    Parameters
    ----------
    say : is told how far it is
    """

    def __init__(self, design: SensorDesign, bundles: Path, seed: int, say: Callable[[str], None]) -> None:
        self._folder = temporary_folder()
        file = Path(self._folder.name) / "design.toml"
        save_design(design, file)
        command = ["driver", "fake", str(file), "--bundles", str(bundles)]
        self._command = ["-c", BOARD_PROGRAM, *command, "--seed", str(seed)]
        self._say = say
        self._lock, self._is_closed = threading.Lock(), False
        self._process: subprocess.Popen[str] | None = None
        self._port = ""

    @property
    def has_ended(self) -> bool:
        """Whether it ended, although nobody asked it to."""
        return self._process is not None and self._process.poll() is not None

    def port(self) -> str:
        """Name of its port; it is started where it does not run.

        Raises
        ------
        DeviceError : closed meanwhile.
        InputError : it ended before it had a port, and its own words why.
        """
        if self._process is not None and not self.has_ended:
            return self._port
        self._say(STARTING_BOARD)
        process, told = self._started(), ""
        assert process.stdout is not None
        for line in process.stdout:
            word, _, rest = line.strip().partition(" ")
            if word == "port":
                self._port = rest.strip()
                return self._port
            told = " ".join(line.split()) or told
            self._say(f"{STARTING_BOARD}: {told}")
        if self._is_closed:
            raise DeviceError("the simulated board: closed before it had started")
        raise InputError(
            f"the simulated board did not start: {told.removeprefix('optopad: ') or 'no word of it'}"
        )

    def end(self) -> None:
        """End it, by force where it does not listen; it is not started again."""
        with self._lock:
            self._is_closed = True
        if self._process is not None:
            _end(self._process)

    def tidy(self) -> None:
        """Close its pipes and remove its folder, when nobody listens to it any more; twice is once."""
        if self._process is not None:
            _close_pipes(self._process)
        self._folder.cleanup()

    def _started(self) -> subprocess.Popen[str]:
        with self._lock:
            if self._is_closed:
                raise DeviceError("the simulated board: closed before it had started")
            if self._process is not None:
                _close_pipes(self._process)
            self._process = started(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
            )
            return self._process


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.wait(GENTLE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _close_pipes(process: subprocess.Popen[str]) -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
