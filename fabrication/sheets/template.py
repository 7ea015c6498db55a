"""Fills the templates of sheets and pages, which are the files `templates/*.j2` of a package (Jinja2).

A template lays out text; what it shows is computed in Python. Each value that is not markup already is escaped as HTML,
but not in Markdown, where the filter `plain` escapes a user's text. A name without a value is an error.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from optopad.design.parts.assumptions import ohm_text
from optopad.fabrication.sheets.table import number, one_line, plain, size_words


def numbered(lines: str) -> str:
    """Lines as an ordered list of Markdown."""
    return "".join(f"{place}. {line}\n" for place, line in enumerate(lines.splitlines(), start=1))


def data(content: Any) -> Markup:
    """Data as JSON for a script element of a page, which they cannot end; NaN and infinity are refused."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return Markup(text.replace("<", "\\u003c"))


FILTERS: dict[str, Callable[..., str]] = {
    "data": data,
    "fmt": format,
    "number": number,
    "numbered": numbered,
    "ohm": ohm_text,
    "one_line": one_line,
    "plain": plain,
    "size_words": size_words,
}


@cache
def templates(package: str) -> Environment:
    """The templates of a package, by file name."""
    found = Environment(
        loader=PackageLoader(package),
        autoescape=lambda name: name is None or not name.endswith(".md.j2"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    found.filters |= FILTERS
    found.tests["guessed"] = lambda value: value.confidence in ("inferred", "unverified")
    return found


def filled(package: str, template: str, values: dict[str, Any]) -> str:
    """The text of a template of a package with these values."""
    return templates(package).get_template(template).render(values)
