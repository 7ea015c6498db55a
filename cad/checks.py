r"""Checks files for printing: whether each file is the intended part, and whether the part can be printed.

The checks read the STL file as written, not the CAD solid. They check that

- the file is one closed body with consistent winding (trimesh finds open seams that CAD kernels miss) and a manifold
  (manifold3d)
- the volumes of file and solid agree with a formula (`optopad.cad.volume`)
- size and area of overhanging faces are within limits
- the mold's cavity and the lid's concave face, the dish, agree with the optical model.

Widths of walls and webs are computed from the parameters (`optopad.design.mold.webs`, `optopad.cad.lid`), not from the
mesh. The checks do not cover warping or the quality of thin walls on a given printer. Slicing is optional
(`with_slices`).

The cavity check traces rays from points inside the cavity to the triangles of the mold. The optical model has flat
walls, round walls between flat facets, the bottom and the top (`optopad.design.shape.cavity`). The ends of the rays are
compared with these surfaces, except in the openings of sockets and filling holes. For a round wall, the check compares
the printed point's distance from the wall, because the printed chords are slightly inside the circle.

A lid shapes the crowned top of a pad. The dish check traces vertical rays upward from the bottom of the clear layer to
the triangles of the lid. It covers the whole pad except the gap around the lid's plug.

Intersections use the barycentric form of Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import manifold3d
import numpy as np
import trimesh

from optopad.cad.lid import lid_clearances, lid_size, turned_over
from optopad.cad.mesh import CHORD_LIMIT_MM, Mesh, read_stl, unit_normals
from optopad.cad.slicer import EXTRUDED_HIGH, EXTRUDED_LOW, Sliced, require_slicer, sliced
from optopad.cad.slicer import VOLUME_LIMIT as SLICER_VOLUME_LIMIT
from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.lettering import OVERLAP
from optopad.design.mold.outline import MoldOutline, bed_lift_mm, outline_of
from optopad.design.mold.part_numbers import unnumbered
from optopad.design.mold.sockets import Socket
from optopad.design.mold.webs import bodies_above_rim, clearances, pockets_below_clear_layer, tightest
from optopad.design.parts.assumptions import Bed, printer, usual_bed_mm
from optopad.design.parts.catalog import find_mold_material
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.shape.outline import Arc, Line
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of

Floats = FloatArray

CHUNK_RAYS = 64
EDGE_MM = 1e-6
"""Rays that end this close to the edge of a socket's opening or to the fill line are ambiguous and are left out."""
CHORD_EDGE_MM = 0.02
"""The same limit as `EDGE_MM` for a round edge, which is printed as chords."""
FAR_MM = 1000.0
"""Length assigned to a ray that hits nothing because it left through a slot or through a hole in the mesh."""


@dataclass(frozen=True, kw_only=True)
class CavityAgreement:
    """Differences between the printed cavity and the cavity of the optical model, measured by rays from inside.

    Attributes
    ----------
    compared : number of rays that end on a wall or on the bottom
    windows : number of rays that leave through the opening of a socket
    worst_mm : largest distance between the printed and the modelled end of a ray, for flat walls and the bottom
    worst_round_mm : largest distance from the round wall to a printed end; 0 for a cavity without a round wall
    shallowest_window_mm : smallest distance behind the wall at which a ray through a socket ends; None if no ray leaves
        through a socket
    """

    compared: int
    windows: int
    worst_mm: float
    worst_round_mm: float
    shallowest_window_mm: float | None


@dataclass(frozen=True, kw_only=True)
class DishAgreement:
    """Differences between the printed lid and the top of the pad in the optical model.

    Attributes
    ----------
    compared : number of rays that end in the dish, the lid's concave face
    worst_mm : largest distance of a printed point from the modelled top, along the normal of the top
    """

    compared: int
    worst_mm: float


