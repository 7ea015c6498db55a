"""The printer that the checks assume: room of its bed, strokes and bridges that it makes."""

from __future__ import annotations

import re

from design.errors import InputError
from design.fields.packaged import data_quantities
from design.fields.quantity import Quantity

Bed = tuple[float, float, float]
"""Room of a printer: x, y and height [mm]."""


def printer(name: str) -> Quantity:
    """A named value of `design/data/printer.toml`."""
    return data_quantities("printer.toml")[name]


def usual_bed_mm() -> Bed:
    """Room of the printer that is assumed where none is named [mm]."""
    return printer("bed_x").value, printer("bed_y").value, printer("bed_z").value


def bed_of(text: str) -> Bed:
    """A bed as it is given on the command line: ``220,220,250`` or ``220x220x250`` [mm].

    Raises
    ------
    InputError : not three lengths above 0.
    """
    pieces = re.split(r"[,x]", text.strip().lower())
    try:
        sides = [float(piece) for piece in pieces]
    except ValueError:
        sides = []
    if len(sides) != 3 or not all(0 < side < 1e4 for side in sides):
        raise InputError(f"--bed: {text!r} is refused: must be three lengths in mm above 0, as 220,220,250")
    return sides[0], sides[1], sides[2]
