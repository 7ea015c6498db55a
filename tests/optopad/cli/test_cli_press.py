"""`optopad press`: what it prints, gives as JSON and writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.fabrication.bundle import altered_files, bundle_name
from tests.said import says

STADIUM = "gripper-stadium"
CYLINDER = "cylinder,radius=2,length=5,edge=0.4,yaw=30"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_an_object_is_pressed_printed_and_pictured(folder, capsys):
    assert main(["press", STADIUM, "--object", CYLINDER, "--depth", "0.5", "--out", "out"]) == 0
    said = capsys.readouterr().out
    labels = [line.split()[0] for line in said.splitlines() if line[0] != " "]
    assert labels == ["press", "load", "contact", "signals", "most", "files"]
    bundle = folder / "out" / bundle_name(preset(STADIUM))
    assert {file.name for file in (bundle / "sims").iterdir()} == {"press-objects.svg", "press-objects.png"}
    assert altered_files(bundle) == ()
    assert main(["press", STADIUM, "--object", CYLINDER, "--depth", "0.5", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["objects"][0]["kind"] == "cylinder"
    assert document["at_mm"] == [12.0, 7.0]
    assert len(document["ratio"]) == len(document["emitters"]) == 4
    assert f"{document['force_n']:.3g} N" in said
    low, high = document["force_band_n"]
    assert low < document["force_n"] < high


def test_a_file_of_objects_and_a_force(folder, capsys):
    (folder / "two.toml").write_text(
        '[[object]]\nkind = "sphere"\nradius = 1.5\nx = 9.0\n\n[[object]]\nkind = "sphere"\nradius = 1.5\nx = 15.0\n'
    )
    assert main(["press", STADIUM, "--object", "two.toml", "--force", "1N", "--at", "12,7", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["force_n"] == pytest.approx(1.0, rel=1e-3)
    assert [one["x"] for one in document["objects"]] == [9.0, 15.0]
    assert document["depth_mm"] < 0.5


def test_an_object_is_pulled_sideways(folder, capsys):
    ball = ("--object", "sphere,radius=1.5,friction=0.5", "--force", "1N", "--pull", "0.3,0")
    assert main(["press", STADIUM, *ball, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["force_n"] == pytest.approx(1.0, rel=5e-3)
    assert document["pull_n"] == pytest.approx([0.3, 0.0], abs=2e-3)
    assert 0.0 < document["shear_mm"][0] < 0.5
    assert 0.0 < document["slip_share"] < 1.0
    assert main(["press", STADIUM, *ball[:-1], "0.6,0"]) == 2
    assert says(capsys.readouterr().err, "more than the pad holds")


def test_a_list_becomes_a_data_set(folder, capsys):
    (folder / "presses.csv").write_text(
        "x_mm,y_mm,depth_mm,shear_x_mm,object\n12,7,0.4,0.05,sphere;radius=1.5\n"
    )
    assert main(["press", STADIUM, "--list", "presses.csv", "--json"]) == 0
    assert Path(json.loads(capsys.readouterr().out)["file"]).is_file()


REFUSED = [
    (("--at", "12;7"), "write X,Y in millimetres"),
    (("--at", "12,nan"), "two finite numbers"),
    (("--force", "strong"), "write a force above 0 in newtons"),
    (("--force", "1", "--depth", "1"), "does not go with --force"),
    (("--depth", "-1"), "give 0 or more"),
    (("--object", "sphere,x=8,y=6", "--at", "12,7"), "x or y of its own"),
    (("--object", "cylinder,radius=1e9"), "radius"),
    (("--object", "sphere,friction=-0.1"), "friction=-0.1 is refused: must be at least 0"),
    (("--object", "sphere,friction=3.5"), "friction=3.5 is refused: must be at most 3"),
    (("--object", "sphere,friction=0.5mm"), "must be a number without unit"),
    (("--shear", "0.1"), "write X,Y in millimetres, as 0.3,0"),
    (("--pull", "1,inf"), "two finite numbers of newtons"),
    (("--shear", "0.1,0", "--pull", "0.1,0"), "does not go with --pull"),
    (("--shear", "20,0"), "outside the workspace"),
    (("--depth", "0", "--shear", "0.1,0"), "do not touch the pad, so nothing holds them"),
    (("--object", "none.toml"), "none.toml"),
    (("--list", "none.csv"), "none.csv"),
    (("--list", "presses.csv", "--depth", "1"), "does not go with --list"),
]


@pytest.mark.parametrize(("words", "said"), REFUSED)
def test_what_cannot_be_meant_is_refused_before_any_work(folder, capsys, words, said):
    assert main(["press", STADIUM, *words]) == 2
    assert says(capsys.readouterr().err, said)
    assert list(folder.iterdir()) == []
