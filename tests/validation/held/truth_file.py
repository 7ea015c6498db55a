"""The stored presses of objects, `truth.csv`: one quantity a row."""

from __future__ import annotations

import csv
from dataclasses import astuple, dataclass, fields
from pathlib import Path

STORED = Path(__file__).with_name("truth.csv")
BESIDE_MM = (0.5, 1.0, 2.0, 4.0)
"""Distances from the contact's edge at which heights are kept."""
FAR_MM = (10.0, 13.0)
"""Distances from the axis at which heights are kept."""


@dataclass(frozen=True)
class Row:
    """A quantity of a press of a case.

    Attributes
    ----------
    quantity : its name, with the unit
    mesh_error : the coarser mesh's value less this one
    """

    depth_mm: float
    quantity: str
    value: float
    mesh_error: float

    @classmethod
    def of(cls, depth_mm: float, quantity: str, value: float, coarser: float) -> Row:
        """The row of a value on two meshes, to the digits that mean something."""
        return cls(depth_mm, quantity, round(value, 5), round(coarser - value, 5))


def read_truth(path: Path = STORED) -> dict[str, list[Row]]:
    """Case -> its rows."""
    cases: dict[str, list[Row]] = {}
    with path.open(encoding="utf-8", newline="") as lines:
        for case, depth, quantity, *numbers in list(csv.reader(lines))[1:]:
            cases.setdefault(case, []).append(Row(float(depth), quantity, *map(float, numbers)))
    return cases


def write_truth(cases: dict[str, list[Row]], path: Path = STORED) -> None:
    """Write all rows."""
    with path.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(["case", *(field.name for field in fields(Row))])
        writer.writerows((case, *astuple(row)) for case, rows in cases.items() for row in rows)
