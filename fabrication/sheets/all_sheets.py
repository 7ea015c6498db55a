"""Writes all sheets for the manufacture of a design into its bundle.

The module also makes the wiring table, which lists each part, its position and the connections of its leads.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from optopad.design.circuit.circuit import Circuit
from optopad.design.io import write_text_atomically
from optopad.design.spec import SensorDesign
from optopad.fabrication.connections import Connection, connections_of
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.gain import SimulatedGain
from optopad.fabrication.sheets.bom import BomRow, bom_csv, bom_rows
from optopad.fabrication.sheets.casting import casting_md
from optopad.fabrication.sheets.orientation_svg import orientation_svg
from optopad.fabrication.sheets.schematic_svg import schematic_svg
from optopad.fabrication.sheets.template import Cell, csv_text
from optopad.fabrication.sheets.wiring_svg import wiring_svg

COLUMNS = (
    "reference",
    "kind",
    "part",
    "wall",
    "along_mm",
    "x_mm",
    "y_mm",
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
    DesignError : the catalogue does not have a part, or the board does not have a pin.
    """
    return csv_text(COLUMNS, (_cells(one) for one in connections_of(Circuit.of(design)).all))


def _cells(one: Connection) -> Sequence[Cell]:
    is_emitter = one.part.kind == "emitter"
    return (
        one.part.name,
        one.part.kind,
        one.part.part_id,
        one.part.wall,
        None if one.part.is_on_floor else one.part.along_mm,
        *one.part.position_mm[:2],
        one.part.height_mm,
        one.pin,
        one.number if is_emitter else None,
        None if is_emitter else one.number,
        one.polarity,
    )


def sheet_texts(
    design: SensorDesign, gain: SimulatedGain | None = None, rows: Sequence[BomRow] | None = None
) -> dict[str, str]:
    """Text of every sheet for the manufacture of a design, by file name.

    Parameters
    ----------
    gain : simulated gain from light to counts; if None, values that depend on it are omitted
    rows : bill of materials with prices; if None, it is the design's own

    Raises
    ------
    DesignError : the catalogue does not have a part or material, or the board does not have a pin.
    """
    rows = bom_rows(design, gain) if rows is None else rows
    return {
        "driver.toml": dump_driver_config(
            design,
            None if gain is None else gain.counts_per_flux,
            None if gain is None else gain.untouched_readings(design),
        ),
        "wiring.csv": wiring_csv(design),
        "wiring.svg": wiring_svg(design),
        "schematic.svg": schematic_svg(design, gain),
        "orientation.svg": orientation_svg(design),
        "bom.csv": bom_csv(rows),
        "casting.md": casting_md(design, gain, rows),
    }


def write_sheets(
    design: SensorDesign,
    folder: Path,
    gain: SimulatedGain | None = None,
    rows: Sequence[BomRow] | None = None,
) -> dict[str, Path]:
    """Write every sheet into an existing folder; return the paths by file name.

    Raises
    ------
    DesignError : the catalogue lacks a part or material, or the board lacks a pin; nothing is written.
    OutputError : the folder cannot be written.
    """
    texts = sheet_texts(design, gain, rows)
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    return {name: folder / name for name in texts}
