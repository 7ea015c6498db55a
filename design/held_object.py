r"""The objects that a gripper may press into a pad: kinds, sizes, pose and finish, from a line of text or a file.

    cylinder,radius=5,yaw=30                    a kind, then key=value; every key has a default
    box,pose=edge,finish=white                  a box with an edge down
    mesh,file=part.stl,units=mm                 a mesh states its units, since the file does not

In a TOML file, each table `[object]` or `[[object]]` has the same keys, and `kind` for the kind. Lengths are in mm and
angles in degrees; friction has no unit. A number may have another unit: `radius=0.5cm`, `yaw=0.5rad`.

The coordinates have their origin at the object's centre and the z axis out of the pad, so the lowest point touches
first. The pose turns the object about these fixed axes: roll about x, then pitch about y, then yaw about z, all
right-handed. A positive pitch lowers the end at +x.

| kind      | before it is turned                                                                     |
|-----------|-----------------------------------------------------------------------------------------|
| sphere    |                                                                                         |
| ellipsoid | half axes a, b, c along x, y, z                                                         |
| cylinder  | lies on its side, its axis along x                                                      |
| box       | length, width, height along x, y, z; a face, an edge along x, or a corner is down       |
| punch     | a flat face down, its shank upward; the centre is the middle of the face                |
| torus     | a ring that lies flat; radius is that of the circle in the middle of the tube           |
| mesh      | as in its file; the centre is the middle of its bounding box                            |

Edges are rounded: a perfectly sharp edge would have infinite pressure.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

from pydantic import Field, ValidationError, model_validator

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import DesignError, InputError, OptopadError, shown
from optopad.design.fields.base import Model, nearest
from optopad.design.fields.packaged import data_quantities
from optopad.design.fields.quantity import MM_PER_CM, Quantity
from optopad.design.fields.validation import BOUNDS
from optopad.design.files import read_bytes
from optopad.design.io import read_toml

Length = Annotated[float, Field(ge=0.1, le=1000.0)]
Edge = Annotated[
    float | None,
    Field(
        ge=0.05,
        le=1000.0,
        description="radius of its edges, since a sharp edge would have infinite pressure; 0.3, or as much as fits",
    ),
]
Angle = Annotated[float, Field(ge=-360.0, le=360.0)]

LARGEST_FRICTION = 3.0
"""Largest coefficient of friction [-]; soft silicone reaches 2.8 at the lightest loads."""
USUAL_EDGE_MM = 0.3
"""Default radius of an edge [mm]: that of a part without chamfers whose burrs are removed."""
PUNCH_LENGTH_MM = 100.0
"""Length of a punch's shank [mm], which no pad reaches."""
MM_PER = {"mm": 1.0, "um": 1e-3, "cm": MM_PER_CM, "m": 1000.0, "in": 25.4, "inch": 25.4}
"""Units of lengths [mm]."""
DEG_PER = {"deg": 1.0, "°": 1.0, "rad": 180.0 / math.pi}
"""Units of angles [deg]."""
UNITS = dict.fromkeys(("yaw", "pitch", "roll"), DEG_PER) | {"friction": {"": 1.0}}
"""Units by key; all other numbers are lengths."""
MOST_FACETS = 2_000_000
MOST_MESH_BYTES = 500_000_000
"""Largest file of a mesh [bytes]: a text STL of `MOST_FACETS`."""
MESH_KINDS = (".stl", ".ply", ".obj", ".off")
SMALLEST_MESH_MM, SMALL_MESH_MM, LARGEST_MESH_MM = 1.0, 5.0, 2000.0
"""Longest side of a mesh [mm]: refused below the first and above the last, since its units are wrong; doubted below
the second."""
NEEDED_MESH = "a mesh as STL, PLY, OBJ or OFF; export the part from CAD as STL"
RADIAN_STEP = math.pi / 12
RADIAN_DIGITS = 1e-3
"""An angle this close to a multiple of 15 degrees in radians is probably meant in radians."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Facets:
    """The triangles of a mesh.

    Attributes
    ----------
    vertices_mm : (n, 3) corners, relative to the middle of the bounding box [mm]
    triangles : (m, 3) indices of each triangle's corners
    """

    vertices_mm: FloatArray
    triangles: IntArray

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """Length along x, y and z [mm]."""
        x, y, z = 2.0 * self.vertices_mm.max(axis=0)
        return float(x), float(y), float(z)


class HeldObject(Model):
    """What all kinds of objects have: where they are, how they are turned, and how they reflect light."""

    article: ClassVar[str] = "a"

    kind: str
    x: Annotated[
        float | None, Field(description="x of its centre in the cavity; that of --at if left out")
    ] = None
    y: Annotated[
        float | None, Field(description="y of its centre in the cavity; that of --at if left out")
    ] = None
    depth: Annotated[
        float | None,
        Field(ge=0.0, le=100.0, description="depth from first touch; that of the press if left out"),
    ] = None
    yaw: Annotated[Angle, Field(description="turn about z, last")] = 0.0
    pitch: Annotated[Angle, Field(description="turn about y, after roll; it lowers the end at +x")] = 0.0
    roll: Annotated[Angle, Field(description="turn about x, first")] = 0.0
    finish: Annotated[
        Literal["black", "grey", "white", "metal"] | None,
        Field(
            description="diffuse reflectance; metal is bare metal without its mirror reflection; the design's "
            "tip_reflectance if left out"
        ),
    ] = None

    friction: Annotated[
        float | None,
        Field(
            ge=0.0,
            le=LARGEST_FRICTION,
            description="Coulomb's coefficient against the pad, for a sideways load; that of dry silicone if left out",
        ),
    ] = None

    @property
    def reflectance(self) -> Quantity | None:
        """Diffuse reflectance of its finish [-]; None if the design's tip reflectance holds."""
        return None if self.finish is None else data_quantities("finishes.toml")[self.finish]

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        raise NotImplementedError

    @property
    def words(self) -> str:
        """Description for reports and messages, as "a cylinder of radius 5 mm, 10 mm long, turned by 30 deg"."""
        turns = (("turned", self.yaw), ("pitched", self.pitch), ("rolled", self.roll))
        turned = [f"{word} by {angle:g} deg" for word, angle in turns if angle]
        finish = {None: [], "metal": ["of bare metal"]}.get(self.finish, [f"{self.finish}"])
        return ", ".join([f"{self.article} {self.form}", *turned, *finish])

    @property
    def line(self) -> str:
        """Text from which `held_of` makes the object: all sizes, and what else differs from its default."""
        usual = {name: field.default for name, field in HeldObject.model_fields.items()}
        names = sorted(type(self).model_fields, key=HeldObject.model_fields.__contains__)
        given = {name: value for name in names if (value := getattr(self, name)) != usual.get(name)}
        del given["kind"]
        numbers = {name: f"{value:.10g}" for name, value in given.items() if isinstance(value, float)}
        return ",".join([self.kind, *(f"{name}={value}" for name, value in (given | numbers).items())])

    @property
    def notes(self) -> tuple[str, ...]:
        """Hints about values that are accepted but may not be meant."""
        angles = {"yaw": self.yaw, "pitch": self.pitch, "roll": self.roll}
        return tuple(
            f"{name}={angle:g} is taken as degrees; if it is in radians, write {name}={round(math.degrees(angle)):g}"
            for name, angle in angles.items()
            if _looks_like_radians(angle)
        )


