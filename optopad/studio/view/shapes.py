"""Geometry of the 3D picture in plain numbers (lengths in mm), and the check of the page's messages.

A message must be of a known kind, and all its fields must be present and of the right type; viser checks none of this.
Other messages would cause a traceback on the terminal, and some kinds (uploads, forms) would be stored without a limit.
The types are those of viser's own message classes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields as fields_of
from typing import Any

import msgspec
import numpy as np
from viser import _messages as kinds
from viser.transforms import SO3

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.held_object import Box as HeldBox
from optopad.design.held_object import Cylinder, Ellipsoid, HeldObject, Mesh, Punch, Sphere, Torus
from optopad.design.mold.outline import outline_of
from optopad.design.shape.cavity import TURN_RAD, PlacedPart, Plan
from optopad.design.shape.outline import Point, X, Y
from optopad.design.spec import SensorDesign
from optopad.sims.contact.held.bottoms import bottom_mm, rotation
from optopad.sims.contact.tip import tip_points_mm
from optopad.studio.pad_mesh import ring_triangles
from optopad.studio.session import LivePress

KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        kinds.CommandTriggerMessage,
        kinds.GetRenderResponseMessage,
        kinds.GuiUpdateMessage,
        kinds.SceneNodeClickMessage,
        kinds.SceneNodeDragMessage,
        kinds.ScenePointerMessage,
        kinds.ViewerCameraMessage,
    )
}
"""Messages that the studio's page may send: hotkeys, exported pictures, fields and buttons, clicks, drags, camera."""
LARGEST_PICTURE_B, LARGEST_B = 16 * 2**20, 64 * 2**10
"""Largest size of an exported picture, and of any other message [bytes]."""
LARGEST_NUMBER = 1e9
"""Largest coordinate [mm], angle and size [px] in a message; with this limit, squares cannot overflow."""


def fault_of(raw: str | bytes, inputs: Mapping[str, Any]) -> str | None:
    """The reason why a message is refused, in one line; None if it is accepted.

    Parameters
    ----------
    raw : the received message
    inputs : viser's handles of the page's fields and buttons, by uuid
    """
    if isinstance(raw, str):
        return "text, where a message is bytes (MessagePack)"
    try:
        found = msgspec.msgpack.decode(raw)
    except (msgspec.MsgspecError, ValueError, RecursionError) as err:
        return f"{len(raw)} bytes that are no MessagePack: {err}"
    name = found.pop("type", None) if isinstance(found, dict) else None
    if not isinstance(name, str) or name not in KINDS:
        return f"type {name!r:.60} is not one of {', '.join(KINDS)}"
    if len(raw) > LARGEST_B and name != "GetRenderResponseMessage":
        return f"{name}: {len(raw)} bytes, where at most {LARGEST_B} are taken"
    fault = _fault_of_fields(name, found) or _fault_of_use(name, found, inputs)
    return None if fault is None else f"{name}: {fault}"


def _fault_of_fields(name: str, found: dict[str, Any]) -> str | None:
    """Fault of a message: a missing or unknown field, a wrong type, or too large a number; None if it is valid."""
    unknown = [str(key) for key in found.keys() - {field.name for field in fields_of(KINDS[name])}]
    if unknown:
        return f"unknown field {unknown[0]!r:.60}"
    try:
        msgspec.convert(found, KINDS[name])
    except msgspec.ValidationError as err:
        return str(err)
    wrong = [number for number in _numbers(found) if not abs(number) <= LARGEST_NUMBER]
    return f"{wrong[0]} is no number from {-LARGEST_NUMBER:g} to {LARGEST_NUMBER:g}" if wrong else None


def _fault_of_use(name: str, found: dict[str, Any], inputs: Mapping[str, Any]) -> str | None:
    """Fault of a click or an edited field whose types are valid; None if it has none."""
    if name == "ScenePointerMessage":
        is_click = found["event_type"] == "click" and len(found["screen_pos"]) == 1
        has_ray = found["ray_origin"] is not None and found["ray_direction"] is not None
        return None if is_click and has_ray else "no click with one position and a ray"
    if name != "GuiUpdateMessage":
        return None
    if found["updates"].keys() != {"value"}:
        return f"updates {sorted(found['updates'])!s:.60}, where a page changes a value alone"
    handle, value = inputs.get(found["uuid"]), found["updates"]["value"]
    if handle is None or _fits(value, handle.value, getattr(handle, "options", None)):
        return None  # viser ignores a removed field
    return f"value {value!r:.60}, where the field has {handle.value!r:.60}"


