"""The page: complete, self-contained, safe against what a design file says, and the same each time."""

from __future__ import annotations

import re
import shutil
import struct
from collections import Counter
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from optopad.cad.mesh import mold_picture
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.report.page import write_report
from optopad.report.sections.closing import WRITTEN_LAST
from optopad.report.sections.drawings import drawings_of, shown_pairs
from optopad.report.sections.load import force_section
from optopad.report.words import governing, ranked
from optopad.screen.verdict import answer_of
from optopad.screen.verdict_sentences import fix_words, sentences_of, tool_words
from optopad.sims.contact.force_curve import PIACENZA_2017, published_load
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.trial import Move, Trial, TriedMove
from tests.optopad.report.page_reader import Page
from tests.said import says
from tests.sims.made_up_scores import (
    CHECKS,
    WARNINGS,
    dead_score,
    made_up_force,
    out_of_scope_score,
)

PAD = preset("piacenza2017-pad")
PAIR = preset("piacenza2017-pair")
LARGEST_PAGE = 8_000_000
"""What a mail still takes; pages of the presets are 0.6 to 1.3 MB."""


def written(folder: Path, design: SensorDesign, score: ContinuityScore) -> str:
    folder.mkdir(exist_ok=True)
    return write_report(design, folder, score, CHECKS, seed=7).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    (folder / "cad").mkdir()
    (folder / "cad" / "mold.stl").write_bytes(tetrahedron_stl())
    (folder / "cad" / "mold.png").write_bytes(mold_picture(folder / "cad" / "mold.stl"))
    (folder / "fabrication").mkdir()
    (folder / "fabrication" / "wiring.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    written(folder, PAD, dead_score())
    return folder


@pytest.fixture(scope="module")
def text(bundle: Path) -> str:
    return (bundle / "report.html").read_text(encoding="utf-8")


def tetrahedron_stl() -> bytes:
    corners = ((0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10))
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    rows = [
        struct.pack("<12fH", 0, 0, 0, *(value for k in face for value in corners[k]), 0) for face in faces
    ]
    return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)


