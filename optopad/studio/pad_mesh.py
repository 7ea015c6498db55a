"""Meshes of the pad for display: outline in plan, walls, layers, the untouched and the pressed top; lengths in mm.

The outline is a polygon whose vertices include the plan's corners. Under a crown, straight walls are divided into
short sides, so that their upper edges follow the crown.

The module also cuts meshes open along a plane, to show the inside.

The pressed top has rings around the press axis, up to the pad's outline. On a crown, the rings are on the untouched
top. Each point is displaced along the normal at the press location; the displacement is the height of the pressed
surface at the point's distance from the axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray, IntArray
from optopad.design.shape.cavity import Plan, cavity_of, edge_mm
from optopad.design.spec import SensorDesign
from optopad.sims.contact.pad_surface import PadSurface, curve_height_mm, pad_surface
from optopad.sims.press import GridTop


def cut_open(points_mm: FloatArray, triangles: IntArray, y_mm: float) -> tuple[FloatArray, IntArray]:
    """The part of a mesh with y above `y_mm`; triangles across this plane are cut, and the opening is not closed.

    Parameters
    ----------
    points_mm, triangles : (n, 3) points [mm], and (m, 3) indices of points
    """
    height = points_mm[:, 1] - y_mm
    inside = (height >= 0)[triangles]
    count = inside.sum(axis=1)
    whole = triangles[count == 3]
    one = _turned(triangles[count == 1], inside[count == 1])
    two = _turned(triangles[count == 2], ~inside[count == 2])
    near, far = (
        _crossing(points_mm, height, one[:, 0], one[:, 1]),
        _crossing(points_mm, height, one[:, 0], one[:, 2]),
    )
    first, last = (
        _crossing(points_mm, height, two[:, 0], two[:, 1]),
        _crossing(points_mm, height, two[:, 0], two[:, 2]),
    )
    corners = np.concatenate(
        [
            points_mm[whole],
            np.stack([points_mm[one[:, 0]], near, far], axis=1),
            np.stack([first, points_mm[two[:, 1]], points_mm[two[:, 2]]], axis=1),
            np.stack([first, points_mm[two[:, 2]], last], axis=1),
        ]
    )
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def _turned(triangles: IntArray, marked: BoolArray) -> IntArray:
    """Triangles with their corners rotated so that the single marked corner is first; the orientation is unchanged."""
    first = marked.argmax(axis=1)[:, None]
    return np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)


def _crossing(points: FloatArray, height: FloatArray, start: IntArray, end: IntArray) -> FloatArray:
    """Points where edges of a mesh cross a plane.

    `height` is the signed distance of each vertex from the plane; `start` and `end` are the vertices of each edge."""
    share = (height[start] / (height[start] - height[end]))[:, None]
    return np.asarray(points[start] + share * (points[end] - points[start]), dtype=np.float64)


RINGS = 14
"""Number of rings of a crown's mesh from the middle to the edge."""
LOOKS = 400
"""Number of heights at which a ray is tested against a crown."""


def outline_mm(plan: Plan) -> FloatArray:
    """(n, 2) corners of the pad in plan, counter-clockwise."""
    return edge_mm(plan)[:, :2]


