"""Designs side by side: what differs, which is better and by how much, what is refused."""

import json
from dataclasses import replace

import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.fabrication.bundle import altered_files, bundle_name
from optopad.report.before_after import compare_html
from optopad.screen.figures import TABLE_WIDTH, figures_of
from optopad.verbs import compare as comparing
from optopad.verbs.compare import changes_of, compare
from tests.sims.made_up_bounds import made_up_bounds
from tests.sims.made_up_scores import contiguous_score, dead_score, out_of_scope_score

PAIR = preset("piacenza2017-pair")
THICK = PAIR.with_(**{"cavity.clear_thickness_mm": 10.0})


@pytest.fixture
def judged(monkeypatch):
    """Made-up scores: thick is dead, a radius of 2 mm is out of scope; another seed changes nothing."""

    def judge(design, **_):
        thick, thin_tip = design.cavity.clear_thickness_mm > 8, design.indenter.tip_radius_mm < 3
        made = out_of_scope_score if thin_tip else dead_score if thick else contiguous_score
        return made(design)

    monkeypatch.setattr(comparing, "_judged", judge)


def compared(out, *designs):
    return compare({f"d{k}": design for k, design in enumerate(designs)}, out=out)


def test_what_differs_is_told_by_dotted_path():
    other = THICK.with_(**{"receivers.part": "generic-receiver"})
    assert changes_of((PAIR, other)) == {
        "cavity.clear_thickness_mm": (8.0, 10.0),
        "receivers.part": ("osram-sfh206k", "generic-receiver"),
    }


def test_a_layout_with_more_entries_shows_what_the_other_lacks():
    grown = PAIR.with_(
        layout=[
            *(entry.model_dump(mode="json") for entry in PAIR.layout),
            {"pattern": "single", "kind": "emitter", "wall": "north", "along_mm": 10.0},
        ]
    )
    found = changes_of((PAIR, grown))
    assert found["layout.1.wall"] == (comparing.ABSENT, "north")


def test_the_contiguous_design_wins_verdict_and_deadband_and_no_figure_of_single_pairs_is_ranked(
    judged, tmp_path
):
    found = compared(tmp_path, THICK, PAIR)
    measures = {one.name: one for one in found.measures}
    assert found.winner_of_verdict == 1
    assert measures["deadband"].winner == 1
    assert measures["parts"].winner is None  # six each
    assert measures["height"].winner == 1
    assert measures["price"].winner is None  # not known
    assert not {"continuity", "evenness", "swing", "resolvable steps", "mode gap"} & set(measures)


def test_a_figure_wins_by_more_than_its_own_error_and_the_seeds(tmp_path, monkeypatch):
    def judge(design, *, seed, verdict_only, **_):
        thick = design.cavity.clear_thickness_mm > 8
        depth_mm, between_mm = (4.0, (3.9, 4.1)) if thick else (3.0, (2.7, 3.1))
        made = replace(
            contiguous_score(design),
            usable_depth_mm=depth_mm,
            usable_range_mm=between_mm,
            margin=(9.0 if thick else 5.0) + 1.5 * seed,
        )
        return made if verdict_only else replace(made, bounds=made_up_bounds(design), is_facing_rows=False)

    monkeypatch.setattr(comparing, "_judged", judge)
    found = compared(tmp_path, PAIR, THICK)
    measures = {one.name: one for one in found.measures}
    assert (measures["usable"].winner, measures["usable"].values) == (1, (3.0, 4.0))
    assert measures["usable"].uncertainty == pytest.approx((0.3, 0.1))
    assert (measures["margin"].winner, measures["margin"].uncertainty) == (1, (1.5, 1.5))
    assert measures["location"].winner is None  # equal
    assert measures["unresolved"].uncertainty[0] > 0.01  # one location and depth of the map
    assert measures["location"].uncertainty[0] > 0  # its own error, though the second seed has no bounds
    lines = found.lines()
    assert lines[:2] == [
        f"1  d0 ({PAIR.digest[:8]})",
        f"2  d1 ({THICK.digest[:8]}): cavity.clear_thickness_mm = 10",
    ]
    assert any(line.startswith("1 ") and "CONTIGUOUS to 3.0 of 5 mm" in line for line in lines)
    assert any(line.startswith("2 ") and "9.0 *" in line and "4.00 *" in line for line in lines)
    assert max(map(len, lines)) <= TABLE_WIDTH
    assert "CONTIGUOUS to 4.0 of 5 mm" in compare_html(found, "<svg></svg>")
    rows = found.to_json()["designs"]
    assert [row["margin_noise_units"] for row in rows] == [5.0, 9.0]
    assert {"location_bound_mm", "detection_force_n", "pressable_mm", "outer_mm", "price"} <= set(rows[0])


