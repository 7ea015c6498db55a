"""What every verb shares: its options, reading a design, changes by ``--set``, output for people and machines."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Annotated, Any

import typer

from design.errors import InputError

LARGEST_SEED = 2**31 - 1
"""What every library below takes."""


def require_folder(folder: Path) -> Path:
    """The folder, if it can be made and written when the work is done; nothing is left here.

    Raises
    ------
    OutputError : where it would lie is no folder, or may not be written.
    """
    from design.errors import OutputError

    place = folder.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    if not _takes_a_folder(place):
        raise OutputError(f"--out: {folder} cannot be made: {place} is no folder to write in; choose another")
    return folder


def _takes_a_folder(place: Path) -> bool:
    """Whether one can be made there, by trial: /proc says yes to an administrator and takes none."""
    import tempfile

    try:
        os.rmdir(tempfile.mkdtemp(prefix=".optopad-", dir=place))
    except OSError:
        return False
    return True


DesignArgument = Annotated[
    str, typer.Argument(metavar="DESIGN", help="Design file (.toml), bundle folder, or the name of a preset.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="PATH=VALUE", help="Change a field, as cavity.clear_thickness_mm=10. Repeatable."
    ),
]
OutOption = Annotated[
    Path,
    typer.Option("--out", metavar="FOLDER", help="Folder that holds the bundles.", callback=require_folder),
]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output, nothing else.")]
SeedOption = Annotated[
    int, typer.Option("--seed", min=0, max=LARGEST_SEED, help="Seed of every random stream.")
]
FineOption = Annotated[
    bool,
    typer.Option("--fine", help="Finer light, and 11 places a side and 0.1 mm steps for the map of the pad."),
]

DEFAULT_OUT = Path("outputs")


def checked_out(out: Path, suffix: str, *read: Path | str | None) -> None:
    """Refuse to write over what the command reads, or over a file of another kind.

    Raises
    ------
    InputError : what is in the way.
    """
    if any(
        one is not None and Path(one).exists() and Path(one).samefile(out) for one in read if out.exists()
    ):
        raise InputError(f"--out {out}: is a file that this command reads; choose another name")
    if out.is_file() and out.suffix.lower() != suffix:
        raise InputError(f"--out {out}: exists and is no {suffix} file; choose another name, or remove it")


def parsed_press(text: str) -> tuple[float, float, float]:
    """Place and depth of one ``X,Y,DEPTH`` [mm].

    Raises
    ------
    InputError : not three finite numbers.
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


def print_json(document: dict[str, Any]) -> None:
    """One JSON object on standard output; an open end is null, never Infinity."""
    typer.echo(json.dumps(document, indent=2, allow_nan=False))


def say(text: str = "") -> None:
    """A line for people on standard output."""
    typer.echo(text)
