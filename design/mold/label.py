r"""The label of a mold: a text engraved in its underside, below the cavity, away from sockets and holes.

    seen from below                     one letter: 5 x 7 points, each a square of 1.25 pitches,
    +---------------------------+       so that points which meet at a corner overlap: a cut that
    | o                       o |       touches itself along an edge only is not manifold
    |     ###   #####                      ##
    |     #       #     8.5               #  #
    |     ###   #####                      ##
    | o                       o |
    +---------------------------+

The underside is on the print bed, where raised letters would lift the mold. Strokes are at most two millimetres wide,
so that the printer bridges them without support. Long texts are broken into lines. Letters are capitals made of
rectangles and not a system font, so equal designs give equal molds on every computer. The pitch is the distance between
neighbouring points of the dot matrix.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from textwrap import wrap

from optopad.design.fields.finding import Finding, error, mm
from optopad.design.fields.packaged import data_table
from optopad.design.mold.filling import SPRUE_RADIUS_MM, filling_offsets_mm, is_cast_under_lid
from optopad.design.mold.lettering import OVERLAP, Stroke, area_mm2, strokes_of
from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign

DEPTH_MM = 0.6
"""Depth of the strokes: three layers of 0.2 mm, so they are legible even though the first layer is squeezed."""
MARGIN_MM = 0.8
"""Distance between the text and the outline of the cavity above it."""
SMALLEST_PITCH_MM = 0.6
"""Smallest pitch of points. It gives strokes of 0.75 mm and gaps of 0.45 mm, which a 0.4 mm nozzle still separates."""
EASY_PITCH_MM = 0.75
"""Pitch of points below which a text is broken into more lines; strokes are then 0.94 mm wide."""
LARGEST_PITCH_MM = 1.5
COLUMNS, ROWS = 5, 7
LETTER_GAP, LINE_GAP = 1, 2
"""Free points between letters and between lines."""


@dataclass(frozen=True, kw_only=True)
class MoldLabel:
    """A label as rectangles to cut into the underside of the mold.

    Attributes
    ----------
    strokes : rectangles, some of which overlap; empty if the design has no label
    depth_mm : depth of the strokes [mm]
    stroke_mm : width of a stroke [mm]
    """

    strokes: tuple[Stroke, ...]
    depth_mm: float
    stroke_mm: float

    @property
    def area_mm2(self) -> float:
        """Area of the union of the strokes [mm2]."""
        return area_mm2(self.strokes)


def mold_label(design: SensorDesign) -> MoldLabel:
    """The label of a design's mold, without strokes if it has no text or no floor.

    `label_findings` checks its legibility.
    """
    text = design.mold.label.upper().strip()
    if not text or design.is_on_board:
        return MoldLabel(strokes=(), depth_mm=0.0, stroke_mm=0.0)
    lines, pitch = label_lines(text, design)
    centre = design.cavity.length_mm / 2, design.cavity.width_mm / 2
    return MoldLabel(
        strokes=tuple(_strokes(lines, pitch, centre)), depth_mm=DEPTH_MM, stroke_mm=OVERLAP * pitch
    )


def label_findings(design: SensorDesign) -> Iterator[Finding]:
    """Errors about a design's label: letters too small to print, or a floor too thin for their depth."""
    text = design.mold.label.upper().strip()
    if not text:
        return
    if design.is_on_board:
        yield error(
            "mold.label",
            "a frame on a circuit board has no floor to engrave",
            value=repr(design.mold.label),
            limit="no label with parts on the floor",
            way_out="leave it empty; the board can carry the text",
        )
        return
    _, pitch = label_lines(text, design)
    if pitch < SMALLEST_PITCH_MM:
        yield error(
            "mold.label",
            "its letters would be too small to print below this cavity",
            value=f"{design.mold.label!r}, strokes {mm(OVERLAP * pitch)}",
            limit=f"strokes of at least {mm(OVERLAP * SMALLEST_PITCH_MM)}",
            way_out="shorten the label",
        )
    if design.mold.floor_mm - DEPTH_MM < design.mold.min_web_mm:
        yield error(
            "mold.floor_mm",
            "the floor is too thin to sink a label into it",
            value=mm(design.mold.floor_mm),
            limit=f"at least mold.min_web_mm + {DEPTH_MM:g} = {mm(design.mold.min_web_mm + DEPTH_MM)}",
            way_out="raise it, or leave mold.label empty",
        )


