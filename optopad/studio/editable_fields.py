"""Fields of a design that the studio offers for editing: label, unit, limits, and meaning."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from optopad.design.fields.base import get_at, is_value
from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import (
    OPPOSITE,
    AlternatingRing,
    Checkerboard,
    DiscRing,
    FacingRows,
    Grid,
    PerSide,
    Ring,
    RingInside,
    expand,
)
from optopad.design.spec.pad import WALLS
from optopad.design.spec.properties import entries_of
from optopad.screen.verdict_sentences import unit_of

Kind = Literal["number", "whole", "choice"]
BY_HAND = "by hand"
RING_INSET = 0.15
"""Distance of a new ring from the outline, as a share of the pad's shorter side [-]."""
MOST_ON_A_WALL, MOST_IN_A_RING = 32, 64
SIZES = ("cavity.length_mm", "cavity.width_mm", "cavity.diameter_mm")
ANGLES_DEG = (-360.0, 360.0)
PATTERNS = ("alternating ring", "facing rows", "by side")
ROUND_PATTERNS = ("disc ring",)
FLOOR_PATTERNS = ("checkerboard", "ring inside")
"""Patterns of a whole layout: `PATTERNS` for straight walls, `ROUND_PATTERNS` for round walls, and `FLOOR_PATTERNS` for
a pad whose parts are on the floor. A layout that follows none of them is a grid or "by hand"."""
ALONE: dict[type, str] = {
    DiscRing: "disc ring",
    Ring: "ring",
    AlternatingRing: "alternating ring",
    FacingRows: "facing rows",
    Checkerboard: "checkerboard",
    RingInside: "ring inside",
}
"""Patterns that describe a whole layout by one entry."""


@dataclass(frozen=True, kw_only=True)
class EditableField:
    """One field of a design that can be edited in the studio.

    Attributes
    ----------
    path : dotted path in the design
    group, label : group in the panel, and label
    unit : unit; empty for a pure number
    kind : "number", "whole" for a whole number, or "choice"
    value : value in the design
    low, high : limits of the value; None for no limit
    step : change of the value by the arrow buttons
    choices : options of a choice
    tells : meaning of the field, in one sentence
    """

    path: str
    group: str
    label: str
    unit: str
    kind: Kind
    value: float | int | str
    tells: str
    low: float | None = None
    high: float | None = None
    step: float = 0.1
    choices: tuple[str, ...] = ()


_FIXED = (
    ("Pad", "cavity.clear_thickness_mm", "clear layer", 0.25, "Optical layer; the largest effect."),
    ("Pad", "cavity.length_mm", "length", 1.0, "Inner length along x; the mold changes with it."),
    ("Pad", "cavity.width_mm", "width", 1.0, "Inner width along y; the mold changes with it."),
    ("Pad", "cavity.diameter_mm", "diameter", 1.0, "Inner diameter; the mold changes with it."),
    ("Pad", "crown.radius_mm", "crown radius", 1.0, "Radius of curvature of the top: smaller is rounder."),
    ("Pad", "cavity.black_thickness_mm", "black layer", 0.25, "Absorbing layer below the clear one."),
    ("Parts", "emitters.height_mm", "emitters' height", 0.1, "Centre of the emitting area over the layer's bottom."),
    ("Parts", "receivers.height_mm", "receivers' height", 0.1, "Centre of the chip over the clear layer's bottom."),
    ("Press", "indenter.tip_radius_mm", "tip radius", 0.25, "Radius of the tip and its shank."),
    ("Press", "operating.max_depth_mm", "deepest press", 0.25, "Largest depth that the verdict covers."),
    ("Press", "operating.workspace_margin_mm", "margin", 0.5, "Tip's edge to the wall at the workspace's border."),
    ("Material", "elastomer.mixing_ratio", "mixing ratio", 1.0, ("Base over curing agent by weight; sets modulus "
                                                                "and index.")),
    ("Signal", "gain.target_counts", "target reading", 10.0, ("Reading of the median judged pair, which sets the "
                                                             "gain.")),
    ("Signal", "noise.read_noise_counts", "read noise", 0.1, "Noise of one reading in the dark."),
    ("Signal", "noise.relative_noise", "relative noise", 0.001, "Total noise in proportion to the signal."),
)  # fmt: skip


