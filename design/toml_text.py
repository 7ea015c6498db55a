"""TOML text to plain data; texts that would take too long to parse are refused.

The parser's time grows with the square of a dotted key's parts, and is some microseconds per value. Files of optopad
are a few parts deep and have some thousand values at most. Whole numbers of hundreds of digits convert neither to
floats nor back to text. The module needs the standard library only.

A message about invalid TOML suggests the likely intention: the parser says where it stopped, not what to write.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from typing import Any

from design.errors import shown

_TWICE = "Cannot overwrite a value"
_NUMBER = r"[+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_KEY = r"""\s*[\w.\-"']+\s*"""
_MEANT = (
    (r"[^#]*[\u201c\u201d\u201e\u201f\u2018\u2019\u201a\u00ab\u00bb]", 'write straight quotes: "..."'),
    (
        r".*[\u00a0\u2000-\u200b\u202f\u205f\u2060\u3000\ufeff]",
        "it has a special blank; type it again",
    ),
    (r'[^"]*"[^"]*\\', "write / for \\ in paths, or use single quotes: '...'"),
    (
        r".*(?<!:)//|\s*(?:;|--|/\*|%)|" + _KEY + r"=[^\"'#]*;",
        "begin a comment with #; nothing follows a value",
    ),
    (_KEY + r":[^=]*$", "write = between name and value, not :"),
    (_KEY + rf"=\s*{_NUMBER}\s*,\s*(?:#.*)?$", "remove the comma at the end"),
    (_KEY + r"=.*[\"'\]}a-z]\s*,\s*(?:#.*)?$", "remove the comma at the end"),
    (_KEY + r"=\s*[+-]?\d+,\d", "write a decimal point, as 32.0"),
    (_KEY + r"=\s*[+-]?\.\d", "write a 0 before the point, as 0.5"),
    (_KEY + r"=\s*[+-]?[\d_]+\.(?!\d)", "write a digit after the point, as 5.0"),
    (_KEY + r"=\s*[+-]?0\d", "write the number without zeros before it, as 32.0"),
    (
        _KEY + rf"=\s*{_NUMBER}\s*[^\W\d_]|" + _KEY + rf"=\s*{_NUMBER}\s*[%°\"']",
        "write the number without its unit",
    ),
    (_KEY + r"=\s*(True|False|TRUE|FALSE|Yes|No|yes|no|on|off)\b", "write true or false, in small letters"),
    (_KEY + r"=\s*(None|null|nil|NULL|~)?\s*(?:#.*)?$", "write a value after =, or remove the line"),
    (_KEY + r"=\s*(?!(true|false|inf|nan)\b)[^\W\d]", 'write text in quotes: "..."'),
    (_KEY + r"=\s*(?:\"[^\"]*|'[^']*)$", "end the text with its quote"),
    (
        r"\s*\[\[?[^\]]*\]*\s*(?:#.*)?$",
        "write a table as [cavity], an entry of a list as [[layout]]",
    ),
    (_KEY + r"\s+[^=\s]", "write = between name and value"),
)
"""Pattern of an invalid line, and the way out; the first match is used."""
_PATTERNS = tuple((re.compile(pattern), way_out) for pattern, way_out in _MEANT)


def explained(message: str, text: str) -> str:
    """A parser's message with the line that it refers to, and a way out where one is known.

    Parameters
    ----------
    message : message of `tomllib`, which ends in "(at line 3, column 5)" or in "(at end of document)"
    text : the complete document
    """
    place = re.search(r"at line (\d+)", message)
    line = text.split("\n")[int(place[1]) - 1].strip() if place else text.strip().rpartition("\n")[2].strip()
    way_out = _way_out(message, line)
    if place is None and not way_out:
        return message
    return f"{message}: {shown(line)}" + (f"; {way_out}" if way_out else "")


def _way_out(message: str, line: str) -> str:
    if message.startswith(_TWICE):
        return f"{line.partition('=')[0].strip()} is given twice in its table; keep one"
    return next((way_out for pattern, way_out in _PATTERNS if pattern.match(line)), "")


MOST_PARTS = 20
"""Greatest depth of a key or of nested lists and tables; designs are 6 deep at most."""
MOST_VALUES = 30_000
"""Most keys, list entries and tables, counted by their signs; parsing takes 0.5 s. The packaged catalogue has 3,000."""
MOST_BITS = 333
"""Most bits of a whole number, 100 digits: it still converts to float and text, so a field reports its own limit."""
LONGEST_DECIMAL_BITS = 2_000
"""Longest decimal number [bits]: Python can be set to refuse more than 640 digits, and these have fewer."""

_QUOTED = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+(?:""")?|'
    r"'''(?:[^']|'(?!''))*+(?:''')?|"
    r'"(?:[^"\\\n]|\\[^\n])*+"?|'
    r"'[^'\n]*+'?|#[^\n]*+",
    re.DOTALL,
)
"""Texts and comments. One without an end extends to the end of the document, so that the search is linear."""
_DEEP = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{MOST_PARTS},}}+")
_SIGNS = re.compile(r"[=,\[{]")
_STAND_IN = "q"


def parsed_toml(text: str) -> dict[str, Any]:
    """The data of a TOML text.

    Raises
    ------
    tomllib.TOMLDecodeError : not TOML.
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
        if "digits" not in str(err):  # an impossible date or time
            raise
        raise ValueError("not valid TOML: a whole number of thousands of digits") from None
    require_plain(found)
    return found


def require_plain(document: Any) -> None:
    """Refuse values that no file of optopad can contain.

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
    """Everything in nested dicts and lists with its path; a value nested too deep is named, not entered."""
    rest: list[tuple[tuple[str | int, ...], Any]] = [((), document)]
    while rest:
        path, value = rest.pop()
        yield path, value
        if len(path) <= MOST_PARTS and isinstance(value, dict | list):
            items = value.items() if isinstance(value, dict) else enumerate(value)
            rest += [((*path, key), inner) for key, inner in items]
