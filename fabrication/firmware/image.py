"""Compiling the sketch without the Arduino IDE: avr-gcc makes an image for the boot loader, and tells its size."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from design.errors import DeviceError
from design.spec import SensorDesign
from design.whole_file import temporary_folder
from fabrication.firmware.settings import FirmwareSettings, firmware_settings
from fabrication.firmware.sketch import MAIN, sketch_texts, source_text

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
"""A compilation takes about a second."""

GET_COMPILER = (
    "install it (Debian and Ubuntu: gcc-avr and avr-libc), or open the sketch folder in the Arduino IDE"
)


@dataclass(frozen=True, kw_only=True)
class Image:
    """A compiled program.

    Attributes
    ----------
    hex_text : Intel HEX, as avrdude takes it
    flash_bytes, ram_bytes : what it takes of the chip; the stack comes on top of the latter
    """

    hex_text: str
    flash_bytes: int
    ram_bytes: int


def has_compiler() -> bool:
    """Whether the compiler and its companions are installed."""
    return all(shutil.which(tool) for tool in (COMPILER, COPIER, SIZER))


def compiled_image(design: SensorDesign) -> Image:
    """The program of a design.

    Raises
    ------
    DesignError : as `sketch_texts`.
    DeviceError : no compiler, or one that cannot compile it.
    """
    with temporary_folder() as scratch:
        folder = Path(scratch)
        elf = compile_elf(design, folder)
        copied = folder / "image.hex"
        _run([COPIER, "-O", "ihex", "-R", ".eeprom", str(elf), str(copied)])
        text, data, bss = _sizes(elf)
        return Image(hex_text=copied.read_text("ascii"), flash_bytes=text + data, ram_bytes=data + bss)


def compile_elf(design: SensorDesign, folder: Path, changes: Sequence[str] = ()) -> Path:
    """The linked program, in a folder that is filled with its sources.

    Parameters
    ----------
    changes : definitions in place of those in config.h, as PRESCALER_EXPONENT=5

    Raises
    ------
    DesignError, DeviceError : as `compiled_image`.
    """
    settings = firmware_settings(design)
    if not has_compiler():
        raise DeviceError(f"{COMPILER} is not installed here; {GET_COMPILER}")
    for name, text in {**sketch_texts(design), MAIN: source_text(MAIN)}.items():
        (folder / name).write_text(text, encoding="utf-8")
    elf = folder / "image.elf"
    _run(
        [*_command(settings), *(f"-D{change}" for change in changes), "-o", str(elf), "core.c", MAIN], folder
    )
    return elf


def _command(settings: FirmwareSettings) -> list[str]:
    return [COMPILER, *OPTIONS, f"-mmcu={settings.chip.mcu}", f"-DF_CPU={settings.clock_hz}UL"]


def _sizes(elf: Path) -> tuple[int, int, int]:
    """Bytes of program, of variables with a first value, and of those without."""
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
