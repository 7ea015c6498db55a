"""The 3D picture: layers, components, mold, tip, pressed top, light paths, and alternative designs; lengths in mm.

Components and tip can be dragged: the pointer's ray is intersected with the surface on which they move. For a component
this is the wall's inner face; it moves either along the wall or in height. For the tip, or the object that presses in
its place, it is a horizontal plane; with the shift key it moves along the normal and changes the depth, and with the
control key an object turns. A second tip is dragged in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import viser

from optopad.cad.mesh import Mesh
from optopad.design.arrays import FloatArray, IntArray
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, Plan, cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.touch_reader import Touch
from optopad.sims.rays import KINDS, LOST
from optopad.studio.actions import Ghost
from optopad.studio.pad_mesh import cut_open, side_walls, slab, struck_place, untouched_top
from optopad.studio.session import LivePress, Session
from optopad.studio.view.shapes import (
    along_normal,
    along_one_way,
    body_box,
    facing,
    held_body,
    held_pose,
    mold_edges,
    plane_cut,
    round_cut,
    tip_apex_mm,
    tip_body,
    turn_deg,
)
from optopad.studio.workshop import Look, Rays

Colour = tuple[int, int, int]
PartDrag = viser.SceneNodeDragEvent[viser.BoxHandle]

CLEAR, BLACK, MOLD, TIP, BAD, GHOST = (
    (120, 180, 235),
    (40, 40, 44),
    (150, 156, 166),
    (236, 178, 140),
    (220, 38, 38),
    (0, 158, 115),
)
PART_COLOURS = {"emitter": (230, 159, 0), "receiver": (0, 114, 178)}
UNTURNED = {"yaw": 0.0, "pitch": 0.0, "roll": 0.0}
FIRST, SECOND = "/tip", "/second-tip"
FACE_MM = 0.25
"""Thickness of a component's active face in the picture [mm]."""


