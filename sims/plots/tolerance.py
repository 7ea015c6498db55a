"""Plots of confidence and sensitivity: effects of the bands of unmeasured parameters, and of a step in each field."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from optopad.sims.plots.style import BLUE, GREY, GRID, INK, VERMILLION, WIDTH_IN, axes_or_new
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.sims.verdict.tolerance import Effect, FieldSteps, ToleranceBand, ToleranceRow

ROW_IN = 0.42
FRAME_IN = 1.0
NOTHING = "mode 2 not reached"
WIDE = 1.35
"""Width of a figure with up to five panels next to each other, over the width of one plot [-]."""
BAR = 0.36
"""Height of a bar as a share of the height of a row [-]."""
EFFECTS = (
    ("usable_mm", "usable depth\n[mm]"),
    ("deadband_mm", "deadband\n[mm]"),
    ("margin", "margin\n[sigma]"),
    ("location_mm", "location bound\n[mm]"),
    ("depth_mm", "depth bound\n[mm]"),
)
"""Names of the results that a step in a field may change, with the label of each result's panel."""


def plot_tolerance(band: ToleranceBand, ax: Axes | None = None) -> Axes:
    """Summed deadband [mm] at both ends of each parameter; a star marks parameters that change the verdict."""
    ax = axes_or_new(ax, FRAME_IN + ROW_IN * len(band.rows))
    _draw_bars(ax, [row.deadband_mm for row in band.rows], band.deadband_mm)
    most = max([band.deadband_range_mm[1], 0.1])
    ax.set_xlim(-0.04 * most, 1.08 * most)
    _name_rows(ax, band.rows)
    ax.set_xlabel(f"deadband of {band.judged} [mm]")
    _explain(ax)
    return ax


def plot_gap_tolerance(band: ToleranceBand, ax: Axes | None = None) -> Axes:
    """Mode gap [mm] at the low and high end of each parameter; for an end without mode 2, text says so."""
    ax = axes_or_new(ax, FRAME_IN + ROW_IN * len(band.rows))
    _draw_bars(ax, [row.gap_mm for row in band.rows], band.gap_mm)
    for number, row in enumerate(band.rows):
        if None in row.gap_mm:
            which = (
                "both ends"
                if row.gap_mm == (None, None)
                else ("low", "high")[row.gap_mm.index(None)] + " end"
            )
            ax.annotate(
                f"{which}: {NOTHING}",
                (1.0, number),
                xycoords=("axes fraction", "data"),
                ha="right",
                va="bottom",
                xytext=(0, 3),
                textcoords="offset points",
                fontsize=7,
            )
    ax.margins(x=0.08)
    _name_rows(ax, band.rows)
    ax.set_xlabel(f"mode gap of {band.judged} [mm]")
    _explain(ax)
    return ax


def plot_margin_tolerance(band: ToleranceBand, ax: Axes | None = None) -> Axes:
    """Margin at both ends of each parameter: signal change over the least responsive 0.3 mm of depth [noise units].

    Values to the left of the dotted line mean a deadband.
    """
    ax = axes_or_new(ax, FRAME_IN + ROW_IN * len(band.rows))
    _draw_bars(ax, [row.margin for row in band.rows], band.margin)
    ax.axvline(DEADBAND_THRESHOLD, color=VERMILLION, linewidth=1.0, linestyle=":")
    ax.set_xlim(left=0.0)
    _name_rows(ax, band.rows)
    ax.set_xlabel(f"margin [sigma]; deadband below {DEADBAND_THRESHOLD:g}")
    _explain(ax)
    return ax


