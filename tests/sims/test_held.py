"""Contact and light of presses by objects, joined: symmetry, sums, balance of forces, and what is refused."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError, OptopadError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.sims.contact.held.press import HeldPress
from optopad.sims.held import AskedPress, held_light, pressed, require_asked

SQUARE, MIDDLE = "piacenza2017-pad", 16.0


@cache
def draft(name: str = SQUARE) -> Draft:
    return Draft.of(preset(name))


def press(*objects: str, at: tuple[float, float] = (MIDDLE, MIDDLE), depth: float | None = 1.0) -> HeldPress:
    return pressed(draft(), AskedPress(held=tuple(map(held_of, objects)), at_mm=at, depth_mm=depth))


def changes(*presses: HeldPress) -> tuple[FloatArray, FloatArray]:
    """(press, emitter, receiver) change of the light, and its error, over untouched light."""
    light = held_light(draft(), presses, accuracy="draft")
    whole = np.where(light.untouched > 0.0, light.untouched, np.inf)
    return (light.flux - light.untouched) / whole, light.error / whole


@pytest.fixture(scope="module")
def turned() -> tuple[HeldPress, ...]:
    """A cylinder, the same turned by 90 degrees about the pad's middle, and two balls, alone and together."""
    ball, other = "sphere,radius=3,x=10,y=10", "sphere,radius=3,x=22,y=22"
    return (
        press("cylinder,radius=4,yaw=20", at=(14.0, 17.0)),
        press("cylinder,radius=4,yaw=110", at=(15.0, 14.0)),
        press(ball, at=(10.0, 10.0), depth=0.3),
        press(other, at=(22.0, 22.0), depth=0.3),
        press(ball, other, at=(10.0, 10.0), depth=0.3),
    )


@pytest.fixture(scope="module")
def light(turned) -> tuple[FloatArray, FloatArray]:
    return changes(*turned)


def image_of(parts) -> list[int]:
    """Number of the part onto which a quarter turn about the pad's middle brings each part."""
    at = np.array([part.position_mm[:2] for part in parts]) - MIDDLE
    images = np.column_stack([-at[:, 1], at[:, 0]])
    away = np.linalg.norm(images[:, None] - at, axis=2)
    assert away.min(axis=1).max() < 1e-9
    return away.argmin(axis=1).tolist()


@pytest.mark.slow
def test_a_cylinder_turned_by_a_quarter_gives_the_turned_frame(turned, light):
    change, error = light
    cavity = draft().cavity
    image = np.ix_(image_of(cavity.emitters), image_of(cavity.receivers))
    assert turned[1].force_n == pytest.approx(turned[0].force_n, rel=1e-6)
    assert np.sqrt(np.mean(change[0] ** 2)) > 0.1
    off = change[1][image] - change[0]
    both = np.hypot(error[0], error[1][image])
    assert np.sqrt(np.mean(off**2)) < 0.01
    assert np.sqrt(np.mean((off / np.maximum(both, 1e-6))[both > 1e-6] ** 2)) < 1.5


@pytest.mark.slow
def test_two_balls_far_apart_change_the_light_by_the_sum_of_both(turned, light):
    one, other, together = light[0][2:]
    assert np.abs(one).max() > 0.1
    assert np.abs(together - one - other).max() < 0.01
    forces = [ball.force_n for ball in turned[2:]]
    assert forces[2] == pytest.approx(forces[0] + forces[1], rel=0.02)


def test_force_in_is_pressure_out_and_depth_0_changes_nothing(turned):
    for one in turned:
        cell = (one.top.x_mm[1] - one.top.x_mm[0]) ** 2
        assert one.pressure_mpa.sum() * cell == pytest.approx(one.force_n, rel=1e-9)
        assert one.pressure_mpa.min() >= 0.0
    found = pressed(
        draft(), AskedPress(held=(held_of("box,pose=edge"),), at_mm=(MIDDLE, MIDDLE), force_n=2.0)
    )
    assert found.force_n == pytest.approx(2.0, rel=1e-4)
    flat = press("cylinder,radius=5", depth=0.0)
    change, _ = changes(flat)
    assert (change == 0.0).all()
    assert (flat.force_n, flat.area_mm2) == (0.0, 0.0)


