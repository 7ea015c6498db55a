"""Printed texts as strokes, with the letters of the mold's label (`optopad.design.mold.lettering`)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from optopad.design.fields.packaged import data_table
from optopad.design.mold.lettering import OVERLAP, Stroke, strokes_of
from optopad.fabrication.board.model import Label

COLUMNS, ROWS = 5, 7


@cache
def _letters() -> dict[str, set[tuple[int, int]]]:
    """Points (column, row) of each letter, counted from the upper left."""
    return {
        letter: {
            (k, bit)
            for k, column in enumerate(code.split())
            for bit in range(ROWS)
            if int(column, 16) >> bit & 1
        }
        for letter, code in data_table("letters.toml").items()
    }


def pitch_mm(height_mm: float) -> float:
    """Pitch of points of capitals of a height [mm]."""
    return height_mm / (ROWS - 1 + OVERLAP)


def text_width_mm(text: str, height_mm: float) -> float:
    """Width of a printed text [mm]."""
    return (len(text) * (COLUMNS + 1) - 1) * pitch_mm(height_mm)


def strokes(label: Label) -> Iterator[Stroke]:
    """Rectangles that print a text, centred at the label's position; letters that are unknown are left out."""
    pitch = pitch_mm(label.height_mm)
    left, top = label.x - text_width_mm(label.text, label.height_mm) / 2, label.y + label.height_mm / 2
    for k, letter in enumerate(label.text.upper()):
        points = _letters().get(letter, set())
        yield from strokes_of(points, (left + k * (COLUMNS + 1) * pitch, top), pitch, mirrored=False)
