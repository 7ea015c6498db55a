"""The layout with its dimensions: the mold from above, and cut open, to one scale.

Kinds of parts that stand at several heights are shown once each; in the section they are turned into its plane.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from design.geometry.cavity import CavityGeometry, PlacedPart, cavity_of
from design.geometry.mold_outline import MoldOutline, outline_of
from design.spec import SensorDesign
from sims.contact.tip import tip_of
from sims.plots.style import BLUE, GRID, INK, MUTED, PALE_BLUE, VERMILLION, WIDTH_IN

BLACK = "#33383f"
"""Colour of the black layer."""
OUTWARD = {"south": (0.0, -1.0), "east": (1.0, 0.0), "north": (0.0, 1.0), "west": (-1.0, 0.0)}
SMALL, MEDIUM = 7.0, 8.5
LINE: dict[str, Any] = {"color": MUTED, "linewidth": 0.7, "solid_capstyle": "butt"}
MOST_NUMBERS = 40
"""Parts with their places along the wall written beside them; more would overlap."""

NEAR_CORNER = 0.12
"""Share of a wall within which a part's name goes towards the wall's middle."""


def plot_layout(design: SensorDesign) -> Axes:
    """Plan and section of a design; the plan's axes."""
    cavity, outline = cavity_of(design), outline_of(design)
    room = 0.21 * max(outline.outer_length_mm, outline.outer_width_mm)
    across = outline.outer_length_mm + 2 * room
    heights = (
        outline.outer_width_mm + 1.67 * room,
        outline.height_mm + design.indenter.tip_radius_mm + 1.1 * room,
    )
    figure = Figure(figsize=(WIDTH_IN, WIDTH_IN * sum(heights) / across))
    total = sum(heights)
    plan = figure.add_axes((0.0, heights[1] / total, 1.0, heights[0] / total))
    cut = figure.add_axes((0.0, 0.0, 1.0, heights[1] / total))
    for ax in (plan, cut):
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set_xlim(-outline.wall_x_mm - room, cavity.length_mm + outline.wall_x_mm + room)
    plan.set_ylim(-outline.wall_y_mm - 0.95 * room, cavity.width_mm + outline.wall_y_mm + 0.72 * room)
    cut.set_ylim(outline.bottom_mm - 0.5 * room, outline.top_mm + design.indenter.tip_radius_mm + 0.6 * room)
    _draw_plan(plan, design, cavity, outline, room)
    _draw_section(cut, design, cavity, outline, room)
    return plan


def _draw_plan(
    ax: Axes, design: SensorDesign, cavity: CavityGeometry, outline: MoldOutline, room: float
) -> None:
    left, low = -outline.wall_x_mm, -outline.wall_y_mm
    size = outline.outer_length_mm, outline.outer_width_mm
    ax.add_patch(Rectangle((left, low), *size, facecolor=GRID, edgecolor=INK, linewidth=1.0))
    ax.add_patch(
        Rectangle(
            (0, 0), cavity.length_mm, cavity.width_mm, facecolor=PALE_BLUE, edgecolor=INK, linewidth=1.0
        )
    )
    for hole in outline.fixing_holes:
        ax.add_patch(Circle((hole.x, hole.y), hole.radius, fill=False, edgecolor=MUTED, linewidth=0.7))
    space = cavity.workspace
    inner = Rectangle(
        (space.x0_mm, space.y0_mm),
        space.x1_mm - space.x0_mm,
        space.y1_mm - space.y0_mm,
        fill=False,
        edgecolor=MUTED,
        linewidth=0.8,
        linestyle=(0, (4, 3)),
    )
    ax.add_patch(inner)
    middle = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
    radius = design.indenter.tip_radius_mm
    ax.add_patch(Circle(middle, radius, fill=False, edgecolor=INK, linewidth=0.8))
    below = middle[0], middle[1] - 1.15 * radius
    ax.text(*below, f"tip R{radius:g}", ha="center", va="top", fontsize=SMALL, color=INK)
    for part in cavity.parts:
        _draw_part(ax, part, cavity, outline, written=len(cavity.parts) <= MOST_NUMBERS)
    _across(ax, 0.0, cavity.length_mm, low - 0.48 * room, f"cavity {cavity.length_mm:g}", from_mm=0.0)
    _across(ax, left, left + size[0], low - 0.80 * room, f"outside {size[0]:g}", from_mm=low)
    _upright(ax, 0.0, cavity.width_mm, left - 0.55 * room, f"cavity {cavity.width_mm:g}", from_mm=0.0)
    _upright(ax, low, low + size[1], left - 0.84 * room, f"outside {size[1]:g}", from_mm=left)
    ax.text(left + size[0] / 2, low + size[1] + 0.5 * room, "from above", **_title())


