"""The main job on the pair preset, once with made-up physics and once whole: its bundle is complete or absent."""

import hashlib
import json
import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest
import trimesh
import xarray as xr

from optopad.bundle_parts import CONTACT_PLOTS, answer_parts
from optopad.cli import main
from optopad.design.errors import OutputError
from optopad.design.io import load_design
from optopad.design.preset import preset
from optopad.fabrication.bundle import altered_files, bundle_name, current_files
from optopad.fabrication.driver_file import load_driver_config
from optopad.report.__main__ import Page
from optopad.verbs.run import run
from tests.sims.made_up_scores import contiguous_score

DESIGN = preset("piacenza2017-pair")

BUNDLE_FILES = {
    "design.toml",
    "manifest.json",
    "report.html",
    "cad/mold.stl",
    "cad/mold.step",
    "cad/mold.3mf",
    "cad/leveling_blade.stl",
    "cad/indenter_tip.stl",
    "cad/checks.json",
    "sims/signals.nc",
    "sims/maps.nc",
    "sims/bounds-location.png",
    "sims/score.json",
    "fabrication/bom.csv",
    "fabrication/wiring.csv",
    "fabrication/wiring.svg",
    "fabrication/casting.md",
    "fabrication/driver.toml",
    "fabrication/firmware/optopad/optopad.ino",
    "fabrication/firmware/optopad/core.c",
    "fabrication/firmware/optopad/config.h",
}

PLOTS = {f"sims/plot-{name}.svg" for name in CONTACT_PLOTS}
OF_THE_LIGHT = {"sims/signals.nc", "sims/maps.nc", "sims/bounds-location.png"}
"""Files of a bundle that need light which was traced, and bounds."""


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("outputs")


def no_step(_stage, _share) -> None:
    pass


@pytest.fixture(scope="module")
def folder(out) -> Path:
    """A whole run, with the models' own score."""
    return run(DESIGN, out=out, seed=0).folder


class Here:
    """In place of another process, with functions that tests have patched."""

    def __init__(self) -> None:
        self.page = Page()

    def begin(self, function: str, *arguments, **settings):
        if function != "prepare":
            getattr(self.page, function)(*arguments, **settings)
        return lambda: None


def make_up_physics(patch: pytest.MonkeyPatch) -> None:
    """Replace the score by a made-up one, and leave out the pictures."""
    patch.setattr("optopad.sims.score.scoring.score", lambda design, **_: contiguous_score(design))
    for also in ("build_tolerance.with_tolerance", "field_steps.with_field_steps", "trials.with_trial"):
        patch.setattr(f"optopad.sims.score.{also}", lambda _design, found, **_: found)
    for verb in ("run", "score"):
        patch.setattr(f"optopad.verbs.{verb}.beside", lambda _module: nullcontext(Here()))
    patch.setattr("optopad.report.sections.early.ray_scene", lambda *_, **__: "no picture in this test")
    patch.setattr("optopad.report.sections.drawings.svg_text", lambda *_: '<svg viewBox="0 0 1 1"></svg>')


@pytest.fixture(scope="module")
def quick(tmp_path_factory) -> Path:
    """A run with a made-up score and without pictures of light, from a folder with modules of names in use."""
    here = tmp_path_factory.mktemp("quick")
    for name in (
        "design.py",
        "signal.py",
    ):  # a folder's name in the checkout, and one of Python's own modules
        (here / name).write_text("raise SystemExit(1)", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(here)
        make_up_physics(patch)
        return here / run(DESIGN, out=Path("outputs")).folder


def names_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_bundle_of_a_made_up_score_holds_every_promised_file_but_those_of_its_light(quick):
    assert BUNDLE_FILES - names_in(quick) == OF_THE_LIGHT
    assert altered_files(quick) == ()


@pytest.mark.slow
def test_the_bundle_holds_every_promised_file(folder):
    assert names_in(folder) >= BUNDLE_FILES


def test_the_bundles_design_has_the_same_digest(quick):
    folder = quick
    assert load_design(folder / "design.toml").digest == DESIGN.digest
    assert folder.name == f"{DESIGN.name}-{DESIGN.digest[:8]}"


def again(made: Path, out: Path, design=DESIGN, *, with_mold: bool = False, **options):
    """A run after another one, in a folder with its bundle. Without `with_mold`, it may not make a mold."""
    if not out.exists():
        shutil.copytree(made.parent, out)
    with pytest.MonkeyPatch.context() as patch:
        make_up_physics(patch)
        if not with_mold:
            patch.setattr("optopad.verbs.run.started", None)
        return run(design, out=out, **options)


def digests_in(folder: Path) -> dict[str, str]:
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names_in(folder)}


