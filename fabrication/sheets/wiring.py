"""The wiring table: every part, where it sits, and what its leads go to."""

from __future__ import annotations

from collections.abc import Sequence

from design.spec import SensorDesign
from fabrication.connections import Connection, connections_of
from fabrication.sheets.formats.table import Cell, csv_text

COLUMNS = (
    "reference",
    "kind",
    "part",
    "wall",
    "along_mm",
    "height_mm",
    "pin",
    "state",
    "column",
    "polarity",
)


def wiring_csv(design: SensorDesign) -> str:
    """The wiring table as CSV: emitters in the order of states, then receivers in the order of columns.

    Raises
    ------
    DesignError : parts or pins that the catalogue or the board does not have.
    """
    return csv_text(COLUMNS, (_cells(one) for one in connections_of(design).all))


def _cells(one: Connection) -> Sequence[Cell]:
    is_emitter = one.part.kind == "emitter"
    return (
        one.part.name,
        one.part.kind,
        one.part.part_id,
        one.part.wall,
        one.part.along_mm,
        one.part.height_mm,
        one.pin,
        one.number if is_emitter else None,
        None if is_emitter else one.number,
        one.polarity,
    )
