"""The tip in tip radii: an outline of lines and arcs with a straight shank, and the arc length along it.

       |  |                     outline coordinate t: arc length from the apex [tip radii]; for a
       |  |  shank              hemisphere, the angle up to π/2, then π/2 + height above the equator
z=0 ---|--|----- undisturbed top
       \\  /   outline          height of the outline is a function of radius, from the axis to 1
        --     apex, at z = -depth

A point is inside the tip if its radius is below 1 and it is higher than the outline at this radius. Distances are
exact: they are measured to the nearest point of outline or shank.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.spec import Indenter
from optopad.design.spec.indenter import tip_outline as outline_pieces

Row = tuple[float, float, float, float, float, float, float]

_KINK = 1e-6
"""Smallest change of the tangent angle between two pieces of an outline that counts as a kink [rad]."""


@dataclass(frozen=True)
class TipOutline:
    """Outline of a tip of radius 1, made of lines and arcs; lengths in tip radii.

    Attributes
    ----------
    rows : 7 numbers for each piece, from the apex outwards: radius and height of the piece's start, of its end and of
        its centre, then the radius of the arc, which is convex. Centre and arc radius are 0 for a line
    """

    rows: tuple[Row, ...]

    @classmethod
    def from_rows(cls, rows: FloatArray) -> TipOutline:
        """Make an outline from the array (piece, 7) of its `rows`."""
        return cls(tuple((a, b, c, d, e, f, g) for a, b, c, d, e, f, g in np.asarray(rows).tolist()))

    @cached_property
    def table(self) -> FloatArray:
        """The outline's `rows` as an array (piece, 7), with the shank as last piece: an infinite vertical line."""
        height = self.rows[-1][3]
        return np.array([*self.rows, (1.0, height, 1.0, height + 1.0, 0.0, 0.0, 0.0)], dtype=np.float64)

    @cached_property
    def angles(self) -> FloatArray:
        """Angle (piece, 2) of the tangent to the radial direction, at each piece's start and end [rad]."""
        start_r, start_h, end_r, end_h, centre_r, centre_h, radius = self.table.T
        line = np.arctan2(end_h - start_h, end_r - start_r)
        first = np.where(radius > 0.0, np.arctan2(start_r - centre_r, centre_h - start_h), line)
        last = np.where(radius > 0.0, np.arctan2(end_r - centre_r, centre_h - end_h), line)
        return np.stack([first, last], axis=1)

    @cached_property
    def lengths(self) -> FloatArray:
        """Arc length (piece,) of each piece [tip radii]; infinite for the shank."""
        chord = np.hypot(self.table[:, 2] - self.table[:, 0], self.table[:, 3] - self.table[:, 1])
        arc = self.table[:, 6] * (self.angles[:, 1] - self.angles[:, 0])
        length = np.where(self.table[:, 6] > 0.0, arc, chord)
        length[-1] = np.inf
        return np.asarray(length, dtype=np.float64)

    @cached_property
    def starts(self) -> FloatArray:
        """Arc length (piece,) from the apex to each piece's start [tip radii]."""
        return np.concatenate([[0.0], np.cumsum(self.lengths[:-1])])

    @cached_property
    def kinks(self) -> FloatArray:
        """Arc lengths (k,) from the apex at which the tangent jumps [tip radii]."""
        jump = np.abs(self.angles[1:, 0] - self.angles[:-1, 1]) > _KINK
        return np.asarray(self.starts[1:][jump], dtype=np.float64)

    @property
    def contact_power(self) -> float:
        """Power of the depth with which the contact radius grows at first touch [-]: round 1/2, pointed 1, flat 0."""
        if self.rows[0][6] > 0.0:
            return 0.5
        return 0.0 if self.rows[0][3] <= self.rows[0][1] else 1.0

    def points(self, coordinate: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radius, and height above the apex, at arc lengths (...) along the outline from the apex [tip radii]."""
        along = np.asarray(coordinate, dtype=np.float64)
        piece = np.clip(np.searchsorted(self.starts, along, side="right") - 1, 0, len(self.table) - 1)
        start_r, start_h, _, _, centre_r, centre_h, radius = np.moveaxis(self.table[piece], -1, 0)
        offset, first = along - self.starts[piece], self.angles[piece, 0]
        angle = first + offset / np.where(radius > 0.0, radius, 1.0)
        return (
            np.where(radius > 0.0, centre_r + radius * np.sin(angle), start_r + offset * np.cos(first)),
            np.where(radius > 0.0, centre_h - radius * np.cos(angle), start_h + offset * np.sin(first)),
        )

    def tangent_angle(self, coordinate: float) -> float:
        """Angle of tangent to radial direction [rad] at an arc length from the apex; at a kink, the angle before it."""
        piece = max(int(np.searchsorted(self.starts, coordinate, side="left")) - 1, 0)
        first, last = self.angles[piece]
        share = (coordinate - self.starts[piece]) / self.lengths[piece]
        return float(first + (last - first) * share)

    def height(self, radius: FloatArray) -> FloatArray:
        """Height (...) of the outline above the apex at radii (...) up to 1 [tip radii]."""
        rows = self.table[:-1]
        piece = np.minimum(np.searchsorted(rows[:, 2], radius, side="left"), len(rows) - 1)
        start_r, start_h, end_r, end_h, centre_r, centre_h, arc = np.moveaxis(rows[piece], -1, 0)
        slope = (end_h - start_h) / np.where(end_r > start_r, end_r - start_r, 1.0)
        dip = np.sqrt(np.maximum(arc**2 - (radius - centre_r) ** 2, 0.0))
        line = start_h + slope * (radius - start_r)
        return np.asarray(np.where(arc > 0.0, centre_h - dip, line), dtype=np.float64)

    def nearest(self, radius: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance (...) to the nearest point of the outline, and arc length (...) from the apex to this point.

        Parameters
        ----------
        radius, height : (...) positions [tip radii]; heights are above the apex
        """
        r, h = (np.asarray(values, dtype=np.float64)[..., None] for values in (radius, height))
        start_r, start_h, _, _, centre_r, centre_h, arc = self.table.T
        first, last = self.angles.T
        angle = np.clip(np.arctan2(r - centre_r, centre_h - h), first, last)
        offset = np.clip((r - start_r) * np.cos(first) + (h - start_h) * np.sin(first), 0.0, self.lengths)
        off_line = np.hypot(r - start_r - offset * np.cos(first), h - start_h - offset * np.sin(first))
        off_arc = np.hypot(r - centre_r - arc * np.sin(angle), h - centre_h + arc * np.cos(angle))
        is_arc = arc > 0.0
        distance = np.where(is_arc, off_arc, off_line)
        along = self.starts + np.where(is_arc, arc * (angle - first), offset)
        best = np.argmin(distance, axis=-1)[..., None]
        return (
            np.take_along_axis(distance, best, axis=-1)[..., 0],
            np.take_along_axis(along, best, axis=-1)[..., 0],
        )


HEMISPHERE = TipOutline(((0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0),))
"""Outline of a hemispherical tip: a quarter of a circle, along which arc length is the angle from the apex [rad]."""


def tip_of(indenter: Indenter) -> TipOutline:
    """The outline of a design's tip, in tip radii."""
    scale = indenter.tip_radius_mm
    rows = ((*piece.start, *piece.end, *piece.centre, piece.radius) for piece in outline_pieces(indenter))
    return TipOutline(tuple(_scaled(row, scale) for row in rows))


def _scaled(row: Sequence[float], scale: float) -> Row:
    """One of an outline's `rows` in tip radii, rounded so that designs in different units give equal rows."""
    a, b, c, d, e, f, g = (round(value / scale, 12) for value in row)
    return a, b, c, d, e, f, g


def tip_gap(radius: FloatArray, height: FloatArray, depth: float, tip: TipOutline = HEMISPHERE) -> FloatArray:
    """Distance (...) of points from the tip's surface, negative inside; all in tip radii.

    `depth` is the depth of the tip's apex below the undeformed top, which is at height 0.
    """
    if tip == HEMISPHERE:
        below_equator = np.minimum(height - (1.0 - depth), 0.0)
        return np.asarray(np.hypot(radius, below_equator) - 1.0, dtype=np.float64)
    above_apex = np.asarray(height, dtype=np.float64) + depth
    distance, _ = tip.nearest(radius, above_apex)
    inside = (np.asarray(radius) < 1.0) & (above_apex > tip.height(np.minimum(radius, 1.0)))
    return np.where(inside, -distance, distance)


def tip_coordinate(
    radius: FloatArray, height: FloatArray, depth: float, tip: TipOutline = HEMISPHERE
) -> FloatArray:
    """Arc length (...) along the outline from the apex to the point nearest to each position; all in tip radii."""
    if tip == HEMISPHERE:
        above_equator = height - (1.0 - depth)
        angle = np.arctan2(radius, np.maximum(-above_equator, 0.0))
        return np.asarray(angle + np.maximum(above_equator, 0.0), dtype=np.float64)
    return tip.nearest(radius, np.asarray(height, dtype=np.float64) + depth)[1]


def tip_outline(
    coordinate: FloatArray, depth: float, tip: TipOutline = HEMISPHERE
) -> tuple[FloatArray, FloatArray]:
    """Radius and height (...) of the outline of a tip at `depth`, at arc lengths (...) from its apex; in tip radii."""
    if tip == HEMISPHERE:
        angle = np.minimum(coordinate, 0.5 * np.pi)
        above_equator = np.maximum(coordinate - 0.5 * np.pi, 0.0)
        return np.sin(angle), 1.0 - depth - np.cos(angle) + above_equator
    radius, height = tip.points(coordinate)
    return radius, height - depth


def outside_tip(
    radius: FloatArray, height: FloatArray, depth: float, tip: TipOutline = HEMISPHERE
) -> tuple[FloatArray, FloatArray]:
    """Move points (...) that are inside the tip onto its surface; all in tip radii."""
    inside = tip_gap(radius, height, depth, tip) < 0.0
    on_radius, on_height = tip_outline(tip_coordinate(radius, height, depth, tip), depth, tip)
    return np.where(inside, on_radius, radius), np.where(inside, on_height, height)


def tip_points_mm(indenter: Indenter, length: float, count: int) -> FloatArray:
    """Radius and height above the apex (count, 2) of points along a tip's outline and shank [mm].

    Parameters
    ----------
    length : arc length from the apex to the last point [tip radii]
    """
    return indenter.tip_radius_mm * np.column_stack(tip_of(indenter).points(np.linspace(0.0, length, count)))
