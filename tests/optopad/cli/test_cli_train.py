"""`optopad train`: what it writes and says, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.sims.contact import indent
from optopad.sims.learning.inference.model_file import load_model
from optopad.sims.learning.learners import LEARNERS
from optopad.sims.readings.dataset import save_data
from optopad.verbs import calibrate as calibration
from tests.said import says
from tests.sims.learning.pressed_pad import grid_mm, made_up_data

PAD = "piacenza2017-pad"
MAP_OF_TWO = ["pad.nc", "--learner", "signal-map", "--design", PAD, "--touches", "2"]


@pytest.fixture(scope="module")
def data():
    made = made_up_data(grid_mm(5), sets=2)
    made.counts[:, 0, 3] = 1023.0
    return replace(made, design_digest=preset(PAD).digest)


@pytest.fixture
def folder(data, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save_data(data, tmp_path / "pad.nc")
    return tmp_path


def refused(arguments, capsys) -> str:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    return err


def test_a_model_lies_beside_the_data_and_the_lines_say_what_it_was_made_of(folder, capsys):
    assert main(["train", "pad.nc", "--learner", "kernel-ridge", "--effort", "quick"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == ("data      1350 samples, 1050 touched; 25 locations, 50 presses; train-0, train-1")
    assert says(lines[1], "1 of 64 ... untouched: E1-R4")
    assert lines[2] == "note      1 of 72 channels clip at 1023 counts: E1-R4 (100 %)"
    assert "kernel-ridge: gamma x" in lines[3]
    assert lines[4].startswith("file      pad-kernel-ridge.optomodel (")
    model = load_model(folder / "pad-kernel-ridge.optomodel")
    assert model.header.force_curve is None
    assert model.header.trained_on["is_simulated"] is False
    assert model.header.design_digest == preset(PAD).digest


@pytest.mark.slow
def test_all_learners_go_into_a_folder_with_the_designs_force(folder, capsys):
    assert (
        main(
            [
                "train",
                "pad.nc",
                "--learner",
                "all",
                "--effort",
                "quick",
                "--design",
                PAD,
                "--out",
                "m",
                "--json",
            ]
        )
        == 0
    )
    out, err = capsys.readouterr()
    assert err == ""
    found, wanted_n = json.loads(out), indent(preset(PAD), 1.0).force_n
    assert [one["learner"] for one in found["models"]] == list(LEARNERS)
    assert found["data"]["locations"] == 25
    for one in found["models"]:
        header = load_model(one["file"]).header
        assert Path(one["file"]).stat().st_size == one["bytes"]
        assert header.force_curve.at(np.array([1.0]))[0] == pytest.approx(
            wanted_n, rel=1e-6
        )  # a stored depth
    assert sorted(path.name for path in folder.rglob("*")) == sorted(
        ["pad.nc", "m", *(f"pad-{name}.optomodel" for name in LEARNERS)]
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["absent.nc"], "absent.nc: no such file"),
        (["pad.nc", "--learner", "oracle"], "--learner: 'oracle'"),
        (["pad.nc", "--learner", "signal-map"], "name it with --design"),
        (["pad.nc", "--effort", "whole"], "--effort: 'whole'"),
        (["pad.nc", "--design", "oblong-60x40"], "of design"),
        (["pad.nc", "--set", "cavity.clear_thickness_mm=9"], "--set: changes a design"),
        (["pad.nc", "--learner", "all", "--out", "one.optomodel"], "one.optomodel"),
        (["pad.nc", "--touches", "3"], "touches: 3 is refused; the models know one or two"),
        (["pad.nc", "--touches", "2"], "--touches: 2 is refused for --learner extra-trees"),
        ([*MAP_OF_TWO, "--set", "indenter.shape=cone"], "indenter.shape: cone"),
    ],
)
def test_what_cannot_be_trained_is_refused_by_name(folder, capsys, arguments, words):
    assert words in refused(["train", *arguments], capsys)
    assert [path.name for path in folder.iterdir()] == ["pad.nc"]


def test_a_design_changed_after_the_recording_is_refused_with_both_digests(folder, capsys):
    err = refused(["train", "pad.nc", "--design", PAD, "--set", "cavity.clear_thickness_mm=9"], capsys)
    assert preset(PAD).digest[:8] in err
    assert "record again" in err


def test_data_for_testing_only_are_refused(data, folder, capsys):
    tests = replace(data, sets=tuple(replace(one, role="test") for one in data.sets))
    save_data(tests, folder / "tests.nc")
    assert "no set for training" in refused(["train", "tests.nc"], capsys)


@pytest.mark.slow
def test_a_trained_model_is_evaluated_on_presses_and_its_files_are_named(folder, capsys):
    assert main(["train", "pad.nc", "--learner", "kernel-ridge", "--effort", "quick"]) == 0
    capsys.readouterr()
    command = ["evaluate", "pad.nc", "--model", "pad-kernel-ridge.optomodel", "--out", "found"]
    assert main([*command, "--json"]) == 0
    json.loads(capsys.readouterr().out)
    names = {path.name for path in (folder / "found").iterdir()}
    assert {"evaluation.json", "evaluation.html"} <= names


def test_frames_of_two_touches_are_left_out_by_models_of_one_with_the_way_out(folder, data, capsys):
    others = np.full((len(data), 1, 3), np.nan)
    others[-40:] = [26.0, 26.0, 1.0]
    press_mm = data.press_mm.copy()
    press_mm[-40:] = [6.0, 6.0, 1.0]
    more = replace(data, others_mm=others, press_mm=press_mm)
    save_data(more, folder / "two.nc")
    assert main(["train", "two.nc", "--learner", "kernel-ridge", "--effort", "quick", "--json"]) == 0
    trained = json.loads(capsys.readouterr().out)
    assert trained["data"]["samples"] == len(data) - 40
    note = (
        f"40 of {len(data)} frames have two touches and are left out ... --learner signal-map ... --touches 2"
    )
    assert says(trained["notes"][-1], note)
    assert main(["evaluate", "two.nc", "--model", "two-kernel-ridge.optomodel", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert "touches" not in found
    assert says(
        " ".join(found["notes"]), f"40 of {len(data)} frames ... kernel-ridge knows one touch ... --touches 2"
    )
    assert "40 of" in " ".join(calibrate_notes(folder / "two.nc"))
    save_data(more.only(more.has_more), folder / "only.nc")
    assert "0 of 40 samples" in refused(
        ["evaluate", "only.nc", "--model", "two-kernel-ridge.optomodel"], capsys
    )


@pytest.mark.slow
def test_simulated_data_are_called_so_in_the_model_and_in_every_result(folder, data, capsys):
    save_data(replace(data, true_press_mm=data.press_mm), folder / "drawn.nc")
    said = "the data are simulated, not recorded"
    assert main(["train", "drawn.nc", "--learner", "kernel-ridge", "--effort", "quick"]) == 0
    assert f"note      {said}" in capsys.readouterr().out.splitlines()
    model = folder / "drawn-kernel-ridge.optomodel"
    assert load_model(model).header.trained_on["is_simulated"]
    assert main(["evaluate", "drawn.nc", "--model", str(model), "--json"]) == 0
    assert said in json.loads(capsys.readouterr().out)["notes"]
    assert said in calibrate_notes(folder / "drawn.nc")
    assert said not in calibrate_notes(folder / "pad.nc")


def calibrate_notes(file: Path) -> tuple[str, ...]:
    """Notes of a calibration whose fit is left out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "calibrated", lambda *_args, **_options: None)
        patch.setattr(calibration, "report_of", lambda _found: None)
        made = calibration.fitted(
            preset(PAD), file, with_model=False, quick=True, seed=0, on_step=lambda *_: None
        )
    return made.notes


def test_too_few_presses_are_refused_and_nothing_is_written(data, folder, capsys):
    few = data.only(data.place_number < 8)
    save_data(few, folder / "few.nc")
    assert "has 8 locations, needs >= 9" in refused(["train", "few.nc"], capsys)
    assert sorted(path.name for path in folder.iterdir()) == ["few.nc", "pad.nc"]


def test_files_of_two_sensors_are_refused(data, folder, capsys):
    save_data(replace(data, design_digest="00" * 32), folder / "other.nc")
    assert "join recordings of one sensor only" in refused(["train", "pad.nc", "other.nc"], capsys)
