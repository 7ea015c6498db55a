"""Solved presses on disk: one .npz an entry, named by a hash of everything the solution depends on.

Plain arrays only: nothing in an entry is executed on reading. An entry is written whole or not at all,
so readers and racing writers see whole files only. An entry that cannot be read, or that is not what
its name says, counts as absent and is replaced.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from design.errors import OutputError
from design.plain_arrays import plain_arrays
from design.whole_file import whole_file
from sims.cache.folder import CACHE_VARIABLE
from sims.cache.folder import cache_folder as folder_of_all
from sims.contact.library.profiles import UnitPress

FORMAT = 1
"""Version of the entry's layout."""
MOST_BYTES = 50_000_000
"""Of an entry; the largest in use have some hundred kB."""
_SCALARS = ("layer_depth", "wall_radius", "crown", "mesh_size", "wedge_angle", "poisson_ratio")
_MAY_LACK = {"crown": 0.0}
"""Fields that an entry of a flat layer may lack, and what they are there."""
_PER_STATE = ("radii", "heights", "normal_force")


def cache_folder() -> Path:
    """Folder of the stored presses."""
    return folder_of_all() / "contact"


def entry_key(inputs: Mapping[str, object]) -> str:
    """SHA-256 over the inputs of a solution, as 64 hexadecimal digits."""
    text = json.dumps({"format": FORMAT, **inputs}, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def entry_path(key: str) -> Path:
    """Where an entry lies."""
    return cache_folder() / f"{key}.npz"


def _is_whole(press: UnitPress) -> bool:
    """Whether all arrays are finite and fit together."""
    depths, nodes = press.depths.size, press.rest_radii.size
    shapes = dict.fromkeys(_PER_STATE, (depths, nodes)) | {
        "rest_radii": (nodes,),
        "tip_rows": (len(press.tip_rows), 7),
    }
    arrays = {f.name: getattr(press, f.name) for f in fields(press) if f.name not in (*_SCALARS, "versions")}
    return depths > 0 and all(
        array.shape == shapes.get(name, (depths,)) and bool(np.isfinite(array).all())
        for name, array in arrays.items()
    )


def read_entry(key: str) -> UnitPress | None:
    """The stored press, or None where there is none that can be used."""
    try:
        entry = plain_arrays(entry_path(key), most_bytes=MOST_BYTES)
        if str(entry["key"]) != key:
            return None
        found: dict[str, object] = {
            f.name: entry[f.name] for f in fields(UnitPress) if f.name in entry or f.name not in _MAY_LACK
        }
    except (OSError, ValueError, KeyError):
        return None
    found = _MAY_LACK | found
    found |= {name: float(np.asarray(found[name])) for name in _SCALARS}
    found["versions"] = tuple(str(text) for text in np.atleast_1d(np.asarray(found["versions"])))
    press = UnitPress(**found)  # type: ignore[arg-type]
    return press if _is_whole(press) else None


def _arrays(press: UnitPress) -> dict[str, np.ndarray[Any, Any]]:
    """Every field as an array."""
    return {field.name: np.array(getattr(press, field.name)) for field in fields(press)}


def write_entry(key: str, press: UnitPress) -> str | None:
    """Store a press; returns None, or a note that says why it could not be stored."""
    path = entry_path(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as hidden, hidden.open("wb") as file:
            np.savez(file, allow_pickle=False, key=np.array(key), **_arrays(press))
    except (OSError, OutputError) as err:
        cause = err.__cause__ or err
        reason = getattr(cause, "strerror", None) or str(cause)
        return f"contact solution not stored in {path.parent} ({reason}); set {CACHE_VARIABLE} to a writable folder"
    return None