def _fits(value: Any, now: Any, options: tuple[str, ...] | None) -> bool:
    """Whether a field of the page can take a value: one of its `options` if given, otherwise of the present type."""
    if options is not None:
        return value in options
    if isinstance(now, int | float) and not isinstance(now, bool):
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(now, bool | str) and type(value) is type(now)


def _numbers(value: Any) -> Iterator[float]:
    """Every number in a message, including NaN."""
    if isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from _numbers(one)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield math.inf if isinstance(value, int) and abs(value) > LARGEST_NUMBER else value


Quaternion = tuple[float, float, float, float]
Box = tuple[FloatArray, FloatArray]

TIP_LENGTH = 3.0
"""Length of the drawn tip [tip radii]."""
TIP_TURNS = 40
HELD_RINGS = 24
"""Number of rings of a drawn object; it is even, so none lies in the middle of an edge."""
TOUCH_STEPS = 41
"""Nodes a side at which an object's first touch of a crown is sought."""


def facing(part: PlacedPart) -> Quaternion:
    """The rotation that brings x to the back of a component's face, y along its width, and z up its height."""
    back, ((x, y), tilt) = -np.array(part.axis), (part.line.outward, math.radians(part.tilt_deg))
    up = np.array([math.cos(tilt) * x, math.cos(tilt) * y, math.sin(tilt)])
    w, i, j, k = SO3.from_matrix(np.column_stack([back, np.cross(up, back), up])).wxyz.tolist()
    return w, i, j, k


def along_normal(normal: tuple[float, float, float]) -> Quaternion:
    """The smallest rotation that brings z to a unit vector that points upward."""
    x, y, z = normal
    real = math.sqrt((1.0 + z) / 2.0)
    return real, -y / (2.0 * real), x / (2.0 * real), 0.0


def body_box(part: PlacedPart) -> Box:
    """Size, and centre relative to the face's centre, of a component's body; axes as of `facing` [mm]."""
    entry = part.part
    size = np.array([entry.body_depth_mm.value, entry.body_width_mm.value, entry.body_height_mm.value])
    middle = size[2] / 2 - entry.active_height_in_body_mm.value
    return size, np.array([size[0] / 2, 0.0, middle])


def tip_apex_mm(plan: Plan, place_mm: tuple[float, float], depth_mm: float) -> FloatArray:
    """(3,) apex of the tip: `depth_mm` below the untouched top at the location, along the normal there."""
    foot = np.array([*place_mm, np.nan_to_num(plan.top_mm(*place_mm), nan=0.0)])
    return np.asarray(foot - depth_mm * np.array(plan.normal(*place_mm)), dtype=np.float64)