def test_a_mesh_of_a_cylinder_is_the_cylinder_within_its_facets(tmp_path: Path):
    part = trimesh.creation.cylinder(radius=4.0, height=10.0, sections=128)
    part.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0.0, 1.0, 0.0)))
    part.export(tmp_path / "part.stl")
    mesh, whole = (
        press(f"mesh,file={tmp_path / 'part.stl'},units=mm"),
        press("cylinder,radius=4,length=10,edge=0.05"),
    )
    sagitta = 4.0 * (1.0 - np.cos(np.pi / 128))
    assert np.abs(mesh.top.height_mm - whole.top.height_mm).max() < 10.0 * sagitta
    assert mesh.force_n == pytest.approx(whole.force_n, rel=0.01)


def test_objects_with_depths_of_their_own_press_so_deep():
    both = press("sphere,radius=3,x=10,y=16,depth=0.3", "sphere,radius=3,x=22,y=16,depth=0.6", depth=None)
    x, y = both.top.x_mm + MIDDLE, both.top.y_mm + MIDDLE
    row = np.abs(y - 16.0).argmin()
    for place, depth in ((10.0, 0.3), (22.0, 0.6)):
        lowest = -both.top.height_mm[np.abs(x - place) < 2.0, row].min()
        assert lowest == pytest.approx(depth, abs=0.005)


def test_a_turn_on_a_dome_keeps_its_mirror_symmetry():
    """Beside the apex, on the diagonal, turns by 0 and 90 degrees are mirror images, and so are 30 and 60."""
    dome, at = draft("fingertip-dome"), (14.0, 14.0)

    def force_n(yaw: float) -> float:
        held = (held_of(f"cylinder,radius=2,length=4,yaw={yaw:g}"),)
        return pressed(dome, AskedPress(held=held, at_mm=at, depth_mm=0.4)).force_n

    assert force_n(0.0) == pytest.approx(force_n(90.0), rel=2e-3)
    assert force_n(30.0) == pytest.approx(force_n(60.0), rel=2e-3)


BAD = [
    (("sphere",), {"at_mm": (2.0, 2.0), "depth_mm": 1.0}, ModelScopeError, "outside the workspace"),
    (("sphere,x=40,y=16",), {"depth_mm": 1.0}, ModelScopeError, "outside the workspace"),
    (("sphere",), {}, InputError, "add --depth or --force"),
    (("sphere",), {"depth_mm": 1.0, "force_n": 2.0}, InputError, "does not go with --force"),
    (
        ("sphere,finish=white", "sphere,x=10,y=10,finish=black"),
        {"depth_mm": 1.0},
        InputError,
        "the same finish",
    ),
    (("cylinder,radius=5,length=100",), {"depth_mm": 1.0}, ModelScopeError, "rim"),
    (("sphere,depth=1",), {"depth_mm": 1.0}, InputError, "a depth of its own"),
    (("sphere,depth=1",), {"force_n": 1.0}, InputError, "does not go with --force"),
    (
        ("sphere,radius=1", "box,length=100,width=100,y=16"),
        {"depth_mm": 0.1},
        ModelScopeError,
        "a box .* rim",
    ),
    (("sphere",), {"depth_mm": 3.5}, ModelScopeError, "press less deep"),
    (("box",), {"depth_mm": 2.0}, ModelScopeError, "sharp edge"),
    (("sphere",), {"force_n": 500.0}, ModelScopeError, "press with less force"),
    (("box,length=14,width=4,height=4",), {"at_mm": (8.0, 16.0), "depth_mm": 0.5}, ModelScopeError, "wall"),
]


@pytest.mark.parametrize(("objects", "given", "error", "words"), BAD)
def test_a_press_outside_the_models_is_refused(objects, given, error: type[OptopadError], words: str):
    asked = AskedPress(**({"held": tuple(map(held_of, objects)), "at_mm": (MIDDLE, MIDDLE)} | given))
    with pytest.raises(error, match=words):
        pressed(draft(), asked)


def test_smooth_walls_are_refused():
    design = preset(SQUARE)
    smooth = design.model_copy(
        update={"surfaces": design.surfaces.model_copy(update={"wall_finish": "air_gap"})}
    )
    with pytest.raises(ModelScopeError, match="smooth walls"):
        require_asked(
            Draft.of(smooth), AskedPress(held=(held_of("sphere"),), at_mm=(MIDDLE, MIDDLE), depth_mm=1.0)
        )