class Sphere(HeldObject):
    """A ball."""

    kind: Literal["sphere"] = "sphere"
    radius: Annotated[Length, Field(description="radius")] = 3.0

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        return f"sphere of radius {self.radius:g} mm"


class Ellipsoid(HeldObject):
    """An ellipsoid with its axes along x, y and z before it is turned."""

    article: ClassVar[str] = "an"

    kind: Literal["ellipsoid"] = "ellipsoid"
    a: Annotated[Length, Field(description="half axis along x")] = 6.0
    b: Annotated[Length, Field(description="half axis along y")] = 4.0
    c: Annotated[Length, Field(description="half axis along z")] = 3.0

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        return f"ellipsoid with half axes of {self.a:g}, {self.b:g} and {self.c:g} mm"


class Edged(HeldObject):
    """An object whose edges are rounded."""

    edge: Edge = None

    @property
    def room_for_edge_mm(self) -> float:
        """Largest radius of its edges [mm]."""
        raise NotImplementedError

    @property
    def edge_mm(self) -> float:
        """Radius of its edges [mm]."""
        return min(USUAL_EDGE_MM, self.room_for_edge_mm) if self.edge is None else self.edge

    @model_validator(mode="after")
    def _edge_fits(self) -> Self:
        if self.edge_mm > self.room_for_edge_mm:
            raise ValueError(
                f"edge={self.edge_mm:g} is refused: must be at most {self.room_for_edge_mm:g} mm, or the object has no "
                "room for it"
            )
        return self


