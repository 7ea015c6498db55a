r"""The printed cavity and the printed lid against the optical model, by rays through the triangles of their files.

The cavity check traces rays from points inside the cavity to the triangles of the mold. The optical model has flat
walls, round walls between flat facets, the bottom and the top (`optopad.design.shape.cavity`). The ends of the rays are
compared with these surfaces, except in the openings of sockets and filling holes. For a round wall, the check compares
the printed point's distance from the wall, because the printed chords are slightly inside the circle.

A lid shapes the crowned top of a pad. The dish check traces vertical rays upward from the bottom of the clear layer to
the triangles of the lid. It covers the whole pad except the gap around the lid's plug.

Intersections use the barycentric form of Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optopad.cad.lid import LidSize, lid_size, turned_over
from optopad.cad.mesh import Mesh
from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.mold.outline import MoldOutline, bed_lift_mm, outline_of
from optopad.design.mold.sockets import Socket
from optopad.design.shape.cavity import Plan
from optopad.design.shape.outline import Arc, Line
from optopad.design.spec import SensorDesign

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
    formed = [plan.contains(x, y) and forms_top(size, plan, x, y, CHORD_EDGE_MM) for x, y in spots]
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


def forms_top(size: LidSize, plan: Plan, x_mm: float, y_mm: float, margin_mm: float = 0.0) -> bool:
    """Whether a point of the pad's top is shaped by the lid's concave face, not by the gap around the plug.

    Parameters
    ----------
    plan : outline and top of the pad
    x_mm, y_mm : position in the cavity's coordinate system
    margin_mm : required distance from the edge of this face
    """
    (x, y), depth, plug = plan.centre_mm, size.seat_mm - plan.top_mm(x_mm, y_mm), size.plug
    if depth <= 0.0 or plug is None:
        return depth <= 0.0 and size.has_dish
    across, deep = (half - plug.inset_mm(depth) - margin_mm for half in plug.half_mm)
    if plug.is_round:
        return math.hypot(x_mm - x, y_mm - y) <= across
    return abs(x_mm - x) <= across and abs(y_mm - y) <= deep


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
