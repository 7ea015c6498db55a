"""Routing of a board: tracks on a raster of two layers, one connection at a time.

A place of the raster is free for a net if a track or via there keeps the clearance to all copper of other nets. A path
may cross tracks of other nets at a high cost; these tracks are then removed and routed again. Each such place becomes
more expensive, so that nets which compete for it separate. After a fixed effort no path may cross others any more, and
connections without a path are returned as unrouted. The result depends on the board alone.

The clearance is kept along the whole step between two places, not only at its ends: distances are larger by what half a
diagonal step takes off.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.shape.outline import Point
from optopad.fabrication.board.kernels import BUCKETS, NEVER, cheapest_path
from optopad.fabrication.board.model import (
    BOTTOM,
    CLEARANCE_MM,
    EDGE_MM,
    HOLE_MM,
    TOP,
    TRACK_MM,
    VIA_DRILL_MM,
    VIA_MM,
    Board,
    Pad,
    Track,
    Unrouted,
    Via,
    moved,
)

RASTER_MM = 0.25
HALF_STEP_MM = RASTER_MM * math.sqrt(0.5)
CROSSING = 300
"""Cost of a place that another net's track occupies."""
LEARNT = 100
"""Further cost of the place, each time that a track was removed there."""
MOST_EFFORT = 30_000_000
"""Places that searches consider before no track is removed any more; some 10 s."""
DRILL_APART_MM = 0.25
"""Least distance between the edges of two holes [mm]."""


def at_least(least_mm: float) -> float:
    """Distance of places [mm] that keeps a distance along the steps between them."""
    return math.hypot(least_mm, HALF_STEP_MM) - 1e-6


TRACK_TO_PAD_MM = at_least(TRACK_MM / 2 + CLEARANCE_MM)
TRACK_TO_TRACK_MM = at_least(TRACK_MM + CLEARANCE_MM)
TRACK_TO_VIA_MM = at_least(TRACK_MM / 2 + CLEARANCE_MM + VIA_MM / 2)
VIA_TO_PAD_MM = VIA_MM / 2 + CLEARANCE_MM
VIA_TO_VIA_MM = VIA_MM + CLEARANCE_MM
DRILL_TO_DRILL_MM = VIA_DRILL_MM + DRILL_APART_MM


@dataclass(eq=False)
class _Path:
    """A routed connection: its places, those that it keeps other nets off (as `owners`), and any other via off."""

    net: int
    places: IntArray
    kept_off: IntArray
    drills_kept_off: IntArray


@dataclass
class _Net:
    name: str
    pads: list[tuple[str, IntArray]]
    paths: list[_Path] = field(default_factory=list)
    searches: int = 0


class Raster:
    """Places of a board's raster, and the fixed obstacles on it."""

    def __init__(self, board: Board) -> None:
        x0, y0, x1, y1 = board.box
        self.x0, self.y0 = math.ceil(x0 / RASTER_MM) * RASTER_MM, math.ceil(y0 / RASTER_MM) * RASTER_MM
        self.columns = math.floor((x1 - self.x0) / RASTER_MM) + 1
        self.rows = math.floor((y1 - self.y0) / RASTER_MM) + 1
        self.layer_size = self.rows * self.columns
        self.xs = self.x0 + RASTER_MM * np.arange(self.columns)
        self.ys = self.y0 + RASTER_MM * np.arange(self.rows)
        self.box = board.box

    def point(self, place: int) -> Point:
        """Position of a place [mm]."""
        row, column = divmod(place % self.layer_size, self.columns)
        return float(self.xs[column]), float(self.ys[row])

    def window(self, x: float, y: float, reach: float) -> tuple[slice, slice]:
        """Rows and columns within a distance of a point in x and y."""
        columns = np.searchsorted(self.xs, (x - reach, x + reach))
        rows = np.searchsorted(self.ys, (y - reach, y + reach))
        return slice(int(rows[0]), int(rows[1])), slice(int(columns[0]), int(columns[1]))

    def pad_distance(self, pad: Pad, reach: float) -> tuple[tuple[slice, slice], FloatArray]:
        """Window around a pad, and distances of its places from the pad [mm]; negative inside."""
        area = self.window(pad.x, pad.y, math.hypot(pad.width, pad.height) / 2 + reach)
        x, y = self.xs[area[1]][None, :] - pad.x, self.ys[area[0]][:, None] - pad.y
        if pad.is_round:
            return area, np.hypot(x, y) - pad.width / 2
        (cosine, sine) = moved((1.0, 0.0), (0.0, 0.0), pad.angle_deg)
        along, across = np.abs(cosine * x + sine * y), np.abs(cosine * y - sine * x)
        beside, above = along - pad.width / 2, across - pad.height / 2
        outside = np.hypot(np.maximum(beside, 0.0), np.maximum(above, 0.0))
        return area, outside + np.minimum(np.maximum(beside, above), 0.0)

    def edge_distance(self) -> FloatArray:
        """Distance (rows, columns) of each place from the board's edge [mm]."""
        x0, y0, x1, y1 = self.box
        x = np.minimum(self.xs - x0, x1 - self.xs)
        y = np.minimum(self.ys - y0, y1 - self.ys)
        return np.asarray(np.minimum(x[None, :], y[:, None]))


