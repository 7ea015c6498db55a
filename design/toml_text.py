"""Parser of TOML text with limits on its size, so that parsing never takes too long.

The parsing time grows with the square of the number of parts in a dotted key, plus a few microseconds per value. Files
of optopad are nested a few levels deep and have a few thousand values at most. Integers of hundreds of digits are also
refused, because they convert neither to floats nor back to text. The module needs the standard library only.

The parser's message about invalid TOML says only where it stopped. This module adds a remedy for common mistakes.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from typing import Any

from optopad.design.errors import shown

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

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
"""Patterns of common invalid lines, each with its remedy; the first match is used."""
LONGEST_LINE = 1_000
"""Longest start of a line that is searched for common mistakes [characters]; patterns take the square of its length."""
_PATTERNS = tuple((re.compile(pattern), way_out) for pattern, way_out in _MEANT)


def explained(message: str, text: str) -> str:
    """Extend a parser's message with the line that it refers to, and with a remedy if one is known.

    Parameters
    ----------
    message : message of `tomllib`, which ends in "(at line 3, column 5)" or in "(at end of document)"
    text : the complete document
    """
    place = re.search(r"at line (\d+)", message)
    line = text.split("\n")[int(place[1]) - 1].strip() if place else text.strip().rpartition("\n")[2].strip()
    way_out = _way_out(message, line[:LONGEST_LINE])
    if place is None and not way_out:
        return message
    return f"{message}: {shown(line)}" + (f"; {way_out}" if way_out else "")


def _way_out(message: str, line: str) -> str:
    if message.startswith(_TWICE):
        return f"{line.partition('=')[0].strip()} is given twice in its table; keep one"
    return next((way_out for pattern, way_out in _PATTERNS if pattern.match(line)), "")


MOST_PARTS = 20
"""Greatest nesting depth of keys, lists and tables; designs have 6 levels at most."""
MOST_VALUES = 30_000
"""Largest total number of keys, list entries and tables, estimated from punctuation marks.

Parsing this many takes 0.5 s. The packaged catalogue has 3,000.
"""
MOST_BITS = 333
"""Largest integer [bits], about 100 digits: float and text can still hold it, so a field can report its limit."""
LONGEST_DECIMAL_BITS = 2_000
"""Largest decimal integer [bits]: it has fewer than 640 digits, the lowest limit that Python can be set to."""

_QUOTED = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*(?:""")?|'
    r"'''(?:[^']|'(?!''))*(?:''')?|"
    r'"(?:[^"\\\n]|\\[^\n])*"?|'
    r"'[^'\n]*'?|#[^\n]*",
    re.DOTALL,
)
"""Quoted strings and comments. An unterminated string extends to the end of the document, so the search is linear."""
_DEEP = re.compile(rf"(?<![\w-])[\w-]+(?:[ \t]*\.[ \t]*[\w-]+){{{MOST_PARTS},}}")
_SIGNS = re.compile(r"[=,\[{]")
_STAND_IN = "q"


def parsed_toml(text: str) -> dict[str, Any]:
    """Parse TOML text.

    Raises
    ------
    tomllib.TOMLDecodeError : the text is not TOML.
    ValueError : the text is nested too deeply, or has too many values or integers that are too large; the message says
        which.
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
        if "digits" not in str(err):  # date or time that does not exist
            raise
        raise ValueError("not valid TOML: a whole number of thousands of digits") from None
    require_plain(found)
    return found


def require_plain(document: Any) -> None:
    """Refuse values that are not permitted in any file of optopad.

    Raises
    ------
    ValueError : the data are nested too deeply, or an integer has more than 100 digits; the message names the field.
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
    """All nodes of nested dicts and lists, each with its path; a node beyond the depth limit is not entered."""
    rest: list[tuple[tuple[str | int, ...], Any]] = [((), document)]
    while rest:
        path, value = rest.pop()
        yield path, value
        if len(path) <= MOST_PARTS and isinstance(value, dict | list):
            items = value.items() if isinstance(value, dict) else enumerate(value)
            rest += [((*path, key), inner) for key, inner in items]
