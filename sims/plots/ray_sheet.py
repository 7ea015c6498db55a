"""A sheet of light paths under several presses: one row of plots per press, with cross-section and plan view."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from matplotlib.figure import Figure

from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.sims.plots.rays import (
    HEAD_ROOM,
    PLAN_ROOM,
    SECTION_ROOM,
    Cut,
    legend_handles,
    percent,
    plot_ray_plan,
    plot_ray_section,
)
from optopad.sims.plots.style import INK, MUTED
from optopad.sims.rays import RayState

LEAST_WIDTH_IN = 8.6
SECTION_IN = (6.0, 2.9)
PLAN_IN = (3.0, 2.7)
LEFT_IN, GAP_IN, HEAD_IN, TICKS_IN, FOOT_IN, LINE_IN = 0.55, 0.75, 0.55, 0.25, 0.3, 0.15
CAPTION_SIGNS = 16
"""Number of characters per inch in the caption."""


def ray_sheet(
    states: Sequence[RayState],
    design: SensorDesign,
    cut: Cut,
    *,
    title: str,
    caption: str,
    is_of_untouched: bool,
) -> Figure:
    """Sheet with one row of plots per press: cross-section and plan view. All rows have the same scale.

    Parameters
    ----------
    states : the presses with their light paths, the untouched pad first
    cut : line of the cross-section, the same in every row
    is_of_untouched : whether powers are shares of the total received in the untouched pad; if False, of the emitters'
        power
    """
    section, plan = _sizes_in(design, cut)
    width = max(LEAST_WIDTH_IN, LEFT_IN + section[0] + GAP_IN + plan[0] + 0.2)
    lines = textwrap.wrap(caption, round(CAPTION_SIGNS * width))
    row = max(section[1], plan[1]) + HEAD_IN + TICKS_IN
    height = 0.35 + len(states) * row + FOOT_IN + LINE_IN * len(lines) + 0.1
    figure = Figure(figsize=(width, height))
    figure.text(0.012, 1 - 0.12 / height, title, va="top", fontsize=11, fontweight="bold")
    for number, state in enumerate(states):
        top = height - 0.35 - number * row - HEAD_IN
        boxes = (
            (LEFT_IN, top - section[1], *section),
            (LEFT_IN + section[0] + GAP_IN, top - plan[1], *plan),
        )
        _draw_row(
            figure, boxes, state, design, cut, _unit(states, is_of_untouched), number == len(states) - 1
        )
    below = FOOT_IN + LINE_IN * len(lines)
    figure.text(0.012, (below - FOOT_IN) / height, "\n".join(lines), va="top", fontsize=7.5, color=MUTED)
    return figure


def _unit(states: Sequence[RayState], is_of_untouched: bool) -> float | None:
    return states[0].total if is_of_untouched and states[0].total > 0.0 else None


def _sizes_in(design: SensorDesign, cut: Cut) -> tuple[tuple[float, float], tuple[float, float]]:
    """(width, height) of the cross-section and of the plan view [inch], each as large as its space allows."""
    cavity = cavity_of(design)
    start, end = cut.reach_mm(cavity)
    length = (1.0 + 2 * SECTION_ROOM) * (end - start)
    high = cavity.black_mm + cavity.clear_mm + HEAD_ROOM * design.indenter.tip_radius_mm
    room = 2 * PLAN_ROOM * max(cavity.length_mm, cavity.width_mm)
    seen = cavity.length_mm + room, cavity.width_mm + room
    section = min(SECTION_IN[0] / length, SECTION_IN[1] / high)
    plan = min(PLAN_IN[0] / seen[0], PLAN_IN[1] / seen[1])
    return (section * length, section * high), (plan * seen[0], plan * seen[1])


def _draw_row(
    figure: Figure,
    boxes: tuple[tuple[float, float, float, float], ...],
    state: RayState,
    design: SensorDesign,
    cut: Cut,
    unit: float | None,
    is_last: bool,
) -> None:
    width, height = figure.get_size_inches()
    axes = [figure.add_axes((x / width, y / height, w / width, h / height)) for x, y, w, h in boxes]
    plot_ray_section(state, design, axes[0], cut=cut, untouched=unit)
    plot_ray_plan(state, design, axes[1], cut=cut)
    legend = axes[0].get_legend()
    assert legend is not None
    legend.remove()
    top = max(y + h for _, y, _, h in boxes) + HEAD_IN - 0.08
    figure.text(
        LEFT_IN / width,
        top / height,
        _row_title(state, unit),
        va="top",
        color=INK,
        fontsize=9.5,
        weight="bold",
    )
    figure.legend(
        handles=legend_handles(state, unit),
        loc="upper left",
        bbox_to_anchor=((LEFT_IN - 0.08) / width, (top - 0.14) / height),
        ncols=6,
        fontsize=8,
        handlelength=2.8,
        columnspacing=1.3,
        borderaxespad=0.0,
    )
    if not is_last:
        for ax in axes:
            ax.set_xlabel("")


def _row_title(state: RayState, unit: float | None) -> str:
    x, y, depth = state.press_mm
    of = "the untouched light" if unit else "the emitted light"
    arrives = f"{percent(state.total / (unit or 1.0))} of {of} arrives"
    where = f"pressed {depth:.2f} mm deep at x = {x:g}, y = {y:g} mm" if state.indentation else "untouched"
    return where if unit and state.indentation is None else f"{where}: {arrives}"
