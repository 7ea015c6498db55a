"""A tip's radial profile from a CSV file: radius and height above the apex of each point, in mm.

    r_mm, height_mm        a heading, empty lines and lines that begin with # are skipped
    0.0, 0.0               the apex
    1.5, 0.4
    3.0, 3.0               the shank, at indenter.tip_radius_mm

Numbers are separated by a comma, a semicolon or blanks, with a point for decimals. A file that is no
function of radius is refused with its row.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

from design.csv_table import DECIMAL_COMMA, is_number
from design.errors import DesignError
from design.spec.tip_shape import profile_fault
from design.text_file import read_text

MAX_FILE_BYTES = 1_000_000
NEEDED = "a CSV table with the radius and height of a tip in mm, a row a point"


def read_profile(file: Path) -> list[list[float]]:
    """Radius and height of the points of a profile [mm].

    Raises
    ------
    DesignError : the file cannot be read, a row is no pair of numbers, or the points are no tip.
    """
    rows: list[int] = []
    points: list[tuple[float, float]] = []
    text = read_text(file, needed=NEEDED, most_bytes=MAX_FILE_BYTES, error=DesignError)
    for number, line in enumerate(text.split("\n"), start=1):
        words = [word for word in re.split(r"[\s,;]+", line.strip()) if word]
        if not words or words[0].startswith("#") or (not points and not is_number(words[0])):
            continue
        points.append(_point(words, f"{file}: row {number}"))
        rows.append(number)
    if len(points) < 2:
        raise DesignError(f"{file}: holds {len(points)} points; a profile needs at least 2, apex and shank")
    fault = profile_fault(points, None, lambda index: f"{file}: row {rows[index]}")
    if fault is not None:
        raise DesignError(fault)
    return [list(point) for point in points]


def _point(words: list[str], where: str) -> tuple[float, float]:
    if len(words) != 2 or not all(is_number(word) for word in words):
        hint = f"; {DECIMAL_COMMA}" if len(words) > 2 and all(map(is_number, words)) else ""
        raise DesignError(
            f"{where}: {' '.join(words)[:60]!r} is refused: a row holds radius and height in mm, as 1.5, 0.4{hint}"
        )
    radius, height = float(words[0]), float(words[1])
    if not (math.isfinite(radius) and math.isfinite(height)):
        raise DesignError(f"{where}: {' '.join(words)[:60]!r} is refused: numbers must be finite")
    return radius, height
