"""Options that several commands share, and checks of their values."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeVar

from optopad.design.errors import InputError, OutputError
from optopad.design.files import folder_fault, has_file_suffix, require_folder_name, require_suffix

Folder = TypeVar("Folder", Path, Path | None)
LARGEST_SEED = 2**31 - 1
"""Largest seed that all used libraries accept."""


def file_name(*suffixes: str, or_folder: bool = False) -> Callable[[Path | None], Path | None]:
    """Make a function that checks the name of an output file, before any other work.

    Parameters
    ----------
    suffixes : permitted file suffixes, for example ".nc"
    or_folder : whether a name without a suffix is permitted, for a folder
    """

    def checked(file: Path | None) -> Path | None:
        is_folder = or_folder and file is not None and (file.is_dir() or not has_file_suffix(file))
        if file is not None and not is_folder:
            require_suffix(file, suffixes, "--out ")
        return file

    return checked


def require_folder(folder: Folder) -> Folder:
    """Check that a folder can be created and written later, and return it; nothing is created yet.

    Raises
    ------
    InputError : the name is that of a file.
    OutputError : the folder cannot be created or written.
    """
    if folder is None:
        return None
    require_folder_name(folder, "--out ")
    if fault := folder_fault(folder):
        raise OutputError(f"--out {folder}: cannot be written: {fault}; choose another folder")
    return folder


def named(path: Path) -> Path:
    """The path itself if it ends in a name, else the same place by its name: ``.`` gives the current folder's path."""
    return path if path.name not in ("", "..") else Path(os.path.realpath(path))


def checked_out(out: Path, *read: Path | str | None) -> None:
    """Raise InputError if the command would overwrite a file that it reads."""
    if any(
        one is not None and Path(one).exists() and Path(one).samefile(out) for one in read if out.exists()
    ):
        raise InputError(f"--out {out}: is a file that this command reads; choose another name")


def parsed_press(text: str) -> tuple[float, float, float]:
    """Parse x, y and depth of a press from a text ``X,Y,DEPTH`` [mm].

    Raises
    ------
    InputError : the text is not three finite numbers.
    """
    try:
        x_mm, y_mm, depth_mm = (float(number) for number in text.split(","))
    except ValueError:
        raise InputError(
            f"--press: {text!r} is refused: write X,Y,DEPTH in millimetres, as 16,16,2"
        ) from None
    if not all(math.isfinite(number) for number in (x_mm, y_mm, depth_mm)):
        raise InputError(f"--press: {text!r} is refused: needs three finite numbers of millimetres")
    return x_mm, y_mm, depth_mm


def parsed_offset(text: str | None) -> float | Literal["auto"] | None:
    """The clock offset [s] of `--offset`; raises InputError."""
    if text is None:
        return None
    if text == "auto":
        return "auto"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"--offset: {text!r} is refused: seconds, or auto")
    return value


def typed(metavar: str | None = None, **how: Any) -> dict[str, Any]:
    """How a parameter is typed where the verb's signature does not say it.

    Parameters
    ----------
    metavar : what the help shows in place of the value
    how : `flag`, the option's name; `type`, to which the text is converted; `default`, if Python's is another;
        `help`, if the docstring has none; and what typer takes: min, max, callback
    """
    return {"metavar": metavar, **how}


SHARED: dict[str, dict[str, Any]] = {
    "design": typed("DESIGN", help="Design file (.toml), bundle folder, or the name of a preset."),
    "set_": typed("PATH=VALUE", help="Change a field, as cavity.clear_thickness_mm=10. Repeatable."),
    "out": typed("FOLDER", type=Path, callback=require_folder, help="Folder that holds the bundles."),
    "seed": typed(min=0, max=LARGEST_SEED, help="Seed of every random stream."),
    "fine": typed(help="Finer light, and a map of 11 locations per side with steps of 0.1 mm."),
    "details": typed(help="Print every figure instead of one screen."),
    "as_json": typed(help="One JSON object on standard output, nothing else."),
    # the built sensor
    "config": typed(
        "CONFIG", help="driver.toml, bundle folder, or the design that was built (file or preset)."
    ),
    "port": typed("NAME", help="Serial port, or serial:NUMBER of its USB device; default: found by USB."),
    "patience": typed(
        "S",
        min=0.1,
        help="Longest wait for a frame, and for the board to start, but at least its boot time (10 s if left out).",
    ),
    "rate": typed("HZ", min=0, help="Frames per second; 0: as many as the board can."),
    "accept_digest": typed("DIGITS", help="Accept a board with firmware of this other design."),
    "frames": typed("N", min=1, help="End after at least this number of frames."),
    "seconds": typed("S", min=0.0, help="End after this time."),
    "bundles": typed("FOLDER", help="Folder that holds the bundles, to find a design's."),
    # recordings
    "topic": typed("NAME", help="Topic of the frames, in a bag of several sensors."),
    "press_topic": typed("NAME", help="Topic of the presses, if a bag has several."),
    "offset": typed("S", help="This machine's clock minus the log's; `auto` finds it."),
}
"""How parameters that many verbs have are typed, by name."""
