from pathlib import Path

import numpy as np
import pytest
import trimesh

from optopad.design.errors import DesignError, InputError, OptopadError
from optopad.design.fields.packaged import data_quantities
from optopad.design.held_object import KINDS, Box, Cylinder, Facets, Mesh, Punch, Torus, held_of, read_held

REFUSED = [
    ("cilinder", "'cilinder' is no kind of object; did you mean cylinder? Kinds: sphere, ellipsoid,"),
    ("cylinder,radios=5", "radios is no key of a cylinder; did you mean radius? Keys: edge, radius, length, x, y,"),
    ("sphere,edge=1", "edge is no key of a sphere"),
    ("cylinder,pose=edge", "pose is no key of a cylinder"),
    ("cylinder,radius", "'radius' is refused: write key=value, as cylinder,radius=5,yaw=30"),
    ("cylinder,radius=5,radius=6", "radius is given twice; keep one"),
    ("cylinder,radius=big", "radius=big is refused: must be a number in mm, as radius=5, or with a unit: mm, um,"),
    ("cylinder,radius=5deg", "radius=5deg is refused: must be a number in mm"),
    ("cylinder,yaw=5mm", "yaw=5mm is refused: must be a number in deg"),
    ("cylinder,radius=nan", "radius=nan is refused: must be a number in mm"),
    ("cylinder,radius=1e999", "radius=1e999 is refused: must be a number in mm"),
    ("cylinder,radius=-5", "radius=-5 is refused: must be at least 0.1 mm"),
    ("cylinder,depth=-1", "depth=-1 is refused: must be at least 0 mm"),
    ("cylinder,yaw=400", "yaw=400 is refused: must be at most 360 deg"),
    ("box,edge=0", "edge=0 is refused: must be at least 0.05 mm"),
    ("box,height=1,edge=0.6", "edge=0.6 is refused: must be at most 0.5 mm, or the object has no room for it"),
    ("torus,radius=2,tube=3", "tube=3 is refused: must be below radius = 2 mm, or the ring has no hole"),
    ("box,pose=egde", "pose=egde is refused: must be 'face', 'edge' or 'corner'; did you mean edge?"),
    ("box,finish=bare metal", "finish=bare metal is refused: must be 'black', 'grey', 'white' or 'metal'; did you"),
    ("mesh", "file is missing; write mesh,file=part.stl,units=mm"),
    ("mesh,file=none.stl,units=mm", "none.stl: no such file"),
    ("mesh,file=part.step,units=mm", "part.step: this kind of file is not read; needs a mesh as STL"),
    ("mesh,file=text.stl,units=mm", "text.stl: "),
    ("mesh,file=part.stl", "does not state its units; add units=mm, cm, m or inch (it measures 20 x 10 x 8 of them)"),
    ("mesh,file=part.stl,units=feet", "units=feet is refused: must be 'mm', 'cm', 'm' or 'inch'"),
    ("mesh,file=open.stl,units=mm", "open.stl: is not watertight: some edges do not join two triangles; close its"),
    ("mesh,file=metres.stl,units=mm", "would be 0.02 mm long, and must be 1 to 2000 mm; if the file is in another "
     "unit, write units=m"),
    ("mesh,file=part.stl,units=m", "would be 20000 mm long, and must be 1 to 2000 mm; if the file is in another unit, "
     "write units=mm or units=cm or units=inch"),
]  # fmt: skip


def refusal(text: str) -> str:
    with pytest.raises(OptopadError) as refused:
        held_of(text)
    return str(refused.value)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("held")
    part = trimesh.creation.box((20.0, 10.0, 8.0))
    part.apply_translation((100.0, 0.0, 4.0))
    part.export(folder / "part.stl")
    part.copy().apply_scale(1e-3).export(folder / "metres.stl")
    trimesh.Trimesh(part.vertices, part.faces[1:], process=False).export(folder / "open.stl")
    (folder / "text.stl").write_text("no mesh at all\n")
    (folder / "part.step").write_text("ISO-10303-21;\n")
    return folder


