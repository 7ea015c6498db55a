"""driver firmware and driver flash, from the command line, against a made-up avrdude."""

from __future__ import annotations

import json
import os
import stat
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.fabrication import flash as image
from optopad.fabrication.bundle import bundle_name
from optopad.fabrication.driver.link.ports import FoundPort
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.verbs.driver.flash import board_setup
from tests.fabrication.driver.made_up_pad import board
from tests.fabrication.driver.other_devices import printer_of
from tests.fabrication.simulated_board import missing_compiler
from tests.said import says

DESIGN = "piacenza2017-pad"
FOLDER = Path("outputs") / bundle_name(preset(DESIGN)) / "fabrication" / "firmware"

needs_compiler = pytest.mark.skipif(bool(missing_compiler()), reason=missing_compiler())
needs_shell = pytest.mark.skipif(os.name != "posix", reason="the made-up avrdude is a shell script")


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def board_image(tmp_path) -> Path:
    file = tmp_path / "any.hex"
    file.write_text(":00000001FF\n", encoding="ascii")
    return file


@pytest.fixture
def port() -> Iterator[str]:
    with FakePort(board()) as made:
        yield made.name


@pytest.fixture
def avrdude(tmp_path, monkeypatch):
    """Puts an avrdude first in the search path that says and ends as told; it notes its arguments."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)

    def behaves(said: str = "", code: int = 0, name: str = "avrdude") -> Path:
        script, notes = folder / name, tmp_path / "arguments"
        script.write_text(
            f"#!/bin/sh\necho \"$@\" > '{notes}'\necho '{said}' >&2\nexit {code}\n", encoding="utf-8"
        )
        script.chmod(script.stat().st_mode | stat.S_IXUSR)
        return notes

    return behaves


def copies_here(monkeypatch, name: str, chip: str = "1a86:7523") -> None:
    """The system lists one port, whose serial chip any device may have."""
    found = FoundPort(name=name, usb_id=chip, title="USB Serial")
    monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", lambda: [found])


def refused(capsys, *arguments: str) -> str:
    assert main(["driver", *arguments]) == 2
    return capsys.readouterr().err


def test_config_leaves_driver_file_wiring_and_parts_in_the_bundle(capsys):
    assert main(["driver", "config", DESIGN, "--budget", "25EUR", "--json"]) == 0
    bill = json.loads(capsys.readouterr().out)["bill"]
    assert bill["rows_without_price"] == bill["rows"] > 8
    held = bill["budget"]
    assert (held["verdict"], held["amount"], held["currency"]) == ("undecided", 25.0, "EUR")
    assert held["rows_without_price"] == bill["rows"] > bill["rows_set_by_gain"] == 3
    made = {path.name for path in FOLDER.parent.iterdir()}
    assert {"driver.toml", "wiring.csv", "bom.csv"} <= made
    assert "14.1 g when printed solid" in (FOLDER.parent / "bom.csv").read_text(encoding="utf-8")


def test_config_takes_the_mold_s_weight_from_its_checks_where_the_mold_is_made(capsys):
    checks = FOLDER.parents[1] / "cad" / "checks.json"
    checks.parent.mkdir(parents=True)
    checks.write_text(json.dumps({"volumes_mm3": {"mold": {"solid": 10_000.0}}}), encoding="utf-8")
    assert main(["driver", "config", DESIGN]) == 0
    assert "10.4 g when printed solid" in (FOLDER.parent / "bom.csv").read_text(encoding="utf-8")
    checks.write_text("{", encoding="utf-8")
    assert main(["driver", "config", DESIGN]) == 0
    assert "14.1 g when printed solid" in (FOLDER.parent / "bom.csv").read_text(encoding="utf-8")


@needs_compiler
def test_firmware_leaves_sketch_and_image_in_the_bundle(capsys):
    assert main(["driver", "firmware", DESIGN, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert Path(found["sketch"]) == FOLDER / "optopad"
    assert (FOLDER / "optopad" / "optopad.ino").is_file()
    assert Path(found["image"]).read_text(encoding="ascii").startswith(":")
    assert found["board"] == "arduino:avr:mega"
    assert 4_000 < found["flash_bytes"] < 8_000
    assert found["ram_bytes"] < 600
    manifest = json.loads((FOLDER.parents[1] / "manifest.json").read_text(encoding="utf-8"))
    assert "fabrication/firmware/optopad/config.h" in manifest["files"]


def test_without_a_compiler_the_sketch_is_written_and_the_reason_said(monkeypatch, capsys):
    monkeypatch.setattr(image.shutil, "which", lambda _name: None)
    assert main(["driver", "firmware", DESIGN]) == 0
    out = capsys.readouterr().out
    assert "installed here" in out
    assert sorted(file.name for file in FOLDER.iterdir()) == ["optopad"]


def test_a_broken_compiler_is_said_and_leaves_the_sketch(monkeypatch, capsys):
    monkeypatch.setattr(image, "has_compiler", lambda: True)
    monkeypatch.setattr(image, "OPTIONS", ("--no-such-option",))
    monkeypatch.setattr(image, "COMPILER", "false")
    assert main(["driver", "firmware", DESIGN]) == 0
    assert "make the firmware" in capsys.readouterr().out
    assert (FOLDER / "optopad" / "core.c").is_file()


def test_a_board_that_does_not_fit_is_refused_and_nothing_written(capsys):
    said = refused(capsys, "firmware", DESIGN, "--set", "board.kind=arduino-uno")
    assert "8 receivers" in said
    assert not Path("outputs").exists()


def test_a_dry_run_prints_the_command_and_runs_nothing(board_image, capsys):
    arguments = ["flash", DESIGN, "--port", "COM7", "--image", str(board_image), "--dry-run"]
    assert main(["driver", *arguments]) == 0
    command = capsys.readouterr().out.strip()
    assert command == f"avrdude -p atmega2560 -c wiring -P COM7 -b 115200 -D -U flash:w:{board_image}:i"


def test_the_nano_is_flashed_by_its_own_protocol(board_image, capsys):
    board = ["--set", "board.kind=arduino-nano"]
    arguments = [
        "flash",
        DESIGN,
        *board,
        "--port",
        "COM7",
        "--image",
        str(board_image),
        "--dry-run",
        "--json",
    ]
    assert main(["driver", *arguments]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["command"][:7] == ["avrdude", "-p", "atmega328p", "-c", "arduino", "-P", "COM7"]
    assert found["uploaded"] is False


@needs_shell
@needs_compiler
def test_flash_compiles_the_design_and_hands_it_to_avrdude(avrdude, port, capsys):
    notes = avrdude()
    assert main(["driver", "flash", DESIGN, "--port", str(port)]) == 0
    assert f"-P {port} -b 115200 -D -U flash:w:{FOLDER / 'optopad.hex'}:i" in notes.read_text(
        encoding="utf-8"
    )
    assert f"to {port}; the board starts" in capsys.readouterr().out


@needs_shell
@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("avrdude: ser_open(): can't open device: Permission denied", "dialout"),
        ("avrdude: stk500_recv(): programmer is not responding, not in sync", "Press the reset button"),
        ("avrdude: device signature = 0x1e950f; expected signature for ATmega2560 is 1E 98 01", "board.kind"),
        ("avrdude: verification error, first mismatch at byte 0x0000", "with another cable"),
        ("avrdude: something never heard of", "something never heard of"),
    ],
)
def test_what_avrdude_says_is_passed_on_with_what_helps(said, words, avrdude, port, board_image, capsys):
    avrdude(said.replace("'", ""), 1)
    message = refused(capsys, "flash", DESIGN, "--port", str(port), "--image", str(board_image))
    assert f"{port}: the upload failed" in message
    assert words in message


def test_without_a_port_the_board_is_looked_for_by_its_usb_identity(
    monkeypatch, avrdude, board_image, capsys
):
    avrdude()
    monkeypatch.setattr("optopad.fabrication.driver.link.ports.ports_here", list)
    message = refused(capsys, "flash", DESIGN, "--image", str(board_image))
    assert "no Arduino Mega 2560 found by its USB identity" in message


@needs_shell
@pytest.mark.parametrize("options", [["--yes"], ["--port"], ["--port", "--yes"]])
def test_a_printer_is_never_overwritten(options, avrdude, board_image, monkeypatch, capsys):
    notes = avrdude()
    with FakePort(printer_of("Marlin 1.0")) as made:
        copies_here(monkeypatch, made.name)
        given = [
            word for option in options for word in ([option, made.name] if option == "--port" else [option])
        ]
        message = refused(capsys, "flash", DESIGN, "--image", str(board_image), *given)
    assert f"{made.name}" in message
    assert not notes.exists()


@needs_shell
@pytest.mark.parametrize("chip", ["1a86:7523", "0403:6001", "10c4:ea60"])
def test_a_port_that_only_a_serial_chip_speaks_for_is_asked_about(
    chip, avrdude, board_image, monkeypatch, capsys
):
    notes, printer = avrdude(), printer_of("Marlin 1.0")
    entry = replace(board_setup(preset(DESIGN)), usb_ids=(chip,))
    monkeypatch.setattr("optopad.verbs.driver.flash.board_setup", lambda _design: entry)
    command = ["flash", DESIGN, "--image", str(board_image)]
    with FakePort(printer) as made:
        copies_here(monkeypatch, made.name, chip)
        for more in ([], ["--json"]):
            message = refused(capsys, *command, *more)
            assert f"--port {made.name}" in message
        monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
        monkeypatch.setattr("builtins.input", lambda question: "n")
        assert "nothing was opened" in refused(capsys, *command)
        assert (printer.opened, printer.told, notes.exists()) == (0, [], False)
    with FakePort(board()) as made:
        copies_here(monkeypatch, made.name, chip)
        monkeypatch.setattr("builtins.input", lambda question: "y")
        assert main(["driver", *command]) == 0
        assert f"-P {made.name}" in notes.read_text(encoding="utf-8")


@pytest.mark.parametrize(("content", "words"), [(None, "no such file"), ("\x7fELF", "no Intel HEX")])
def test_an_image_that_is_none_is_refused(content, words, tmp_path, capsys):
    file = tmp_path / "image"
    if content is not None:
        file.write_text(content, encoding="utf-8")
    assert words in refused(capsys, "flash", DESIGN, "--port", "COM7", "--image", str(file), "--dry-run")


TEENSY = ["--set", "board.kind=teensy-40"]


@needs_shell
def test_a_board_that_is_no_avr_is_flashed_by_arduino_cli(avrdude, port, tmp_path, capsys):
    notes = avrdude(name="arduino-cli")
    out = tmp_path / "outputs"
    assert (
        main(["driver", "flash", DESIGN, *TEENSY, "--port", port, "--out", str(out), "--patience", "0.1"])
        == 0
    )
    (folder,) = out.glob("*/fabrication/firmware/optopad")
    assert notes.read_text().split() == [
        *("compile", "--fqbn", "teensy:avr:teensy40", "--upload", "--port", port, str(folder)),
    ]
    avrdude("Error: platform not installed", 1, name="arduino-cli")
    said = refused(capsys, "flash", DESIGN, *TEENSY, "--port", port, "--out", str(out), "--patience", "0.1")
    assert "arduino-cli core install" in said


PICO = ["--set", "board.kind=raspberry-pi-pico", "--set", "board.receivers.multiplexer=74hc4067"]
RP2040, RP2350 = 0xE48BFF56, 0xE48BFF59


def uf2(file: Path, family: int = RP2040, blocks: int = 3) -> Path:
    """A UF2 file of this many blocks."""
    numbers = ((0x0A324655, 0x9E5D5157, 0x2000, 256 * n, 256, n, blocks, family) for n in range(blocks))
    file.write_bytes(b"".join(struct.pack("<8I476xI", *one, 0x0AB16F30) for one in numbers))
    return file


@pytest.fixture
def drives(tmp_path, monkeypatch):
    """Makes mounted drives: folders with the file that tells their board, or without one."""

    def mounted(*board_ids: str | None) -> list[Path]:
        found = [tmp_path / f"drive {number}" for number in range(len(board_ids))]
        for drive, board_id in zip(found, board_ids, strict=True):
            drive.mkdir(exist_ok=True)
            if board_id:
                text = f"UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: {board_id}\n"
                (drive / "INFO_UF2.TXT").write_text(text, encoding="ascii")
        monkeypatch.setattr("optopad.verbs.driver.flash.mounted_drives", lambda: found)
        return found

    return mounted


def test_a_uf2_file_is_copied_to_the_board_in_its_boot_mode(drives, tmp_path, capsys):
    _, _, drive = drives(None, "RP2350", "RPI-RP2")
    file = uf2(tmp_path / "optopad.ino.uf2")
    given = ["driver", "flash", DESIGN, *PICO, "--image", str(file)]
    assert main([*given, "--dry-run"]) == 0
    assert capsys.readouterr().out.strip() == f"cp {file} '{drive}'"
    assert not (drive / file.name).exists()
    assert main(given) == 0
    assert f"uploaded  {file} to {drive}" in " ".join(capsys.readouterr().out.split("\n"))
    assert (drive / file.name).read_bytes() == file.read_bytes()
    assert main([*given, "--port", str(drive), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["uploaded"] is True


def test_a_uf2_file_that_is_none_or_for_another_chip_is_refused(drives, tmp_path, capsys):
    (drive,) = drives("RPI-RP2")
    cut = uf2(tmp_path / "cut.uf2")
    cut.write_bytes(cut.read_bytes()[:-1])
    short = uf2(tmp_path / "short.uf2")
    short.write_bytes(short.read_bytes()[:-512])
    os.mkfifo(tmp_path / "pipe.uf2")
    for file, words in (
        (tmp_path / "none.uf2", "no such file"),
        (tmp_path / "pipe.uf2", "a pipe or a device"),
        (short, "2 of its 3 blocks are there"),
        (cut, "not a UF2 file"),
        (uf2(tmp_path / "other.uf2", RP2350), "compiled for 0xe48bff59; the board RPI-RP2 takes 0xe48bff56"),
    ):
        assert words in refused(capsys, "flash", DESIGN, *PICO, "--image", str(file))
    assert [one.name for one in drive.iterdir()] == ["INFO_UF2.TXT"]


@pytest.mark.parametrize(
    ("boards", "words"),
    [
        ([], "RPI-RP2 (0 ... BOOTSEL"),
        ([None, "RP2350"], "1 is ... RP2350 ... BOOTSEL"),
        (["RPI-RP2", "RPI-RP2"], "2 drives of boards RPI-RP2"),
    ],
)
def test_no_drive_or_two_of_them_are_told_apart(boards, words, drives, tmp_path, capsys):
    drives(*boards)
    assert says(refused(capsys, "flash", DESIGN, *PICO, "--image", str(uf2(tmp_path / "a.uf2"))), words)


def test_only_drives_of_the_boot_drives_file_system_are_looked_at(tmp_path):
    from optopad.fabrication.flash import mounted_drives

    mounts = tmp_path / "mounts"
    mounts.write_text(
        "/dev/sda1 / ext4 rw 0 0\n"
        "server:/export /net/far nfs rw 0 0\n"
        "/dev/sdb1 /media/a\\040user/RPI-RP2 vfat rw 0 0\n"
    )
    assert mounted_drives(mounts) == [Path("/media/a user/RPI-RP2")]
    assert Path("/") not in mounted_drives()


def test_a_file_of_the_rp2350_may_begin_with_a_block_that_its_boot_loader_ignores(drives, tmp_path, capsys):
    (drive,) = drives("RP2350")
    file, absolute = uf2(tmp_path / "a.uf2", RP2350), uf2(tmp_path / "b.uf2", 0xE48BFF57, blocks=2)
    file.write_bytes(absolute.read_bytes()[:512] + file.read_bytes())
    pico_2 = ["--set", "board.kind=raspberry-pi-pico-2", *PICO[2:]]
    assert main(["driver", "flash", DESIGN, *pico_2, "--image", str(file)]) == 0
    assert (drive / file.name).read_bytes() == file.read_bytes()


@pytest.mark.parametrize("is_gone", [True, False])
def test_a_drive_that_leaves_after_the_last_block_has_taken_the_file(
    is_gone, drives, tmp_path, monkeypatch, capsys
):
    (drive,) = drives("RPI-RP2")

    def restarted(_: int) -> None:
        if is_gone:
            (drive / "INFO_UF2.TXT").unlink()
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("os.fsync", restarted)
    given = ["driver", "flash", DESIGN, *PICO, "--image", str(uf2(tmp_path / "a.uf2"))]
    if is_gone:
        assert main(given) == 0
        assert "uploaded" in capsys.readouterr().out
    else:
        assert "Input/output" in refused(capsys, *given[1:])


def test_a_budget_without_a_currency_and_a_missing_price_list_are_refused(capsys, tmp_path):
    assert "--budget: '25'" in refused(capsys, "config", DESIGN, "--budget", "25")
    assert "'XYZ' is not a known currency" in refused(capsys, "config", DESIGN, "--budget", "25XYZ")
    assert "no.csv" in refused(capsys, "config", DESIGN, "--prices", str(tmp_path / "no.csv"))
