"""Many workers on one study: a real PostgreSQL server on loopback, started as an unprivileged user."""

from __future__ import annotations

import importlib.util
import os
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from optopad.design.errors import InputError
from optopad.design.search.explore import explore, findings_of, grid_size

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PROGRAMS = ("initdb", "pg_ctl", "postgres")

needs_postgres = pytest.mark.skipif(
    not all(map(shutil.which, PROGRAMS)),
    reason=f"PostgreSQL is not installed ({', '.join(PROGRAMS)} on PATH)",
)


def load_cheap():
    spec = importlib.util.spec_from_file_location("cheap_search", HERE / "cheap_search.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


cheap = load_cheap()


def as_nobody(command: list[str], folder: Path) -> None:
    """Run a program of the server's; root lends it another user, which PostgreSQL insists on."""
    user = (
        {"user": "nobody", "group": pwd.getpwnam("nobody").pw_gid, "extra_groups": []}
        if os.getuid() == 0
        else {}
    )
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=60, check=False, **user
    )
    if done.returncode != 0:
        pytest.skip(f"no PostgreSQL server could be started: {(done.stderr or done.stdout).strip()[-300:]}")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    """Address of an empty database; everything of it lies in one temporary folder."""
    with tempfile.TemporaryDirectory(prefix="optopad-postgres-") as place:
        folder, port = Path(place), free_port()
        os.chmod(folder, 0o700)
        if os.getuid() == 0:
            shutil.chown(folder, "nobody")
        data = str(folder / "data")
        as_nobody(["initdb", "-D", data, "-U", "optopad", "-A", "trust", "--no-sync", "-E", "UTF8"], folder)
        options = f"-p {port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={folder} -c fsync=off"
        as_nobody(["pg_ctl", "-D", data, "-o", options, "-l", str(folder / "log"), "-w", "start"], folder)
        try:
            yield f"postgresql://optopad@127.0.0.1:{port}/postgres"
        finally:
            as_nobody(["pg_ctl", "-D", data, "-m", "immediate", "-w", "stop"], folder)


@pytest.mark.full
@needs_postgres
def test_two_workers_share_a_study_on_postgresql_and_one_is_killed(server, tmp_path):
    """A grid is the same set of designs whoever judges them: nothing twice, nothing left out, one front."""
    space = cheap.cheap_space("grid")
    alone = explore(space, cheap.bowl, f"sqlite:///{tmp_path / 'alone.db'}", trials=1000)
    command = [sys.executable, str(HERE / "cheap_search.py"), server, "1000", "grid", "shared", "0.1"]
    here = os.environ | {"PYTHONPATH": str(ROOT)}
    survivor = subprocess.Popen(command, env=here, stdout=subprocess.DEVNULL)
    victim = subprocess.Popen(command, env=here, stdout=subprocess.PIPE, text=True)
    for line in victim.stdout:
        if int(line) >= 12:
            victim.send_signal(signal.SIGKILL)
            break
    victim.stdout.close()
    assert victim.wait() == -signal.SIGKILL
    assert survivor.wait(timeout=120) == 0
    found = findings_of(space, server, wanted=1000)
    points = [tuple(sorted(one.parameters.items())) for one in found.tried]
    assert len(points) == len(set(points)) == grid_size(space)
    assert {one.digest for one in found.front} == {one.digest for one in alone.front}


@pytest.mark.full
@needs_postgres
def test_a_study_of_another_space_is_refused_on_a_shared_server_as_well(server):
    explore(cheap.cheap_space(name="taken"), cheap.bowl, server, trials=2, is_shared=True)
    other = cheap.cheap_space(name="taken", constraints=[])
    with pytest.raises(InputError, match="'taken'"):
        explore(other, cheap.bowl, server, trials=2, is_shared=True)
