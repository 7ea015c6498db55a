import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from optopad.design.arrays import FloatArray
from optopad.design.held_object import held_of
from optopad.sims.contact.held.bottoms import bottom_mm, rotation

X, Y = np.linspace(-8.0, 8.0, 65), np.linspace(-7.0, 9.0, 65)
GRID = np.meshgrid(X, Y, indexing="ij")
EXACT_MM = 1e-12
"""Rounding of sums of lengths of some 10 mm."""


def bottom(text: str, x: FloatArray = X, y: FloatArray = Y) -> FloatArray:
    return bottom_mm(held_of(text), x, y)


def distance_to_box(half: list[float], points: FloatArray) -> FloatArray:
    beyond = np.maximum(np.abs(points) - half, 0.0)
    return np.linalg.norm(beyond, axis=-1)


def distance_to_cylinder(radius: float, half: float, axis: int, points: FloatArray) -> FloatArray:
    across = np.linalg.norm(np.delete(points, axis, axis=-1), axis=-1)
    return np.hypot(np.maximum(across - radius, 0.0), np.maximum(np.abs(points[..., axis]) - half, 0.0))


def distance_to_ring(radius: float, points: FloatArray) -> FloatArray:
    return np.hypot(np.hypot(points[..., 0], points[..., 1]) - radius, points[..., 2])


Inside = Callable[[FloatArray], FloatArray]
POSE = (20.0, -35.0, 50.0)
"""Roll, pitch and yaw [deg]."""
FORMS: dict[str, Inside] = {
    "sphere,radius=5": lambda p: np.linalg.norm(p, axis=-1) - 5.0,
    "ellipsoid,a=6,b=4,c=2": lambda p: np.linalg.norm(p / [6.0, 4.0, 2.0], axis=-1) - 1.0,
    "cylinder,radius=3,length=8,edge=1": lambda p: distance_to_cylinder(2.0, 3.0, 0, p) - 1.0,
    "box,length=8,width=6,height=4,edge=0.5": lambda p: distance_to_box([3.5, 2.5, 1.5], p) - 0.5,
    "punch,radius=2.5,edge=0.5": (
        lambda p: distance_to_cylinder(2.0, 49.5, 2, p - np.array([0.0, 0.0, 50.0])) - 0.5
    ),
    "torus,radius=5,tube=1.5": lambda p: distance_to_ring(5.0, p) - 1.5,
}


@pytest.mark.parametrize("text", FORMS)
def test_each_kind_is_met_where_a_line_searched_step_by_step_enters_it(text: str) -> None:
    roll, pitch, yaw = POSE
    turn = Rotation.from_euler("xyz", POSE, degrees=True)  # about fixed axes, x first
    x, y = np.linspace(-7.3, 7.1, 12), np.linspace(-6.9, 7.2, 12)
    found = bottom(f"{text},roll={roll},pitch={pitch},yaw={yaw}", x, y)
    z = np.linspace(-9.0, 9.0, 1801)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    is_in = FORMS[text](points @ turn.as_matrix()) < 0.0
    entered = np.where(is_in.any(axis=-1), z[is_in.argmax(axis=-1)], np.inf)
    both = np.isfinite(entered) & np.isfinite(found)
    assert both.sum() > 5
    step = z[1] - z[0]
    assert (np.isfinite(found) | ~np.isfinite(entered)).all()  # the search misses what a line only grazes
    assert (np.isfinite(entered) ^ np.isfinite(found)).sum() <= 2
    lowest = np.median(entered[both] - found[both])
    on_surface = np.stack(np.broadcast_arrays(x[:, None], y[None, :], found + lowest), axis=-1)[both]
    assert np.ptp(entered[both] - found[both]) <= step
    assert np.abs(FORMS[text](on_surface @ turn.as_matrix())).max() < step


def test_a_sphere_and_an_ellipsoid_have_their_closed_forms_and_touch_at_zero() -> None:
    x, y = GRID
    under = x**2 + y**2 <= 25.0
    expected = 5.0 - np.sqrt(np.maximum(25.0 - x**2 - y**2, 0.0))
    found = bottom("sphere,radius=5")
    assert np.abs(found - expected)[under].max() < EXACT_MM
    assert np.isinf(found[~under]).all()
    turned = bottom("ellipsoid,a=6,b=4,c=3,yaw=90")
    inside = (x / 4.0) ** 2 + (y / 6.0) ** 2
    assert np.abs(turned - 3.0 * (1.0 - np.sqrt(np.maximum(1.0 - inside, 0.0))))[inside <= 1].max() < EXACT_MM


def test_a_turned_cylinder_is_a_circle_across_its_axis_and_a_pitched_one_is_steeper() -> None:
    x, y = GRID
    across = y * math.cos(math.pi / 6) - x * math.sin(math.pi / 6)
    found = bottom("cylinder,radius=5,length=100,yaw=30")
    under = np.abs(across) < 4.9  # a steeper flank turns a gap into a larger error along z
    assert np.abs(found - 5.0 + np.sqrt(np.maximum(25.0 - across**2, 0.0)))[under].max() < EXACT_MM
    assert np.isinf(found[np.abs(across) > 5.0]).all()
    pitch = math.radians(10.0)
    pitched = bottom("cylinder,radius=5,length=100,pitch=10")
    along = -x * math.tan(pitch) - np.sqrt(np.maximum(25.0 - y**2, 0.0)) / math.cos(pitch)
    lowest = (
        -(50.0 - 0.3) * math.sin(pitch) - (5.0 - 0.3) * math.cos(pitch) - 0.3
    )  # its end at +x, off the grid
    assert np.abs(pitched - along + lowest)[np.abs(y) < 4.9].max() < 10 * EXACT_MM


