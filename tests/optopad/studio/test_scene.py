"""The scene of every preset as the page sends it to a browser: drawn without one, and looked at node by node."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from viser.transforms import SO3

from optopad.design.preset import PRESETS, SHAPED_PRESETS, WALL_PRESETS
from optopad.design.shape.cavity import cavity_of
from optopad.studio.design_file import DesignFile
from optopad.studio.moves import moved, part_named
from optopad.studio.session import Session
from optopad.studio.view.local_server import local_server
from optopad.studio.view.scene import PadScene
from optopad.studio.view.shapes import facing, tip_apex_mm


@contextmanager
def scene_of(name: str) -> Iterator[tuple[PadScene, Session, viser.ViserServer]]:
    """A scene on a preset, with a server that nobody visits."""
    session, server = Session(DesignFile(name)), local_server(0)
    try:
        scene = PadScene(server, session, later=lambda _name, do: do(), with_row=lambda: False)
        yield scene, session, server
    finally:
        server.stop()


def nodes(server: viser.ViserServer, kind: type) -> dict[str, object]:
    """Handles of what is drawn, by name, of one kind."""
    found = server.scene._handle_from_node_name
    return {name: handle for name, handle in found.items() if isinstance(handle, kind)}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_drawn_with_its_parts_turned_to_their_walls_and_its_tip_along_the_normal(
    name: str,
) -> None:
    with scene_of(name) as (scene, session, server):
        design = session.design
        cavity = cavity_of(design)
        scene.draw_design(design, (cavity.parts[0].name,), is_bad=False)
        scene.draw_untouched_top(design, is_bad=False)
        scene.draw_tip(design, session.press)
        scene.draw_mold(design, "whole")
        frames, meshes = nodes(server, viser.FrameHandle), nodes(server, viser.MeshHandle)
        for part in cavity.parts:
            frame = frames[f"/parts/{part.name}"]
            assert tuple(frame.position) == pytest.approx(part.position_mm)
            assert tuple(frame.wxyz) == pytest.approx(facing(part))
        apex = tip_apex_mm(cavity.plan, session.press.place_mm, session.press.depth_mm)
        assert np.asarray(frames["/tip"].position) == pytest.approx(apex)
        top = np.asarray(meshes["/pad/top"].vertices)
        assert top[:, 2] == pytest.approx([cavity.plan.top_mm(x, y) for x, y in top[:, :2]], abs=1e-5)
        assert ("/pad/black" in meshes) == (cavity.black_mm > 0.0)
        if cavity.black_mm > 0.0:
            assert np.ptp(np.asarray(meshes["/pad/black"].vertices), axis=0) == pytest.approx(
                [cavity.length_mm, cavity.width_mm, cavity.black_mm], rel=0.01
            )


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_a_part_that_is_moved_keeps_its_node_so_that_a_drag_goes_on(name: str) -> None:
    with scene_of(name) as (scene, session, server):
        scene.draw_design(session.design, (), is_bad=False)
        before = nodes(server, viser.FrameHandle)["/parts/E1"]
        where = {"along_mm" if part_named(session.design, "E1").angle_deg is None else "angle_deg": 4.0}
        assert session.move_part("E1", **where)
        scene.draw_design(session.design, (), is_bad=False)
        now = nodes(server, viser.FrameHandle)["/parts/E1"]
        assert now is before
        part = next(one for one in cavity_of(session.design).parts if one.name == "E1")
        assert tuple(now.position) == pytest.approx(part.position_mm)
        assert tuple(now.wxyz) == pytest.approx(facing(part))


@pytest.mark.parametrize("name", WALL_PRESETS)
def test_a_part_goes_where_the_pointer_drags_its_face(name: str) -> None:
    with scene_of(name) as (scene, session, _):
        eye = np.array([*cavity_of(session.design).plan.centre_mm, 60.0]) + 1.0
        for part in cavity_of(session.design).parts:
            x, y, _ = part.position_mm
            asked = (
                {"x_mm": x + 1.0, "y_mm": y - 0.5}
                if part.is_on_floor
                else {"along_mm": part.along_mm + 1.0}
                if part.angle_deg is None
                else {"angle_deg": part.angle_deg + 3.0}
            )
            there = part_named(session.design.with_(**moved(session.design, part.name, **asked)), part.name)
            for phase, to in (("start", part), ("update", there)):
                event = SimpleNamespace(
                    phase=phase,
                    start_position=part.position_mm,
                    end_position=eye + 0.7 * (np.array(to.position_mm) - eye),
                    client=SimpleNamespace(camera=SimpleNamespace(position=eye)),
                )
                where = scene._dragged_to(event, part)
            kept = {} if part.is_on_floor else {"height_mm": part.height_mm}
            assert where == pytest.approx(asked | kept, abs=0.06)  # a step of `moved`


@pytest.mark.parametrize("name", ["piacenza2017-pad", "gripper-stadium", "crowned-40x25"])
@pytest.mark.parametrize("text", ["cylinder,yaw=30", "box,pose=edge", "torus,pitch=20"])
def test_an_object_goes_as_deep_into_the_untouched_top_as_it_is_pressed(name: str, text: str) -> None:
    with scene_of(name) as (scene, session, server):
        assert session.hold(f"{text},depth=1")
        plan, press = cavity_of(session.design).plan, session.press
        space = cavity_of(session.design).workspace
        session.move_tip(x_mm=space.x0_mm + 0.3 * (space.x1_mm - space.x0_mm))
        scene.draw_tip(session.design, session.press)
        frame, body = nodes(server, viser.FrameHandle)["/tip"], nodes(server, viser.MeshHandle)["/tip/body"]
        turn = SO3(np.asarray(frame.wxyz)).as_matrix()
        corners = np.asarray(body.vertices) @ turn.T + np.asarray(frame.position)
        ends = corners[np.asarray(body.faces)]
        share = np.linspace(0.0, 1.0, 9)[:, None, None, None]
        points = (share * ends + (1.0 - share) * np.roll(ends, 1, axis=1)).reshape(-1, 3)
        _, axes = plan.top.press_frame(*session.press.place_mm)
        below = (plan.top.height_mm(points[:, 0], points[:, 1]) - points[:, 2]) * axes[2, 2]
        assert np.nanmax(below) == pytest.approx(press.depth_mm, abs=0.05)
        node = body
        session.turn(yaw=70.0)
        scene.draw_tip(session.design, session.press)
        assert nodes(server, viser.MeshHandle)["/tip/body"] is node  # so that a drag goes on
        session.hold("")
        scene.draw_tip(session.design, session.press)
        tip = nodes(server, viser.FrameHandle)["/tip"]
        assert np.asarray(tip.position) == pytest.approx(
            tip_apex_mm(plan, session.press.place_mm, session.press.depth_mm)
        )


@pytest.mark.parametrize("name", ["piacenza2017-pad", "crowned-40x25"])
def test_a_second_tip_is_drawn_dragged_and_taken_away(name: str) -> None:
    with scene_of(name) as (scene, session, server):
        plan = cavity_of(session.design).plan
        session.add_second(True)
        scene.draw_tip(session.design, session.press)
        frames = nodes(server, viser.FrameHandle)
        for node, (x, y, depth) in zip(("/tip", "/second-tip"), session.press.tips_mm, strict=True):
            assert np.asarray(frames[node].position) == pytest.approx(tip_apex_mm(plan, (x, y), depth))
        first, second = session.press.tips_mm
        body = nodes(server, viser.MeshHandle)["/second-tip/body"]
        eye = np.array([*plan.centre_mm, 60.0])
        apex = tip_apex_mm(plan, second[:2], second[2])
        for phase, to in (("start", apex), ("update", apex - [0.0, 0.5, 0.0])):
            event = SimpleNamespace(
                phase=phase,
                start_position=apex,
                end_position=eye + 0.7 * (to - eye),
                client=SimpleNamespace(camera=SimpleNamespace(position=eye)),
            )
            (moved,) = (one.callback for one in body._impl.drag_cb if one.modifier is None)
            asyncio.run(moved(event))
        assert session.press.tips_mm[0] == first
        assert session.press.tips_mm[1] == pytest.approx((second[0], second[1] - 0.5, second[2]), abs=0.02)
        session.add_second(False)
        scene.draw_tip(session.design, session.press)
        assert "/second-tip" not in nodes(server, viser.FrameHandle)
