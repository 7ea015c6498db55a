"""A pad with a pressed top as triangles: what mesh tracers see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, RectBivariateSpline

from optopad.design.arrays import FloatArray
from optopad.design.shape.top import Top
from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm
from optopad.sims.press import Indentation
from tests.bench.measures.forward_walk import dimple_row


def compact_height(press: Indentation, top_mm: float) -> Callable[[FloatArray], FloatArray]:
    """Height [mm] over radius [mm] of a compact dimple without pile-up, from its definition."""
    _, _, top, tip, contact2, tip_z, drop, width, rim, _ = dimple_row(np.zeros(2), press, top_mm)

    def height(radius: FloatArray) -> FloatArray:
        share = np.clip((rim - radius) / width, 0.0, None)
        inside = tip_z - np.sqrt(tip**2 - np.minimum(radius**2, contact2))
        return np.where(radius**2 < contact2, inside, top - drop * share**3)

    return height


def compact_curve(press: Indentation, top_mm: float, knots: int = 256) -> Indentation:
    """The compact dimple as knots with inclinations, from its definition."""
    height, step = compact_height(press, top_mm), 1e-5
    radius = np.linspace(0.0, dimple_row(np.zeros(2), press, top_mm)[8], knots)
    slope = (height(radius + step) - height(np.maximum(radius - step, 0.0))) / (2.0 * step)
    slope[0] = 0.0
    return replace(
        press,
        radius_mm=radius,
        height_mm=height(radius) - top_mm,
        inclination_deg=np.degrees(np.arctan(slope)),
    )


def form_of(scene: OpticalScene) -> PadForm:
    """Walls and top of a pad; a flat rectangle has four flat walls: south, east, north, west."""
    length, width = scene.length_mm, scene.width_mm
    return scene.form or PadForm(
        walls=np.array(
            [
                (0.0, 0.0, 1.0, 0.0, 0.0, -1.0),
                (length, 0.0, 0.0, 1.0, 1.0, 0.0),
                (0.0, width, 1.0, 0.0, 0.0, 1.0),
                (0.0, 0.0, 0.0, 1.0, -1.0, 0.0),
            ]
        ),
        arcs=np.empty((0, 6)),
        top=Top(clear_mm=scene.height_mm, apex_mm=(0.5 * length, 0.5 * width)),
    )


@dataclass(frozen=True, kw_only=True)
class TopMesh:
    """A pressed top as triangles.

    Attributes
    ----------
    vertices, normals : (n, 3) single precision, in the cavity frame [mm, -]; the normals point out of the elastomer
    triangles : (m, 3) vertices of each
    touched : the first so many triangles are the contact
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    touched: int


def pressed_mesh(
    scene: OpticalScene,
    at_mm: tuple[float, float],
    press: Indentation | None,
    beside: RectBivariateSpline | None,
    step_mm: float,
) -> TopMesh:
    """The top of a pad as rings around the axis of its press; one of them is the edge of the contact.

    The surface is that of the contact model: the untouched top, along the normal of the press the curve (cubics through
    its knots with their inclinations), and on a flat rectangle the height beside it. Normals are those of the surface.

    Parameters
    ----------
    at_mm : where the axis meets the untouched top, in plan [mm]
    press : with inclinations; None: untouched
    beside : height [mm] over x and y [mm], added to the top of a flat rectangle; it ends at the walls
    step_mm : longest side of a triangle along a spoke, and at the farthest corner along a ring [mm]
    """
    form, clear = form_of(scene), scene.height_mm
    origin, axes = form.top.press_frame(*at_mm)
    corners = np.array([(x, y) for x in (0.0, scene.length_mm) for y in (0.0, scene.width_mm)])
    far = min(float(np.hypot(*(corners - at_mm).T).max()) + clear, 0.985 * form.top.radius_mm)
    points, tangents, edge = _generator(press, far, step_mm)
    spokes = int(np.ceil(2.0 * np.pi * far / step_mm))
    angle = np.linspace(0.0, 2.0 * np.pi, spokes, endpoint=False)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    vertices, normals = (np.empty((len(points), spokes, 3), dtype=np.float32) for _ in range(2))
    inside = np.empty((len(points), spokes), dtype=np.bool_)
    for ring, ((radius, height), (out, up)) in enumerate(zip(points, tangents, strict=True)):
        across = radius * way
        fall, slopes = _crown_fall(form, across)
        top, slopes = np.column_stack([across, height - fall]) @ axes + origin, -slopes
        near = inside[ring] = _beyond_mm(form, top) < 2.0 * step_mm
        if beside is not None:
            lifted, lift = _lifted(beside, top[near], scene)
            top[near, 2] += lifted
            slopes[near] += lift
        normal = np.column_stack([-up * way - out * slopes, np.full(spokes, out)])
        vertices[ring] = top
        normals[ring] = (normal / np.linalg.norm(normal, axis=1, keepdims=True)) @ axes
    corner = (np.arange(len(points) - 1)[:, None] * spokes + np.arange(spokes)).astype(np.uint32)
    later = np.roll(corner, -1, axis=1)
    both = np.stack(
        [
            np.stack([corner, corner + spokes, later + spokes], -1),
            np.stack([corner, later + spokes, later], -1),
        ],
        axis=2,
    )
    kept = np.any(inside.ravel()[both], axis=-1)
    return TopMesh(
        vertices=vertices.reshape(-1, 3),
        normals=normals.reshape(-1, 3),
        triangles=both[kept],
        touched=int(kept[:edge].sum()),
    )


