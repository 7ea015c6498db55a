import json
from dataclasses import replace

import numpy as np
import pytest

from optopad.cli import main
from optopad.design.errors import DesignError
from optopad.design.preset import preset
from optopad.design.shape.outline import rectangle
from optopad.screen.prediction import PredictedAccuracy, accuracy_lines, accuracy_of
from optopad.sims.learning.tables import JudgedPresses, published_touch
from optopad.sims.two_touch_errors import PairRow, TwoTouchErrors
from optopad.verbs.evaluate import write_accuracy
from tests.said import says

SPACE = rectangle((6.0, 6.0, 26.0, 26.0))


def found_accuracy(**changes) -> PredictedAccuracy:
    depth = np.tile([-0.4, 0.1, 1.0, 3.0], 9)
    place = np.repeat([(x, y) for x in (8.0, 16.0, 24.0) for y in (8.0, 16.0, 24.0)], 4, axis=0)
    press = np.column_stack([place, depth])
    presses = JudgedPresses(
        press_mm=press,
        said_mm=press + 0.1,
        is_found=depth > 0.0,
        place_number=np.repeat(np.arange(9), 4),
        session_number=np.zeros(36, dtype=np.int64),
    )
    one = accuracy_of("kernel-ridge", "set $x_1$ \\frac $y", False, [presses])
    return replace(PredictedAccuracy(name="made-up", digest="ab" * 32, found=(one,)), **changes)


@pytest.mark.slow
def test_a_bound_that_is_open_is_null_in_json_and_a_word_for_people(tmp_path):
    bounds = {0.1: (np.inf, np.inf), 1.0: (0.02, 0.01)}
    rows = (
        PairRow(
            from_mm=6.0, to_mm=7.5, frames=40, found=0.975, location_mm=(0.125, 0.5), depth_mm=(0.0625, 0.25)
        ),
        PairRow(from_mm=18.0, to_mm=np.inf, frames=8, found=0.0, location_mm=None, depth_mm=None),
    )
    two = TwoTouchErrors(
        learner="signal-map", radius_mm=3.0, rows=rows, single_frames=200, called=(0.005, 0.985, 0.01)
    )
    found = found_accuracy(
        bound_mm=bounds, published=published_touch(preset("piacenza2017-pad")), touches=(two,)
    )
    write_accuracy(found, SPACE, tmp_path / "new" / "folder", "prediction")
    document = json.loads((tmp_path / "new" / "folder" / "prediction.json").read_text(encoding="utf-8"))
    assert document["bound_mm"][0] == {"depth_mm": 0.1, "location": None, "depth": None}
    assert document["bound_mm"][1]["location"] == 0.02
    assert [row["second_found"] for row in document["touches"][0]["separations"]] == [0.975, 0.0]
    text = "\n".join(accuracy_lines(found))
    assert "open" in text
    assert says(
        text, "6 to 7.5 ... 2 to 2.5 ... 97.5% ... 0.125 ... 0.500 ... 0.062 ... 0.250 ... 40\n  18 and more"
    )
    assert says(text, "98.5% called one, 1.0% two, 0.5% none, of 200 frames")
    page = (tmp_path / "new" / "folder" / "prediction.html").read_text(encoding="utf-8")
    assert '<td class="number">open</td>' in page
    assert says(page, '<a href="#touches">Two touches ... <th scope="row">18 and more</th> ... 98.5%')
    assert "inf" not in json.dumps(document)


