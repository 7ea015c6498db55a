"""Lists of presses by objects: what is read and refused, and the data set that learners take."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import xarray as xr

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.design.progress import silent
from optopad.design.recordings import kept_share
from optopad.screen.training import data_lines
from optopad.sims.held import all_pressed, held_light
from optopad.sims.held_data import APPROACH_MM, PRESS_S, TOUCHED, ListedPress, held_data, read_presses
from optopad.sims.readings.dataset import read_data
from optopad.sims.readings.signal_chain import without_noise
from tests.said import pattern, says

PAD = preset("gripper-stadium")
LIST = (
    "X (mm), Y (mm), Depth (mm), object, yaw_deg, finish, role\n"
    "10, 7, 1, cylinder;radius=3;length=6, 30, ,\n"
    "12, 7, 0.8, , , white, test\n"
    '9, 7, 0.5, "box,length=4,width=4,pose=edge", 0.785, ,train\n'
)
FRAMES = len(APPROACH_MM) + TOUCHED
TWO = "x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm,object\n"
REFUSED = (
    ("x_mm,y_mm\n9,7\n", "depth_mm ... force_n"),
    ("x_mm,y_mm,depth_mm,force_n\n9,7,1,1\n", "depth_mm ... force_n"),
    ("y_mm,depth_mm\n7,1\n", "x_mm"),
    ("x_mm,y_mm,depth_mm,radus\n9,7,1,2\n", "radus ... radius"),
    ("x_mm,y_mm,depth_mm,radius,radius_mm\n9,7,1,2,2\n", "radius_mm"),
    ("x_mm,y_mm,depth_mm\n9,7,1\n9,seven,1\n", "row 3 ... y_mm ... seven"),
    ("x_mm,y_mm,depth_mm\n9,7,-1\n", "row 2 ... depth_mm ... -1 ... 0 or more"),
    ("x_mm,y_mm,force_n\n9,7,0\n", "row 2 ... force_n ... above 0"),
    ("x_mm,y_mm,depth_mm\n9,7,1\n", "row 2 ... object ... --object"),
    ("x_mm,y_mm,depth_mm,object\n9,7,1,balll\n", "row 2 ... balll ... sphere"),
    ("x_mm,y_mm,depth_mm,object\n9,7,1,sphere,radius=5\n", "row 2 ... 5 values ... 4 columns"),
    ("x_mm,y_mm,depth_mm,object,radius\n9,7,1,sphere,-2\n", "row 2 ... radius ... -2 ... 0.1 mm"),
    ("x_mm,y_mm,depth_mm,object,pose\n9,7,1,sphere,edge\n", "row 2 ... pose ... sphere"),
    ("x_mm,y_mm,depth_mm,object,yaw\n9,7,1,sphere,north\n", "row 2 ... yaw ... north ... deg"),
    ("x_mm,y_mm,depth_mm,object\n9,7,1,sphere;x=3\n", "row 2 ... x=3"),
    ("x_mm,y_mm,depth_mm,object,role\n9,7,1,sphere,learn\n", "row 2 ... role ... learn ... train or test"),
    ("x_mm;y_mm;depth_mm\n9;7;1\n", "semicolons"),
    (f"{TWO}9,7,1,,,,sphere\n9,7,1,14,7,,sphere\n", "row 3 ... x2_mm, y2_mm without depth2_mm"),
    (f"{TWO}9,7,1,12,7,1,sphere;radius=2\n", "row 2 ... overlap ... 3.00 mm apart ... two radii, 4 mm"),
    (f"{TWO}9,7,1,18,7,1,cylinder\n", "row 2 ... x2_mm ... cylinder ... sphere"),
    (f"{TWO}9,7,1,18,7,-1,sphere\n", "row 2 ... depth2_mm ... -1 ... 0 or more"),
    (f"{TWO}9,7,1,18,seven,1,sphere\n", "row 2 ... y2_mm ... seven"),
    (
        TWO.replace("depth", "force", 1).replace("force_mm", "force_n") + "9,7,1,18,7,1,sphere\n",
        "row 2 ... force_n ... depth_mm",
    ),
    ("x_mm,y_mm,depth_mm,x2_mm,y2_mm,depth2_mm,x3_mm\n9,7,1,18,7,1,24\n", "x3_mm ... one touch or two"),
)
"""Lists, and what the refusal names."""


def listed(text: str, held: str | None = None) -> tuple[ListedPress, ...]:
    with TemporaryDirectory() as folder:
        (file := Path(folder) / "presses.csv").write_text(text)
        return read_presses(file, None if held is None else held_of(held))


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        listed(text)
    return str(caught.value).partition("/presses.csv: ")[2]


@pytest.mark.parametrize(("text", "said"), REFUSED)
def test_a_bad_list_is_refused_with_row_and_column(text: str, said: str) -> None:
    assert says(refusal(text), said), refusal(text)


def test_cells_change_the_objects_of_a_list() -> None:
    found = [one.asked.held[0] for one in listed(LIST, "sphere,radius=2,yaw=10")]
    assert found[0] == held_of("cylinder,radius=3,length=6,yaw=30")
    assert found[1] == held_of("sphere,radius=2,yaw=10,finish=white")
    assert found[2] == held_of("box,length=4,width=4,pose=edge,yaw=0.785")
    (one,) = listed("x_mm,y_mm,force_n,radius_mm\n9,7,2,0.5cm\n", "cylinder,edge=0.2")
    assert one.asked.held == (held_of("cylinder,edge=0.2,radius=5"),)
    assert (one.asked.depth_mm, one.asked.force_n, one.role) == (None, 2.0, "train")


def test_a_turned_mesh_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    trimesh.creation.box((4.0, 4.0, 4.0)).export(tmp_path / "part.stl")
    rows = "".join(f"9,7,1,mesh;file=part.stl;units=mm,{yaw}\n" for yaw in (0, 30, 60))
    (file := tmp_path / "presses.csv").write_text("x_mm,y_mm,depth_mm,object,yaw\n" + rows)
    read = trimesh.load_mesh
    calls: list[object] = []
    monkeypatch.setattr(
        trimesh, "load_mesh", lambda *args, **kinds: (calls.append(1), read(*args, **kinds))[1]
    )
    found = [one.asked.held[0] for one in read_presses(file)]
    assert [one.yaw for one in found] == [0.0, 30.0, 60.0]
    assert len(calls) == 1


@pytest.mark.slow
def test_the_data_set_of_a_list(tmp_path: Path) -> None:
    """Without noise, counts are gain times the light of the same presses; learners find each sample's press."""
    presses, design = listed(LIST, "sphere,radius=2"), without_noise(PAD)
    made = held_data(design, presses, tmp_path / "data.nc", on_step=silent)
    assert [one["presses"] for one in made["sets"]] == [2, 2, 1, 1]
    assert made["objects"][0].startswith("a cylinder of radius 3 mm")
    assert "yaw=45" in made["notes"][0]
    assert "3 presses by 3 different objects, 0.50 to 1.00 mm" in data_lines(made)[0]
    data = read_data(tmp_path / "data.nc", design)
    assert len(data) == made["samples"] == 6 * FRAMES
    assert [len(data.role(role)) for role in ("train", "test")] == [4 * FRAMES, 2 * FRAMES]
    np.testing.assert_array_equal(data.press_mm[:FRAMES, 2], [*APPROACH_MM, *[1.0] * TOUCHED])
    draft, asked = Draft.of(design), [one.asked for one in presses]
    tops = all_pressed(draft, asked)
    for number, (top, one) in enumerate(zip(tops, asked, strict=True)):
        light = held_light(draft, [top], reflectance=one.reflectance)
        rows = (data.place_number == number) & (data.press_mm[:, 2] > 0.0)
        assert rows.sum() == 2 * TOUCHED
        signals = data.signals()[rows]
        np.testing.assert_allclose(
            signals, np.broadcast_to(light.readout.counts(light.flux), signals.shape), rtol=1e-5
        )
        np.testing.assert_array_equal(data.press_mm[rows, :2], np.broadcast_to(one.at_mm, (2 * TOUCHED, 2)))
    kept = xr.load_dataset(tmp_path / "data.nc", engine="h5netcdf")
    assert held_of(str(kept["object"].values[0])) == held_of(
        "cylinder,radius=3,length=6,yaw=30,pitch=0,roll=0"
    )
    np.testing.assert_allclose(kept["force_n"], [one.force_n for one in tops])
    keeps = design.with_(**{"noise.release_residue": 0.1, "noise.release_decay_s": PRESS_S})
    held_data(keeps, presses, tmp_path / "memory.nc", on_step=silent)
    after = read_data(tmp_path / "memory.nc", keeps)
    first, second, third = (
        after.only((after.set_number == 0) & (after.place_number == k)) for k in (0, 1, 2)
    )
    assert len(second) == 0  # of the other role
    whole = first.signals()[-1] - first.signals()[0]
    since_s = third.time_s[0] - PRESS_S
    wanted = kept_share(since_s, residue=0.1, decay_s=PRESS_S) * whole
    np.testing.assert_allclose(third.signals()[0] - first.signals()[0], wanted, atol=1e-3)


