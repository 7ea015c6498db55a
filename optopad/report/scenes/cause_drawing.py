"""The cause of unresolved depth as a picture: a cross-section through a pair under the press, with its remaining light.

The cross-section runs along the chord of the cause's typical pair. The hatched tip is at the depth where the
unresolved interval begins, the dashed tip where it ends. Between these depths no reading changes enough.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from matplotlib.axes import Axes

from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import indent
from optopad.sims.plots.contact import cut_tip_mm, press_frame
from optopad.sims.plots.rays import Cut, ceiling_mm, cut_of_pair, draw_cut_faces, draw_cut_pad
from optopad.sims.plots.style import BLUE, GREEN, INK, WIDTH_IN, axes_or_new
from optopad.sims.verdict.causes import GONE, WHOLE, Cause, Witness

SMALL = 7.5
WORDS = 0.3
"""Length that the labels take, as a share of the cross-section's length [-]."""


def plot_cause(design: SensorDesign, cause: Cause, ax: Axes | None = None) -> Axes | None:
    """Draw the cross-section along a cause's typical pair; returns None if no pair runs under the tip."""
    witness = cause.typical
    if witness is None:
        return None
    cavity = cavity_of(design)
    emitter, receiver, cut = _chord(cavity, witness.pair)
    tall = ceiling_mm(design) + cavity.black_mm
    ax = axes_or_new(ax, WIDTH_IN * min(max(tall / cut.length_mm, 0.3), 0.9) + 0.25)
    begin_mm, end_mm = cause.depth_mm
    press = indent(design, begin_mm, cause.place_mm)
    draw_cut_pad(ax, design, cut, (0.0, cut.length_mm), cause.place_mm, press)
    draw_cut_faces(ax, cavity, cut, {emitter.name, receiver.name})
    deepest = cut_tip_mm(design, press_frame(design, cause.place_mm), end_mm, cut.plane(ceiling_mm(design)))
    (line,) = ax.plot(*deepest.T, color=INK, linewidth=1.0, linestyle=(0, (3, 2)))
    line.set_gid("deepest-tip")
    _draw_light(ax, design, cut, (emitter.height_mm, receiver.height_mm), witness)
    ax.set_axis_off()
    return ax


def _chord(cavity: CavityGeometry, pair: str) -> tuple[PlacedPart, PlacedPart, Cut]:
    """Emitter and receiver of a pair, and the cross-section along its chord."""
    (i, emitter), (j, receiver) = next(
        both
        for both in product(enumerate(cavity.emitters), enumerate(cavity.receivers))
        if f"{both[0][1].name}-{both[1][1].name}" == pair
    )
    return emitter, receiver, cut_of_pair(cavity, (i, j))


def _draw_light(
    ax: Axes, design: SensorDesign, cut: Cut, heights_mm: tuple[float, float], witness: Witness
) -> None:
    (low, high), length = heights_mm, cut.length_mm
    top = cut.plane(ceiling_mm(design)).untouched_mm(cavity_of(design).plan)
    along, height = top.T
    way = np.hypot(along, height - low) + np.hypot(length - along, height - high)
    shortest = np.flatnonzero(np.diff(np.sign(np.diff(way)))) + 1  # light takes paths of stationary length
    mirror = top[shortest[np.abs(shortest - len(way) // 2).argmin()] if len(shortest) else len(way) // 2]
    over_words = float(height[along <= WORDS * length].max())
    shift = 0.02 * length
    for words, share, path, colour, at, level, side in (
        ("straight", witness.straight, [(0.0, low), (length, high)], BLUE, 0.16 * length, None, "top"),
        (
            "mirrored",
            witness.mirrored,
            [(0.0, low), tuple(mirror), (length, high)],
            GREEN,
            shift,
            over_words + shift,
            "bottom",
        ),
    ):
        x, z = zip(*path, strict=True)
        line = "-" if share >= WHOLE else ":" if share <= GONE else "--"
        ax.plot(x, z, color=colour, linewidth=1.4, linestyle=line, zorder=2.4)
        y = float(np.interp(at, x, z)) - shift if level is None else level
        said = f"{words}: {max(share, 0.0):.0%} left"
        ax.text(at, y, said, ha="left", va=side, fontsize=SMALL, color=colour)
