r"""Whether the printed cavity is the cavity that light travels in.

The optical model knows a plan (`design.shape.plan`): flat walls that carry active areas flush with their face, round
walls between their facets, the bottom at -black thickness, and the top. Rays from inside are followed to
the printed mold's triangles and compared with that plan wherever no socket opens the wall and no hole the floor. A
round wall is compared by the distance of the printed place from it, since chords lie a little inside.

A crowned top is cast by the lid. Rays go straight up from the bottom of the clear layer to the lid's triangles, in the
mold's frame, wherever the lid forms the top: over the whole plan but the play around its plug.

Intersection: the barycentric form of Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cad.lid_size import lid_size, turned_over
from cad.mesh import Mesh
from design.arrays import BoolArray, FloatArray
from design.mold.outline import MoldOutline, bed_lift_mm, outline_of
from design.mold.sockets import Socket
from design.shape.outline import Arc, Line
from design.spec import SensorDesign

Floats = FloatArray

CHUNK_RAYS = 64
EDGE_MM = 1e-6
"""Rays that end this close to a window's edge or the fill level belong to both sides; they are left out."""
CHORD_EDGE_MM = 0.02
"""The same where an edge is round, and printed as chords."""
FAR_MM = 1000.0
"""Stands for the end of a ray that meets nothing: it left through a slot, or through a hole in the mesh."""


@dataclass(frozen=True, kw_only=True)
class CavityAgreement:
    """Comparison of the printed cavity with the plan of the optical model.

    Attributes
    ----------
    compared, windows : rays that end on a wall or the bottom; rays that leave through a socket
    worst_mm : largest distance between the printed and the modelled end of a ray to a flat wall or the bottom
    worst_round_mm : largest distance of a printed end from the round wall; 0 without one
    shallowest_window_mm : least depth behind the wall at which a ray through a socket ends; None without
    """

    compared: int
    windows: int
    worst_mm: float
    worst_round_mm: float
    shallowest_window_mm: float | None


@dataclass(frozen=True, kw_only=True)
class DishAgreement:
    """Comparison of the printed lid with the pad's top.

    Attributes
    ----------
    compared : rays that end in the dish
    worst_mm : largest distance of a printed place from the top, along its normal
    """

    compared: int
    worst_mm: float


def first_hits_mm(mesh: Mesh, origins_mm: Floats, directions: Floats) -> Floats:
    """Distance to the first triangle in front of each ray.

    Parameters
    ----------
    origins_mm : (n, 3)
    directions : (n, 3) unit vectors

    Returns
    -------
    (n,) distance [mm]; infinite where a ray meets nothing
    """
    planes = _planes(mesh)
    pieces = [
        _nearest(planes, origins_mm[k : k + CHUNK_RAYS], directions[k : k + CHUNK_RAYS])
        for k in range(0, len(origins_mm), CHUNK_RAYS)
    ]
    return np.concatenate(pieces)