def first_hits_mm(mesh: Mesh, origins_mm: Floats, directions: Floats) -> Floats:
    """Distance from the origin of each ray to the first triangle that it hits.

    Parameters
    ----------
    origins_mm : start points, shape (n, 3)
    directions : unit vectors, shape (n, 3)

    Returns
    -------
    distances, shape (n,) [mm]; infinite for a ray without a hit
    """
    planes = _planes(mesh)
    pieces = [
        _nearest(planes, origins_mm[k : k + CHUNK_RAYS], directions[k : k + CHUNK_RAYS])
        for k in range(0, len(origins_mm), CHUNK_RAYS)
    ]
    return np.concatenate(pieces)


@dataclass(frozen=True, kw_only=True)
class _Planes:
    """The m triangles of a mesh, with precomputed products for intersections with rays.

    Each triangle has a corner a, and edges e1 and e2 from it. The arrays `edge1`, `edge2`, `normal` n = e1 x e2,
    `moment1` = e1 x a and `moment2` = e2 x a have the shape (3, m), and `level` = n . a has the shape (m,).
    """

    edge1: Floats
    edge2: Floats
    normal: Floats
    moment1: Floats
    moment2: Floats
    level: Floats


def _planes(mesh: Mesh) -> _Planes:
    corners = mesh.corners
    a, edge1, edge2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(edge1, edge2)
    return _Planes(
        edge1=edge1.T,
        edge2=edge2.T,
        normal=normal.T,
        moment1=np.cross(edge1, a).T,
        moment2=np.cross(edge2, a).T,
        level=np.einsum("ti,ti->t", normal, a),
    )


def _nearest(planes: _Planes, origins: Floats, directions: Floats) -> Floats:
    """Distance along each ray to the first triangle that it hits, shape (n,); infinite without a hit.

    The ray from o along d meets the triangle with a corner a and edges e1, e2 where o + t d = a + u e1 + v e2. With
    n = e1 x e2 and m = o x d, the solutions are matrix products:

    t = (n.a - n.o) / n.d,   u = (d.(e2 x a) - m.e2) / n.d,   v = (m.e1 - d.(e1 x a)) / n.d
    """
    moment, along = np.cross(origins, directions), directions @ planes.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / along
        t = (planes.level - origins @ planes.normal) * inverse
        u = (directions @ planes.moment2 - moment @ planes.edge2) * inverse
        v = (moment @ planes.edge1 - directions @ planes.moment1) * inverse
        hit = (np.abs(along) > 1e-12) & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0)
    nearest: Floats = np.where(hit, t, np.inf).min(axis=1)
    return nearest


def cavity_agreement(design: SensorDesign, mesh: Mesh, *, rays: int = 400, seed: int = 0) -> CavityAgreement:
    """Compare the cavity of a printed mold with the optical model.

    Parameters
    ----------
    mesh : the mold as in its file, with the print bed at z = 0
    rays : number of rays, which start at random points in the clear layer, in random directions
    """
    outline = outline_of(design)
    origins, directions = _random_rays(outline, rays, seed)
    modelled, ends, is_round = _exits(outline, origins, directions)
    stays = (ends[:, 2] < outline.fill_mm - EDGE_MM) & ~_in_filling_holes(outline, ends)
    stays &= ~(is_round & _beside_facets(outline, ends))
    origins, directions, modelled = origins[stays], directions[stays], modelled[stays]
    ends, is_round = ends[stays], is_round[stays]
    lifted = origins + np.array([0.0, 0.0, bed_lift_mm(design)])
    printed = np.minimum(first_hits_mm(mesh, lifted, directions), FAR_MM)
    places = origins + printed[:, None] * directions
    inside, near = _windows(outline, ends)
    walls, windows = ~inside & ~near, inside & ~near
    depth = _behind_wall_mm(outline, places)[windows]
    off = np.where(is_round, _off_round_wall_mm(outline, places), np.abs(printed - modelled))
    return CavityAgreement(
        compared=int(walls.sum()),
        windows=int(windows.sum()),
        worst_mm=float(off[walls & ~is_round].max(initial=0.0)),
        worst_round_mm=float(off[walls & is_round].max(initial=0.0)),
        shallowest_window_mm=float(depth.min()) if len(depth) else None,
    )


