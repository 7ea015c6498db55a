"""The simulated board that a page of the docs starts in one terminal and talks to from another."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

LONGEST_START_S = 300.0
"""Compiling the light kernels and tracing the table, on a busy machine."""


def started_board(command: list[str]) -> subprocess.Popen[bytes]:
    """Run `driver fake` as the page says, until its port is there."""
    link = Path(command[command.index("--link") + 1])
    root = str(Path(__file__).parents[2])
    here = os.environ | {"PYTHONPATH": root}
    process = subprocess.Popen(
        [sys.executable, "-m", "optopad", *command], env=here, stdout=subprocess.DEVNULL
    )
    deadline = time.monotonic() + LONGEST_START_S
    while not link.is_symlink():
        assert process.poll() is None, " ".join(command)
        assert time.monotonic() < deadline, "the board did not start"
        time.sleep(0.1)
    return process
