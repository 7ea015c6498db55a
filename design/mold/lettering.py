"""Engraved letters made of rectangles: overlapping points of a dot matrix, the area that they cover, and its outline.

The pitch is the distance between neighbouring points. A point is a square with a side of 1.25 pitches, so that diagonal
neighbours overlap. Without this overlap, the cut would touch itself only along an edge and not be manifold. A row of
adjacent points becomes one rectangle, a stroke. Letters are not a system font, so equal designs give equal molds on
every computer.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby

OVERLAP = 1.25
"""Side of a point divided by the pitch of points."""

Point = tuple[int, int]
Loop = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """A rectangle of an engraved text, in the plane of the face that it is cut into [mm]."""

    x0: float
    x1: float
    y0: float
    y1: float


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A connected part of an engraved text: its outline counter-clockwise and its holes clockwise [mm]."""

    outline: Loop
    holes: tuple[Loop, ...]


def strokes_of(
    points: set[Point], place: tuple[float, float], pitch_mm: float, *, mirrored: bool
) -> list[Stroke]:
    """Rectangles that cover the points of a text; adjacent points in a row or column share one rectangle.

    Parameters
    ----------
    points : column and row of each point, counted from the top left
    place : position of the upper left corner of the point (0, 0), as seen by the reader [mm]
    mirrored : whether x of the plane increases to the reader's left instead of right; y increases upward
    """
    across, along = _runs(points, horizontal=True), _runs(points, horizontal=False)
    joined = {point for run in (*across, *along) for point in run}
    alone = [[point] for point in sorted(points - joined)]
    return [_stroke(run, place, pitch_mm, mirrored) for run in (*across, *along, *alone)]


def _stroke(run: Sequence[Point], place: tuple[float, float], pitch_mm: float, mirrored: bool) -> Stroke:
    (column0, row0), (column1, row1) = run[0], run[-1]
    left, right = column0 * pitch_mm, (column1 + OVERLAP) * pitch_mm
    x0, x1 = (place[0] - right, place[0] - left) if mirrored else (place[0] + left, place[0] + right)
    y0, y1 = place[1] - (row1 + OVERLAP) * pitch_mm, place[1] - row0 * pitch_mm
    return Stroke(x0=round(x0, 6), x1=round(x1, 6), y0=round(y0, 6), y1=round(y1, 6))


def area_mm2(strokes: Iterable[Stroke]) -> float:
    """Area of the union of strokes [mm2]."""
    grid = _Grid(tuple(strokes))
    return sum((grid.width(i) * grid.height(j) for i, j in grid.covered), 0.0)


def upper_edges_mm(strokes: Iterable[Stroke]) -> float:
    """Total length of the upper edges of the area covered by strokes [mm].

    In a vertical wall these edges are ceilings that the printer must bridge.
    """
    grid = _Grid(tuple(strokes))
    return sum(grid.width(i) for i, j in grid.covered if (i, j + 1) not in grid.covered)


def shapes_of(strokes: Iterable[Stroke]) -> tuple[Shape, ...]:
    """Connected shapes of the area covered by strokes, in the order of their leftmost corners."""
    loops = _Grid(tuple(strokes)).loops()
    outer = [loop for loop in loops if _signed_area(loop) > 0]
    holes = [loop for loop in loops if _signed_area(loop) < 0]
    return tuple(
        Shape(outline=loop, holes=tuple(hole for hole in holes if _holds(loop, hole[0])))
        for loop in sorted(outer, key=min)
    )


class _Grid:
    """Grid of cells between all edges of some strokes; `covered` has the indices of the cells inside strokes."""

    def __init__(self, strokes: tuple[Stroke, ...]) -> None:
        self.xs = sorted({edge for stroke in strokes for edge in (stroke.x0, stroke.x1)})
        self.ys = sorted({edge for stroke in strokes for edge in (stroke.y0, stroke.y1)})
        column, row = {x: k for k, x in enumerate(self.xs)}, {y: k for k, y in enumerate(self.ys)}
        self.covered = {
            (i, j)
            for stroke in strokes
            for i in range(column[stroke.x0], column[stroke.x1])
            for j in range(row[stroke.y0], row[stroke.y1])
        }

    def width(self, i: int) -> float:
        """Width of a column [mm]."""
        return self.xs[i + 1] - self.xs[i]

    def height(self, j: int) -> float:
        """Height of a row [mm]."""
        return self.ys[j + 1] - self.ys[j]

    def loops(self) -> list[Loop]:
        """Corners of the closed outlines of the covered cells [mm]; the cells are to the left of their outline."""
        following = dict(edge for cell in sorted(self.covered) for edge in self._open_edges(*cell))
        loops = []
        while following:
            start = at = next(iter(following))
            corners = []
            while at in following:
                corners.append(at)
                at = following.pop(at)
            assert at == start, "overlapping points never touch at a corner only"
            loops.append(tuple((self.xs[i], self.ys[j]) for i, j in _turns(corners)))
        return loops

    def _open_edges(self, i: int, j: int) -> list[tuple[Point, Point]]:
        """Directed edges between a covered cell and neighbours that are not covered, as pairs of grid corners."""
        sides = (
            ((i, j - 1), (i, j), (i + 1, j)),
            ((i + 1, j), (i + 1, j), (i + 1, j + 1)),
            ((i, j + 1), (i + 1, j + 1), (i, j + 1)),
            ((i - 1, j), (i, j + 1), (i, j)),
        )
        return [(start, end) for beyond, start, end in sides if beyond not in self.covered]


def _turns(corners: list[Point]) -> list[Point]:
    """The corners at which a closed outline changes direction."""
    around = zip(corners, corners[1:] + corners[:1], corners[-1:] + corners[:-1], strict=True)
    return [
        at
        for at, after, before in around
        if not (before[0] == at[0] == after[0] or before[1] == at[1] == after[1])
    ]


def _signed_area(loop: Loop) -> float:
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(loop, loop[1:] + loop[:1], strict=True)) / 2


def _holds(loop: Loop, point: tuple[float, float]) -> bool:
    """Whether a point is inside an outline of axis-parallel edges, by counting crossings of a ray to the right."""
    x, y = point[0] + 1e-7, point[1] + 1e-7
    edges = zip(loop, loop[1:] + loop[:1], strict=True)
    return sum(x0 > x and (y0 > y) != (y1 > y) for (x0, y0), (_, y1) in edges) % 2 == 1


def _runs(points: set[Point], *, horizontal: bool) -> list[list[Point]]:
    """Groups of at least two adjacent points in a row, or in a column."""
    ordered = sorted((point[::-1] if horizontal else point) for point in points)
    runs = []
    for _, group in groupby(enumerate(ordered), key=lambda item: (item[1][0], item[1][1] - item[0])):
        run = [point[::-1] if horizontal else point for _, point in group]
        if len(run) > 1:
            runs.append(run)
    return runs
