"""A pad and its workspace in plan: corners, patches for plots, and lines from wall to wall."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from design.arrays import FloatArray
from design.geometry.cavity import CavityGeometry, PlacedPart, Workspace
from design.geometry.plan import Plan

ROUND_POINTS = 96
"""Corners that a round wall is drawn with: it stands out between two of them by 5e-4 of its radius."""
ALONG_POINTS = 12
"""Pieces that a straight wall under a curved edge is drawn in."""
FACET_SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Places of a facet that its curved top edge is drawn through."""
APART_MM = 0.01
"""Corners nearer to the one before are left out."""
HALVINGS = 60
NAME_POINTS = 5
"""Distance of a part's name from its mark [points]."""


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of a pad in plan, counter-clockwise [mm]."""
    if not plan.is_disc:
        length, width = plan.length_mm, plan.width_mm
        return np.array([(0.0, 0.0), (length, 0.0), (length, width), (0.0, width)])
    return _around(plan, (0.0, 1.0))


def _around(plan: Plan, shares: tuple[float, ...]) -> FloatArray:
    """(n, 2) corners of a disc, counter-clockwise, with places at some shares of its facets [mm]."""
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND_POINTS, endpoint=False)
    centre = np.array(plan.centre_mm)
    ring = centre + plan.radius_mm * np.column_stack([np.cos(angle), np.sin(angle)])
    places = [wall.point(share * wall.length_mm) for wall in plan.walls for share in shares]
    both = np.array([*ring, *places])
    kept = both[[plan.contains(float(x), float(y)) for x, y in both]]
    away = kept - centre
    around = kept[np.argsort(np.arctan2(away[:, 1], away[:, 0]) % (2.0 * np.pi), kind="stable")]
    return np.asarray(around[np.hypot(*(around - np.roll(around, 1, axis=0)).T) > APART_MM])


def edge_mm(plan: Plan) -> FloatArray:
    """(n, 3) edge of the untouched top: corners in plan, more of them under a crown, and its height there [mm]."""
    corners = outline_mm(plan)
    if plan.crown is not None and plan.is_disc:
        corners = _around(plan, FACET_SHARES)
    elif plan.crown is not None:
        share = np.linspace(0.0, 1.0, ALONG_POINTS, endpoint=False)[:, None]
        corners = np.concatenate(
            [a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
        )
    return np.array([(x, y, plan.top_mm(float(x), float(y))) for x, y in corners])


def outline_patch(plan: Plan, **look: Any) -> Patch:
    """A pad's outline."""
    if plan.is_disc:
        return Polygon(outline_mm(plan), **look)
    return Rectangle((0.0, 0.0), plan.length_mm, plan.width_mm, **look)


def workspace_patch(space: Workspace, **look: Any) -> Patch:
    """The places that presses are judged at."""
    if space.is_disc:
        middle = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
        return Circle(middle, (space.x1_mm - space.x0_mm) / 2, **look)
    corner = space.x0_mm, space.y0_mm
    return Rectangle(corner, space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm, **look)


def clip_to_pad(artist: Any, ax: Any, cavity: CavityGeometry) -> None:
    """Leave of cells only what lies in a disc; those of a rectangle end at its walls."""
    if cavity.plan.is_disc:
        artist.set_clip_path(outline_patch(cavity.plan, transform=ax.transData))


def draw_part(ax: Axes, part: PlacedPart, colour: str, *, size: float, is_named: bool) -> None:
    """A part from above: an emitter as a dot, a receiver as an open square, its name outward of it.

    Parameters
    ----------
    size : of the mark [points]
    """
    x, y, _ = part.position_mm
    is_emitter = part.kind == "emitter"
    look: dict[str, Any] = {"markersize": size, "markeredgecolor": colour, "clip_on": False, "zorder": 5}
    ax.plot(
        x, y, marker="o" if is_emitter else "s", markerfacecolor=colour if is_emitter else "white", **look
    )
    if is_named:
        right, up = part.line.outward
        ax.annotate(
            part.name,
            (x, y),
            xytext=(NAME_POINTS * right, NAME_POINTS * up),
            textcoords="offset points",
            ha=("center", "left", "right")[round(right)],
            va=("center", "bottom", "top")[round(up)],
            fontsize=7,
            color=colour,
        )


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
