"""A part dragged by hand: the resulting changes of the design.

A part of a pattern that is moved along its wall leaves the pattern, whose parts then become single ones at the same
positions; their names and order remain. If the whole row moves, the pattern's pitch or shift changes. A change of
height applies to all parts of a kind, unless the part has its own height.

In a round wall the direction from the centre changes: either the part leaves its ring, whose parts then have an angle
each, or the whole ring rotates. Parts that were given by angles share their height with the others of their entry.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from design.errors import InputError
from design.shape.cavity import PlacedPart, cavity_of
from design.spec import SensorDesign
from design.spec.layout import AtAngles, DiscRing, FacingRows, PerSide, Placement, Ring, Single, expand

STEP_MM = 0.05
"""Grid of a dragged position [mm]; it is finer than the print of any mold."""
STEP_DEG = 0.1
"""Grid of a dragged direction [degrees]: 0.05 mm on a disc of 57 mm."""
LEAST_MM = 0.01


def part_named(design: SensorDesign, name: str) -> PlacedPart:
    """A placed part by its name.

    Raises
    ------
    InputError : no such part.
    """
    parts = cavity_of(design).parts
    for part in parts:
        if part.name == name:
            return part
    raise InputError(f"{name}: no such part; there are {', '.join(part.name for part in parts)}")


def moved(
    design: SensorDesign,
    name: str,
    *,
    along_mm: float | None = None,
    angle_deg: float | None = None,
    height_mm: float | None = None,
    with_row: bool = False,
) -> dict[str, Any]:
    """Changes that move a part to a position on its wall.

    Parameters
    ----------
    along_mm : in a straight wall, from its low end [mm]; None: unchanged
    angle_deg : in a round wall, direction from its centre [degrees]; None: unchanged
    height_mm : above the clear layer's bottom [mm]; None: unchanged
    with_row : move the whole row of its pattern, too

    Returns
    -------
    dotted path and value; empty if nothing moves

    Raises
    ------
    InputError : no such part, a position that is not a number, or one of the other kind of wall.
    DesignError : a position that the layout does not allow.
    """
    part = part_named(design, name)
    if part.angle_deg is not None and along_mm is not None:
        raise InputError(f"{name}: along_mm: a round wall has no position along it; give angle_deg")
    if part.angle_deg is None and angle_deg is not None:
        raise InputError(f"{name}: angle_deg: a straight wall has no angles; give along_mm")
    changes: dict[str, Any] = {}
    if angle_deg is not None:
        changes |= _turned(design, part, angle_deg, with_row=with_row)
    along = _place(along_mm, part.along_mm, f"{name}: along_mm")
    height = _place(height_mm, part.height_mm, f"{name}: height_mm")
    if along is not None:
        changes |= _along(design, part, along, with_row=with_row)
    if height is not None:
        there = part_named(design.with_(**changes), name) if changes else part
        changes |= _at_height(there, height, changes)
    return changes


def placed_singles(design: SensorDesign, numbers: Iterable[int]) -> list[dict[str, Any]]:
    """The layout with some of its patterns resolved into single parts at the same positions.

    A part in a straight wall gets an entry of its own; parts of one kind in round walls get one entry, with an angle
    per part. The parts of each kind keep their order, and with it their names. Rows that take turns are resolved
    together, because the positions of one depend on the other.
    """
    apart = set(numbers)
    places = expand(design.layout, design.cavity)
    in_turn = {number for number in range(len(design.layout)) if _takes_turns(design, number)}
    if apart & in_turn:
        apart |= in_turn
    found: list[dict[str, Any]] = []
    for number, pattern in enumerate(design.model_dump(mode="json")["layout"]):
        if number not in apart or pattern["pattern"] in ("single", "at_angles"):
            found.append(pattern)
            continue
        found += _singles_of([one for one in places if one.origin == f"layout.{number}"])
    return found


def _takes_turns(design: SensorDesign, number: int) -> bool:
    """Whether a row's positions depend on another row of its wall."""
    alone = expand((design.layout[number],), design.cavity)
    origin = f"layout.{number}"
    among = [one for one in expand(design.layout, design.cavity) if one.origin == origin]
    return [one.along_mm for one in alone] != [one.along_mm for one in among]


def _singles_of(places: Iterable[Placement]) -> list[dict[str, Any]]:
    """Entries of one pattern's parts: singles, and angles of each kind until a straight wall comes between."""
    found: list[dict[str, Any]] = []
    angles: dict[str, list[float]] = {}
    for place in places:
        if place.angle_deg is None:
            angles.pop(place.kind, None)
            own = {"part": place.part, "height_mm": place.height_mm}
            entry = {
                "pattern": "single",
                "kind": place.kind,
                "wall": place.wall,
                "along_mm": _plain(place.along_mm),
            }
            found.append(entry | {key: value for key, value in own.items() if value is not None})
        elif place.kind in angles:
            angles[place.kind].append(_plain(place.angle_deg))
        else:
            angles[place.kind] = [_plain(place.angle_deg)]
            found.append({"pattern": "at_angles", "kind": place.kind, "angles_deg": angles[place.kind]})
    return found


