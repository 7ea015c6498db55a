"""The tip as convex bodies for MuJoCo, which takes a mesh to be its convex hull.

An outline whose slope only grows is one convex body of revolution. Another one is cut where its slope
falls; each part is a body by itself, whose hull lies inside the tip because heights never fall outward
(the hull closes the hole of a ring with a disc, which lies above the outline further in). A part is
prolonged straight beyond its end as far as that stays inside the tip, so that no side of a part lies
near the tip's surface, where the solver could take it for the way out of an overlap.

Arcs become points, with a sagitta of 1e-6 tip radii: coarser ones (1e-4) made contact chatter, these do
not. Around the axis, points are dense over the wedge and sparse elsewhere.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from design.arrays import FloatArray
from sims.contact.tip import TipOutline

SAGITTA = 1e-6
"""How far an arc's chord may lie inside the arc [tip radii]."""
TOP_HEIGHT = 6.0
"""Height of the shank above the outline [tip radii]; more than the deepest press."""
DENSE_HALF_ANGLE = 0.06
"""Half of the sector in which meridians are dense [rad]; the wedge has 0.05."""
DENSE_COUNT, SPARSE_COUNT = 5, 12
"""Meridians in that sector and in the rest of the turn; a facet's middle is on a dense one."""
_SLOPE_NOISE = 1e-9


def tip_hulls(tip: TipOutline) -> list[FloatArray]:
    """(vertex, 3) points of each convex body, height above the apex; lengths in tip radii."""
    outline = outline_points(tip)
    top = float(outline[-1, 1]) + TOP_HEIGHT
    return [_revolved(_prolonged(chain, outline), top) for chain in convex_chains(outline)]


def outline_points(tip: TipOutline) -> FloatArray:
    """(n, 2) radius and height of points of the outline, from the apex to the shank."""
    found = [np.zeros((1, 2))]
    for start, length, (first, last), row in zip(
        tip.starts[:-1], tip.lengths[:-1], tip.angles[:-1], tip.rows, strict=True
    ):
        step = np.sqrt(8.0 * SAGITTA / row[6]) if row[6] > 0.0 else np.inf
        count = max(1, int(np.ceil((last - first) / step)))
        along = start + length * np.arange(1, count + 1) / count
        found.append(np.stack(tip.points(along[:-1]), axis=1))
        found.append(np.array([[row[2], row[3]]]))
    return np.concatenate(found)


def convex_chains(outline: FloatArray) -> list[FloatArray]:
    """The outline cut where its slope falls: runs of points (n, 2) that share their ends."""
    step = np.diff(outline, axis=0)
    angle = np.arctan2(step[:, 1], step[:, 0])
    cuts = np.flatnonzero(np.diff(angle) < -_SLOPE_NOISE) + 1
    ends = [0, *cuts.tolist(), len(outline) - 1]
    return [outline[first : last + 1] for first, last in pairwise(ends)]


def _prolonged(chain: FloatArray, outline: FloatArray) -> FloatArray:
    """The chain with its last line prolonged while that stays above the outline."""
    (r0, h0), (r1, h1) = chain[-2], chain[-1]
    beyond = outline[outline[:, 0] > r1 + 1e-12]
    if len(beyond) == 0 or r1 - r0 < 1e-12:
        return chain
    above = h1 + (h1 - h0) / (r1 - r0) * (beyond[:, 0] - r1) - beyond[:, 1]
    count = int(np.argmax(above < 0.0)) if (above < 0.0).any() else len(beyond)
    if count == 0:
        return chain
    reach = beyond[count - 1, 0]
    return np.concatenate([chain, [[reach, h1 + (h1 - h0) / (r1 - r0) * (reach - r1)]]])


def _revolved(chain: FloatArray, top: float) -> FloatArray:
    """(vertex, 3) points of a chain, closed upward to a height, on all meridians."""
    sparse = np.linspace(DENSE_HALF_ANGLE, 2.0 * np.pi - DENSE_HALF_ANGLE, SPARSE_COUNT + 2)[1:-1]
    angle = np.concatenate([np.linspace(-DENSE_HALF_ANGLE, DENSE_HALF_ANGLE, DENSE_COUNT), sparse])
    rim = np.array([[chain[-1, 0], max(top, float(chain[-1, 1]) + 1.0)]])
    profile = np.concatenate([chain, rim])
    on_axis = profile[profile[:, 0] <= 1e-12]
    rings = profile[profile[:, 0] > 1e-12]
    radius, height = rings[:, 0, None], rings[:, 1, None]
    points = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), height + np.zeros_like(angle)], axis=-1
    ).reshape(-1, 3)
    return np.concatenate([np.stack([on_axis[:, 0], on_axis[:, 0], on_axis[:, 1]], axis=1), points])
