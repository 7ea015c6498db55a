"""A tip's radial profile from a CSV file: radius and height above the apex of each point, in mm.

    r_mm, height_mm        a heading, empty lines and lines that begin with # are skipped
    0.0, 0.0               the apex
    1.5, 0.4
    3.0, 3.0               the shank, at indenter.tip_radius_mm

Numbers are separated by a comma, a semicolon or blanks, with a point for decimals. A file that is no
function of radius is refused with its row.
"""

from __future__ import annotations

from pathlib import Path

from design.csv_table import numbered_points
from design.errors import DesignError
from design.spec.tip_shape import profile_fault

NEEDED = "a CSV table with the radius and height of a tip in mm, a row a point"


def read_profile(file: Path) -> list[list[float]]:
    """Radius and height of the points of a profile [mm].

    Raises
    ------
    DesignError : the file cannot be read, a row is no pair of numbers, or the points are no tip.
    """
    found = numbered_points(file, needed=NEEDED, error=DesignError)
    rows, points = [number for number, _ in found], [point for _, point in found]
    fault = profile_fault(points, None, lambda index: f"{file}: row {rows[index]}")
    if fault is not None:
        raise DesignError(fault)
    return [list(point) for point in points]
