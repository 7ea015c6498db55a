"""The improve verb: its files, its JSON, its refusals; made-up physics, the search and the files are real."""

from __future__ import annotations

import csv
import json
import re
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest

import optopad
import optopad.sims.score.objective as objective
import optopad.verbs.improve as improvement
from optopad.cli.main import main
from optopad.design.io import load_design
from optopad.design.preset import preset, preset_text
from optopad.design.rules.check import check
from optopad.screen.answer import INTERRUPTED, LINES
from optopad.sims.score.smallest_mold import smallest_mold
from tests.design.search.test_improvement_space import judge
from tests.optopad.screen.test_one_screen import cause
from tests.sims.made_up_scores import contiguous_score, dead_score

BAD_INPUT = 2


@pytest.fixture(scope="module")
def thick_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's pair under 10 mm of silicone, as a file with comments."""
    file = tmp_path_factory.mktemp("improve") / "thick.toml"
    text = preset_text("piacenza2017-pair")
    assert "clear_thickness_mm = 8.0" in text
    file.write_text(text.replace("clear_thickness_mm = 8.0", "clear_thickness_mm = 10.0"), encoding="utf-8")
    return file


@pytest.fixture
def design_file(thick_file: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The thick pair, in its folder, under made-up physics; each test but those of `found` has an --out of its own."""
    with_made_up_physics(monkeypatch)
    monkeypatch.chdir(thick_file.parent)
    return thick_file


@pytest.fixture(scope="module")
def found(thick_file: Path) -> dict:
    """What `optopad improve` says of the thick pair; its files are in the folder of the file."""
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as said:
        with_made_up_physics(patch)
        patch.chdir(thick_file.parent)
        assert main(["improve", str(thick_file), "--json", "--budget", "0.5"]) == 0
    return json.loads(said.getvalue())


def with_made_up_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    def scored(design, **_):
        if judge(design, ()).verdict == "CONTIGUOUS":
            return contiguous_score(design)
        return replace(dead_score(design), causes=(replace(cause("apart"), short_mm=3.3),))

    for module in (objective, improvement):
        monkeypatch.setattr(module, "judge", lambda design, limits, **_: judge(design, limits))
    monkeypatch.setattr(improvement, "verdict_of", scored)
    for also in ("with_tolerance", "with_field_steps", "with_bounds"):
        monkeypatch.setattr(improvement, also, lambda _design, found, **_: found)


def improved(file: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict:
    assert main(["improve", str(file), "--json", "--budget", "0.5", *options]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_alternatives_are_files_with_comments_that_load_as_judged(design_file, found):
    said = found
    assert said["before"]["verdict"] == "DEADBAND"
    kinds = [one["kind"] for one in said["alternatives"]]
    assert kinds[0] == "fewest changes"
    assert len(set(kinds)) == len(kinds) <= 3
    comments = [line for line in design_file.read_text().splitlines() if line.startswith("#")]
    for one in said["alternatives"]:
        loaded = load_design(one["file"])
        assert loaded.digest == one["digest"]
        assert one["verdict"] == "CONTIGUOUS"
        text = Path(one["file"]).read_text()
        assert [line for line in text.splitlines() if line.startswith("#")] == comments
        assert text.count(f"improve: {one['kind']}") == len(one["changes"])
    assert json.loads((Path(said["folder"]) / "improve.json").read_text()) == said


@pytest.mark.slow
def test_the_same_command_gives_the_same_files(design_file, capsys, found):
    first = found
    texts = [Path(one["file"]).read_bytes() for one in first["alternatives"]]
    assert improved(design_file, capsys) == first
    assert [Path(one["file"]).read_bytes() for one in first["alternatives"]] == texts


@pytest.mark.slow
def test_an_interrupted_search_goes_on_to_the_same_files(design_file, capsys, monkeypatch, found):
    whole = found
    seen: list[str] = []

    def stopping(design, limits, **_):
        seen.append(design.digest)
        if len(seen) == 6:
            raise KeyboardInterrupt
        return judge(design, limits)

    monkeypatch.setattr(objective, "judge", stopping)
    command = ["improve", str(design_file), "--json", "--budget", "0.5", "--out", "cut"]
    assert main(command) == INTERRUPTED
    cut = json.loads(capsys.readouterr().out)
    assert cut["interrupted"]
    assert cut["alternatives"] == []
    again = improved(design_file, capsys, "--out", "cut")
    one_batch = 4  # and the base before it: what was judged when it stopped is not judged again
    with (Path(whole["folder"]) / "designs.csv").open() as table:
        refused = sum(not row["digest"] for row in csv.DictReader(table))
    assert len(seen) == 6 + whole["designs"] - refused - one_batch
    assert json.dumps(again).replace("cut/", "outputs/") == json.dumps(whole)
    for one, other in zip(again["alternatives"], whole["alternatives"], strict=True):
        assert Path(one["file"]).read_bytes() == Path(other["file"]).read_bytes()


@pytest.mark.full
def test_an_interruption_leaves_what_an_earlier_run_found(design_file, capsys, monkeypatch):
    first = improved(design_file, capsys, "--out", "own")
    folder = Path(first["folder"])
    own = folder / "1-mine.toml"
    own.write_text("mine")
    before = {file: file.read_bytes() for file in (own, folder / "improve.json", *folder.glob("*.toml"))}

    def stopping(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(objective, "judge", stopping)
    assert main(["improve", str(design_file), "--json", "--budget", "5", "--out", "own"]) == INTERRUPTED
    assert {file: file.read_bytes() for file in before} == before
    monkeypatch.setattr(objective, "judge", lambda design, limits, **_: judge(design, limits))
    capsys.readouterr()
    again = improved(design_file, capsys, "--budget", "0.5", "--out", "own")
    named = {Path(one["file"]).name for one in again["alternatives"]}
    assert {file.name for file in folder.glob("[0-9]-*.toml")} == named | {"1-mine.toml"}


@pytest.mark.slow
def test_a_pad_is_searched_at_its_deciding_places_too(design_file, capsys, monkeypatch):
    asked: list[tuple] = []

    def watched(design, limits, *, also_mm, **_):
        asked.append(also_mm)
        return judge(design, limits)

    monkeypatch.setattr(objective, "judge", watched)
    out = ["--budget", "0.3", "--out", "pad"]
    assert main(["improve", "piacenza2017-pad", "--set", "cavity.clear_thickness_mm=10", "--json", *out]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["before"]["verdict"] == "DEADBAND"
    score = dead_score(preset("piacenza2017-pad")).pad_map
    places = {(one.x_mm, one.y_mm) for one in (score.worst, score.weakest)}
    assert set(map(frozenset, asked)) == {frozenset(places)}
    assert json.loads((Path(said["folder"]) / "places.json").read_text()) == [list(one) for one in asked[0]]


@pytest.mark.slow
def test_a_base_whose_deadband_a_quick_map_misses_is_mended_all_the_same(design_file, capsys, monkeypatch):
    """The score decides what the base is, not the search's coarse look at it."""
    thick = load_design(design_file).digest

    def hasty(design, limits, **_):
        found = judge(design, limits)
        if design.digest != thick:
            return found
        return replace(
            found, verdict="CONTIGUOUS", figures=found.figures | {"margin": 30.0, "deadband_mm": 0.0}
        )

    monkeypatch.setattr(objective, "judge", hasty)
    said = improved(design_file, capsys, "--out", "hasty")
    assert said["before"]["verdict"] == "DEADBAND"
    assert said["alternatives"][0]["kind"] == "fewest changes"


@pytest.mark.slow
def test_none_is_never_said_over_a_design_that_a_score_finds_better(design_file, capsys, monkeypatch):
    """Quick light that sees a deadband everywhere has the best designs judged by the score's all the same."""

    def blind(design, limits, **_):
        found = judge(design, limits)
        dead = found.figures["deadband_mm"] + 0.1
        return replace(found, verdict="DEADBAND", figures=found.figures | {"deadband_mm": dead})

    monkeypatch.setattr(objective, "judge", blind)
    said = improved(design_file, capsys, "--out", "blind")
    assert said["judged_by_score"] >= 1
    assert [one["verdict"] for one in said["alternatives"]] == ["CONTIGUOUS"]
    assert said["nearest"] is None


@pytest.mark.slow
def test_what_comes_nearest_is_told_with_the_verdict_of_a_score(design_file, capsys, monkeypatch):
    monkeypatch.setattr(improvement, "verdict_of", lambda design, **_: dead_score(design))
    said = improved(design_file, capsys, "--out", "dead")
    assert said["alternatives"] == []
    assert said["nearest"]["verdict"] == "DEADBAND"
    assert said["judged_by_score"] >= improvement.ATTEMPTS
    assert main(["improve", str(design_file), "--budget", "0.5", "--out", "dead"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"nearest +[^:]+:\s+DEADBAND", text)
    assert "\N{HORIZONTAL ELLIPSIS}" not in text


@pytest.mark.slow
def test_the_page_shows_before_and_after_side_by_side(design_file, found):
    said = found
    text = (Path(said["folder"]) / "report.html").read_text()
    assert text.index('id="before-after"') < text.index('id="front"')
    for one in said["alternatives"]:
        assert f'href="{Path(one["file"]).name}"' in text
        for path in one["changes"]:
            assert path in text
    assert text.count("<figcaption>before</figcaption>") == 1


@pytest.mark.slow
def test_from_python_it_gives_designs(design_file, tmp_path, found):
    said = found
    found = optopad.improve(load_design(design_file), budget_min=0.5, out=tmp_path / "own")
    assert [one.digest for one in found.designs] == [one["digest"] for one in said["alternatives"]]
    assert [load_design(file).digest for file in found.files] == [one.digest for one in found.designs]
    assert found.before.verdict == "DEADBAND"
    assert {one.verdict for one in found.scores} == {"CONTIGUOUS"}
    assert repr(found).splitlines()[0].startswith("design    ")
    assert found.kinds[0] in found._repr_html_()
    assert found.page.is_file()


@pytest.mark.full
def test_an_aim_at_size_offers_a_mold_that_is_smaller_and_breaks_no_rule(design_file, capsys):
    given = load_design(design_file)
    first = improved(design_file, capsys, "--aim", "size", "--budget", "0.2", "--out", "own")["alternatives"][
        0
    ]
    made = load_design(first["file"])
    assert first["kind"] == "size"
    assert objective.sizes_of(made)["outer_volume_cm3"] < objective.sizes_of(given)["outer_volume_cm3"]
    assert len(check(made)) <= len(check(given))


@pytest.mark.usefixtures("found")
def test_the_screen_names_what_changes_and_the_next_command(design_file, capsys):
    assert main(["improve", str(design_file), "--budget", "0.5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("before      DEADBAND")
    first = next(line for line in lines if line.startswith("1 "))
    assert re.fullmatch(r"1 +fewest changes: [a-z_.]+ [\d.]+ to [\d.]+ mm", first)
    assert len(lines) <= LINES
    assert any(line.startswith("next        optopad run ") for line in lines)


@pytest.mark.slow
def test_what_binds_is_named_where_nothing_mends_it(design_file, capsys):
    options = ["--keep", "cavity.clear_thickness_mm", "--keep", "receivers.height_mm", "--out", "kept"]
    said = improved(design_file, capsys, *options)
    assert said["alternatives"] == []
    assert said["nearest"]["deadband_mm"] > 0.0
    assert main(["improve", str(design_file), "--budget", "0.5", *options]) == 0
    assert "none        no better design among" in capsys.readouterr().out


REFUSED = [
    (["--vary", "receivers.heigth_mm"], "receivers.height_mm"),
    (["--vary", "receivers.height_mm=7"], "write FIELD=A:B"),
    (["--vary", "receivers.height_mm=7:7"], "is an empty range"),
    (["--budget", "0"], "--budget: 0 minutes is refused"),
    (["--keep", "mold.rim_mm"], "vary by default"),
    (["--aim", "strength"], "margin, location, contact"),
    (["--aim", "location"], "refused for facing rows"),
]


@pytest.mark.parametrize(
    ("options", "words"),
    REFUSED,
)
def test_what_it_cannot_do_is_said(design_file, capsys, options, words):
    before = sorted(design_file.parent.rglob("*"))
    assert main(["improve", str(design_file), *options]) == BAD_INPUT
    assert words in capsys.readouterr().err
    assert sorted(design_file.parent.rglob("*")) == before


def test_the_smallest_mold_of_any_outline_has_no_more_findings():
    for name in ("piacenza2017-pad", "levi2013-disc"):
        design = preset(name)
        changes = smallest_mold(design)
        assert changes
        assert len(check(design.with_(**changes))) <= len(check(design))
