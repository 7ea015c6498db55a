"""Sensitivity of the verdict to manufacturing tolerances: a tornado plot next to rank correlations.

Each row of the plot is one toleranced value, that with the strongest rank correlation first. The left panel shows the
margin with only this value at its low or high end; an end with a deadband is labelled with the deadband's length. The
right panel shows the rank correlation over units in which all values are drawn at once, with its 95 % interval.
"""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from optopad.sims.plots.style import BLUE, GREY, GRID, INK, MUTED, VERMILLION
from optopad.sims.verdict.builds import BuildStudy
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.sims.verdict.tolerance import ToleranceBand, ToleranceRow

ROW_IN = 0.36
FRAME_IN = 1.5
WIDTH_IN = 7.4


def plot_builds(study: BuildStudy, band: ToleranceBand) -> Figure:
    """Tornado plot of the margin at both ends, and rank correlations, one row per toleranced value."""
    order = study.ranking
    figure = Figure(figsize=(WIDTH_IN, FRAME_IN + ROW_IN * len(order)), layout="constrained")
    ends, ranks = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
    plot_ends(study, band, ends)
    plot_ranks(study, ranks)
    low, high = study.kept_interval
    doubt = f"; {study.doubtful} undecided by numerical error" if study.doubtful else ""
    verdict = "DEADBAND" if study.as_designed.deadband_mm else "CONTIGUOUS"
    figure.suptitle(
        f"{study.kept} of {study.builds} manufactured units stay {verdict}: {study.kept_share:.0%} "
        f"({low:.0%} to {high:.0%}){doubt}",
        fontsize=9,
        x=0.01,
        ha="left",
    )
    return figure


def plot_ends(study: BuildStudy, band: ToleranceBand, ax: Axes) -> Axes:
    """Margin when one value at a time is at its low or high end [noise units]; labels give the deadbands."""
    rows = {row.path: row for row in band.rows}
    for place, number in enumerate(study.ranking):
        row = rows.get(study.tolerances[number].path)
        if row is not None:
            _draw_ends(ax, place, row, band)
    ax.axvline(DEADBAND_THRESHOLD, color=VERMILLION, linewidth=1.0, linestyle=":")
    ax.axvline(band.margin, color=INK, linewidth=1.0, linestyle="--")
    ax.set_xlim(left=0.0)
    ax.set_yticks(range(len(study.ranking)), [_label(study, number) for number in study.ranking], fontsize=7)
    ax.set_ylim(len(study.ranking) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)
    ax.grid(axis="x", color=GRID, linewidth=0.6)
    ax.set_xlabel(f"one value at a time: margin [sigma]; deadband below {DEADBAND_THRESHOLD:g}")
    ax.legend(
        handles=[
            Line2D([], [], marker="<", color=BLUE, linestyle="none", label="low end"),
            Line2D([], [], marker=">", color=VERMILLION, linestyle="none", label="high end"),
            Line2D([], [], color=INK, linestyle="--", linewidth=1.0, label="design"),
        ],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=3,
        handletextpad=0.3,
        columnspacing=1.0,
    )
    return ax


def plot_ranks(study: BuildStudy, ax: Axes) -> Axes:
    """Rank correlation between each value and the margin over all units [-], with its 95 % interval."""
    found = study.rank_correlations()
    for place, number in enumerate(study.ranking):
        value, low, high = found[number]
        is_clear = low > 0.0 or high < 0.0
        colour = (BLUE if value < 0 else VERMILLION) if is_clear else GREY
        ax.barh(place, value, height=0.5, color=colour, alpha=0.85 if is_clear else 0.5)
        ax.plot([low, high], [place, place], color=INK, linewidth=0.9)
    ax.axvline(0.0, color=MUTED, linewidth=0.8)
    ax.set_xlim(-1.0, 1.0)
    ax.grid(axis="x", color=GRID, linewidth=0.6)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("all values at once: rank correlation [-]")
    return ax


def _draw_ends(ax: Axes, place: int, row: ToleranceRow, band: ToleranceBand) -> None:
    known = [*row.margin, band.margin]
    ax.plot([min(known), max(known)], [place] * 2, color=GREY, linewidth=5, alpha=0.6, solid_capstyle="butt")
    for margin, dead, marker, colour in zip(
        row.margin, row.deadband_mm, "<>", (BLUE, VERMILLION), strict=True
    ):
        ax.plot(margin, place, marker, color=colour, markersize=6, markeredgecolor="white", linestyle="none")
        if dead:
            ax.annotate(
                f"{dead:.2f} mm",
                (margin, place),
                xytext=(5, 3),
                textcoords="offset points",
                fontsize=6,
                color=MUTED,
            )


def _label(study: BuildStudy, number: int) -> str:
    one = study.tolerances[number]
    name = one.path.removeprefix("part_measurements.")
    mark = "" if one.origin == "open value" else " (making)" if one.origin == "making" else " (given)"
    return f"{name}{mark}\n{one.low:.4g} to {one.high:.4g}"
