"""A pad, its workspace and its parts from above, as marks of a plot."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Patch, Polygon

from design.shape.cavity import CavityGeometry, PlacedPart
from design.shape.outline import Outline
from design.shape.plan import TURN_RAD, Plan, outline_mm

NAME_POINTS = 5
"""Distance of a part's name from its mark [points]."""


def outline_patch(plan: Plan, **look: Any) -> Patch:
    """A pad's outline."""
    return Polygon(outline_mm(plan), **look)


def workspace_patch(space: Outline, **look: Any) -> Patch:
    """The places that presses are judged at."""
    return Polygon(space.points(TURN_RAD), **look)


def clip_to_pad(artist: Any, ax: Any, cavity: CavityGeometry) -> None:
    """Leave of cells only what lies in the pad."""
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
