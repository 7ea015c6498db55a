"""The verbs of the built sensor, each against a simulated board."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from optopad.cli import main
from optopad.cli.commands import whole_command
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link.ports import FoundPort
from optopad.fabrication.driver.recording.export import read_recorded
from optopad.fabrication.driver.simulated.board import faults_of
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver_config import dump_driver_config
from optopad.screen.live_sensor import live_table
from optopad.sims.readings.recording import read_recording
from tests.fabrication.driver.made_up_pad import board, pad_config, untouched
from tests.fabrication.driver.other_devices import printer_of

ROOT = Path(__file__).parents[3]
NAME = "piacenza2017-pad"


@pytest.fixture
def config(tmp_path: Path) -> str:
    file = tmp_path / "driver.toml"
    text = dump_driver_config(preset(NAME), [1e5] * 8, np.minimum(untouched(), 1023))
    file.write_text(text, encoding="utf-8")
    return str(file)


@pytest.fixture
def port() -> Iterator[str]:
    with FakePort(board()) as fake:
        yield fake.name


def test_read_gives_frames_as_json_lines(config: str, port: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["driver", "read", config, "--port", port, "--frames", "5", "--rate", "100", "--json"]) == 0
    frames = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(frames) == 5
    assert np.shape(frames[0]["counts"]) == (9, 8)
    assert [after["sequence"] - before["sequence"] for before, after in pairwise(frames)] == [1] * 4
    ratios = [ratio for row in frames[0]["normalised"] for ratio in row if ratio is not None]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.01)


def test_read_writes_a_new_file_and_says_how_the_line_did(
    config: str, port: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "frames.jsonl"
    command = ["driver", "read", config, "--port", port, "--frames", "3", "--out", str(out)]
    assert main(command) == 0
    assert len(out.read_text().splitlines()) == 3
    assert re.search(r"\d+ frames, [\d.]+ Hz, 0 lost, 0 damaged", capsys.readouterr().out)
    assert main(command) == 2
    assert "exists already" in capsys.readouterr().err


def test_read_that_never_began_leaves_no_file_in_the_way(config: str, tmp_path: Path) -> None:
    out = tmp_path / "frames.jsonl"
    command = ["driver", "read", config, "--port", str(tmp_path / "nowhere"), "--out", str(out)]
    assert main(command) == 2
    assert not out.exists()


def test_record_and_export_lead_to_what_compare_reads(
    config: str, port: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, path = tmp_path / "a.optorec", tmp_path / "finger.csv"
    assert (
        main(["driver", "record", config, "--port", port, "--frames", "40", "--out", str(file), "--json"])
        == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert said["recorded"] >= 40
    assert said["netcdf"] == str(tmp_path / "a.nc")
    assert said["link"]["lost"] == 0
    path.write_text("t_s,x_mm,y_mm,depth_mm\n0,16,16,0\n100,16,16,50\n")
    again = ["driver", "export", str(file), "--presses", str(path), "--out", str(tmp_path / "b.nc"), "--json"]
    assert main(again) == 0
    assert json.loads(capsys.readouterr().out)["has_presses"]
    assert read_recording(tmp_path / "b.nc").design_digest == preset(NAME).digest


@pytest.mark.parametrize(
    ("fault", "kind", "parts"),
    [
        ("swap:R3,R4", "swapped", ["R3", "R4"]),
        ("dead:E7", "dead", ["E7"]),
        ("saturated:R2", "saturated", ["R2"]),
    ],
)
def test_check_names_what_is_wrong(
    fault: str, kind: str, parts: list[str], config: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with FakePort(board(faults=faults_of(pad_config(), [fault]))) as fake:
        out = tmp_path / "check.json"
        command = ["driver", "check", config, "--port", fake.name, "--seconds", "0.4", "--rate", "100"]
        assert main([*command, "--out", str(out), "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert json.loads(out.read_text()) == document
    assert not document["is_good"]
    assert [(problem["kind"], problem["parts"]) for problem in document["problems"]] == [(kind, parts)]


def test_check_says_that_a_right_build_is_right(
    config: str, port: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["driver", "check", config, "--port", port, "--seconds", "0.4"]) == 0
    assert "verdict   wired as designed" in capsys.readouterr().out


OPENING = {
    "read": [],
    "record": ["--out", "a.optorec"],
    "check": [],
    "collect": ["--stage-port", "nowhere", "--protocol", "presses.csv", "--out", "a.nc"],
}
"""Verbs that open the sensor's port, with what each of them needs besides."""