def _turned(design: SensorDesign, part: PlacedPart, angle_deg: float, *, with_row: bool) -> dict[str, Any]:
    """Changes that move a part of a round wall, or its whole pattern, to another direction."""
    if not math.isfinite(angle_deg):
        raise InputError(f"{part.name}: angle_deg: {angle_deg} is refused: must be a finite number")
    turn = _around(angle_deg - (part.angle_deg or 0.0))
    if abs(turn) < STEP_DEG / 2:
        return {}
    number = int(part.origin.split(".")[1])
    pattern = design.layout[number]
    if with_row:
        turn = _whole_steps(turn)
        if isinstance(pattern, AtAngles):
            angles = [_direction(angle + turn) for angle in pattern.angles_deg]
            return {f"{part.origin}.angles_deg": angles}
        if isinstance(pattern, DiscRing | Ring) and not design.cavity.walls:
            return {f"{part.origin}.first_angle_deg": _direction(pattern.first_angle_deg + turn)}
    wanted = _direction(_whole_steps(angle_deg))
    if isinstance(pattern, AtAngles):
        before = expand(design.layout[:number], design.cavity)
        rank = _rank(design, part) - sum(place.kind == part.kind for place in before)
        return {f"{part.origin}.angles_deg.{rank}": wanted}
    layout = placed_singles(design, [number])
    start_deg = part.angle_deg or 0.0
    angles, nearest = min(
        (
            (one["angles_deg"], k)
            for one in layout[number:]
            if one["kind"] == part.kind
            for k in range(len(one.get("angles_deg", ())))
        ),
        key=lambda at: abs(_around(at[0][at[1]] - start_deg)),
    )
    angles[nearest] = wanted
    return {"layout": layout}


def _around(angle_deg: float) -> float:
    """The same direction, from -180 to 180 [degrees]."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def _direction(angle_deg: float) -> float:
    """The same direction, from 0 on and below 360 [degrees]."""
    return _plain(angle_deg % 360.0) % 360.0


def _whole_steps(angle_deg: float) -> float:
    return round(angle_deg / STEP_DEG) * STEP_DEG


def _along(design: SensorDesign, part: PlacedPart, along_mm: float, *, with_row: bool) -> dict[str, Any]:
    number = int(part.origin.split(".")[1])
    pattern = design.layout[number]
    if isinstance(pattern, Single):
        return {f"{part.origin}.along_mm": along_mm}
    if with_row and not isinstance(pattern, Ring) and not _takes_turns(design, number):
        return _row_moved(design, part, along_mm)
    layout = placed_singles(design, [number])
    mine = [
        k
        for k, one in enumerate(layout)
        if k >= number and (one.get("kind"), one.get("wall")) == (part.kind, part.wall)
    ]
    at = min(mine, key=lambda k: abs(layout[k]["along_mm"] - part.along_mm))
    layout[at] = layout[at] | {"along_mm": along_mm}
    return {"layout": layout}


def _rank(design: SensorDesign, part: PlacedPart) -> int:
    cavity = cavity_of(design)
    parts = cavity.emitters if part.kind == "emitter" else cavity.receivers
    return [one.name for one in parts].index(part.name)


def _row_moved(design: SensorDesign, part: PlacedPart, along_mm: float) -> dict[str, Any]:
    """Changes of the shift of a row if the pattern has one, or else of its pitch."""
    pattern = design.layout[int(part.origin.split(".")[1])]
    if isinstance(pattern, PerSide):
        return {f"{part.origin}.shift_mm": _plain(pattern.shift_mm + along_mm - part.along_mm)}
    cavity = cavity_of(design)
    middle = cavity.wall_length_mm(part.wall) / 2
    from_middle = part.along_mm - middle
    if abs(from_middle) < LEAST_MM:
        return {}
    assert not isinstance(pattern, Single | DiscRing | AtAngles | Ring)
    if pattern.pitch_mm is not None:
        pitch = pattern.pitch_mm
    else:
        counts = pattern.count if isinstance(pattern, FacingRows) else _on_wall(design, part)
        pitch = 2 * middle / counts
    return {f"{part.origin}.pitch_mm": _plain(max(pitch * (along_mm - middle) / from_middle, 0.5))}


def _on_wall(design: SensorDesign, part: PlacedPart) -> int:
    parts = cavity_of(design).parts
    return sum(one.wall == part.wall and one.origin == part.origin for one in parts)


def _at_height(part: PlacedPart, height_mm: float, others: dict[str, Any]) -> dict[str, Any]:
    """Changes of a part's own height, also if the part has just left its pattern, or of its kind's height."""
    field = part.height_field
    if "layout" in others and field.startswith("layout."):
        others["layout"][int(part.origin.split(".")[1])]["height_mm"] = height_mm
        return {}
    return {field: height_mm}


def _place(wanted_mm: float | None, is_mm: float, what: str) -> float | None:
    """The position on the grid of `STEP_MM`; None if no move was requested or it rounds to zero."""
    if wanted_mm is None:
        return None
    if not math.isfinite(wanted_mm):
        raise InputError(f"{what}: {wanted_mm} mm is refused: must be a finite number")
    return None if abs(wanted_mm - is_mm) < STEP_MM / 2 else _plain(round(wanted_mm / STEP_MM) * STEP_MM)


def _plain(value_mm: float) -> float:
    return round(value_mm, 6)
