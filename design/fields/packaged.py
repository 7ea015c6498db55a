"""Packaged tables and files."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from design.errors import DesignError
from design.fields.base import nearest
from design.fields.quantity import Quantity


def data_table(file: str) -> dict[str, Any]:
    """The rows of a file of `design/data`, by their names."""
    return tomllib.loads((files("design") / "data" / file).read_text(encoding="utf-8"))


@cache
def data_quantities(file: str) -> dict[str, Quantity]:
    """The values of a file of `design/data` whose rows are quantities."""
    return {name: Quantity(**row) for name, row in data_table(file).items()}


def packaged_or_own(
    where: str | Path, package: str, names: tuple[str, ...], *, kind: str, listed_as: str
) -> Path:
    """A file of the user's, or else the packaged one of that name.

    Raises
    ------
    DesignError : neither exists; `kind` names the kind of file, `listed_as` the list of packaged ones.
    """
    file = Path(where)
    if file.exists():
        return file
    if str(where) in names:
        return Path(str(files(package) / f"{where}.toml"))
    near = nearest(file.stem, names)
    hint = f"did you mean the packaged {near[0]}?" if near else f"{listed_as}: {', '.join(names)}"
    raise DesignError(f"{file}: no such {kind}; {hint}")
