"""What a sweep says, writes, refuses, and takes up again; the physics of a few values on the real models."""

import csv
import json
from dataclasses import replace

import pytest

from optopad.cli import main
from optopad.design.io import load_design
from optopad.design.preset import preset
from optopad.fabrication.bundle import altered_files, bundle_name
from optopad.screen.figures import TABLE_WIDTH, figures_of
from optopad.screen.sweep import Sweep
from optopad.sims.plots.sweep import plot_sweep
from optopad.sims.score.sweep import SweepRow, disputed, sweep_row
from optopad.verbs import sweep as sweeping
from optopad.verbs.sweep import sweep
from optopad.work import FinishedWork
from tests.said import says
from tests.sims.made_up_bounds import made_up_bounds
from tests.sims.made_up_scores import contiguous_score, dead_score, out_of_scope_score

PAIR = preset("piacenza2017-pair")
THICKNESS = "cavity.clear_thickness_mm"


def made_up(design, **_):
    made = dead_score if design.cavity.clear_thickness_mm > 8 else contiguous_score
    return made(design)


@pytest.fixture
def judged(monkeypatch):
    """Made-up scores in place of the physics; returns the thicknesses that were judged."""
    asked = []

    def judge(variant, *_, **__):
        asked.append(variant.cavity.clear_thickness_mm)
        return made_up(variant)

    monkeypatch.setattr(sweeping, "_judged", judge)
    return asked


def swept(out, values, design=PAIR, **options):
    return sweep(design, THICKNESS, values, out=out, **options)


