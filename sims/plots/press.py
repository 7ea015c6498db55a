"""The press itself: load and contact radius of the tip against depth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from design.quantity import Quantity
from sims.plots.style import BLUE, GREEN, GRID, INK, PALE_BLUE, VERMILLION, axes_or_new
from sims.verdict.result import ForceCurve

HEIGHT_IN = 3.2
POINT: dict[str, Any] = {
    "color": VERMILLION,
    "marker": "D",
    "markersize": 6,
    "markeredgecolor": INK,
    "linestyle": "none",
}


def plot_force(
    force: ForceCurve,
    modulus: Quantity,
    ax: Axes | None = None,
    *,
    measured: Sequence[tuple[float, float, str]] = (),
) -> Axes:
    """Load [N] against depth [mm], with the band of the modulus.

    Parameters
    ----------
    modulus : Young's modulus that the loads were computed with [MPa]; the load is proportional to it
    measured : depth [mm], force [N] and label of measurements to hold the curve against
    """
    ax = axes_or_new(ax, HEIGHT_IN)
    if modulus.low is not None and modulus.high is not None:
        low, high = modulus.low / modulus.value, modulus.high / modulus.value
        ax.fill_between(
            force.depth_mm,
            force.force_n * low,
            force.force_n * high,
            color=PALE_BLUE,
            linewidth=0,
            label=f"modulus {modulus.low:.3g} to {modulus.high:.3g} MPa",
        )
    ax.plot(force.depth_mm, force.force_n, color=BLUE, linewidth=2, label=f"modulus {modulus.value:.3g} MPa")
    for depth_mm, force_n, label in measured:
        ax.plot(depth_mm, force_n, label=label, **POINT)
    _frame(ax, force, "load [N]")
    ax.legend(loc="upper left")
    return ax


def plot_force_near(force: ForceCurve, modulus: Quantity, measured: tuple[float, float, str]) -> Axes:
    """The same around one measured point, from contact to twice its depth."""
    ax = plot_force(force, modulus, measured=[measured])
    deepest = min(2.0 * measured[0], float(force.depth_mm[-1]))
    stiffest = 1.0 if modulus.high is None else modulus.high / modulus.value
    highest = float(np.interp(deepest, force.depth_mm, force.force_n)) * stiffest
    ax.set_xlim(0.0, deepest)
    ax.set_ylim(0.0, 1.05 * max(highest, measured[1]))
    return ax


def plot_contact_radius(force: ForceCurve, ax: Axes | None = None) -> Axes:
    """Radius of the circle of contact [mm] against depth [mm]."""
    ax = axes_or_new(ax, HEIGHT_IN)
    ax.plot(force.depth_mm, force.contact_radius_mm, color=GREEN, linewidth=2)
    _frame(ax, force, "contact radius [mm]")
    return ax


def _frame(ax: Axes, force: ForceCurve, label: str) -> None:
    ax.set_xlim(0.0, float(force.depth_mm[-1]))
    ax.set_ylim(bottom=0.0)
    ax.grid(color=GRID, linewidth=0.6)
    ax.set_xlabel("depth of the press [mm]")
    ax.set_ylabel(label)
