"""Reader of all CSV tables that optopad accepts.

Lines that begin with # are remarks, and so are lines without a comma before a heading with several columns: loggers
greet first. The first line that is not a remark is the heading. Values are separated by commas, and numbers have a
decimal point. Empty lines are skipped, and so are empty cells at the end of a line. A row with more or fewer cells than
the heading is refused, because a decimal comma would shift all later cells. The module needs the standard library only.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from optopad.design.errors import DesignError, InputError, shown
from optopad.design.files import read_text

DECIMAL_COMMA = "decimal comma? write 8.9, and separate by commas"
MOST_CURVE_BYTES = 1_000_000
MOST_BYTES = 500_000_000
_COMMA_NUMBER = re.compile(r"[+-]?\d+,\d+")
_WITH_UNIT = re.compile(r"[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*[^\W\d_]+")
_WORD = re.compile(r"[^\W_]+")
UNIT_WORDS = {
    "s": "s sec secs second seconds", "ms": "msec millis millisecond milliseconds",
    "us": "usec micros microsecond microseconds", "ns": "nanos nanosecond nanoseconds",
    "mm": "millimetre millimetres millimeter millimeters", "um": "micron microns micrometre micrometres micrometer",
    "n": "newton newtons", "mn": "millinewton millinewtons", "g": "gram grams", "kg": "kilogram kilograms",
    "lb": "lbs pound pounds", "oz": "ounce ounces",
}  # fmt: skip
"""Other words for a unit at the end of a column's name, by its symbol in lower case."""
_SYMBOLS = {word: symbol for symbol, words in UNIT_WORDS.items() for word in words.split()}
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True, kw_only=True)
class CsvTable:
    """A CSV table whose cells are still text.

    Attributes
    ----------
    file : path of the file
    heading : names of the columns, without blanks around them
    rows : cells of each row below the heading, one per column
    lines : line number of each row in the file, counted from 1
    remarks : lines that begin with #
    """

    file: Path
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    remarks: tuple[str, ...]

    def column(self, name: str) -> list[str]:
        """The cells of a column, from top to bottom."""
        at = self.heading.index(name)
        return [row[at] for row in self.rows]

    def records(self) -> list[dict[str, str]]:
        """The cells of each row as a dictionary by column name."""
        return [dict(zip(self.heading, row, strict=True)) for row in self.rows]

    def without_doubles(self) -> tuple[CsvTable, tuple[int, ...]]:
        """The table without rows that are equal to the row before them, and the line numbers of those rows."""
        doubled = [k for k in range(1, len(self.rows)) if self.rows[k] == self.rows[k - 1]]
        return self.without(doubled), tuple(self.lines[k] for k in doubled)

    def without(self, rows: Collection[int]) -> CsvTable:
        """The table without some rows, which are counted from 0 below the heading."""
        kept = sorted(set(range(len(self.rows))).difference(rows))
        return replace(self, rows=tuple(self.rows[k] for k in kept), lines=tuple(self.lines[k] for k in kept))

    def where(self, row: int) -> str:
        """Start of an error message about a row: the file and the row's line number in the file."""
        return f"{self.file}: row {self.lines[row]}"

    def numbers(self, name: str) -> list[float]:
        """The cells of a column as finite numbers.

        Raises
        ------
        InputError : a cell is not a finite number; the message names row, column and value.
        """
        return self.parsed(name, float, "a finite number")

    def parsed(self, name: str, parse: Callable[[str], float], needed: str) -> list[float]:
        """The cells of a column as finite numbers, converted by `parse`.

        Parameters
        ----------
        parse : function that converts the text of a cell, or raises ValueError
        needed : description of permitted values, for messages

        Raises
        ------
        InputError : a cell is not a finite number; the message names row, column and value.
        """
        found = []
        for row, text in enumerate(self.column(name)):
            try:
                value = parse(text)
                if not math.isfinite(value):
                    raise ValueError
            except (ValueError, OverflowError):
                way_out = _way_out(text) or "correct or drop the row"
                raise InputError(
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
) -> CsvTable:
    """Read a CSV table with a heading.

    Parameters
    ----------
    needed : required content of the table, for messages
    fewest_rows : minimum number of rows below the heading
    lower : whether column names are converted to lower-case words with underscores: "Force (N)" becomes force_n
    most_bytes : file size above which the file is refused without being read

    Raises
    ------
    InputError : the file is not text, or has a separator other than commas, too few rows, a row whose length differs
        from the heading's, or a duplicate column.
    """
    text = read_text(file, needed=needed, most_bytes=most_bytes)
    remarks: list[str] = []
    numbered: list[tuple[int, list[str]]] = []
    lines = text.split("\n")
    for number, line in enumerate(lines, start=1):
        if number == 1 and re.fullmatch(r"sep=.?", line.strip(), re.IGNORECASE):
            if line.strip()[4:] not in (",", ""):
                raise InputError(f"{file}: row 1 is {shown(line.strip())}; {DECIMAL_COMMA}")
            continue
        if line.lstrip('" \t').startswith("#"):
            remarks.append(line.strip('",; \t'))
            continue
        if any(cells := _cells(line)):
            numbered.append((number, cells))
    while _is_greeting(numbered):
        remarks.append(numbered.pop(0)[1][0])
    heading = _without_last_empty(numbered[0][1]) if numbered else []
    for sign, name in _OTHER_SEPARATORS.items():
        if any(sign in cell for cell in heading):
            raise InputError(f"{file}: its values are separated by {name}; {DECIMAL_COMMA}")
    if heading and all(map(is_number, heading)):
        raise InputError(
            f"{file}: row {numbered[0][0]} has numbers and no heading; write the names of its columns first"
        )
    heading = [plain_name(name) for name in heading] if lower else heading
    if len(numbered) <= fewest_rows:
        counted = "a row" if fewest_rows == 1 else f"{fewest_rows} rows"
        raise InputError(
            f"{file}: {max(len(numbered) - 1, 0)} rows below the heading, needs at least {counted}; needs {needed}"
        )
    if doubled := sorted({name for name in heading if heading.count(name) > 1}):
        raise InputError(f"{file}: has the column {', '.join(map(repr, doubled))} twice; keep one")
    rows = [
        (number, _fitted(cells, heading, f"{file}: row {number}", is_torn=number == len(lines)))
        for number, cells in numbered[1:]
    ]
    return CsvTable(
        file=file,
        heading=tuple(heading),
        rows=tuple(cells for _, cells in rows),
        lines=tuple(number for number, _ in rows),
        remarks=tuple(remarks),
    )


