"""Tables in CSV: the reader of every table that optopad takes.

The first line that is not a remark is the heading. Commas separate values, and decimals have a point. Lines that
begin with # are remarks; empty lines and empty cells at the end of a line do not count. A row with another number of
cells is refused, because a decimal comma shifts all later cells. The module needs the standard library only.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from design.errors import InputError, OptopadError, shown
from design.files import read_text

DECIMAL_COMMA = "decimal comma? write 8.9, and separate by commas"
MOST_BYTES = 500_000_000
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+")
_WITH_UNIT = re.compile(r"[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*[^\W\d_]+")
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True, kw_only=True)
class CsvTable:
    """A table as text.

    Attributes
    ----------
    file : its source
    heading : names of the columns, without blanks around them
    rows : the cells of each row, as many as in the heading
    lines : (row,) number of each row in the file, from 1, as editors and spreadsheets count
    remarks : the lines that begin with #
    """

    file: Path
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    remarks: tuple[str, ...]
    error: type[OptopadError] = InputError

    def column(self, name: str) -> list[str]:
        """The cells of a column."""
        at = self.heading.index(name)
        return [row[at] for row in self.rows]

    def records(self) -> list[dict[str, str]]:
        """The cells of each row by column."""
        return [dict(zip(self.heading, row, strict=True)) for row in self.rows]

    def where(self, row: int) -> str:
        """The start of a message about a row: the file and the row's number in it."""
        return f"{self.file}: row {self.lines[row]}"

    def numbers(self, name: str) -> list[float]:
        """The cells of a column as finite numbers.

        Raises
        ------
        OptopadError : a cell that is not a number; the message names row, column and value.
        """
        return self.parsed(name, float, "a finite number")

    def parsed(self, name: str, parse: Callable[[str], float], needed: str) -> list[float]:
        """As `numbers`, with another parser, which raises ValueError, and a description of the required values."""
        found = []
        for row, text in enumerate(self.column(name)):
            try:
                value = parse(text)
                if not math.isfinite(value):
                    raise ValueError
            except (ValueError, OverflowError):
                way_out = _way_out(text) or "correct or drop the row"
                raise self.error(
                    f"{self.where(row)}: {name} is {shown(text)}, needs {needed}; {way_out}"
                ) from None
            found.append(value)
        return found


def read_csv(
    file: Path,
    *,
    needed: str,
    fewest_rows: int = 1,
    lower: bool = False,
    most_bytes: int = MOST_BYTES,
    error: type[OptopadError] = InputError,
) -> CsvTable:
    """Read a table.

    Parameters
    ----------
    needed : required content of the table, in words for messages
    fewest_rows : least number of rows below the heading
    lower : whether to convert names of columns to lower case
    most_bytes : size above which the file is refused unread
    error : class of the error that is raised

    Raises
    ------
    OptopadError : no text, another separator, too few rows, a row of another length, or a duplicate column.
    """
    text = read_text(file, needed=needed, most_bytes=most_bytes, error=error)
    remarks: list[str] = []
    numbered: list[tuple[int, list[str]]] = []
    for number, line in enumerate(text.split("\n"), start=1):
        if number == 1 and re.fullmatch(r"sep=.?", line.strip(), re.IGNORECASE):
            if line.strip()[4:] not in (",", ""):
                raise error(f"{file}: row 1 is {shown(line.strip())}; {DECIMAL_COMMA}")
            continue
        if line.lstrip('" \t').startswith("#"):
            remarks.append(line.strip('",; \t'))
            continue
        if any(cells := _cells(line)):
            numbered.append((number, cells))
    heading = _without_last_empty(numbered[0][1]) if numbered else []
    heading = [name.lower() for name in heading] if lower else heading
    for sign, name in _OTHER_SEPARATORS.items():
        if any(sign in cell for cell in heading):
            raise error(f"{file}: its values are separated by {name}; {DECIMAL_COMMA}")
    if len(numbered) <= fewest_rows:
        counted = "a row" if fewest_rows == 1 else f"{fewest_rows} rows"
        raise error(
            f"{file}: {max(len(numbered) - 1, 0)} rows below the heading, needs at least {counted}; needs {needed}"
        )
    if doubled := sorted({name for name in heading if heading.count(name) > 1}):
        raise error(f"{file}: has the column {', '.join(map(repr, doubled))} twice; keep one")
    rows = [
        (number, _fitted(cells, heading, f"{file}: row {number}", error)) for number, cells in numbered[1:]
    ]
    return CsvTable(
        file=file,
        heading=tuple(heading),
        rows=tuple(cells for _, cells in rows),
        lines=tuple(number for number, _ in rows),
        remarks=tuple(remarks),
        error=error,
    )


def numbered_points(
    file: Path, *, needed: str, most_bytes: int = 1_000_000, error: type[OptopadError] = InputError
) -> list[tuple[int, tuple[float, float]]]:
    """The points of a curve, two numbers per row, each with its row's number in the file; a heading is optional.

    A comma, a semicolon or blanks separate numbers, and decimals have a point.

    As `read_csv`; fewer than two points, or a row without two finite numbers, are refused.
    """
    found: list[tuple[int, tuple[float, float]]] = []
    text = read_text(file, needed=needed, most_bytes=most_bytes, error=error)
    for number, line in enumerate(text.split("\n"), start=1):
        words = [word for word in re.split(r"[\s,;]+", line.strip()) if word]
        if not words or words[0].startswith("#") or (not found and not is_number(words[0])):
            continue
        if len(words) != 2 or not all(map(is_number, words)):
            hint = DECIMAL_COMMA if len(words) > 2 and all(map(is_number, words)) else "write it as 1.5, 0.4"
            raise error(f"{file}: row {number}: {shown(line.strip())} is no pair of numbers; {hint}")
        pair = float(words[0]), float(words[1])
        if not all(map(math.isfinite, pair)):
            raise error(f"{file}: row {number}: {shown(line.strip())}: numbers must be finite")
        found.append((number, pair))
    if len(found) < 2:
        raise error(f"{file}: has {len(found)} points, needs at least 2; needs {needed}")
    return found


def is_number(text: str) -> bool:
    """Whether a text is a number, finite or not."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cells(line: str) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(",")]
    return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [])]


def _without_last_empty(cells: list[str]) -> list[str]:
    return cells[: max((k for k, cell in enumerate(cells, start=1) if cell), default=0)]


def _fitted(
    cells: list[str], heading: Sequence[str], where: str, error: type[OptopadError]
) -> tuple[str, ...]:
    """The cells of a row, without empty ones beyond the heading."""
    found = cells if len(cells) <= len(heading) else _without_last_empty(cells)
    found += [""] * (len(heading) - len(found)) if len(cells) >= len(heading) else []
    if len(found) == len(heading):
        return tuple(found)
    way_out = "give an empty cell its comma, too" if len(found) < len(heading) else "correct the row"
    if len(found) > len(heading) and all(is_number(cell) for cell in found if cell):
        way_out = DECIMAL_COMMA
    raise error(f"{where} has {len(found)} values, the heading {len(heading)} columns; {way_out}")


def _way_out(text: str) -> str | None:
    if _COMMA_NUMBER.fullmatch(text):
        return DECIMAL_COMMA
    return "write the number without its unit" if _WITH_UNIT.fullmatch(text) else None
