"""The sketch folder, which the Arduino IDE opens as it is, and which the compiler takes with `main.c` beside it."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from design.io import write_text_atomically
from design.spec import SensorDesign
from fabrication.firmware.config_header import config_header
from fabrication.firmware.settings import firmware_settings

SKETCH = "optopad"
"""Name of the folder and of the .ino in it: the Arduino IDE wants them alike."""

IMAGE = f"{SKETCH}.hex"
CONFIG = "config.h"
FIXED_FILES = ("optopad.ino", "core.c", "core.h", "clock.h", "crc.h", "line.h")
"""The same for every design."""

MAIN = "main.c"
"""What the Arduino core would bring; not in the sketch folder, where there would then be two."""


def source_text(name: str) -> str:
    """A packaged source file."""
    return files("fabrication.firmware").joinpath("source", name).read_text(encoding="utf-8")


def sketch_texts(design: SensorDesign) -> dict[str, str]:
    """Text of every file of the sketch folder by name.

    Raises
    ------
    DesignError : the design breaks a rule, or its board's entry does not say enough to program it.
    """
    fixed = {name: source_text(name) for name in FIXED_FILES}
    return {**fixed, CONFIG: config_header(firmware_settings(design))}


def write_sketch(design: SensorDesign, folder: Path) -> Path:
    """Write the sketch folder into a folder; an image of a former text beside it is removed.

    Returns
    -------
    the sketch folder

    Raises
    ------
    DesignError : as `sketch_texts`; nothing is written.
    OutputError : the folder cannot be written.
    """
    texts, sketch = sketch_texts(design), folder / SKETCH
    sketch.mkdir(parents=True, exist_ok=True)
    if any(_is_other(sketch / name, text) for name, text in texts.items()):
        (folder / IMAGE).unlink(missing_ok=True)
    for name, text in texts.items():
        write_text_atomically(sketch / name, text)
    return sketch


def _is_other(file: Path, text: str) -> bool:
    return not file.is_file() or file.read_text(encoding="utf-8", errors="replace") != text
