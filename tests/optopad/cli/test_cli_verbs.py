"""What the verbs print, write and return; the long verbs are tested on their bundle in test_run.py."""

from __future__ import annotations

import json
from importlib.metadata import version

import pytest

from optopad.cli import main
from optopad.design.io import load_design
from optopad.design.preset import PRESETS, preset
from optopad.verbs.sweep import parsed_sweep
from optopad.work import parsed_change, parsed_value


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", PRESETS)
def test_new_writes_a_commented_preset_under_the_name_of_the_file(folder, name):
    assert main(["new", "mine.toml", "--preset", name]) == 0
    text = (folder / "mine.toml").read_text(encoding="utf-8")
    assert text.count("#") > 15
    assert load_design(folder / "mine.toml") == preset(name).with_(name="mine", description="")


def test_new_keeps_an_existing_file(folder, capsys):
    (folder / "mine.toml").write_text("mine", encoding="utf-8")
    assert main(["new", "mine.toml"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (folder / "mine.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("file", "words"),
    [("my pad.toml", "use my-pad.toml"), ("..toml", "use my-pad.toml"), ("my-pad", "use my-pad.toml")],
)
def test_new_refuses_a_file_name_that_is_no_design_s_and_says_one_that_is(folder, capsys, file, words):
    assert main(["new", file]) == 2
    assert words in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_check_of_a_preset_prints_nothing_but_json_with_json(folder, capsys):
    assert main(["check", "piacenza2017-pad", "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["digest"] == preset("piacenza2017-pad").digest
    assert printed.err == ""


def test_a_design_that_breaks_a_rule_is_not_run_and_nothing_is_written(folder, capsys):
    assert main(["run", "piacenza2017-pad", "--set", "emitters.height_mm=9"]) == 2
    printed = capsys.readouterr()
    assert "emitters.height_mm" in printed.err
    assert "Traceback" not in printed.err
    assert list(folder.iterdir()) == []


def test_set_reads_values_as_toml_and_bare_words_as_text():
    assert parsed_change("cavity.clear_thickness_mm=10") == ("cavity.clear_thickness_mm", 10)
    assert parsed_value("[1, 2]") == [1, 2]
    assert parsed_value("osram-sfh206k") == "osram-sfh206k"
    assert parsed_value("true") is True
    assert parsed_value("9" * 5000) == "9" * 5000


def test_a_sweep_holds_both_ends():
    assert parsed_sweep("cavity.clear_thickness_mm=6:12:0.5") == (
        "cavity.clear_thickness_mm",
        [6 + 0.5 * step for step in range(13)],
    )
    assert parsed_sweep("emitters.part=a,b") == ("emitters.part", ["a", "b"])


@pytest.mark.parametrize(
    "text",
    [
        "x",
        "x=",
        "=1:2:1",
        "x=2:1:1",
        "x=1:2:0",
        "x=1:2:-1",
        "x=1:b:1",
        "x=0:1e9:1",
        "x=nan:1:1",
        "x=0:inf:1",
        "x=0:1:nan",
    ],
)
def test_a_sweep_of_no_value_is_refused(folder, capsys, text):
    assert main(["sweep", "piacenza2017-pair", text]) == 2
    assert "sweep" in capsys.readouterr().err


def test_a_sweep_with_one_unusable_value_is_refused_before_anything_is_computed(folder, capsys):
    assert main(["sweep", "piacenza2017-pair", "cavity.clear_thickness_mm=8,5"]) == 2
    printed = capsys.readouterr().err
    assert "cavity.clear_thickness_mm = 5" in printed
    assert "receivers.height_mm" in printed
    assert list(folder.iterdir()) == []


def test_a_sweep_out_of_scope_keeps_its_rows(folder, capsys):
    assert main(["sweep", "piacenza2017-pair", "operating.max_depth_mm=5.3,5.5", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["verdict"] for row in rows] == ["OUT_OF_MODEL_SCOPE"] * 2
    assert [row["value"] for row in rows] == [5.3, 5.5]


def test_an_interrupted_verb_says_so_and_exits_130(folder, capsys, monkeypatch):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr("optopad.doctor.examine", interrupted)
    assert main(["doctor"]) == 130
    assert "no file is incomplete" in capsys.readouterr().err


def test_the_schema_accepts_every_field_of_a_saved_design(folder, capsys):
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert set(preset("piacenza2017-pad").model_dump()) <= set(schema["properties"])
    assert "catalog_files" in schema["properties"]
    assert schema["additionalProperties"] is False


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--builds", "50"], "--builds: needs --tolerance"),
        (["--tolerance", "--builds", "3"], "--builds: 3 is refused: give 10 to 100000"),
        (["--tolerance", "--builds", "-1"], "--builds: -1 is refused"),
    ],
)
def test_a_useless_number_of_builds_is_refused_before_anything_is_computed(folder, capsys, options, words):
    assert main(["score", "piacenza2017-pair", *options]) == 2
    assert words in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_a_score_of_a_design_that_breaks_a_rule_leaves_no_folder(folder, capsys):
    assert main(["score", "piacenza2017-pad", "--set", "emitters.height_mm=9"]) == 2
    assert list(folder.iterdir()) == []


def test_check_exits_2_on_an_error_and_names_the_field(folder, capsys):
    assert main(["check", "piacenza2017-pad", "--set", "emitters.height_mm=9"]) == 2
    assert "emitters.height_mm" in capsys.readouterr().out


WIDTH = 80
GROUPS = ("Main job:", "Design:", "Mold:", "Physics:", "Search:", "Built sensor:")


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"optopad {version('optopad')}\n"


@pytest.mark.parametrize("arguments", [["--help"], ["-h"]])
def test_the_help_has_all_verbs_in_groups_and_cuts_no_line(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if len(line) > WIDTH] == []
    assert [line for line in lines[1:] if "..." in line] == []  # the first line has the arguments' own
    assert [line for line in lines if line in GROUPS] == list(GROUPS)
    last = lines[lines.index(GROUPS[0]) :]
    told = [line.split()[0] for line in last if line.startswith("  ")]
    assert len(told) == len(set(told))
    assert {"run", "check", "build", "score", "improve", "driver"} <= set(told)
    assert all(line.endswith(".") for line in last if line.startswith("  "))