def _draw_part(
    ax: Axes, part: PlacedPart, cavity: CavityGeometry, outline: MoldOutline, *, written: bool
) -> None:
    x, y, _ = part.position_mm
    right, up = OUTWARD[part.wall]
    wide, deep = part.part.body_width_mm.value, part.part.body_depth_mm.value
    size = (wide, deep) if part.wall in ("south", "north") else (deep, wide)
    corner = x + right * deep / 2 - size[0] / 2, y + up * deep / 2 - size[1] / 2
    colour = VERMILLION if part.kind == "emitter" else BLUE
    ax.add_patch(Rectangle(corner, *size, facecolor=colour, alpha=0.25, edgecolor=colour, linewidth=0.7))
    marker = "o" if part.kind == "emitter" else "s"
    ax.plot(x, y, marker=marker, markersize=3.5, color=colour, markeredgecolor="white", markeredgewidth=0.5)
    if not written:
        return
    gap = 0.02 * max(cavity.length_mm, cavity.width_mm)
    aside = {"west": "left", "east": "right"}.get(part.wall, "center")
    share = y / cavity.width_mm  # beside a corner, out of the way of the other wall's names
    level = "bottom" if share <= NEAR_CORNER else "top" if share >= 1.0 - NEAR_CORNER else "center"
    look: dict[str, Any] = {"ha": aside, "va": level, "fontsize": SMALL, "color": INK}
    ax.text(x - right * gap, y - up * gap, part.name, **look)
    _write_place(ax, part, cavity, outline)


def _write_place(ax: Axes, part: PlacedPart, cavity: CavityGeometry, outline: MoldOutline) -> None:
    """How far along its wall a part is, outside the mold."""
    x, y, _ = part.position_mm
    right, up = OUTWARD[part.wall]
    wall = outline.wall_y_mm if part.wall in ("south", "north") else outline.wall_x_mm
    tick = 0.012 * max(cavity.length_mm, cavity.width_mm)
    out = [(wall + share * tick) for share in (0.0, 1.0, 1.6)]
    ax.plot((x + right * out[0], x + right * out[1]), (y + up * out[0], y + up * out[1]), **LINE)
    ax.text(
        x + right * out[2],
        y + up * out[2],
        f"{round(part.along_mm, 2):g}",
        ha={"west": "right", "east": "left"}.get(part.wall, "center"),
        va={"south": "top", "north": "bottom"}.get(part.wall, "center"),
        fontsize=SMALL,
        color=MUTED,
    )


def _draw_section(
    ax: Axes, design: SensorDesign, cavity: CavityGeometry, outline: MoldOutline, room: float
) -> None:
    length, left = cavity.length_mm, -outline.wall_x_mm
    right, low, high = length + outline.wall_x_mm, outline.bottom_mm, outline.top_mm
    lip = outline.lip_mm
    shell = [
        (left, low),
        (right, low),
        (right, high),
        (length + lip, high),
        (length, high - lip),
        (length, -cavity.black_mm),
        (0.0, -cavity.black_mm),
        (0.0, high - lip),
        (-lip, high),
        (left, high),
    ]
    ax.add_patch(Polygon(shell, facecolor=GRID, edgecolor=INK, linewidth=1.0))
    ax.add_patch(Rectangle((0, -cavity.black_mm), length, cavity.black_mm, facecolor=BLACK, linewidth=0))
    ax.add_patch(
        Rectangle((0, 0), length, cavity.clear_mm, facecolor=PALE_BLUE, edgecolor=INK, linewidth=0.7)
    )
    _draw_tip(ax, design, cavity)
    for part, side in ((cavity.emitters[0], -1), (cavity.receivers[0], 1)):
        _draw_body(ax, part, 0.0 if side < 0 else length, side)
    _heights(ax, cavity.emitters[0], 0.10 * length, VERMILLION)
    _heights(ax, cavity.receivers[0], 0.62 * length, BLUE)
    first, second = right + 0.30 * room, right + 0.72 * room
    _upright(ax, 0.0, cavity.clear_mm, first, f"clear {cavity.clear_mm:g}", from_mm=length)
    _upright(ax, low, high, second, f"mold {outline.height_mm:.4g}", from_mm=right)
    _upright(ax, cavity.clear_mm, high, left - 0.30 * room, f"rim {high - cavity.clear_mm:.3g}", from_mm=left)
    if cavity.black_mm > 0:
        below = length / 2, -cavity.black_mm - 0.05 * room
        ax.text(*below, f"black {cavity.black_mm:g}", ha="center", va="top", fontsize=SMALL, color=INK)
    ax.text(
        (left + right) / 2,
        low - 0.35 * room,
        "cut open, one part of each kind turned into the cut",
        **_title(),
    )