def editable_fields_of(design: SensorDesign) -> tuple[EditableField, ...]:
    """Every field that the studio offers for a design, group by group."""
    found = [*_numbers(design), *_choices(design), *_layout(design)]
    order = ("Pad", "Layout", "Parts", "Press", "Material", "Signal")
    return tuple(sorted(found, key=lambda field: order.index(field.group)))


def changes_of(design: SensorDesign, path: str, value: Any) -> dict[str, Any]:
    """All changes of a design that follow from a new value of one field, by dotted path."""
    if path == "layout":
        return {} if value == pattern_of(design) else {"layout": relaid(design, str(value))}
    if path in SIZES and isinstance(value, int | float):
        side = path.removeprefix("cavity.")
        inner, outer = getattr(design.cavity, side), getattr(design.mold, f"outer_{side}")
        if inner is not None and outer is not None:  # a rectangle has no diameter
            return {path: value, f"mold.outer_{side}": round(outer + value - inner, 6)}
    if ".parts_per_side." in path and isinstance(value, int):
        return {path: value} | _opposite_too(design, path, value)
    return {path: value}


def _opposite_too(design: SensorDesign, path: str, value: int) -> dict[str, Any]:
    """Change of the opposite wall's number of components that keeps a ring's total even; empty if none is needed."""
    ring, _, wall = path.rpartition(".")
    counts = get_at(design.model_dump(mode="json"), ring)
    change = value - counts[int(wall)]
    if change % 2 == 0:
        return {}
    opposite = (int(wall) + 2) % len(WALLS)
    there = counts[opposite] + change
    return {f"{ring}.{opposite}": there if 0 <= there <= MOST_ON_A_WALL else counts[opposite] - change}


def relaid(design: SensorDesign, pattern: str) -> list[dict[str, Any]]:
    """A layout of another pattern with about as many components; for "by hand", the present components one by one."""
    from optopad.studio.moves import placed_singles

    emitters, walls = _count(design, "emitter"), _walls(design)
    if pattern == "disc ring":
        return [_disc_ring(design)]
    if pattern in FLOOR_PATTERNS:
        return [_on_floor(design, pattern)]
    if pattern == "ring":
        return [
            {"pattern": "ring", "emitters": max(emitters, 1), "receivers": max(_count(design, "receiver"), 1)}
        ]
    if pattern == "alternating ring":
        share = max(round(_count(design) / max(len(walls), 1)), 1)
        counts = [share if wall in walls else 0 for wall in WALLS]
        return [{"pattern": "alternating_ring", "parts_per_side": share if all(counts) else counts}]
    if pattern == "facing rows":
        row = {"pattern": "facing_rows", "count": max(min(emitters, 3), 1)}
        return [row if "west" in walls else row | {"emitter_wall": "south"}]
    if pattern == "by side":
        lit = [wall for wall in ("south", "west") if wall in walls]
        share = max(round(emitters / max(len(lit), 1)), 1)
        return [
            {"pattern": "per_side", "kind": "emitter"} | dict.fromkeys(lit, share),
            {"pattern": "per_side", "kind": "receiver"} | {OPPOSITE[wall]: share for wall in lit},
        ]
    return placed_singles(design, range(len(design.layout)))


def pattern_of(design: SensorDesign) -> str:
    """The name of the pattern if it describes the whole layout, otherwise `BY_HAND`."""
    kinds: set[type] = {type(one) for one in design.layout}
    if kinds == {PerSide}:
        return "by side"
    if kinds == {Grid}:
        return "grid"
    return ALONE.get(type(design.layout[0]), BY_HAND) if len(design.layout) == 1 else BY_HAND


def _disc_ring(design: SensorDesign) -> dict[str, Any]:
    """A disc ring that begins at the first emitter's direction.

    Its number of components per kind is the larger of the numbers of emitters and receivers.
    """
    count = max(_count(design, "emitter"), _count(design, "receiver"))
    places = expand(design.layout, design.cavity)
    first = next((one.angle_deg for one in places if one.kind == "emitter"), None) or 0.0
    return {"pattern": "disc_ring", "count": min(count, MOST_ON_A_WALL), "first_angle_deg": first}


def _on_floor(design: SensorDesign, pattern: str) -> dict[str, Any]:
    """A checkerboard that fills the pad, or a ring inside its outline, with about as many components."""
    outline = plan_of(design).outline.bare
    if pattern == "ring inside":
        counts = {"emitters": _count(design, "emitter"), "receivers": _count(design, "receiver")}
        return {
            "pattern": "ring_inside",
            **counts,
            "inset_mm": round(RING_INSET * min(outline.box_mm[2:]), 2),
        }
    length, width = outline.room_mm(outline.box_mm[3])
    rows = max(round(math.sqrt(_count(design) * width / length)), 1)
    columns = max(round(_count(design) / rows), 1)
    pitch = round(min(length / columns, width / rows), 2)
    return {"pattern": "checkerboard", "columns": columns, "rows": rows, "pitch_mm": max(pitch, 0.5)}