def test_every_verb_that_opens_a_port_has_a_patience() -> None:
    found = set()
    for path, command in leaves(whole_command()):
        options = {name for parameter in command.params for name in parameter.opts}
        if "--port" in options:
            found.add(path[-1])
            assert "--patience" in options, path
    assert found == {*OPENING, "flash", "studio"}


@pytest.mark.parametrize("verb", OPENING)
def test_a_guessed_port_is_told_waited_for_and_sent_nothing(
    verb: str,
    config: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("optopad.fabrication.driver.link.link.SAY_EVERY_S", 0.2)
    monkeypatch.setattr("optopad.fabrication.driver.sensor.ANSWER_S", -2.0)  # less the boot time of 2.5 s
    (tmp_path / "presses.csv").write_text("x_mm,y_mm,depth_mm\n16,16,1\n")
    printer = printer_of("Marlin 2")
    command = ["driver", verb, config, *OPENING[verb], "--patience", "0.5"]
    with FakePort(printer) as made:
        found = FoundPort(name=made.name, usb_id="1a86:7523", title="USB Serial")
        monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", lambda: [found])
        assert main(command) == 2
        told = capsys.readouterr().err
        for words in (
            "is taken for the Arduino Mega 2560. Only the serial chip identifies this port",
            "Opening it may reset the device",
            "still waiting, up to 0.5 s",
            "silent for 0.5 s",
            "If this is another device, name the sensor's port with --port",
        ):
            assert words in told
        assert (printer.opened, printer.told) == (1, [])
        if verb == "collect":  # the printer itself is never taken for the sensor
            command[command.index("nowhere")] = made.name
            assert main(command) == 2
            assert "no Arduino Mega 2560 found" in capsys.readouterr().err
            assert main([*command, "--port", made.name]) == 2
            assert f"--port {made.name}: is also the printer's" in capsys.readouterr().err
            assert printer.opened == 1


def leaves(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every verb below a command."""
    if not hasattr(command, "commands"):
        yield path, command
        return
    for name, below in command.commands.items():
        yield from leaves(below, (*path, name))


def test_set_on_a_written_configuration_is_refused(config: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["driver", "read", config, "--set", "board.baud=500000"]) == 2
    assert "is a finished file" in capsys.readouterr().err


def test_a_finger_needs_a_table_of_presses(
    config: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "finger.csv"
    path.write_text("t_s,x_mm,y_mm,depth_mm\n0,16,16,0\n")
    assert main(["driver", "fake", config, "--path", str(path)]) == 2
    assert "design was simulated" in capsys.readouterr().err


def test_fingers_that_overlap_or_are_too_many_are_refused_before_the_light_is_simulated(
    config: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "fingers.csv"
    path.write_text(
        "# two fingers\nt_s,x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm\n"
        "0,10,12,1,22,12,1\n1,10,12,1,22,17,1\n2,22,12,1,10,17,1\n"
    )
    cases = (
        (NAME, ["--path", str(path)], f"{path}: row 4: until the next row the fingers come within 5.00 mm"),
        (NAME, ["--fingers", "3"], "--fingers: 3 is refused; give 1 or 2"),
        (NAME, ["--fingers", "2", "--path", str(path)], "--fingers: --path was given"),
        (NAME, ["--fingers", "2", "--set", "indenter.tip_radius_mm=10"], "need 22 mm"),
        (config, ["--fingers", "2"], "--fingers: no press"),
    )
    for name, options, told in cases:
        assert main(["driver", "fake", name, *options, "--seconds", "0.1"]) == 2
        said = capsys.readouterr()
        assert (said.out, told in said.err) == ("", True), said.err


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ([], "no press"),
        (["--still"], "no press"),
    ],
)
def test_a_simulated_stage_needs_presses_that_were_simulated(
    options: list[str], told: str, config: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["driver", "fake", config, "--stage-link", "stage", *options]) == 2
    assert f"--stage-link: {told}" in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pseudo-terminal", "socket"])
def test_fake_serves_a_board_until_ctrl_c_and_record_ends_cleanly_on_it(
    kind: str, config: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.optorec"
    options = ["--socket"] if kind == "socket" else ["--link", str(tmp_path / "pad")]
    with started("fake", config, "--json", *options) as fake:
        assert fake.stdout is not None
        said = json.loads("".join(iter(fake.stdout.readline, "}\n")) + "}")
        with started(
            "record", config, "--port", said["port"], "--out", str(file), "--json", "--no-netcdf"
        ) as record:
            while not file.exists() or file.stat().st_size < 12_000:
                assert record.poll() is None
                time.sleep(0.05)
            record.send_signal(signal.SIGINT)
            outcome, _ = record.communicate(timeout=20)
        fake.send_signal(signal.SIGTERM if kind == "socket" else signal.SIGINT)
        assert fake.wait(timeout=20) == 0
    assert record.returncode == 0
    assert json.loads(outcome)["recorded"] > 30
    assert not (tmp_path / "pad").is_symlink()


@pytest.mark.skipif(os.name != "posix", reason="needs limits of a process")
def test_a_disk_that_fills_up_ends_the_recording_with_one_line_and_whole_frames(
    config: str, port: str, tmp_path: Path
) -> None:
    file = tmp_path / "a.optorec"
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        "from optopad.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    command = [
        "driver",
        "record",
        config,
        "--port",
        port,
        "--rate",
        "200",
        "--seconds",
        "20",
        "--out",
        str(file),
    ]
    done = subprocess.run(
        [sys.executable, "-c", program, *command],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert "the disk is full (File too large); the recording stopped" in done.stderr
    assert "Traceback" not in done.stderr
    kept = read_recorded(file)
    assert kept.stray_bytes == 0
    assert np.diff(kept.sequence).tolist() == [1] * (len(kept.sequence) - 1)
    assert len(kept.sequence) > 50


@pytest.mark.skipif(os.name != "posix", reason="needs a pipe's signals")
def test_a_closed_pipe_is_an_end_like_any_other(config: str, port: str) -> None:
    command = [sys.executable, "-m", "optopad", "driver", "read", config, "--port", port, "--json"]
    with subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as reader:
        assert reader.stdout is not None
        assert reader.stderr is not None
        json.loads(reader.stdout.readline())
        reader.stdout.close()
        assert reader.wait(timeout=20) == 0
        assert reader.stderr.read() == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_standard_output_on_a_full_disk_is_told_in_one_line(config: str, port: str) -> None:
    command = [sys.executable, "-m", "optopad", "driver", "read", config, "--port", port, "--json"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True, timeout=30, check=False
        )
    assert done.returncode == 2
    assert "No space" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A verb in a process of its own, ended with the test whatever happens there."""
    command = [sys.executable, "-m", "optopad", "driver", *arguments]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def test_a_layout_whose_numbers_do_not_fit_the_terminal_is_drawn_as_blocks(config: str, port: str) -> None:
    with Sensor(config, port=port) as sensor:
        frame = sensor.read()
        drawn = {}
        for size in ((100, 40), (40, 40), (100, 8), (14, 40)):
            console = Console(width=size[0], record=True, file=io.StringIO(), color_system="truecolor")
            console.print(live_table(frame, sensor, size))
            drawn[size] = console.export_text().splitlines()
    assert [line.split()[0] for line in drawn[100, 40][2:11]] == [*(f"E{n}" for n in range(1, 9)), "dark"]
    assert drawn[100, 40][2].split()[1] == "100"
    for size, cell in {(40, 40): "▀▀", (100, 8): "▀▀", (14, 40): "▀"}.items():
        rows = [line for line in drawn[size] if "▀" in line]
        assert rows == [f"{name.ljust(5)}{cell * 8}".ljust(len(rows[0])) for name in ("E1", "E3", "E5", "E7")]


def test_a_still_pad_needs_no_light_of_presses(monkeypatch, capsys):
    def traced(*_: object, **__: object) -> None:
        raise InputError("presses are traced")

    monkeypatch.setattr("optopad.sensor._simulated_table", traced)
    given = ["driver", "fake", "piacenza2017-pad", "--bundles", "none", "--seconds", "0.1"]
    assert main(given) == 2
    assert "presses are traced" in capsys.readouterr().err
    assert main([*given, "--set", "board.dark=each", "--still"]) == 0
    assert "driver read piacenza2017-pad --set board.dark=each --port" in capsys.readouterr().out
