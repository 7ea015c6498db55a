"""Lower a radial curve to the table that the ray kernels read.

Between contact edge a and outer radius b the curve h(r) is stored as `CELLS` cubic pieces, uniform in

    x = sqrt(A r² + D) - C,    x(a) = 0,    x(b) = CELLS,

so that a kernel needs one square root from r² to a height, and none from there to a gradient:
dh/dr / r = h' A / (x + C). C makes the first piece `FIRST_PIECE` of the mean one: pieces are short at the contact edge
and nearly uniform in r beyond. Each piece also holds what a march along a ray needs from there: bounds of slope outward
and of fall outward, how far inward it may look, and the bound of bend within that window. Bend is how fast the slope
along a line falls, -d²h/ds², the largest of all directions: max(-h'', -h'/r, 0).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from design.arrays import FloatArray

CELLS = 320
LEVELS = 64
FIRST_PIECE = 0.25
BOUND_RESERVE = 1.01
"""Factor on the largest of `SAMPLES` slopes of a piece."""
SAMPLES = 9
NEAREST_WINDOW_MM, WINDOW_SHARE = 0.06, 0.25
"""A march that comes inward looks this far, or this share of its radius; the further, the larger the bend there."""

# columns of a piece
CUBIC, STEEP, FALL, WINDOW, BEND = 0, 4, 5, 6, 7
PIECE_COLUMNS = 8


@dataclass(frozen=True, kw_only=True)
class RadialTable:
    """One curve as kernels read it.

    Attributes
    ----------
    pieces : (CELLS, 8) height above the clear layer's bottom as a cubic in the piece's fraction [mm]; from this piece
        outward the largest |dh/dr| and the largest fall -dh/dr [-]; window inward [mm], largest bend within it
        and outward [1/mm]
    reach2 : (LEVELS,) squared radius beyond which the top lies nowhere below the upper edge of each level between
        its lowest point and the undisturbed top [mm²]
    scale, offset, start : A [1/mm²], D and C of the coordinate x
    radius, slope : (CELLS + 1,) of the nodes [mm], [-]
    """

    pieces: FloatArray
    reach2: FloatArray
    scale: float
    offset: float
    start: float
    radius: FloatArray
    slope: FloatArray


def node_radii_mm(first_mm: float, last_mm: float) -> tuple[FloatArray, float, float]:
    """(CELLS + 1,) radii of the nodes [mm], and A [1/mm²] and C of the coordinate."""
    start = CELLS * FIRST_PIECE * first_mm / (last_mm + first_mm * (1.0 - 2.0 * FIRST_PIECE))
    scale = CELLS * (CELLS + 2.0 * start) / (last_mm**2 - first_mm**2)
    x = np.arange(CELLS + 1) + start
    radii = np.sqrt(first_mm**2 + (x**2 - start**2) / scale)
    radii[0], radii[-1] = first_mm, last_mm
    return radii, scale, start


def radial_table(
    radius: FloatArray, height: FloatArray, slope: FloatArray, *, top_mm: float, lowest_mm: float
) -> RadialTable:
    """Lower the C1 cubic curve through knots with slopes.

    Parameters
    ----------
    radius, height, slope : (n,) rising radii, heights relative to the undisturbed top [mm], dh/dr [-]
    top_mm, lowest_mm : undisturbed top and lowest point of the tip above the bottom [mm]
    """
    curve = CubicHermiteSpline(radius, height, slope)
    nodes, scale, start = node_radii_mm(float(radius[0]), float(radius[-1]))
    per_piece = (np.arange(CELLS + 1) + start) / (scale * nodes)
    value, node_slope = curve(nodes), curve(nodes, 1)
    node_slope[0], node_slope[-1] = slope[0], 0.0
    rise, jump = node_slope * per_piece, np.diff(value)
    pieces = np.zeros((CELLS, PIECE_COLUMNS))
    pieces[:, 0], pieces[:, 1] = value[:-1] + top_mm, rise[:-1]
    pieces[:, 2], pieces[:, 3] = 3 * jump - 2 * rise[:-1] - rise[1:], rise[:-1] + rise[1:] - 2 * jump
    slopes = _slopes_within(pieces, nodes, scale, start)
    pieces[:, STEEP] = _outward_maximum(np.abs(slopes))
    pieces[:, FALL] = _outward_maximum(np.maximum(-slopes, 0.0))
    pieces[:, WINDOW] = np.maximum(NEAREST_WINDOW_MM, WINDOW_SHARE * nodes[:-1])
    holds = np.searchsorted(nodes, nodes[:-1] - pieces[:, WINDOW], side="right") - 1
    pieces[:, BEND] = _outward_maximum(_bends_within(pieces, nodes, scale, start))[np.maximum(holds, 0)]
    return RadialTable(
        pieces=pieces,
        reach2=_reach2(pieces, nodes, top_mm, lowest_mm),
        scale=scale,
        offset=start**2 - scale * float(nodes[0]) ** 2,
        start=start,
        radius=nodes,
        slope=node_slope,
    )


def lowest_of_pieces_mm(pieces: FloatArray) -> FloatArray:
    """(CELLS,) a height that each cubic does not fall below: its lowest Bernstein coefficient [mm]."""
    c0, c1, c2, c3 = pieces[:, :4].T
    return np.asarray(np.min([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3], axis=0))


def outward_cup(table: RadialTable) -> FloatArray:
    """(CELLS,) how fast the slope along a line rises, d²h/ds², at most from each piece outward: max(h'', h'/r, 0)
    [1/mm].
    """
    return _outward_maximum(_bends_within(-table.pieces, table.radius, table.scale, table.start))


def _samples(nodes: FloatArray, scale: float, start: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(SAMPLES,) fractions of a piece, and (CELLS, SAMPLES) x + C and radius there [mm]."""
    t = np.linspace(0.0, 1.0, SAMPLES)
    x = np.arange(CELLS)[:, None] + t + start
    return t, x, np.sqrt(np.maximum(nodes[0] ** 2 + (x**2 - start**2) / scale, nodes[0] ** 2))


def _slopes_within(pieces: FloatArray, nodes: FloatArray, scale: float, start: float) -> FloatArray:
    """(CELLS, SAMPLES) dh/dr at evenly spread places of every piece."""
    t, x, r = _samples(nodes, scale, start)
    gradient = pieces[:, 1:2] + 2 * pieces[:, 2:3] * t + 3 * pieces[:, 3:4] * t**2
    return np.asarray(gradient * scale * r / x)


def _bends_within(pieces: FloatArray, nodes: FloatArray, scale: float, start: float) -> FloatArray:
    """(CELLS, SAMPLES) bend at evenly spread places of every piece [1/mm]."""
    t, x, r = _samples(nodes, scale, start)
    turn = (pieces[:, 1:2] + 2 * pieces[:, 2:3] * t + 3 * pieces[:, 3:4] * t**2) * scale / x
    radial = turn + (2 * pieces[:, 2:3] + 6 * pieces[:, 3:4] * t - turn / scale) * (scale * r / x) ** 2
    return np.asarray(np.maximum(np.maximum(-radial, -turn), 0.0))


def _outward_maximum(values: FloatArray) -> FloatArray:
    """(CELLS,) largest value of this and all outer pieces, with a reserve."""
    worst = BOUND_RESERVE * values.max(axis=1)
    return np.asarray(np.maximum.accumulate(worst[::-1])[::-1])


def _reach2(pieces: FloatArray, nodes: FloatArray, top_mm: float, lowest_mm: float) -> FloatArray:
    """(LEVELS,) squared radius beyond which no piece comes below each level."""
    low = lowest_of_pieces_mm(pieces)
    levels = lowest_mm + (top_mm - lowest_mm) * np.arange(1, LEVELS + 1) / LEVELS
    below = low[None, :] < levels[:, None]
    last = np.where(below.any(axis=1), CELLS - np.argmax(below[:, ::-1], axis=1), 0)
    return np.asarray(nodes[last] ** 2)