def _walls(design: SensorDesign) -> dict[str, float]:
    """Name and length [mm] of the straight walls on which components can be placed."""
    return {line.name: line.length_mm for line in plan_of(design).walls}


def _count(design: SensorDesign, kind: str | None = None) -> int:
    places = expand(design.layout, design.cavity)
    return sum(kind in (None, place.kind) for place in places)


def _numbers(design: SensorDesign) -> Iterator[EditableField]:
    document = design.model_dump(mode="json")
    for group, path, label, step, tells in _FIXED:
        if not is_value(document, path):  # of another outline, or without a crown
            continue
        if path == "gain.target_counts" and not isinstance(design.gain.feedback_ohm, str):
            continue
        low, high = limits_of(path)
        yield EditableField(
            path=path,
            group=group,
            label=label,
            unit=unit_of(path).strip(),
            kind="number",
            value=float(get_at(document, path)),
            low=low,
            high=high,
            step=step,
            tells=tells,
        )


def _choices(design: SensorDesign) -> Iterator[EditableField]:
    entries = entries_of(design)

    def choice(
        group: str, path: str, label: str, value: str, names: tuple[str, ...], tells: str
    ) -> EditableField:
        return EditableField(
            path=path,
            group=group,
            label=label,
            unit="",
            kind="choice",
            value=value,
            choices=names if value in names else (*names, value),
            tells=tells,
        )

    for section, kind in (("emitters", "emitter"), ("receivers", "receiver")):
        parts = tuple(sorted(name for name, part in entries.parts.items() if part.kind == kind))
        value = getattr(design, section).part
        yield choice("Parts", f"{section}.part", section, value, parts, "Entry of the parts catalogue.")
    silicones = tuple(sorted(entries.elastomers))
    silicone = design.elastomer.material
    yield choice("Material", "elastomer.material", "silicone", silicone, silicones, "Of the clear layer.")
    if isinstance(design.gain.feedback_ohm, str):
        rule = design.gain.feedback_ohm
        tells = "each: one gain per receiver; common: one gain for all."
        yield choice("Signal", "gain.feedback_ohm", "gain", rule, ("each", "common"), tells)
    tells = "Positions of the parts. By hand: each part on its own; dragging one part selects it."
    bare = plan_of(design).outline
    patterns = ("ring", *(PATTERNS if bare.lines else ()), *(ROUND_PATTERNS if bare.arcs else ()), BY_HAND)
    if design.is_on_board:
        patterns = (*FLOOR_PATTERNS, BY_HAND)
    yield choice("Layout", "layout", "pattern", pattern_of(design), patterns, tells)


def _layout(design: SensorDesign) -> Iterator[EditableField]:
    for number, pattern in enumerate(design.layout):
        at = f"layout.{number}"
        match pattern:
            case AlternatingRing():
                yield from _ring(design, pattern, at)
            case DiscRing():
                tells = "Number of emitters, and of receivers, alternating."
                yield _whole(at, "count", "pairs", pattern.count, MOST_ON_A_WALL, tells)
                yield _first_angle(at, pattern.first_angle_deg)
            case Ring():
                for kind in ("emitters", "receivers"):
                    yield _whole(at, kind, kind, getattr(pattern, kind), MOST_IN_A_RING, "Spread evenly.")
                if not design.cavity.walls:
                    yield _first_angle(at, pattern.first_angle_deg)
            case FacingRows():
                yield _whole(
                    at,
                    "count",
                    "pairs",
                    pattern.count,
                    MOST_ON_A_WALL,
                    "Number of emitters in the row, and of receivers.",
                )
                span = design.cavity.wall_length_mm(pattern.emitter_wall)
                yield _pitch(at, pattern.pitch_mm, span / pattern.count)
            case PerSide():
                for wall in _walls(design):
                    yield _whole(
                        at,
                        wall,
                        f"{pattern.kind}s {wall}",
                        getattr(pattern, wall),
                        MOST_ON_A_WALL,
                        "Parts on this wall.",
                    )
                tells = "Moves the whole row along its wall."
                yield _along(at, "shift_mm", f"{pattern.kind}s' shift", pattern.shift_mm, tells)
            case Grid() | Checkerboard():
                for name in ("columns", "rows"):
                    tells = (
                        f"Number of {'packages' if 'coupler' in getattr(pattern, 'kind', '') else 'parts'}."
                    )
                    yield _whole(at, name, name, getattr(pattern, name), MOST_ON_A_WALL, tells)
                yield _pitch(at, pattern.pitch_mm, pattern.pitch_mm)
                if isinstance(pattern, Grid):
                    tells = "Turns every part about its axis; couplers: from emitter to receiver."
                    yield _number(
                        f"{at}.turn_deg", "turned by", "°", pattern.turn_deg, ANGLES_DEG, 15.0, tells
                    )
            case RingInside():
                for kind in ("emitters", "receivers"):
                    yield _whole(at, kind, kind, getattr(pattern, kind), MOST_IN_A_RING, "Spread evenly.")
                tells = "Distance of the ring from the pad's outline."
                yield _number(f"{at}.inset_mm", "inset", "mm", pattern.inset_mm, (0.1, 100.0), 0.25, tells)
            case _:
                pass


