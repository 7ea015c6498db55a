"""Tables of stored results, read by heading."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
NUMBER = re.compile(r"[-+]?\d[\d,]*(?:\.\d+)?")

Row = dict[str, str]


@dataclass(frozen=True)
class Figure:
    """One figure: its value as text, and the stored result that it is read from."""

    name: str
    value: str
    source: str


def tables(path: str) -> list[list[Row]]:
    """Every table of a Markdown file, or the one of a CSV file, as rows by heading."""
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.endswith(".csv"):
        return [list(csv.DictReader(text.splitlines()))]
    found: list[list[Row]] = []
    for block in re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE):
        lines = [[cell.strip() for cell in line.strip()[1:-1].split("|")] for line in block.splitlines()]
        head = lines[0]
        found.append([dict(zip(head, [*line, *[""] * len(head)], strict=False)) for line in lines[2:]])
    return found


def table(path: str, *heads: str) -> list[Row]:
    """The rows of all tables of a file that have these headings."""
    return [row for rows in tables(path) for row in rows if set(heads) <= set(row)]


def number(text: str) -> float:
    """The first number of a cell."""
    found = NUMBER.search(text)
    if found is None:
        raise ValueError(f"no number in {text!r}")
    return float(found.group().replace(",", ""))


def column(rows: list[Row], head: str, keep: Callable[[Row], bool] = lambda _: True) -> list[float]:
    """The numbers of a column, of the rows that are kept."""
    return [number(row[head]) for row in rows if keep(row)]


def made(source: str, name: str, value: float | str, form: str = "") -> Figure:
    """A figure with its value in a form of `format`."""
    return Figure(name, format(value, form), source)
