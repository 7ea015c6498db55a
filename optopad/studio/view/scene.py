"""The picture in three dimensions: layers, parts, mold, tip, pressed top, rays, ghosts; lengths in mm.

Parts and tip are dragged: the pointer's ray is cut with the plane that the thing moves in, the wall's inner face for a
part (along it or in height, not both), the level of its apex for the tip (with shift: upright, which is depth).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser
from numpy.typing import NDArray

from cad.mesh import Mesh
from design.geometry.cavity import CavityGeometry, PlacedPart, cavity_of
from design.geometry.mold_outline import outline_of
from design.spec import SensorDesign
from fabrication.driver.touch_reader import Touch
from optopad.report.scenes.mold_scene import body_mm
from optopad.studio.actions import Ghost
from optopad.studio.answers import Look, Rays
from optopad.studio.cut_mesh import cut_open
from optopad.studio.session import Press, Session
from sims.contact.tip import tip_of
from sims.rays.light_kinds import KINDS, LOST

FloatArray = NDArray[np.float64]
Colour = tuple[int, int, int]

CLEAR, BLACK, MOLD, TIP, BAD, GHOST = (
    (120, 180, 235),
    (40, 40, 44),
    (150, 156, 166),
    (236, 178, 140),
    (220, 38, 38),
    (0, 158, 115),
)
PART_COLOURS = {"emitter": (230, 159, 0), "receiver": (0, 114, 178)}
NO_TURN = (1.0, 0.0, 0.0, 0.0)
TIP_LENGTH = 3.0
"""Length of the drawn tip [tip radii]."""
FACE_MM = 0.25
"""How far a part's active face is drawn out of its wall [mm]."""


