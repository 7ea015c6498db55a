"""optopad explore, on an objective that costs nothing; the physics has tests of its own."""

from __future__ import annotations

import csv
import json
import shutil
from contextlib import redirect_stdout
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import pytest

from optopad.cli import main
from optopad.design.io import load_design
from optopad.design.rules.check import check
from optopad.design.search.improve import Judged
from optopad.design.search.space import SPACES, load_space
from optopad.verbs.explore import figures_wanted

SPACE = """
name = "cheap"
base = "piacenza2017-pair"

[[fields]]
path = "cavity.clear_thickness_mm"
low = 6.0
high = 11.0
step = 0.5

[[fields]]
path = "layout"
choices = [
    [{ pattern = "facing_rows", count = 3, pitch_mm = 6.35 }],
    [{ pattern = "facing_rows", count = 1 }],
]

[[objectives]]
figure = "evenness"

[[objectives]]
figure = "part_count"

[[constraints]]
figure = "strength"
at_least_base = 0.8

[search]
trials = 12
"""


LAYOUTS = SPACE[SPACE.index("choices = [") + 10 : SPACE.index("\n\n[[objectives]]")]
NAMED = 'name = "cheap"'
ATTACK = 'description = "<script>alert(1)</script>"'


def bowl(design, limits, *, wanted, accuracy, also_mm):
    thickness = design.cavity.clear_thickness_mm
    if thickness > 10.0:
        return Judged(reason="too thick (for this test)")
    count = design.layout[0].count
    figures = {"evenness": 1 / (1 + abs(thickness - 9.0)) - 0.1 * (count == 1), "part_count": 2.0 * count}
    return Judged(figures=figures | {"strength": 8.0 / thickness}, verdict="CONTIGUOUS")


@pytest.fixture
def space(tmp_path, monkeypatch):
    monkeypatch.setattr("optopad.sims.score.objective.judge", bowl)
    file = tmp_path / "space.toml"
    file.write_text(SPACE)
    return file


