"""What every verb shares: its options, reading a design, changes by ``--set``, output for people and machines."""

from __future__ import annotations

import json
import math
import os
import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from design.errors import InputError
from design.spec import SensorDesign

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


def read_design(where: str, changes: list[str] | None) -> SensorDesign:
    """Load a design file, a bundle's design, or a preset, and apply ``--set`` changes.

    Raises
    ------
    DesignError, InputError : what is wrong with the file or a change.
    """
    from design.fields.paths import nearest
    from design.io import load_design
    from design.preset import PRESETS, preset

    path = Path(where)
    if not path.exists() and where in PRESETS:
        design = preset(where)
    elif not path.exists() and not path.suffix:
        near = nearest(where, PRESETS)
        hint = f"did you mean {near[0]}?" if near else f"presets: {', '.join(PRESETS)}"
        raise InputError(f"{where}: no such file, bundle or preset; {hint}")
    else:
        design = load_design(path / "design.toml" if (path / "manifest.json").is_file() else path)
    return design.with_(**dict(parsed_change(change) for change in changes)) if changes else design


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


def parsed_change(text: str, *, option: str = "--set") -> tuple[str, Any]:
    """Path and value of one ``PATH=VALUE``; the value is read as TOML, else as plain text.

    Raises
    ------
    InputError : no ``=`` or no path.
    """
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"{option}: {text!r} is refused: write PATH=VALUE, as cavity.clear_thickness_mm=10")
    return path.strip(), parsed_value(value.strip())


def parsed_value(text: str) -> Any:
    """A value written as in a design file; bare words are text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):  # not TOML, a whole number of thousands of digits, nested too deep
        return text


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
