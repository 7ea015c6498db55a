"""A program of ours as a process of its own, by this interpreter and with what this one can import."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from weakref import WeakSet

_STARTED: WeakSet[subprocess.Popen[str]] = WeakSet()


def started(
    arguments: Sequence[str],
    *,
    stdin: int = subprocess.DEVNULL,
    stdout: int = subprocess.DEVNULL,
    stderr: int = subprocess.PIPE,
) -> subprocess.Popen[str]:
    """Start ``python ARGUMENTS``.

    Parameters
    ----------
    arguments : as ``["-m", "cad", ...]``
    stdin, stdout, stderr : as `subprocess.Popen` takes them
    """
    # -P: a design.py or cad.py of the user's in the current folder must not stand in for ours
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
    """End every program that was started here and still runs."""
    for process in tuple(_STARTED):
        if process.poll() is None:
            process.kill()
            process.wait()
