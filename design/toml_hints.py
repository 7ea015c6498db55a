"""What a line that is no TOML was likely meant to be: the parser says where it stopped, not what to write."""

from __future__ import annotations

import re

from design.errors import shown

_TWICE = "Cannot overwrite a value"
_MEANT = (
    (re.compile(r"[^=]*=\s*[+-]?\d+,\d"), "write a decimal point, as 32.0"),
    (re.compile(r"[^=]*=\s*[+-]?[\d.]+\s*[^\W\d_]"), "write the number without its unit"),
    (re.compile(r"[^=]*=\s*(True|False)\b"), "write true or false, in small letters"),
    (re.compile(r"[^=]*=\s*(?!(true|false|inf|nan)\b)[A-Za-z]"), 'write text in quotes: "..."'),
)
"""What follows the line's first sign of equality, and the way out."""


def explained(message: str, text: str) -> str:
    """A parser's message with the line that it is about, and a way out where one is known.

    Parameters
    ----------
    message : of `tomllib`, which ends in "(at line 3, column 5)" or in "(at end of document)"
    text : the whole document
    """
    place = re.search(r"at line (\d+)", message)
    if place is None:
        return message
    line = text.split("\n")[int(place[1]) - 1].strip()
    way_out = _way_out(message, line)
    return f"{message}: {shown(line)}" + (f"; {way_out}" if way_out else "")


def _way_out(message: str, line: str) -> str:
    if message.startswith(_TWICE):
        return f"{line.partition('=')[0].strip()} stands twice in its table; keep one"
    return next((way_out for pattern, way_out in _MEANT if pattern.match(line)), "")
