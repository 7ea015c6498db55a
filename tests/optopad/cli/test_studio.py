"""The verb studio: its ports, its refusals, and its end."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

from optopad.cli.main import main
from tests.said import says


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["studio", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err


def test_a_port_that_is_taken_is_refused_by_its_number(capsys) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        message = refusal(capsys, "piacenza2017-pair", "--no-open", "--port", str(port))
    assert f"--port: {port}" in message


REFUSED = [
    (["--port", "80"], "80 is ... 1024 to 65535"),
    (["--port", "70000"], "70000 is refused"),
    (["--port", "8091", "--port", "8092"], "8091 and 8092"),
    (["--port", "fake", "--port", "COM3"], "COM3 are"),
    (["--model", "touch.npz"], "--model: touch.npz needs a sensor"),
    (["--port", "fake", "--model", "none.npz"], "none.npz"),
]


@pytest.mark.parametrize(
    ("arguments", "words"),
    REFUSED,
)
def test_what_cannot_be_meant_is_refused_before_anything_starts(capsys, arguments, words) -> None:
    assert says(refusal(capsys, "piacenza2017-pair", "--no-open", *arguments), words)


def test_a_design_that_is_none_is_refused_as_everywhere(capsys, tmp_path: Path) -> None:
    assert "did you mean piacenza2017-pair" in refusal(capsys, "piacenza2017-pear", "--no-open")
    file = tmp_path / "pad.toml"
    file.write_text("[cavity", encoding="utf-8")
    assert "not valid TOML" in refusal(capsys, str(file), "--no-open")


def test_without_viser_it_says_how_to_get_it(capsys, monkeypatch) -> None:
    # The module alone: a package imported anew would stay an attribute of its parent, without its modules.
    monkeypatch.delitem(sys.modules, "optopad.studio.view.page", raising=False)
    monkeypatch.setitem(sys.modules, "viser", None)
    assert "package viser; run" in refusal(capsys, "piacenza2017-pair", "--no-open")


@pytest.mark.slow
def test_it_serves_this_machine_alone_and_ctrl_c_ends_all_of_it(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "optopad",
            "studio",
            "piacenza2017-pair",
            "--no-open",
            "--json",
            "--port",
            str(free()),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.getcwd()},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        assert process.stdout is not None
        lines = iter(process.stdout.readline, "")
        told = json.loads("".join(line for _, line in zip(range(5), lines, strict=False)))
        assert told["url"].startswith("http://127.0.0.1:")
        with urllib.request.urlopen(told["url"], timeout=10) as answer:
            assert answer.status == 200
        listening = listening_addresses(process.pid)
        assert listening
        assert all(address.startswith("0100007F:") for address in listening)
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert time.monotonic() - began < 10
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        process.communicate()


def free() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


def listening_addresses(pid: int) -> list[str]:
    """Local addresses, in hexadecimal, of the sockets that a process listens at."""
    inodes = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        target = os.readlink(entry) if entry.exists() else ""
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:
                found.append(fields[1])
    return found
