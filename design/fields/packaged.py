"""Reader of the tables and files that are packaged with optopad."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from optopad.design.errors import DesignError
from optopad.design.fields.base import nearest
from optopad.design.fields.quantity import Quantity


def data_table(file: str) -> dict[str, Any]:
    """Read a TOML file from the folder `design/data` as a dictionary."""
    return tomllib.loads((files("optopad.design") / "data" / file).read_text(encoding="utf-8"))


@cache
def data_quantities(file: str) -> dict[str, Quantity]:
    """Read a TOML file of quantities from the folder `design/data`, as a dictionary by name."""
    return {name: Quantity(**row) for name, row in data_table(file).items()}


def packaged_or_own(
    where: str | Path, package: str, names: tuple[str, ...], *, kind: str, listed_as: str
) -> Path:
    """Path of the user's file at `where`, or else of the packaged file with this name.

    Parameters
    ----------
    package : Python package that contains the packaged files
    names : names of the packaged files
    kind : kind of file, for messages
    listed_as : term for the list of packaged files, for messages

    Raises
    ------
    DesignError : neither file exists.
    """
    file = Path(where)
    if file.exists():
        return file
    if str(where) in names:
        return Path(str(files(package) / f"{where}.toml"))
    near = nearest(file.stem, names)
    hint = f"did you mean the packaged {near[0]}?" if near else f"{listed_as}: {', '.join(names)}"
    raise DesignError(f"{file}: no such {kind}; {hint}")
