"""Whether the printed cavity is the cavity that light travels in.

The optical model knows a box: [0, length] x [0, width], bottom at -black thickness, walls that carry
active areas flush with their face. Rays from inside the box are followed to the printed mold's
triangles and compared with that box wherever no socket opens the wall.

Intersection: the barycentric form of Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.mesh import Mesh
from design.geometry.mold_outline import MoldOutline, bed_lift_mm, outline_of
from design.geometry.sockets import Socket
from design.spec import SensorDesign
from design.spec.layout import WALLS

Floats = NDArray[np.float64]

CHUNK_RAYS = 64
EDGE_MM = 1e-6
"""Rays that end this close to a window's edge or the fill level belong to both sides; they are left out."""
FAR_MM = 1000.0
"""Stands for the end of a ray that meets nothing: it left through a slot, or through a hole in the mesh."""


@dataclass(frozen=True, kw_only=True)
class CavityAgreement:
    """Comparison of the printed cavity with the box of the optical model.

    Attributes
    ----------
    compared, windows : rays that end on a wall or the bottom; rays that leave through a socket
    worst_mm : largest distance between the printed and the modelled end of a compared ray
    shallowest_window_mm : least depth behind the wall at which a ray through a socket ends; None without
    """

    compared: int
    windows: int
    worst_mm: float
    shallowest_window_mm: float | None


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
    """Compare a printed mold with the optical model's box.

    Parameters
    ----------
    mesh : the mold as in its file, print bed at z = 0
    rays : number of rays, from random places in the clear layer in random directions
    """
    outline = outline_of(design)
    origins, directions = _random_rays(outline, rays, seed)
    modelled, ends = _box_exits(outline, origins, directions)
    stays = ends[:, 2] < outline.fill_mm - EDGE_MM
    origins, directions, modelled, ends = origins[stays], directions[stays], modelled[stays], ends[stays]
    lifted = origins + np.array([0.0, 0.0, bed_lift_mm(design)])
    printed = np.minimum(first_hits_mm(mesh, lifted, directions), FAR_MM)
    inside, near = _windows(outline, ends)
    walls, windows = ~inside & ~near, inside & ~near
    depth = _behind_wall_mm(outline, origins + printed[:, None] * directions)[windows]
    return CavityAgreement(
        compared=int(walls.sum()),
        windows=int(windows.sum()),
        worst_mm=float(np.abs(printed - modelled)[walls].max(initial=0.0)),
        shallowest_window_mm=float(depth.min()) if len(depth) else None,
    )


def _random_rays(outline: MoldOutline, count: int, seed: int) -> tuple[Floats, Floats]:
    random = np.random.default_rng(seed)
    size = np.array([outline.length_mm, outline.width_mm, outline.fill_mm])
    directions = random.normal(size=(count, 3))
    return (
        random.uniform(0.1, 0.9, (count, 3)) * size,
        directions / np.linalg.norm(directions, axis=1, keepdims=True),
    )


def _box_exits(outline: MoldOutline, origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    low = np.array([0.0, 0.0, outline.cavity_bottom_mm])
    high = np.array([outline.length_mm, outline.width_mm, outline.top_mm])
    to_face = np.where(directions > 0, high - origins, low - origins) / directions
    distance = to_face.min(axis=1)
    return distance, origins + distance[:, None] * directions


def _windows(outline: MoldOutline, ends: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
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
    runs_along_x = socket.frame.wall in ("south", "north")
    along, across = (ends[:, 0], ends[:, 1]) if runs_along_x else (ends[:, 1], ends[:, 0])
    plane = 0.0 if socket.frame.wall in ("south", "west") else socket.frame.across_mm
    pocket = socket.pocket
    inward = np.minimum.reduce([along - pocket.along0, pocket.along1 - along, ends[:, 2] - pocket.floor])
    on_wall = np.abs(across - plane) < EDGE_MM
    signed: Floats = np.where(on_wall, inward, -np.inf)
    return signed


def _behind_wall_mm(outline: MoldOutline, points: Floats) -> Floats:
    """Largest distance of points outside the cavity's four wall planes."""
    x, y = points[:, 0], points[:, 1]
    outward = dict(zip(WALLS, (-y, x - outline.length_mm, y - outline.width_mm, -x), strict=True))
    depth: Floats = np.maximum.reduce(list(outward.values()))
    return depth
