"""Converts plain data to frozen dataclasses and back; missing or unknown fields and wrong types are refused.

Supported types are str, bool, int, finite float (an int is converted), tuple (from a list), nested dataclasses, and
`X | None` for optional fields. The module needs only the standard library.
"""

from __future__ import annotations

import math
import types
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

Record = TypeVar("Record")


LARGEST_WHOLE = 2**63 - 1
"""Largest magnitude of an integer in a field; arrays and packed frames cannot hold larger numbers."""


class RecordError(ValueError):
    """A field is missing, unknown or of the wrong type; the message names the field."""


def record_of(kind: type[Record], data: Any, path: str = "") -> Record:
    """Convert nested plain data to a frozen dataclass.

    Raises
    ------
    RecordError : a field is missing, unknown or of the wrong type; the message gives its dotted path.
    """
    if not isinstance(data, dict):
        raise RecordError(f"{path or 'the file'}: is no table")
    hints = get_type_hints(kind)
    unknown = [key for key in data if key not in hints]
    if unknown:
        raise RecordError(f"{_join(path, unknown[0])}: is not a field")
    values = {}
    for field in fields(cast(Any, kind)):
        if field.name in data:
            values[field.name] = _value(hints[field.name], data[field.name], _join(path, field.name))
        elif field.default is MISSING:
            raise RecordError(f"{_join(path, field.name)}: is missing")
    return kind(**values)


def plain_of(value: Any) -> Any:
    """Convert a frozen dataclass to the plain data that `record_of` reads; fields whose value is None are omitted."""
    if is_dataclass(value):
        named = {field.name: getattr(value, field.name) for field in fields(value)}
        return {name: plain_of(entry) for name, entry in named.items() if entry is not None}
    return [plain_of(entry) for entry in value] if isinstance(value, tuple) else value


def _value(hint: Any, value: Any, path: str) -> Any:
    if isinstance(hint, types.UnionType):
        return _value(next(kind for kind in get_args(hint) if kind is not types.NoneType), value, path)
    if get_origin(hint) is tuple:
        return _tuple(get_args(hint), value, path)
    if is_dataclass(hint):
        return record_of(cast(type[Any], hint), value, path)
    return _plain(hint, value, path)


def _tuple(kinds: tuple[Any, ...], value: Any, path: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise RecordError(f"{path}: {value!r} is no list")
    each = [kinds[0]] * len(value) if kinds[-1] is Ellipsis else list(kinds)
    if len(each) != len(value):
        raise RecordError(f"{path}: has {len(value)} entries, needs {len(each)}")
    return tuple(
        _value(kind, item, f"{path}[{k}]") for k, (kind, item) in enumerate(zip(each, value, strict=True))
    )


def _plain(kind: type[Any], value: Any, path: str) -> Any:
    if isinstance(value, int) and abs(value) > LARGEST_WHOLE:
        raise RecordError(f"{path}: is beyond 64 bits")
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise RecordError(f"{path}: {value!r} is no {kind.__name__}")
    if kind is float and not math.isfinite(value):
        raise RecordError(f"{path}: {value!r} is no finite number")
    return value


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name