def test_a_sweep_writes_table_and_figure_into_the_bundle(judged, tmp_path):
    made = swept(tmp_path, [8.0, 10.0])
    names = {path.name for path in (made.folder / "sims").iterdir()}
    assert names == {f"sweep-{THICKNESS}.{kind}" for kind in ("json", "csv", "svg", "png")}
    assert made.folder == tmp_path / bundle_name(PAIR)
    assert altered_files(made.folder) == ()
    table = (made.folder / "sims" / f"sweep-{THICKNESS}.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(table.splitlines()))
    assert [row[THICKNESS] for row in rows] == ["8.0", "10.0"]
    assert [row["verdict"] for row in rows] == ["CONTIGUOUS", "DEADBAND"]
    assert list(tmp_path.iterdir()) == [made.folder]  # finished pieces are gone with the work


def test_rows_hold_the_value_the_keys_of_a_score_and_the_figures_of_the_screen(judged, tmp_path):
    document = swept(tmp_path, [8.0]).to_json()
    assert document["field"] == THICKNESS
    score = {"value", "verdict", "deadband_mm", "mode_gap_mm", "continuity", "evenness", "strength"}
    figures = {"margin_noise_units", "location_bound_mm", "depth_bound_mm", "detection_force_n"}
    sizes = {"unresolved_share", "pressable_mm", "pressable_share", "outer_mm", "parts", "price"}
    assert score | figures | sizes <= set(document["rows"][0])
    json.dumps(document, allow_nan=False)


def test_table_file_and_figure_show_what_varies(tmp_path, monkeypatch):
    faded = replace(
        contiguous_score(PAIR),
        usable_depth_mm=3.1,
        usable_range_mm=(3.0, 3.2),
        margin=4.6,
        bounds=made_up_bounds(PAIR),
    )
    scores = {8.0: faded, 9.0: out_of_scope_score(PAIR)}
    monkeypatch.setattr(
        sweeping, "_judged", lambda variant, *_, **__: scores[variant.cavity.clear_thickness_mm]
    )
    made = swept(tmp_path, [8.0, 9.0])
    head, units, line, beyond, same, *rest = made.lines()
    assert head.split() == f"{THICKNESS} verdict margin usable deadband location depth contact height".split()
    assert units.split() == ["sigma", *["mm"] * 4, "N", "mm"]
    assert "CONTIGUOUS to 3.1 of 5 mm  4.6     3.10" in line
    assert "OUT_OF_MODEL_SCOPE         -" in beyond
    assert says(same, "8 x 8 mm ... 16 % ... 33 x 33 mm ... 6, price")
    assert any("press less deep" in reason for reason in rest)
    assert max(map(len, made.lines()[:5])) <= TABLE_WIDTH
    written = list(csv.DictReader(made.to_csv().splitlines()))
    assert (written[0]["usable_depth_mm"], written[0]["usable_from_mm"]) == ("3.1", "3.0")
    assert (written[0]["margin_noise_units"], written[1]["margin_noise_units"]) == ("4.6", "")
    assert (written[1]["outer_x_mm"], written[1]["parts"]) == ("33.0", "6")
    assert [row["headline"] for row in written] == ["CONTIGUOUS to 3.1 of 5 mm", "OUT_OF_MODEL_SCOPE"]
    assert made.to_json()["rows"][0]["headline"] == "CONTIGUOUS to 3.1 of 5 mm"
    panel = plot_sweep(THICKNESS, made.rows).axes[0]
    assert "CONTIGUOUS to 3.1" in panel.get_title(loc="left")
    marks = [line for line in panel.lines if line.get_gid() == "usable-depth"]
    assert [mark.get_xdata()[0] for mark in marks] == [3.1]


PAD = preset("piacenza2017-pad")


def dead_for(length_mm, *, usable_mm=5.0, design=PAD):
    """A score with one deadband of a length; none: 0 mm."""
    bands = ((1.0, 1.0 + length_mm),) if length_mm else ()
    score = replace(contiguous_score(design), deadbands_mm=bands, usable_depth_mm=usable_mm)
    return replace(score, verdict="DEADBAND" if bands else "CONTIGUOUS")


def rows_of(*scores, values=None):
    given = values or [5.0 + 0.5 * number for number in range(len(scores))]
    return [sweep_row(PAD, value, score) for value, score in zip(given, scores, strict=True)]


def test_rows_whose_verdict_differs_from_both_neighbours_are_in_dispute_with_them():
    dead, sound = dead_for(0.4), dead_for(0.0)
    assert disputed(rows_of(sound, sound, dead, dead)) == ()
    assert disputed(rows_of(sound, dead, sound, sound)) == (0, 1, 2)
    assert disputed(rows_of(dead, sound, sound, dead, sound)) == (2, 3, 4)


@pytest.mark.slow
def test_a_depth_lost_that_rises_and_falls_beyond_the_sampling_error_is_in_dispute():
    lengths = [dead_for(mm) for mm in (0.4, 0.8, 0.5)]
    assert disputed(rows_of(*lengths)) == (0, 1, 2)
    assert disputed(rows_of(*(dead_for(mm) for mm in (0.4, 0.5, 0.45)))) == ()
    # a blind interval that reaches the end of the range is no deadband, but as much is lost
    faded = [dead_for(0.0, usable_mm=mm) for mm in (4.6, 4.2, 4.6)]
    assert disputed(rows_of(*faded)) == (0, 1, 2)
    # a layer between too thin and too thick loses least: an optimum is no dispute
    assert disputed(rows_of(*(dead_for(0.0, usable_mm=mm) for mm in (2.6, 3.6, 3.1)))) == ()


def test_neighbours_are_those_of_the_values_and_categories_have_none():
    dead, sound = dead_for(0.4), dead_for(0.0)
    assert disputed(rows_of(sound, dead, dead, sound, values=[1, 4, 3, 2])) == ()
    assert disputed(rows_of(sound, dead, sound, values=["a", "b", "c"])) == ()
    assert disputed([*rows_of(sound), sweep_row(PAD, 6.0, out_of_scope_score(PAD)), *rows_of(sound)]) == ()


@pytest.mark.slow
@pytest.mark.parametrize(("design", "setting"), [(PAD, "full"), (PAIR, "fine")])
def test_rows_in_dispute_are_judged_again_more_finely_and_say_so(monkeypatch, tmp_path, design, setting):
    asked = []

    def coarse(variant, *_, **__):
        return dead_for(0.5 if variant.cavity.clear_thickness_mm == 8.5 else 0.0, design=variant)

    def finer(variant, *, fine, full, **_):
        asked.append((variant.cavity.clear_thickness_mm, "fine" if fine else "full" if full else ""))
        return dead_for(0.0, design=variant)

    monkeypatch.setattr(sweeping, "_judged", coarse)
    monkeypatch.setattr(sweeping, "_scored", finer)
    made = swept(tmp_path, [7.5, 8.0, 8.5, 9.0], design=design)
    assert asked == [(8.0, setting), (8.5, setting), (9.0, setting)]
    assert [row.refined for row in made.rows] == ["", setting, setting, setting]
    assert {row.score["verdict"] for row in made.rows} == {"CONTIGUOUS"}
    assert any(line.startswith("8.0, 8.5, 9.0: ") and f"--{setting}" in line for line in made.lines())
    assert [row["refined"] for row in csv.DictReader(made.to_csv().splitlines())] == ["", *[setting] * 3]
    asked.clear()
    assert not any(row.refined for row in swept(tmp_path, [7.5, 8.0, 8.5], design=design, fine=True).rows)
    assert asked == []


def test_a_row_is_the_same_after_a_file():
    row = sweep_row(PAIR, 8.0, contiguous_score(PAIR))
    assert SweepRow.from_json(json.loads(json.dumps(row.to_json()))) == row
    nothing = sweep_row(PAIR, 8.0, out_of_scope_score(PAIR))
    assert SweepRow.from_json(json.loads(json.dumps(nothing.to_json()))) == nothing


def test_an_interrupted_sweep_goes_on_where_it_stopped(monkeypatch, tmp_path):
    asked = []

    def judge(variant, *_, **__):
        asked.append(variant.cavity.clear_thickness_mm)
        if len(asked) == 2:
            raise KeyboardInterrupt
        return made_up(variant)

    monkeypatch.setattr(sweeping, "_judged", judge)
    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path, [8.0, 8.5, 10.0])
    made = swept(tmp_path, [8.0, 8.5, 10.0])
    assert asked == [8.0, 8.5, 8.5, 10.0]
    assert made.taken_up == 1
    assert "1 of 3" in made.lines()[-1]


