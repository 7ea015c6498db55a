"""The sections of our docstrings (Parameters, Returns, Raises, ...) as lists on the page.

A section is a heading, a line of dashes, and entries `name : what it is [unit]`, their further lines indented; a
section without such entries is text. Types stand in the code, so that an entry has room for shape and unit.
"""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ENTRY = re.compile(r"^(?P<names>[\w*]+(?:, [\w*]+)*) : (?P<about>.*)$")


def with_lists(lines: list[str]) -> list[str]:
    """The lines of a docstring with every section as a field of reStructuredText."""
    starts = [number for number in range(len(lines) - 1) if _is_heading(lines[number], lines[number + 1])]
    found = lines[: starts[0]] if starts else list(lines)
    for start, end in pairwise([*starts, len(lines)]):
        found += ["", f":{lines[start].strip()}:", *_body(lines[start + 2 : end]), ""]
    return found


def _is_heading(line: str, below: str) -> bool:
    return bool(line.strip()) and set(below.strip()) == {"-"} and len(below.strip()) >= len(line.strip()) - 1


def _body(lines: list[str]) -> list[str]:
    found = []
    for line in lines:
        entry = ENTRY.match(line)
        if entry is None:
            found.append(f"    {line}".rstrip())
        else:
            names = ", ".join(f"**{name}**".replace("**\\*", "\\*") for name in entry["names"].split(", "))
            found += ["", f"    {names}", f"        {entry['about']}"]
    return _as_text(found)


def _as_text(lines: list[str]) -> list[str]:
    """Further lines of an entry, indented in the docstring, as deep as its first."""
    return [re.sub(r"^ {8,}", " " * 8, line) for line in lines]


def _convert(_app: Sphinx, _what: str, _name: str, _obj: object, _options: object, lines: list[str]) -> None:
    lines[:] = with_lists(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Join the build."""
    app.connect("autodoc-process-docstring", _convert)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