class PadScene:
    """The 3D picture, synchronised with the session.

    Parameters
    ----------
    server : the page's server
    session : receives drags and clicks
    later : schedules a call on the page's thread; a newer call with the same name replaces it
    with_row : whether dragging a component moves its whole row
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
        self._tips: dict[str, tuple[str, viser.FrameHandle]] = {}
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
        """Draw the layers and components of a design.

        Parameters
        ----------
        bad : names of components with errors
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
            self._draw_part(part, is_bad=part.name in bad)

    def _draw_layers(self, cavity: CavityGeometry, *, is_bad: bool) -> None:
        if cavity.black_mm <= 0:
            self._scene.remove_by_name("/pad/black")
        else:
            points, triangles = slab(cavity.plan, cavity.black_mm)
            self._scene.add_mesh_simple("/pad/black", points, triangles, color=BLACK, flat_shading=True)
        points, triangles = side_walls(cavity.plan)
        self._scene.add_mesh_simple(
            "/pad/sides",
            points,
            triangles,
            color=BAD if is_bad else CLEAR,
            opacity=0.18,
            side="double",
            cast_shadow=False,
        )

    def _draw_part(self, part: PlacedPart, *, is_bad: bool) -> None:
        colour = BAD if is_bad else PART_COLOURS[part.kind]
        if part.name not in self._parts:
            self._parts[part.name] = self._new_part(part)
        _, frame, body, face = self._parts[part.name]
        frame.position, frame.wxyz = part.position_mm, facing(part)
        body.color = colour
        face.color = colour

    def _new_part(self, part: PlacedPart) -> tuple[str, viser.FrameHandle, viser.BoxHandle, viser.BoxHandle]:
        """Draw a component in the coordinate system of its face: x points to its back, y along its width."""
        at = f"/parts/{part.name}"
        frame = self._scene.add_frame(at, show_axes=False)
        size, middle = body_box(part)
        body = self._scene.add_box(f"{at}/body", dimensions=size, position=middle)
        face = self._scene.add_box(
            f"{at}/face", dimensions=(FACE_MM, 2 * part.half_width_mm, 2 * part.half_height_mm)
        )
        above = float(middle[2] + size[2] / 2) + 0.8
        label = (-0.8, 0.0, 0.0) if part.is_on_floor else (0.0, 0.0, above)
        self._scene.add_label(f"{at}/name", part.name, position=label, anchor="bottom-center")
        for node in (body, face):
            self._drag_part(node, part.name)
        return _key(part), frame, body, face

    def _drag_part(self, node: viser.BoxHandle, name: str) -> None:
        async def dragged(event: viser.SceneNodeDragEvent[viser.BoxHandle]) -> None:
            parts = cavity_of(self._session.design).parts
            part = next((one for one in parts if one.name == name), None)
            if part is None:
                return
            where = self._dragged_to(event, part)
            row = self._with_row()
            self._later(f"move {name}", lambda: self._session.move_part(name, **where, with_row=row))

        node.on_drag("left")(dragged)

    def _dragged_to(self, event: PartDrag, part: PlacedPart) -> dict[str, float]:
        """New position of a dragged component: in a wall or its height, or on the floor [mm, degrees]."""
        if part.is_on_floor:
            return self._drag_on_floor(event, part)
        if part.angle_deg is None:
            return self._drag_straight(event, part)
        return self._drag_round(event, part, part.angle_deg)

    def _drag_on_floor(self, event: PartDrag, part: PlacedPart) -> dict[str, float]:
        """New position of a component on the floor, x and y [mm]."""
        here, eye = np.array(part.position_mm), np.array(event.client.camera.position)
        if event.phase == "start":
            self._grabs[part.name] = plane_cut(eye, np.array(event.start_position), 2, here[2])
            self._grabs[f"{part.name} from"] = here
        at = plane_cut(eye, np.array(event.end_position), 2, here[2])
        to = self._grabs.get(f"{part.name} from", here) + at - self._grabs.get(part.name, here)
        return {"x_mm": float(to[0]), "y_mm": float(to[1])}

    def _drag_straight(self, event: PartDrag, part: PlacedPart) -> dict[str, float]:
        """New position of a component on its straight wall, along the wall or in height [mm]."""
        here, eye = np.array(part.position_mm), np.array(event.client.camera.position)
        axis = int(np.argmax(np.abs(part.line.outward)))
        if event.phase == "start":
            self._grabs[part.name] = plane_cut(eye, np.array(event.start_position), axis, here[axis])
            self._grabs[f"{part.name} from"] = np.array([part.along_mm, here[2]])
        from_mm, from_up_mm = self._grabs.get(
            f"{part.name} from", np.array([part.along_mm, here[2]])
        ).tolist()
        at = plane_cut(eye, np.array(event.end_position), axis, here[axis])
        way = at - self._grabs.get(part.name, here)
        along, rise = float(way[:2] @ part.line.tangent), float(way[2])
        is_along, is_up = along_one_way(along, rise)
        return {"along_mm": from_mm + is_along * along, "height_mm": from_up_mm + is_up * rise}

    def _drag_round(self, event: PartDrag, part: PlacedPart, angle_deg: float) -> dict[str, float]:
        """New position of a component in its round wall: direction [degrees] and height [mm]."""
        here, eye = np.array(part.position_mm), np.array(event.client.camera.position)
        arcs = self._plan.outline.bare.arcs
        wall = min(arcs, key=lambda arc: math.dist(arc.centre_mm, part.position_mm[:2]))
        if event.phase == "start":
            self._grabs[part.name] = np.array(event.start_position)
            self._grabs[f"{part.name} from"] = np.array([angle_deg, here[2]])
        from_deg, from_mm = self._grabs.get(f"{part.name} from", np.array([angle_deg, here[2]])).tolist()
        grab = self._grabs.get(part.name, here)
        radius = math.dist(wall.centre_mm, grab[:2])
        at = round_cut(eye, np.array(event.end_position), wall.centre_mm, radius, here)
        turn, rise = turn_deg(wall.centre_mm, grab, at), float(at[2] - grab[2])
        is_along, is_up = along_one_way(np.radians(turn) * wall.radius_mm, rise)
        return {"angle_deg": from_deg + is_along * turn, "height_mm": from_mm + is_up * rise}

    def draw_top(self, look: Look) -> None:
        """Draw the pressed top."""
        self._scene.add_mesh_simple(
            "/pad/top",
            look.points_mm,
            look.triangles,
            color=CLEAR,
            opacity=0.55,
            side="double",
            cast_shadow=False,
        )

    def draw_untouched_top(self, design: SensorDesign, *, is_bad: bool) -> None:
        """Draw the untouched top, for a design without results."""
        points, triangles = untouched_top(cavity_of(design).plan)
        self._scene.add_mesh_simple(
            "/pad/top",
            points,
            triangles,
            color=BAD if is_bad else CLEAR,
            opacity=0.3 if is_bad else 0.55,
            side="double",
            cast_shadow=False,
        )

    def draw_tip(self, design: SensorDesign, press: LivePress) -> None:
        """Draw what presses: one or two tips along the normals of the untouched top there, or an object."""
        held, plan = press.held, cavity_of(design).plan
        if held is not None:
            shape = held.model_copy(update=UNTURNED).line
            tip = self._tip(FIRST, shape, lambda: held_body(held))
            tip.position, tip.wxyz = held_pose(plan, held, press)
        else:
            shape = design.indenter.model_dump_json()
            for name, (x, y, depth) in zip((FIRST, SECOND), press.tips_mm, strict=False):
                tip = self._tip(name, shape, lambda: tip_body(design))
                tip.position, tip.wxyz = tip_apex_mm(plan, (x, y), depth), along_normal(plan.normal(x, y))
        if press.second_mm is None and SECOND in self._tips:
            self._tips.pop(SECOND)[1].remove()

    def _tip(
        self, name: str, shape: str, body: Callable[[], tuple[FloatArray, IntArray]]
    ) -> viser.FrameHandle:
        """The node of what presses, made anew if it has another shape than before."""
        if self._tips.get(name, ("",))[0] != shape:
            self._tips[name] = shape, self._new_tip(name, body())
        return self._tips[name][1]

    def _new_tip(self, name: str, body_mesh: tuple[FloatArray, IntArray]) -> viser.FrameHandle:
        frame = self._scene.add_frame(name, show_axes=False)
        body = self._scene.add_mesh_simple(
            f"{name}/body", *body_mesh, color=TIP, opacity=0.75, side="double", cast_shadow=False
        )
        move = self._session.move_tip if name == FIRST else self._session.move_second

        def now() -> FloatArray:
            """Location and depth of the tip."""
            tips = self._session.press.tips_mm
            return np.array(tips[0] if name == FIRST else tips[-1])

        async def moved(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            if event.phase == "start" or name not in self._grabs:
                self._grabs[name] = np.array(event.start_position)
                self._grabs[f"{name} offset"] = now()[:2] - self._grabs[name][:2]
            eye, level = np.array(event.client.camera.position), float(self._grabs[name][2])
            at = plane_cut(eye, np.array(event.end_position), 2, level)[:2] + self._grabs[f"{name} offset"]
            x, y = float(at[0]), float(at[1])
            self._later(name, lambda: move(x_mm=x, y_mm=y))

        async def pushed(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            x, y, from_mm = now().tolist()
            normal, grab = np.array(self._plan.normal(x, y)), f"{name} push"
            if event.phase == "start" or grab not in self._grabs:
                self._grabs[grab] = np.array(event.start_position)
                self._grabs[f"{grab} from"] = np.array([from_mm])
            way = self._grabs[grab] - np.array(event.end_position)
            depth = float(self._grabs[f"{grab} from"][0] + way @ normal)
            self._later(f"{name} depth", lambda: move(depth_mm=depth))

        async def turned(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            press = self._session.press
            if press.held is None:
                return
            if event.phase == "start" or "turn" not in self._grabs:
                self._grabs["turn"] = np.array(event.start_position)
                self._grabs["turn from"] = np.array([press.held.yaw])
            eye, grab = np.array(event.client.camera.position), self._grabs["turn"]
            at = plane_cut(eye, np.array(event.end_position), 2, float(grab[2]))
            yaw = float(self._grabs["turn from"][0]) + turn_deg(press.place_mm, grab, at)
            self._later("turn", lambda: self._session.turn(yaw=yaw))

        async def sheared(event: viser.SceneNodeDragEvent[viser.MeshHandle]) -> None:
            if event.phase == "start" or "shear" not in self._grabs:
                self._grabs["shear"] = np.array(event.start_position)
                self._grabs["shear from"] = np.array(self._session.press.sideways_mm)
            eye, grab = np.array(event.client.camera.position), self._grabs["shear"]
            at = plane_cut(eye, np.array(event.end_position), 2, float(grab[2]))
            x, y = (self._grabs["shear from"] + (at - grab)[:2]).tolist()
            self._later("sideways", lambda: self._session.shear(x_mm=x, y_mm=y))

        body.on_drag("left")(moved)
        body.on_drag("left", modifier="shift")(pushed)
        if name == SECOND:
            return frame
        body.on_drag("left", modifier="cmd/ctrl")(turned)
        body.on_drag("left", modifier="cmd/ctrl+shift")(sheared)
        return frame

    @property
    def _plan(self) -> Plan:
        return cavity_of(self._session.design).plan

    def _listen_to_clicks(self) -> None:
        @self._scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            place = struck_place(self._plan, np.array(event.ray_origin), np.array(event.ray_direction))
            if place is not None:
                x, y = place
                self._later(FIRST, lambda: self._session.move_tip(x_mm=x, y_mm=y))

    def draw_rays(self, rays: Rays | None, *, is_dark: bool) -> None:
        """Draw sample paths of light, one colour per kind; if `rays` is None, remove them."""
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
        """Store the printable mold of the design with this digest."""
        self._mold = (digest, mesh)

    def draw_mold(self, design: SensorDesign, shown: str) -> None:
        """Draw the mold as a whole or cut open, or remove it; until its mesh is finished, draw only its outline.

        Parameters
        ----------
        shown : "hidden", "cut" or "whole"
        """
        for name in ("/mold/solid", "/mold/outline"):
            self._scene.remove_by_name(name)
        if shown == "hidden":
            return
        if self._mold is None or self._mold[0] != design.digest:
            self._scene.add_line_segments(
                "/mold/outline", mold_edges(design), MOLD, thickness=1.0, thickness_units="screen"
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
        """Draw components and top of the alternatives that `optopad improve` found; they can be clicked."""
        for frame in self._ghosts:
            frame.remove()
        self._ghosts = []
        for number, ghost in enumerate(ghosts):
            frame = self._scene.add_frame(f"/ghosts/{number}", show_axes=False)
            self._ghosts.append(frame)
            cavity = cavity_of(ghost.design)
            top = self._scene.add_mesh_simple(
                f"/ghosts/{number}/top",
                *untouched_top(cavity.plan),
                color=GHOST,
                opacity=0.12,
                side="double",
                cast_shadow=False,
            )
            self._click_ghost(top, ghost)
            for part in cavity.parts:
                node = self._scene.add_box(
                    f"/ghosts/{number}/{part.name}",
                    color=GHOST,
                    opacity=0.45,
                    dimensions=(0.6, 2 * part.half_width_mm + 0.4, 2 * part.half_height_mm + 0.4),
                    position=part.position_mm,
                    wxyz=facing(part),
                )
                self._click_ghost(node, ghost)
            self._scene.add_label(
                f"/ghosts/{number}/kind",
                f"{number + 1}: {ghost.kind}",
                position=(cavity.length_mm, cavity.width_mm * (0.25 + 0.25 * number), cavity.clear_mm),
                anchor="center-left",
            )

    def _click_ghost(self, node: viser.MeshHandle | viser.BoxHandle, ghost: Ghost) -> None:
        def clicked(_event: object) -> None:
            self._later("ghost", lambda: self._session.take(ghost.design, f"taken: {ghost.kind}"))

        node.on_click(clicked)

    def draw_touch(self, touch: Touch | None) -> None:
        """Draw the sensor's touch as an ellipsoid of two standard deviations; without a touch, remove the drawing."""
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
            position=tip_apex_mm(self._plan, (x, y), depth),
            cast_shadow=False,
        )


def _key(part: PlacedPart) -> str:
    """Text with those properties of a component, other than its position, that determine how it is drawn."""
    return f"{part.kind} {part.part_id} {part.half_width_mm} {part.half_height_mm} {part.is_on_floor}"


def _rgb(colour: str) -> Colour:
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return red, green, blue