def _draw_tip(ax: Axes, design: SensorDesign, cavity: CavityGeometry) -> None:
    """The tip as it touches the undisturbed top."""
    radius, tall = tip_of(design.indenter).points(np.linspace(0.0, 2.0, 80))
    scale, middle = design.indenter.tip_radius_mm, cavity.length_mm / 2
    top = cavity.clear_mm + 1.25 * scale
    keep = cavity.clear_mm + scale * tall <= top
    side = np.column_stack([radius[keep] * scale, cavity.clear_mm + scale * tall[keep]])
    outline = np.concatenate([side[::-1] * (-1.0, 1.0), side]) + np.array([middle, 0.0])
    ax.add_patch(Polygon(outline, closed=False, fill=False, edgecolor=INK, linewidth=0.9))


def _draw_body(ax: Axes, part: PlacedPart, wall_x: float, side: int) -> None:
    deep = part.part.body_depth_mm.value
    colour = VERMILLION if part.kind == "emitter" else BLUE
    base, tall = part.body_base_mm, part.part.body_height_mm.value
    corner = wall_x if side > 0 else wall_x - deep
    ax.add_patch(
        Rectangle((corner, base), deep, tall, facecolor=colour, alpha=0.3, edgecolor=colour, linewidth=0.8)
    )
    low, high = part.height_mm - part.half_height_mm, part.height_mm + part.half_height_mm
    ax.plot((wall_x, wall_x), (low, high), color=colour, linewidth=3.0, solid_capstyle="butt")


def _heights(ax: Axes, part: PlacedPart, at_mm: float, colour: str) -> None:
    """How high the middle of a part's active area is above the clear layer's bottom."""
    _arrow(ax, (at_mm, 0.0), (at_mm, part.height_mm), colour)
    words = f" {part.kind} {part.height_mm:.4g}"
    ax.text(at_mm, part.height_mm / 2, words, ha="left", va="center", fontsize=SMALL, color=colour)


def _across(ax: Axes, start: float, end: float, y: float, words: str, *, from_mm: float) -> None:
    """A dimension along x, with lines up to what it measures."""
    _arrow(ax, (start, y), (end, y))
    for x in (start, end):
        ax.plot((x, x), (from_mm, y), **LINE)
    ax.text((start + end) / 2, y, words, ha="center", va="center", fontsize=MEDIUM, color=INK, bbox=_ground())


def _upright(ax: Axes, low: float, high: float, x: float, words: str, *, from_mm: float) -> None:
    """A dimension along y, with lines to what it measures."""
    _arrow(ax, (x, low), (x, high))
    for y in (low, high):
        ax.plot((from_mm, x), (y, y), **LINE)
    short = high - low < 4.5
    ax.text(
        x,
        high + 0.3 if short else (low + high) / 2,
        words,
        ha="center",
        va="bottom" if short else "center",
        rotation=0 if short else 90,
        fontsize=SMALL if short else MEDIUM,
        color=INK,
        bbox=None if short else _ground(),
    )


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = MUTED) -> None:
    look = {"arrowstyle": "<->", "color": colour, "linewidth": 0.8, "mutation_scale": 6}
    ax.annotate("", start, end, arrowprops={**look, "shrinkA": 0, "shrinkB": 0})


def _ground() -> dict[str, Any]:
    return {"facecolor": "#ffffff", "linewidth": 0, "pad": 0.8}


def _title() -> dict[str, Any]:
    return {"ha": "center", "va": "center", "fontsize": MEDIUM, "color": MUTED}
