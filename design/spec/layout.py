"""Layout of emitters and receivers: patterns, and the positions of the parts that they describe.

In a round wall a part's position is its direction from the wall's centre, 0 degrees along x, 90 degrees along y. Each
part has its own flat facet there (`optopad.design.shape.cavity`). In a straight wall a position is a distance along the
wall, `along`. It increases with x on the south and north walls, and with y on the east and west walls. The drawing
shows the walls from above:

        y                north
        ^         +-----------------+
        |   west  |                 |  east
        |         +-----------------+
        +--> x           south

A part on the floor stands on the circuit board under the pad, at x and y. Its tilt is the angle between its axis and
the vertical: at 0 degrees it looks up, at 90 degrees level. Its turn is a direction in plan, 0 along x: where a tilted
part looks, or how far a part that looks up is turned about its axis. A coupler is an emitter and a receiver in one
package.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from optopad.design.fields.base import Model, PartId
from optopad.design.spec.pad import WALLS, Cavity, Wall

Kind = Literal["emitter", "receiver"]

OPPOSITE: dict[Wall, Wall] = {"south": "north", "north": "south", "east": "west", "west": "east"}
MAX_PER_KIND = 64

Count = Annotated[int, Field(ge=0, le=32)]
HeightMm = Annotated[float, Field(gt=0.0, le=50.0)]
AlongMm = Annotated[float, Field(gt=0.0, lt=300.0)]
PitchMm = Annotated[float, Field(ge=0.5, le=100.0)]
AngleDeg = Annotated[float, Field(ge=-360.0, le=360.0)]
TURN_DEG = 360.0
FLOOR = "floor"
"""Name of the wall of parts that stand on the floor."""
XMm = Annotated[float, Field(gt=0.0, lt=300.0)]
TiltDeg = Annotated[float, Field(ge=0.0, le=90.0)]
PartName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,15}$")]


class AlternatingRing(Model):
    """Alternating emitters and receivers around the perimeter, evenly spaced along each wall."""

    pattern: Annotated[Literal["alternating_ring"], Field(description="name of the pattern")]
    parts_per_side: Annotated[
        Annotated[int, Field(ge=1, le=32)] | tuple[Count, Count, Count, Count],
        Field(description="parts on each wall: one number, or [south, east, north, west]; the sum is even"),
    ]
    first: Annotated[Kind, Field(description="kind of the first part of the south wall, at low x")] = (
        "emitter"
    )
    pitch_mm: Annotated[
        PitchMm | None, Field(description="distance between neighbours [mm]; default: wall length / parts")
    ] = None

    @model_validator(mode="after")
    def _takes_turns_to_the_end(self) -> Self:
        counts = self.parts_per_side
        if isinstance(counts, tuple) and (sum(counts) % 2 or not sum(counts)):
            raise ValueError(
                f"parts_per_side = {list(counts)} has the sum {sum(counts)}; emitters and receivers alternate around "
                "the perimeter, so the sum must be even and at least 2: add or remove one"
            )
        return self


class FacingRows(Model):
    """A row of emitters facing a row of receivers on the opposite wall, at the same positions."""

    pattern: Annotated[Literal["facing_rows"], Field(description="name of the pattern")]
    emitter_wall: Annotated[Wall, Field(description="wall of the emitters; the receivers are opposite")] = (
        "west"
    )
    count: Annotated[int, Field(ge=1, le=32, description="emitters, and as many receivers")]
    pitch_mm: Annotated[PitchMm | None, Field(description="distance between neighbours [mm]")] = None


class PerSide(Model):
    """Evenly spaced parts of one kind (emitters or receivers), with a separate number for each wall.

    If a row of emitters and a row of receivers would have parts at the same position, the parts alternate.
    """

    pattern: Annotated[Literal["per_side"], Field(description="name of the pattern")]
    kind: Annotated[Kind, Field(description="emitter or receiver")]
    south: Annotated[Count, Field(description="parts on the wall at y = 0")] = 0
    east: Annotated[Count, Field(description="parts on the wall at the largest x")] = 0
    north: Annotated[Count, Field(description="parts on the wall at the largest y")] = 0
    west: Annotated[Count, Field(description="parts on the wall at x = 0")] = 0
    pitch_mm: Annotated[PitchMm | None, Field(description="distance between neighbours [mm]")] = None
    shift_mm: Annotated[
        float, Field(ge=-100.0, le=100.0, description="moves the whole row along its wall [mm]")
    ] = 0.0
    part: Annotated[PartId | None, Field(description="catalogue part; default: the section's")] = None
    height_mm: Annotated[HeightMm | None, Field(description="height above the clear layer's bottom")] = None


class Single(Model):
    """One part at a given position in a straight wall or on the floor."""

    unsaid = ("along_mm", "x_mm", "y_mm", "tilt_deg", "turn_deg")

    pattern: Annotated[Literal["single"], Field(description="name of the pattern")]
    kind: Annotated[Kind, Field(description="emitter or receiver")]
    wall: Annotated[Wall | Literal["floor"], Field(description="wall of the part, or 'floor'")]
    along_mm: Annotated[
        AlongMm | None, Field(description="wall: distance from its low-x or low-y corner [mm]")
    ] = None
    x_mm: Annotated[XMm | None, Field(description="floor: x of its active area's centre [mm]")] = None
    y_mm: Annotated[XMm | None, Field(description="floor: y of its active area's centre [mm]")] = None
    tilt_deg: Annotated[
        TiltDeg, Field(description="floor: angle of its axis to the vertical, 0 looks up")
    ] = 0.0
    turn_deg: Annotated[
        AngleDeg, Field(description="floor: direction in plan in which it looks or is turned")
    ] = 0.0
    part: Annotated[PartId | None, Field(description="catalogue part; default: the section's")] = None
    height_mm: Annotated[HeightMm | None, Field(description="height above the clear layer's bottom")] = None
    name: Annotated[PartName | None, Field(description="default: E1, E2 ... or R1, R2 ... in order")] = None

    @model_validator(mode="after")
    def _has_a_position(self) -> Self:
        on_floor = self.wall == FLOOR
        needed = {"x_mm": self.x_mm, "y_mm": self.y_mm} if on_floor else {"along_mm": self.along_mm}
        missing = [name for name, value in needed.items() if value is None]
        if missing:
            raise ValueError(f"{missing[0]} is missing: a part in wall = '{self.wall}' needs it; add it")
        others = ("along_mm",) if on_floor else ("x_mm", "y_mm")
        extra = [name for name in others if getattr(self, name) is not None]
        if not on_floor and (self.tilt_deg, self.turn_deg) != (0.0, 0.0):
            extra.append("tilt_deg" if self.tilt_deg else "turn_deg")
        if extra:
            raise ValueError(
                f"{extra[0]} does not belong to wall = '{self.wall}'; remove it"
                + ("" if on_floor else ", or set wall = 'floor'")
            )
        return self


class Grid(Model):
    """Parts of one kind, or couplers, on the floor in rows and columns about the middle of the pad, looking up."""

    unsaid = ("pitch_y_mm", "shift_x_mm", "shift_y_mm", "turn_deg", "apart_mm")

    pattern: Annotated[Literal["grid"], Field(description="name of the pattern")]
    kind: Annotated[
        Literal["emitter", "receiver", "coupler"],
        Field(description="emitter, receiver, or coupler: both in one package"),
    ]
    columns: Annotated[int, Field(ge=1, le=32, description="number of parts along x")]
    rows: Annotated[int, Field(ge=1, le=32, description="number of parts along y")]
    pitch_mm: Annotated[PitchMm, Field(description="distance between neighbours [mm]")]
    pitch_y_mm: Annotated[PitchMm | None, Field(description="distance along y; default: pitch_mm")] = None
    shift_x_mm: Annotated[float, Field(ge=-100.0, le=100.0, description="moves the grid along x [mm]")] = 0.0
    shift_y_mm: Annotated[float, Field(ge=-100.0, le=100.0, description="moves the grid along y [mm]")] = 0.0
    turn_deg: Annotated[
        AngleDeg, Field(description="turns each part; couplers: from emitter to receiver")
    ] = 0.0
    apart_mm: Annotated[
        PitchMm | None, Field(description="couplers: distance of the emitter's and receiver's centres [mm]")
    ] = None
    part: Annotated[PartId | None, Field(description="catalogue part; default: the section's")] = None
    height_mm: Annotated[HeightMm | None, Field(description="height above the clear layer's bottom")] = None

    @model_validator(mode="after")
    def _couplers_have_both(self) -> Self:
        if self.kind == "coupler" and self.apart_mm is None:
            raise ValueError("apart_mm is missing: couplers need it; add the distance of their two centres")
        if self.kind != "coupler" and self.apart_mm is not None:
            raise ValueError("apart_mm belongs to couplers; remove it, or set kind = 'coupler'")
        if self.kind == "coupler" and self.part is not None:
            raise ValueError("part: a coupler has two entries; name them in emitters.part and receivers.part")
        return self


class Checkerboard(Model):
    """Emitters and receivers in turn on the floor, as the squares of a chessboard, looking up."""

    unsaid = ("pitch_y_mm",)

    pattern: Annotated[Literal["checkerboard"], Field(description="name of the pattern")]
    columns: Annotated[int, Field(ge=1, le=32, description="number of parts along x")]
    rows: Annotated[int, Field(ge=1, le=32, description="number of parts along y")]
    pitch_mm: Annotated[PitchMm, Field(description="distance between neighbours [mm]")]
    pitch_y_mm: Annotated[PitchMm | None, Field(description="distance along y; default: pitch_mm")] = None
    first: Annotated[Kind, Field(description="kind of the part at the lowest x and y")] = "emitter"


class RingInside(Model):
    """Any number of emitters and of receivers on the floor along a line inside the outline, evenly spaced."""

    pattern: Annotated[Literal["ring_inside"], Field(description="name of the pattern")]
    emitters: Annotated[int, Field(ge=0, le=64, description="number of emitters")]
    receivers: Annotated[int, Field(ge=0, le=64, description="number of receivers")]
    inset_mm: Annotated[
        float, Field(gt=0.0, le=100.0, description="distance of the line from the outline [mm]")
    ]
    looks: Annotated[
        Literal["up", "in", "out"], Field(description="up, or level: inward or towards the wall")
    ] = "up"


class DiscRing(Model):
    """As many emitters as receivers around a disc, alternating, evenly spaced and counter-clockwise."""

    pattern: Annotated[Literal["disc_ring"], Field(description="name of the pattern")]
    count: Annotated[int, Field(ge=1, le=32, description="emitters, and as many receivers")]
    first: Annotated[Kind, Field(description="kind of the part at first_angle_deg")] = "emitter"
    first_angle_deg: Annotated[AngleDeg, Field(description="direction of the first part from the centre")] = (
        0.0
    )


class Ring(Model):
    """Any number of emitters and of receivers around any outline, evenly spaced along each of its walls."""

    pattern: Annotated[Literal["ring"], Field(description="name of the pattern")]
    emitters: Annotated[int, Field(ge=1, le=64, description="number of emitters")]
    receivers: Annotated[int, Field(ge=1, le=64, description="number of receivers")]
    sequence: Annotated[
        str | None,
        Field(
            pattern=r"^[ER]{2,32}$",
            description="kinds in turn, as 'ERR', repeated; default: spread evenly, an emitter first",
        ),
    ] = None
    first_angle_deg: Annotated[AngleDeg, Field(description="direction of the first part from the centre")] = (
        0.0
    )

    @model_validator(mode="after")
    def _sequence_makes_these_numbers(self) -> Self:
        if self.sequence is not None:
            lit, read = self.sequence.count("E"), self.sequence.count("R")
            turns, rest = divmod(self.emitters + self.receivers, lit + read)
            if rest or (lit * turns, read * turns) != (self.emitters, self.receivers):
                raise ValueError(
                    f"sequence = '{self.sequence}' has {lit} emitters and {read} receivers; repeated, it never has "
                    f"{self.emitters} and {self.receivers}; correct emitters, receivers or the sequence"
                )
        return self

    @property
    def kinds(self) -> tuple[Kind, ...]:
        """Kind of each part, emitter or receiver, in order around the outline."""
        if self.sequence is not None:
            turns = (self.emitters + self.receivers) // len(self.sequence)
            return tuple("emitter" if letter == "E" else "receiver" for letter in self.sequence * turns)
        return interleaved(self.emitters, self.receivers)


class AtAngles(Model):
    """Parts of one kind (emitters or receivers) in round walls, in given directions from the wall's centre."""

    pattern: Annotated[Literal["at_angles"], Field(description="name of the pattern")]
    kind: Annotated[Kind, Field(description="emitter or receiver")]
    angles_deg: Annotated[
        tuple[AngleDeg, ...], Field(min_length=1, max_length=64, description="one direction per part")
    ]
    part: Annotated[PartId | None, Field(description="catalogue part; default: the section's")] = None
    height_mm: Annotated[HeightMm | None, Field(description="height above the clear layer's bottom")] = None