class Scene:
    """What is drawn, kept in step with the session.

    Parameters
    ----------
    server : of the page
    session : gets drags and clicks
    later : keeps a call for the page's own thread, the newest of a name; callbacks of the page must be quick
    with_row : says whether a dragged part takes its row along
    """

    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        *,
        later: Callable[[str, Callable[[], object]], None],
        with_row: Callable[[], bool],
    ) -> None:
        self._scene, self._session = server.scene, session
        self._later, self._with_row = later, with_row
        self._parts: dict[str, tuple[str, viser.FrameHandle, viser.BoxHandle, viser.BoxHandle]] = {}
        self._grabs: dict[str, FloatArray] = {}
        self._mold: tuple[str, Mesh] | None = None
        self._tip: viser.FrameHandle | None = None
        self._tip_shape = ""
        self._ghosts: list[viser.FrameHandle] = []
        self._scene.set_up_direction("+z")
        self._scene.world_axes.visible = False
        self._look_from_the_front(server)
        self._listen_to_clicks()

    def _look_from_the_front(self, server: viser.ViserServer) -> None:
        cavity = cavity_of(self._session.design)
        middle = np.array([cavity.length_mm / 2, cavity.width_mm / 2, cavity.clear_mm / 2])
        away = 1.5 * max(cavity.length_mm, cavity.width_mm)
        server.initial_camera.position = tuple(middle + away * np.array([-0.35, -1.0, 0.85]))
        server.initial_camera.look_at = tuple(middle)
        server.initial_camera.up = (0.0, 0.0, 1.0)

    def draw_design(self, design: SensorDesign, bad: Sequence[str], *, is_bad: bool) -> None:
        """Layers and parts.

        Parameters
        ----------
        bad : names of parts that do not fit
        is_bad : whether the design breaks a rule
        """
        cavity = cavity_of(design)
        self._draw_layers(cavity, is_bad=is_bad)
        wanted = {part.name: part for part in cavity.parts}
        for name in [
            name
            for name, (kind, *_) in self._parts.items()
            if wanted.get(name) is None or kind != _key(wanted[name])
        ]:
            self._parts.pop(name)[1].remove()
        for part in cavity.parts:
            self._draw_part(part, cavity, is_bad=part.name in bad)

    def _draw_layers(self, cavity: CavityGeometry, *, is_bad: bool) -> None:
        length, width = cavity.length_mm, cavity.width_mm
        if cavity.black_mm > 0:
            self._scene.add_box(
                "/pad/black",
                color=BLACK,
                dimensions=(length, width, cavity.black_mm),
                position=(length / 2, width / 2, -cavity.black_mm / 2),
            )
        else:
            self._scene.remove_by_name("/pad/black")
        points, triangles = _side_walls(length, width, cavity.clear_mm)
        self._scene.add_mesh_simple(
            "/pad/sides",
            points,
            triangles,
            color=BAD if is_bad else CLEAR,
            opacity=0.18,
            side="double",
            cast_shadow=False,
        )

    def _draw_part(self, part: PlacedPart, cavity: CavityGeometry, *, is_bad: bool) -> None:
        place = part.position_mm
        colour = BAD if is_bad else PART_COLOURS[part.kind]
        if part.name not in self._parts:
            self._parts[part.name] = self._new_part(part, cavity, place)
        _, frame, body, face = self._parts[part.name]
        frame.position = place
        body.color = colour
        face.color = colour

    def _new_part(
        self, part: PlacedPart, cavity: CavityGeometry, place: tuple[float, float, float]
    ) -> tuple[str, viser.FrameHandle, viser.BoxHandle, viser.BoxHandle]:
        at = f"/parts/{part.name}"
        frame = self._scene.add_frame(at, show_axes=False, position=place)
        low, high = (np.array(corner) - place for corner in body_mm(part, cavity))
        body = self._scene.add_box(
            f"{at}/body", dimensions=tuple(high - low), position=tuple((low + high) / 2)
        )
        across = part.wall in ("south", "north")
        size = (
            (2 * part.half_width_mm, FACE_MM, 2 * part.half_height_mm)
            if across
            else (FACE_MM, 2 * part.half_width_mm, 2 * part.half_height_mm)
        )
        face = self._scene.add_box(f"{at}/face", dimensions=size)
        self._scene.add_label(
            f"{at}/name", part.name, position=(0.0, 0.0, float(high[2]) + 0.8), anchor="bottom-center"
        )
        for node in (body, face):
            self._drag_part(node, part.name)
        return _key(part), frame, body, face

    def _drag_part(self, node: viser.BoxHandle, name: str) -> None:
        async def dragged(event: viser.SceneNodeDragEvent[viser.BoxHandle]) -> None:
            cavity = cavity_of(self._session.design)
            part = next((one for one in cavity.parts if one.name == name), None)
            if part is None:
                return
            axis = 1 if part.wall in ("south", "north") else 0
            level = {"south": 0.0, "west": 0.0, "north": cavity.width_mm, "east": cavity.length_mm}[part.wall]
            here = np.array(part.position_mm)
            if event.phase == "start":
                self._grabs[name] = _cut(event, np.array(event.start_position), axis, level)
                self._grabs[f"{name} from"] = here
            start = self._grabs.get(f"{name} from", here)
            way = _cut(event, np.array(event.end_position), axis, level) - self._grabs.get(name, here)
            along, height = _along_one_axis(float(way[1 - axis]), float(way[2]))
            place, row = (float(start[1 - axis]) + along, float(start[2]) + height), self._with_row()
            self._later(
                f"move {name}",
                lambda: self._session.move_part(name, along_mm=place[0], height_mm=place[1], with_row=row),
            )

        node.on_drag("left")(dragged)

    def draw_top(self, look: Look) -> None:
        """The pressed top."""
        self._scene.add_mesh_simple(
            "/pad/top",
            look.points_mm,
            look.triangles,
            color=CLEAR,
            opacity=0.55,
            side="double",
            cast_shadow=False,
        )

    def draw_flat_top(self, design: SensorDesign) -> None:
        """The untouched top of a design that is not worked at."""
        cavity = design.cavity
        points, triangles = _plane(cavity.length_mm, cavity.width_mm, cavity.clear_thickness_mm)
        self._scene.add_mesh_simple(
            "/pad/top", points, triangles, color=BAD, opacity=0.3, side="double", cast_shadow=False
        )

    def draw_tip(self, design: SensorDesign, press: Press) -> None:
        """The tip where it presses."""
        shape = design.indenter.model_dump_json()
        if self._tip is None or shape != self._tip_shape:
            self._tip = self._new_tip(design)
            self._tip_shape = shape
        self._tip.position = (press.x_mm, press.y_mm, design.cavity.clear_thickness_mm - press.depth_mm)

    def _new_tip(self, design: SensorDesign) -> viser.FrameHandle:
        frame = self._scene.add_frame("/tip", show_axes=False)
        points, triangles = _turned_outline(design)
        body = self._scene.add_mesh_simple(
            "/tip/body", points, triangles, color=TIP, opacity=0.75, side="double", cast_shadow=False
        )

        async def moved(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            now, clear = self._session.press, self._session.design.cavity.clear_thickness_mm
            apex = np.array([now.x_mm, now.y_mm, clear - now.depth_mm])
            if event.phase == "start":
                self._grabs["tip"] = np.array(event.start_position)
                self._grabs["tip offset"] = apex - self._grabs["tip"]
            at = (
                _cut(event, np.array(event.end_position), 2, float(self._grabs["tip"][2]))
                + self._grabs["tip offset"]
            )
            x, y = float(at[0]), float(at[1])
            self._later("tip", lambda: self._session.move_tip(x_mm=x, y_mm=y))

        async def pushed(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            if event.phase == "start":
                self._grabs["push"] = np.array([event.start_position[2], self._session.press.depth_mm, 0.0])
            grab = self._grabs["push"]
            depth = float(grab[1] + grab[0] - event.end_position[2])
            self._later("depth", lambda: self._session.move_tip(depth_mm=depth))

        body.on_drag("left")(moved)
        body.on_drag("left", modifier="shift")(pushed)
        return frame

    def _listen_to_clicks(self) -> None:
        @self._scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            way, clear = np.array(event.ray_direction), self._session.design.cavity.clear_thickness_mm
            if abs(way[2]) < 1e-9:
                return
            at = np.array(event.ray_origin) + way * (clear - event.ray_origin[2]) / way[2]
            cavity = cavity_of(self._session.design)
            if 0.0 <= at[0] <= cavity.length_mm and 0.0 <= at[1] <= cavity.width_mm:
                x, y = float(at[0]), float(at[1])
                self._later("tip", lambda: self._session.move_tip(x_mm=x, y_mm=y))

    def draw_rays(self, rays: Rays | None, *, is_dark: bool) -> None:
        """Sample paths, a colour a kind; None: none."""
        for kind in (*KINDS, LOST):
            name = f"/rays/{kind.key}"
            mine = [one.places_mm for one in rays.rays if one.kind == kind.key] if rays is not None else []
            if not mine:
                self._scene.remove_by_name(name)
                continue
            segments = np.concatenate([np.stack([places[:-1], places[1:]], axis=1) for places in mine])
            self._scene.add_line_segments(
                name,
                segments,
                _rgb(kind.night_colour if is_dark else kind.colour),
                thickness=1.6,
                thickness_units="screen",
            )

    def set_mold(self, digest: str, mesh: Mesh) -> None:
        """The mold as it is printed, of a design."""
        self._mold = (digest, mesh)

    def draw_mold(self, design: SensorDesign, shown: str) -> None:
        """The mold: "hidden", "cut" open or "whole"; its outline until the solid is made."""
        for name in ("/mold/solid", "/mold/outline"):
            self._scene.remove_by_name(name)
        if shown == "hidden":
            return
        if self._mold is None or self._mold[0] != design.digest:
            self._scene.add_line_segments(
                "/mold/outline", _outline(design), MOLD, thickness=1.0, thickness_units="screen"
            )
            return
        mesh = self._mold[1]
        points, triangles = mesh.vertices.astype(np.float64), mesh.triangles
        if shown == "cut":
            points, triangles = cut_open(points, triangles, 0.5 * design.cavity.width_mm)
        self._scene.add_mesh_simple(
            "/mold/solid", points, triangles, color=MOLD, side="double", flat_shading=True, cast_shadow=False
        )

    def draw_ghosts(self, ghosts: Sequence[Ghost]) -> None:
        """Parts and top of verified alternatives, to be clicked."""
        for frame in self._ghosts:
            frame.remove()
        self._ghosts = []
        for number, ghost in enumerate(ghosts):
            frame = self._scene.add_frame(f"/ghosts/{number}", show_axes=False)
            self._ghosts.append(frame)
            cavity = cavity_of(ghost.design)
            level = cavity.clear_mm
            top = self._scene.add_mesh_simple(
                f"/ghosts/{number}/top",
                *_plane(cavity.length_mm, cavity.width_mm, level),
                color=GHOST,
                opacity=0.12,
                side="double",
                cast_shadow=False,
            )
            self._click_ghost(top, ghost)
            for part in cavity.parts:
                size = (2 * part.half_width_mm + 0.4, 0.6, 2 * part.half_height_mm + 0.4)
                turned = size if part.wall in ("south", "north") else (size[1], size[0], size[2])
                node = self._scene.add_box(
                    f"/ghosts/{number}/{part.name}",
                    color=GHOST,
                    opacity=0.45,
                    dimensions=turned,
                    position=part.position_mm,
                )
                self._click_ghost(node, ghost)
            self._scene.add_label(
                f"/ghosts/{number}/kind",
                f"{number + 1}: {ghost.kind}",
                position=(cavity.length_mm, cavity.width_mm * (0.25 + 0.25 * number), level),
                anchor="center-left",
            )

    def _click_ghost(self, node: viser.MeshHandle | viser.BoxHandle, ghost: Ghost) -> None:
        def clicked(_event: object) -> None:
            self._later("ghost", lambda: self._session.take(ghost.design, f"taken: {ghost.kind}"))

        node.on_click(clicked)

    def draw_touch(self, touch: Touch | None, clear_mm: float) -> None:
        """The sensor's touch with its uncertainty, two standard deviations wide; None or no touch: nothing."""
        if touch is None or not touch.is_touched or not np.isfinite(touch.press_mm).all():
            self._scene.remove_by_name("/touch")
            return
        x, y, depth = (float(value) for value in touch.press_mm)
        sigma = [float(value) if np.isfinite(value) else 0.2 for value in touch.sigma_mm]
        self._scene.add_icosphere(
            "/touch",
            radius=1.0,
            scale=(max(2 * sigma[0], 0.15), max(2 * sigma[1], 0.15), max(2 * sigma[2], 0.15)),
            color=(209, 36, 47),
            position=(x, y, clear_mm - depth),
            cast_shadow=False,
        )


def _key(part: PlacedPart) -> str:
    """What a part's picture depends on, but its place."""
    return f"{part.kind} {part.wall} {part.part_id} {part.half_width_mm} {part.half_height_mm}"


def _cut(event: viser.SceneNodeDragEvent, point: FloatArray, axis: int, level: float) -> FloatArray:  # type: ignore[type-arg]
    """Where the ray from the eye through a point meets the plane of one coordinate."""
    eye = np.array(event.client.camera.position)
    way = point - eye
    if abs(way[axis]) < 1e-9:
        return point
    return np.asarray(eye + way * (level - eye[axis]) / way[axis], dtype=np.float64)


def _along_one_axis(along: float, height: float) -> tuple[float, float]:
    """A drag goes along the wall or in height, whichever it does more: a hand's wobble is not a second change."""
    return (along, 0.0) if abs(along) >= abs(height) else (0.0, height)


def _side_walls(length: float, width: float, height: float) -> tuple[FloatArray, NDArray[np.int64]]:
    corners = [(0, 0), (length, 0), (length, width), (0, width)]
    points = np.array([(x, y, z) for z in (0.0, height) for x, y in corners], dtype=np.float64)
    faces = [
        face for k in range(4) for face in ((k, (k + 1) % 4, k + 4), ((k + 1) % 4, (k + 1) % 4 + 4, k + 4))
    ]
    return points, np.array(faces)


def _plane(length: float, width: float, level: float) -> tuple[FloatArray, NDArray[np.int64]]:
    points = np.array(
        [(0, 0, level), (length, 0, level), (length, width, level), (0, width, level)], dtype=np.float64
    )
    return points, np.array([(0, 1, 2), (0, 2, 3)])


def _turned_outline(design: SensorDesign) -> tuple[FloatArray, NDArray[np.int64]]:
    """The tip as a body of revolution, its apex at the origin."""
    radius, height = tip_of(design.indenter).points(np.linspace(0.0, TIP_LENGTH, 40))
    outline = np.column_stack([radius, height]) * design.indenter.tip_radius_mm
    turns = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    points = np.stack(
        [
            outline[:, None, 0] * np.cos(turns),
            outline[:, None, 0] * np.sin(turns),
            np.broadcast_to(outline[:, None, 1], (len(outline), len(turns))),
        ],
        axis=-1,
    ).reshape(-1, 3)
    ring, turn = (a.ravel() for a in np.meshgrid(np.arange(len(outline) - 1), np.arange(40), indexing="ij"))
    a, b = ring * 40 + turn, ring * 40 + (turn + 1) % 40
    triangles = np.concatenate([np.stack([a, b, b + 40], axis=1), np.stack([a, b + 40, a + 40], axis=1)])
    return points, triangles


def _outline(design: SensorDesign) -> FloatArray:
    """(edge, 2, 3) edges of the mold's outer box [mm]."""
    found = outline_of(design)
    x = (-found.wall_x_mm, found.length_mm + found.wall_x_mm)
    y = (-found.wall_y_mm, found.width_mm + found.wall_y_mm)
    z = (found.bottom_mm, found.top_mm)
    corners = np.array([(a, b, c) for a in x for b in y for c in z], dtype=np.float64)
    edges = [(i, j) for i in range(8) for j in range(i + 1, 8) if (corners[i] != corners[j]).sum() == 1]
    return np.array([(corners[i], corners[j]) for i, j in edges])


def _rgb(colour: str) -> Colour:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue
