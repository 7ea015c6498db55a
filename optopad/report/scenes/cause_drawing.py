"""Why depth is not told, as a picture: the section through a pair under the press, and which of its light is missing.

The section runs along the chord of the cause's typical pair. Solid: the tip where the blind interval begins; dashed:
where it ends. Between them no reading changes enough. On a crowned pad the tip comes along the normal of the untouched
top at its place, and the section cuts it and the pressed top as they stand in space.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from design.arrays import FloatArray
from design.geometry.cavity import CavityGeometry, PlacedPart, cavity_of
from design.spec import SensorDesign
from optopad.report.scenes.layout_drawing import BLACK
from sims.contact.indentation import indent
from sims.contact.tip import tip_of
from sims.plots.shapes.pressed_top import CutPlane, cut_tip_mm, cut_top_mm, press_frame
from sims.plots.style import BLUE, GREEN, INK, MUTED, PALE_BLUE, VERMILLION, WIDTH_IN, axes_or_new
from sims.verdict.causes import GONE, WHOLE, Cause, Witness

SMALL = 7.5
WORDS = 0.3
"""Share of the section that words take."""
SHANK = 1.5
"""Height of the tip that is drawn [tip radii]."""


@dataclass(frozen=True, kw_only=True)
class _Cut:
    """A vertical plane along a pair's chord: length [mm], and where the press's axis is beside it.

    Attributes
    ----------
    direction : (x, y) unit vector of the chord, from emitter to receiver [-]
    along_mm, aside_mm : of the press's axis: along the chord from the emitter, and its distance from the plane
    """

    emitter: PlacedPart
    receiver: PlacedPart
    length_mm: float
    direction: tuple[float, float]
    along_mm: float
    aside_mm: float

    def plane(self, ceiling_mm: float) -> CutPlane:
        """The plane between the parts, up to a height [mm]."""
        return CutPlane(
            start_mm=self.emitter.position_mm[:2],
            direction=self.direction,
            reach_mm=(0.0, self.length_mm),
            ceiling_mm=ceiling_mm,
        )

    def sides(self, radius_mm: FloatArray, height_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where the plane cuts a body of revolution about the axis: along and height, from one end to the other."""
        is_cut = radius_mm >= self.aside_mm
        half = np.sqrt(np.maximum(radius_mm[is_cut] ** 2 - self.aside_mm**2, 0.0))
        along = np.concatenate([self.along_mm - half[::-1], self.along_mm + half])
        return along, np.concatenate([height_mm[is_cut][::-1], height_mm[is_cut]])


def plot_cause(design: SensorDesign, cause: Cause, ax: Axes | None = None) -> Axes | None:
    """The section of a cause's typical pair; None where no pair runs under the tip."""
    witness = cause.typical
    if witness is None:
        return None
    cavity = cavity_of(design)
    cut = _cut(cavity, witness.pair, cause.place_mm)
    tall = cavity.clear_mm + cavity.black_mm + 1.4 * design.indenter.tip_radius_mm
    ax = axes_or_new(ax, WIDTH_IN * min(max(tall / cut.length_mm, 0.3), 0.9) + 0.25)
    ax.set_aspect("equal")
    ax.set_axis_off()
    _draw_layers(ax, cavity, cut, _pressed_top(design, cavity, cut, cause))
    for depth_mm, is_first in zip(cause.depth_mm, (True, False), strict=True):
        _draw_tip(ax, design, cavity, cut, cause.place_mm, depth_mm, is_first=is_first)
    _draw_light(ax, cavity, cut, witness)
    margin = 0.06 * cut.length_mm
    ax.set_xlim(-margin, cut.length_mm + margin)
    ax.set_ylim(-cavity.black_mm, cavity.clear_mm + SHANK * design.indenter.tip_radius_mm)
    return ax


def _cut(cavity: CavityGeometry, pair: str, place_mm: tuple[float, float]) -> _Cut:
    emitter, receiver = next(
        both
        for both in product(cavity.emitters, cavity.receivers)
        if f"{both[0].name}-{both[1].name}" == pair
    )
    start, end = (np.array(part.position_mm[:2]) for part in (emitter, receiver))
    chord = end - start
    length = float(np.hypot(*chord))
    to_press = np.array(place_mm) - start
    return _Cut(
        emitter=emitter,
        receiver=receiver,
        length_mm=length,
        direction=(float(chord[0]) / length, float(chord[1]) / length),
        along_mm=float(to_press @ chord) / length,
        aside_mm=abs(float(chord[0] * to_press[1] - chord[1] * to_press[0])) / length,
    )


def _pressed_top(
    design: SensorDesign, cavity: CavityGeometry, cut: _Cut, cause: Cause
) -> list[tuple[float, float]]:
    """Places along the chord and heights of the top where the blind interval begins, from part to part [mm]."""
    depth_mm = cause.depth_mm[0]
    if not cavity.plan.top.is_flat:
        frame, press = press_frame(design, cause.place_mm), indent(design, depth_mm, cause.place_mm)
        line = cut_top_mm(frame, press, cut.plane(cavity.clear_mm + design.indenter.tip_radius_mm))
        return [(float(along), float(height)) for along, height in line]
    press = indent(design, depth_mm)
    along, height = cut.sides(press.radius_mm, cavity.clear_mm + press.height_mm)
    inside = (along >= 0.0) & (along <= cut.length_mm)
    along, height = (
        np.concatenate([[0.0], along[inside], [cut.length_mm]]),
        np.concatenate([[cavity.clear_mm], height[inside], [cavity.clear_mm]]),
    )
    return list(zip(along.tolist(), height.tolist(), strict=True))


def _draw_layers(ax: Axes, cavity: CavityGeometry, cut: _Cut, pressed_top: list[tuple[float, float]]) -> None:
    ax.add_patch(
        Rectangle((0.0, -cavity.black_mm), cut.length_mm, cavity.black_mm, facecolor=BLACK, linewidth=0)
    )
    if not cavity.plan.top.is_flat:
        untouched = cut.plane(cavity.clear_mm).untouched_mm(cavity.plan)
        ax.plot(*untouched.T, color=MUTED, linewidth=0.7, linestyle=(0, (1, 1.5)))
    outline = [(0.0, 0.0), *pressed_top, (cut.length_mm, 0.0)]
    ax.add_patch(Polygon(outline, facecolor=PALE_BLUE, edgecolor=INK, linewidth=0.8))
    for part, x, side, colour in (
        (cut.emitter, 0.0, "right", VERMILLION),
        (cut.receiver, cut.length_mm, "left", BLUE),
    ):
        low, high = part.height_mm - part.half_height_mm, part.height_mm + part.half_height_mm
        ax.plot((x, x), (low, min(high, part.clear_mm)), color=colour, linewidth=4.0, solid_capstyle="butt")
        shift = -0.015 if side == "right" else 0.015
        ax.text(
            x + shift * cut.length_mm,
            part.height_mm,
            part.name,
            ha=side,
            va="center",
            fontsize=SMALL,
            color=INK,
        )


def _draw_tip(
    ax: Axes,
    design: SensorDesign,
    cavity: CavityGeometry,
    cut: _Cut,
    place_mm: tuple[float, float],
    depth_mm: float,
    *,
    is_first: bool,
) -> None:
    scale = design.indenter.tip_radius_mm
    if not cavity.plan.top.is_flat:
        plane = cut.plane(cavity.clear_mm + SHANK * scale)
        along, height = cut_tip_mm(design, press_frame(design, place_mm), depth_mm, plane).T
    else:
        radius, tall = tip_of(design.indenter).points(np.linspace(0.0, 2.0 + SHANK + depth_mm / scale, 240))
        low = cavity.clear_mm - depth_mm
        keep = low + scale * tall <= cavity.clear_mm + SHANK * scale
        along, height = cut.sides(scale * radius[keep], low + scale * tall[keep])
    ax.plot(along, height, color=INK, linewidth=1.0, linestyle="-" if is_first else (0, (3, 2)))
    if is_first and len(along):
        ax.text(
            cut.along_mm,
            cavity.clear_mm + 0.75 * scale,
            "tip",
            ha="center",
            va="center",
            fontsize=SMALL,
            color=MUTED,
        )


def _mirror_place(cavity: CavityGeometry, cut: _Cut) -> tuple[float, float]:
    """Along the chord and in height, where the untouched top mirrors emitter to receiver within the section [mm]."""
    low, high = cut.emitter.height_mm, cut.receiver.height_mm
    below = cavity.clear_mm - low, cavity.clear_mm - high
    turn = cut.length_mm * below[0] / (below[0] + below[1]) if sum(below) > 0.0 else 0.5 * cut.length_mm
    if cavity.plan.top.is_flat:
        return turn, cavity.clear_mm
    along, height = cut.plane(cavity.clear_mm).untouched_mm(cavity.plan).T
    way = np.hypot(along, height - low) + np.hypot(cut.length_mm - along, height - high)
    level = np.flatnonzero(np.diff(np.sign(np.diff(way)))) + 1  # light goes where its way is stationary
    if not len(level):
        return turn, float(np.interp(turn, along, height))
    nearest = level[np.abs(along[level] - turn).argmin()]
    return float(along[nearest]), float(height[nearest])


def _over_words_mm(cavity: CavityGeometry, cut: _Cut) -> float:
    """Height of the untouched top where words stand over it, at the emitter's side [mm]."""
    if cavity.plan.top.is_flat:
        return cavity.clear_mm
    along, height = cut.plane(cavity.clear_mm).untouched_mm(cavity.plan).T
    return float(height[along <= WORDS * cut.length_mm].max())


def _draw_light(ax: Axes, cavity: CavityGeometry, cut: _Cut, witness: Witness) -> None:
    low, high = cut.emitter.height_mm, cut.receiver.height_mm
    turn, mirror = _mirror_place(cavity, cut)
    for words, share, path, colour in (
        ("straight", witness.straight, [(0.0, low), (cut.length_mm, high)], BLUE),
        (
            "mirrored",
            witness.mirrored,
            [(0.0, low), (turn, mirror), (cut.length_mm, high)],
            GREEN,
        ),
    ):
        x, z = zip(*path, strict=True)
        line = "-" if share >= WHOLE else ":" if share <= GONE else "--"
        ax.plot(x, z, color=colour, linewidth=1.4, linestyle=line)
        is_straight = words == "straight"
        at = 0.16 * cut.length_mm if is_straight else 0.02 * cut.length_mm
        level = float(np.interp(at, x, z)) if is_straight else _over_words_mm(cavity, cut)
        shift = 0.02 * cut.length_mm
        ax.text(
            at,
            level - shift if is_straight else level + shift,
            f"{words}: {max(share, 0.0):.0%} left",
            ha="left",
            va="top" if is_straight else "bottom",
            fontsize=SMALL,
            color=colour,
        )
