"""The ground pour of a routed board: copper on ground that fills both layers around tracks and pads.

It joins tracks and vias of ground, which connect all pads already, and keeps its clearance from pads, so that no pad
loses its heat to it. It consists of squares of the router's raster; pieces that touch neither track nor via of ground
are left out. In KiCad's file it is a zone, which KiCad fills by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from optopad.design.arrays import BoolArray
from optopad.design.shape.outline import Point
from optopad.fabrication.board.model import (
    BOTTOM,
    CLEARANCE_MM,
    EDGE_MM,
    GROUND,
    HOLE_MM,
    TOP,
    TRACK_MM,
    VIA_MM,
    Board,
    Pad,
    Track,
)
from optopad.fabrication.board.router import HALF_STEP_MM, RASTER_MM, Raster

SEAM_MM = 0.005
"""Overlap of neighbouring rectangles [mm]."""


def with_pour(board: Board) -> Board:
    """The board with a ground pour on both layers."""
    raster = Raster(board)
    return replace(
        board, pours=tuple(tuple(_rectangles(raster, _mask(board, raster, k))) for k in (TOP, BOTTOM))
    )


def track_pad(track: Track) -> Pad:
    """The middle of a track as a rectangle, without its round ends."""
    (x0, y0), (x1, y1) = track.start, track.end
    angle, length = np.degrees(np.arctan2(y1 - y0, x1 - x0)), np.hypot(x1 - x0, y1 - y0)
    return Pad(
        number="", net=track.net, x=(x0 + x1) / 2, y=(y0 + y1) / 2, width=float(length), height=0.0,
        angle_deg=float(angle),
    )  # fmt: skip


def _disc(x: float, y: float, diameter_mm: float, net: str = "") -> Pad:
    return Pad(number="", net=net, x=x, y=y, width=diameter_mm, height=diameter_mm, is_round=True)


def _mask(board: Board, raster: Raster, layer: int) -> BoolArray:
    """Squares (rows, columns) of the raster that the pour covers on a layer."""
    free = raster.edge_distance() >= EDGE_MM + RASTER_MM / 2
    tracks = [(track_pad(one), TRACK_MM / 2) for one in board.tracks if one.layer == layer]
    vias = [(_disc(one.x, one.y, VIA_MM, one.net), 0.0) for one in board.vias]
    pads = [(replace(pad, net=""), 0.0) for _, pad in board.pads if layer in pad.layers]
    holes = [(_disc(hole.x, hole.y, hole.diameter_mm), HOLE_MM - CLEARANCE_MM) for hole in board.holes]
    seeds = np.zeros_like(free)
    for pad, grown in (*tracks, *vias, *pads, *holes):
        reach = grown + CLEARANCE_MM + HALF_STEP_MM + 2 * SEAM_MM
        area, distance = raster.pad_distance(pad, reach)
        if pad.net == GROUND:
            seeds[area] |= distance <= 0.0
        else:
            free[area] &= distance >= reach
    return _touching(free, seeds & free)


def _touching(free: BoolArray, seeds: BoolArray) -> BoolArray:
    """The connected pieces of an area that contain a seed."""
    from scipy.ndimage import label

    numbers, _ = label(free)
    return np.asarray(np.isin(numbers, np.unique(numbers[seeds])) & free)


def _rectangles(raster: Raster, mask: BoolArray) -> Iterator[tuple[Point, ...]]:
    """Rectangles that cover a mask; equal runs of neighbouring rows are one rectangle."""
    open_runs: dict[tuple[int, int], int] = {}
    for row in range(raster.rows + 1):
        line = (
            np.concatenate(([False], mask[row], [False]))
            if row < raster.rows
            else np.zeros(2, dtype=np.bool_)
        )
        edges = np.flatnonzero(line[1:] != line[:-1])
        runs = {(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)}
        for run in sorted(set(open_runs) - runs):
            yield _rectangle(raster, run, (open_runs.pop(run), row))
        for run in runs:
            open_runs.setdefault(run, row)


def _rectangle(raster: Raster, columns: tuple[int, int], rows: tuple[int, int]) -> tuple[Point, ...]:
    half = RASTER_MM / 2
    x0, x1 = (raster.x0 + RASTER_MM * k - half for k in columns)
    y0, y1 = (raster.y0 + RASTER_MM * k - half for k in rows)
    x0, y0, x1, y1 = x0 - SEAM_MM, y0 - SEAM_MM, x1 + SEAM_MM, y1 + SEAM_MM
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1)
