"""How a pad resolves sideways load, in lines and sentences, from the data of `ShearScore.to_json`."""

from __future__ import annotations

from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.screen.answer import labelled

LABELS = ("location_mm", "depth_mm", "pull_n")


def shear_lines(found: dict[str, Any]) -> list[str]:
    """How a pad resolves sideways load, the most important first."""
    if "refused" in found:
        return [labelled("shear", f"not computed: {found['refused']}")]
    return [labelled(*one) for one in (("shear", what_was_pulled(found)), *shear_sentences(found))]


def what_was_pulled(found: dict[str, Any]) -> str:
    """What presses and pulls, and where."""
    depths = " and ".join(f"{depth:.2g}" for depth in found["depth_mm"])
    return (
        f"a ball of the tip's size, {depths} mm deep at {len(found['places_mm'])} locations, pulled sideways by "
        f"{_span(found['pull_n'])} N with a friction of {found['friction']:g}"
    )


def shear_sentences(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Sentences about sideways load, each with its label."""
    least = _numbers(found["least_pull_n"])
    known, lost = least[np.isfinite(least)], int((~np.isfinite(least)).sum())
    if known.size:
        pull = (
            f"one frame gives the pull within {np.median(known):.2g} N (median; worst {known.max():.2g} N), location "
            "and depth unknown"
        ) + (f"; not resolved at {lost} of {least.size}" if lost else "")
        away, deep = (
            float(np.median(one[np.isfinite(one)]))
            for one in map(_numbers, (found["location_times"], found["depth_times"]))
        )
        costs = f"an unknown pull makes the bounds {away:.2f} times as large for location and {deep:.2f} for depth"
    else:
        pull = "one frame does not give the pull"
        costs = "bounds of location and depth with an unknown pull are not resolved"
    unmodelled = [_moved(found, name) for name in found["unmodelled"]]
    plain, with_pull = (one for one in found["map_errors"] if one["is_pulled"])
    return [
        ("a pull", pull),
        ("costs", costs),
        *(("" if number else "unmodelled", sentence) for number, sentence in enumerate(unmodelled)),
        (
            "modelled",
            f"a signal map with the pull as unknown: location within {with_pull['location_mm'][0]:.2g} mm in place of "
            f"{plain['location_mm'][0]:.2g} mm, depth {with_pull['depth_mm'][0]:.2g} in place of "
            f"{plain['depth_mm'][0]:.2g} mm, the pull within {with_pull['pull_n'][0]:.2g} N (medians, one noisy frame)",
        ),
    ]


def _moved(found: dict[str, Any], name: str) -> str:
    """What a pull changes of the press that a model reports, in words."""
    of = found["unmodelled"][name]
    sizes = [np.abs(np.array(of[key])) for key in ("moved_mm", "deeper_mm", "stronger_n")]
    (away, deep, force), (most, deepest, strongest) = (
        [f"{float(rule(one)):.2g}" for one in sizes] for rule in (np.median, np.max)
    )
    return (
        f"{_span(found['pull_n'])} N move what {name} reports by {away} mm, its depth by {deep} mm and its force by "
        f"{force} N (medians; worst {most} mm, {deepest} mm and {strongest} N)"
    )


def unmodelled_rows(found: dict[str, Any]) -> list[tuple[str, ...]]:
    """Name of each model, and median and worst error without a pull and changes by it, as in the report's table."""
    keys = ("off_mm", "moved_mm", "deeper_mm", "stronger_n")
    return [(name, *(_largest(one[key]) for key in keys)) for name, one in found["unmodelled"].items()]


def map_rows(found: dict[str, Any]) -> list[tuple[str, ...]]:
    """Name of each map, whether there is a pull, and median and 95th percentile of its errors."""
    return [
        (
            one["map"],
            "yes" if one["is_pulled"] else "no",
            *(f"{one[key][0]:.2g} ({one[key][1]:.2g})" if key in one else "" for key in LABELS),
        )
        for one in found["map_errors"]
    ]


def _numbers(values: Any) -> FloatArray:
    """An array in which None is infinite."""
    return np.array([[np.inf if one is None else one for one in row] for row in values])


def _largest(values: Any) -> str:
    size = np.abs(np.array(values))
    return f"{np.median(size):.2g} ({size.max():.2g})"


def _span(values: list[float]) -> str:
    low, high = (f"{one:.2g}" for one in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"