def test_a_second_run_makes_nothing(quick, tmp_path):
    made = again(quick, tmp_path / "out")
    assert made.is_current
    assert made.mended == ()
    assert {path: path.stat().st_mtime_ns for path in made.files} == {
        made.folder / name: (quick / name).stat().st_mtime_ns for name in names_in(quick)
    }


def test_files_that_were_edited_or_removed_are_made_again_and_said(quick, tmp_path):
    made = again(quick, tmp_path / "out")
    (made.folder / "sims" / "answer.json").write_text("{", encoding="utf-8")
    (made.folder / "fabrication" / "casting.md").unlink()
    mended = again(quick, tmp_path / "out").mended
    assert sorted(mended) == ["fabrication/casting.md", "sims/answer.json"]
    assert digests_in(made.folder) == digests_in(quick)


def test_a_file_that_a_run_does_not_make_is_not_said_to_be_made_again(quick, tmp_path):
    made = again(quick, tmp_path / "out")
    manifest = json.loads((made.folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["files"]["sims/prediction.json"] = {"sha256": "0" * 64, "bytes": 2, "run": 0}
    (made.folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    (made.folder / "sims" / "prediction.json").write_text("{}", encoding="utf-8")
    (made.folder / "report.html").unlink()
    assert again(quick, tmp_path / "out").mended == ("report.html",)


def test_a_manifest_that_names_files_elsewhere_gives_none(quick, tmp_path):
    folder = again(quick, tmp_path / "out").folder
    part, secret = answer_parts(DESIGN, 0)[1], tmp_path / "secret"
    secret.write_text("not of the bundle", encoding="utf-8")
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["inputs"][part.digest]["files"].append("../../secret")
    record = {"sha256": hashlib.sha256(secret.read_bytes()).hexdigest(), "run": 0, "made_from": part.digest}
    manifest["files"]["../../secret"] = record
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    assert current_files(folder, part) == []


@pytest.mark.slow
def test_a_mold_that_was_edited_is_made_again_alone(quick, tmp_path):
    out = tmp_path / "out"
    stl = again(quick, out).folder / "cad" / "mold.stl"
    stl.write_bytes(b"solid of another program")
    made = again(quick, out, with_mold=True)
    assert (made.mended, made.is_current) == (("cad/mold.stl",), False)
    assert digests_in(made.folder) == digests_in(quick)


def test_electronics_and_gain_take_the_mold_of_the_bundle_before(quick, tmp_path):
    changed = DESIGN.with_(**{"gain.target_counts": 301.0, "board.settle_us": 120})
    made = again(quick, tmp_path / "out", changed)
    assert (made.folder / "cad" / "mold.stl").read_bytes() == (quick / "cad" / "mold.stl").read_bytes()
    assert made.checks["digest"] == changed.digest
    assert altered_files(made.folder) == ()


def drawn_again(patch: pytest.MonkeyPatch) -> set[str]:
    """The names of the plots that are drawn from now on, each as another picture than before."""
    names: set[str] = set()

    def svg(_figure, name):
        names.add(f"sims/plot-{name}.svg")
        return '<svg viewBox="0 0 2 2"></svg>'

    patch.setattr("optopad.report.sections.drawings.svg_text", svg)
    return names


@pytest.mark.parametrize(
    ("changes", "is_taken"),
    [
        ({"gain.target_counts": 301.0}, True),
        ({"board.kind": "teensy-41", "noise.read_noise_counts": 0.4}, True),
        ({"surfaces.wall_reflectance": 0.06}, False),
        ({"measured": ["emitters.height_mm"]}, False),
    ],
)
def test_plots_of_the_contact_are_taken_from_a_bundle_of_other_electronics_and_others_are_drawn(
    quick, tmp_path, changes, is_taken
):
    changed, out = DESIGN.with_(**changes), tmp_path / "out"
    shutil.copytree(quick.parent, out)
    there = PLOTS & names_in(quick)
    assert {"sims/plot-layout.svg", "sims/plot-force.svg", "sims/plot-contact-radius.svg"} <= there
    with pytest.MonkeyPatch.context() as patch:
        make_up_physics(patch)
        names = drawn_again(patch)
        made = run(changed, out=out)
    plots = {name for name in names_in(made.folder) if name.startswith("sims/plot-")}
    assert names == (plots - there if is_taken else plots)
    assert altered_files(made.folder) == ()
    for name in there:
        is_same = (made.folder / name).read_bytes() == (quick / name).read_bytes()
        assert is_same == is_taken, name


def test_a_plot_that_was_edited_is_not_taken_and_is_drawn_again(quick, tmp_path):
    out, changed = tmp_path / "out", DESIGN.with_(**{"gain.target_counts": 301.0})
    made = again(quick, out)
    edited = made.folder / "sims" / "plot-layout.svg"
    edited.write_text("<svg>edited</svg>", encoding="utf-8")
    other = again(quick, out, changed)
    assert (other.folder / "sims" / "plot-layout.svg").read_bytes() == (
        quick / "sims" / "plot-layout.svg"
    ).read_bytes()
    assert again(quick, out).mended == ("sims/plot-layout.svg",)
    assert digests_in(made.folder) == digests_in(quick)


def test_another_seed_is_made_anew(quick, tmp_path):
    assert not again(quick, tmp_path / "out", seed=1).is_current
    assert again(quick, tmp_path / "out", seed=1).is_current
    assert answer_parts(DESIGN, 0, fine=True)[1].digest != answer_parts(DESIGN, 0)[1].digest


@pytest.mark.slow
def test_another_program_makes_all_anew_and_so_does_force(quick, tmp_path, monkeypatch):
    monkeypatch.setattr("optopad.bundle_parts.program_digest", lambda: "another")
    assert not again(quick, tmp_path / "out", with_mold=True).is_current
    assert not again(quick, tmp_path / "out", force=True, with_mold=True).is_current
    assert again(quick, tmp_path / "out").is_current


def test_a_run_after_a_score_makes_the_report_and_the_sheets(quick, tmp_path):
    out = tmp_path / "out"
    folder = again(quick, out).folder
    with pytest.MonkeyPatch.context() as patch:
        make_up_physics(patch)
        for name in ("report.html", "fabrication", "sims"):
            path = folder / name
            path.unlink() if path.is_file() else shutil.rmtree(path)
        assert main(["score", DESIGN.name, "--out", str(out)]) == 0
    assert not (folder / "report.html").exists()
    assert not again(quick, out).is_current
    assert names_in(folder) == names_in(quick)
    assert again(quick, out).is_current
    with pytest.MonkeyPatch.context() as patch:
        make_up_physics(patch)
        assert main(["score", DESIGN.name, "--out", str(out)]) == 0
    assert again(quick, out).is_current  # the score made the page anew, from the same inputs


def test_every_file_states_what_it_was_made_from(quick):
    manifest = json.loads((quick / "manifest.json").read_text(encoding="utf-8"))
    for name, record in manifest["files"].items():
        inputs = manifest["inputs"][record["made_from"]]
        assert name in inputs["files"], name
        if name.startswith("cad/"):
            assert inputs["mold"] == DESIGN.mold_digest, name
        elif name in PLOTS:
            assert inputs["surface"] == DESIGN.surface_digest, name
        else:
            assert inputs["design"] == DESIGN.digest, name


def test_the_screen_of_a_run_that_made_nothing_is_that_of_the_run_before(
    quick, tmp_path, capsys, monkeypatch
):
    again(quick, tmp_path / "out")
    typed = ["run", DESIGN.name, "--out", str(tmp_path / "out")]
    monkeypatch.setattr("optopad.sims.score.scoring.score", None)
    for option in ("--json", "--details", "--seed=0"):
        assert main([*typed, option]) == 0
        said = capsys.readouterr()
        assert "CONTIGUOUS" in said.out
        assert ("up to date" in said.err) == (option != "--json")


def test_the_manifest_names_every_file_with_its_hash(quick):
    folder = quick
    files = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["files"]
    assert set(files) >= BUNDLE_FILES - OF_THE_LIGHT - {"manifest.json"}
    for name, record in files.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == record["sha256"], name
    assert altered_files(folder) == ()


@pytest.mark.slow
def test_the_maps_hold_bounds_and_readings_of_the_same_places(folder):
    with xr.open_dataset(folder / "sims" / "maps.nc") as maps:
        assert maps.counts.dims == ("y", "x", "press_depth", "pair")
        assert maps.location_bound.dims == ("y", "x", "depth")
        assert maps.attrs["design_digest"] == DESIGN.digest
        assert float(maps.counts.sel(pair="E2-R2", x=10.0, y=10.0)[0]) == pytest.approx(
            0.75 * 1023.0, rel=0.01
        )
    bounds = json.loads((folder / "sims" / "score.json").read_text(encoding="utf-8"))["bounds"]
    assert bounds["median_depth_place_known_mm"]["value"] == pytest.approx(0.0038, rel=0.1)


@pytest.mark.slow
def test_the_pair_at_8_mm_is_contiguous_and_its_gap_positive(folder):
    score = json.loads((folder / "sims" / "score.json").read_text(encoding="utf-8"))
    assert score["verdict"] == "CONTIGUOUS"
    assert score["deadband_mm"]["total"] == 0.0
    # the feasibility study, by other code: gap +0.57 mm, evenness 0.23; boundaries are good to 0.05 mm
    assert score["mode_gap_mm"] == pytest.approx(0.57, abs=0.1)
    assert score["evenness"] == pytest.approx(0.23, abs=0.05)
    assert score["worst_pair"] in {pair["pair"] for pair in score["pairs"]}
    assert [pair["pair"] for pair in score["pairs"]] == ["E2-R2", "E1-R1", "E3-R3"]


@pytest.mark.slow
def test_the_photodiodes_height_turns_the_verdict(folder):
    # the feasibility study: the photodiode's height, off by 0.5 mm, flips the verdict at 8 mm
    tolerance = json.loads((folder / "sims" / "score.json").read_text(encoding="utf-8"))["tolerance"]
    assert "receivers.height_mm" in tolerance["flips_verdict"]
    row = next(row for row in tolerance["rows"] if row["path"] == "receivers.height_mm")
    assert row["deadband_mm"][0] > 0.3
    assert row["deadband_mm"][1] == 0.0


@pytest.mark.slow
def test_signals_carry_units_axes_and_provenance(folder):
    with xr.open_dataset(folder / "sims" / "signals.nc", engine="h5netcdf") as signals:
        assert signals.flux.dims == ("state", "emitter", "receiver")
        assert list(signals.emitter.values) == ["E1", "E2", "E3"]
        assert signals.press_depth.attrs["units"] == "mm"
        assert signals.attrs["design_digest"] == DESIGN.digest
        assert float(abs(signals.flux_by_class.sum("path") - signals.flux).max()) < 1e-15


def test_the_driver_config_is_of_this_design_and_knows_its_gain(quick):
    config = load_driver_config(quick / "fabrication" / "driver.toml", digest=DESIGN.digest)
    assert len(config.emitters) == 3
    assert config.gain.counts_per_flux > 0


def test_the_mold_is_watertight(quick):
    assert trimesh.load_mesh(quick / "cad" / "mold.stl").is_watertight


def test_the_page_opens_without_a_network(quick):
    page = (quick / "report.html").read_text(encoding="utf-8")
    assert "CONTIGUOUS" in page
    assert 'src="http' not in page
    assert 'href="http' not in page


def test_the_molds_process_takes_no_module_from_the_current_folder(quick):
    assert (quick.parents[1] / "signal.py").is_file()
    assert json.loads((quick / "cad" / "checks.json").read_text(encoding="utf-8"))["ok"]


def test_a_run_that_fails_late_leaves_the_old_bundle_intact(quick, monkeypatch):
    folder, out = quick, quick.parent
    before = (folder / "manifest.json").read_bytes()

    def full_disk(*_args, **_kwargs):
        raise OSError(28, "No space left on device", str(folder.parent / f".{folder.name}.x"))

    monkeypatch.setattr("optopad.verbs.run.scored", full_disk)
    with pytest.raises((OutputError, OSError)):
        run(DESIGN, out=out, force=True)
    assert (folder / "manifest.json").read_bytes() == before
    assert altered_files(folder) == ()
    assert [path.name for path in out.iterdir()] == [bundle_name(DESIGN)]


def test_report_finds_the_page_and_notices_a_changed_file(quick, capsys):
    folder = quick
    assert main(["report", str(folder), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["altered"] == []
    table = folder / "fabrication" / "bom.csv"
    original = table.read_bytes()
    table.write_bytes(original + b"x")
    main(["report", str(folder), "--json"])
    assert json.loads(capsys.readouterr().out)["altered"] == ["fabrication/bom.csv"]
    table.write_bytes(original)


def test_a_bundle_is_accepted_where_a_design_is(quick, capsys):
    assert main(["check", str(quick), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["digest"] == DESIGN.digest