def dish_agreement(design: SensorDesign, mesh: Mesh, *, rays: int = 1000, seed: int = 0) -> DishAgreement:
    """Compare a printed lid with the crowned top in the optical model.

    Parameters
    ----------
    mesh : the lid as in its file, with its back on the print bed
    rays : number of vertical rays, which start at random points in the pad's bounding rectangle
    """
    outline, size = outline_of(design), lid_size(design)
    assert size is not None, f"{design.name}: a flat top has no lid"
    spread = np.random.default_rng(seed).uniform(size=(rays, 2))
    spots = spread * np.array([outline.length_mm, outline.width_mm])
    plan = outline.plan
    formed = [plan.contains(x, y) and size.forms_top(plan, x, y, margin_mm=CHORD_EDGE_MM) for x, y in spots]
    if not any(formed):
        return DishAgreement(compared=0, worst_mm=0.0)
    spots = spots[formed]
    top = np.array([plan.top_mm(x, y) for x, y in spots])
    steep = np.array([plan.normal(x, y)[2] for x, y in spots])
    below = np.column_stack([spots, np.full(len(spots), outline.cavity_bottom_mm)])
    up = np.tile([0.0, 0.0, 1.0], (len(spots), 1))
    way = np.minimum(first_hits_mm(turned_over(mesh, design, size), below, up), FAR_MM)
    off = np.abs(way + outline.cavity_bottom_mm - top) * steep
    return DishAgreement(compared=len(spots), worst_mm=float(off.max(initial=0.0)))


def _random_rays(outline: MoldOutline, count: int, seed: int) -> tuple[Floats, Floats]:
    """Origins and unit directions of random rays in the clear layer, both of shape (n, 3) with n at most `count`."""
    random = np.random.default_rng(seed)
    plan = outline.plan
    size = np.array([outline.length_mm, outline.width_mm, plan.rim_mm[0]])
    directions = random.normal(size=(count, 3))
    origins = random.uniform(0.1, 0.9, (count, 3)) * size
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    within = plan.outline.contains(origins[:, 0], origins[:, 1])
    return origins[within], directions[within]


def _exits(outline: MoldOutline, origins: Floats, directions: Floats) -> tuple[Floats, Floats, BoolArray]:
    """For each ray: distance to the modelled cavity's surface, end point there, and whether this is on a round wall."""
    plan = outline.plan
    to_flat = [_to_level(directions[:, 2], origins[:, 2], outline.cavity_bottom_mm, outline.top_mm)]
    for wall in plan.walls:
        (x, y), (nx, ny) = wall.origin, wall.outward
        gap = (x - origins[:, 0]) * nx + (y - origins[:, 1]) * ny
        speed = directions[:, 0] * nx + directions[:, 1] * ny
        to_flat.append(_where_positive(gap, speed))
    distance = np.minimum.reduce(to_flat)
    is_round = np.zeros(len(origins), dtype=bool)
    for arc in plan.outline.bare.arcs:
        around = _to_arc(arc, origins, directions)
        is_round, distance = is_round | (around < distance), np.minimum(around, distance)
    return distance, origins + distance[:, None] * directions, is_round


def _to_level(speed: Floats, height: Floats, low: float, high: float) -> Floats:
    return np.asarray(np.where(speed > 0, high - height, low - height) / speed)


def _where_positive(gap: Floats, speed: Floats) -> Floats:
    """Gap divided by speed where the speed is positive, and infinity elsewhere."""
    steps: Floats = np.divide(gap, speed, out=np.full(len(gap), np.inf), where=speed > 0)
    return steps


def _to_arc(arc: Arc, origins: Floats, directions: Floats) -> Floats:
    """Distance along each ray to a round wall, shape (n,) [mm]; infinite for a ray that hits another wall."""
    from_middle, level = origins[:, :2] - np.array(arc.centre_mm), directions[:, :2]
    speed2 = np.einsum("ij,ij->i", level, level)
    towards = np.einsum("ij,ij->i", from_middle, level)
    room = arc.radius_mm**2 - np.einsum("ij,ij->i", from_middle, from_middle)
    square = towards**2 + speed2 * room
    far = (np.sqrt(np.maximum(square, 0.0)) - towards) / speed2
    end = from_middle + far[:, None] * level
    return np.where((square >= 0.0) & arc.spans(np.arctan2(end[:, 1], end[:, 0])), far, np.inf)


