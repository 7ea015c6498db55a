"""The layout with its dimensions: the mold from above and in cross-section, at one scale.

The cross-section shows one emitter and one receiver at their heights, moved into its plane. The plane is
along x; under a crown that is straight along x, it is along y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from optopad.design.arrays import FloatArray
from optopad.design.mold.outline import MoldOutline, outline_of
from optopad.design.mold.sockets import Socket
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of
from optopad.design.shape.outline import X
from optopad.design.spec import SensorDesign
from optopad.sims.contact.tip import tip_points_mm
from optopad.sims.plots.maps import outline_patch, workspace_patch
from optopad.sims.plots.rays import BLACK
from optopad.sims.plots.style import BLUE, GRID, INK, MUTED, PALE_BLUE, VERMILLION, WIDTH_IN

SMALL, MEDIUM = 7.0, 8.5
LINE: dict[str, Any] = {"color": MUTED, "linewidth": 0.7, "solid_capstyle": "butt"}
MOST_NUMBERS = 40
"""Largest number of parts whose positions along the wall are labelled; more labels would overlap."""

DIAMETER = "\N{LATIN CAPITAL LETTER O WITH STROKE}"
DIMENSION_GAPS = (0.48, 0.80), (0.55, 0.84)
"""Distances of the dimension lines from the mold, as shares of the free space: (cavity, outside) along x, then y."""
CROWN_POINTS = 81
BOARD, BOARD_MM = "#3f7d55", 1.6
"""Colour and usual thickness of a circuit board."""
STANDS_SHARE = 0.24
"""Distance of a part on the floor from the middle of the cross-section, as a share of its length."""
ROUND_GAP = 2.8
"""Factor by which a part's name is farther from the part on a round wall, where it is centred, than on a straight one.
"""
LEVEL = 0.2
"""Sine of the angle below which a direction counts as horizontal or vertical when a label is aligned next to it."""
NEAR_CORNER = 0.12
"""Distance from a corner, as a share of the wall's length, within which a part's name is aligned towards the middle."""


def plot_layout(design: SensorDesign) -> Axes:
    """Draw plan and cross-section of a design; returns the plan's axes."""
    cavity, outline = cavity_of(design), outline_of(design)
    room = 0.21 * max(outline.outer_length_mm, outline.outer_width_mm)
    across = outline.outer_length_mm + 2 * room
    over_rim = max(cavity.clear_mm - outline.top_mm, 0.0)
    board = BOARD_MM if outline.is_frame else 0.0
    heights = (
        outline.outer_width_mm + 1.67 * room,
        outline.height_mm + board + over_rim + design.indenter.tip_radius_mm + 1.1 * room,
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
    ceiling = outline.top_mm + over_rim + design.indenter.tip_radius_mm + 0.6 * room
    cut.set_ylim(outline.bottom_mm - board - 0.5 * room, ceiling)
    section = _section_of(cavity, outline)
    if section.is_across:
        shift = (cavity.length_mm - cavity.width_mm) / 2
        cut.set_xlim(*(end - shift for end in cut.get_xlim()))
    _draw_plan(plan, design, cavity, outline, room)
    _draw_section(cut, design, section, room)
    return plan


def _draw_plan(
    ax: Axes, design: SensorDesign, cavity: CavityGeometry, outline: MoldOutline, room: float
) -> None:
    left, low, right, high = outline.outer.box_mm
    ax.add_patch(workspace_patch(outline.outer, facecolor=GRID, edgecolor=INK, linewidth=1.0))
    ax.add_patch(outline_patch(cavity.plan, facecolor=PALE_BLUE, edgecolor=INK, linewidth=1.0))
    for hole in outline.fixing_holes:
        ax.add_patch(Circle((hole.x, hole.y), hole.radius, fill=False, edgecolor=MUTED, linewidth=0.7))
    for hole in outline.filling:
        ax.add_patch(
            Circle((hole.x, hole.y), hole.radius, fill=False, edgecolor=MUTED, linestyle=(0, (1, 1)))
        )
    space = cavity.workspace
    ax.add_patch(workspace_patch(space, fill=False, edgecolor=MUTED, linewidth=0.8, linestyle=(0, (4, 3))))
    middle = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
    radius = design.indenter.tip_radius_mm
    ax.add_patch(Circle(middle, radius, fill=False, edgecolor=INK, linewidth=0.8))
    tip, title = f"tip R{radius:g}", "from above"
    if cavity.on_floor:  # parts fill the middle of the pad
        title += f"; circle: {tip}"
    else:
        ax.text(middle[0], middle[1] - 1.15 * radius, tip, ha="center", va="top", fontsize=SMALL, color=INK)
    for part in cavity.parts:
        _draw_part(ax, part)
        if len(cavity.parts) <= MOST_NUMBERS:
            _write_name(ax, part, cavity)
    for socket in outline.sockets if len(cavity.parts) <= MOST_NUMBERS else ():
        _write_place(ax, socket, cavity)
    inner, outer = cavity.plan.outline.bare, outline.outer
    for inside, outside, gaps in zip(inner.dimensions, outer.dimensions, DIMENSION_GAPS, strict=False):
        for words, of, one, gap in zip(
            ("cavity", "outside"), (inner, outer), (inside, outside), gaps, strict=True
        ):
            told = f"{words} {DIAMETER if one.is_diameter else ''}{one.size_mm:g}"
            x, y = np.min(of.touches_mm(one.direction), axis=0)
            if one.direction == X:
                _across(ax, of.x0_mm, of.x1_mm, low - gap * room, told, from_mm=y)
            else:
                _upright(ax, of.y0_mm, of.y1_mm, left - gap * room, told, from_mm=x)
    ax.text((left + right) / 2, high + 0.5 * room, title, **_title())


def _draw_part(ax: Axes, part: PlacedPart) -> None:
    x, y, _ = part.position_mm
    colour = VERMILLION if part.kind == "emitter" else BLUE
    ax.add_patch(_body(part, facecolor=colour, alpha=0.25, edgecolor=colour, linewidth=0.7))
    marker = "o" if part.kind == "emitter" else "s"
    ax.plot(x, y, marker=marker, markersize=3.5, color=colour, markeredgecolor="white", markeredgewidth=0.5)


def _write_name(ax: Axes, part: PlacedPart, cavity: CavityGeometry) -> None:
    x, y, _ = part.position_mm
    right, up = part.line.outward
    gap = 0.02 * max(cavity.length_mm, cavity.width_mm)
    if part.is_on_floor:
        ax.text(x, y + gap, part.name, ha="center", va="bottom", fontsize=SMALL, color=INK)
        return
    aside, level = "center", "center"
    if part.angle_deg is not None:
        gap *= ROUND_GAP
    else:  # near a corner: clear of the other wall's names
        aside, share = {"west": "left", "east": "right"}.get(part.wall, "center"), y / cavity.width_mm
        level = "bottom" if share <= NEAR_CORNER else "top" if share >= 1.0 - NEAR_CORNER else "center"
    look: dict[str, Any] = {"ha": aside, "va": level, "fontsize": SMALL, "color": INK}
    ax.text(x - right * gap, y - up * gap, part.name, **look)


def _body(part: PlacedPart, **look: Any) -> Patch:
    return Polygon(part.footprint_mm, **look)


def _write_place(ax: Axes, socket: Socket, cavity: CavityGeometry) -> None:
    """Write a part's position along its wall next to the mold; on a round wall, write its direction instead."""
    part, wall = socket.part, socket.frame.thickness_mm
    x, y, _ = part.position_mm
    right, up = part.line.outward
    words = (
        f"{round(part.along_mm, 2):g}"
        if part.angle_deg is None
        else f"{round(part.angle_deg % 360.0, 2):g}\N{DEGREE SIGN}"
    )
    aside = "center" if abs(right) < LEVEL else "left" if right > 0 else "right"
    level = "center" if abs(up) < LEVEL else "bottom" if up > 0 else "top"
    tick = 0.012 * max(cavity.length_mm, cavity.width_mm)
    out = [(wall + share * tick) for share in (0.0, 1.0, 1.6)]
    ax.plot((x + right * out[0], x + right * out[1]), (y + up * out[0], y + up * out[1]), **LINE)
    place = x + right * out[2], y + up * out[2]
    ax.text(*place, words, ha=aside, va=level, fontsize=SMALL, color=MUTED)


@dataclass(frozen=True, kw_only=True)
class _Section:
    """A vertical plane through the middle of the mold.

    Attributes
    ----------
    is_across : whether the plane is along y
    start_mm, end_mm : positions of the faces of an emitter and of a receiver, rotated into the plane
    length_mm, wall_mm : inner length of the cavity, and thickness of the mold's wall
    """

    cavity: CavityGeometry
    outline: MoldOutline
    is_across: bool
    start_mm: float
    end_mm: float
    length_mm: float
    wall_mm: float

    def top_mm(self) -> FloatArray:
        """(n, 2) position in the plane and height of points of the untouched top [mm]."""
        plan = self.cavity.plan
        along = np.linspace(self.start_mm, self.end_mm, 2 if plan.top.is_flat else CROWN_POINTS)
        x, y = plan.centre_mm
        places = [(x, float(t)) if self.is_across else (float(t), y) for t in along]
        return np.column_stack([along, [plan.top_mm(*place) for place in places]])


def _section_of(cavity: CavityGeometry, outline: MoldOutline) -> _Section:
    plan = cavity.plan
    is_across = plan.top.straight == "x"
    length = cavity.width_mm if is_across else cavity.length_mm
    start, inset = (
        0.0 if row[0].is_on_floor else float(plan.outline.bare.gap_mm(*row[0].position_mm[:2])) + 0.0
        for row in (cavity.emitters, cavity.receivers)
    )
    return _Section(
        cavity=cavity,
        outline=outline,
        is_across=is_across,
        start_mm=start,
        end_mm=length - inset,
        length_mm=length,
        wall_mm=outline.wall_y_mm if is_across else outline.wall_x_mm,
    )


def _draw_section(ax: Axes, design: SensorDesign, section: _Section, room: float) -> None:
    cavity, outline = section.cavity, section.outline
    start, end = section.start_mm, section.end_mm
    left, right = -section.wall_mm, section.length_mm + section.wall_mm
    low, high, lip = outline.bottom_mm, outline.top_mm, outline.lip_mm
    shell = [
        (left, low),
        (right, low),
        (right, high),
        (end + lip, high),
        (end, high - lip),
        (end, -cavity.black_mm),
        (start, -cavity.black_mm),
        (start, high - lip),
        (start - lip, high),
        (left, high),
    ]
    ax.add_patch(Polygon(shell, facecolor=GRID, edgecolor=INK, linewidth=1.0))
    ax.add_patch(
        Rectangle((start, -cavity.black_mm), end - start, cavity.black_mm, facecolor=BLACK, linewidth=0)
    )
    look: dict[str, Any] = {"facecolor": PALE_BLUE, "edgecolor": INK, "linewidth": 0.7}
    top = section.top_mm()
    ax.add_patch(
        Rectangle((start, 0), end - start, cavity.clear_mm, **look)
        if cavity.plan.top.is_flat
        else Polygon([(start, 0.0), *top, (end, 0.0)], **look)
    )
    _draw_tip(ax, design, cavity, section.length_mm / 2)
    below = BOARD_MM if outline.is_frame else 0.0
    if outline.is_frame:
        board = (left, low - BOARD_MM), right - left, BOARD_MM
        ax.add_patch(Rectangle(*board, facecolor=BOARD, edgecolor=INK, linewidth=0.7))
    for part, side in ((cavity.emitters[0], -1), (cavity.receivers[0], 1)):
        at_share = 0.5 + side * STANDS_SHARE
        if part.is_on_floor:
            _draw_standing(ax, part, at_share * section.length_mm)
        else:
            _draw_body(ax, part, start if side < 0 else end, side)
            _heights(ax, part, (0.10 if side < 0 else 0.62) * section.length_mm)
    first, second = right + 0.30 * room, right + 0.72 * room
    apex = end if cavity.plan.top.is_flat else section.length_mm / 2
    _upright(ax, 0.0, cavity.clear_mm, first, f"clear {cavity.clear_mm:g}", from_mm=apex)
    mold = "frame" if outline.is_frame else "mold"
    _upright(ax, low, high, second, f"{mold} {outline.height_mm:.4g}", from_mm=right)
    fill, beside = outline.fill_mm, left - 0.30 * room
    if not cavity.plan.top.is_flat:
        edge_low, edge_high = (f"{edge:.3g}" for edge in cavity.plan.rim_mm)
        words = f"edge {edge_high}" if edge_low == edge_high else f"edge {edge_low} to {edge_high}"
        _upright(ax, 0.0, float(top[0, 1]), beside, words, from_mm=start)
    if cavity.plan.top.is_flat or high > fill:
        _upright(ax, fill, high, beside, f"rim {high - fill:.3g}", from_mm=left)
    if cavity.black_mm > 0:
        place = section.length_mm / 2, -cavity.black_mm - below - 0.05 * room
        words = f"black {cavity.black_mm:g}{', on the circuit board' if outline.is_frame else ''}"
        ax.text(*place, words, ha="center", va="top", fontsize=SMALL, color=INK)
    ax.text(
        (left + right) / 2,
        low - 0.35 * room - below,
        f"cut open{' across' if section.is_across else ''}, one part of each kind "
        + ("moved into the cut" if outline.is_frame else "rotated into the cut"),
        **_title(),
    )


def _draw_tip(ax: Axes, design: SensorDesign, cavity: CavityGeometry, middle: float) -> None:
    side = tip_points_mm(design.indenter, 2.0, 80)
    side = side[side[:, 1] <= 1.25 * design.indenter.tip_radius_mm]
    outline = np.concatenate([side[::-1] * (-1.0, 1.0), side]) + np.array([middle, cavity.clear_mm])
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


def _draw_standing(ax: Axes, part: PlacedPart, at_mm: float) -> None:
    """A part on the floor, cut along the direction in which it looks or is turned, with the height of its face."""
    colour = VERMILLION if part.kind == "emitter" else BLUE
    way = -np.array(part.line.outward)
    body, face = part.body_mm, part.face_mm
    along = at_mm + (body[:, :2] - part.position_mm[:2]) @ way
    sides = [0, 3, 7, 4]  # of the same side: behind below, behind above, front above, front below
    ax.add_patch(
        Polygon(
            np.column_stack([along, body[:, 2]])[sides],
            facecolor="white",
            edgecolor=colour,
            linewidth=0.9,
        )
    )
    across = at_mm + (face[[0, 2], :2] - part.position_mm[:2]) @ way
    ax.plot(across, face[[0, 2], 2], color=colour, linewidth=3.0, solid_capstyle="butt")
    words = f"{part.kind} {part.height_mm:.4g}"
    level = float(body[:, 2].max()) + 0.3
    ax.text(at_mm, level, words, ha="center", va="bottom", fontsize=SMALL, color=colour)


def _heights(ax: Axes, part: PlacedPart, at_mm: float) -> None:
    colour = VERMILLION if part.kind == "emitter" else BLUE
    _arrow(ax, (at_mm, 0.0), (at_mm, part.height_mm), colour)
    words = f" {part.kind} {part.height_mm:.4g}"
    ax.text(at_mm, part.height_mm / 2, words, ha="left", va="center", fontsize=SMALL, color=colour)


def _across(ax: Axes, start: float, end: float, y: float, words: str, *, from_mm: float) -> None:
    _arrow(ax, (start, y), (end, y))
    for x in (start, end):
        ax.plot((x, x), (from_mm, y), **LINE)
    ax.text((start + end) / 2, y, words, ha="center", va="center", fontsize=MEDIUM, color=INK, bbox=_ground())


def _upright(ax: Axes, low: float, high: float, x: float, words: str, *, from_mm: float) -> None:
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
