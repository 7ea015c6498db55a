"""Compiles and uploads firmware: avrdude writes a compiled program to AVR boards, arduino-cli a sketch to other boards.

The upload command depends only on board, program and port, so it can be shown without being run. avrdude checks the
chip's signature before it writes, and reads everything back afterwards. For AVR boards, avr-gcc compiles the program
without the Arduino IDE, and the program's size is reported.
"""

from __future__ import annotations

import os
import re
import shutil
import string
import struct
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from optopad.design.errors import DeviceError, InputError
from optopad.design.files import read_bytes, temporary_folder
from optopad.design.parts.board_firmware import ArduinoProgram, BoardFirmware
from optopad.fabrication.sketch import MAIN, FirmwareSettings, sketch_texts, source_text

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
    hex_text : the program in Intel HEX format, which avrdude reads
    flash_bytes : program memory used [bytes]
    ram_bytes : RAM used, not including the stack [bytes]
    """

    hex_text: str
    flash_bytes: int
    ram_bytes: int


def has_compiler() -> bool:
    """Whether the compiler avr-gcc and its tools are installed."""
    return all(shutil.which(tool) for tool in (COMPILER, COPIER, SIZER))


def compiled_image(settings: FirmwareSettings) -> Image:
    """Compile the firmware.

    Raises
    ------
    DeviceError : no compiler is installed, the compilation failed, or the board is not an AVR board.
    """
    with temporary_folder() as scratch:
        folder = Path(scratch)
        elf = compile_elf(settings, folder)
        copied = folder / "image.hex"
        _run([COPIER, "-O", "ihex", "-R", ".eeprom", str(elf), str(copied)])
        text, data, bss = _sizes(elf)
        return Image(hex_text=copied.read_text("ascii"), flash_bytes=text + data, ram_bytes=data + bss)


def compile_elf(settings: FirmwareSettings, folder: Path, changes: Sequence[str] = ()) -> Path:
    """Compile and link the firmware in a folder; return the path of the program (ELF).

    Parameters
    ----------
    changes : macro definitions that replace the definitions in config.h, for example PRESCALER_EXPONENT=5

    Raises
    ------
    DeviceError : for the same reasons as in `compiled_image`.
    """
    chip = avr_chip(settings)
    if not has_compiler():
        raise DeviceError(f"{COMPILER} is not installed here; {GET_COMPILER}")
    for name, text in {**sketch_texts(settings), MAIN: source_text(MAIN)}.items():
        (folder / name).write_text(text, encoding="utf-8")
    elf = folder / "image.elf"
    _run(
        [
            *_command(chip, settings.circuit.board.clock_hz),
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
    """Data of an AVR board that its firmware needs, from the catalogue; raises DeviceError for other boards."""
    if not isinstance(settings.chip, BoardFirmware):
        raise DeviceError(
            f"the program of the {settings.board_title} is compiled by {ARDUINO} (`optopad driver flash`) or the "
            f"Arduino IDE, for the board {settings.chip.arduino_board}"
        )
    return settings.chip


def _sizes(elf: Path) -> tuple[int, int, int]:
    """Sizes of the program, of its variables with an initial value, and of its other variables [bytes]."""
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
BOARD_ID = "Board-ID:"
BOOT_MODE = "hold the board's BOOTSEL button while you plug it in, and mount the drive that then appears"


MOST_IMAGE_BYTES = 64_000_000
"""Largest file of a compiled program that is read [bytes]; the largest flash memories of boards hold 16 MB."""


def require_uf2(chip: ArduinoProgram, file: Path) -> None:
    """Check that a file is a complete UF2 file for a board.

    A UF2 file consists of blocks, each marked with a family of chips. Files for the RP2350 begin with a block of
    another family, which its boot loader ignores, so only blocks of the board's own families are counted.

    Raises
    ------
    InputError : the file does not exist, is not a UF2 file, is for other boards, or lacks blocks.
    """
    assert chip.boot_drive is not None, "the caller knows that the board has one"
    content = read_bytes(file, needed="a .uf2 file", most_bytes=MOST_IMAGE_BYTES)
    is_whole = bool(content) and len(content) % UF2_BLOCK.size == 0
    blocks = list(UF2_BLOCK.iter_unpack(content)) if is_whole else []
    if not is_whole or any((block[0], block[1], block[-1]) != UF2_MAGIC for block in blocks):
        raise InputError(
            f"{file}: not a UF2 file; Sketch > Export Compiled Binary of the Arduino IDE writes one"
        )
    takes = chip.boot_drive.families
    numbered = {(block[7], block[6], block[5]) for block in blocks if block[2] & UF2_HAS_FAMILY}
    own = sorted(one for one in numbered if one[0] in takes)
    if not own:
        families = {family for family, _, _ in numbered}
        raise InputError(
            f"{file}: compiled for {_listed(families) or 'no family'}; the board {chip.boot_drive.board_id} takes "
            f"{_listed(takes)}; compile the sketch for {chip.fqbn}"
        )
    family, total, _ = own[0]
    if own != [(family, total, number) for number in range(len(own))] or total != len(own):
        raise InputError(f"{file}: {len(own)} of its {total} blocks are there; export or copy it again")


def _listed(families: Iterable[int]) -> str:
    return ", ".join(f"0x{family:08x}" for family in sorted(families))


def boot_drive(chip: ArduinoProgram, drives: Sequence[Path]) -> Path:
    """Mount point of the drive as which a board of this type appears in its boot mode.

    Parameters
    ----------
    drives : mount points of the drives to examine

    Raises
    ------
    DeviceError : no drive or several drives match.
    """
    assert chip.boot_drive is not None, "the caller knows that the board has one"
    board_ids = {drive: board_id for drive in drives if (board_id := _board_id(drive)) is not None}
    wanted = chip.boot_drive.board_id
    found = [drive for drive, board_id in board_ids.items() if board_id == wanted]
    if len(found) == 1:
        return found[0]
    if found:
        listed = ", ".join(map(str, found))
        raise DeviceError(
            f"{len(found)} drives of boards {wanted}: {listed}; unplug all but one, or name it: --port"
        )
    others = [
        f"{drive} is that of a board {board_id or 'without a name'}" for drive, board_id in board_ids.items()
    ]
    looked = others or [
        f"{drives[0]} has no {INFO_FILE}" if len(drives) == 1 else f"{len(drives)} drives are mounted"
    ]
    raise DeviceError(f"no drive of a board {wanted} ({'; '.join(looked)}); {BOOT_MODE}")


def _board_id(drive: Path) -> str | None:
    """Identifier of the board whose boot drive this is, "" if it has none; None for a drive of another device."""
    try:
        lines = (drive / INFO_FILE).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return None
    return next((line.removeprefix(BOARD_ID).strip() for line in lines if line.startswith(BOARD_ID)), "")


MOUNTS = Path("/proc/mounts")
FAT = "vfat", "msdos"
"""Linux's names for the file system of a boot drive; drives with other file systems, such as network drives, may not
reply and are ignored."""


def mounted_drives(mounts: Path = MOUNTS) -> list[Path]:
    """Mount points of drives that may be boot drives.

    Parameters
    ----------
    mounts : Linux's table of mounted drives; if it does not exist, the drives of macOS or Windows are returned
    """
    try:
        rows = [row.split() for row in mounts.read_text(encoding="utf-8").splitlines()]
    except OSError:
        volumes = Path("/Volumes")
        letters = [Path(f"{letter}:\\") for letter in string.ascii_uppercase] if os.name == "nt" else []
        return sorted(volumes.iterdir()) if volumes.is_dir() else letters
    escaped = re.compile(r"\\([0-7]{3})")
    return [
        Path(escaped.sub(lambda code: chr(int(code[1], 8)), row[1]))
        for row in rows
        if len(row) > 2 and row[2] in FAT
    ]


def copy_uf2(file: Path, drive: Path) -> None:
    """Copy a UF2 file to the drive of a board, which then restarts with the new program.

    The board restarts as soon as it has the whole file, so its drive may disappear before the file is closed.

    Raises
    ------
    DeviceError : the file cannot be written to the drive.
    """
    content, sent = file.read_bytes(), 0
    try:
        with open(drive / file.name, "wb", buffering=0) as target:
            while sent < len(content):
                sent += target.write(content[sent:])
            os.fsync(target.fileno())
    except OSError as err:
        if sent == len(content) and not (drive / INFO_FILE).exists():
            return
        raise DeviceError(
            f"{drive}: the file was not copied: {err.strerror}; {BOOT_MODE}, then try again"
        ) from err


UPLOADER, ARDUINO = "avrdude", "arduino-cli"
UPLOAD_LIMIT_S = {UPLOADER: 180.0, ARDUINO: 900.0}
"""Time limit of an upload with each program [s]. Writing a whole chip at 115200 baud takes a minute, and the first
compilation by arduino-cli a few minutes."""

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
"""Advice for known error messages of the upload program, by a lower-case part of the message."""


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


def require_uploader(chip: BoardFirmware | ArduinoProgram, sketch: Path) -> None:
    """Raise DeviceError if the upload program is missing; the message says how to install or avoid it."""
    by_hand = f"in the Arduino IDE, open {sketch}, select the board {chip.arduino_board}, and press Upload"
    if isinstance(chip, BoardFirmware) and shutil.which(UPLOADER) is None:
        raise DeviceError(
            f"{UPLOADER} is not installed here; install it (Debian and Ubuntu: avrdude), or, {by_hand}"
        )
    if isinstance(chip, ArduinoProgram) and shutil.which(ARDUINO) is None:
        copied = (
            ""
            if chip.boot_drive is None
            else "; or export the compiled .uf2 file there and run `optopad driver flash DESIGN --image FILE.uf2`; "
            f"before that, {BOOT_MODE}"
        )
        raise DeviceError(f"{ARDUINO} is not installed here; install it, or, {by_hand}{copied}")


def require_port(port: str) -> None:
    """Raise DeviceError if a port does not exist; on Windows, nothing is checked."""
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