def _off_round_wall_mm(outline: MoldOutline, places: Floats) -> Floats:
    """Radial distance of points from the round wall, shape (n,) [mm]; infinite in directions without an arc."""
    off = np.full(len(places), np.inf)
    for arc in outline.plan.outline.bare.arcs:
        x, y = (places[:, :2] - np.array(arc.centre_mm)).T
        off = np.where(
            arc.spans(np.arctan2(y, x)), np.minimum(off, np.abs(np.hypot(x, y) - arc.radius_mm)), off
        )
    return off


def _in_filling_holes(outline: MoldOutline, ends: Floats) -> BoolArray:
    """Whether each end point of a ray is in a filling hole in the floor, or so near its edge that this is ambiguous."""
    found = np.zeros(len(ends), dtype=bool)
    on_floor = ends[:, 2] < outline.cavity_bottom_mm + EDGE_MM
    for hole in outline.filling:
        apart = np.hypot(ends[:, 0] - hole.x, ends[:, 1] - hole.y)
        found |= on_floor & (apart < hole.radius + CHORD_EDGE_MM)
    return found


def _beside_facets(outline: MoldOutline, ends: Floats) -> BoolArray:
    """Whether each end point of a ray is so near the end of a facet that it may be on either wall."""
    corners = [wall.point(along) for wall in outline.plan.walls for along in (0.0, wall.length_mm)]
    found = np.zeros(len(ends), dtype=bool)
    for x, y in corners:
        found |= np.hypot(ends[:, 0] - x, ends[:, 1] - y) < CHORD_EDGE_MM
    return found


def _windows(outline: MoldOutline, ends: Floats) -> tuple[BoolArray, BoolArray]:
    """For each end point of a ray: whether it is in a socket's opening, and whether it is too near the edge to say."""
    inside = np.zeros(len(ends), dtype=bool)
    near = np.zeros(len(ends), dtype=bool)
    for socket in outline.sockets:
        signed = _inside_window_mm(socket, ends)
        inside |= signed > 0
        near |= np.abs(signed) < EDGE_MM
    return inside, near


def _inside_window_mm(socket: Socket, ends: Floats) -> Floats:
    """Distance of each end point inside the edge of a socket's opening [mm]; negative outside or on another wall."""
    line, pocket = socket.frame.line, socket.pocket
    across, along = _outward_mm(line, ends), (ends[:, :2] - np.array(line.origin)) @ np.array(line.tangent)
    inward = np.minimum.reduce([along - pocket.along0, pocket.along1 - along, ends[:, 2] - pocket.floor])
    on_wall = np.abs(across) < EDGE_MM
    signed: Floats = np.where(on_wall, inward, -np.inf)
    return signed


def _outward_mm(line: Line, points: Floats) -> Floats:
    """Distance of points behind a flat wall [mm]; negative for points on the cavity's side."""
    return np.asarray((points[:, :2] - np.array(line.origin)) @ np.array(line.outward))


def _behind_wall_mm(outline: MoldOutline, points: Floats) -> Floats:
    """Largest distance of each point behind any of the flat walls [mm]; negative inside the cavity."""
    depth: Floats = np.maximum.reduce([_outward_mm(wall, points) for wall in outline.plan.walls])
    return depth


State = Literal["ok", "warning", "error"]