def test_a_second_touch_is_in_the_light_and_in_the_labels(tmp_path: Path) -> None:
    rows = "10,7,0.8,18,7,0.4,\n14,7,0.6,,,,\n"
    presses, design = listed(TWO + rows, "sphere,radius=2"), without_noise(PAD)
    made = held_data(design, presses, tmp_path / "data.nc", on_step=silent)
    assert made["two_touches"] == 1
    assert "2 presses (1 of two touches) by a sphere of radius 2 mm" in data_lines(made)[0]
    data = read_data(tmp_path / "data.nc", design)
    both = data.only((data.place_number == 0) & (data.set_number == 0))
    np.testing.assert_array_equal(both.touch_count, [*[0] * len(APPROACH_MM), *[2] * TOUCHED])
    np.testing.assert_array_equal(both.press_mm[-1], [10.0, 7.0, 0.8])
    np.testing.assert_array_equal(both.others_mm[-1], [[18.0, 7.0, 0.4]])
    np.testing.assert_array_equal(both.others_mm[:4, 0, 2], APPROACH_MM)
    assert np.isnan(data.only(data.place_number == 1).others_mm).all()
    draft, asked = Draft.of(design), [one.asked for one in presses]
    light = held_light(draft, all_pressed(draft, asked[:1]))
    np.testing.assert_allclose(both.signals()[-1], light.readout.counts(light.flux)[0], rtol=1e-5)
    alone = listed("x_mm,y_mm,depth_mm\n10,7,0.8\n18,7,0.4\n", "sphere,radius=2")
    apart = held_light(draft, all_pressed(draft, [one.asked for one in alone]))
    product = apart.flux[0] * apart.flux[1] / apart.untouched
    first, second = np.linalg.norm(light.flux[0] - apart.flux, axis=(1, 2))
    assert np.linalg.norm(light.flux[0] - product) < 0.2 * min(first, second)


