"""Changes of a design that follow when the user drags a component.

If a component is moved along its wall, its layout pattern is replaced by single components at the same positions, with
the same names and order. If the whole row moves, the pattern's pitch or shift changes instead. A change of height
applies to all emitters or all receivers, unless the component has its own height.

In a round wall, the direction from the centre changes. Either the ring is replaced by a list of angles, or the whole
ring rotates. Components given by angles share the height of their layout entry.

On the floor, a component moves along x and y. A grid moves as a whole if it holds couplers, whose two halves belong
together, or if the row is to move.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from optopad.design.errors import InputError
from optopad.design.shape.cavity import PlacedPart, cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import (
    FLOOR,
    AlternatingRing,
    AtAngles,
    DiscRing,
    FacingRows,
    Grid,
    PerSide,
    Placement,
    Ring,
    Single,
    expand,
)

STEP_MM = 0.05
"""Step to which dragged positions are rounded [mm]; it is finer than the print of any mold."""
STEP_DEG = 0.1
"""Step to which dragged directions are rounded [degrees]; it is 0.05 mm on a disc of 57 mm diameter."""
LEAST_MM = 0.01
AXES = ("x_mm", "y_mm")
"""Fields of a component's position on the floor."""


def part_named(design: SensorDesign, name: str) -> PlacedPart:
    """The placed component with this name.

    Raises
    ------
    InputError : there is no such component.
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
    x_mm: float | None = None,
    y_mm: float | None = None,
    with_row: bool = False,
) -> dict[str, Any]:
    """Changes of a design, by dotted path, that move a component to a position on its wall or on the floor.

    Parameters
    ----------
    along_mm : position along a straight wall, from its low end [mm]; None for unchanged
    angle_deg : direction from the centre of a round wall [degrees]; None for unchanged
    height_mm : height above the clear layer's bottom [mm]; None for unchanged
    x_mm, y_mm : position on the floor [mm]; None for unchanged
    with_row : whether to move the whole row or ring of the pattern

    Returns
    -------
    new values by dotted path; empty if nothing moves

    Raises
    ------
    InputError : there is no such component, or the position is not a number or is for the other kind of wall.
    DesignError : the layout does not allow the position.
    """
    part = part_named(design, name)
    _require_place(part, along_mm=along_mm, angle_deg=angle_deg, x_mm=x_mm, y_mm=y_mm)
    if part.is_on_floor:
        return _shifted(design, part, x_mm, y_mm, with_row=with_row)
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


def _require_place(part: PlacedPart, **where: float | None) -> None:
    """Refuse a position on a wall for a component on the floor, and the reverse."""
    wrong = ("along_mm", "angle_deg") if part.is_on_floor else ("x_mm", "y_mm")
    for field in wrong:
        if where[field] is not None:
            place, give = ("on the floor", "x_mm and y_mm") if part.is_on_floor else ("in a wall", "along_mm")
            raise InputError(f"{part.name}: {field}: the part is {place}; give {give}")


def _shifted(
    design: SensorDesign, part: PlacedPart, x_mm: float | None, y_mm: float | None, *, with_row: bool
) -> dict[str, Any]:
    """Changes that move a component on the floor, or the grid that holds it."""
    at = part.position_mm[:2]
    wanted = [
        _place(to, was, f"{part.name}: {name}") for to, was, name in zip((x_mm, y_mm), at, AXES, strict=True)
    ]
    if wanted == [None, None]:
        return {}
    number = int(part.origin.split(".")[1])
    pattern, new = (
        design.layout[number],
        [was if to is None else to for to, was in zip(wanted, at, strict=True)],
    )
    if isinstance(pattern, Grid) and (with_row or pattern.kind == "coupler"):
        return {
            f"{part.origin}.{field}": _plain(getattr(pattern, field) + to - was)
            for field, to, was in zip(("shift_x_mm", "shift_y_mm"), new, at, strict=True)
            if to != was
        }
    if isinstance(pattern, Single):
        return {
            f"{part.origin}.{field}": to for field, to in zip(AXES, wanted, strict=True) if to is not None
        }
    layout = placed_singles(design, [number])
    nearest = min(
        (
            one
            for one in layout[number:]
            if one["pattern"] == "single" and one["wall"] == FLOOR and one["kind"] == part.kind
        ),
        key=lambda one: math.dist((one["x_mm"], one["y_mm"]), at),
    )
    nearest |= {"x_mm": _plain(new[0]), "y_mm": _plain(new[1])}
    return {"layout": layout}


def placed_singles(design: SensorDesign, numbers: Iterable[int]) -> list[dict[str, Any]]:
    """The layout, with the patterns of these indices replaced by single components at the same positions."""
    apart = set(numbers)
    places = expand(design.layout, design.cavity)
    in_turn = {number for number in range(len(design.layout)) if _takes_turns(design, number)}
    if apart & in_turn:
        apart |= in_turn
    found: list[dict[str, Any]] = []
    for number, pattern in enumerate(design.model_dump(mode="json")["layout"]):
        is_whole = pattern["pattern"] in ("single", "at_angles") or pattern.get("kind") == "coupler"
        if number not in apart or is_whole:
            found.append(pattern)
            continue
        found += _singles_of([one for one in places if one.origin == f"layout.{number}"])
    return found


def _takes_turns(design: SensorDesign, number: int) -> bool:
    """Whether a row alternates with another row on its wall, and its positions therefore depend on that row."""
    alone = expand((design.layout[number],), design.cavity)
    origin = f"layout.{number}"
    among = [one for one in expand(design.layout, design.cavity) if one.origin == origin]
    return [one.along_mm for one in alone] != [one.along_mm for one in among]


def _singles_of(places: Iterable[Placement]) -> list[dict[str, Any]]:
    """Layout entries for the components of one pattern.

    Each component in a straight wall or on the floor has its own entry; consecutive components in round walls share one
    entry per kind.
    """
    found: list[dict[str, Any]] = []
    angles: dict[str, list[float]] = {}
    for place in places:
        if place.angle_deg is None:
            angles.pop(place.kind, None)
            own = {"part": place.part, "height_mm": place.height_mm}
            entry: dict[str, Any] = {"pattern": "single", "kind": place.kind, "wall": place.wall}
            if place.at_mm is None:
                entry["along_mm"] = _plain(place.along_mm)
            else:
                entry |= {"x_mm": _plain(place.at_mm[0]), "y_mm": _plain(place.at_mm[1])}
                own |= {"tilt_deg": place.tilt_deg or None, "turn_deg": place.turn_deg or None}
            found.append(entry | {key: value for key, value in own.items() if value is not None})
        elif place.kind in angles:
            angles[place.kind].append(_plain(place.angle_deg))
        else:
            angles[place.kind] = [_plain(place.angle_deg)]
            found.append({"pattern": "at_angles", "kind": place.kind, "angles_deg": angles[place.kind]})
    return found


def _turned(design: SensorDesign, part: PlacedPart, angle_deg: float, *, with_row: bool) -> dict[str, Any]:
    """Changes that move a component, or its whole pattern, to another angle around a round wall."""
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
    """The same direction as an angle from -180 to 180 [degrees]."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def _direction(angle_deg: float) -> float:
    """The same direction as an angle of at least 0 and below 360 [degrees]."""
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
    """Changes of a pattern's shift if it has one, otherwise of its pitch, that move a row."""
    pattern = design.layout[int(part.origin.split(".")[1])]
    if isinstance(pattern, PerSide):
        return {f"{part.origin}.shift_mm": _plain(pattern.shift_mm + along_mm - part.along_mm)}
    cavity = cavity_of(design)
    middle = cavity.wall_length_mm(part.wall) / 2
    from_middle = part.along_mm - middle
    if abs(from_middle) < LEAST_MM:
        return {}
    assert isinstance(pattern, AlternatingRing | FacingRows)
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
    """Changes that set a component's height, in its layout entry if the height is given there, else for its kind."""
    field = part.height_field
    if "layout" in others and field.startswith("layout."):
        others["layout"][int(part.origin.split(".")[1])]["height_mm"] = height_mm
        return {}
    return {field: height_mm}


def _place(wanted_mm: float | None, is_mm: float, what: str) -> float | None:
    """The position rounded to `STEP_MM`; None if no move was requested or the move rounds to zero."""
    if wanted_mm is None:
        return None
    if not math.isfinite(wanted_mm):
        raise InputError(f"{what}: {wanted_mm} mm is refused: must be a finite number")
    return None if abs(wanted_mm - is_mm) < STEP_MM / 2 else _plain(round(wanted_mm / STEP_MM) * STEP_MM)


def _plain(value_mm: float) -> float:
    return round(value_mm, 6)