@dataclass(frozen=True, kw_only=True)
class _Planes:
    """Triangles as (3, m) arrays: two edges from the corner a, their cross product n, and edges x a; n . a as (m,)."""

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
    """Triple products written as matrix products: with o + t d = a + u e1 + v e2 and m = o x d,

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
    """Compare a printed mold with the optical model's plan.

    Parameters
    ----------
    mesh : the mold as in its file, print bed at z = 0
    rays : number of rays, from random places in the clear layer in random directions
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
    """Compare a printed lid with the top that it casts.

    Parameters
    ----------
    mesh : the lid as in its file, back on the bed
    rays : number of rays, straight up from random places
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
    """Rays from within the clear layer; of a disc and below a crown from the places of the box that lie in it."""
    random = np.random.default_rng(seed)
    plan = outline.plan
    size = np.array([outline.length_mm, outline.width_mm, plan.rim_mm[0]])
    directions = random.normal(size=(count, 3))
    origins = random.uniform(0.1, 0.9, (count, 3)) * size
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    within = plan.outline.contains(origins[:, 0], origins[:, 1])
    return origins[within], directions[within]


def _exits(outline: MoldOutline, origins: Floats, directions: Floats) -> tuple[Floats, Floats, BoolArray]:
    """Distance to the modelled cavity, up to the rim, where it ends, and whether on the round wall."""
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
    """Gap over speed where a ray approaches; else infinite."""
    steps: Floats = np.divide(gap, speed, out=np.full(len(gap), np.inf), where=speed > 0)
    return steps


def _to_arc(arc: Arc, origins: Floats, directions: Floats) -> Floats:
    """Distance along each ray to a round wall; infinite for one that leaves elsewhere."""
    from_middle, level = origins[:, :2] - np.array(arc.centre_mm), directions[:, :2]
    speed2 = np.einsum("ij,ij->i", level, level)
    towards = np.einsum("ij,ij->i", from_middle, level)
    room = arc.radius_mm**2 - np.einsum("ij,ij->i", from_middle, from_middle)
    square = towards**2 + speed2 * room
    far = (np.sqrt(np.maximum(square, 0.0)) - towards) / speed2
    end = from_middle + far[:, None] * level
    return np.where((square >= 0.0) & arc.spans(np.arctan2(end[:, 1], end[:, 0])), far, np.inf)


def _off_round_wall_mm(outline: MoldOutline, places: Floats) -> Floats:
    """Distance of places from the nearest round wall that they lie before or behind; infinite without one [mm]."""
    off = np.full(len(places), np.inf)
    for arc in outline.plan.outline.bare.arcs:
        x, y = (places[:, :2] - np.array(arc.centre_mm)).T
        off = np.where(
            arc.spans(np.arctan2(y, x)), np.minimum(off, np.abs(np.hypot(x, y) - arc.radius_mm)), off
        )
    return off


def _in_filling_holes(outline: MoldOutline, ends: Floats) -> BoolArray:
    """Which ends lie on the floor in a filling hole, or too close to its edge to tell."""
    found = np.zeros(len(ends), dtype=bool)
    on_floor = ends[:, 2] < outline.cavity_bottom_mm + EDGE_MM
    for hole in outline.filling:
        apart = np.hypot(ends[:, 0] - hole.x, ends[:, 1] - hole.y)
        found |= on_floor & (apart < hole.radius + CHORD_EDGE_MM)
    return found


def _beside_facets(outline: MoldOutline, ends: Floats) -> BoolArray:
    """Which ends on the round wall lie too close to a facet to tell."""
    corners = [wall.point(along) for wall in outline.plan.walls for along in (0.0, wall.length_mm)]
    found = np.zeros(len(ends), dtype=bool)
    for x, y in corners:
        found |= np.hypot(ends[:, 0] - x, ends[:, 1] - y) < CHORD_EDGE_MM
    return found


def _windows(outline: MoldOutline, ends: Floats) -> tuple[BoolArray, BoolArray]:
    """Which ends lie in a socket's opening, and which too close to an opening's edge to tell."""
    inside = np.zeros(len(ends), dtype=bool)
    near = np.zeros(len(ends), dtype=bool)
    for socket in outline.sockets:
        signed = _inside_window_mm(socket, ends)
        inside |= signed > 0
        near |= np.abs(signed) < EDGE_MM
    return inside, near


def _inside_window_mm(socket: Socket, ends: Floats) -> Floats:
    """How far each end lies within a socket's opening; negative outside of it or on another wall."""
    line, pocket = socket.frame.line, socket.pocket
    across, along = _outward_mm(line, ends), (ends[:, :2] - np.array(line.origin)) @ np.array(line.tangent)
    inward = np.minimum.reduce([along - pocket.along0, pocket.along1 - along, ends[:, 2] - pocket.floor])
    on_wall = np.abs(across) < EDGE_MM
    signed: Floats = np.where(on_wall, inward, -np.inf)
    return signed


def _outward_mm(line: Line, points: Floats) -> Floats:
    """How far points lie outside of a flat wall; negative inside."""
    return np.asarray((points[:, :2] - np.array(line.origin)) @ np.array(line.outward))


def _behind_wall_mm(outline: MoldOutline, points: Floats) -> Floats:
    """Largest distance of points outside of the cavity's flat walls."""
    depth: Floats = np.maximum.reduce([_outward_mm(wall, points) for wall in outline.plan.walls])
    return depth
