"""Write and read a trained model in one file, `.optomodel`: a NumPy archive of plain arrays and a JSON header.

The archive (.npz, a zip file) holds an array `header` (the JSON text's UTF-8 bytes), the arrays of the model, and
`sha256`, the 32 bytes of a checksum over header and arrays: names, types, shapes and contents, in the order of the
names. Reading a file executes nothing in it. A file is written completely or not at all.

`KINDS` lists the kinds of models.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.errors import InputError
from optopad.design.file_sets import settle
from optopad.design.files import kind_of_file, require_file, whole_file
from optopad.design.plain_arrays import plain_arrays
from optopad.sims.learning.inference.extra_trees import extra_trees_of_arrays
from optopad.sims.learning.inference.header import ModelHeader, header_of_json
from optopad.sims.learning.inference.kernel_ridge import kernel_ridge_of_arrays
from optopad.sims.learning.inference.signal_map import signal_map_of_arrays
from optopad.sims.learning.inference.touch_model import Arrays, TouchModel

KINDS: dict[str, Callable[[ModelHeader, Arrays], TouchModel]] = {
    "kernel-ridge": kernel_ridge_of_arrays,
    "extra-trees": extra_trees_of_arrays,
    "signal-map": signal_map_of_arrays,
}
"""Constructor of each kind of model from header and arrays; raises `InputError` if they are inconsistent."""

NEEDED = "a model (.optomodel), which `optopad train` writes"
MOST_BYTES = 400_000_000
"""Largest accepted size of the unpacked arrays [bytes]: twice the size of a kernel-ridge model with 49,000 samples of
1,024 pairs.
"""
_HEADER, _CHECKSUM = "header", "sha256"


def save_model(file: str | os.PathLike[str], model: TouchModel) -> None:
    """Write a model to a file; an older file remains until the new one is complete.

    Raises
    ------
    InputError, OutputError : the file cannot be written, see `optopad.design.files.whole_file`.
    """
    text = json.dumps(model.header.to_json(), allow_nan=False).encode()
    arrays: dict[str, NDArray[Any]] = {name: np.asarray(array) for name, array in model.arrays().items()}
    arrays[_HEADER] = np.frombuffer(text, np.uint8)
    arrays[_CHECKSUM] = np.frombuffer(_checksum(arrays), np.uint8)
    with whole_file(Path(file)) as hidden, hidden.open("wb") as stream:
        # not with `allow_pickle`, which NumPy 1 stores as one more array
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]


def load_model(file: str | os.PathLike[str]) -> TouchModel:
    """Read a model from a file.

    Raises
    ------
    InputError : the file is missing or damaged, or has a version or kind of model that this optopad does not support.
    """
    path = Path(file)
    arrays = _read(path)
    try:
        header = header_of_json(json.loads(arrays.pop(_HEADER).tobytes()))
        if header.kind not in KINDS:
            raise InputError(
                f"is of kind {header.kind!r}, this optopad reads {', '.join(KINDS)}; train one of these on its data"
            )
        return KINDS[header.kind](header, arrays)
    except InputError as err:
        raise InputError(f"{path}: {err}") from None
    except (ValueError, RecursionError) as err:
        raise InputError(f"{path}: its header cannot be read: {err}; train the model again") from None


def _read(path: Path) -> dict[str, NDArray[Any]]:
    """Read a file and check its checksum; return its other arrays."""
    settle(path.parent)
    require_file(path, needed=NEEDED)
    try:
        arrays = plain_arrays(path, most_bytes=MOST_BYTES)
        held = arrays.pop(_CHECKSUM).tobytes()
        if _HEADER not in arrays:
            raise KeyError(_HEADER)
    except (OSError, ValueError, KeyError) as err:
        raise InputError(
            f"{path}: is no optopad model, or it is damaged ({kind_of_file(path)}; {err}); needs {NEEDED}; copy or "
            "train it again"
        ) from None
    if held != _checksum(arrays):
        raise InputError(f"{path}: is damaged: its checksum does not match; copy or train it again")
    return arrays


def _checksum(arrays: Arrays) -> bytes:
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        total.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        total.update(array.reshape(-1).view(np.uint8).data)
    return total.digest()
