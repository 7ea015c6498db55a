"""No test reads or writes the user's kept light: what a test claims to trace is traced. Fixtures of several rooms."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

os.environ["OPTOPAD_LIGHT_CACHE_MB"] = "0"  # processes that tests start inherit it

if "PYTEST_XDIST_WORKER" in os.environ:
    # Workers fill the cores already: on small matrices, linear algebra on all cores in each of them mostly waits
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a shell that runs the tests in the background has them ignore Ctrl-C, and so would every process they interrupt
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def board_harness(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The simulated board's program, compiled once; tests that need it skip where a tool is missing."""
    from tests.fabrication.simulated_board import build_harness, missing_tools

    if missing := missing_tools():
        pytest.skip(missing)
    return build_harness(tmp_path_factory.mktemp("harness"))
