"""The rooms of the code as a picture, drawn from the code's own imports: docs/images/architecture.svg.

Each part of the house is a frame, its rooms stand on floors: a room stands above all that it imports in its frame.
Arrows that follow from others are left out (A to C, where A imports B and B imports C).
"""

from __future__ import annotations

import ast
from html import escape

from tests.rooms import ROOT, Place, arrows, folders

PICTURE = ROOT / "docs" / "images" / "architecture.svg"
COLUMNS = (("optopad", "sims"), ("fabrication", "cad", "design"))
"""Parts of the house by column, from the roof down."""
CELL_W, CELL_H, GAP_X, GAP_Y, PAD, HEAD = 214, 46, 14, 22, 14, 44
WORDS = 35
STYLE = """
  text { font-family: system-ui, sans-serif; fill: #1b2733; }
  .name { font-size: 13px; font-weight: 600; } .what { font-size: 10px; fill: #4a5a6a; }
  .frame { fill: #f6f8fa; stroke: #b9c4cf; } .title { font-size: 16px; font-weight: 700; }
  .cell { fill: #ffffff; stroke: #7a8b9c; } .arrow { stroke: #5d7fa3; stroke-width: 1; fill: none; }
"""


def rooms_of(frame: str) -> list[str]:
    """Folders of modules that lie in a part of the house; the part itself where it has none."""
    return sorted(path[1] for path in folders() if len(path) == 2 and path[0] == frame)


def edges_of(frame: str) -> set[tuple[str, str]]:
    """(room, what it imports) between the folders of a part."""
    rooms = set(rooms_of(frame))
    return {(a, b) for a, b in arrows((frame,)) if a in rooms and b in rooms}


def reduced(edges: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Edges that do not follow from others; the graph has no circle."""
    below: dict[str, set[str]] = {}
    for start, end in edges:
        below.setdefault(start, set()).add(end)

    def reaches(start: str, end: str) -> bool:
        return any(step == end or reaches(step, end) for step in below.get(start, ()))

    return {
        (start, end)
        for start, end in edges
        if not any(reaches(step, end) for step in below[start] if step != end)
    }


def floors_of(rooms: list[str], edges: set[tuple[str, str]]) -> list[list[str]]:
    """Rooms by floor, from the ground up: each on the lowest floor above all that it imports."""
    heights: dict[str, int] = {}

    def height(room: str) -> int:
        if room not in heights:
            heights[room] = max((height(end) + 1 for start, end in edges if start == room), default=0)
        return heights[room]

    tops = max((height(room) for room in rooms), default=0)
    return [[room for room in rooms if heights[room] == floor] for floor in range(tops + 1)]


def purpose(place: Place) -> str:
    """The first line at a room's door."""
    text = ast.get_docstring(ast.parse((ROOT.joinpath(*place) / "__init__.py").read_text(encoding="utf-8")))
    return (text or "").partition("\n")[0].replace("`", "")


def wrapped(text: str, width: int = WORDS, lines: int = 2) -> list[str]:
    """The beginning of a text in a few short lines; cut at a word, with an ellipsis."""
    found = [""]
    for word in text.split():
        if len(found[-1]) + len(word) + 1 <= width:
            found[-1] = f"{found[-1]} {word}".strip()
        elif len(found) < lines:
            found.append(word)
        else:
            found[-1] = found[-1].rstrip(".,:;") + " …"
            break
    return found


def _frame(frame: str, x: float, top: float, width: float) -> tuple[list[str], float]:
    """SVG of one part of the house, and where it ends."""
    rooms, edges = rooms_of(frame), edges_of(frame)
    floors = floors_of(rooms, edges)[::-1] if rooms else []
    row_height = CELL_H + GAP_Y
    height = HEAD + len(floors) * row_height + (PAD - GAP_Y if floors else 4)
    at: dict[str, tuple[float, float]] = {}
    for number, floor in enumerate(floors):
        left = x + PAD + (width - 2 * PAD - len(floor) * (CELL_W + GAP_X) + GAP_X) / 2
        for place, room in enumerate(floor):
            at[room] = (left + place * (CELL_W + GAP_X), top + HEAD + number * row_height)
    out = [
        f'<rect class="frame" x="{x:g}" y="{top:g}" width="{width:g}" height="{height:g}" rx="8"/>',
        f'<text class="title" x="{x + PAD:g}" y="{top + 20:g}">{frame}/</text>',
        f'<text class="what" x="{x + PAD:g}" y="{top + 34:g}">{escape(purpose((frame,)))}</text>',
    ]
    out += [_arrow(at[start], at[end]) for start, end in sorted(reduced(edges))]
    for room in rooms:
        out += _cell(room, purpose((frame, room)), *at[room])
    return out, top + height


def _cell(name: str, what: str, x: float, y: float) -> list[str]:
    lines = [
        f'<text class="what" x="{x + 8:g}" y="{y + 29 + 11 * number:g}">{escape(line)}</text>'
        for number, line in enumerate(wrapped(what))
    ]
    box = f'<rect class="cell" x="{x:g}" y="{y:g}" width="{CELL_W}" height="{CELL_H}" rx="4"/>'
    return [box, f'<text class="name" x="{x + 8:g}" y="{y + 16:g}">{name}</text>', *lines]


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    x0, y0 = start[0] + CELL_W / 2, start[1] + CELL_H
    x1, y1 = end[0] + CELL_W / 2, end[1]
    bend = min(22.0, 0.5 * (y1 - y0))
    path = f"M{x0:g},{y0:g} C{x0:g},{y0 + bend:g} {x1:g},{y1 - bend:g} {x1:g},{y1 - 2:g}"
    return f'<path class="arrow" marker-end="url(#tip)" d="{path}"/>'


def picture() -> str:
    """The whole map as SVG; equal imports and doors give equal bytes."""
    parts: list[str] = []
    x, bottom = 4.0, 0.0
    for column in COLUMNS:
        floors = [len(floor) for frame in column for floor in floors_of(rooms_of(frame), edges_of(frame))]
        width, top = 2 * PAD + max(floors) * (CELL_W + GAP_X) - GAP_X, 4.0
        for frame in column:
            drawn, end = _frame(frame, x, top, width)
            parts += drawn
            top = end + 12
        x, bottom = x + width + 16, max(bottom, top)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {x:g} {bottom:g}" role="img">\n'
        "<title>The rooms of optopad and what imports what</title>\n"
        f"<style>{STYLE}</style>\n"
        '<rect width="100%" height="100%" fill="#ffffff"/>\n'
        '<marker id="tip" viewBox="0 0 6 6" refX="5" refY="3" markerWidth="6" markerHeight="6" orient="auto">'
        '<path d="M0,0 L6,3 L0,6 z" fill="#5d7fa3"/></marker>'
    )
    return "\n".join([head, *parts, "</svg>"]) + "\n"