def _generator(
    press: Indentation | None, far_mm: float, step_mm: float
) -> tuple[FloatArray, FloatArray, int]:
    """(n, 2) radius and height and (n, 2) unit tangents from the axis to the farthest ring; number of the edge's."""
    points, tangents, edge = np.zeros((1, 2)), np.array([[1.0, 0.0]]), 0
    if press is not None:
        assert press.inclination_deg is not None
        slope = np.deg2rad(press.inclination_deg)
        knots = np.column_stack([press.radius_mm, press.height_mm])
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(knots, axis=0).T)))
        curve = CubicHermiteSpline(along, knots, np.column_stack([np.cos(slope), np.sin(slope)]))
        border = np.interp(press.contact_radius_mm, np.maximum.accumulate(press.radius_mm), along)
        for _ in range(8):  # Newton: the contact need not end at a knot
            border -= (curve(border)[0] - press.contact_radius_mm) / curve(border, 1)[0]
        ends = np.unique(np.append(along, border))
        ends = ends[np.append(True, np.diff(ends) > 1e-9)]
        counts = np.ceil(np.diff(ends) / step_mm).astype(int)
        pieces = zip(ends[:-1], ends[1:], counts, strict=True)
        places = np.append(
            np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b, n in pieces]), ends[-1]
        )
        edge = int(np.argmin(np.abs(places - border)))
        points, tangents = curve(places), curve(places, 1)
        tangents /= np.hypot(*tangents.T)[:, None]
    rings = np.arange(points[-1, 0] + step_mm, far_mm, step_mm)
    flat = np.stack([rings, np.zeros(len(rings))], axis=1)
    points = np.concatenate([points, flat])
    tangents = np.concatenate([tangents, np.broadcast_to([1.0, 0.0], flat.shape)])
    kept = points[:, 0] <= far_mm
    return points[kept], tangents[kept], edge


def _crown_fall(form: PadForm, across: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) fall of the untouched top below its tangent plane [mm] and its (n, 2) slopes, in the frame of a press."""
    if form.top.is_flat:
        return np.zeros(len(across)), np.zeros_like(across)
    radius, used = form.top.radius_mm, across * (1.0 if form.top.straight is None else [0.0, 1.0])
    square = np.sum(used**2, axis=1)
    root = np.sqrt(radius**2 - square)
    return square / (radius + root), used / root[:, None]


def _lifted(
    beside: RectBivariateSpline, top: FloatArray, scene: OpticalScene
) -> tuple[FloatArray, FloatArray]:
    """(n,) height [mm] and (n, 2) slopes beside the press; beyond the walls it goes on straight."""
    x, y = np.clip(top[:, 0], 0.0, scene.length_mm), np.clip(top[:, 1], 0.0, scene.width_mm)
    slopes = np.stack([beside.ev(x, y, dx=1), beside.ev(x, y, dy=1)], axis=-1)
    return beside.ev(x, y) + (top[:, 0] - x) * slopes[:, 0] + (top[:, 1] - y) * slopes[:, 1], slopes


def _beyond_mm(form: PadForm, places: FloatArray) -> FloatArray:
    """(n,) how far places lie outside the walls in plan, negative inside [mm]."""
    beyond = np.full(len(places), -np.inf)
    for x, y, _, _, nx, ny in form.walls:
        beyond = np.maximum(beyond, (places[:, 0] - x) * nx + (places[:, 1] - y) * ny)
    for cx, cy, radius, ux, uy, cosine in form.arcs:
        px, py = places[:, 0] - cx, places[:, 1] - cy
        away = np.hypot(px, py)
        beyond = np.where(px * ux + py * uy >= cosine * away, np.maximum(beyond, away - radius), beyond)
    return beyond


def cosine_rays(scene: OpticalScene, count: int, seed: int = 0) -> FloatArray:
    """(count, 6) origins [mm] and unit directions of rays by the cosine law, from the emitters in turn."""
    generator = np.random.default_rng(seed)
    a, b, u, v = generator.random((4, count))
    which = np.arange(count) % len(scene.emitter_wall)
    wall, patch = scene.emitter_wall[which], scene.emitter_patch[which]
    along = patch[:, 0] + (2.0 * a - 1.0) * patch[:, 2]
    z = patch[:, 1] + (2.0 * b - 1.0) * patch[:, 3]
    into, aside, up = np.sqrt(1.0 - u), np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v)
    on_x = wall % 2 == 0
    sign = np.where((wall == 0) | (wall == 3), 1.0, -1.0)
    start = np.where((wall == 0) | (wall == 3), 0.0, np.where(wall == 1, scene.length_mm, scene.width_mm))
    x, y = np.where(on_x, along, start), np.where(on_x, start, along)
    dx, dy = np.where(on_x, aside, sign * into), np.where(on_x, sign * into, aside)
    return np.column_stack([x, y, z, dx, dy, up])
