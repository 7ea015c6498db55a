"""`optopad rays`: what it prints, gives as JSON and writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from optopad.cli import main
from optopad.design.preset import preset
from optopad.fabrication.bundle import altered_files, bundle_name
from optopad.verbs import rays as ray_view
from tests.said import says

PAIR = "piacenza2017-pair"
ONE = ["--emitter", "E2", "--receiver", "R2", "--count", "6"]
FOLDER = Path("outputs") / bundle_name(preset(PAIR))


@pytest.fixture(scope="module")
def kept_states():
    """Paths that a test of this file traced are not traced again."""
    kept, trace = {}, ray_view.ray_states

    def traced(design, choice, presses, **options):
        key = (design.digest, choice, tuple(presses))
        if key not in kept:
            kept[key] = trace(design, choice, presses, **options)
        return kept[key]

    return traced


@pytest.fixture
def pictured(tmp_path, monkeypatch, capsys, kept_states):
    """The verb, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ray_view, "ray_states", kept_states)

    def draw(*arguments: str) -> str:
        assert main(["rays", PAIR, *arguments]) == 0
        return capsys.readouterr().out

    return draw


@pytest.fixture
def drawn(pictured, monkeypatch):
    """The verb with empty pictures, where numbers and names are what matters."""
    monkeypatch.setattr(ray_view, "ray_sheet", lambda *_, **__: Figure(figsize=(1, 1)))
    return pictured


def test_a_pair_is_drawn_and_its_files_are_listed(pictured):
    text = pictured(*ONE, "--press", "10,10,1")
    files = [line.split()[1] for line in text.splitlines() if line.startswith("file ")]
    sims = FOLDER / "sims"
    assert files == [str(sims / name) for name in ("rays-E2-R2.svg", "rays-E2-R2.png", "rays.json")]
    assert (sims / "rays-E2-R2.png").read_bytes().startswith(b"\x89PNG")
    said = " ".join(ElementTree.parse(sims / "rays-E2-R2.svg").getroot().itertext())
    assert "light from E2 to R2" in said
    assert "E2 to R2" in said
    assert "counts of lines" in " ".join(said.split())
    assert altered_files(FOLDER) == ()


def test_json_is_one_object_and_the_data_file_holds_every_path(drawn, capsys):
    found = json.loads(drawn(*ONE, "--press", "10,10,1", "--json"))
    assert capsys.readouterr().err == ""
    untouched, pressed = found["states"]
    assert untouched["share"] == pytest.approx(1.0)
    assert sum(pressed["share_by_kind"].values()) == pytest.approx(pressed["share"])
    assert sum(pressed["flux_by_class"].values()) == pytest.approx(pressed["share"] * found["unit_flux"])
    data = json.loads((FOLDER / "sims" / "rays.json").read_text(encoding="utf-8"))
    for row, told in zip(data["states"], found["states"], strict=True):
        kinds = [path["kind"] for path in row["paths"]]
        counts = {kind: kinds.count(kind) for kind in set(kinds)} | {"lost": len(row["lost_paths"])}
        assert counts == told["paths_by_kind"]
        assert {path["receiver"] for path in row["paths"]} == {"R2"}
        assert all(path["arrived_at"] == "R2" != path["receiver"] for path in row["lost_paths"])
        assert all(path["places_mm"][0][0] == 0.0 and path["emitter"] == "E2" for path in row["paths"])
    assert {row["kind"] for row in data["kinds"]} >= {"direct", "top", "diffuse", "lost"}


def test_without_a_pair_all_light_is_drawn_with_its_losses(drawn):
    found = json.loads(drawn("--count", "5", "--press", "10,10,1", "--json"))
    assert (found["light"], found["power_of"]) == ("all", "emitted light")
    assert all(state["paths_by_kind"]["lost"] == 5 for state in found["states"])
    assert all(0.0 < state["share"] < 0.2 for state in found["states"])


def test_one_emitter_or_one_receiver_can_be_asked_for(drawn):
    assert (
        json.loads(drawn("--emitter", "E1", "--count", "4", "--press", "10,10,1", "--json"))["light"] == "E1"
    )
    found = json.loads(drawn("--receiver", "R3", "--count", "4", "--press", "10,10,1", "--json"))
    assert (found["light"], found["power_of"]) == ("R3", "untouched light")
    names = sorted(path.name for path in (FOLDER / "sims").iterdir())
    assert names == ["rays-R3.png", "rays-R3.svg", "rays.json"]  # pictures of an earlier request do not stay


def test_without_a_verdict_three_depths_are_drawn(drawn):
    found = json.loads(drawn(*ONE, "--json"))
    assert [state["press_mm"] for state in found["states"][1:]] == [[10, 10, 1], [10, 10, 2], [10, 10, 4]]


def test_a_deadband_that_a_verdict_found_is_drawn_at_both_ends(drawn):
    drawn(*ONE, "--press", "10,10,1")
    score = {"pairs": [{"pair": "E2-R2", "deadbands_mm": [[0.5, 0.9], [1.5, 3.0]]}], "map": None}
    (FOLDER / "sims" / "score.json").write_text(json.dumps(score), encoding="utf-8")
    found = json.loads(drawn(*ONE, "--json"))
    assert [state["press_mm"][2] for state in found["states"]] == [0.0, 1.5, 3.0]
    assert found["presses_are"] == "where the deadband from 1.5 to 3 mm begins and ends"


def test_a_pad_is_pressed_at_its_weakest_place(drawn):
    drawn(*ONE, "--press", "10,10,1")
    score = {"map": {"weakest_place_mm": [7, 8], "worst_place_mm": None}, "deadband_mm": {"intervals": []}}
    (FOLDER / "sims" / "score.json").write_text(json.dumps(score | {"judged_by": "pad"}), encoding="utf-8")
    found = json.loads(drawn("--count", "2", "--json"))
    assert [state["press_mm"] for state in found["states"][1:]] == [[7, 8, 1], [7, 8, 2], [7, 8, 4]]


@pytest.mark.parametrize("text", ["no json", "[]", '{"map": {"weakest_place_mm": 3}}'])
def test_a_damaged_verdict_is_named(drawn, capsys, text):
    drawn(*ONE, "--press", "10,10,1")
    (FOLDER / "sims" / "score.json").write_text(text, encoding="utf-8")
    assert main(["rays", PAIR]) == 2
    assert "run `optopad score` again" in capsys.readouterr().err


REFUSED = [
    (["--emitter", "E9"], "--emitter: 'E9' ... E1, E2, E3"),
    (["--receiver", "E1"], "--receiver: 'E1' ... R1, R2, R3"),
    (["--emitter", ""], "does not exist"),
    (["--press", "1,1,1"], "outside the workspace"),
    (["--press", "10,10"], "write X,Y,DEPTH"),
    (["--press", "10,10,nan"], "finite"),
    (["--press", "10,10,7.9"], "depth"),
    (["--count", "0"], "count"),
    (["--seed", "-1"], "seed"),
]


@pytest.mark.parametrize(
    ("arguments", "message"),
    REFUSED,
)
def test_what_cannot_be_drawn_is_refused_by_name_and_writes_nothing(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    assert main(["rays", PAIR, *arguments]) == 2
    printed = capsys.readouterr()
    assert says(printed.err, message)
    assert "Traceback" not in printed.err
    assert list(tmp_path.iterdir()) == []