FORBIDDEN = -1
VIAS = 2
"""Index of the vias next to the two layers."""


class Router:
    """State of a board's routing.

    Attributes
    ----------
    owners : net that alone may use a place (3, rows, columns): for tracks on the top and bottom, and for vias; 0 for
        all, `FORBIDDEN` for none
    counts, sums : number of nets whose tracks keep others off a place, and the sum of their numbers, as `owners`
    drills : number of vias (rows, columns) that are too near for another one
    learnt : additional cost (2, rows, columns) of a place where a track was removed
    """

    def __init__(self, board: Board) -> None:
        self.board, self.raster = board, Raster(board)
        shape = 3, self.raster.rows, self.raster.columns
        names = sorted({pad.net for _, pad in board.pads if pad.net})
        self.numbers = {name: number for number, name in enumerate(names, start=1)}
        self.nets = {number: _Net(name, []) for name, number in self.numbers.items()}
        self.owners, self.counts, self.sums = (np.zeros(shape, dtype=np.int64) for _ in range(3))
        self.learnt, self.drills = (
            np.zeros((2, *shape[1:]), dtype=np.int64),
            np.zeros(shape[1:], dtype=np.int64),
        )
        self._best = np.full(2 * self.raster.layer_size, NEVER, dtype=np.int64)
        self._before = np.empty_like(self._best)
        self._heads = np.full(BUCKETS, -1, dtype=np.int64)
        self._is_goal = np.zeros(len(self._best), dtype=np.bool_)
        self.effort = 0
        self._block_fixed()
        self._place_pads()

    def _block_fixed(self) -> None:
        edge = self.raster.edge_distance()
        self.owners[:2, edge < EDGE_MM + TRACK_MM / 2 - 1e-9] = FORBIDDEN
        self.owners[VIAS, edge < EDGE_MM + VIA_MM / 2 - 1e-9] = FORBIDDEN
        for hole in self.board.holes:
            ring = Pad(
                number="",
                net="",
                x=hole.x,
                y=hole.y,
                width=hole.diameter_mm,
                height=hole.diameter_mm,
                is_round=True,
            )
            area, distance = self.raster.pad_distance(ring, HOLE_MM + VIA_MM)
            self.owners[:2, *area][:, distance < at_least(HOLE_MM + TRACK_MM / 2)] = FORBIDDEN
            self.owners[VIAS][area][distance < HOLE_MM + VIA_MM / 2] = FORBIDDEN

    def _place_pads(self) -> None:
        raster = self.raster
        for part, pad in self.board.pads:
            number = self.numbers.get(pad.net, FORBIDDEN)
            area, distance = raster.pad_distance(pad, TRACK_TO_PAD_MM + VIA_MM)
            for layer in pad.layers:
                _claim(self.owners[layer][area], distance < TRACK_TO_PAD_MM, number)
            _claim(self.owners[VIAS][area], distance < VIA_TO_PAD_MM - 1e-9, number)
            own_via = VIA_MM / 2 if not pad.drill_mm else 0.0
            self.owners[VIAS][area][distance < own_via] = FORBIDDEN  # solder would flow into a via in a pad
            if pad.drill_mm:
                gap = VIA_DRILL_MM / 2 + DRILL_APART_MM - (pad.width - pad.drill_mm) / 2
                self.owners[VIAS][area][distance < max(gap, 0.0)] = FORBIDDEN
            if number > 0:
                rows, columns = np.nonzero(distance <= -0.02)
                flat = (rows + area[0].start) * raster.columns + columns + area[1].start
                places = np.concatenate([flat + layer * raster.layer_size for layer in pad.layers])
                name = f"{part.reference}-{pad.number}"
                self.nets[number].pads.append((name, places))

    def components(self, number: int) -> list[set[int]]:
        """Places of the connected pieces of a net."""
        net, pieces = self.nets[number], list[set[int]]()
        whole = [set(places.tolist()) for _, places in net.pads]
        for piece in (*whole, *(set(path.places.tolist()) for path in net.paths)):
            touching = [one for one in pieces if not one.isdisjoint(piece)]
            pieces = [one for one in pieces if one.isdisjoint(piece)]
            pieces.append(piece.union(*touching))
        return [one for one in pieces if any(not one.isdisjoint(pad) for pad in whole)]

    def route(self) -> None:
        """Route every net."""
        lengths = {number: self._span(net) for number, net in self.nets.items()}
        order = sorted(
            self.nets, key=lambda number: (len(self.nets[number].pads) > 2, lengths[number], number)
        )
        waiting = deque(number for number in order if len(self.nets[number].pads) > 1)
        while waiting and self.effort < MOST_EFFORT:
            number = waiting.popleft()
            pieces = self.components(number)
            while len(pieces) > 1 and self.effort < MOST_EFFORT:
                path = self._search(number, pieces, may_cross=True)
                if path is None:
                    break
                waiting.extend(one for one in self._put(number, path) if one not in waiting)
                pieces = self.components(number)
        for number in order:
            pieces = self.components(number)
            while len(pieces) > 1:
                path = self._search(number, pieces, may_cross=False)
                if path is None:
                    break
                self._put(number, path)
                pieces = self.components(number)

    def _span(self, net: _Net) -> float:
        points = np.array(
            [self.raster.point(int(places[len(places) // 2])) for _, places in net.pads if len(places)]
        )
        return float(np.ptp(points, axis=0).sum()) if len(points) else 0.0

    def _search(self, number: int, pieces: Sequence[set[int]], *, may_cross: bool) -> IntArray | None:
        start = min(pieces, key=lambda piece: (len(piece), min(piece)))
        others = [np.fromiter(piece, dtype=np.int64) for piece in pieces if piece is not start]
        goals = np.concatenate(others)
        rows, columns = np.divmod(goals % self.raster.layer_size, self.raster.columns)
        box = np.array([rows.min(), rows.max(), columns.min(), columns.max()])
        self._is_goal[goals] = True
        path, considered = cheapest_path(
            self.owners, self.counts, self.sums, self.learnt, self.drills, number, CROSSING if may_cross else -1,
            np.array(sorted(start), dtype=np.int64), self._is_goal, box, self._best, self._before, self._heads,
        )  # fmt: skip
        self._is_goal[goals] = False
        self.effort += considered
        return path if len(path) else None

    def _put(self, number: int, places: IntArray) -> list[int]:
        """Add a path to a net, and remove the paths of other nets that it crosses; return these nets."""
        path, size = self._kept(number, places), self.raster.layer_size
        vias = np.array(_via_places(places, size), dtype=np.int64) + VIAS * size
        used = np.concatenate([places, vias])
        removed = list[int]()
        counts, sums = self.counts.ravel()[used], self.sums.ravel()[used]
        if np.any((counts > 1) | ((counts == 1) & (sums != number))):
            is_used = np.zeros(3 * size, dtype=np.bool_)
            is_used[used] = True
            for other, net in self.nets.items():
                for one in list(net.paths) if other != number else ():
                    crossed = one.kept_off[is_used[one.kept_off]]
                    if len(crossed):
                        self._count(one, -1)
                        net.paths.remove(one)
                        self.learnt.ravel()[crossed[crossed < VIAS * size]] += LEARNT
                        removed.append(other)
        self._count(path, 1)
        self.nets[number].paths.append(path)
        return list(dict.fromkeys(removed))

    def _count(self, path: _Path, sign: int) -> None:
        """Count the places that a path keeps others off; a net counts once, however many of its paths are near."""
        mine = np.zeros(3 * self.raster.layer_size, dtype=np.bool_)
        mine[path.kept_off] = True
        for one in self.nets[path.net].paths:
            if one is not path:
                mine[one.kept_off] = False
        alone = np.flatnonzero(mine)
        self.counts.ravel()[alone] += sign
        self.sums.ravel()[alone] += sign * path.net
        self.drills.ravel()[path.drills_kept_off] += sign

    def _kept(self, number: int, places: IntArray) -> _Path:
        size = self.raster.layer_size
        vias = np.array(_via_places(places, size), dtype=np.int64)
        layers, here = np.divmod(places, size)
        near_tracks = [
            self._disc(here[layers == layer], TRACK_TO_TRACK_MM) + layer * size for layer in (0, 1)
        ]
        near_vias = self._disc(vias, TRACK_TO_VIA_MM)
        kept = (
            *near_tracks,
            near_vias,
            near_vias + size,
            self._disc(here, TRACK_TO_VIA_MM) + VIAS * size,
            self._disc(vias, VIA_TO_VIA_MM) + VIAS * size,
        )
        drills = np.concatenate(
            [self._disc(vias[k : k + 1], DRILL_TO_DRILL_MM) for k in range(len(vias))] or [vias]
        )
        return _Path(number, places, np.unique(np.concatenate(kept)), np.unique(drills))

    def _disc(self, here: IntArray, radius: float) -> IntArray:
        """Places of one layer that are nearer than a radius to one of several places."""
        row, column = (one[:, None] for one in np.divmod(here, self.raster.columns))
        dy, dx = _disc_steps(radius)
        row, column = row + dy, column + dx
        inside = (row >= 0) & (column >= 0) & (row < self.raster.rows) & (column < self.raster.columns)
        return (row * self.raster.columns + column)[inside]

    def tracks_and_vias(self) -> tuple[tuple[Track, ...], tuple[Via, ...]]:
        """The routed paths as straight tracks and vias, without pieces that lead nowhere."""
        tracks, vias = list[Track](), list[Via]()
        for net in self.nets.values():
            steps = _without_stubs(net)
            size = self.raster.layer_size
            degree = Counter(place for step in steps for place in step)
            ends = {place for place, count in degree.items() if count != 2}
            ends.update(place for _, places in net.pads for place in places.tolist())
            spots = sorted({a % size for a, b in steps if a // size != b // size})
            vias += [Via(net=net.name, x=x, y=y) for x, y in map(self.raster.point, spots)]
            for layer in (TOP, BOTTOM):
                flat = [step for step in steps if step[0] // size == step[1] // size == layer]
                tracks += [
                    Track(net=net.name, start=self.raster.point(a), end=self.raster.point(b), layer=layer)
                    for a, b in _straight(flat, self.raster.columns, ends)
                ]
        return tuple(tracks), tuple(vias)

    def unrouted(self) -> Iterator[Unrouted]:
        """The connections that have no track."""
        for number, net in self.nets.items():
            pieces = self.components(number)
            names = [
                next((name for name, places in net.pads if not piece.isdisjoint(places.tolist())), "")
                for piece in pieces
            ]
            lost = [name for name, places in net.pads if not len(places)]
            yield from (Unrouted(net=net.name, start=names[0], end=name) for name in names[1:] + lost)


def _claim(owner: IntArray, near: BoolArray, number: int) -> None:
    taken = near & (owner != 0) & (owner != number)
    owner[near & (owner == 0)] = number
    owner[taken] = FORBIDDEN


def _via_places(places: IntArray, size: int) -> list[int]:
    """Places of one layer at which a path changes the layer."""
    return [int(a) % size for a, b in pairwise(places.tolist()) if a // size != b // size]


@cache
def _disc_steps(radius: float) -> tuple[IntArray, IntArray]:
    """Steps of the raster (n,) along y and along x that are shorter than a radius [mm]."""
    most = math.ceil(radius / RASTER_MM)
    dy, dx = np.mgrid[-most : most + 1, -most : most + 1].reshape(2, -1)
    near = np.hypot(dx, dy) * RASTER_MM < radius - 1e-9
    return dy[near], dx[near]


def _without_stubs(net: _Net) -> list[tuple[int, int]]:
    """Steps of a net's paths as pairs of places, without loops and without those that lead to no pad."""
    joined: dict[int, int] = {}

    def root(place: int) -> int:
        while joined.setdefault(place, place) != place:
            place = joined[place]
        return place

    for _, places in net.pads:
        for place in places.tolist():
            joined[root(place)] = root(int(places[0]))
    steps = set[tuple[int, int]]()
    for path in net.paths:
        for a, b in pairwise(path.places.tolist()):
            if root(a) != root(b):  # otherwise they are connected already, as inside a pad
                joined[root(a)] = root(b)
                steps.add((min(a, b), max(a, b)))
    held = {place for _, places in net.pads for place in places.tolist()}
    at: dict[int, set[tuple[int, int]]] = {}
    for step in steps:
        for end in step:
            at.setdefault(end, set()).add(step)
    loose = [place for place, its in at.items() if len(its) == 1 and place not in held]
    while loose:
        place = loose.pop()
        for step in list(at[place]):
            other = step[0] if step[1] == place else step[1]
            steps.discard(step)
            at[place].discard(step)
            at[other].discard(step)
            if len(at[other]) == 1 and other not in held:
                loose.append(other)
    return sorted(steps)


def _straight(
    steps: Iterable[tuple[int, int]], columns: int, ends: Container[int]
) -> Iterator[tuple[int, int]]:
    """Steps of one layer, with those in a line joined, but not at ends."""
    by_line: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for a, b in steps:
        row, column = divmod(a, columns)
        step = b - a
        line = {1: row, columns: column, columns + 1: column - row, columns - 1: column + row}[step]
        by_line.setdefault((step, line), []).append((a, b))
    for _, found in sorted(by_line.items()):
        start, end = None, None
        for a, b in sorted(found):
            if a == end and a not in ends:
                end = b
                continue
            if start is not None and end is not None:
                yield start, end
            start, end = a, b
        if start is not None and end is not None:
            yield start, end


def routed(board: Board) -> Board:
    """The board with tracks and vias; connections without a path are in `unrouted`."""
    router = Router(board)
    router.route()
    tracks, vias = router.tracks_and_vias()
    return replace(board, tracks=tracks, vias=vias, unrouted=tuple(router.unrouted()))