def test_an_edge_and_a_corner_are_straight_below_the_centre_with_the_flanks_of_their_box() -> None:
    line = bottom("box,length=30,width=6,height=12,edge=0.3,pose=edge", np.array([-9.0, 0.0, 9.0]), Y)
    flanks = np.diff(line[0, 24:33]) / np.diff(Y[24:33])
    assert line[:, 28] == pytest.approx(0.0, abs=EXACT_MM)  # at y = 0, all along x
    assert Y[28] == 0.0
    tilt = math.atan2(3.0 - 0.3, 6.0 - 0.3)
    assert flanks[0] == pytest.approx(-1.0 / math.tan(tilt), rel=1e-9)
    assert flanks[7] == pytest.approx(math.tan(tilt), rel=1e-9)
    corner = bottom("box,length=30,width=6,height=12,pose=corner,yaw=17")
    assert corner[32, 28] == pytest.approx(0.0, abs=EXACT_MM)
    assert corner.min() == corner[32, 28]


@pytest.mark.parametrize(
    ("text", "lowest_at_mm"),
    [
        ("box,pose=edge,edge=0.4", 0.0),
        ("punch,radius=2.5,edge=0.4,roll=-20", 2.1 * math.cos(math.pi / 9) + 0.4 * math.sin(math.pi / 9)),
    ],
)
def test_an_edge_is_curved_with_its_radius(text: str, lowest_at_mm: float) -> None:
    step = 1e-3
    heights = bottom(text, np.zeros(1), lowest_at_mm + np.array([-step, 0.0, step]))[0]
    assert heights[1] == pytest.approx(0.0, abs=EXACT_MM)
    curvature = (heights[0] - 2.0 * heights[1] + heights[2]) / step**2
    assert curvature == pytest.approx(1.0 / 0.4, rel=1e-5)  # the step's square over the radius's square


def test_a_flat_ring_touches_along_its_circle_and_is_open_in_the_middle() -> None:
    x, y = GRID
    beside = np.hypot(x, y) - 6.0
    under = np.abs(beside) < 1.5
    found = bottom("torus,radius=6,tube=1.5")
    assert np.abs(found - 1.5 + np.sqrt(np.maximum(2.25 - beside**2, 0.0)))[under].max() < EXACT_MM
    assert np.isinf(found[np.abs(beside) > 1.5 + EXACT_MM]).all()


def test_a_face_is_flat_to_its_edge_and_nothing_is_beside_it() -> None:
    x, y = GRID
    found = bottom("box,length=10,width=8,height=20,edge=0.5")
    assert np.abs(found[(np.abs(x) <= 4.5) & (np.abs(y) <= 3.5)]).max() < EXACT_MM
    assert np.isinf(found[(np.abs(x) > 5.0) | (np.abs(y) > 4.0)]).all()


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("meshes")
    trimesh.creation.cylinder(radius=3.0, height=10.0, sections=64).export(folder / "cylinder.stl")
    trimesh.creation.box((10.0, 8.0, 6.0)).export(folder / "box.ply")
    return folder


def test_a_mesh_of_a_cylinder_is_the_cylinder_within_its_facets(meshes: Path) -> None:
    found = bottom(f"mesh,file={meshes / 'cylinder.stl'},units=mm,pitch=90,yaw=25")
    expected = bottom("cylinder,radius=3,length=10,edge=0.05,yaw=25")
    x, y = GRID
    across = y * math.cos(math.radians(25.0)) - x * math.sin(math.radians(25.0))
    along = y * math.sin(math.radians(25.0)) + x * math.cos(math.radians(25.0))
    inner = (np.abs(across) < 2.0) & (np.abs(along) < 4.9)
    sagitta = 3.0 * (1.0 - math.cos(math.pi / 64))
    steepest = 1.0 / math.cos(math.asin(2.0 / 3.0))  # a facet's gap is measured along z
    assert np.abs(found[inner] - expected[inner]).max() < steepest * sagitta
    assert np.isinf(found[(np.abs(across) > 3.0) | (np.abs(along) > 5.0)]).all()


def test_a_mesh_of_a_box_is_exact_at_every_node_of_its_face(meshes: Path) -> None:
    text = f"mesh,file={meshes / 'box.ply'},units=mm"
    x, y = GRID
    is_face = (np.abs(x) <= 5.0) & (np.abs(y) <= 4.0)
    assert (bottom(text)[is_face] == 0.0).all()
    assert np.isinf(bottom(text)[~is_face]).all()
    tilted = bottom(f"{text},pitch=-5", np.linspace(-4.0, 4.0, 9), np.zeros(1))[:, 0]
    slope = math.tan(math.radians(5.0))
    end = -5.0 * math.cos(math.radians(5.0)) + 3.0 * math.sin(math.radians(5.0))  # the lowest corner is at -x
    assert tilted == pytest.approx(slope * (np.linspace(-4.0, 4.0, 9) - end), abs=EXACT_MM)


def test_roll_comes_first_and_yaw_last_about_fixed_axes() -> None:
    turn = rotation(held_of("sphere,roll=90,pitch=0,yaw=90"))
    assert turn @ [0.0, 1.0, 0.0] == pytest.approx([0.0, 0.0, 1.0], abs=EXACT_MM)  # y to z, and z stays
    assert turn @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0], abs=EXACT_MM)
    assert (rotation(held_of("box,pitch=30")) @ [1.0, 0.0, 0.0])[2] == pytest.approx(-0.5)