def test_facing_rows_and_a_pad_have_no_winner_of_margin_and_depth(judged, tmp_path):
    pad = preset("piacenza2017-pad")
    figures = [figures_of(one, contiguous_score(one)) for one in (PAIR, pad)]
    margins = [replace(one, margin=value) for one, value in zip(figures, (5.0, 9.0), strict=True)]
    winners = {one.name: one.winner for one in comparing.measures_of(margins, margins)}
    assert (winners["margin"], winners["depth"], winners["parts"]) == (None, None, 0)
    assert next(one for one in comparing.measures_of(margins[1:], margins[1:])).winner == 0


def test_an_undecided_verdict_makes_no_winner(tmp_path, monkeypatch):
    def judge(design, **_):
        made = dead_score(design) if design.cavity.clear_thickness_mm > 8 else contiguous_score(design)
        return replace(made, is_open=made.verdict == "DEADBAND")

    monkeypatch.setattr(comparing, "_judged", judge)
    found = compared(tmp_path, PAIR, THICK)
    assert found.winner_of_verdict is None
    assert any("DEADBAND, undecided" in line for line in found.lines())


def test_everything_is_written_into_the_first_designs_bundle(judged, tmp_path):
    found = compared(tmp_path, PAIR, THICK)
    bundle = tmp_path / bundle_name(PAIR)
    assert found.folder == bundle / "sims"
    assert {path.suffix for path in found.folder.iterdir()} == {".json", ".svg", ".png", ".html"}
    assert altered_files(bundle) == ()
    json.dumps(found.to_json(), allow_nan=False)


def test_the_page_and_the_lines_mark_winners_and_escape_what_was_typed(judged, tmp_path):
    found = compare({"<b>&": PAIR, "thick": THICK}, out=tmp_path)
    page = compare_html(found, "<svg></svg>")
    assert "<b>&<" not in page
    assert "&lt;b&gt;&amp;" in page
    assert "class=best>CONTIGUOUS" in page
    assert "http" not in page.replace("http://www.w3.org", "")  # opens offline
    assert any("CONTIGUOUS *" in line for line in found.lines())


def test_a_design_out_of_scope_is_compared_by_its_reason(judged, tmp_path):
    found = compared(tmp_path, PAIR, PAIR.with_(**{"indenter.tip_radius_mm": 2.0}))
    lines = "\n".join(found.lines())
    assert "OUT_OF_MODEL_SCOPE" in lines
    assert "press less deep" in lines


def test_a_copy_with_other_parts_is_scored_anew(judged, tmp_path, capsys):
    command = [
        "compare",
        "piacenza2017-pair",
        "--with",
        "cavity.clear_thickness_mm=10;receivers.part=generic-receiver",
    ]
    assert main([*command, "--out", str(tmp_path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [design["verdict"] for design in document["designs"]] == ["CONTIGUOUS", "DEADBAND"]
    assert {one["path"] for one in document["changes"]} == {"cavity.clear_thickness_mm", "receivers.part"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["piacenza2017-pair"], "one design alone"),
        (["piacenza2017-pair", "piacenza2017-pair"], "are the same design"),
        (
            ["piacenza2017-pair", "--with", "cavity.clear_thicknes_mm=9"],
            "did you mean cavity.clear_thickness_mm",
        ),
        (["piacenza2017-pair", "--with", "receivers.part"], "--with: 'receivers.part' is refused"),
        (["piacenza2017-pair", "--with", "receivers.part=osram-sfh206"], "osram-sfh206k"),
        (["piacenza2017-pair", "nowhere.toml"], "nowhere.toml"),
        (["piacenza2017-pair", "--pair", "E1-R1", "--with", "gain.target_counts=200"], "are for a recording"),
        (["piacenza2017-pair", "none.csv"], "none.csv: no such file"),
        (["a.csv", "b.csv"], "DESIGN RECORDING"),
    ],
)
def test_a_comparison_that_cannot_be_made_is_refused(judged, tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["compare", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_lead_within_the_uncertainties_is_no_win():
    assert comparing._winner("lower", (1.0, 1.1), (0.08, 0.08)) is None
    assert comparing._winner("lower", (1.0, 1.2), (0.08, 0.08)) == 0
    assert comparing._winner("higher", (1.0, 1.2, 1.2), (0.0, 0.0, 0.0)) is None
    assert comparing._winner("higher", (1.0, None), (0.0, 0.0)) is None
    never = float("inf")  # not resolved
    assert comparing._winner("lower", (never, 1.0), (0.0, 0.1)) == 1
    assert comparing._winner("lower", (never, never), (0.0, 0.0)) is None