class Cylinder(Edged):
    """A cylinder on its side, its axis along x before it is turned."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Annotated[Length, Field(description="radius")] = 5.0
    length: Annotated[Length, Field(description="length of its axis")] = 10.0

    @property
    def room_for_edge_mm(self) -> float:
        """Largest radius of its edges [mm]."""
        return min(self.radius, self.length / 2)

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        return f"cylinder of radius {self.radius:g} mm, {self.length:g} mm long"


class Box(Edged):
    """A box with a face, an edge along x or a corner down, before it is turned further."""

    kind: Literal["box"] = "box"
    length: Annotated[Length, Field(description="length along x")] = 8.0
    width: Annotated[Length, Field(description="length along y")] = 8.0
    height: Annotated[Length, Field(description="length along z")] = 8.0
    pose: Annotated[
        Literal["face", "edge", "corner"],
        Field(description="what is straight below its centre; edge is the edge along its length"),
    ] = "face"

    @property
    def room_for_edge_mm(self) -> float:
        """Largest radius of its edges [mm]."""
        return min(self.length, self.width, self.height) / 2

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        down = "" if self.pose == "face" else f", {'an edge' if self.pose == 'edge' else 'a corner'} down"
        return f"box of {self.length:g} x {self.width:g} x {self.height:g} mm{down}"


class Punch(Edged):
    """A flat punch that stands upright."""

    kind: Literal["punch"] = "punch"
    radius: Annotated[Length, Field(description="radius of face and shank")] = 2.5

    @property
    def room_for_edge_mm(self) -> float:
        """Largest radius of its edges [mm]."""
        return min(self.radius, PUNCH_LENGTH_MM / 2)

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        return f"flat punch of radius {self.radius:g} mm, its edge rounded by {self.edge_mm:g} mm"


class Torus(HeldObject):
    """A ring that lies flat before it is turned."""

    kind: Literal["torus"] = "torus"
    radius: Annotated[Length, Field(description="radius of the circle in the middle of the tube")] = 4.0
    tube: Annotated[Length, Field(description="radius of the tube")] = 1.25

    @model_validator(mode="after")
    def _has_a_hole(self) -> Self:
        if self.tube >= self.radius:
            raise ValueError(
                f"tube={self.tube:g} is refused: must be below radius = {self.radius:g} mm, or the ring has no hole"
            )
        return self

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        return f"torus of radius {self.radius:g} mm, its tube of radius {self.tube:g} mm"


class Mesh(HeldObject):
    """A part as a closed mesh from a file, read when the object is made."""

    kind: Literal["mesh"] = "mesh"
    file: Annotated[Path, Field(description="mesh of the part: STL, PLY, OBJ or OFF")]
    units: Annotated[
        Literal["mm", "cm", "m", "inch"] | None, Field(description="units of the file's lengths; required")
    ] = None

    @cached_property
    def facets(self) -> Facets:
        """Its triangles; InputError if the file is no closed mesh or its units are missing or implausible."""
        return _read_facets(self.file, self.units)

    @model_validator(mode="after")
    def _is_read(self) -> Self:
        assert self.facets is not None  # reading is the check
        return self

    @property
    def form(self) -> str:
        """Kind and sizes in words."""
        return f"mesh {self.file.name} of {_sides(self.facets.size_mm)} mm"

    @property
    def notes(self) -> tuple[str, ...]:
        """Hints about values that are accepted but may not be meant."""
        size = self.facets.size_mm
        if self.units != "mm" or max(size) >= SMALL_MESH_MM:
            return super().notes
        return (
            *super().notes,
            f"{self.file}: measures only {_sides(size)} mm; if the file is in inch or cm, write units=inch or units=cm",
        )


KINDS: dict[str, type[HeldObject]] = {
    kind.model_fields["kind"].default: kind for kind in (Sphere, Ellipsoid, Cylinder, Box, Punch, Torus, Mesh)
}


def held_of(text: str, folder: Path = Path()) -> HeldObject:
    """Parse an object from a text such as ``cylinder,radius=5,yaw=30``; the file of a mesh is relative to `folder`.

    Raises
    ------
    InputError : a kind, key or value is invalid, or a mesh cannot be used.
    """
    kind, *pieces = (piece.strip() for piece in text.split(","))
    where = f"object {shown(text)}"
    given: dict[str, Any] = {}
    for piece in pieces:
        key, equals, value = (part.strip() for part in piece.partition("="))
        if not (key and equals and value):
            raise InputError(f"{where}: {piece!r} is refused: write key=value, as cylinder,radius=5,yaw=30")
        if key in given:
            raise InputError(f"{where}: {key} is given twice; keep one")
        given[key] = value
    return _made(kind, given, where, folder, InputError)


def held_with(held: HeldObject, given: Mapping[str, str], where: str, folder: Path) -> HeldObject:
    """An object with other values of some keys, given as text; `where` and `folder` are as in `_made`.

    A mesh that is only turned or painted is not read again.

    Raises
    ------
    InputError : a key or value is invalid, or a mesh cannot be used.
    """
    common = {key: value for key, value in given.items() if key in HeldObject.model_fields}
    if own := given.keys() - common.keys():
        kept = held.model_dump(exclude_unset=True, exclude={"kind"})
        if "file" in kept:
            kept["file"] = kept["file"].absolute()
        held = _made(held.kind, kept | {key: given[key] for key in own}, where, folder, InputError)
    pose = _made("sphere", common, where, folder, InputError)
    return held.model_copy(update={key: getattr(pose, key) for key in common})


def read_held(file: Path) -> tuple[HeldObject, ...]:
    """Read the objects of a TOML file, the tables `[object]` or `[[object]]`.

    Raises
    ------
    DesignError : the file is not readable as TOML, has no objects, or a kind, key or value is invalid.
    InputError : a mesh cannot be used.
    """
    document = read_toml(file)
    found = document.pop("object", None)
    tables = [found] if isinstance(found, dict) else found
    if document or not tables or not all(isinstance(table, dict) for table in tables):
        said = f"{next(iter(document))!r} is no table of objects" if document else "has no objects"
        raise DesignError(
            f'{file}: {said}; write each as a table [[object]] with its kind: kind = "cylinder"'
        )
    return tuple(
        _made(str(table.pop("kind", "")), table, f"{file}: object {number}", file.parent, DesignError)
        for number, table in enumerate(tables, start=1)
    )


def _made(
    kind: str, given: Mapping[str, Any], where: str, folder: Path, error: type[OptopadError]
) -> HeldObject:
    """Make an object; its error names `where`, and the file of a mesh is relative to `folder`."""
    if kind not in KINDS:
        near = nearest(kind.lower(), tuple(KINDS))
        hint = f"did you mean {near[0]}? " if near else ""
        raise error(f"{where}: {shown(kind)} is no kind of object; {hint}Kinds: {', '.join(KINDS)}")
    fields = dict(
        sorted(KINDS[kind].model_fields.items(), key=lambda field: field[0] in HeldObject.model_fields)
    )
    del fields["kind"]
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key not in fields:
            near = nearest(key, tuple(fields))
            hint = f"did you mean {near[0]}? " if near else ""
            raise error(f"{where}: {key} is no key of a {kind}; {hint}Keys: {', '.join(fields)}")
        is_number = float in (fields[key].annotation, *get_args(fields[key].annotation))
        fault, values[key] = _number(key, value) if is_number else (None, value)
        if fault:
            raise error(f"{where}: {fault}")
    if "file" in values:
        values["file"] = folder / str(values["file"])
    try:
        return KINDS[kind](**values)
    except ValidationError as err:
        raise error(f"{where}: {_fault(err)}") from None


_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\W\d_]+|°)?")


def _number(key: str, value: Any) -> tuple[str | None, float]:
    """What is wrong with the number of a key, if anything, and the number in mm or degrees."""
    units = UNITS.get(key, MM_PER)
    usual = next(iter(units))
    text = "" if isinstance(value, bool) else str(value)
    found = _NUMBER.fullmatch(text.strip())
    number = float(found[1]) * units.get(found[2] or usual, math.nan) if found else math.nan
    if math.isfinite(number):
        return None, number
    wanted = (
        f"a number in {usual}, as {key}=5, or with a unit: {', '.join(units)}"
        if usual
        else "a number without unit"
    )
    return f"{key}={value} is refused: must be {wanted}", number


def _fault(err: ValidationError) -> str:
    """The first finding of a validation in words."""
    detail = err.errors(include_url=False)[0]
    key, kind, value = ".".join(map(str, detail["loc"][:1])), detail["type"], detail["input"]
    if kind == "value_error":
        return detail["msg"].removeprefix("Value error, ")
    if kind == "missing":
        return f"{key} is missing; write mesh,file=part.stl,units=mm"
    if kind in BOUNDS:
        unit = next(iter(UNITS.get(key, MM_PER)))
        bound = f"{BOUNDS[kind]} {next(iter(detail['ctx'].values())):g} {unit}".strip()
        return f"{key}={value:g} is refused: must be {bound}"
    if kind == "literal_error":
        near = nearest(str(value), tuple(re.findall(r"'(\w+)'", detail["ctx"]["expected"])))
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"{key}={value} is refused: must be {detail['ctx']['expected']}{hint}"
    return f"{key}={value} is refused: {detail['msg'].lower()}"


def _looks_like_radians(angle: float) -> bool:
    """Whether an angle is a multiple of 15 degrees in radians, of one turn at most, and no whole number."""
    steps = round(angle / RADIAN_STEP)
    return 0 < abs(steps) <= 24 and angle != round(angle) and abs(angle - steps * RADIAN_STEP) < RADIAN_DIGITS


def _sides(size_mm: tuple[float, float, float]) -> str:
    return " x ".join(f"{side:.3g}" for side in size_mm)


def _read_facets(file: Path, units: str | None) -> Facets:
    """Triangles of a closed mesh, in mm and relative to the middle of its bounding box."""
    import numpy as np
    import trimesh

    if file.suffix.lower() not in MESH_KINDS:
        raise InputError(f"{file}: this kind of file is not read; needs {NEEDED_MESH}")
    content = read_bytes(file, needed=NEEDED_MESH, most_bytes=MOST_MESH_BYTES)
    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=file.suffix.lower()[1:], skip_materials=True)
        corners, triangles = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        is_closed = bool(mesh.is_watertight)
    except Exception as err:  # readers of foreign files raise errors of any class
        raise InputError(
            f"{file}: no mesh could be read ({type(err).__name__}); needs {NEEDED_MESH}"
        ) from None
    if len(triangles) == 0 or not np.isfinite(corners).all():
        raise InputError(f"{file}: has no triangles, or corners that are not finite; needs {NEEDED_MESH}")
    if len(triangles) > MOST_FACETS:
        raise InputError(
            f"{file}: has {len(triangles)} triangles; at most {MOST_FACETS}: export it with a coarser tolerance"
        )
    low, high = corners.min(axis=0), corners.max(axis=0)
    plain = _sides(tuple(high - low))
    if units is None:
        raise InputError(
            f"{file}: a mesh file does not state its units; add units=mm, cm, m or inch (it measures {plain} of them)"
        )
    if not is_closed:
        raise InputError(
            f"{file}: is not watertight: some edges do not join two triangles; close its holes in CAD, and export it "
            "as one solid"
        )
    longest = float((high - low).max())
    if not _is_plausible(longest, units):
        fitting = [f"units={name}" for name in ("mm", "cm", "m", "inch") if _is_plausible(longest, name)]
        way_out = (
            f"if the file is in another unit, write {' or '.join(fitting)}" if fitting else "scale it in CAD"
        )
        raise InputError(
            f"{file}: units={units} is refused: the part would be {longest * MM_PER[units]:g} mm long, and must be "
            f"{SMALLEST_MESH_MM:g} to {LARGEST_MESH_MM:g} mm; {way_out}"
        )
    return Facets(vertices_mm=(corners - (low + high) / 2) * MM_PER[units], triangles=triangles)


def _is_plausible(length: float, unit: str) -> bool:
    return SMALLEST_MESH_MM <= length * MM_PER[unit] <= LARGEST_MESH_MM