def plot_field_steps(steps: FieldSteps, unit_of: Callable[[str], str]) -> Figure:
    """Change of each result when each field is stepped down and up, one panel per result.

    Results that no step changes are left out.

    Parameters
    ----------
    unit_of : function from a field's path to its unit, including a leading space
    """
    shown = [one for one in EFFECTS if any(_changes(steps, one[0]))]
    figure = Figure(figsize=(WIDE * WIDTH_IN, FRAME_IN + ROW_IN * len(steps.rows)), layout="constrained")
    panels = figure.subplots(1, max(len(shown), 1), sharey=True, squeeze=False)[0]
    for ax, (name, title) in zip(panels, shown or EFFECTS[:1], strict=True):
        ax.axvline(0.0, color=INK, linewidth=0.8)
        for number, row in enumerate(steps.rows):
            for effect, shift, colour in ((row.lower, -0.5, BLUE), (row.higher, 0.5, VERMILLION)):
                change = _change(steps.as_designed, effect, name)
                if change is None:
                    ax.plot(0.0, number + shift * BAR, "x", color=colour, markersize=4)
                else:
                    ax.barh(number + shift * BAR, change, BAR, color=colour)
        ax.margins(x=0.12)
        ax.set_xlabel(title, fontsize=8)
        ax.locator_params(axis="x", nbins=3)
        ax.tick_params(axis="x", labelsize=7)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis="x", color=GRID, linewidth=0.6)
    panels[0].set_yticks(
        range(len(steps.rows)),
        [f"{row.path}\n\N{PLUS-MINUS SIGN}{row.step:g}{unit_of(row.path)}" for row in steps.rows],
        fontsize=7,
    )
    panels[0].set_ylim(len(steps.rows) - 0.5, -0.5)
    figure.legend(
        handles=[
            Patch(color=BLUE, label="a step lower"),
            Patch(color=VERMILLION, label="a step higher"),
            Line2D([], [], marker="x", color=INK, linestyle="none", label="not resolved, or no valid design"),
        ],
        loc="outside upper right",
        ncols=3,
        fontsize=7,
    )
    return figure


def _changes(steps: FieldSteps, name: str) -> list[float]:
    """Changes of a result by all steps, without unknown ones and zeros."""
    known = (
        _change(steps.as_designed, effect, name) for row in steps.rows for effect in (row.lower, row.higher)
    )
    return [change for change in known if change]


def _change(design: Effect, stepped: Effect | None, name: str) -> float | None:
    """Change of a result by a step; None if its value before or after the step is unknown."""
    before, after = getattr(design, name), None if stepped is None else getattr(stepped, name)
    return None if before is None or after is None else after - before


def row_label(row: ToleranceRow) -> str:
    """Label of a parameter: a star if it changes the verdict, its path without `part_measurements.`, and end values."""
    name = row.path.removeprefix("part_measurements.")
    return f"{'* ' if row.flips else ''}{name}\n{row.values[0]:.3g} / {row.values[1]:.3g}"


def _draw_bars(ax: Axes, ends: Sequence[tuple[float | None, float | None]], at_design: float | None) -> None:
    if at_design is not None:
        ax.axvline(at_design, color=INK, linewidth=1.0, linestyle="--")
    for row, (low, high) in enumerate(ends):
        known = [value for value in (low, high, at_design) if value is not None]
        if known:
            ax.plot(
                [min(known), max(known)],
                [row, row],
                color=GREY,
                linewidth=5,
                alpha=0.6,
                solid_capstyle="butt",
            )
        for value, marker, colour in ((low, "<", BLUE), (high, ">", VERMILLION)):
            if value is not None:
                ax.plot(
                    value, row, marker, color=colour, markersize=7, markeredgecolor="white", linestyle="none"
                )


def _name_rows(ax: Axes, rows: Sequence[ToleranceRow]) -> None:
    ax.set_yticks(range(len(rows)), [row_label(row) for row in rows], fontsize=7)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x", color=GRID, linewidth=0.6)


def _explain(ax: Axes) -> None:
    ax.legend(
        handles=[
            Line2D([], [], marker="<", color=BLUE, linestyle="none", label="low end"),
            Line2D([], [], marker=">", color=VERMILLION, linestyle="none", label="high end"),
            Line2D([], [], color=INK, linestyle="--", linewidth=1.0, label="design"),
        ],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=3,
        handletextpad=0.3,
        columnspacing=1.0,
    )