@pytest.fixture
def pair_bundle(undrawn: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pair's page without ink on its plots."""
    folder = tmp_path_factory.mktemp("pair")
    written(folder, PAIR, dead_score(PAIR))
    return folder


def test_the_page_says_verdict_design_digest_and_seed(text: str) -> None:
    said = Page(text).text
    assert "DEADBAND" in said
    assert PAD.name in said
    assert PAD.digest in said
    assert "seed 7" in said


def test_the_page_carries_every_warning_and_the_values_it_rests_on(text: str) -> None:
    said = Page(text).text
    assert [warning for warning in WARNINGS if warning not in said] == []
    assert "Depends on 4 unmeasured parameters" in said
    assert "receivers.height_mm" in said


def test_the_page_needs_nothing_from_outside(text: str) -> None:
    page = Page(text)
    assert [value for name in ("src", "srcset", "data", "action") for value in page.values(name)] != []
    assert all(value.startswith("data:image/") for value in page.values("src"))
    without_names = re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert re.findall(r"https?://|//\w+\.\w+|@import|url\(\s*['\"]?(?!#)", without_names) == []
    assert page.tags["link"] == page.tags["iframe"] == 0
    assert [value for tag, name, value in page.attributes if (tag, name) == ("script", "src")] == []
    assert len(text.encode()) < LARGEST_PAGE


def test_links_lead_to_parts_of_the_page_or_to_files_of_the_bundle(text: str, bundle: Path) -> None:
    page = Page(text)
    places = set(page.values("id"))
    links = [value for tag, name, value in page.attributes if (tag, name) == ("a", "href")]
    assert [link for link in links if link.startswith("#") and link[1:] not in places] == []
    names = [link for link in links if not link.startswith("#")]
    assert [name for name in names if urlsplit(name).scheme or urlsplit(name).netloc] == []
    assert [name for name in names if not (bundle / name).is_file() and name not in WRITTEN_LAST] == []
    assert {"cad/mold.stl", "fabrication/wiring.svg", "sims/plot-force.svg", "design.toml"} <= set(names)


def test_no_identifier_is_used_twice_but_shared_shapes_of_plots(text: str) -> None:
    counts = Counter(value for _, name, value in Page(text).attributes if name == "id")
    assert [value for value, count in counts.items() if count > 1] == []


def test_every_image_says_what_it_shows(text: str) -> None:
    page = Page(text)
    assert all(page.values("alt"))
    assert len(page.values("alt")) == page.tags["img"] == 2
    drawn_by_script = 4  # curves, plan, map, profile: the script titles them as it draws them
    assert page.tags["title"] == 1 + page.tags["svg"] - drawn_by_script
    images = [tag for tag, name, value in page.attributes if (name, value) == ("role", "img")]
    assert Counter(images) == {"svg": page.tags["svg"], "canvas": 1}
    assert page.tags["svg"] == 16 + drawn_by_script


def test_plots_are_files_of_the_bundle_too(bundle: Path) -> None:
    names = sorted(path.name for path in (bundle / "sims").iterdir())
    score = dead_score()
    order = ranked(score)
    shown = {order[0].name, order[len(order) // 2].name, order[-1].name}
    assert {name for name in names if name.startswith("plot-signal-")} == {
        f"plot-signal-{name}.svg" for name in shown
    }
    assert {"plot-pairs.svg", "plot-map-deadband.svg", "plot-map-margin.svg", "plot-tolerance-gap.svg"} <= {
        *names
    }


def require_equal_bytes(design: SensorDesign, bundle: Path, folder: Path) -> None:
    for part in ("cad", "fabrication"):
        if (bundle / part).is_dir():
            shutil.copytree(bundle / part, folder / part)
    (folder / "report.html").write_text("an earlier page")
    assert written(folder, design, dead_score(design)) == (bundle / "report.html").read_text(encoding="utf-8")
    for plot in (bundle / "sims").iterdir():
        assert (folder / "sims" / plot.name).read_bytes() == plot.read_bytes()


@pytest.mark.slow
def test_equal_input_gives_equal_bytes(bundle: Path, tmp_path: Path) -> None:
    require_equal_bytes(PAD, bundle, tmp_path)


@pytest.mark.usefixtures("undrawn")
def test_what_a_design_says_stays_text(tmp_path: Path) -> None:
    attack = "<script>alert(1)</script> & \"quotes\" 'single' $style"
    design = PAD.with_(description=attack)
    page = written(tmp_path, design, out_of_scope_score(design))
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &#34;quotes&#34;" in page
    assert attack in Page(page).text


@pytest.mark.usefixtures("undrawn")
def test_reasons_and_warnings_stay_text(tmp_path: Path) -> None:
    bad = "<img src=x onerror=alert(1)>"
    page = written(tmp_path / "a", PAD, replace(out_of_scope_score(), reason=bad))
    assert bad in Page(page).text
    assert bad not in page
    page = written(tmp_path / "b", PAD, replace(out_of_scope_score(), warnings=(bad,)))
    assert bad in Page(page).text
    assert bad not in page


def test_a_design_out_of_scope_gets_a_page_with_the_reason(tmp_path: Path) -> None:
    score = out_of_scope_score()
    page = Page(written(tmp_path, PAD, score))
    assert "OUT OF MODEL SCOPE" in page.text
    assert score.reason in page.text
    assert page.tags["svg"] == 1  # the layout
    assert page.tags["img"] == 0
    assert {"signals", "map", "tolerance", "force"} & set(page.values("id")) == set()
    assert {"sensor", "mold", "warnings", "limits", "files", "origin"} <= set(page.values("id"))


def test_plots_of_an_earlier_verdict_do_not_stay(tmp_path: Path) -> None:
    (tmp_path / "sims").mkdir()
    (tmp_path / "sims" / "plot-map-deadband.svg").write_text("of an earlier verdict")
    (tmp_path / "sims" / "signals.nc").write_bytes(b"kept")
    written(tmp_path, PAIR, out_of_scope_score(PAIR))
    assert sorted(path.name for path in (tmp_path / "sims").iterdir()) == ["plot-layout.svg", "signals.nc"]


def test_facing_rows_show_every_facing_pair(pair_bundle: Path) -> None:
    score = dead_score(PAIR)
    said = Page((pair_bundle / "report.html").read_text(encoding="utf-8")).text
    assert [pair.name for pair in score.pairs] == ["E2-R2", "E1-R1", "E3-R3"]
    for pair in score.pairs:
        assert (pair_bundle / "sims" / f"plot-signal-{pair.name}.svg").is_file()
    start, end = score.pairs[0].score.deadbands_mm[0]
    words = f"E2-R2 does not resolve {start:.2f} to {end:.2f} mm; the 2 other pairs have deadbands, too."
    assert words in said


def test_the_plots_of_a_pad_follow_its_governing_pair() -> None:
    score = dead_score()
    other = replace(score, governing="E3-R5")
    assert governing(other).name == "E3-R5"
    roles = {pair.name: role for pair, role in shown_pairs(other)}
    order = ranked(score)
    assert roles == {
        "E3-R5": "longest deadband of the pairs that never clip",
        order[0].name: "worst pair",
        order[len(order) // 2].name: "median pair",
        order[-1].name: "best pair",
    }


@pytest.mark.usefixtures("undrawn")
def test_a_tolerance_without_any_mode_gap_has_no_plot_of_it() -> None:
    score = dead_score(PAIR)
    assert score.tolerance is not None
    rows = tuple(replace(row, gap_mm=(None, None)) for row in score.tolerance.rows)
    never = replace(score, tolerance=replace(score.tolerance, rows=rows, gap_mm=None))
    assert "tolerance-deadband" in drawings_of(PAIR, never)
    assert "tolerance-gap" not in drawings_of(PAIR, never)


def test_the_governing_pair_is_the_middle_facing_one_or_a_pads_worst() -> None:
    assert governing(dead_score(PAIR)).name == "E2-R2"
    pad = dead_score()
    assert governing(pad).score.deadband_total_mm == max(pair.score.deadband_total_mm for pair in pad.pairs)


def test_the_published_load_is_shown_for_the_papers_press_only(text: str) -> None:
    assert published_load(PAD) is PIACENZA_2017
    assert published_load(PAD.with_(**{"cavity.clear_thickness_mm": 9.0})) is None
    assert published_load(PAD.with_(**{"elastomer.mixing_ratio": 10.0})) is None
    said = Page(text).text
    assert "0.6 mm corresponds to about 2 N" in said
    load = 3.3 * 0.6**1.5
    assert f"Computed at 0.6 mm: {load:.2f} N, {1 - load / 2:.0%} below the stated 2 N" in said
    assert "inside the band" in said


@pytest.mark.usefixtures("undrawn")
def test_press_and_retract_are_drawn_only_for_a_pad_whose_load_relaxes(text: str) -> None:
    assert "same load: relaxation" in Page(text).text
    press_only = replace(dead_score(), pairs=(), pad_map=None, tolerance=None)
    assert "load-protocol" not in drawings_of(PAD, press_only)
    relaxing = PAD.with_(
        **{"elastomer.viscoelastic.relaxed_share": 0.2, "elastomer.viscoelastic.time_constant_s": 5.0}
    )
    drawings = drawings_of(relaxing, press_only)
    assert {"load-protocol", "load-time"} <= set(drawings)
    said = Page(force_section(relaxing, press_only, drawings)).text
    assert says(said, "20% of ... of 5 s")
    shallow = replace(press_only, force=made_up_force(3.0))
    assert "load-protocol" not in drawings_of(relaxing, shallow)
    assert "deeper than operating.max_depth_mm: not drawn" in Page(force_section(relaxing, shallow, {})).text


def test_mold_checks_are_listed_with_what_is_wrong_first(text: str) -> None:
    said = Page(text).text
    rows = [said.index(finding["name"]) for finding in CHECKS["findings"]]
    assert rows[2] < rows[0] < rows[1]
    assert says(said, "3 checks ... 0 errors ... 1 warning")


LOWER = Move(path="receivers.height_mm", parts="R1-R8", was=6.0, to=5.1)
MORE = Move(path="layout.0.parts_per_side", parts="", was=4, to=5)
FOUND = Trial(
    kind="deadband",
    found="move",
    moves=(LOWER,),
    verdict="CONTIGUOUS",
    deadband_mm=0.0,
    usable_mm=5.0,
    margin=6.24,
    judged="all 25 locations, coarse light",
    searched="the pad at x 16, y 16 mm",
    tried=(TriedMove(changes={LOWER.path: 5.1}, deadband_mm=0.0, usable_mm=5.0, margin=6.5),),
    farthest_mm=0.9,
    more_parts_tried=False,
)


def test_the_next_command_makes_the_move_that_helps():
    command = "pad.toml --set receivers.height_mm=6"
    lines = answer_of(PAD, replace(dead_score(), trial=FOUND), "").lines([], command=command)
    said = " ".join(" ".join(lines).split())
    assert (
        "next optopad score pad.toml --set receivers.height_mm=5.1 "
        "(moves R1-R8; trial: CONTIGUOUS to 5 mm, margin 6.2 sigma)"
    ) in said
    assert sentences_of(PAD, replace(dead_score(), trial=FOUND)).fix == fix_words(FOUND)
    more = replace(FOUND, found="more parts", moves=(MORE,))
    lines = answer_of(PAD, replace(dead_score(), trial=more), "").lines([], command="pad.toml")
    assert "optopad improve pad.toml --more-parts" in " ".join(" ".join(lines).split())


@pytest.mark.parametrize(
    ("path", "within", "words"),
    [
        ("receivers.height_mm", 0.2, " with a calliper"),
        ("receivers.height_mm", 0.022, "30 presses"),
        ("receivers.height_mm", 0.012, "measuring microscope"),
        ("receivers.height_mm", 0.004, "measuring microscope"),
        ("part_measurements.x.active_height_mm", 0.35, " with a measuring microscope"),
        ("elastomer.refractive_index", 0.004, " with an Abbe refractometer"),
        ("surfaces.wall_reflectance", 0.004, "30 presses"),
        ("elastomer.youngs_modulus_mpa", 0.1, ""),
    ],
)
def test_the_tool_is_one_that_resolves_what_must_be_known(path, within, words):
    assert words in tool_words(path, within)
