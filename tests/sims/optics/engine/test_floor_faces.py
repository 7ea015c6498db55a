"""Faces with a pose, and skins, against closed forms and against faces in walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.symmetry import symmetries_of
from tests.oracle.floor_scenes import CLEAR_MM, FLUSH, floor_scene
from tests.oracle.form_scenes import block, rectangle_form
from tests.oracle.oracle_scenes import dimple

BLACK = {"wall_reflectance": 0.0, "bottom_reflectance": 0.0, "absorption_per_mm": 0.0}
SMALL = 0.05
AWAY_MM = 6.0


def small_pair(finish, reflectance):
    emitters, receivers = [(7.0, 8.0, *FLUSH, SMALL, SMALL)], [(7.0 + AWAY_MM, 8.0, *FLUSH, 0.4, 0.4)]
    scene = floor_scene(finish, reflectance, emitters=emitters, receivers=receivers, **BLACK)
    return float(trace_scene(scene, np.zeros((1, 2)), [None], accuracy="standard").flux.sum())


def from_image() -> float:
    """Light of a small Lambertian emitter on the receiver by way of a perfect mirror: cos² A / (π s²)."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    x, y = AWAY_MM + 0.4 * nodes[:, None], 0.4 * nodes[None, :]
    s2 = x**2 + y**2 + (2.0 * CLEAR_MM) ** 2
    return float((weights[:, None] * weights * (2.0 * CLEAR_MM) ** 2 / (np.pi * s2**2)).sum() * 0.16)


@pytest.mark.parametrize("reflectance", [0.3, 0.8])
def test_a_specular_skin_sends_the_light_of_the_image(reflectance):
    assert small_pair("specular", reflectance) == pytest.approx(reflectance * from_image(), rel=0.01)


def test_a_diffuse_skin_sends_the_integral_over_itself():
    x, y = np.meshgrid(
        *(np.linspace(0.0, side, count) + 0.025 for side, count in ((20.0, 401), (16.0, 321))), indexing="ij"
    )
    x, y = x[:-1, :-1], y[:-1, :-1]
    there, back = (
        CLEAR_MM**2 / ((x - at) ** 2 + (y - 8.0) ** 2 + CLEAR_MM**2) ** 2 for at in (7.0, 7.0 + AWAY_MM)
    )
    known = 0.6 * float((there * back).sum()) * 0.05**2 / np.pi**2 * 0.64
    assert small_pair("diffuse", 0.6) == pytest.approx(known, rel=0.01)


def test_level_faces_at_the_walls_foot_are_faces_in_the_walls():
    size, places = (20.0, 16.0), np.array([[10.0, 8.0], [11.0, 7.0]])
    patches = np.array([[7.0, 1.2, 0.6, 0.5]]), np.array([[9.0, 1.5, 1.0, 0.9]])
    in_walls = block(
        rectangle_form(*size), size, height_mm=CLEAR_MM, emitter_order=np.ones(1), wall_reflectance=0.2,
        emitter_wall=np.array([3]), emitter_patch=patches[0], receiver_wall=np.array([1]), receiver_patch=patches[1],
    )  # fmt: skip
    posed = floor_scene(
        emitters=[(0.0, 7.0, 1.2, 90.0, 0.0, 0.6, 0.5)], receivers=[(20.0, 9.0, 1.5, 90.0, 180.0, 1.0, 0.9)],
        wall_reflectance=0.2, size_mm=size,
    )  # fmt: skip
    tops = [None, dimple(1.5, 0.05)]
    wall, floor = (trace_scene(scene, places, tops, accuracy="score") for scene in (in_walls, posed))
    assert floor.flux[:3, 0] == pytest.approx(wall.flux[:3, 0], rel=1e-6)  # all but scattered light
    assert floor.flux[0, 1] == pytest.approx(wall.flux[0, 1], rel=1e-6)
    error = np.hypot(wall.standard_error, floor.standard_error)
    assert (np.abs(floor.flux.sum(axis=0) - wall.flux.sum(axis=0)) < 3.0 * error).all()
    assert (error < 0.05 * floor.flux.sum(axis=0)).all()


def test_symmetries_of_a_layout_on_the_floor_are_found_with_the_turn_of_its_parts():
    def square(turn_deg, half_v=0.4):
        faces = [(x, y, 0.0, 0.0, turn_deg, 0.4, half_v) for x in (4.0, 12.0) for y in (4.0, 12.0)]
        scene = floor_scene(
            emitters=faces[:1] + faces[3:], receivers=faces[1:3], size_mm=(16.0, 16.0), form=None
        )
        return len(symmetries_of(scene))

    assert square(0.0) == 4  # identity, half turn, both diagonals
    assert square(0.0, half_v=0.2) == 2  # a diagonal would turn the faces
    assert square(45.0, half_v=0.2) == 4


def test_light_is_the_same_for_a_press_and_its_image():
    scene = floor_scene("diffuse", 0.6, size_mm=(20.0, 16.0))
    halves = np.array([[8.0, 7.0], [12.0, 9.0]])
    one, other = (
        trace_scene(scene, at[None], [dimple(1.5, 0.05)], accuracy="score", seed=seed)
        for seed, at in enumerate(halves)
    )
    turned = other.flux.sum(axis=0)[0][::-1, ::-1]
    error = np.hypot(one.standard_error[0], other.standard_error[0][::-1, ::-1])
    assert (np.abs(one.flux.sum(axis=0)[0] - turned) < 4.0 * error).all()
    assert (error < 0.05 * turned.max()).all()


def test_poses_are_checked():
    scene = floor_scene()
    high = replace(scene, emitter_pose=scene.emitter_pose + np.array([0.0, 0.0, 9.0, 0.0, 0.0]))
    for wrong, word in ((high, "emitter_pose"), (replace(scene, top_finish="matt"), "top_finish")):
        with pytest.raises(InputError, match=word):
            trace_scene(wrong, np.zeros((1, 2)), [None], accuracy="draft")
