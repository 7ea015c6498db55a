"""A pad's outline in plan as points, the edge of its top, and lines from wall to wall; lengths in mm."""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from design.geometry.plan import Plan

ROUND_POINTS = 96
"""Corners that a round wall is drawn with: it stands out between two of them by 5e-4 of its radius."""
ALONG_POINTS = 16
"""Pieces that a straight wall under a curved edge is drawn in."""
FACET_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Places of a facet that its curved top edge is drawn through."""
APART_MM = 0.01
"""Corners nearer to each other are one."""
HALVINGS = 60


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of a pad in plan, counter-clockwise [mm]."""
    if not plan.is_disc:
        length, width = plan.length_mm, plan.width_mm
        return np.array([(0.0, 0.0), (length, 0.0), (length, width), (0.0, width)])
    return _around(plan, (0.0, 1.0))


def edge_mm(plan: Plan) -> FloatArray:
    """(n, 3) edge of the untouched top: corners in plan, more of them under a crown, and its height there [mm].

    Heights are not numbers where a crown is too tight for its pad.
    """
    corners = outline_mm(plan)
    if plan.crown is not None and plan.is_disc:
        corners = _around(plan, FACET_SHARES)
    elif plan.crown is not None:
        share = np.linspace(0.0, 1.0, ALONG_POINTS, endpoint=False)[:, None]
        corners = np.concatenate(
            [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        )
    return np.array([(x, y, plan.top_mm(float(x), float(y))) for x, y in corners])


def _around(plan: Plan, shares: tuple[float, ...]) -> FloatArray:
    """(n, 2) corners of a disc, counter-clockwise, with places at some shares of its facets [mm].

    Each is as far from the middle as the nearest wall in its direction.
    """
    facing = np.array([np.arctan2(*wall.outward[::-1]) for wall in plan.walls])
    stands = np.array([plan.stands_mm(wall) for wall in plan.walls])
    places = [wall.point(share * wall.length_mm) for wall in plan.walls for share in shares]
    away = np.array(places).reshape(-1, 2) - plan.centre_mm
    marked = np.arctan2(away[:, 1], away[:, 0]) % (2.0 * np.pi)
    even = np.linspace(0.0, 2.0 * np.pi, ROUND_POINTS, endpoint=False)
    beside = np.abs((even[:, None] - marked + np.pi) % (2.0 * np.pi) - np.pi).min(axis=1, initial=np.inf)
    turns = np.sort(np.concatenate([even[plan.radius_mm * beside > APART_MM], marked]))
    cosine = np.cos(turns[:, None] - facing)
    to_facet = np.where(cosine > 1e-9, stands / np.maximum(cosine, 1e-9), np.inf)
    reach = np.minimum(plan.radius_mm, to_facet.min(axis=1, initial=np.inf))
    ring = np.array(plan.centre_mm) + reach[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    return np.asarray(ring[np.hypot(*(ring - np.roll(ring, 1, axis=0)).T) > APART_MM])


def wall_reached_mm(
    plan: Plan, start_mm: tuple[float, float], direction: tuple[float, float]
) -> tuple[float, float]:
    """Where a line from a place in the pad meets its wall (x, y) [mm].

    Parameters
    ----------
    direction : unit vector
    """
    (x, y), (dx, dy) = start_mm, direction
    low, high = 0.0, 2.0 * plan.radius_mm
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if plan.contains(x + middle * dx, y + middle * dy):
            low = middle
        else:
            high = middle
    return x + low * dx, y + low * dy