@pytest.mark.parametrize("other", [{"seed": 1}, {"fine": True}])
def test_another_sweep_never_takes_up_the_values_of_this_one(judged, tmp_path, monkeypatch, other):
    monkeypatch.setattr(FinishedWork, "forget", lambda self: None)
    swept(tmp_path, [8.0])
    swept(tmp_path, [8.0], **other)
    assert judged == [8.0, 8.0]


def test_a_finished_piece_that_was_cut_short_is_worked_again(tmp_path):
    kept = FinishedWork(tmp_path, "x.sweep", [1])
    kept.put("a", {"n": 1})
    kept.put("b", {"n": 2})
    kept.path.write_text(kept.path.read_text(encoding="utf-8")[:-8], encoding="utf-8")
    again = FinishedWork(tmp_path, "x.sweep", [1])
    assert again.get("a") == {"n": 1}
    assert again.get("b") is None
    again.put("b", {"n": 3})
    assert FinishedWork(tmp_path, "x.sweep", [1]).get("b") == {"n": 3}


def test_loads_at_the_modes_carry_the_band_of_the_modulus(judged, tmp_path):
    row = swept(tmp_path, [8.0]).rows[0]
    load, low, high = row.forces_n["mode1_end"]
    assert (low / load, high / load) == pytest.approx((0.66, 1.49), rel=1e-3)  # the catalogue's band at 20:1