VOLUME_LIMIT = 1e-3
"""Limit of the relative volume difference between file and formula, which is mainly due to chords of round faces."""
SOLID_LIMIT = 1e-6
"""Limit of the relative volume difference between solid and formula, which is only due to rounding."""
WALL_LIMIT_MM = 1e-4
"""Limit of the deviation of flat walls; rounding to single precision causes up to 3e-5 mm at sizes up to 400 mm."""
OVERHANG_DEG = 45.0
"""Faces that overhang by more than this angle from the vertical need support."""
THIN_LAYER_MM = 0.1
"""Layer thickness of a fine print, which is the height of the steps in a lid's concave face before smoothing."""
OVERHANG_LIMIT_MM2 = 0.5
"""Overhanging area up to which no support is recommended, because support leaves marks."""


@dataclass(frozen=True, kw_only=True)
class PartFile:
    """A part to print: the content of its STL file, and its volume by the CAD kernel and by formula [mm3]."""

    name: str
    stl: bytes
    solid_mm3: float
    formula_mm3: float


@dataclass(frozen=True, kw_only=True)
class MoldCheck:
    """Comparison of one measured value with its limit.

    Attributes
    ----------
    name : name of the part and of the measured value
    value, limit, unit : the measured value, its limit, and the unit of both
    state : result of the comparison: `ok`, `warning` (the part can still be made) or `error`
    note : position of the worst value, or advice; may be empty
    """

    name: str
    value: float
    limit: float
    unit: str
    state: State
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Checks:
    """All findings of a design's printed parts.

    Attributes
    ----------
    digest : hash of the design's content
    findings : findings in the order of the parts
    volumes_mm3 : for each part, its volumes `stl`, `solid` and `formula`
    prints : for each sliced part, `minutes` and `filament_g`; empty without slicing
    """

    digest: str
    findings: tuple[MoldCheck, ...]
    volumes_mm3: dict[str, dict[str, float]]
    prints: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def is_ok(self) -> bool:
        """Whether no finding is an error; warnings are allowed."""
        return all(finding.state != "error" for finding in self.findings)

    def as_dict(self) -> dict[str, Any]:
        """The checks as plain data for a JSON file."""
        return {
            "ok": self.is_ok,
            "digest": self.digest,
            "volumes_mm3": self.volumes_mm3,
            **({"prints": self.prints} if self.prints else {}),
            "findings": [asdict(finding) for finding in self.findings],
        }


def check_parts(design: SensorDesign, parts: tuple[PartFile, ...], *, bed_mm: Bed | None = None) -> Checks:
    """Check every printed part of a design, including the cavity of the `mold` and the concave face of the `lid`.

    Parameters
    ----------
    parts : the parts as written to their files
    bed_mm : build volume of the printer (x, y, height) for the size check; if None, that of a typical printer
    """
    bed, bridged = bed_mm or usual_bed_mm(), bridged_mm2(design)
    findings: list[MoldCheck] = []
    volumes = {}
    for part in parts:
        loaded = trimesh.load_mesh(io.BytesIO(part.stl), file_type="stl")
        findings += _body(part.name, loaded) + _volumes(part, float(loaded.volume))
        findings += _printing(part.name, read_stl(part.stl), bed, bridged.get(part.name, 0.0))
        volumes[part.name] = {
            "stl": round(float(loaded.volume), 4),
            "solid": round(part.solid_mm3, 4),
            "formula": round(part.formula_mm3, 4),
        }
        if part.name == "mold":
            findings += _mold_size(design, loaded.extents) + _cavity(design, read_stl(part.stl))
        if part.name == "lid":
            findings.append(_dish(design, read_stl(part.stl)))
    return Checks(digest=design.digest, findings=(*findings, *design_findings(design)), volumes_mm3=volumes)


def with_slices(
    checks: Checks, design: SensorDesign, parts: tuple[PartFile, ...], bed_mm: Bed | None
) -> Checks:
    """The given checks with the slicer's findings about every printed part added.

    Raises
    ------
    InputError : no slicer is installed on this computer.
    """
    density = find_mold_material(entries_of(design), design.mold.material).density_g_per_cm3.value
    room, program = bed_mm or usual_bed_mm(), require_slicer()
    findings, prints = list(checks.findings), {}
    for part in parts:
        if part.name == "mold" and design.mold.pieces != "one":
            continue
        one = sliced(part.stl, density_g_per_cm3=density, bed_mm=room, command=program)
        findings += _slicing(part, one)
        prints[part.name] = {"minutes": round(one.minutes, 1), "filament_g": round(one.filament_g, 2)}
    return replace(checks, findings=tuple(findings), prints=prints)


