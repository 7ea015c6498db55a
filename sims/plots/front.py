"""Plots of a search: the Pareto front, parallel coordinates, and the importance of fields.

The front, other designs and the base design differ in marker and line style as well as in colour. Designs whose
evaluation was stopped early are not shown.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from optopad.design.arrays import FloatArray
from optopad.design.search.figures import FIGURES
from optopad.design.search.improve import Judged, Tried
from optopad.design.search.space import SearchSpace, SpaceField, Value
from optopad.sims.plots.style import (
    BLUE,
    GREY,
    GRID,
    INK,
    MUTED,
    VERMILLION,
    axes_or_new,
    plain_style,
    svg_text,
)

PANEL_IN = (4.6, 3.4)
AXIS_IN = 1.05
"""Width per axis of a parallel-coordinates plot [inch], with space for the axis's name and the values at its ends."""


def front_svg(space: SearchSpace, base: Judged, tried: Sequence[Tried], front: Sequence[Tried]) -> str:
    """All panels of `front_panels` on one sheet, as SVG text."""
    with plain_style():
        pairs = _pairs(space)
        columns = min(2, max(1, len(pairs)))
        rows = max(1, -(-len(pairs) // columns))
        figure = Figure(figsize=(PANEL_IN[0] * columns, PANEL_IN[1] * rows), layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for panel, (x, y) in zip(panels, pairs, strict=False):
            plot_front(x, y, base, tried, front, panel)
        for panel in panels[max(1, len(pairs)) :]:
            panel.set_axis_off()
        if pairs:
            handles, labels = panels[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=3)
        else:
            plot_course(space, base, tried, panels[0])
        return svg_text(figure, "front")


def front_panels(
    space: SearchSpace, base: Judged, tried: Sequence[Tried], front: Sequence[Tried]
) -> tuple[str, ...]:
    """The Pareto front for every pair of objectives, each as SVG text.

    If there is a single objective, its course over the search is plotted instead.
    """
    drawn = []
    with plain_style():
        for number, (x, y) in enumerate(_pairs(space)):
            ax = plot_front(x, y, base, tried, front)
            ax.legend()
            drawn.append(_svg_of(ax, f"front{number}"))
        return tuple(drawn) or (_svg_of(plot_course(space, base, tried), "course"),)


def _pairs(space: SearchSpace) -> list[tuple[str, str]]:
    return list(itertools.combinations([objective.figure for objective in space.objectives], 2))


def _svg_of(ax: Axes, salt: str) -> str:
    figure = ax.figure
    assert isinstance(figure, Figure)
    return svg_text(figure, salt)


def plot_front(
    x: str, y: str, base: Judged, tried: Sequence[Tried], front: Sequence[Tried], ax: Axes | None = None
) -> Axes:
    """Fully judged designs, with the results `x` and `y` on the axes; the front and the base design are highlighted."""
    ax = axes_or_new(ax, PANEL_IN[1], PANEL_IN[0])
    on_front = {one.number for one in front}
    rest = [one.judged for one in tried if one.number not in on_front]
    ax.scatter(
        *_points(rest, x, y), s=14, color=GREY, alpha=0.6, marker="o", label="judged, not on the front"
    )
    best = [one.judged for one in front]
    ax.scatter(*_points(best, x, y), s=30, color=VERMILLION, marker="D", label="front", zorder=3)
    here = _points([base], x, y)
    ax.scatter(*here, s=90, color=BLUE, marker="*", label="base design", zorder=4)
    ax.set_xlabel(axis_label(x))
    ax.set_ylabel(axis_label(y))
    ax.grid(color=GRID, linewidth=0.6)
    return ax


def plot_course(space: SearchSpace, base: Judged, tried: Sequence[Tried], ax: Axes | None = None) -> Axes:
    """Value of one objective over the search: every feasible design, and the best one so far."""
    ax = axes_or_new(ax, PANEL_IN[1], PANEL_IN[0])
    objective = space.objectives[0]
    pick = np.minimum if objective.sense == "minimize" else np.maximum
    feasible = [one for one in tried if one.is_feasible]
    numbers = [one.number for one in feasible]
    values = np.array([float(one.judged.figures[objective.figure] or 0.0) for one in feasible])
    ax.scatter(numbers, values, s=14, color=GREY, marker="o", label="judged")
    if feasible:
        ax.step(numbers, pick.accumulate(values), color=VERMILLION, where="post", label="best so far")
    start = base.figures.get(objective.figure)
    if start is not None:
        ax.axhline(start, color=BLUE, linestyle="--", linewidth=1.0, label="base design")
    ax.set_xlabel("design")
    ax.set_ylabel(axis_label(objective.figure))
    ax.legend()
    return ax


def parallel_svg(space: SearchSpace, tried: Sequence[Tried], front: Sequence[Tried]) -> str:
    """Parallel coordinates of fields and objectives, one line per fully judged design, as SVG text."""
    with plain_style():
        return _svg_of(plot_parallel(space, tried, front), "parallel")


def plot_parallel(
    space: SearchSpace, tried: Sequence[Tried], front: Sequence[Tried], ax: Axes | None = None
) -> Axes:
    """Parallel coordinates of fields and objectives, one line per fully judged design. Values increase upwards."""
    names = [field.path for field in space.fields] + [objective.figure for objective in space.objectives]
    ax = axes_or_new(ax, 3.6, max(4.6, AXIS_IN * len(names)))
    on_front = {one.number for one in front}
    shown = [one for one in tried if not one.judged.reason]
    table = np.array([_row(space, one) for one in shown]).reshape(len(shown), len(names))
    ends = [_ends(space, number, table) for number in range(len(names))]
    for one, row in zip(shown, table, strict=True):
        heights = [
            (value - low) / ((high - low) or 1.0) for value, (low, high) in zip(row, ends, strict=True)
        ]
        is_best = one.number in on_front
        ax.plot(
            range(len(names)),
            heights,
            color=VERMILLION if is_best else GREY,
            linewidth=1.5 if is_best else 0.6,
            alpha=0.9 if is_best else 0.4,
            zorder=3 if is_best else 2,
        )
    for number, (low, high) in enumerate(ends):
        ax.axvline(number, color=MUTED, linewidth=0.8, zorder=1)
        bottom, top = _end_labels(space, number, low, high)
        ax.text(number, -0.03, bottom, ha="center", va="top", fontsize=7, color=INK)
        ax.text(number, 1.03, top, ha="center", va="bottom", fontsize=7, color=INK)
    ax.set_xticks(range(len(names)), [short_name(name) for name in names], fontsize=7)
    ax.tick_params(axis="x", length=0, pad=14)
    ax.set_yticks([])
    ax.set_ylim(-0.02, 1.02)
    for side in ("left", "bottom"):
        ax.spines[side].set_visible(False)
    return ax


def importance_svg(space: SearchSpace, importance: dict[str, dict[str, float]]) -> str:
    """Bars of the importance of every field for every objective, as SVG text."""
    with plain_style():
        return _svg_of(plot_importance(space, importance), "importance")


def plot_importance(
    space: SearchSpace, importance: dict[str, dict[str, float]], ax: Axes | None = None
) -> Axes:
    """Bars of the importance [-] of every field for every objective."""
    fields = [field.path for field in space.fields]
    ax = axes_or_new(ax, 1.0 + 0.22 * len(fields) * max(1, len(importance)))
    looks = ((VERMILLION, ""), (BLUE, "//"), (GREY, ".."), (INK, "xx"), (MUTED, "--"), (GRID, "\\\\"))
    height = 0.8 / max(1, len(importance))
    for number, ((objective, shares), (colour, hatch)) in enumerate(
        zip(importance.items(), looks, strict=False)
    ):
        at = np.arange(len(fields)) + (number - (len(importance) - 1) / 2) * height
        values = [shares.get(path, 0.0) for path in fields]
        ax.barh(
            at,
            values,
            height * 0.9,
            color=colour,
            hatch=hatch,
            edgecolor="white",
            label=short_name(objective),
        )
    ax.set_yticks(range(len(fields)), [short_name(path) for path in fields])
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel("importance for being among the best tenth [-]")
    ax.legend(loc="lower right")
    return ax


def axis_label(figure: str) -> str:
    """Name of a result, followed by its unit in brackets."""
    unit = FIGURES[figure].unit
    return f"{words(figure)} [{'-' if unit == '1' else unit}]"


def words(name: str) -> str:
    """Name of a result or field in plain words, without the unit suffix and underscores."""
    return name.removesuffix("_mm").replace("_", " ")


def short_name(path: str) -> str:
    """Last part of a dotted path, and the section of the design that contains it on a second line."""
    head, _, leaf = path.rpartition(".")
    return f"{words(leaf)}\n{head.split('.')[0]}" if head else words(leaf)


def choice_text(label: str) -> str:
    """Short text for one of a field's choices: the value itself, or the settings of a layout pattern."""
    value = json.loads(label)
    if isinstance(value, list | dict):
        parts = value if isinstance(value, list) else [value]
        return " + ".join(_pattern_text(part) if isinstance(part, dict) else str(part) for part in parts)
    return str(value)


def _pattern_text(pattern: dict[str, Value]) -> str:
    name = str(pattern.get("pattern", "")).replace("_", " ")
    return " ".join([name, *(f"{words(key)} {value}" for key, value in pattern.items() if key != "pattern")])


def _points(judged: Sequence[Judged], x: str, y: str) -> tuple[list[float], list[float]]:
    found = [(one.figures.get(x), one.figures.get(y)) for one in judged if not one.reason]
    whole = [(a, b) for a, b in found if a is not None and b is not None]
    return [a for a, _ in whole], [b for _, b in whole]


def _row(space: SearchSpace, one: Tried) -> list[float]:
    fields = [_position(field, one.parameters[field.path]) for field in space.fields]
    return fields + [float(one.judged.figures[objective.figure] or 0.0) for objective in space.objectives]


def _position(field: SpaceField, value: Value) -> float:
    return float(field.labels.index(str(value))) if field.choices is not None else float(value)


def _ends(space: SearchSpace, number: int, table: FloatArray) -> tuple[float, float]:
    if number < len(space.fields):
        field = space.fields[number]
        if field.choices is not None:
            return 0.0, float(len(field.choices) - 1)
        return float(field.low or 0.0), float(field.high or 0.0)
    column = table[:, number]
    return (float(column.min()), float(column.max())) if len(column) else (0.0, 1.0)


def _end_labels(space: SearchSpace, number: int, low: float, high: float) -> tuple[str, str]:
    if number < len(space.fields) and space.fields[number].choices is not None:
        return "first", "last"
    return f"{low:.3g}", f"{high:.3g}"
