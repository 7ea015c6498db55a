"""Starting points and refinements of a search around a base design.

The first points change single fields, the next form a regular grid over part heights and layer thickness, and later
ones are near the best designs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence

from optopad.design.fields.base import get_at
from optopad.design.search.improve import Tried, cost_of, is_near, usable_of, worth
from optopad.design.search.space import ROUND_DIGITS, SearchSpace, SpaceField, Value
from optopad.design.spec.properties import CLEAR, HEIGHTS, TARGET

FIRST_SHARES = (0.15, 0.3, 0.5, 0.8)
"""Sizes of the first changes of single fields, as shares of the height by which emitters and receivers are too low."""
WIDE_SHARES = (0.5, 1.0)
"""Sizes of the first changes of single fields, as shares of `WIDE_MM`, if the parts are high enough."""
WIDE_MM = 1.0
LEAST_SPREAD, TOP_MM = 3, 1.0
"""Least number of values per field in a grid, and least distance of parts below the pad's top in a grid [mm]."""
GAIN_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Targets of the gain that are tried with each good design, as shares of the largest one."""
MOVES = (4.0, 2.0, 2.0, 1.0)
"""Size of the changes to a good design in each round [steps of a field]; then the next best design has its rounds."""
MOST_A_ROUND = 10
"""Largest number of designs in a round."""
PROMISE = 3.0
"""Usable depth [mm] that makes up for one millimetre of deadband when the most promising deep design is chosen."""


def start_of(space: SearchSpace) -> dict[str, Value]:
    """Values of the base design by dotted path; a value outside its range is moved to the nearest permitted one."""
    found, document = dict[str, Value](), space.base.model_dump(mode="json")
    for field in space.fields:
        value = space.base_value(field)
        if value is None:
            now = float(get_at(document, field.path))
            ends = [end for end in (field.low, field.high) if end is not None]
            value = min(space.values_of(field) or ends, key=lambda one: abs(float(one) - now))
        found[field.path] = value
    return found


def first_points(
    space: SearchSpace, *, sides: Mapping[str, int], short_mm: float | None
) -> list[dict[str, Value]]:
    """First points of a search: changes of one field at a time or of both part heights together, small changes first.

    Parameters
    ----------
    sides : direction of change by dotted path, the most promising field first: 1 to increase, -1 to decrease. Part
        heights and the layer thickness that are not in `sides` change in both directions.
    short_mm : height by which emitters and receivers are too low [mm], which sets the size of the changes; None if they
        are high enough
    """
    base = start_of(space)
    order = [*sides, *(path for path in (*HEIGHTS, CLEAR) if path not in sides)]
    groups = [
        [field] for path in order for field in space.fields if field.path == path and field.low is not None
    ]
    heights = [field for field in space.fields if field.path in HEIGHTS]
    if len(heights) > 1:
        groups.insert(0, heights)
    points: list[dict[str, Value]] = [] if space.base_parameters() == base else [base]
    lengths = (
        [share * WIDE_MM for share in WIDE_SHARES]
        if short_mm is None
        else [share * short_mm for share in FIRST_SHARES]
    )
    for length in lengths:
        for group in groups:
            known = sides.get(group[0].path)
            for side in (1, -1) if known is None else (known,):
                point = base | {
                    field.path: _moved(space, field, base, sides.get(field.path, side) * length)
                    for field in group
                }
                if point != base and point not in points:
                    points.append(point)
    return points + [one for one in gain_points(space, base) if one not in points]


def spread_points(space: SearchSpace, most: int) -> list[dict[str, Value]]:
    """Points of a regular grid over part heights and layer thickness; other fields have the values of the base design.

    Parameters
    ----------
    most : largest number of points; if it permits fewer than three values per field, the result is empty
    """
    base = start_of(space)
    thickness = next((field for field in space.fields if field.path == CLEAR and field.low is not None), None)
    heights = [field for field in space.fields if field.path in HEIGHTS and field.low is not None]
    each = int(most ** (1.0 / max(len(heights) + (thickness is not None), 1)) + 1e-9)
    if each < LEAST_SPREAD or not heights:
        return []
    shares = [number / (each - 1) for number in range(each)]
    paths = [one.path for one in heights] + ([CLEAR] if thickness is not None else [])
    points = []
    for clear in (
        [space.base.cavity.clear_thickness_mm]
        if thickness is None
        else [_at(space, thickness, one, math.inf) for one in shares]
    ):
        values = [[_at(space, field, one, float(clear) - TOP_MM) for one in shares] for field in heights]
        for found in itertools.product(*values):
            points.append(base | dict(zip(paths, (*found, clear), strict=False)))
    return points


def _at(space: SearchSpace, field: SpaceField, share: float, highest: float) -> Value:
    """The permitted value nearest to a share of a field's range; the range ends at `highest` if that is lower."""
    assert field.low is not None
    assert field.high is not None
    at = field.low + share * (max(min(field.high, highest), field.low) - field.low)
    return min(space.values_of(field) or [round(at, ROUND_DIGITS)], key=lambda one: abs(float(one) - at))