@pytest.mark.slow
def test_noise_is_of_the_seed_and_the_stage_reports_its_errors(tmp_path: Path) -> None:
    design = PAD.with_(**{"noise.zero_offset_set_mm": 0.05, "noise.position_error_mm": 0.1})
    presses = listed(LIST, "sphere,radius=2")
    made = []
    for number, seed in enumerate((1, 1, 2)):
        held_data(design, presses, file := tmp_path / f"{number}.nc", seed=seed, on_step=silent)
        made.append(read_data(file))
    first, again, other = made
    np.testing.assert_array_equal(first.counts, again.counts)
    assert (first.counts != other.counts).any()
    np.testing.assert_array_equal(first.true_press_mm, other.true_press_mm)
    assert (first.press_mm != first.true_press_mm).all()
    assert first.signals().std(axis=0).max() > 0.0


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("30,7,1", "row 3 ... workspace"),
        ("10,7,4", "row 3 ... 4 mm ... deeper"),
    ],
)
def test_a_press_outside_the_models_is_refused_before_any_light(tmp_path: Path, row: str, said: str) -> None:
    presses = listed(f"x_mm,y_mm,depth_mm\n10,7,1\n{row}\n", "sphere,radius=2")
    stages: list[str] = []
    with pytest.raises(ModelScopeError, match=pattern(said)):
        held_data(PAD, presses, tmp_path / "data.nc", on_step=lambda stage, _: stages.append(stage))
    assert "light" not in stages
    assert list(tmp_path.iterdir()) == []


def test_loose_walls_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelScopeError, match="wall_unbonded_share"):
        held_data(PAD.with_(**{"noise.wall_unbonded_share": 0.5}), (), tmp_path / "data.nc", on_step=silent)
