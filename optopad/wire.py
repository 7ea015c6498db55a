"""Objects between the program's own processes, as a line of JSON and the arrays that it names; no code can be sent.

An object is a number, a text, None, a list, a tuple, a dictionary, a path, an array, a design, an error of a file or of
this package, or a data class of this package, of which module, name and fields are sent.
"""

from __future__ import annotations

import builtins
import importlib
import io
import json
from dataclasses import fields, is_dataclass
from pathlib import Path, PurePath
from typing import IO, Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import OptopadError
from optopad.design.spec import SensorDesign

PACKAGE = __name__.partition(".")[0] + "."


def packed(value: Any) -> bytes:
    """An object as bytes.

    Raises
    ------
    TypeError : it has a part of another type.
    """
    arrays: list[FloatArray] = []
    plain = _plain(value, arrays)
    blob = io.BytesIO()
    for array in arrays:
        np.save(blob, array, allow_pickle=False)
    return json.dumps([len(arrays), blob.tell(), plain]).encode() + b"\n" + blob.getvalue()


def unpacked(stream: IO[bytes]) -> Any:
    """Read the next object of a stream.

    Raises
    ------
    EOFError : the stream has ended.
    """
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    count, size, plain = json.loads(line)
    blob = io.BytesIO(stream.read(size))
    return _object(plain, [np.load(blob, allow_pickle=False) for _ in range(count)])


def _plain(value: Any, arrays: list[FloatArray]) -> Any:
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, list):
        return [_plain(one, arrays) for one in value]
    if isinstance(value, tuple):
        return {"tuple": [_plain(one, arrays) for one in value]}
    if isinstance(value, dict):
        return {"dict": [[_plain(key, arrays), _plain(one, arrays)] for key, one in value.items()]}
    if isinstance(value, (np.ndarray, np.generic)):
        arrays.append(np.asarray(value))
        return {"array": len(arrays) - 1}
    if isinstance(value, PurePath):
        return {"path": str(value)}
    if isinstance(value, SensorDesign):
        return {"design": value.model_dump(mode="json", exclude_unset=True)}
    kind = type(value)
    if isinstance(value, (OSError, OptopadError)):
        given = (value.errno, value.strerror, value.filename) if isinstance(value, OSError) else value.args
        return {"error": [kind.__module__, kind.__name__, _plain(list(given), arrays)]}
    if is_dataclass(value) and kind.__module__.startswith(PACKAGE):
        named = {
            field.name: _plain(getattr(value, field.name), arrays) for field in fields(value) if field.init
        }
        return {"class": [kind.__module__, kind.__qualname__, named]}
    raise TypeError(f"a {kind.__name__} cannot be sent to another process")


def _object(plain: Any, arrays: list[FloatArray]) -> Any:
    if isinstance(plain, list):
        return [_object(one, arrays) for one in plain]
    if not isinstance(plain, dict):
        return plain
    ((kind, held),) = plain.items()
    if kind == "tuple":
        return tuple(_object(one, arrays) for one in held)
    if kind == "dict":
        return {_object(key, arrays): _object(one, arrays) for key, one in held}
    if kind == "array":
        return arrays[held] if arrays[held].ndim else arrays[held][()]
    if kind == "path":
        return Path(held)
    if kind == "design":
        return SensorDesign.model_validate(held)
    module, name, given = held
    found = (
        getattr(importlib.import_module(module), name)
        if module.startswith(PACKAGE)
        else getattr(builtins, name)
    )
    if kind == "error" and isinstance(found, type) and issubclass(found, (OSError, OptopadError)):
        return found(*_object(given, arrays))
    if kind == "class" and isinstance(found, type) and is_dataclass(found):
        return found(**{field: _object(one, arrays) for field, one in given.items()})
    raise TypeError(f"{module}.{name} is neither a data class nor an error of this package")
