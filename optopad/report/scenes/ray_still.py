"""The view of light as a still picture: what the page shows in print and where scripts do not run."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from optopad.report.scenes.ray_scene import RayScene
from optopad.report.text.markup import Html, element
from sims.optics.oracle.paths import LightPath
from sims.plots.shapes.pad_outline import edge_mm
from sims.plots.shapes.pressed_top import PressFrame, press_frame
from sims.rays.light_kinds import LOST, LightKind, kind_of
from sims.rays.ray_states import RayState

Place = tuple[float, float, float]

YAW_DEG, PITCH_DEG = -32.0, 24.0
"""Where the onlooker stands: the same as the script's first view."""
WIDTH, MARGIN = 560.0, 22.0
"""Width of the picture and room for names [px]."""
RINGS = 48
THIN = 2
"""One line in so many is drawn: a still cannot be turned to see behind others."""
SHANK = 1.3
"""Length of the tip that is drawn [tip radii]."""
MOST_NAMES = 40
INK, MUTED, BLACK, CLEAR = "#1b1f24", "#5b6470", "#33383f", "#dcecf7"


def still(scene: RayScene, number: int) -> Html:
    """One state as a drawing."""
    eye = _Eye(scene)
    state = scene.states[number]
    parts = [
        *_block(eye, scene),
        *_faces(eye, scene),
        *(_line(eye, path, LOST) for path in state.lost[::THIN]),
        *(_line(eye, path, kind_of(path.fate)) for path in state.paths[::THIN]),
        *_press(eye, scene, state),
        *_names(eye, scene),
    ]
    words = f"Block, parts and sample paths of light from above one corner: {scene.labels[number]}"
    return element(
        "svg",
        element("title", words),
        *parts,
        role="img",
        class_="plot",
        viewBox=f"0 0 {WIDTH:.0f} {eye.height:.0f}",
        font_family="sans-serif",
        font_size="11",
    )


class _Eye:
    """Orthographic projection of the block onto the picture."""

    def __init__(self, scene: RayScene) -> None:
        cavity = scene.cavity
        self._middle = cavity.length_mm / 2, cavity.width_mm / 2, cavity.clear_mm / 2
        yaw, pitch = math.radians(YAW_DEG), math.radians(PITCH_DEG)
        self._yaw, self._pitch = (math.cos(yaw), math.sin(yaw)), (math.cos(pitch), math.sin(pitch))
        self._scale, self._shift = 1.0, (0.0, 0.0)
        heights = (-cavity.black_mm, cavity.clear_mm + 0.4 * scene.design.indenter.tip_radius_mm)
        corners = [
            self.seen((x, y, z))
            for x in (0.0, cavity.length_mm)
            for y in (0.0, cavity.width_mm)
            for z in heights
        ]
        low, high = ([pick(c[k] for c in corners) for k in (0, 1)] for pick in (min, max))
        self._scale = (WIDTH - 2 * MARGIN) / (high[0] - low[0])
        self._shift = MARGIN - self._scale * low[0], MARGIN - self._scale * low[1]
        self.height = self._scale * (high[1] - low[1]) + 2 * MARGIN

    def seen(self, place: Place) -> tuple[float, float]:
        """A place [mm] on the picture [px]."""
        x, y, z = (value - middle for value, middle in zip(place, self._middle, strict=True))
        across = self._yaw[0] * x - self._yaw[1] * y
        away = self._yaw[1] * x + self._yaw[0] * y
        up = z * self._pitch[0] + away * self._pitch[1]
        return self._scale * across + self._shift[0], -self._scale * up + self._shift[1]

    def points(self, places: list[Place]) -> str:
        """Places as an attribute of a line or a polygon."""
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self.seen, places))


def _block(eye: _Eye, scene: RayScene) -> list[Html]:
    cavity = scene.cavity
    edge = [(x, y, z) for x, y, z in edge_mm(cavity.plan).tolist()]
    rim = [(x, y) for x, y, _ in edge]
    seam = BLACK if cavity.plan.is_disc else "none"
    found = [_polygon(eye, [(x, y, -cavity.black_mm) for x, y in rim], BLACK)]
    found += [
        _polygon(eye, [(*a, 0.0), (*b, 0.0), (*b, -cavity.black_mm), (*a, -cavity.black_mm)], BLACK, seam)
        for a, b in pairwise([*rim, rim[0]])
    ]
    found.append(_polygon(eye, [(x, y, 0.0) for x, y in rim], CLEAR, MUTED))
    found.append(_polygon(eye, edge, "none", MUTED))
    found += [
        element("polyline", points=eye.points([(x, y, 0.0), (x, y, z)]), stroke=MUTED, fill="none")
        for x, y, z in _uprights(eye, scene, edge)
    ]
    return found + [_outline(eye, line, MUTED, 0.6) for line in _crown_lines(scene)]


