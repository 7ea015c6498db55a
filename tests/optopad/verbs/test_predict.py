import json

import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.verbs.predict import predict

PROTOCOL = """
name = "small"
approach = [
  { from_mm = -2.0, to_mm = 0.6, step_mm = 0.2 },
  { from_mm = 1.0, to_mm = 3.0, step_mm = 1.0 },
]

[[sets]]
name = "grid"
role = "train"
is_ambient = false
grid_mm = 5.0

[[sets]]
name = "random"
role = "test"
is_ambient = false
random_places = 4
"""


@pytest.fixture(scope="module")
def small_protocol(tmp_path_factory):
    file = tmp_path_factory.mktemp("protocol") / "small.toml"
    file.write_text(PROTOCOL, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def predicted(small_protocol, tmp_path_factory):
    out = tmp_path_factory.mktemp("predicted")
    keeps = preset("piacenza2017-pad").with_(**{"noise.release_residue": 0.04})
    made = predict(keeps, protocol=str(small_protocol), draws=2, out=out)
    return made.found, made.folder


@pytest.mark.slow
def test_a_prediction_has_its_tables_page_pictures_and_a_model_that_loads(predicted):
    from optopad.sims.learning.inference.model_file import load_model

    found, folder = predicted
    document = json.loads((folder / "sims" / "prediction.json").read_text(encoding="utf-8"))
    assert document["digest"] == found.digest
    assert [row["depth_mm"] for row in document["touch"]][:3] == [-0.4, -0.2, 0.0]
    assert document["errors"][2]["location_median_mm"] > 0.0
    (again,) = document["found_again"]
    assert (again["learner"], again["press_mm"], again["touch_mm"]) == ("kernel-ridge", 3.0, 0.2)
    page = (folder / "sims" / "prediction.html").read_text(encoding="utf-8")
    assert "kernel-ridge: after a press to 3 mm, a touch of 0.2 mm there is" in page
    assert "src=" not in page
    assert 'href="http' not in page.replace('href="http://www.w3.org', "")
    model = load_model(folder / "sims" / "models" / "kernel-ridge.optomodel")
    said = model.predict(model.header.untouched_counts[None])
    assert not said.is_touched[0]


@pytest.mark.slow
def test_two_draws_are_pooled_as_sessions_at_the_same_places(predicted):
    found, _ = predicted
    (one,) = found.found
    row = next(row for row in one.errors if row.depth_mm == 1.0)
    assert row.presses == 4  # places: both draws press the same ones
    assert row.samples == 2 * 2 * 4  # draws, in and out
    assert set(one.presses.session_number) == {0, 1}


@pytest.mark.slow
def test_a_deep_press_is_told_better_than_one_that_barely_touches(predicted):
    found, _ = predicted
    rows = {row.depth_mm: row for row in found.found[0].errors}
    assert rows[3.0].found == 1.0
    assert {row.depth_mm: row.right for row in found.found[0].touch}[-0.4] >= 0.75


@pytest.mark.full
def test_a_signal_map_of_two_touches_is_judged_by_the_distance_between_them(small_protocol, tmp_path):
    design = preset("gripper-stadium")
    made = predict(design, learners=["signal-map"], protocol=str(small_protocol), touches=2, out=tmp_path)
    (found,) = made.to_json()["touches"]
    rows = found["separations"]
    assert (rows[0]["from_mm"], rows[0]["from_radii"]) == (2 * design.indenter.tip_radius_mm, 2.0)
    assert rows[-1]["to_mm"] is None
    apart = [row for row in rows if row["from_radii"] >= 3.0]  # 16 pairs: nearer ones are often one
    assert len(apart) == 3
    assert sum(row["second_found"] for row in apart) / 3 >= 0.9
    assert rows[-1]["location_mm"]["median"] < design.indenter.tip_radius_mm / 3
    assert found["single"]["called"]["one"] >= 0.95
    page = (made.folder / "sims" / "prediction.html").read_text(encoding="utf-8")
    assert '<section id="touches"' in page
    assert any("called one" in line for line in made.screen())


def test_what_contradicts_or_is_unknown_is_refused_before_any_light(capsys, tmp_path):
    cases = {
        ("--quick", "--full"): "contradict",
        ("--learner", "oracle"): "'oracle' is no learner",
        ("--draws", "0"): "--draws: 0 is refused",
        ("--protocol", "piacenza2018"): "no such protocol",
        ("--touches", "3"): "touches: 3 is refused; the models know one or two",
        ("--touches", "2", "--set", "indenter.shape=cone"): "indenter.shape: cone; two touches",
    }
    for options, words in cases.items():
        assert main(["predict", "piacenza2017-pad", "--out", str(tmp_path), *options]) == 2
        assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
