"""Writes tables as CSV with cells that a spreadsheet never evaluates as formulas.

A spreadsheet evaluates a text that starts with one of = + - @, even after a control character. An apostrophe is
therefore put in front of it. Numbers are not changed.

The module also makes a user's text safe in Markdown.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence

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