def _uprights(eye: _Eye, scene: RayScene, edge: list[Place]) -> list[Place]:
    """Corners of a rectangle's top; of a round wall where it turns out of sight."""
    if scene.cavity.plan.is_disc:
        across = [eye.seen(place)[0] for place in edge]
        return [edge[pick(range(len(edge)), key=across.__getitem__)] for pick in (min, max)]
    return edge[:: len(edge) // 4]


def _crown_lines(scene: RayScene) -> list[list[Place]]:
    """Lines over an untouched crown, along x and along y through the middle."""
    plan = scene.cavity.plan
    if plan.top.is_flat:
        return []
    x, y = plan.centre_mm
    shares = [k / RINGS for k in range(RINGS + 1)]
    along = (
        [(share * plan.length_mm, y) for share in shares],
        [(x, share * plan.width_mm) for share in shares],
    )
    return [[(*place, plan.top_mm(*place)) for place in line if plan.contains(*place)] for line in along]


def _polygon(eye: _Eye, places: list[Place], fill: str, stroke: str = "none") -> Html:
    return element("polygon", points=eye.points(places), fill=fill, stroke=stroke, stroke_width="0.8")


def _line(eye: _Eye, path: LightPath, kind: LightKind) -> Html:
    places = [(float(x), float(y), float(z)) for x, y, z in path.places_mm]
    return element(
        "polyline",
        points=eye.points(places),
        fill="none",
        stroke=kind.colour,
        stroke_width="0.65",
        stroke_dasharray=" ".join(f"{value:g}" for value in kind.dash) or None,
    )


def _press(eye: _Eye, scene: RayScene, state: RayState) -> list[Html]:
    """Circles of the deformed top where they lie in the block, and the tip's outline."""
    press = state.indentation
    if press is None:
        return []
    frame, tip = press_frame(scene.design, scene.place_mm), press.tip_radius_mm
    radii = [share * tip for share in (0.33, 0.66, 1.0, 1.5, 2.2)]
    heights = [float(press.height_mm[int((press.radius_mm >= radius).argmax())]) for radius in radii]
    rings = [
        _ring(frame, radius, height, on_crown=True) for radius, height in zip(radii, heights, strict=True)
    ]
    equator, end = tip - press.depth_mm, SHANK * tip - press.depth_mm
    shank = [_ring(frame, tip, end, on_crown=False), *_sides(frame, tip, equator, end)]
    inside = [ring for ring in rings if all(_is_inside(scene, place) for place in ring)]
    return [_outline(eye, places, INK, 0.9) for places in inside] + [
        _outline(eye, places, MUTED, 1.3) for places in shank
    ]


def _ring(frame: PressFrame, radius: float, height: float, *, on_crown: bool) -> list[Place]:
    """A circle about the press at a height over its frame's plane, or over the untouched top."""
    angles = [2 * math.pi * k / RINGS for k in range(RINGS + 1)]
    across, aside = (np.array([radius * turn(angle) for angle in angles]) for turn in (math.cos, math.sin))
    over = height - frame.fall_mm(across, aside) if on_crown else np.full(len(angles), height)
    return [(x, y, z) for x, y, z in frame.places_mm(across, aside, over).tolist()]


def _sides(frame: PressFrame, radius: float, low: float, high: float) -> list[list[Place]]:
    """The two sides of a cylinder about the press as they are seen."""
    yaw, pitch = math.radians(YAW_DEG), math.radians(PITCH_DEG)
    away = math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), -math.sin(pitch)
    upward = frame.axes[2]
    across = np.cross(np.array(away), upward)
    across *= radius / np.linalg.norm(across)
    ends = [frame.origin_mm + level * upward for level in (low, high)]
    return [[tuple((end + side * across).tolist()) for end in ends] for side in (-1, 1)]


def _is_inside(scene: RayScene, place: Place) -> bool:
    return scene.cavity.plan.contains(place[0], place[1])


def _outline(eye: _Eye, places: list[Place], colour: str, width: float) -> Html:
    return element(
        "polyline", points=eye.points(places), fill="none", stroke=colour, stroke_width=f"{width:g}"
    )


def _shown(scene: RayScene) -> set[str]:
    return {name for pair in scene.pair_names for name in pair.split("-")}


def _faces(eye: _Eye, scene: RayScene) -> list[Html]:
    """Active faces of all parts."""
    cavity, shown, found = scene.cavity, _shown(scene), []
    for part in cavity.parts:
        x, y, z = part.position_mm
        along = [part.half_width_mm * way for way in part.line.tangent]
        corners = [
            (x + u * along[0], y + u * along[1], z + v * part.half_height_mm)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        colour = INK if part.name in shown else MUTED
        found.append(_polygon(eye, corners, colour if part.kind == "emitter" else "#ffffff", colour))
    return found


def _names(eye: _Eye, scene: RayScene) -> list[Html]:
    """Names of the parts, a little outward of them."""
    cavity, shown, found = scene.cavity, _shown(scene), []
    reach = 0.06 * max(cavity.length_mm, cavity.width_mm)
    for part in cavity.parts:
        if part.name not in shown and len(cavity.parts) > MOST_NAMES:
            continue
        x, y, z = part.position_mm
        ahead, aside = part.line.outward
        left, up = eye.seen((x + ahead * reach, y + aside * reach, z))
        found.append(
            element(
                "text",
                part.name,
                x=f"{left:.1f}",
                y=f"{up + 4:.1f}",
                text_anchor="middle",
                fill=INK if part.name in shown else MUTED,
                stroke="#ffffff",
                stroke_width="3",
                paint_order="stroke",
            )
        )
    return found
