"""Where tests keep light, kernels and contact between runs, what a run cost, and fixtures of several rooms."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path

import pytest
from platformdirs import user_cache_path

from optopad.sims.cache import CACHE_VARIABLE, folder_fingerprint, kernel_folder
from tests.durations import write_durations

KEPT_FOLDERS = 3
"""Of contact sources, whose presses and light are kept; the ones used longest ago go."""


def kept_results() -> Path:
    """A folder for what tests keep, in the user's cache folder, named by the sources of the contact model.

    Kernels and rows of light have the hash of their own sources in their names, presses do not.
    """
    room = user_cache_path("optopad") / "tests"
    folder = room / f"{folder_fingerprint(Path(__file__).parents[1] / 'sims' / 'contact'):016x}"
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    for old in sorted(room.iterdir(), key=lambda path: path.stat().st_mtime)[:-KEPT_FOLDERS]:
        shutil.rmtree(old, ignore_errors=True)
    return folder


for bare in ("design", "cad", "sims", "fabrication"):
    sys.modules[bare] = None  # type: ignore[assignment]  # in a checkout it would load the modules a second time

# Processes that tests start inherit these. Where light itself is tested, nothing kept is read (`no_kept_light`).
os.environ.setdefault("NUMBA_CACHE_DIR", str(kernel_folder()))
os.environ.setdefault(CACHE_VARIABLE, str(kept_results()))

if "PYTEST_XDIST_WORKER" in os.environ:
    # Workers fill the cores already: on small matrices, linear algebra on all cores in each of them mostly waits
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a shell that runs the tests in the background has them ignore Ctrl-C, and so would every process they interrupt
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--durations-file FILE`: see `tests.durations`."""
    parser.addoption("--durations-file", type=Path, metavar="FILE", help="write the seconds of every test")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Keep the seconds of this run, if that was asked for."""
    if file := config.getoption("--durations-file"):
        write_durations(file, (one for kind in terminalreporter.stats.values() for one in kind))


@pytest.fixture
def no_kept_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test says it traces is traced."""
    monkeypatch.setenv("OPTOPAD_LIGHT_CACHE_MB", "0")


@pytest.fixture(scope="session")
def board_harness(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The simulated board's program, compiled once; tests that need it skip where a tool is missing."""
    from tests.fabrication.simulated_board import build_harness, missing_tools

    if missing := missing_tools():
        pytest.skip(missing)
    return build_harness(tmp_path_factory.mktemp("harness"))


@pytest.fixture(scope="session")
def native_harness() -> None:
    """The portable firmware brings its simulated board along; tests that need it skip where a tool is missing."""
    from tests.fabrication.simulated_board import missing_native_tools

    if missing := missing_native_tools():
        pytest.skip(missing)