def _slicing(part: PartFile, one: Sliced) -> list[MoldCheck]:
    ratio = one.extruded_mm3 / part.formula_mm3
    is_whole = EXTRUDED_LOW <= ratio <= EXTRUDED_HIGH
    return [
        _exact(f"{part.name}: manifold to the slicer", int(one.is_manifold), 1, "yes"),
        _at_most(
            f"{part.name}: volume in the slicer against the formula",
            round(abs(one.volume_mm3 / part.formula_mm3 - 1), 6),
            SLICER_VOLUME_LIMIT,
            "share",
        ),
        MoldCheck(
            name=f"{part.name}: extruded by a solid print",
            value=round(ratio, 4),
            limit=EXTRUDED_HIGH if ratio > 1 else EXTRUDED_LOW,
            unit="share",
            state="ok" if is_whole else "warning",
            note="" if is_whole else "thin walls are dropped or doubled; see mold.min_web_mm",
        ),
        MoldCheck(
            name=f"{part.name}: warnings of the slicer",
            value=len(one.warnings),
            limit=0,
            unit="warnings",
            state="warning" if one.warnings else "ok",
            note="; ".join(one.warnings),
        ),
    ]


def design_findings(design: SensorDesign) -> tuple[MoldCheck, ...]:
    """Findings from the design's numbers alone: thinnest webs, lid, lettering, and bodies outside the clear layer."""
    outline = outline_of(design)
    webs = [
        MoldCheck(
            name=f"mold: {one.name}",
            value=round(one.value_mm, 4),
            limit=one.needed_mm,
            unit="mm",
            state="ok" if one.is_kept else "error",
            note=one.where,
        )
        for one in tightest(clearances(outline, design.mold))
    ]
    tall, deep = bodies_above_rim(outline), pockets_below_clear_layer(outline)
    return (
        *webs,
        *_lid(design),
        *_lettering(design),
        _count("bodies above the rim", tall, "in the way of the leveling blade; raise mold.rim_mm"),
        _count("pockets below the clear layer", deep, "the black layer touches these bodies"),
    )


def _lid(design: SensorDesign) -> Iterator[MoldCheck]:
    """Findings about the thinnest parts of a lid, and about the optical smoothness of its concave face."""
    for one in lid_clearances(design):
        state: State = "ok" if one.is_kept else "warning"
        note = "" if one.is_kept else f"raise {one.field}; dowels in the fixing holes replace the pins"
        yield MoldCheck(
            name=f"lid: {one.name}",
            value=round(one.value_mm, 4),
            limit=one.needed_mm,
            unit="mm",
            state=state,
            note=note,
        )
    size = lid_size(design)
    if size is None:
        return
    cavity = cavity_of(design)
    clear, black = (
        volume / 1e3 for volume in (cavity.plan.clear_volume_mm3, cavity.plan.area_mm2 * cavity.black_mm)
    )
    straight = cavity.plan.top.straight
    turned = straight is not None and any(notch.frame.is_facet for notch in size.notches)
    yield MoldCheck(
        name="lid: steps of layers in the dish, as printed",
        value=THIN_LAYER_MM,
        limit=0.0,
        unit="mm",
        state="warning",
        note="they become haze on the crown: print the lid dish up in layers of 0.1 mm, then fill and wet-sand the "
        "dish, or smooth ABS in vapour; or lay a formed film of 0.1 to 0.2 mm PET into it, which makes the "
        f"layer thinner by as much. Filled upside down: {clear:.2f} cm3 clear, then {black:.2f} cm3 black"
        + (f". On the round mold its notches are along {straight}" if turned else ""),
    )