def _ring(design: SensorDesign, pattern: AlternatingRing, at: str) -> Iterator[EditableField]:
    counts = pattern.parts_per_side
    if isinstance(counts, int):
        yield _whole(
            at,
            "parts_per_side",
            "parts a side",
            counts,
            MOST_ON_A_WALL,
            "Emitters and receivers alternate on each wall.",
        )
        even = min(_walls(design).values()) / counts
        yield _pitch(at, pattern.pitch_mm, even)
    else:
        walls = _walls(design)
        for wall, count in zip(WALLS, counts, strict=True):
            if wall not in walls:
                continue
            yield _whole(
                at,
                f"parts_per_side.{WALLS.index(wall)}",
                f"parts {wall}",
                count,
                MOST_ON_A_WALL,
                "The sum is even: an odd step also changes the opposite wall.",
            )


def _whole(at: str, name: str, label: str, value: int, high: int, tells: str) -> EditableField:
    low = 0 if name in WALLS or "." in name else 1
    return EditableField(
        path=f"{at}.{name}",
        group="Layout",
        label=label,
        unit="",
        kind="whole",
        value=value,
        low=low,
        high=high,
        step=1,
        tells=tells,
    )


def _first_angle(at: str, value: float) -> EditableField:
    tells = "Direction of the first part from the centre, 0 along x, 90 along y: rotates the whole ring."
    return _number(f"{at}.first_angle_deg", "first part at", "°", value, ANGLES_DEG, 1.0, tells)


def _pitch(at: str, given_mm: float | None, even_mm: float) -> EditableField:
    """The editable field of a pitch; if the design gives no pitch, the value is the pitch of even spacing."""
    value = round(even_mm, 3) if given_mm is None else given_mm
    return _along(at, "pitch_mm", "pitch", value, "Distance between neighbours.")


def _along(at: str, name: str, label: str, value: float, tells: str) -> EditableField:
    limits = (0.5, 100.0) if name == "pitch_mm" else (-100.0, 100.0)
    return _number(f"{at}.{name}", label, "mm", value, limits, 0.25, tells)


def _number(
    path: str, label: str, unit: str, value: float, limits: tuple[float, float], step: float, tells: str
) -> EditableField:
    return EditableField(
        path=path,
        group="Layout",
        label=label,
        unit=unit,
        kind="number",
        value=value,
        low=limits[0],
        high=limits[1],
        step=step,
        tells=tells,
    )


def limits_of(path: str) -> tuple[float | None, float | None]:
    """Least and largest value that the schema allows for a field; None for no limit. The path has no list indices."""
    schema = _schema()
    found = schema
    for name in path.split("."):
        found = found["properties"][name]
        reference = found.get("$ref") or next(
            (one["$ref"] for one in found.get("anyOf", ()) if "$ref" in one), None
        )
        if reference:
            found = schema["$defs"][reference.rsplit("/", 1)[-1]]
    found = next((one for one in found.get("anyOf", ()) if one.get("type") in ("number", "integer")), found)
    low = found.get("minimum", found.get("exclusiveMinimum"))
    high = found.get("maximum", found.get("exclusiveMaximum"))
    return (None if low is None else float(low), None if high is None else float(high))


@cache
def _schema() -> dict[str, Any]:
    return SensorDesign.model_json_schema()
