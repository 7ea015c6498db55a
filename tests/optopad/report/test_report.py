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

from design.preset import preset
from design.spec import SensorDesign
from optopad.report.page import write_report
from optopad.report.sections.closing import WRITTEN_LAST
from optopad.report.sections.drawings import drawings_of, shown_pairs
from optopad.report.sections.load import force_section
from optopad.report.sections.published import PIACENZA_2017, compared, published_load
from optopad.report.words import Html, bullets, element, governing, pair_words, ranked, rests_on, table
from optopad.screen.verdict_sentences import sentences_of
from sims.score.result import ContinuityScore
from tests.optopad.report.page_reader import Page
from tests.said import says
from tests.sims.made_up_scores import (
    CHECKS,
    WARNINGS,
    contiguous_score,
    dead_score,
    made_up_depths,
    made_up_force,
    made_up_pair,
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


def test_the_page_names_every_judged_pair(text: str) -> None:
    said = Page(text).text
    pairs = dead_score().pairs
    assert len(pairs) == 36
    assert [pair.name for pair in pairs if said.count(pair.name) < 2] == []  # in the plot and in the table


def test_the_page_carries_every_warning_and_the_values_it_rests_on(text: str) -> None:
    said = Page(text).text
    assert [warning for warning in WARNINGS if warning not in said] == []
    assert "Depends on 4 unmeasured parameters" in said
    assert "receivers.height_mm" in said


def test_the_headline_gives_the_worst_place_and_its_depths(text: str) -> None:
    said = Page(text).text
    assert says(said, "10 of 25 ... 1.20 to 3.10 mm ... 6, 6) mm")
    assert "Deadband 1.90 mm" in said
    assert "36 of 36" in said


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


def test_wide_tables_can_be_scrolled_with_the_keyboard(text: str) -> None:
    page = Page(text)
    the_map = 1
    assert page.values("tabindex") == ["0"] * (page.tags["table"] + page.tags["canvas"] + the_map)


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


def test_equal_input_gives_equal_words_and_tables(pair_bundle: Path, tmp_path: Path) -> None:
    require_equal_bytes(PAIR, pair_bundle, tmp_path)


@pytest.mark.usefixtures("undrawn")
def test_what_a_design_says_stays_text(tmp_path: Path) -> None:
    attack = "<script>alert(1)</script> & \"quotes\" 'single' $style"
    design = PAD.with_(description=attack)
    page = written(tmp_path, design, out_of_scope_score(design))
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;quotes&quot;" in page
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


@pytest.mark.usefixtures("undrawn")
def test_a_contiguous_pad_says_so_and_has_no_deadband_map(tmp_path: Path) -> None:
    said = Page(written(tmp_path, PAD, contiguous_score())).text
    assert says(said, "5 mm at ... 25 locations")
    assert "Deadband 0.00 mm" in said
    assert not (tmp_path / "sims" / "plot-map-deadband.svg").exists()


def test_a_pad_whose_numerical_error_may_hide_a_deadband_is_called_undecided() -> None:
    score = contiguous_score()
    assert "light model may hide" not in sentences_of(PAD, score).confidence
    first, *others = score.pad_map.places
    doubtful = replace(first, depths=made_up_depths(is_open=True))
    pad_map = replace(score.pad_map, places=(doubtful, *others))
    words = sentences_of(PAD, replace(score, is_open=True, pad_map=pad_map)).confidence
    assert says(words, f"{first.x_mm:g}, {first.y_mm:g}) mm ... --fine")


def test_contiguous_facing_pairs_say_so() -> None:
    words = sentences_of(PAIR, contiguous_score(PAIR)).verdict
    assert "to 5 mm" in words


def test_a_facing_pair_beside_the_middle_one_is_named_when_only_it_is_dead() -> None:
    score = contiguous_score(PAIR)
    dead = replace(score.pairs[2], score=made_up_pair(onset_mm=3.0).score)
    words = sentences_of(PAIR, replace(score, verdict="DEADBAND", pairs=(*score.pairs[:2], dead))).verdict
    assert words.startswith("DEADBAND: E3-R3 does not resolve 0.")


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
def test_the_tolerance_of_a_pad_says_that_it_is_of_one_place(tmp_path: Path) -> None:
    score = dead_score()
    assert score.tolerance is not None
    tried = replace(score, tolerance=replace(score.tolerance, judged="the pad at x 6, y 6 mm"))
    said = Page(written(tmp_path, PAD, tried)).text
    assert "location of least" in said
    assert says(said, "x 6, y 6 mm")
    line = rests_on(tried)
    assert line is not None
    assert says(line, "x 6, y 6 mm")


@pytest.mark.usefixtures("undrawn")
def test_a_tolerance_without_any_mode_gap_has_no_plot_of_it() -> None:
    score = dead_score(PAIR)
    assert score.tolerance is not None
    rows = tuple(replace(row, gap_mm=(None, None)) for row in score.tolerance.rows)
    never = replace(score, tolerance=replace(score.tolerance, rows=rows, gap_mm=None))
    assert "tolerance-deadband" in drawings_of(PAIR, never)
    assert "tolerance-gap" not in drawings_of(PAIR, never)


def test_an_open_mode_gap_is_given_as_a_bound() -> None:
    score = dead_score(PAIR)
    never = replace(score.pairs[0], score=made_up_pair(onset_mm=6.0, last_mm=7.0).score)
    opened = replace(score, mode_gap_mm=None, pairs=(never, *score.pairs[1:]))
    least = never.score.modes.gap_at_least_mm
    said = Page(pair_words(opened)).text
    assert says(said, f"2 does ... {least:.2f} mm ... for E2-R2")


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


def test_a_published_load_outside_the_band_is_called_outside() -> None:
    soft = compared(PIACENZA_2017, made_up_force(band=(0.9, 1.1)), 1.0)
    assert not soft.is_in_band
    assert "which is OUTSIDE the band" in soft.words
    assert soft.needed_modulus_mpa == pytest.approx(2.0 / soft.force_n)


def test_the_load_at_the_deepest_press_is_told_with_its_band(text: str) -> None:
    load = 3.3 * 5.0**1.5
    expected = (
        f"The deepest press, 5 mm, takes {load:.3g} N ({0.66 * load:.3g} to {1.49 * load:.3g} N over the band"
    )
    assert expected in Page(text).text


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


@pytest.mark.usefixtures("undrawn")
def test_a_mold_that_cannot_be_printed_says_so(tmp_path: Path) -> None:
    page = write_report(PAD, tmp_path, out_of_scope_score(), {"ok": False, "findings": []}, seed=0)
    assert "NOT be" in page.read_text(encoding="utf-8")


def test_elements_escape_text_and_attributes_once() -> None:
    assert element("p", "a < b", element("b", "&"), title='"') == '<p title="&quot;">a &lt; b<b>&amp;</b></p>'
    assert element("img", src="x", alt=None) == '<img src="x">'
    assert isinstance(bullets(["<"]), Html)


def test_a_tables_first_cells_are_headings() -> None:
    made = table(("a", "b"), [("1", "2")], label="numbers", numeric=(1,))
    assert '<th scope="row">1</th><td class="number">2</td>' in made
    assert 'aria-label="numbers"' in made


@pytest.mark.usefixtures("undrawn")
def test_a_pad_that_fades_says_to_what_depth_and_maps_it(tmp_path: Path) -> None:
    score = contiguous_score()
    first, *others = score.pad_map.places
    faded = replace(score.pad_map, places=(replace(first, depths=made_up_depths(usable_mm=4.3)), *others))
    page = Page(written(tmp_path, PAD, replace(score, pad_map=faded, usable_depth_mm=4.3)))
    assert "To 4.3 of the 5 mm required: " in page.text
    assert "4.30 mm" in page.text
    assert (tmp_path / "sims" / "plot-map-usable.svg").exists()