def _lettering(design: SensorDesign) -> Iterator[MoldCheck]:
    """Findings about strokes and gaps of the lettering, parts without a name, and channels for leads."""
    outline, narrowest = outline_of(design), printer("narrowest_stroke").value
    widths = {"numbers": [one.stroke_mm for one in outline.numbers]}
    widths["label"] = [outline.label.stroke_mm] if outline.label.strokes else []
    for what, strokes in widths.items():
        if strokes:
            yield _at_least(f"mold: narrowest stroke of the {what}", min(strokes), narrowest)
            gap = min(strokes) / OVERLAP * (2 - OVERLAP)
            yield _at_least(f"mold: narrowest gap of the {what}", gap, narrowest)
    spans = [s.channel.along1 - s.channel.along0 for s in outline.sockets if s.channel is not None]
    if spans:
        longest = printer("longest_bridge").value
        yield _at_most(
            "mold: widest bridge over a lead channel", round(max(spans), 4), longest, "mm", "", "warning"
        )
    names = tuple(socket.part.name for socket in outline.sockets)
    missing = () if design.mold.numbers == "none" else tuple(unnumbered(names, outline.numbers))
    no_room = "no room below their sockets, in a parted mold on the frame; mark them by hand"
    yield _count("parts without their name on the mold", missing, no_room)
    radial = [s for s in outline.sockets if s.holes and s.channel is None]
    bare = tuple(s.part.name for s in radial) if design.mold.strain_relief == "pinch" else ()
    yield _count("leads without a channel below the mold", bare, "put the mold on feet; see mold.floor_mm")


def _at_least(name: str, value: float, limit: float) -> MoldCheck:
    state: State = "ok" if value >= limit - ROUNDING_MM else "error"
    return MoldCheck(name=name, value=round(value, 4), limit=limit, unit="mm", state=state)


def _count(name: str, parts: tuple[str, ...], meaning: str) -> MoldCheck:
    note = f"{', '.join(parts)}: {meaning}" if parts else ""
    return MoldCheck(
        name=f"mold: {name}",
        value=len(parts),
        limit=0,
        unit="parts",
        state="warning" if parts else "ok",
        note=note,
    )


def _exact(name: str, value: float, wanted: float, unit: str, note: str = "") -> MoldCheck:
    return MoldCheck(
        name=name,
        value=value,
        limit=wanted,
        unit=unit,
        state="ok" if value == wanted else "error",
        note=note,
    )


def _at_most(
    name: str, value: float, limit: float, unit: str, note: str = "", beyond: State = "error"
) -> MoldCheck:
    return MoldCheck(
        name=name, value=value, limit=limit, unit=unit, state="ok" if value <= limit else beyond, note=note
    )


def _body(name: str, loaded: trimesh.Trimesh) -> list[MoldCheck]:
    mesh = manifold3d.Mesh(
        np.asarray(loaded.vertices, dtype=np.float32), np.asarray(loaded.faces, dtype=np.uint32)
    )
    status = manifold3d.Manifold(mesh).status()
    is_manifold = status == manifold3d.Error.NoError
    return [
        _exact(f"{name}: watertight", int(loaded.is_watertight), 1, "yes"),
        _exact(f"{name}: consistent winding", int(loaded.is_winding_consistent), 1, "yes"),
        _exact(f"{name}: bodies", int(loaded.body_count), 1, "bodies"),
        _exact(f"{name}: manifold", int(is_manifold), 1, "yes", "" if is_manifold else status.name),
    ]


def _volumes(part: PartFile, stl_mm3: float) -> list[MoldCheck]:
    return [
        _at_most(
            f"{part.name}: volume of the file against the formula",
            round(abs(stl_mm3 / part.formula_mm3 - 1), 9),
            VOLUME_LIMIT,
            "share",
        ),
        _at_most(
            f"{part.name}: volume of the solid against the formula",
            round(abs(part.solid_mm3 / part.formula_mm3 - 1), 9),
            SOLID_LIMIT,
            "share",
        ),
    ]