def top_mm(plan: Plan, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """(...,) height of the untouched top at (...,) locations [mm]; 0 beyond the crown's sphere or cylinder."""
    return np.nan_to_num(plan.top.height_mm(x_mm, y_mm), nan=0.0)


def untouched_top(plan: Plan) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of the untouched top, in rings from the middle to the edge."""
    edge, middle = outline_mm(plan), np.array(plan.centre_mm)
    shares = np.linspace(0.0, 1.0, 2 if plan.top.is_flat else RINGS)
    places = middle + shares[:, None, None] * (edge - middle)
    heights = top_mm(plan, places[..., 0], places[..., 1])
    points = np.concatenate([places, heights[..., None]], axis=-1).reshape(-1, 3)
    return points, ring_triangles(len(shares), len(edge))


def side_walls(plan: Plan) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of the walls, from the clear layer's bottom to the untouched top."""
    edge = outline_mm(plan)
    low = np.column_stack([edge, np.zeros(len(edge))])
    high = np.column_stack([edge, top_mm(plan, edge[:, 0], edge[:, 1])])
    return np.concatenate([low, high]), ring_triangles(2, len(edge))


def slab(plan: Plan, thickness_mm: float) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of a closed layer under the clear layer.

    The triangles are counter-clockwise as seen from outside.
    """
    edge = outline_mm(plan)
    rings = [
        np.column_stack([plan.centre_mm + share * (edge - plan.centre_mm), np.full(len(edge), level)])
        for share, level in ((0.0, 0.0), (1.0, 0.0), (1.0, -thickness_mm), (0.0, -thickness_mm))
    ]
    return np.concatenate(rings), ring_triangles(4, len(edge))


def ring_triangles(rings: int, spokes: int) -> IntArray:
    """Indices of two triangles for every cell between rings and spokes, counter-clockwise as seen from above."""
    ring, spoke = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(spokes), indexing="ij"))
    after = (spoke + 1) % spokes
    a, b = ring * spokes + spoke, ring * spokes + after
    c, d = (ring + 1) * spokes + spoke, (ring + 1) * spokes + after
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)]).astype(np.int64)


def struck_place(plan: Plan, eye_mm: FloatArray, way: FloatArray) -> tuple[float, float] | None:
    """Location (x, y) where a ray from above first meets the untouched top [mm]; None if it misses the pad.

    Parameters
    ----------
    eye_mm, way : (3,) start and direction of the ray
    """
    if abs(way[2]) < 1e-9:
        return None
    low = plan.clear_mm if plan.top.is_flat else max(np.nan_to_num(plan.rim_mm[0], nan=0.0), 0.0)
    for height in np.linspace(plan.clear_mm, low, 1 if plan.top.is_flat else LOOKS).tolist():
        x, y, _ = (eye_mm + way * (height - eye_mm[2]) / way[2]).tolist()
        if height <= plan.top_mm(x, y) and plan.contains(x, y):
            return x, y
    return None


SPOKES, RINGS = 72, 28
GRID_SPOKES, GRID_RINGS = 180, 70
"""Spokes and rings of a top under an object, which may have edges anywhere."""
BORDER_STEPS = 6
"""Number of iterations that move a displaced border point back onto its wall; each reduces the distance about
tenfold."""
REST_MM = 0.5
"""Node spacing for the smooth part of the surface outside the contact [mm]; linear interpolation has an error of at
most 0.01 mm, near the contact."""


def pressed_top(
    design: SensorDesign, place_mm: tuple[float, float], depth_mm: float
) -> tuple[FloatArray, IntArray, PadSurface | None]:
    """(n, 3) points [mm] and (m, 3) triangles of the top in the cavity's coordinate system, and the solved surface.

    The surface is None without contact.

    Raises
    ------
    ModelScopeError : the contact model does not cover the press.
    """
    plan = cavity_of(design).plan
    outline = outline_mm(plan)
    angles = _angles(outline, place_mm, SPOKES)
    reach = _reach(outline, place_mm, angles)
    surface = pad_surface(design, depth_mm, place_mm) if depth_mm > 0 else None
    tip = design.indenter.tip_radius_mm
    radii = _radii(surface, tip, float(reach.max()))
    at = np.minimum(radii[:, None], reach[None, :])
    x = np.clip(place_mm[0] + at * np.cos(angles), 0.0, plan.length_mm)
    y = np.clip(place_mm[1] + at * np.sin(angles), 0.0, plan.width_mm)
    points = np.stack([x, y, top_mm(plan, x, y)], axis=-1).reshape(-1, 3)
    if surface is not None and not plan.top.is_flat:
        points = _pressed_crown(plan, place_mm, _curve_along(surface, plan), points, (at >= reach).ravel())
    elif surface is not None:
        points[:, 2] += _height(surface, at, x, y).ravel()
    return points, ring_triangles(len(radii), len(angles)), surface


def held_top(design: SensorDesign, top: GridTop) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of the top under an object, in the cavity's coordinate system."""
    plan, outline = cavity_of(design).plan, outline_mm(cavity_of(design).plan)
    angles = _angles(outline, top.at_mm, GRID_SPOKES)
    reach = _reach(outline, top.at_mm, angles)
    radii = float(reach.max()) * np.linspace(0.0, 1.0, GRID_RINGS) ** 1.5
    at = np.minimum(radii[:, None], reach)
    x = np.clip(top.at_mm[0] + at * np.cos(angles), 0.0, plan.length_mm)
    y = np.clip(top.at_mm[1] + at * np.sin(angles), 0.0, plan.width_mm)
    points = np.stack([x, y, top_mm(plan, x, y)], axis=-1).reshape(-1, 3)
    axes, step = plan.top.press_frame(*top.at_mm)[1], top.x_mm[1] - top.x_mm[0]

    def height(away: FloatArray) -> FloatArray:
        column, row = ((axes[:2] @ away.T).T - [top.x_mm[0], top.y_mm[0]]).T / step
        return _between_nodes(top.height_mm, column, row)

    points = _pressed_crown(plan, top.at_mm, height, points, (at >= reach).ravel())
    return points, ring_triangles(len(radii), len(angles))


def _curve_along(surface: PadSurface, plan: Plan) -> Callable[[FloatArray], FloatArray]:
    """Height [mm] of a curve around the press axis, of positions (n, 3) relative to its foot on the top [mm]."""
    normal = np.array(plan.normal(*surface.at_mm))

    def height(away: FloatArray) -> FloatArray:
        axial = away @ normal
        radius = np.sqrt(np.maximum((away**2).sum(axis=1) - axial**2, 0.0))
        return curve_height_mm(surface.near, radius)

    return height


def _pressed_crown(
    plan: Plan,
    at_mm: tuple[float, float],
    height: Callable[[FloatArray], FloatArray],
    points: FloatArray,
    is_border: BoolArray,
) -> FloatArray:
    """(n, 3) points of the pressed top, from those of the untouched top [mm]; border points stay on the walls."""
    normal = np.array(plan.normal(*at_mm))
    foot = np.array([*at_mm, plan.top_mm(*at_mm)])

    def raised(start: FloatArray) -> FloatArray:
        return np.asarray(start + height(start - foot)[:, None] * normal)

    found, border, start = raised(points), points[is_border], points[is_border]
    for _ in range(BORDER_STEPS):
        x, y = (start + border - raised(start))[:, :2].T
        start = np.column_stack([x, y, top_mm(plan, x, y)])
    found[is_border] = np.column_stack([border[:, :2], raised(start)[:, 2]])
    return found


def _height(surface: PadSurface, radius: FloatArray, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """Height of the pressed top [mm]: a curve around the press axis plus, outside the contact, the smooth remainder."""
    near = curve_height_mm(surface.near, radius)
    lines = [np.linspace(0.0, size, math.ceil(size / REST_MM) + 1) for size in surface.size_mm]
    rest = surface.beside_mm(*lines)
    cells = [len(line) - 1 for line in lines]
    beside = _between_nodes(rest, x_mm / surface.size_mm[0] * cells[0], y_mm / surface.size_mm[1] * cells[1])
    return near + np.where(radius <= surface.near.contact_radius_mm, 0.0, beside)


def _between_nodes(values: FloatArray, column: FloatArray, row: FloatArray) -> FloatArray:
    """Values of a grid, linear between its nodes; columns and rows count the nodes."""
    column, row = (
        np.clip(one, 0, count - 1 - 1e-9) for one, count in zip((column, row), values.shape, strict=True)
    )
    i, j = column.astype(int), row.astype(int)
    u, v = column - i, row - j
    return np.asarray(
        values[i, j] * (1 - u) * (1 - v)
        + values[i + 1, j] * u * (1 - v)
        + values[i, j + 1] * (1 - u) * v
        + values[i + 1, j + 1] * u * v
    )


def _angles(outline: FloatArray, place_mm: tuple[float, float], spokes: int) -> FloatArray:
    """Evenly spaced angles and the angles of the outline's corners, as seen from the press axis [rad]."""
    corners = np.arctan2(outline[:, 1] - place_mm[1], outline[:, 0] - place_mm[0])
    even = np.linspace(-np.pi, np.pi, spokes, endpoint=False)
    return np.unique(np.round(np.concatenate([even, corners]), 9))


def _reach(outline: FloatArray, place_mm: tuple[float, float], angles: FloatArray) -> FloatArray:
    """(angle,) distance from the press axis to the convex outline in each direction [mm]."""
    side = np.roll(outline, -1, axis=0) - outline
    outward = np.column_stack([side[:, 1], -side[:, 0]])
    gap = ((outline - place_mm) * outward).sum(axis=1)
    towards = outward @ np.stack([np.cos(angles), np.sin(angles)])
    meets = towards > 1e-12 * np.linalg.norm(outward, axis=1)[:, None]
    return np.asarray(np.where(meets, gap[:, None] / np.where(meets, towards, 1.0), np.inf).min(axis=0))


def _radii(surface: PadSurface | None, tip_mm: float, farthest_mm: float) -> FloatArray:
    """Radii of the rings [mm]: close together near the tip, far apart outside; the last is beyond every corner."""
    edge = tip_mm if surface is None else max(surface.near.contact_radius_mm, 0.3 * tip_mm)
    near = np.linspace(0.0, edge, RINGS // 3)
    beside = edge + np.linspace(0.0, 2.0 * tip_mm, RINGS // 2)[1:]
    beyond = np.linspace(beside[-1], max(farthest_mm, beside[-1] + tip_mm), RINGS // 4)[1:]
    return np.concatenate([near, beside, beyond])
