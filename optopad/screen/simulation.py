"""What `optopad simulate` prints: the light of presses, or a data set."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def signal_lines(summary: dict[str, Any]) -> Iterator[str]:
    """Light of each press by path class."""
    for state in summary["states"]:
        x_mm, y_mm, depth_mm = state["press_mm"]
        shares = "  ".join(f"{name} {value:.3e}" for name, value in state["mean_flux_by_class"].items())
        yield (
            f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm  mean flux {state['mean_flux']:.4e}  {shares}"
        )


def data_lines(summary: dict[str, Any]) -> list[str]:
    """Text that summarises the data set, in a few lines."""
    protocol = summary["protocol"]
    lines = [
        f"protocol  {protocol['name']}: {protocol['points_per_press']} points a press, "
        f"{protocol['touched_per_press']} of them at 0 mm or deeper; {summary['samples']} samples, "
        f"{protocol['hours']:.1f} h on a stage"
    ]
    lines += [
        f"set       {one['name']:<20} {one['role']:<6} {one['pattern']:<7} "
        f"{'ambient' if one['is_ambient'] else 'dark':<8} {one['presses']} presses"
        for one in summary["sets"]
    ]
    if summary["taken_up_presses"]:
        lines.append(f"reused    {summary['taken_up_presses']} presses of an interrupted run")
    if summary["clipped"]:
        lines.append(f"warning   {summary['clipped']}")
    return [*lines, f"file      {summary['file']}"]
