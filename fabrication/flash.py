"""Compiles and uploads firmware: avrdude writes a compiled program to AVR boards, arduino-cli a sketch to other boards.

The upload command is a pure function of board, program and port, so that it can be shown without being run. avrdude
checks the chip's signature before it writes, and reads everything back afterwards. avr-gcc compiles the program for AVR
boards without the Arduino IDE, and the program's size is reported.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from design.errors import DeviceError, InputError
from design.files import temporary_folder
from design.parts.board_firmware import ArduinoProgram, BoardFirmware
from design.spec import SensorDesign
from fabrication.sketch import MAIN, FirmwareSettings, firmware_settings, sketch_texts, source_text

COMPILER, COPIER, SIZER = "avr-gcc", "avr-objcopy", "avr-size"
OPTIONS = (
    "-std=gnu11",
    "-Os",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-flto",
    "-ffunction-sections",
    "-Wl,--gc-sections",
)
COMPILE_LIMIT_S = 60.0
"""Time limit of a compilation, which usually takes about a second [s]."""

GET_COMPILER = (
    "install it (Debian and Ubuntu: gcc-avr and avr-libc), or open the sketch folder in the Arduino IDE"
)


@dataclass(frozen=True, kw_only=True)
class Image:
    """A compiled program for an AVR chip.

    Attributes
    ----------
    hex_text : the program in the format Intel HEX, which avrdude reads
    flash_bytes : used program memory [bytes]
    ram_bytes : used RAM without the stack [bytes]
    """

    hex_text: str
    flash_bytes: int
    ram_bytes: int


def has_compiler() -> bool:
    """Whether the compiler avr-gcc and its tools are installed."""
    return all(shutil.which(tool) for tool in (COMPILER, COPIER, SIZER))


def compiled_image(design: SensorDesign) -> Image:
    """Compile the firmware of a design.

    Raises
    ------
    DesignError : the design breaks a rule, or the catalogue lacks data of the board.
    DeviceError : no compiler is installed, or the compilation failed.
    """
    with temporary_folder() as scratch:
        folder = Path(scratch)
        elf = compile_elf(design, folder)
        copied = folder / "image.hex"
        _run([COPIER, "-O", "ihex", "-R", ".eeprom", str(elf), str(copied)])
        text, data, bss = _sizes(elf)
        return Image(hex_text=copied.read_text("ascii"), flash_bytes=text + data, ram_bytes=data + bss)


def compile_elf(design: SensorDesign, folder: Path, changes: Sequence[str] = ()) -> Path:
    """Compile and link the firmware of a design in a folder; return the path of the program (ELF).

    Parameters
    ----------
    changes : macro definitions that replace the definitions in config.h, for example PRESCALER_EXPONENT=5

    Raises
    ------
    DesignError, DeviceError : as `compiled_image`.
    """
    settings = firmware_settings(design)
    chip = avr_chip(settings)
    if not has_compiler():
        raise DeviceError(f"{COMPILER} is not installed here; {GET_COMPILER}")
    for name, text in {**sketch_texts(design), MAIN: source_text(MAIN)}.items():
        (folder / name).write_text(text, encoding="utf-8")
    elf = folder / "image.elf"
    _run(
        [
            *_command(chip, settings.clock_hz),
            *(f"-D{change}" for change in changes),
            "-o",
            str(elf),
            "core.c",
            MAIN,
        ],
        folder,
    )
    return elf


def _command(chip: BoardFirmware, clock_hz: int) -> list[str]:
    return [COMPILER, *OPTIONS, f"-mmcu={chip.mcu}", f"-DF_CPU={clock_hz}UL"]


def avr_chip(settings: FirmwareSettings) -> BoardFirmware:
    """Catalogue entry for the firmware of an AVR board; raises DeviceError for other boards."""
    if not isinstance(settings.chip, BoardFirmware):
        raise DeviceError(
            f"the program of the {settings.board_title} is compiled by {ARDUINO} (`optopad driver flash`) or the "
            f"Arduino IDE, for the board {settings.chip.arduino_board}"
        )
    return settings.chip


def _sizes(elf: Path) -> tuple[int, int, int]:
    """Sizes [bytes] of the program, of variables with an initial value, and of variables without."""
    row = _run([SIZER, str(elf)]).splitlines()[1].split()
    return int(row[0]), int(row[1]), int(row[2])


def _run(command: list[str], folder: Path | None = None) -> str:
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=COMPILE_LIMIT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as err:
        raise DeviceError(f"{command[0]} did not run: {err}; {GET_COMPILER}") from err
    if done.returncode:
        said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip()[:200])
        raise DeviceError(f"{command[0]} could not make the firmware: {said}; {GET_COMPILER}")
    return done.stdout


UF2_BLOCK = struct.Struct("<8I476sI")
UF2_MAGIC = 0x0A324655, 0x9E5D5157, 0x0AB16F30
"""First, second and last number of each block of a UF2 file (Microsoft's specification of UF2)."""
UF2_HAS_FAMILY = 0x2000
INFO_FILE = "INFO_UF2.TXT"
BOOT_MODE = "hold the board's BOOTSEL button while you plug it in; it then appears as a drive"


def uf2_families(file: Path) -> set[int]:
    """Identifiers of chip families for which a UF2 file is made.

    Raises
    ------
    InputError : the file does not exist, or does not consist of complete UF2 blocks.
    """
    try:
        content = file.read_bytes()
    except OSError as err:
        raise InputError(f"{file}: {err.strerror}; name a .uf2 file") from None
    whole = bool(content) and len(content) % UF2_BLOCK.size == 0
    blocks = [UF2_BLOCK.unpack_from(content, at) for at in range(0, len(content), UF2_BLOCK.size) if whole]
    if not whole or any((one[0], one[1], one[-1]) != UF2_MAGIC for one in blocks):
        raise InputError(
            f"{file}: not a UF2 file; Sketch > Export Compiled Binary of the Arduino IDE writes one"
        )
    return {one[7] for one in blocks if one[2] & UF2_HAS_FAMILY}


def boot_drive(chip: ArduinoProgram, drives: Sequence[Path]) -> Path:
    """Folder of the drive that a board of this kind provides in its boot mode.

    Parameters
    ----------
    drives : folders at which drives are mounted

    Raises
    ------
    DeviceError : no drive or several drives match.
    """
    assert chip.boot_drive is not None, "the caller knows that the board has one"
    wanted = f"Board-ID: {chip.boot_drive.board_id}"
    found: list[Path] = []
    other: list[Path] = []
    for drive in drives:
        try:
            lines = (drive / INFO_FILE).read_text(encoding="ascii", errors="replace").splitlines()
        except OSError:
            continue
        (found if wanted in map(str.strip, lines) else other).append(drive)
    if len(found) != 1:
        seen = (
            f"{len(found)} of them: {', '.join(map(str, found))}; unplug all but one" if found else BOOT_MODE
        )
        also = f" (other boards: {', '.join(map(str, other))})" if other and not found else ""
        raise DeviceError(f"needs one drive of a {chip.boot_drive.board_id} board{also}: {seen}")
    return found[0]


def mounted_drives() -> list[Path]:
    """Folders at which drives are mounted, on Linux and macOS."""
    try:
        rows = Path("/proc/mounts").read_text(encoding="utf-8").splitlines()
        return [Path(row.split()[1].replace("\\040", " ")) for row in rows]
    except OSError:
        volumes = Path("/Volumes")
        return sorted(volumes.iterdir()) if volumes.is_dir() else []


def copy_uf2(file: Path, drive: Path) -> None:
    """Copy a UF2 file to the drive of a board, which then restarts with the new program.

    Raises
    ------
    DeviceError : the file cannot be written to the drive.
    """
    try:
        with open(drive / file.name, "wb") as target:
            target.write(file.read_bytes())
            target.flush()
            os.fsync(target.fileno())
    except OSError as err:
        raise DeviceError(
            f"{drive}: the file was not copied: {err.strerror}; {BOOT_MODE}, then try again"
        ) from err


UPLOADER, ARDUINO = "avrdude", "arduino-cli"
UPLOAD_LIMIT_S = {UPLOADER: 180.0, ARDUINO: 900.0}
"""Time limits of an upload by each program [s]. A whole chip at 115200 baud takes a minute, arduino-cli's first
compilation some minutes."""

SHOWN_LINES = 3

CAUSES: Mapping[str, str] = MappingProxyType(
    {
        "permission denied": "you may not use the port: join its group (Debian and Ubuntu: dialout), then log in again",
        "busy": "another program has the port open: end it (a serial monitor, `driver read`), then try again",
        "not in sync": (
            "no reply of a boot loader: are board and port right? Press the reset button just before the upload"
        ),
        "timeout": "no reply of a boot loader: are board and port right? Press the reset button just before the upload",
        "signature": "the chip is not that of the design's board: correct board.kind or use the right board",
        "verification error": "verification failed: try again with another cable",
        "platform not installed": "install the board's core: `arduino-cli core install teensy:avr`, say",
    }
)
"""Advice for known error messages of the uploader; the key is a part of the message in lower case."""


def upload_command(chip: BoardFirmware, image: Path, port: str) -> list[str]:
    """The command line that writes a compiled program to the board at a port."""
    return [
        UPLOADER,
        *("-p", chip.mcu, "-c", chip.programmer, "-P", port, "-b", str(chip.upload_baud)),
        "-D",  # these boot loaders erase page by page; avrdude's own erasing of the chip fails on them
        *("-U", f"flash:w:{image}:i"),
    ]


def sketch_command(chip: ArduinoProgram, sketch: Path, port: str) -> list[str]:
    """The command line that compiles a sketch folder and writes the program to the board at a port."""
    return [ARDUINO, "compile", "--fqbn", chip.fqbn, "--upload", "--port", port, str(sketch)]


def require_uploader(chip: BoardFirmware | ArduinoProgram, sketch: Path, port: str) -> None:
    """Raise DeviceError if the upload program or the port is missing, so that an upload cannot start."""
    by_hand = f"in the Arduino IDE, open {sketch}, select the board {chip.arduino_board}, and press Upload"
    if isinstance(chip, BoardFirmware) and shutil.which(UPLOADER) is None:
        raise DeviceError(
            f"{UPLOADER} is not installed here; install it (Debian and Ubuntu: avrdude), or, {by_hand}"
        )
    if isinstance(chip, ArduinoProgram) and shutil.which(ARDUINO) is None:
        copied = (
            ""
            if chip.boot_drive is None
            else "; or export the compiled .uf2 file there and give it as --image"
        )
        raise DeviceError(f"{ARDUINO} is not installed here; install it, or, {by_hand}{copied}")
    if os.sep == "/" and not Path(port).exists():
        raise DeviceError(f"{port}: no such port; plug the board in and name the port that then appears")


def upload(command: Sequence[str], port: str) -> None:
    """Run an upload command from `upload_command` or `sketch_command`.

    Raises
    ------
    DeviceError : the upload program cannot start, does not end, or fails. The message quotes its output and says what
        to do.
    """
    uploader = command[0]
    limit_s = UPLOAD_LIMIT_S[uploader]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired:
        raise DeviceError(
            f"{port}: {uploader} did not finish within {limit_s:g} s; unplug the board, plug it in, try again"
        ) from None
    except OSError as err:
        raise DeviceError(f"{uploader} cannot be started: {err.strerror or err}") from err
    if done.returncode:
        raise DeviceError(f"{port}: the upload failed: {_explained(done.stderr or done.stdout)}")


def _explained(said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    shown = " | ".join(lines[-SHOWN_LINES:]) or "the uploader printed no message"
    help_ = next((way_out for words, way_out in CAUSES.items() if words in said.lower()), "")
    return f"{shown}; {help_}" if help_ else shown
