"""What a line that is no TOML was likely meant to be: the parser says where it stopped, not what to write."""

from __future__ import annotations

import re

from design.errors import shown

_TWICE = "Cannot overwrite a value"
_NUMBER = r"[+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_KEY = r"""\s*[\w.\-"']+\s*"""
_MEANT = (
    (r"[^#]*[\u201c\u201d\u201e\u201f\u2018\u2019\u201a\u00ab\u00bb]", 'write straight quotes: "..."'),
    (
        r".*[\u00a0\u2000-\u200b\u202f\u205f\u2060\u3000\ufeff]",
        "it has a blank that is not ordinary; type it anew",
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
"""What a line looks like, and the way out; the first that fits."""
_PATTERNS = tuple((re.compile(pattern), way_out) for pattern, way_out in _MEANT)


def explained(message: str, text: str) -> str:
    """A parser's message with the line that it is about, and a way out where one is known.

    Parameters
    ----------
    message : of `tomllib`, which ends in "(at line 3, column 5)" or in "(at end of document)"
    text : the whole document
    """
    place = re.search(r"at line (\d+)", message)
    line = text.split("\n")[int(place[1]) - 1].strip() if place else text.strip().rpartition("\n")[2].strip()
    way_out = _way_out(message, line)
    if place is None and not way_out:
        return message
    return f"{message}: {shown(line)}" + (f"; {way_out}" if way_out else "")


def _way_out(message: str, line: str) -> str:
    if message.startswith(_TWICE):
        return f"{line.partition('=')[0].strip()} stands twice in its table; keep one"
    return next((way_out for pattern, way_out in _PATTERNS if pattern.match(line)), "")