def test_a_classifier_with_false_alarms_is_a_finding_on_the_screen_the_page_and_in_json(tmp_path):
    presses = found_accuracy().found[0].presses
    always = replace(presses, is_found=np.ones(len(presses), dtype=bool))
    found = found_accuracy(found=(accuracy_of("kernel-ridge", "random-dark", False, [always]),))
    (words,) = found.findings()
    assert says(words, "100 % of ... 5 %")
    assert accuracy_lines(found)[0] == f"finding   {words}"
    write_accuracy(found, SPACE, tmp_path, "prediction")
    document = json.loads((tmp_path / "prediction.json").read_text(encoding="utf-8"))
    assert document["findings"] == [words]
    assert (document["false_alarms"], document["false_alarm_limit"]) == (1.0, 0.05)
    assert document["models"][0]["false_alarms"] == 1.0
    page = (tmp_path / "prediction.html").read_text(encoding="utf-8")
    assert 'id="touches"' not in page
    assert "random-dark are classified" in page
    assert 'class="verdict deadband"' in page


def test_a_classifier_that_misses_presses_is_a_finding_with_a_way_out():
    presses = found_accuracy().found[0].presses
    never = replace(presses, is_found=presses.is_found & (presses.press_mm[:, 2] > 1.0))
    (words,) = found_accuracy(found=(accuracy_of("kernel-ridge", "dark", False, [never]),)).findings()
    assert says(words, "100 % of ... 1 mm deep")
    assert "--learner signal-map" in words
    (own,) = found_accuracy(found=(accuracy_of("signal-map", "dark", False, [never]),)).findings()
    assert "--learner" not in own


def test_an_interrupted_evaluation_leaves_the_earlier_one_as_it_was(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    def uninked(_figure, stem):
        files = stem.with_suffix(".svg"), stem.with_suffix(".png")
        for file in files:
            file.write_text('<svg viewBox="0 0 1 1"></svg>', encoding="utf-8")
        return files

    monkeypatch.setattr("optopad.verbs.evaluate.write_plot", uninked)
    folder = tmp_path / "evaluation"
    write_accuracy(found_accuracy(), SPACE, folder, "evaluation")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    monkeypatch.setattr("optopad.verbs.evaluate.accuracy_page", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_accuracy(found_accuracy(name="other"), SPACE, folder, "evaluation")
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    with pytest.raises(KeyboardInterrupt):
        write_accuracy(found_accuracy(), SPACE, tmp_path / "first", "evaluation")
    assert list((tmp_path / "first").iterdir()) == []


def test_a_changed_pad_has_no_published_table():
    assert published_touch(preset("piacenza2017-pad").with_(**{"cavity.clear_thickness_mm": 14.0})) is None


def test_an_out_that_is_a_file_is_refused_before_anything_is_read(tmp_path, capsys):
    (tmp_path / "file").write_text("", encoding="utf-8")
    code = main(
        ["evaluate", "absent.nc", "--model", "absent.optomodel", "--out", str(tmp_path / "file" / "x")]
    )
    assert code == 2
    assert "a folder" in capsys.readouterr().err


@pytest.mark.parametrize("role", ["train", "test"])
def test_a_protocol_without_one_of_the_roles_is_refused_before_any_light(role, tmp_path, capsys):
    file = tmp_path / "half.toml"
    file.write_text(
        f"""name = "half"
approach = [{{ from_mm = -1.0, to_mm = 1.0, step_mm = 0.5 }}]
[[sets]]
name = "a"
role = "{role}"
is_ambient = false
grid_mm = 5.0
""",
        encoding="utf-8",
    )
    assert main(["predict", "piacenza2017-pad", "--protocol", str(file), "--out", str(tmp_path / "o")]) == 2
    assert "set of role" in capsys.readouterr().err


def test_places_that_are_trained_and_tested_on_are_refused():
    from optopad.design.press_protocol import protocol_from

    sets = [
        {"name": "a", "role": "train", "is_ambient": False, "random_places": 9},
        {"name": "b", "role": "test", "is_ambient": False, "random_places": 4},
    ]
    document = {"name": "p", "approach": [{"from_mm": -1.0, "to_mm": 1.0, "step_mm": 0.5}], "sets": sets}
    with pytest.raises(DesignError, match="the locations"):
        protocol_from(document, where="p")
    sets[1]["place_seed"] = 1
    assert protocol_from(document, where="p").sets[1].place_seed == 1