@pytest.mark.parametrize(("text", "words"), REFUSED, ids=[text for text, _ in REFUSED])
def test_a_bad_object_is_refused_with_the_way_out(
    text: str, words: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert words in refusal(text)


def test_every_kind_but_a_mesh_has_usual_sizes_and_words() -> None:
    said = {kind: held_of(kind).words for kind in KINDS if kind != "mesh"}
    assert said == {
        "sphere": "a sphere of radius 3 mm",
        "ellipsoid": "an ellipsoid with half axes of 6, 4 and 3 mm",
        "cylinder": "a cylinder of radius 5 mm, 10 mm long",
        "box": "a box of 8 x 8 x 8 mm",
        "punch": "a flat punch of radius 2.5 mm, its edge rounded by 0.3 mm",
        "torus": "a torus of radius 4 mm, its tube of radius 1.25 mm",
    }
    assert held_of("cylinder,yaw=30,finish=metal").words == (
        "a cylinder of radius 5 mm, 10 mm long, turned by 30 deg, of bare metal"
    )
    assert held_of("box,pose=edge,pitch=2,finish=white").words == (
        "a box of 8 x 8 x 8 mm, an edge down, pitched by 2 deg, white"
    )


def test_numbers_may_have_units() -> None:
    held = held_of(
        " cylinder, radius = 0.5cm, length=1inch, yaw=-.5rad, pitch=5°, x=16, y=1.6e1 mm, depth=1500um"
    )
    assert isinstance(held, Cylinder)
    assert (held.radius, held.length, held.pitch, held.x, held.y, held.depth) == (
        5.0,
        25.4,
        5.0,
        16.0,
        16.0,
        1.5,
    )
    assert held.yaw == pytest.approx(np.degrees(-0.5))


def test_an_edge_is_rounded_by_0_3_mm_or_as_much_as_fits() -> None:
    found = [held_of(text) for text in ("box", "cylinder,radius=0.2", "punch,edge=1")]
    assert [held.edge_mm for held in found if isinstance(held, Box | Cylinder | Punch)] == [0.3, 0.2, 1.0]


@pytest.mark.parametrize(
    ("angle", "meant"),
    [("0.7854", "45"), ("1.5708", "90"), ("-1.57", "-90"), ("3.14159", "180"), ("0.2618", "15")],
)
def test_an_angle_that_looks_like_radians_is_taken_as_degrees_with_a_hint(angle: str, meant: str) -> None:
    held = held_of(f"cylinder,yaw={angle}")
    assert held.yaw == float(angle)
    assert held.notes == (
        f"yaw={float(angle):g} is taken as degrees; if it is in radians, write yaw={meant}",
    )


def test_usual_angles_have_no_hint() -> None:
    for angle in ("0", "0.5", "1", "1.5", "2", "3", "30", "45", "0.26rad"):
        assert held_of(f"cylinder,yaw={angle},roll={angle}").notes == ()


def test_a_finish_is_a_reflectance_with_a_band_and_left_out_it_is_the_designs() -> None:
    assert held_of("sphere").reflectance is None
    order = []
    for finish in ("black", "grey", "metal", "white"):
        found = held_of(f"sphere,finish={finish}").reflectance
        assert found is not None
        assert found.low is not None
        assert found.high is not None
        assert 0.0 < found.low < found.value < found.high < 1.0
        order.append(found.value)
    assert order == sorted(order)


def test_friction_has_a_band_whose_dry_one_comes_from_measurements() -> None:
    states = data_quantities("friction.toml")
    assert set(states) == {"dry", "powdered", "wet"}
    assert states["dry"].confidence == "inferred"
    for state in states.values():
        assert state.unit == "1"
        assert state.low is not None
        assert state.high is not None
        assert 0.0 < state.low < state.value < state.high <= 3.0


def test_a_mesh_is_read_in_mm_about_the_middle_of_its_bounding_box(folder: Path) -> None:
    held = held_of(f"mesh,file={folder / 'part.stl'},units=mm")
    in_metres = held_of(f"mesh,file={folder / 'metres.stl'},units=m")
    assert isinstance(held, Mesh)
    assert isinstance(in_metres, Mesh)
    assert held.words == "a mesh part.stl of 20 x 10 x 8 mm"
    assert (held.facets.vertices_mm.min(axis=0), held.facets.vertices_mm.max(axis=0)) == (
        pytest.approx([-10.0, -5.0, -4.0]),
        pytest.approx([10.0, 5.0, 4.0]),
    )
    assert in_metres.facets.size_mm == pytest.approx(
        held.facets.size_mm, rel=1e-5
    )  # STL has 32 bits a number
    assert isinstance(held.facets, Facets)
    assert "facets" not in held.model_dump()
    assert held.notes == ()


def test_a_small_mesh_in_mm_has_a_hint_about_inches(tmp_path: Path) -> None:
    trimesh.creation.box((1.5, 1.0, 0.5)).export(tmp_path / "nut.stl")
    assert (
        "measures only 1.5 x 1 x 0.5 mm; if the file is in inch or cm, write units=inch"
        in (held_of(f"mesh,file={tmp_path / 'nut.stl'},units=mm").notes[0])
    )


def test_a_file_lists_objects_with_meshes_beside_it(folder: Path) -> None:
    file = folder / "objects.toml"
    file.write_text(
        '[[object]]\nkind = "torus"\nradius = 4\ntube = "1mm"\n'
        '[[object]]\nkind = "mesh"\nfile = "part.stl"\nunits = "mm"\n'
    )
    torus, mesh = read_held(file)
    assert torus == Torus(radius=4.0, tube=1.0)
    assert isinstance(mesh, Mesh)
    file.write_text('[object]\nkind = "box"\npose = "corner"\n')
    assert read_held(file) == (held_of("box,pose=corner"),)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no objects; write each as a table [[object]] with its kind"),
        ("[objekt]\nkind = 'box'\n", "'objekt' is no table of objects; write each as a table [[object]]"),
        ("object = 'box'\n", "has no objects"),
        ("[object]\nradius = 5\n", "object 1: '' is no kind of object; Kinds: sphere"),
        (
            "[[object]]\nkind = 'box'\n[[object]]\nkind = 'box'\nwidht = 3\n",
            "object 2: widht is no key of a box; did",
        ),
        ("[object]\nkind = 'box'\nwidth = true\n", "object 1: width=True is refused: must be a number in mm"),
        (
            "[object]\nkind = 'box'\npose = 3\n",
            "object 1: pose=3 is refused: must be 'face', 'edge' or 'corner'",
        ),
    ],
)
def test_a_bad_file_of_objects_is_refused(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "objects.toml"
    file.write_text(text)
    with pytest.raises(DesignError) as refused:
        read_held(file)
    assert words in str(refused.value)


def test_an_object_from_the_command_line_is_an_argument() -> None:
    with pytest.raises(InputError):
        held_of("cylinder,radius=-5")


@pytest.mark.parametrize(
    "text",
    [
        *(kind for kind in KINDS if kind != "mesh"),
        "cylinder,radius=1.23456789,edge=0.1,yaw=-12.5,finish=metal",
        "box,pose=corner,x=3,y=4,depth=0.5,roll=3",
    ],
)
def test_an_object_is_made_again_from_its_line(text: str) -> None:
    held = held_of(text)
    assert held_of(held.line) == held
    assert set(text.split(",")) <= set(held.line.split(","))