def tip_body(design: SensorDesign) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of the tip as a body of revolution about z, apex at the origin."""
    outline = tip_points_mm(design.indenter, TIP_LENGTH, 40)
    turns = np.linspace(0.0, 2 * np.pi, TIP_TURNS, endpoint=False)
    points = np.stack(
        [
            outline[:, None, 0] * np.cos(turns),
            outline[:, None, 0] * np.sin(turns),
            np.broadcast_to(outline[:, None, 1], (len(outline), len(turns))),
        ],
        axis=-1,
    ).reshape(-1, 3)
    return points, ring_triangles(len(outline), TIP_TURNS)


def held_body(held: HeldObject) -> tuple[FloatArray, IntArray]:
    """(n, 3) points [mm] and (m, 3) triangles of an object before it is turned, its centre at the origin.

    Rounded bodies are a ball of the edge's radius, its points moved away from the centre by the sharp body inside.
    """
    if isinstance(held, Mesh):
        return held.facets.vertices_mm, held.facets.triangles
    polar = np.linspace(0.0, 2 * np.pi if isinstance(held, Torus) else np.pi, HELD_RINGS)[:, None]
    turns = (np.arange(TIP_TURNS) + 0.5) * 2 * np.pi / TIP_TURNS
    flat = np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=-1)
    ring = np.round(np.sin(polar), 12)[..., None]
    ball = ring * flat + np.array([0.0, 0.0, 1.0]) * np.cos(polar)[..., None]
    if isinstance(held, Sphere):
        points = held.radius * ball
    elif isinstance(held, Ellipsoid):
        points = np.array([held.a, held.b, held.c]) * ball
    elif isinstance(held, Torus):
        points = held.radius * flat + held.tube * ball
    elif isinstance(held, HeldBox):
        core = np.array([held.length, held.width, held.height]) / 2 - held.edge_mm
        points = core * np.sign(ball) + held.edge_mm * ball
    else:
        assert isinstance(held, Cylinder | Punch)
        length = held.length if isinstance(held, Cylinder) else TIP_LENGTH * held.radius
        core = np.array([held.radius, held.radius, length / 2]) - held.edge_mm
        points = core * (np.sign(ring) * flat + np.sign(ball) * [0.0, 0.0, 1.0]) + held.edge_mm * ball
        points = (
            points[..., [2, 0, 1]]
            if isinstance(held, Cylinder)
            else points + np.array([0.0, 0.0, length / 2])
        )
    return points.reshape(-1, 3), ring_triangles(HELD_RINGS, TIP_TURNS)


def held_pose(plan: Plan, held: HeldObject, press: LivePress) -> tuple[FloatArray, Quaternion]:
    """Position of an object's centre (3,) in the cavity's coordinates [mm], and its rotation."""
    origin, axes = plan.top.press_frame(*press.place_mm)
    posed = held.model_copy(update={"yaw": held.yaw - plan.top.frame_turn_deg})
    body = held_body(held)[0] @ rotation(posed).T
    height = -float(body[:, 2].min()) - press.depth_mm
    if not plan.top.is_flat:
        nodes = np.linspace(-1.0, 1.0, TOUCH_STEPS) * np.abs(body[:, :2]).max()
        sag_mm = plan.top.in_frame.sag_mm(*np.meshgrid(nodes, nodes, indexing="ij"))
        height -= float(np.nanmin(bottom_mm(posed, nodes, nodes) + sag_mm))
    w, x, y, z = SO3.from_matrix(axes.T @ rotation(posed)).wxyz.tolist()
    sideways = np.array([*press.sideways_mm, 0.0])
    return origin + sideways + (height - sideways @ axes[2]) * axes[2], (w, x, y, z)


def mold_edges(design: SensorDesign) -> FloatArray:
    """(edge, 2, 3) start and end of the mold's outer edges: around foot and rim, and upright edges of its box [mm]."""
    found = outline_of(design)
    sides = (X, Y, (-1.0, 0.0), (0.0, -1.0))
    upright = sorted({place for side in sides for place in found.outer.touches_mm(side)})
    ring = found.outer.points(TURN_RAD).tolist()
    low, high = found.bottom_mm, found.top_mm
    around = [
        ((*a, z), (*b, z)) for z in (low, high) for a, b in zip(ring, (*ring[1:], ring[0]), strict=True)
    ]
    return np.array([*around, *(((x, y, low), (x, y, high)) for x, y in upright)])


def plane_cut(eye_mm: FloatArray, point_mm: FloatArray, axis: int, level_mm: float) -> FloatArray:
    """(3,) point where the ray from the eye through a point meets the plane where coordinate `axis` is `level_mm`."""
    way = point_mm - eye_mm
    if abs(way[axis]) < 1e-9:
        return point_mm
    return np.asarray(eye_mm + way * (level_mm - eye_mm[axis]) / way[axis], dtype=np.float64)


def round_cut(
    eye_mm: FloatArray, point_mm: FloatArray, centre_mm: Point, radius_mm: float, near_mm: FloatArray
) -> FloatArray:
    """(3,) point where the ray from the eye through a point meets a vertical cylinder about `centre_mm`.

    Of two such points, the one nearer to `near_mm` is used. If the ray misses the cylinder, its point nearest to the
    axis is used.
    """
    way, start = point_mm - eye_mm, eye_mm[:2] - centre_mm
    square, half = float(way[:2] @ way[:2]), float(start @ way[:2])
    if square < 1e-12:
        return point_mm
    root = math.sqrt(max(half**2 - square * (float(start @ start) - radius_mm**2), 0.0))
    meets = [eye_mm + way * share for share in ((-half - root) / square, (-half + root) / square)]
    return min(meets, key=lambda one: float(np.hypot(*(one - near_mm)[:2])))


def turn_deg(centre_mm: Point, start_mm: FloatArray, end_mm: FloatArray) -> float:
    """Angle about a centre (x, y) from one point to another, -180 to 180 [degrees]."""
    (x0, y0), (x1, y1) = (one[:2] - centre_mm for one in (start_mm, end_mm))
    return math.degrees(math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1))


def along_one_way(along_mm: float, height_mm: float) -> tuple[bool, bool]:
    """Whether a drag is along the wall, and whether it is in height; the larger of the two components decides."""
    is_along = abs(along_mm) >= abs(height_mm)
    return is_along, not is_along