def test_an_open_boundary_has_no_load(tmp_path):
    score = dead_score(PAIR)
    pair = score.pairs[0]
    modes = replace(pair.score.modes, mode2_mm=(None, None), gap_mm=None, gap_at_least_mm=4.0)
    never = replace(score, pairs=(replace(pair, score=replace(pair.score, modes=modes)), *score.pairs[1:]))
    row = sweep_row(PAIR, 12, never)
    assert row.forces_n["mode2_onset"] is None
    sweep = Sweep(
        field=THICKNESS, rows=(row,), figures=(figures_of(PAIR, row.score),), taken_up=0, folder=tmp_path
    )
    assert "None" not in sweep.to_csv()


def test_categories_are_swept_too(judged, tmp_path, capsys):
    command = [
        "sweep",
        "piacenza2017-pair",
        "receivers.part=osram-sfh206k,generic-receiver",
        "--out",
        str(tmp_path),
    ]
    assert main([*command, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["value"] for row in rows] == ["osram-sfh206k", "generic-receiver"]


def test_whole_numbers_stay_whole(judged, tmp_path, capsys):
    command = ["sweep", "piacenza2017-pair", "layout.0.count=1:3:1", "--out", str(tmp_path), "--json"]
    assert main(command) == 0
    assert [row["value"] for row in json.loads(capsys.readouterr().out)["rows"]] == [1, 2, 3]


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ("cavity.clear_thicknes_mm=7,8", "did you mean cavity.clear_thickness_mm"),
        ("cavity.clear_thickness_mm=8,8", "is given twice"),
        ("cavity.clear_thickness_mm=8,,9", "value between commas"),
        ("cavity.clear_thickness_mm=9:8:1", "A up to B"),
        ("cavity.clear_thickness_mm=thick,9", "must be a number"),
        ("receivers.part=osram-sfh206", "osram-sfh206k"),
    ],
)
def test_a_bad_sweep_is_refused_before_anything_is_computed(judged, tmp_path, capsys, field, words):
    assert main(["sweep", "piacenza2017-pair", field, "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert judged == []
    assert not (tmp_path / "out").exists()


@pytest.mark.full
def test_a_softer_mix_moves_loads_and_no_depth(tmp_path, capsys):
    command = [
        "sweep",
        "piacenza2017-pair",
        "elastomer.mixing_ratio=5:30:5",
        "--out",
        str(tmp_path),
        "--json",
    ]
    assert main(command) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["value"] for row in rows] == [5, 10, 15, 20, 25, 30]
    onsets = [row["pairs"][0]["mode2_mm"][0] for row in rows]
    ends = [row["pairs"][0]["mode1_mm"][1] for row in rows]
    # the index differs by up to 0.012 between the tables of the ratios, which is worth under 0.01 mm of depth
    assert max(onsets) - min(onsets) < 0.01
    assert max(ends) - min(ends) < 0.01
    loads = [row["mode_forces_n"]["mode2_onset"] for row in rows]
    # E = 20 MPa / ratio (Wang 2014), and load is proportional to E
    assert [load[0] * row["value"] for load, row in zip(loads, rows, strict=True)] == pytest.approx(
        [loads[0][0] * 5] * 6, rel=0.01
    )
    assert all(low < load < high for load, low, high in loads)


@pytest.mark.slow
def test_a_built_set_has_a_bundle_a_value_with_its_mold_marked(tmp_path, capsys, monkeypatch):
    def judge(design, **_):
        return replace(made_up(design), pad_signals=None)

    monkeypatch.setattr("optopad.sims.score.scoring.score", judge)  # the bundle is what is tested here
    command = ["sweep", "piacenza2017-pair", f"{THICKNESS}=9", "--build", "--out", str(tmp_path), "--json"]
    assert main(command) == 0
    document = json.loads(capsys.readouterr().out)
    for folder, row in zip(document["bundles"], document["rows"], strict=True):
        bundle = tmp_path / folder
        design = load_design(bundle / "design.toml")
        assert design.mold.label == str(row["value"])
        assert design.digest == row["digest"]
        assert json.loads((bundle / "cad" / "checks.json").read_text(encoding="utf-8"))["ok"]
        assert (bundle / "report.html").is_file()
