"""A search on a real Dask cluster: a scheduler and two workers on loopback, one of which is killed."""

from __future__ import annotations

import functools
import importlib.util
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from optopad.design.errors import InputError
from optopad.design.search.explore import explore
from optopad.design.search.space import load_space
from optopad.verbs.explore import on_cluster

ROOT = Path(__file__).parents[3]
CHEAP = ROOT / "tests" / "design" / "search" / "cheap_search.py"
PATIENCE_S = 60


def load_cheap():
    spec = importlib.util.spec_from_file_location("cheap_search", CHEAP)
    module = importlib.util.module_from_spec(spec)
    sys.modules["cheap_search"] = module
    spec.loader.exec_module(module)
    return module


cheap = load_cheap()


def started(*arguments: str) -> subprocess.Popen:
    here = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(CHEAP.parent)])}
    command = [sys.executable, "-W", "ignore", "-m", "distributed.cli." + arguments[0], *arguments[1:]]
    return subprocess.Popen(command, env=here, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def ended(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.kill()
    process.wait(timeout=PATIENCE_S)


@pytest.fixture
def cluster(tmp_path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """Address of a scheduler, and its two workers."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    address = f"tcp://127.0.0.1:{port}"
    scheduler = started("dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")
    rest = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
    workers = [
        started("dask_worker", address, *rest, "--local-directory", str(tmp_path / name)) for name in "ab"
    ]
    try:
        wait_for_workers(address, 2)
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            ended(process)


def wait_for_workers(address: str, count: int) -> None:
    from distributed import Client

    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            with Client(address, timeout=5, set_as_default=False) as client:
                client.wait_for_workers(count, timeout=PATIENCE_S)
                return
        except (OSError, TimeoutError):
            if time.monotonic() > end:
                raise
            time.sleep(0.5)


@pytest.mark.full
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_search_on_two_workers_one_killed_finds_what_one_process_finds(cluster, tmp_path):
    address, workers = cluster
    space = cheap.cheap_space("tpe")
    alone = explore(space, cheap.bowl, f"sqlite:///{tmp_path / 'alone.db'}", trials=18)
    killed = []

    def kill_one(found, one):
        if len(found.tried) >= 5 and not killed:
            workers[0].send_signal(signal.SIGKILL)
            killed.append(True)

    with on_cluster(address) as fan_out:
        together = explore(
            space,
            cheap.bowl,
            f"sqlite:///{tmp_path / 'together.db'}",
            trials=18,
            fan_out=fan_out,
            on_tried=kill_one,
        )
    assert workers[0].wait(timeout=PATIENCE_S) == -signal.SIGKILL
    assert cheap.outcome(together) == cheap.outcome(alone)


@pytest.mark.full
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_the_real_pair_is_judged_the_same_on_the_cluster(cluster, tmp_path):
    from optopad.sims.score.objective import judge

    space = load_space("pair-heights")
    objective = functools.partial(judge, wanted=("evenness", "strength", "resolvable_steps"))
    alone = explore(space, objective, f"sqlite:///{tmp_path / 'alone.db'}", trials=5)
    with on_cluster(cluster[0]) as fan_out:
        url = f"sqlite:///{tmp_path / 'together.db'}"
        together = explore(space, objective, url, trials=5, fan_out=fan_out)
    assert cheap.outcome(together) == cheap.outcome(alone)


def test_no_scheduler_is_said_in_one_line():
    with (
        pytest.raises(InputError, match="no scheduler replies at 'nonsense://x'"),
        on_cluster("nonsense://x"),
    ):
        pass


@pytest.mark.full
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_scheduler_out_of_reach_is_said_in_one_line():
    with (
        pytest.raises(InputError, match=r"no scheduler replies at 'tcp://127\.0\.0\.1:9'"),
        on_cluster("tcp://127.0.0.1:9"),
    ):
        pass
