"""TOML text to plain data, refused before it can hold up the reader.

The parser takes a time that grows with the square of a dotted key's parts, and some microseconds a value. Files of
ours are a few parts deep and hold some thousand values at most. Whole numbers of hundreds of digits become neither
floats nor text again. Needs the standard library only.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Any

MOST_PARTS = 20
"""Depth of a key or of nested lists and tables; designs are 6 deep at most."""
MOST_VALUES = 30_000
"""Keys, list entries and tables, counted by their signs: parsed in half a second. The packaged catalogue has 3,000."""
MOST_BITS = 333
"""Of a whole number, 100 digits: well below what becomes no float or no text, so that a field tells its own limit."""
LONGEST_DECIMAL_BITS = 2_000
"""Python may be set to refuse decimal texts of more than 640 digits, and never refuses those."""

_QUOTED = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+(?:""")?|'
    r"'''(?:[^']|'(?!''))*+(?:''')?|"
    r'"(?:[^"\\\n]|\\[^\n])*+"?|'
    r"'[^'\n]*+'?|#[^\n]*+",
    re.DOTALL,
)
"""Texts and comments. One without an end is taken to the end, so that the search goes over a text once."""
_DEEP = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{MOST_PARTS},}}+")
_SIGNS = re.compile(r"[=,\[{]")
_STAND_IN = "q"


def parsed_toml(text: str) -> dict[str, Any]:
    """The data of a TOML text.

    Raises
    ------
    tomllib.TOMLDecodeError : no TOML.
    ValueError : too deep, too many values, or whole numbers that are too large; the message says which.
    """
    bare = _QUOTED.sub(_STAND_IN, text)
    if deep := _DEEP.search(bare):
        raise ValueError(
            f"nested too deep: a key of more than {MOST_PARTS} parts, {deep[0][:40]}...; write fewer"
        )
    values = len(_SIGNS.findall(bare))
    if values > MOST_VALUES:
        raise ValueError(f"{values} keys, tables and list entries, reads at most {MOST_VALUES}; cut it")
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"nested too deep: more than {MOST_PARTS} lists and tables in each other") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as err:
        if "digits" not in str(err):  # a date or time that there is not
            raise
        raise ValueError("not valid TOML: a whole number of thousands of digits") from None
    require_plain(found)
    return found


def require_plain(document: Any) -> None:
    """Refuse what no file of ours can hold.

    Raises
    ------
    ValueError : nested too deep, or a whole number of more than 100 digits; the message names the field.
    """
    for path, value in _nodes(document):
        if len(path) > MOST_PARTS:
            where = ".".join(map(str, path[:4]))
            raise ValueError(
                f"{where}: nested too deep: more than {MOST_PARTS} lists and tables in each other"
            )
        if isinstance(value, int) and value.bit_length() > MOST_BITS:
            name = ".".join(map(str, path))
            begun = str(value) if value.bit_length() <= LONGEST_DECIMAL_BITS else hex(value)
            raise ValueError(
                f"{name}: {begun[:20]}... is refused: must be a finite number of at most 100 digits"
            )


def _nodes(document: Any) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Everything in nested dicts and lists with its path; what is too deep is named, not entered."""
    rest: list[tuple[tuple[str | int, ...], Any]] = [((), document)]
    while rest:
        path, value = rest.pop()
        yield path, value
        if len(path) <= MOST_PARTS and isinstance(value, dict | list):
            items = value.items() if isinstance(value, dict) else enumerate(value)
            rest += [((*path, key), inner) for key, inner in items]