def label_lines(text: str, design: SensorDesign) -> tuple[list[str], float]:
    """Break a text into lines that fit below the cavity; return them and the pitch of their points [mm].

    Lines are broken at blanks. They are broken within words only if the text is otherwise too small to print.
    """
    room_mm = _room_mm(design)
    widths = range(len(text), 0, -1)
    at_blanks = [wrap(text, width, break_long_words=False, break_on_hyphens=False) for width in widths]
    lines, pitch = _best(at_blanks, room_mm)
    if pitch < SMALLEST_PITCH_MM:
        anywhere = [[line.strip() for line in wrap(text, width, break_on_hyphens=False)] for width in widths]
        lines, pitch = _best(anywhere, room_mm)
    return lines, min(pitch, LARGEST_PITCH_MM)


def _room_mm(design: SensorDesign) -> tuple[float, float]:
    """Length and width of the rectangle below the cavity that a label may cover, between sprue and vents [mm]."""
    plan = plan_of(design)
    width = plan.width_mm
    if is_cast_under_lid(plan):  # sprue and vents are near the corners
        width = 2 * (filling_offsets_mm(plan)[1] - SPRUE_RADIUS_MM)
    length, width = plan.outline.room_mm(width)
    return length - 2 * MARGIN_MM, max(width - 2 * MARGIN_MM, 1e-3)


def _best(broken: list[list[str]], room_mm: tuple[float, float]) -> tuple[list[str], float]:
    """The best of several ways to break a text, and the pitch of its points [mm].

    It is the one with the fewest lines if its pitch is at least `EASY_PITCH_MM`, else the one with the widest pitch.
    """
    pitches = [min(room_mm[0] / _width(lines), room_mm[1] / _height(lines)) for lines in broken]

    def rank(number: int) -> tuple[float, ...]:
        count, pitch = len(broken[number]), round(pitches[number], 9)
        return (1.0, -count, pitch) if pitch >= EASY_PITCH_MM else (0.0, pitch, -count)

    best = max(range(len(broken)), key=rank)
    return broken[best], pitches[best]


def _width(lines: list[str]) -> float:
    longest = max(len(line) for line in lines)
    return longest * (COLUMNS + LETTER_GAP) - LETTER_GAP + OVERLAP - 1.0


def _height(lines: list[str]) -> float:
    return len(lines) * (ROWS + LINE_GAP) - LINE_GAP + OVERLAP - 1.0


def _strokes(lines: list[str], pitch_mm: float, centre_mm: tuple[float, float]) -> list[Stroke]:
    """Rectangles of the text [mm], mirrored along x because the text is read from below."""
    place = centre_mm[0] + _width(lines) / 2 * pitch_mm, centre_mm[1] + _height(lines) / 2 * pitch_mm
    return strokes_of(_points(lines), place, pitch_mm, mirrored=True)


def _points(lines: list[str]) -> set[tuple[int, int]]:
    """Column and row of every point of a text, counted from the top left."""
    return {
        (place * (COLUMNS + LETTER_GAP) + column, number * (ROWS + LINE_GAP) + row)
        for number, line in enumerate(lines)
        for place, letter in enumerate(line)
        for column, bits in enumerate(letters()[letter])
        for row in range(ROWS)
        if bits >> row & 1
    }


@cache
def letters() -> dict[str, tuple[int, ...]]:
    """Columns of every permitted letter as bit patterns; the lowest bit is the top row."""
    return {
        name: tuple(int(bits, 16) for bits in columns.split())
        for name, columns in data_table("letters.toml").items()
    }