def numbered_points(file: Path, *, needed: str) -> list[tuple[int, tuple[float, float]]]:
    """Read the points of a curve from a file with two numbers per row; a heading is optional.

    The two numbers have a decimal point and are separated by a comma, a semicolon or blanks.

    Returns
    -------
    For each point, its line number in the file and its two numbers.

    Raises
    ------
    DesignError : the file has fewer than two points, or a row without two finite numbers.
    """
    found: list[tuple[int, tuple[float, float]]] = []
    text = read_text(file, needed=needed, most_bytes=MOST_CURVE_BYTES, error=DesignError)
    for number, line in enumerate(text.split("\n"), start=1):
        words = [word for word in re.split(r"[\s,;]+", line.strip()) if word]
        if not words or words[0].startswith("#") or (not found and not is_number(words[0])):
            continue
        if len(words) != 2 or not all(map(is_number, words)):
            hint = DECIMAL_COMMA if len(words) > 2 and all(map(is_number, words)) else "write it as 1.5, 0.4"
            raise DesignError(f"{file}: row {number}: {shown(line.strip())} is no pair of numbers; {hint}")
        pair = float(words[0]), float(words[1])
        if not all(map(math.isfinite, pair)):
            raise DesignError(f"{file}: row {number}: {shown(line.strip())}: numbers must be finite")
        found.append((number, pair))
    if len(found) < 2:
        raise DesignError(f"{file}: has {len(found)} points, needs at least 2; needs {needed}")
    return found


def plain_name(name: str) -> str:
    """A column's name as lower-case words with underscores, its last word a unit's symbol if it is a unit.

    Examples: ``Force (N)`` is ``force_n``, ``time [seconds]`` is ``time_s``, and ``X (micron)`` is ``x_um``.
    """
    lowered = name.lower().replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
    words = _WORD.findall(lowered)
    return "_".join([*words[:-1], *(_SYMBOLS.get(word, word) for word in words[-1:])])


def is_number(text: str) -> bool:
    """Whether a text is a number; infinite and NaN count as numbers."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _cells(line: str) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(",")]
    return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [])]


def _is_greeting(numbered: Sequence[tuple[int, list[str]]]) -> bool:
    """Whether the first line has one cell, but the next or the last line has more."""
    first, *others = [_without_last_empty(cells) for _, cells in (*numbered[:2], *numbered[-1:])] or [[]]
    return len(first) == 1 and any(len(cells) > 1 for cells in others)


def _without_last_empty(cells: list[str]) -> list[str]:
    return cells[: max((k for k, cell in enumerate(cells, start=1) if cell), default=0)]


def _fitted(cells: list[str], heading: Sequence[str], where: str, *, is_torn: bool) -> tuple[str, ...]:
    """The cells of a row without empty ones after the last column; an error if their number is wrong."""
    found = cells if len(cells) <= len(heading) else _without_last_empty(cells)
    found += [""] * (len(heading) - len(found)) if len(cells) >= len(heading) else []
    if len(found) == len(heading):
        return tuple(found)
    way_out = (
        "give an empty cell its comma, too" if len(found) < len(heading) else "quote a cell that has commas"
    )
    if is_torn and len(found) < len(heading):
        way_out = "the file ends within this row: drop it"
    if len(found) > len(heading) and all(is_number(cell) for cell in found if cell):
        way_out = DECIMAL_COMMA
    raise InputError(f"{where} has {len(found)} values, the heading {len(heading)} columns; {way_out}")


def _way_out(text: str) -> str | None:
    if _COMMA_NUMBER.fullmatch(text):
        return DECIMAL_COMMA
    return "write the number without its unit" if _WITH_UNIT.fullmatch(text) else None
