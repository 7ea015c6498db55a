import numpy as np
import pytest

import optopad
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.held_object import held_of
from optopad.sims.contact.held.bottoms import bottom_mm
from optopad.sims.robot.fast_light import draft_nodes
from optopad.sims.robot.poses import posed
from optopad.sims.robot.shapes import Shape, hull_of, overlap_mm

UP = np.array([[0.0, 0.0, 1.0]])
SIZES = {
    "sphere": [3.0, 0.0, 0.0],
    "ellipsoid": [3.0, 2.0, 1.5],
    "cylinder": [2.0, 3.0, 0.0],
    "capsule": [1.5, 2.5, 0.0],
    "box": [2.0, 3.0, 1.0],
}


def _is_inside(kind, size, points):
    a, b, c = size
    x, y, z = points.T
    if kind == "sphere":
        return x * x + y * y + z * z <= a * a
    if kind == "ellipsoid":
        return (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 <= 1.0
    if kind == "cylinder":
        return (x * x + y * y <= a * a) & (np.abs(z) <= b)
    if kind == "capsule":
        return x * x + y * y + np.maximum(np.abs(z) - b, 0.0) ** 2 <= a * a
    return (np.abs(points) <= size).all(axis=1)


@pytest.mark.parametrize("kind", SIZES)
def test_a_line_enters_where_the_points_of_the_line_begin_to_be_inside(kind):
    rng = np.random.default_rng(0)
    size = np.array(SIZES[kind])
    shape = Shape(kind=kind, size_mm=size)
    start = rng.uniform(-4.0, 4.0, (200, 3))
    way = rng.standard_normal((200, 3))
    way[:6] = [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0.6, 0.0, 0.8]]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    found = shape.entry_mm(start.T, way.T)
    along = np.linspace(-12.0, 12.0, 4801)
    inside = np.array(
        [_is_inside(kind, size, one + along[:, None] * w) for one, w in zip(start, way, strict=True)]
    )
    first = np.where(inside.any(axis=1), along[inside.argmax(axis=1)], np.inf)
    hit = np.isfinite(found)
    np.testing.assert_allclose(found[hit & np.isfinite(first)], first[hit & np.isfinite(first)], atol=0.0051)
    grazes = hit != np.isfinite(first)
    assert grazes.sum() <= 2  # a line may leave between two samples
    assert hit.sum() > 20


def test_the_hull_of_a_boxs_corners_is_the_box():
    half = np.array([2.0, 3.0, 1.0])
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T * half
    rng = np.random.default_rng(1)
    start, way = rng.uniform(-4.0, 4.0, (100, 3)), rng.standard_normal((100, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    box, hull = Shape(kind="box", size_mm=half), hull_of(corners)
    assert len(hull.planes) == 6
    np.testing.assert_allclose(hull.entry_mm(start.T, way.T), box.entry_mm(start.T, way.T), atol=1e-9)


def test_what_encloses_nothing_is_refused():
    for points in (np.zeros((3, 3)), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])):
        with pytest.raises(InputError, match="give a solid's corners"):
            hull_of(points)
    with pytest.raises(InputError, match="'cone'"):
        Shape(kind="cone", size_mm=np.zeros(3))


OBJECTS = (
    "sphere,radius=3",
    "ellipsoid,a=4,b=2,c=3,pitch=20,yaw=40",
    "cylinder,radius=3,length=9,yaw=30,pitch=5,edge=0.05",
    "cylinder,radius=2,length=9,edge=2,yaw=-20,pitch=10",
    "box,length=6,width=8,height=5,pose=edge,yaw=25,edge=0.05",
    "box,length=6,width=8,height=5,yaw=25,roll=3,edge=0.05",
    "punch,radius=3,pitch=3,roll=2,edge=0.05",
)


@pytest.mark.parametrize("text", OBJECTS)
def test_shapes_are_where_the_contact_model_has_the_objects(text):
    """But for edges, which the contact model rounds."""
    top = Draft.of(optopad.load("gripper-teensy")).plan.top
    held, at, depth = held_of(text), (15.0, 11.0), 0.5
    x, y = np.linspace(9.0, 21.0, 33), np.linspace(5.0, 17.0, 33)
    wanted = depth - bottom_mm(held, x - at[0], y - at[1])
    shape, centre, turn = posed(held, top, at, depth)
    nodes = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((33, 33), top.clear_mm)], axis=-1).reshape(
        -1, 3
    )
    found = overlap_mm(shape, centre[None], turn[None], nodes, UP)[0].reshape(33, 33)
    near = wanted > -0.5
    off = np.abs(np.maximum(found, -9.0) - np.maximum(wanted, -9.0))[near]
    assert np.median(off) < 0.02
    assert np.quantile(off, 0.9) < 0.1  # the edge of 0.05 mm moves the lowest point
    assert found.max() == pytest.approx(depth, abs=0.05)


def test_an_object_with_a_hole_is_refused():
    top = Draft.of(optopad.load("gripper-teensy")).plan.top
    with pytest.raises(InputError, match=r"torus.*no convex shape"):
        posed(held_of("torus"), top, (15.0, 11.0), 0.5)


def test_on_a_crowned_top_objects_follow_the_normal():
    top = Draft.of(optopad.load("fingertip-dome")).plan.top
    at = (13.0, 9.5)
    _, centre, _ = posed(held_of("sphere,radius=4"), top, at, 0.3)
    foot = np.array([*at, float(top.height_mm(*at))])
    np.testing.assert_allclose(centre - foot, 3.7 * top.normal(*at), atol=1e-12)


@pytest.mark.parametrize(
    "text",
    ["sphere,radius=4", "ellipsoid,a=6,b=3,c=4,pitch=25", "cylinder,radius=3,length=10,pitch=8,yaw=40"],
)
def test_depths_on_a_crown_count_from_first_touch(text):
    draft = Draft.of(optopad.load("fingertip-dome"))
    top, at = draft.plan.top, (12.0, 10.0)
    nodes = draft_nodes(draft, 0.8)
    for depth in (0.0, 0.4):
        shape, centre, turn = posed(held_of(text), top, at, depth)
        found = overlap_mm(shape, centre[None], turn[None], nodes.points_mm, nodes.normals)[0][nodes.inside]
        assert found.max() == pytest.approx(depth, abs=0.06)  # the nodes are 0.4 mm apart


def test_a_hollow_mesh_is_refused(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.annulus(r_min=3.0, r_max=6.0, height=4.0)
    mesh.export(tmp_path / "ring.stl")
    top = Draft.of(optopad.load("gripper-teensy")).plan.top
    with pytest.raises(InputError, match=r"lacks 2\d% of its convex hull"):
        posed(held_of(f"mesh,file={tmp_path / 'ring.stl'},units=mm"), top, (15.0, 11.0), 0.5)
