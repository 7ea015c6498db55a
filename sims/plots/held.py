"""What a pad sees of objects: the pressed top from above, and the change of every pair."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, TwoSlopeNorm
from matplotlib.figure import Figure

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.sims.plots.maps import clip_to_pad, draw_part, outline_patch
from optopad.sims.plots.style import BLUE, INK, MUTED, VERMILLION, WIDTH_IN
from optopad.sims.press import GridTop
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD

HEIGHTS = LinearSegmentedColormap.from_list("heights", [BLUE, "#cfe6f5", "#ffffff", "#fbe0cc"])
CHANGES = LinearSegmentedColormap.from_list("changes", [VERMILLION, "#fbe0cc", "#ffffff", "#cfe6f5", BLUE])
PANEL_IN = 3.4
WIDEST_POINTS = 3.0


def plot_held(draft: Draft, top: GridTop, changes: FloatArray, title: str) -> Figure:
    """The pressed top with the contact's edge, and the pairs that change, seen from above.

    Parameters
    ----------
    top : the pressed top
    changes : (emitter, receiver) change of each pair [noise units]
    title : what presses, in words
    """
    cavity, plan = draft.cavity, draft.plan
    height_in = PANEL_IN * plan.width_mm / plan.length_mm + 1.1
    figure = Figure(figsize=(2.0 * PANEL_IN, height_in), layout="constrained")
    surface, pairs = figure.subplots(1, 2)
    figure.suptitle(title, fontsize=9, color=INK, parse_math=False)
    for ax in (surface, pairs):
        _draw_pad(ax, draft, is_named=True)
    x, y = _plan_of(draft, top)
    low, high = min(float(top.height_mm.min()), -1e-6), max(float(top.height_mm.max()), 1e-6)
    scale = TwoSlopeNorm(0.0, low, high)
    mesh = surface.pcolormesh(
        x, y, top.height_mm, cmap=HEIGHTS, norm=scale, shading="gouraud", rasterized=True
    )
    clip_to_pad(mesh, surface, cavity)
    surface.contour(x, y, top.level, levels=[0.0], colors=[INK], linewidths=0.9)
    figure.colorbar(
        mesh, ax=surface, location="bottom", shrink=0.8, label="height of the top [mm]; line: contact"
    )
    tone = _draw_pairs(pairs, draft, changes, _most(changes))
    pairs.contour(x, y, top.level, levels=[0.0], colors=[INK], linewidths=0.9)
    label = f"change of a pair [sigma]; shown from {DEADBAND_THRESHOLD:g}"
    figure.colorbar(ScalarMappable(tone, CHANGES), ax=pairs, location="bottom", shrink=0.8, label=label)
    return figure


def plot_objects(draft: Draft, changes: Mapping[str, FloatArray]) -> Figure:
    """The pairs that each object changes, (emitter, receiver) [noise units] by the object's name, on one scale."""
    plan = draft.plan
    size_in = WIDTH_IN / len(changes)
    figure = Figure(figsize=(WIDTH_IN, size_in * plan.width_mm / plan.length_mm + 0.9), layout="constrained")
    most = max(map(_most, changes.values()))
    panels = figure.subplots(1, len(changes))
    for ax, (name, of_object) in zip(panels, changes.items(), strict=True):
        _draw_pad(ax, draft, is_named=False)
        ax.set_title(name, fontsize=8)
        tone = _draw_pairs(ax, draft, of_object, most)
    label = f"change of a pair [sigma]; shown from {DEADBAND_THRESHOLD:g}"
    figure.colorbar(
        ScalarMappable(tone, CHANGES), ax=list(panels), location="bottom", shrink=0.6, label=label
    )
    return figure


def _draw_pad(ax: Axes, draft: Draft, *, is_named: bool) -> None:
    plan, cavity = draft.plan, draft.cavity
    ax.add_patch(outline_patch(plan, fill=False, edgecolor=MUTED))
    ax.set_aspect("equal")
    ax.set_axis_off()
    for part in (*cavity.emitters, *cavity.receivers):
        draw_part(ax, part, INK, size=4.0 if is_named else 2.0, is_named=is_named)
    ax.set_xlim(-2.5, plan.length_mm + 2.5)
    ax.set_ylim(-2.5, plan.width_mm + 2.5)


def _most(changes: FloatArray) -> float:
    return max(float(np.abs(changes).max()), DEADBAND_THRESHOLD)


def _draw_pairs(ax: Axes, draft: Draft, changes: FloatArray, most: float) -> Normalize:
    """Draw a line for each pair that changes, the largest change on top; return the colours' scale."""
    cavity, tone = draft.cavity, Normalize(-most, most)
    for number in np.argsort(np.abs(changes), axis=None):
        e, r = np.unravel_index(number, changes.shape)
        change = float(changes[e, r])
        if abs(change) >= DEADBAND_THRESHOLD:
            ends = (cavity.emitters[e].position_mm, cavity.receivers[r].position_mm)
            width = 0.4 + WIDEST_POINTS * (abs(change) / most) ** 0.5
            ax.plot(
                *zip(*(end[:2] for end in ends), strict=True), color=CHANGES(tone(change)), linewidth=width
            )
    return tone


def _plan_of(draft: Draft, top: GridTop) -> tuple[FloatArray, FloatArray]:
    """x and y (nx, ny) of the grid's nodes in the cavity [mm]."""
    origin, axes = draft.plan.top.press_frame(*top.at_mm)
    x, y = np.meshgrid(top.x_mm, top.y_mm, indexing="ij")
    fallen = np.nan_to_num(draft.plan.top.in_frame.sag_mm(x, y))
    place = np.stack([x, y, -fallen], axis=-1) @ axes + origin
    return place[..., 0], place[..., 1]
