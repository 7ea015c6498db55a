"""The text of sheets and pages. Their templates are the files `templates/*.j2` of a package (Jinja2).

A template lays out text; what it shows is computed in Python. Each value that is not markup already is escaped as HTML,
but not in Markdown, where the filter `plain` escapes a user's text. A name without a value is an error.

Tables are written as CSV with cells that a spreadsheet never evaluates as formulas. A spreadsheet evaluates a text that
starts with one of = + - @, even after a control character. An apostrophe is therefore put in front of it. Numbers are
not changed.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from optopad.design.parts.assumptions import ohm_text
from optopad.design.shape.outline import Outline

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r", "\n")

Cell = str | int | float | None


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """A table as CSV, with column names in the first line. Lines end with a line feed; None becomes an empty cell."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_shown(cell) for cell in row] for row in rows)
    return stream.getvalue()


def safe_text(text: str) -> str:
    """A text on one line, without control characters, in a form that no spreadsheet evaluates as a formula."""
    line = one_line(text)
    return f"'{line}" if line.startswith(FORMULA_STARTS) else line


def one_line(text: str) -> str:
    """A text without line breaks and control characters; consecutive spaces become one."""
    printable = "".join(char if char.isprintable() else " " for char in text)
    return " ".join(printable.split())


def number(value: float) -> str:
    """A number as text, rounded to four decimals, without trailing zeros."""
    return f"{value:.4f}".rstrip("0").rstrip(".")


def size_words(outline: Outline, unit: str = "") -> str:
    """Dimensions of an outline [mm] as text, for example "40 x 25" for a rectangle or "55 across" for a disc."""
    sizes = outline.dimensions
    across = " across" if sizes[0].is_diameter else ""
    return f"{' x '.join(number(one.size_mm) for one in sizes)}{unit}{across}"


def _shown(cell: Cell) -> str:
    if cell is None:
        return ""
    if isinstance(cell, str):
        return safe_text(cell)
    return number(cell)


def plain(text: str) -> str:
    """A user's text on one line, with the special characters of Markdown and HTML escaped."""
    return re.sub(r"([\\`*_{}\[\]<>#|~])", r"\\\1", one_line(text)).replace("\\<", "&lt;")


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
