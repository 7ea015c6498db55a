"""How near two touches may be on a pad, in lines and sentences, from the data of `TouchesScore.to_json`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.screen.answer import counted, labelled
from optopad.sims.touches_score import TOLD_APART

AT_ONCE = 1.01
"""Least separations up to this ratio to that of tips that touch each other are equal to it [-]."""


def touch_lines(found: dict[str, Any]) -> list[str]:
    """How near two touches may be, the most important first."""
    if "refused" in found:
        return [labelled("touches", f"not computed: {found['refused']}")]
    return [labelled(*one) for one in (("touches", what_touched(found)), *touch_sentences(found))]


def what_touched(found: dict[str, Any]) -> str:
    """What touches, and where."""
    *most, last = (f"{depth:.2g}" for depth in found["depth_mm"])
    depths = f"{', '.join(most)} and {last}" if most else last
    return (
        f"two tips of {found['radius_of_tip_mm']:g} mm radius, equally deep: {depths} mm, around "
        f"{counted(len(found['places_mm']), 'location')}, in {counted(len(found['directions_deg']), 'direction')}"
    )


def touch_sentences(found: dict[str, Any]) -> list[tuple[str, str]]:
    """Sentences about two touches, each with its label."""
    room, least = has_room(found), numbers(found, "least_mm")
    undecided = int(np.array(found["is_open"])[room].sum())
    sentences = [
        ("" if number else "two points", one) for number, one in enumerate(_separations(found, least, room))
    ]
    if np.isfinite(least[room]).any():
        sentences += [("difference", _difference(found, room)), ("costs", _costs(found, room))]
    if undecided:
        sentences.append(
            (
                "undecided",
                f"in {undecided} of {room.sum()} states the error of the light model leaves open whether tips that "
                "touch each other are resolved; they count as not resolved",
            )
        )
    return sentences


def depth_rows(found: dict[str, Any]) -> list[tuple[str, ...]]:
    """For each depth: least separation, states that are never resolved, distance and bounds, for the report's table."""
    least, distance, location, deep = (
        numbers(found, name) for name in ("least_mm", "distance", "location_mm", "bound_depth_mm")
    )
    return [
        (
            f"{depth:.2g}",
            _with_worst(least[..., k], np.max),
            f"{np.isinf(least[..., k]).sum()} of {has_room(found)[..., k].sum()}",
            _with_worst(distance[..., k], np.min),
            _with_worst(location[..., k], np.max),
            _with_worst(deep[..., k], np.max),
        )
        for k, depth in enumerate(found["depth_mm"])
    ]


def _with_worst(values: FloatArray, worst: Callable[[FloatArray], float]) -> str:
    known = values[np.isfinite(values)]
    return f"{_short(np.median(known))} ({_short(worst(known))})" if known.size else "-"


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}"


def numbers(found: dict[str, Any], name: str) -> FloatArray:
    """Figures (place, direction, depth): infinite where there is none, NaN where there is no room for two tips."""
    values = np.array(found[name], dtype=np.float64)
    return np.where(has_room(found), np.nan_to_num(values, nan=np.inf), np.nan)


def has_room(found: dict[str, Any]) -> BoolArray:
    """Where two tips have room (place, direction, depth)."""
    return np.array(found["has_room"], dtype=np.bool_)


def is_at_once(found: dict[str, Any]) -> BoolArray:
    """Where tips that touch each other are resolved as two (place, direction, depth)."""
    return np.asarray(numbers(found, "least_mm") <= AT_ONCE * found["touching_mm"])


def _separations(found: dict[str, Any], least: FloatArray, room: BoolArray) -> list[str]:
    """Least separations: a sentence for each depth, and one for all from which tips that touch are resolved."""
    if not np.isfinite(least[room]).any():
        return [
            "this pad cannot separate two touches: whatever their separation, some single touch gives the same frame "
            f"within {TOLD_APART:g} sigma"
        ]
    depths, touching = found["depth_mm"], found["touching_mm"]
    at_once = np.asarray((is_at_once(found) | ~room).all(axis=(0, 1)))
    first = len(depths) - int(np.cumprod(at_once[::-1]).sum())
    lines = []
    if first < len(depths):
        lines.append(
            f"two tips of {found['radius_of_tip_mm']:g} mm that touch each other, {touching:g} mm apart, are resolved "
            f"as two everywhere from {depths[first]:.2g} mm deep"
        )
    for number in range(first):
        values = least[..., number][room[..., number]]
        known, never = values[np.isfinite(values)], int(np.isinf(values).sum())
        words = []
        if known.size:
            who = "median of those that are" if never else "median"
            words.append(f"resolved from {np.median(known):.3g} mm ({who}; worst {known.max():.3g} mm)")
        if never:
            words.append(f"never at {never} of {values.size} states")
        lines.append(f"{depths[number]:.2g} mm deep: {'; '.join(words)}")
    return lines


def _difference(found: dict[str, Any], room: BoolArray) -> str:
    """The state in which tips that touch each other differ least from a single touch."""
    distance = np.where(room, numbers(found, "distance"), np.inf)
    place, direction, depth = np.unravel_index(int(distance.argmin()), distance.shape)
    x, y = found["places_mm"][place]
    return (
        f"one frame of tips that touch each other differs from every single touch by {_short(distance.min())} sigma or "
        f"more; least around ({x:.3g}, {y:.3g}) mm at {found['directions_deg'][direction]:g} degrees, "
        f"{found['depth_mm'][depth]:.2g} mm deep; {TOLD_APART:g} are needed"
    )


def _costs(found: dict[str, Any], room: BoolArray) -> str:
    """The bounds with a second touch that touches the first one, over those of a touch alone."""
    location, depth = (numbers(found, name)[room] for name in ("location_times", "depth_times"))
    is_known = np.isfinite(location) & np.isfinite(depth)
    if not is_known.any():
        return "bounds of location and depth of two tips that touch each other are not resolved"
    (away, deep), (most_away, most_deep) = (
        [f"{rule(one[is_known]):.2f}" for one in (location, depth)] for rule in (np.median, np.max)
    )
    lost = int((~is_known).sum())
    return (
        f"a second touch next to the first one makes the bounds {away} times as large for location and {deep} for "
        f"depth (medians; worst {most_away} and {most_deep})"
    ) + (f"; not resolved at {lost} of {room.sum()}" if lost else "")