def bridged_mm2(design: SensorDesign) -> dict[str, float]:
    """For each part, the area of ceilings over engraved strokes and lead channels, which a printer can bridge [mm2]."""
    outline = outline_of(design)
    channels = [(s.channel, s.holes) for s in outline.sockets if s.channel is not None]
    below = outline.label.area_mm2 + sum(
        (cut.along1 - cut.along0) * (cut.out1 - cut.out0) - sum(math.pi * hole.radius**2 for hole in holes)
        for cut, holes in channels
    )
    numbers = sum(number.ceiling_mm2 for number in outline.numbers)
    return {"mold": below + numbers, "mold_base": below, "mold_frame": numbers}


def _printing(name: str, mesh: Mesh, bed_mm: Bed, bridged: float) -> list[MoldCheck]:
    """Findings about overhanging area and print bed; `bridged` is the area of ceilings that need no support [mm2]."""
    size = np.ptp(mesh.vertices, axis=0)
    fits = max(size[:2]) <= max(bed_mm[:2]) and min(size[:2]) <= min(bed_mm[:2]) and size[2] <= bed_mm[2]
    return [
        _at_most(
            f"{name}: overhang",
            round(overhang_area_mm2(mesh), 3),
            round(OVERHANG_LIMIT_MM2 + bridged, 3),
            "mm2",
            "faces that overhang by more than 45 deg, above the bed"
            + (
                f"; {bridged:.1f} of it are ceilings of strokes and channels, which bridge" if bridged else ""
            ),
            "warning",
        ),
        MoldCheck(
            name=f"{name}: print bed",
            value=round(float(max(size[:2])), 3),
            limit=max(bed_mm[:2]),
            unit="mm",
            state="ok" if fits else "warning",
            note=f"{size[0]:.1f} x {size[1]:.1f} x {size[2]:.1f} mm in a room of "
            f"{bed_mm[0]:g} x {bed_mm[1]:g} x {bed_mm[2]:g} mm",
        ),
    ]


def overhang_area_mm2(mesh: Mesh) -> float:
    """Area of faces above the bed that overhang by more than `OVERHANG_DEG` from the vertical [mm2]."""
    corners = mesh.corners
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    lean = np.degrees(np.arcsin(np.clip(-unit_normals(mesh)[:, 2], -1.0, 1.0)))
    above_bed = corners[:, :, 2].max(axis=1) > corners[:, :, 2].min() + WALL_LIMIT_MM
    return float(areas[above_bed & (lean > OVERHANG_DEG + 1e-3)].sum())


def _mold_size(design: SensorDesign, extents: np.ndarray[Any, Any]) -> list[MoldCheck]:
    outline = outline_of(design)
    wanted = (design.mold.outer_length_mm, design.mold.outer_width_mm, outline.highest_mm - outline.bottom_mm)
    return [
        _at_most(
            "mold: outer size against the design",
            round(float(np.abs(extents - wanted).max()), 6),
            CHORD_LIMIT_MM if outline.outer.arcs else WALL_LIMIT_MM,
            "mm",
            " x ".join(f"{side:.2f}" for side in extents),
        )
    ]


def _cavity(design: SensorDesign, mesh: Mesh) -> list[MoldCheck]:
    agreement = cavity_agreement(design, mesh)
    flat = _at_most(
        "mold: cavity walls against the optical model",
        round(agreement.worst_mm, 6),
        WALL_LIMIT_MM,
        "mm",
        f"{agreement.compared} rays from inside; {agreement.windows} more leave through sockets",
    )
    if not plan_of(design).outline.arcs:
        return [flat]
    worst = round(agreement.worst_round_mm, 6)
    return [
        flat,
        _at_most("mold: round wall against the optical model", worst, CHORD_LIMIT_MM, "mm", "chords"),
    ]


def _dish(design: SensorDesign, mesh: Mesh) -> MoldCheck:
    agreement = dish_agreement(design, mesh)
    return _at_most(
        "lid: dish against the top of the optical model",
        round(agreement.worst_mm, 6),
        CHORD_LIMIT_MM,
        "mm",
        f"{agreement.compared} rays upward from the pad; chords",
    )