def explored(space: Path, out: Path, capsys, *more: str) -> dict:
    assert main(["explore", str(space), "--out", str(out), "--json", *more]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict:
    """What a search of all 12 trials says, made once; its space says something that a page must escape."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "space.toml").write_text(SPACE.replace(NAMED, f"{NAMED}\n{ATTACK}"))
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as said:
        patch.setattr("optopad.sims.score.objective.judge", bowl)
        assert main(["explore", str(folder / "space.toml"), "--out", str(folder / "out"), "--json"]) == 0
    return json.loads(said.getvalue())


def test_the_front_comes_as_tables_and_as_designs_that_load(whole):
    found = whole
    folder = Path(found["folder"])
    assert found["designs"] == found["wanted"] == 12
    rows = list(csv.DictReader((folder / "front.csv").read_text().splitlines()))
    assert [int(row["number"]) for row in rows] == [one["number"] for one in found["front"]]
    assert len(list(csv.DictReader((folder / "designs.csv").read_text().splitlines()))) == 12
    for one in found["front"]:
        design = load_design(folder / one["file"])
        assert design.digest == one["digest"]
        assert not [finding for finding in check(design) if finding.severity == "error"]
        assert main(["check", str(folder / one["file"])]) == 0
    assert {path.name for path in (folder / "designs").iterdir()} == {
        Path(one["file"]).name for one in found["front"]
    }


@pytest.mark.slow
def test_more_trials_go_on_and_the_seed_repeats(space, tmp_path, capsys, whole):
    explored(space, tmp_path / "a", capsys, "--trials", "8")
    resumed = explored(space, tmp_path / "a", capsys, "--trials", "12")
    assert [one["digest"] for one in resumed["front"]] == [one["digest"] for one in whole["front"]]
    assert resumed["designs"] == 12


def test_a_cost_without_prices_is_refused_before_a_folder_is_made(space, tmp_path, capsys):
    text = space.read_text(encoding="utf-8").replace('"evenness"', '"cost"')
    priced = space.with_name("priced.toml")
    priced.write_text(text, encoding="utf-8")
    assert main(["explore", str(priced), "--out", str(tmp_path / "out")]) == 2
    assert "osram-sfh206k" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_every_row_shows_the_usable_depth_and_the_score_words_of_its_verdict(
    space, tmp_path, capsys, monkeypatch
):
    asked = []

    def judged(design, limits, *, wanted, **_):
        asked.append(wanted)
        near = design.cavity.clear_thickness_mm < 9.0
        figures = {
            "evenness": 0.5,
            "part_count": 6.0,
            "strength": 1.0,
            "usable_depth_mm": 3.1,
            "deadband_mm": 0.0,
        }
        return Judged(figures=figures | {"margin": 3.1 if near else 9.0}, verdict="CONTIGUOUS")

    monkeypatch.setattr("optopad.sims.score.objective.judge", judged)
    assert main(["explore", str(space), "--out", str(tmp_path / "out"), "--trials", "1"]) == 0
    assert asked[0][-1] == "usable_depth_mm"
    told = capsys.readouterr().out
    rows = [[cell.strip() for cell in line.split("  ")] for line in told.splitlines()]
    head, base = ([cell for row in rows if row[0] == name for cell in row] for name in ("design", "base"))
    assert {"usable_depth_mm", "pressable", "height", "price"} <= set(head)
    assert "CONTIGUOUS, undecided, to 3.1 of 5 mm" in base  # 8 mm, margin near the threshold
    assert {"3.1", "8 x 8 (16 %)", "33 x 33"} <= set(base)
    assert "next      optopad score " in told  # one design: not re-scored, and the line says how
    found = explored(space, tmp_path / "out", capsys, "--trials", "12")
    folder = Path(found["folder"])
    words = {row["headline"] for row in csv.DictReader((folder / "designs.csv").read_text().splitlines())}
    assert words == {"CONTIGUOUS, undecided, to 3.1 of 5 mm", "CONTIGUOUS to 3.1 of 5 mm"}
    assert {one["is_open"] for one in found["front"]} <= {True, False}
    page = Path(found["report"]).read_text(encoding="utf-8")
    assert "CONTIGUOUS, undecided, to 3.1 of 5 mm" in page
    assert "quick light" in page


def test_the_usable_depth_alone_makes_no_search_trace_the_map_of_a_pad(space):
    pair = load_space(str(space))
    pad = SPACE.replace("piacenza2017-pair", "piacenza2017-pad")
    plain = space.with_name("pad.toml")
    plain.write_text(
        pad.replace('path = "layout"', 'path = "gain.target_counts"').replace(LAYOUTS, "[200.0]")
    )
    assert "usable_depth_mm" in figures_wanted(pair)
    assert "usable_depth_mm" not in figures_wanted(load_space(str(plain)))
    assert "usable_depth_mm" in figures_wanted(
        load_space("pad-layout")
    )  # its limit on the verdict needs the map


@pytest.mark.slow
def test_an_interrupt_leaves_tables_and_a_page_and_says_so(space, tmp_path, capsys, monkeypatch):
    calls = []

    def interrupts(*given, **named):
        calls.append(1)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return bowl(*given, **named)

    monkeypatch.setattr("optopad.sims.score.objective.judge", interrupts)
    assert main(["explore", str(space), "--out", str(tmp_path / "out"), "--json"]) == 130
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert found["interrupted"]
    assert found["designs"] == 5
    assert (Path(found["folder"]) / "report.html").is_file()
    assert "interrupted" in told.err


def test_a_second_search_in_the_folder_is_kept_out(space, tmp_path, capsys):
    import fcntl

    folder = Path(explored(space, tmp_path / "out", capsys, "--trials", "1")["folder"])
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert main(["explore", str(space), "--out", str(tmp_path / "out")]) == 2
    assert "process is searching" in capsys.readouterr().err


def test_a_search_is_not_written_through_links(space, tmp_path, capsys):
    own = load_space(str(space))
    folder = tmp_path / "out" / f"{own.name}-{own.digest[:8]}"
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine.toml").write_text("kept")
    for link in (folder / "designs", folder):
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(tmp_path / "elsewhere")
        assert main(["explore", str(space), "--trials", "1", "--out", str(tmp_path / "out")]) == 2
        assert "written through links" in capsys.readouterr().err
        assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["mine.toml"]
        shutil.rmtree(folder, ignore_errors=True)


def test_a_study_of_another_space_is_refused_and_nothing_is_lost(space, tmp_path, capsys):
    url = f"sqlite:///{tmp_path / 'shared.db'}"
    explored(space, tmp_path / "a", capsys, "--storage", url, "--trials", "4")
    other = tmp_path / "other.toml"
    other.write_text(SPACE.replace("high = 11.0", "high = 10.0"))
    assert main(["explore", str(other), "--out", str(tmp_path / "b"), "--storage", url]) == 2
    assert "of another search space" in capsys.readouterr().err
    assert explored(space, tmp_path / "a", capsys, "--storage", url, "--trials", "4")["designs"] == 4


REFUSED = [
    ("clear_thickness_mm", "clear_thicknes_mm", "did you mean cavity.clear_thickness_mm"),
    ('"layout"', '"layout.0.cuont"', "did you mean layout.0.count"),
    ("high = 11.0", "high = 6.0", "the range from 6 to 6 is empty"),
    ("high = 11.0", "high = 5.5", "the range from 6 to 5.5 is empty"),
    ("step = 0.5", "step = 0.7", "steps of 0.7 from 6 do not reach 11"),
    ("low = 6.0", "low = -6.0", "must be at least 1 mm"),
    ("at_least_base = 0.8", "at_least = 2.0\nat_most = 1.0", "cannot be at least 2 and at most 1"),
    ("at_least_base = 0.8", "", "needs at_least, at_most, at_least_base or at_most_base"),
    ('figure = "strength"', 'figure = "srtength"', "did you mean strength"),
    ('figure = "evenness"', 'figure = "evenes"', "did you mean evenness"),
    ("trials = 12", "trials = 0", "search.trials: 0 is refused"),
    ("trials = 12", 'sampler = "tbe"', "search.sampler: 'tbe' is refused"),
    ("trials = 12", "tirals = 12", "search.tirals"),
    ('base = "piacenza2017-pair"', 'base = "piacenza2017-pear"', "did you mean piacenza2017-pair"),
    ('path = "layout"', 'path = "name"', "name: cannot vary"),
    ("count = 1 }", "count = 99 }", "must be at most 32"),
]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    REFUSED,
)
def test_bad_spaces_are_refused_with_the_way_out(space, tmp_path, capsys, old, new, words):
    assert old in SPACE
    space.write_text(SPACE.replace(old, new, 1))
    assert main(["explore", str(space), "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_only_continuity_is_no_objective(space, tmp_path, capsys):
    text = SPACE.replace('figure = "evenness"', 'figure = "continuity"').replace(
        'figure = "part_count"', 'figure = "deadband_mm"'
    )
    space.write_text(text)
    assert main(["explore", str(space), "--out", str(tmp_path / "out")]) == 2
    assert "half the signal" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--storage", "postgresql://someone:secret@127.0.0.1:9/none", "127.0.0.1:9/none cannot be reached"),
        ("--storage", "nonsense", "cannot be reached"),
        ("--trials", "0", "to 1"),
    ],
)
def test_what_cannot_be_reached_is_said_in_one_line(space, tmp_path, capsys, option, value, words):
    assert main(["explore", str(space), "--out", str(tmp_path / "out"), option, value]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert "secret" not in told
    assert "Traceback" not in told


@pytest.mark.parametrize("name", SPACES)
def test_every_packaged_space_loads_and_holds_its_base_design(name):
    space = load_space(name)
    assert space.base_parameters() is not None
    assert (
        space.design_at(space.base_parameters()).with_(
            name=space.base.name, description=space.base.description
        )
        == space.base
    )


class Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.links, self.tags, self.sources = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        found = dict(attributes)
        if tag == "a":
            self.links.append(found["href"])
        self.sources += [found[name] for name in ("src", "href") if name in found and tag != "a"]


def test_the_page_is_self_contained_and_links_to_every_design(whole):
    require_whole_page(whole, plots=2)  # front, parallel coordinates


@pytest.mark.slow
def test_the_page_of_a_search_of_24_trials_has_the_importance_too(space, tmp_path, capsys):
    require_whole_page(explored(space, tmp_path / "out", capsys, "--trials", "24"), plots=3)


def require_whole_page(found: dict, *, plots: int) -> None:
    text = Path(found["report"]).read_text(encoding="utf-8")
    page = Page(text)
    assert page.tags.count("svg") == plots
    assert not [source for source in page.sources if not source.startswith("#")]
    assert "script" not in page.tags
    for one in found["front"]:
        assert one["file"] in page.links
    for link in page.links:
        assert link.startswith("#") or (Path(found["folder"]) / link).is_file()
    assert "too thick" in text


def test_the_page_escapes_what_a_space_says(whole):
    text = Path(whole["report"]).read_text(encoding="utf-8")
    assert "<script>" not in text
    assert "&lt;script&gt;alert(1)" in text


@pytest.mark.slow
def test_importance_finds_the_field_that_matters(space, tmp_path, capsys):
    space.write_text(SPACE.replace("trials = 12", 'sampler = "random"'))
    shares = explored(space, tmp_path / "out", capsys, "--trials", "40")["importance"]["evenness"]
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-9)
    # 9 mm is best by up to 0.75, the layout by 0.1; a fair share of two fields is a half
    assert shares["cavity.clear_thickness_mm"] > 0.6


def test_another_base_is_another_search(space, tmp_path, capsys):
    plain = explored(space, tmp_path / "out", capsys, "--trials", "1")
    changed = explored(space, tmp_path / "out", capsys, "--trials", "1", "--set", "gain.target_counts=500")
    assert plain["digest"] != changed["digest"]
    assert plain["folder"] != changed["folder"]
