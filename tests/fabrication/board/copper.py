"""Distances between all copper of a board, computed from its shapes alone."""

from __future__ import annotations

import numpy as np

from optopad.fabrication.board.model import TRACK_MM, VIA_MM, Board

ROWS = 200


def pieces(board: Board, layer: int) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Net, segment (n, 4) and half width (n,) of pieces that make up the copper of a layer, without the pour."""
    nets, segments, halves = [], [], []

    def add(net: str, x0: float, y0: float, x1: float, y1: float, half: float) -> None:
        nets.append(net)
        segments.append((x0, y0, x1, y1))
        halves.append(half)

    for track in board.tracks:
        if track.layer == layer:
            add(track.net, *track.start, *track.end, TRACK_MM / 2)
    for via in board.vias:
        add(via.net, via.x, via.y, via.x, via.y, VIA_MM / 2)
    for number, (part, pad) in enumerate(board.pads):
        if layer not in pad.layers:
            continue
        net = pad.net or f"open {number} {part.reference}"
        if pad.is_round:
            add(net, pad.x, pad.y, pad.x, pad.y, pad.width / 2)
            continue
        ends = pad.corners
        for (x0, y0), (x1, y1) in zip(ends, ends[1:] + ends[:1], strict=True):
            add(net, x0, y0, x1, y1, 0.0)
        middles = [
            ((x0 + x1) / 2, (y0 + y1) / 2)
            for (x0, y0), (x1, y1) in zip(ends, ends[1:] + ends[:1], strict=True)
        ]
        add(net, *middles[0], *middles[2], 0.0)
        add(net, *middles[1], *middles[3], 0.0)
    return nets, np.array(segments), np.array(halves)


def point_distance(x: np.ndarray, y: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Distance of points from segments (..., 4)."""
    ax, ay, bx, by = np.moveaxis(segment, -1, 0)
    dx, dy = bx - ax, by - ay
    length = np.maximum(dx**2 + dy**2, 1e-18)
    share = np.clip(((x - ax) * dx + (y - ay) * dy) / length, 0.0, 1.0)
    return np.hypot(x - ax - share * dx, y - ay - share * dy)


def side(segment: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Sign of the side of segments on which points are."""
    ax, ay, bx, by = np.moveaxis(segment, -1, 0)
    return np.sign(np.round((bx - ax) * (y - ay) - (by - ay) * (x - ax), 9))


def closest(board: Board, layer: int) -> tuple[float, str]:
    """Least distance between copper of two nets on a layer, and the two nets."""
    nets, segments, halves = pieces(board, layer)
    numbers = np.unique(nets, return_inverse=True)[1]
    best, names = np.inf, ""
    for first in range(0, len(nets), ROWS):
        rows = slice(first, first + ROWS)
        one, other = segments[rows, None, :], segments[None, :, :]
        distance = np.min(
            [
                point_distance(one[..., 0], one[..., 1], other),
                point_distance(one[..., 2], one[..., 3], other),
                point_distance(other[..., 0], other[..., 1], one),
                point_distance(other[..., 2], other[..., 3], one),
            ],
            axis=0,
        )
        crosses = (side(one, other[..., 0], other[..., 1]) * side(one, other[..., 2], other[..., 3]) < 0) & (
            side(other, one[..., 0], one[..., 1]) * side(other, one[..., 2], one[..., 3]) < 0
        )
        gap = np.where(crosses, 0.0, distance) - halves[rows, None] - halves[None, :]
        gap[numbers[rows, None] == numbers[None, :]] = np.inf
        at = np.unravel_index(np.argmin(gap), gap.shape)
        if gap[at] < best:
            best, names = float(gap[at]), f"{nets[first + at[0]]} and {nets[at[1]]}"
    return best, names


def pour_gap(board: Board, layer: int) -> float:
    """Least distance between the ground pour of a layer and copper of other nets, or pads."""
    nets, segments, halves = pieces(board, layer)
    others = np.array([net != "GND" for net in nets])
    boxes = np.array([(*one[0], *one[2]) for one in board.pours[layer]])
    best = np.inf
    for segment, half in zip(segments[others], halves[others], strict=True):
        steps = np.linspace(0.0, 1.0, max(int(np.hypot(*(segment[2:] - segment[:2])) / 0.05), 1) + 1)[:, None]
        x, y = segment[0] + steps * (segment[2] - segment[0]), segment[1] + steps * (segment[3] - segment[1])
        away_x = np.maximum(np.maximum(boxes[:, 0] - x, x - boxes[:, 2]), 0.0)
        away_y = np.maximum(np.maximum(boxes[:, 1] - y, y - boxes[:, 3]), 0.0)
        best = min(best, float(np.min(np.hypot(away_x, away_y))) - half)
    return best