Pattern = Annotated[
    AlternatingRing
    | FacingRows
    | PerSide
    | Single
    | DiscRing
    | AtAngles
    | Ring
    | Grid
    | Checkerboard
    | RingInside,
    Field(discriminator="pattern"),
]
BY_ANGLE = ("ring", "disc_ring", "at_angles")
"""Names of the patterns that are permitted in round walls."""
ON_FLOOR = ("grid", "checkerboard", "ring_inside")
"""Names of the patterns of parts on the floor of any outline."""
BY_WALL = ("ring", "alternating_ring", "facing_rows", "per_side", "single")
"""Names of the patterns that are permitted in straight walls."""


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Position of one emitter or receiver, without its catalogue entry.

    Attributes
    ----------
    name : E1, R1, ... or a name given by the user
    wall : name of the wall; in a round wall the direction, such as `45-degree`
    along_mm : distance of the part's centre from that end of the wall where x or y is lower [mm]; not used in a round
        wall
    angle_deg : direction of the part from a round wall's centre; None in a straight wall
    height_mm : height above the clear layer's bottom [mm]; None for the default
    part : catalogue identifier; None for the default
    origin : dotted path of the pattern that defines the part, for messages
    at_mm : x, y of a part on the floor; None in a wall
    tilt_deg, turn_deg : axis of a part on the floor: angle to the vertical, and direction in plan
    coupler : name of the coupler that the part belongs to, such as OC1; None for a part of its own
    """

    name: str
    kind: Kind
    wall: str
    along_mm: float
    height_mm: float | None
    part: str | None
    origin: str
    angle_deg: float | None = None
    at_mm: tuple[float, float] | None = None
    tilt_deg: float = 0.0
    turn_deg: float = 0.0
    coupler: str | None = None


def expand(layout: tuple[Pattern, ...], cavity: Cavity) -> tuple[Placement, ...]:
    """Positions of all emitters and receivers of a layout in the walls of a cavity, in the order of the patterns.

    Names are E1, E2, ... and R1, R2, ... in this order, and OC1, OC2, ... of couplers. A single part may have a name of
    its own.
    """
    bare: list[Placement] = []
    for index, pattern in enumerate(layout):
        bare += _expand_one(pattern, f"layout.{index}", cavity)
    couplers = dict.fromkeys((one.origin, one.coupler) for one in bare if one.coupler is not None)
    names: dict[tuple[str, str | None], str] = {
        coupler: f"OC{number}" for number, coupler in enumerate(couplers, start=1)
    }
    bare = [replace(one, coupler=names.get((one.origin, one.coupler))) for one in bare]
    bare = _with_rows_in_turn(layout, bare, cavity)
    counters = {"emitter": 0, "receiver": 0}
    named = []
    for place in bare:
        counters[place.kind] += 1
        named.append(replace(place, name=place.name or f"{place.kind[0].upper()}{counters[place.kind]}"))
    return tuple(named)


def _expand_one(pattern: Pattern, origin: str, cavity: Cavity) -> list[Placement]:
    match pattern:
        case AlternatingRing():
            return _ring(pattern, origin, cavity)
        case FacingRows():
            return _facing(pattern, origin, cavity)
        case PerSide():
            return _per_side(pattern, origin, cavity)
        case DiscRing():
            return _disc_ring(pattern, origin)
        case Ring():
            return _even_ring(pattern, origin, cavity)
        case AtAngles():
            return [
                _at_angle(pattern.kind, angle, origin, pattern.height_mm, pattern.part)
                for angle in pattern.angles_deg
            ]
        case Grid():
            return _grid(pattern, origin, cavity)
        case Checkerboard():
            return _checkerboard(pattern, origin, cavity)
        case RingInside():
            return _ring_inside(pattern, origin, cavity)
        case Single():
            at = None if pattern.x_mm is None or pattern.y_mm is None else (pattern.x_mm, pattern.y_mm)
            return [
                Placement(
                    name=pattern.name or "",
                    kind=pattern.kind,
                    wall=pattern.wall,
                    along_mm=pattern.along_mm or 0.0,
                    height_mm=pattern.height_mm,
                    part=pattern.part,
                    origin=origin,
                    at_mm=at,
                    tilt_deg=pattern.tilt_deg,
                    turn_deg=pattern.turn_deg,
                )
            ]


def _row(count: int, span_mm: float, pitch_mm: float | None, shift_mm: float = 0.0) -> list[float]:
    pitch = span_mm / count if pitch_mm is None and count else pitch_mm or 0.0
    return [span_mm / 2 + shift_mm + (k - (count - 1) / 2) * pitch for k in range(count)]


def _plain(kind: Kind, wall: Wall, along_mm: float, origin: str) -> Placement:
    return Placement(
        name="", kind=kind, wall=wall, along_mm=along_mm, height_mm=None, part=None, origin=origin
    )


def _ring(pattern: AlternatingRing, origin: str, cavity: Cavity) -> list[Placement]:
    counts = pattern.parts_per_side
    per_wall = counts if isinstance(counts, tuple) else (counts,) * 4
    other: Kind = "receiver" if pattern.first == "emitter" else "emitter"
    kinds: tuple[Kind, Kind] = (pattern.first, other)
    places: list[Placement] = []
    for wall, count in zip(WALLS, per_wall, strict=True):
        row = _row(count, cavity.wall_length_mm(wall), pattern.pitch_mm)
        walk = (
            row if wall in ("south", "east") else row[::-1]
        )  # counter-clockwise from the corner at the lowest x and y
        places += [_plain(kinds[(len(places) + k) % 2], wall, along, origin) for k, along in enumerate(walk)]
    return places


def angle_name(angle_deg: float) -> str:
    """Name of the facet in a direction, such as `45-degree`."""
    return f"{round(angle_deg % 360.0, 6):g}-degree"


def _at_angle(
    kind: Kind, angle_deg: float, origin: str, height_mm: float | None = None, part: str | None = None
) -> Placement:
    return Placement(
        name="",
        kind=kind,
        wall=angle_name(angle_deg),
        along_mm=0.0,
        height_mm=height_mm,
        part=part,
        origin=origin,
        angle_deg=angle_deg,
    )


def _disc_ring(pattern: DiscRing, origin: str) -> list[Placement]:
    other: Kind = "receiver" if pattern.first == "emitter" else "emitter"
    step = 180.0 / pattern.count
    return [
        _at_angle((pattern.first, other)[k % 2], angle - 360.0 if angle > 360.0 else angle, origin)
        for k in range(2 * pattern.count)
        for angle in [pattern.first_angle_deg + k * step]
    ]


def interleaved(emitters: int, receivers: int) -> tuple[Kind, ...]:
    """Order of emitters and receivers in a row, each kind spread as evenly as possible; an emitter is first."""
    total = emitters + receivers
    return tuple("emitter" if k * emitters % total < emitters else "receiver" for k in range(total))


def _even_ring(pattern: Ring, origin: str, cavity: Cavity) -> list[Placement]:
    kinds = pattern.kinds
    places: list[Placement] = []
    for stretch, count in zip(cavity.border, _shared(len(kinds), cavity), strict=True):
        mine = kinds[len(places) : len(places) + count]
        if stretch.wall is None:
            is_whole = stretch.turn_deg == TURN_DEG
            first = (
                pattern.first_angle_deg
                if is_whole
                else stretch.start_deg + stretch.turn_deg / (2 * count or 1)
            )
            step = stretch.turn_deg / (count or 1)
            places += [_at_angle(kind, (first + k * step) % TURN_DEG, origin) for k, kind in enumerate(mine)]
            continue
        row = _row(count, stretch.length_mm, None)
        walk = row if stretch.wall in ("south", "east") else row[::-1]  # counter-clockwise
        places += [_plain(kind, stretch.wall, along, origin) for kind, along in zip(mine, walk, strict=True)]
    return places


def _shared(count: int, cavity: Cavity) -> list[int]:
    """Number of parts in each wall of the outline, in proportion to its length.

    Remaining parts are distributed by the method of largest remainders.
    """
    lengths = [stretch.length_mm for stretch in cavity.border]
    exact = [count * length / sum(lengths) for length in lengths]
    shares = [int(one) for one in exact]
    by_rest = sorted(range(len(exact)), key=lambda k: (shares[k] - exact[k], k))
    for k in by_rest[: count - sum(shares)]:
        shares[k] += 1
    return shares


def _with_rows_in_turn(
    layout: tuple[Pattern, ...], places: list[Placement], cavity: Cavity
) -> list[Placement]:
    """Alternate rows of emitters and of receivers that would have parts at the same position of one wall.

    This applies only to evenly spaced rows. Rows with a pitch, a shift or a height of their own keep their positions.
    """
    plain = {
        f"layout.{number}"
        for number, pattern in enumerate(layout)
        if isinstance(pattern, PerSide)
        and (pattern.pitch_mm, pattern.shift_mm, pattern.height_mm) == (None, 0.0, None)
    }
    for wall in WALLS:
        mine = [k for k, one in enumerate(places) if one.wall == wall and one.origin in plain]
        emitters = [k for k in mine if places[k].kind == "emitter"]
        receivers = [k for k in mine if places[k].kind == "receiver"]
        at_mm = [[round(places[k].along_mm, 6) for k in kind] for kind in (emitters, receivers)]
        if not set(at_mm[0]) & set(at_mm[1]):
            continue
        row = _row(len(mine), cavity.wall_length_mm(wall), None)
        queues = {"emitter": iter(emitters), "receiver": iter(receivers)}
        for along, kind in zip(row, interleaved(len(emitters), len(receivers)), strict=True):
            k = next(queues[kind])
            places[k] = replace(places[k], along_mm=along)
    return places


def _facing(pattern: FacingRows, origin: str, cavity: Cavity) -> list[Placement]:
    wall = pattern.emitter_wall
    row = _row(pattern.count, cavity.wall_length_mm(wall), pattern.pitch_mm)
    emitters = [_plain("emitter", wall, along, origin) for along in row]
    receivers = [_plain("receiver", OPPOSITE[wall], along, origin) for along in row]
    return emitters + receivers


def _per_side(pattern: PerSide, origin: str, cavity: Cavity) -> list[Placement]:
    counts = (pattern.south, pattern.east, pattern.north, pattern.west)
    return [
        Placement(
            name="",
            kind=pattern.kind,
            wall=wall,
            along_mm=along,
            height_mm=pattern.height_mm,
            part=pattern.part,
            origin=origin,
        )
        for wall, count in zip(WALLS, counts, strict=True)
        for along in _row(count, cavity.wall_length_mm(wall), pattern.pitch_mm, pattern.shift_mm)
    ]


def _on_floor(
    kind: Kind, at_mm: tuple[float, float], origin: str, tilt_deg: float = 0.0, turn_deg: float = 0.0
) -> Placement:
    return Placement(
        name="",
        kind=kind,
        wall=FLOOR,
        along_mm=0.0,
        height_mm=None,
        part=None,
        origin=origin,
        at_mm=at_mm,
        tilt_deg=tilt_deg,
        turn_deg=turn_deg,
    )


def _squares(
    pattern: Grid | Checkerboard, cavity: Cavity, shift_mm: tuple[float, float] = (0.0, 0.0)
) -> list[tuple[float, float]]:
    """Positions x, y of a grid, row by row from the lowest y, each from the lowest x [mm]."""
    across = pattern.pitch_mm if pattern.pitch_y_mm is None else pattern.pitch_y_mm
    columns = _row(pattern.columns, cavity.length_mm, pattern.pitch_mm, shift_mm[0])
    return [(x, y) for y in _row(pattern.rows, cavity.width_mm, across, shift_mm[1]) for x in columns]


def _grid(pattern: Grid, origin: str, cavity: Cavity) -> list[Placement]:
    turn = math.radians(pattern.turn_deg)
    half = (pattern.apart_mm or 0.0) / 2
    offset = half * math.cos(turn), half * math.sin(turn)
    kinds: tuple[tuple[Kind, float], ...] = (
        (("emitter", -1.0), ("receiver", 1.0)) if pattern.kind == "coupler" else ((pattern.kind, 0.0),)
    )
    return [
        replace(
            _on_floor(kind, (x + side * offset[0], y + side * offset[1]), origin, turn_deg=pattern.turn_deg),
            part=pattern.part,
            height_mm=pattern.height_mm,
            coupler=f"OC{number}" if pattern.kind == "coupler" else None,
        )
        for number, (x, y) in enumerate(
            _squares(pattern, cavity, (pattern.shift_x_mm, pattern.shift_y_mm)), start=1
        )
        for kind, side in kinds
    ]


def _checkerboard(pattern: Checkerboard, origin: str, cavity: Cavity) -> list[Placement]:
    other: Kind = "receiver" if pattern.first == "emitter" else "emitter"
    kinds: tuple[Kind, Kind] = (pattern.first, other)
    return [
        _on_floor(kinds[(k // pattern.columns + k % pattern.columns) % 2], at, origin)
        for k, at in enumerate(_squares(pattern, cavity))
    ]


def _ring_inside(pattern: RingInside, origin: str, cavity: Cavity) -> list[Placement]:
    kinds = interleaved(pattern.emitters, pattern.receivers)
    looks = {"up": (0.0, 0.0), "in": (90.0, 180.0), "out": (90.0, 0.0)}
    tilt, back = looks[pattern.looks]
    places = []
    for kind, share in zip(kinds, ((k + 0.5) / len(kinds) for k in range(len(kinds))), strict=True):
        at, outward = _inside_border(cavity, pattern.inset_mm, share)
        turn = (outward + back) % TURN_DEG if tilt else 0.0
        places.append(_on_floor(kind, at, origin, tilt, turn))
    return places


def _inside_border(cavity: Cavity, inset_mm: float, share: float) -> tuple[tuple[float, float], float]:
    """Point x, y at a share of the line inside the outline, and the outward direction there [deg].

    The line runs counter-clockwise from its corner, or the end of its straight piece, at the lowest x and y.
    """
    length, width = (max(side - 2 * inset_mm, 0.0) for side in (cavity.length_mm, cavity.width_mm))
    radius = min(length, width) / 2 if cavity.has_round_walls else 0.0
    inner, arc = (length - 2 * radius, width - 2 * radius), math.pi / 2 * radius
    left = share * (2 * sum(inner) + 4 * arc)
    x, y, way = inset_mm + radius, inset_mm, 0.0
    for side in range(4):
        run, angle = inner[side % 2], math.radians(way)
        step = min(left, run)
        x, y = x + step * math.cos(angle), y + step * math.sin(angle)
        if left <= run:
            return (x, y), way - 90.0
        left -= run
        turned = min(left / arc, 1.0) * 90.0 if arc else 90.0
        centre = (x - radius * math.sin(angle), y + radius * math.cos(angle))
        out = math.radians(way + turned - 90.0)
        x, y = centre[0] + radius * math.cos(out), centre[1] + radius * math.sin(out)
        if left <= arc and arc:
            return (x, y), way + turned - 90.0
        left -= arc
        way += 90.0
    return (x, y), way - 90.0