def _moved(space: SearchSpace, field: SpaceField, base: dict[str, Value], by: float) -> Value:
    """The permitted value of a field that is nearest to its value in `base` plus `by`, and differs from it."""
    start = float(base[field.path])
    assert field.low is not None
    assert field.high is not None
    anywhere: list[Value] = [round(min(max(start + by, field.low), field.high), ROUND_DIGITS)]
    beyond = [one for one in space.values_of(field) or anywhere if (float(one) - start) * by > 1e-9]
    return min(beyond, key=lambda one: abs(float(one) - start - by), default=base[field.path])


def refinements(
    space: SearchSpace,
    tried: Sequence[Tried],
    number: int,
    *,
    starts: int = 1,
    aim: Callable[[Tried], tuple[float, ...]] | None = None,
) -> list[dict[str, Value]]:
    """New points around the best designs: single changes reverted, or values increased and decreased.

    Parameters
    ----------
    tried : designs judged so far
    number : number of the round, from 0, which selects the size of the changes from `MOVES`. After the last of these,
        rounds begin again around the next best designs; the result is empty if there is no design or no new point left
    starts : 1 for points around the best design; 2 to add points around the deepest design whose deadband, if any, is
        short
    aim : sort key of the user's aim, larger for better designs, to add points around the best design by it
    """
    orders: list[Callable[[Tried], tuple[float, ...]]] = [
        lambda one: (*worth(one.judged), -cost_of(space, one)[0], -one.number),
        _promise,
    ]
    orders = [*([] if aim is None else [aim]), *orders[:starts]]
    found, known = list[dict[str, Value]](), [one.parameters for one in tried]
    usable = [one for one in tried if one.judged.figures]
    for order in orders:
        for place in _ranked(space, usable, order, number // len(MOVES) + 1)[number // len(MOVES) :]:
            points = _around(space, place.parameters, MOVES[number % len(MOVES)])
            fresh = [one for at, one in enumerate(points) if one not in (*known, *found, *points[:at])]
            found += fresh[:MOST_A_ROUND]
    return found


def _ranked(
    space: SearchSpace, tried: Sequence[Tried], order: Callable[[Tried], tuple[float, ...]], count: int
) -> list[Tried]:
    """The best designs by an order, larger first, without designs that differ little from a better one."""
    found: list[Tried] = []
    for one in sorted(tried, key=order, reverse=True):
        if len(found) == count:
            break
        if not any(is_near(space, one, other, apart_from=(TARGET,)) for other in found):
            found.append(one)
    return found


def gain_points(space: SearchSpace, here: Mapping[str, Value]) -> list[dict[str, Value]]:
    """A point with other targets of the gain, the largest first: their light is known. Empty if the gain is fixed."""
    field = next((one for one in space.fields if one.path == TARGET and one.low is not None), None)
    if field is None:
        return []
    assert field.high is not None
    wanted = [field.high * share for share in GAIN_SHARES]
    values = dict.fromkeys(_at_value(space, field, value) for value in wanted)
    return [{**here, TARGET: value} for value in values if value != here[TARGET]]


def _at_value(space: SearchSpace, field: SpaceField, value: float) -> Value:
    return min(
        space.values_of(field) or [round(value, ROUND_DIGITS)], key=lambda one: abs(float(one) - value)
    )


def _promise(one: Tried) -> tuple[float, int]:
    short = PROMISE * float(one.judged.figures.get("deadband_mm") or 0.0)
    return usable_of(one.judged) - short, -one.number


def _around(space: SearchSpace, here: dict[str, Value], steps: float) -> list[dict[str, Value]]:
    """Points around one point: each of its changes reverted, then values moved up and down by a number of steps.

    The moved fields are part heights, layer thickness, and all fields that differ from the base design.
    """
    base = start_of(space)
    points = [here | {path: base[path]} for path in here if here[path] != base[path]]
    points += gain_points(space, here)
    heights = [field for field in space.fields if field.path in HEIGHTS]
    groups = [heights] if len(heights) > 1 else []
    groups += [[field] for field in space.fields if field.path in (*HEIGHTS, CLEAR)]
    groups += [
        [field]
        for field in space.fields
        if field.low is not None and here[field.path] != base[field.path] and [field] not in groups
    ]
    for group in groups:
        for side in (1.0, -1.0):
            points.append(
                here | {one.path: _moved(space, one, here, side * steps * _step(one)) for one in group}
            )
    return points


def _step(field: SpaceField) -> float:
    """Step of a field with a range, in its unit; a 50th of the range if the field has no step."""
    assert field.low is not None
    assert field.high is not None
    return field.step or (field.high - field.low) / 50.0
