"""The paper's thickness experiment: the same assumptions at every thickness, and the page that tells of it."""

import csv
import json
import re

import pytest

from optopad.cli import main
from optopad.sims.score.sweep import SweepRow
from tests.validation.verdict.thickness import (
    FIGURE,
    HEAD,
    MIDDLE,
    PAGE,
    PATH,
    TABLE,
    TAIL,
    THICKNESSES_MM,
    findings,
    table,
)

REDUCED = "7.0,8.0,10.0,12.0"
BOUNDARY_MM, DEADBAND_MM = 0.05, 0.15
"""What the depth step and the seed may move a mode boundary and a deadband by: the limits that are asked of them."""


@pytest.fixture(scope="module")
def published() -> dict[float, dict[str, str]]:
    return {float(row[PATH]): row for row in csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines())}


@pytest.fixture(scope="module")
def rows(tmp_path_factory, request) -> dict[float, SweepRow]:
    """The reduced copy, by the command that the page names."""
    capture = request.getfixturevalue("capsys_of_module")
    out = tmp_path_factory.mktemp("outputs")
    with capture() as printed:
        assert main(["sweep", "piacenza2017-pair", f"{PATH}={REDUCED}", "--json", "--out", str(out)]) == 0
    return {row["value"]: SweepRow.from_json(row) for row in json.loads(printed.getvalue())["rows"]}


@pytest.fixture(scope="module")
def capsys_of_module():
    import contextlib
    import io

    return lambda: contextlib.redirect_stdout(io.StringIO())


def test_the_page_tells_of_every_thickness_and_of_its_misses(published):
    page = PAGE.read_text(encoding="utf-8")
    assert tuple(published) == THICKNESSES_MM
    for paragraph in (*HEAD, *MIDDLE, *TAIL):
        assert paragraph in page
    assert re.findall(r"\| (agrees|MISS|open) \|$", page, flags=re.MULTILINE) == [
        "agrees",
        "agrees",
        "agrees",
        "MISS",
        "open",
    ]
    assert FIGURE.is_file()


def test_the_pages_table_is_the_csv_beside_it(published):
    lines = re.findall(
        r"^\| ([0-9.]+) \| [0-9.]+ \| (.*?) to (.*?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    assert [float(thickness) for thickness, _, _ in lines] == list(THICKNESSES_MM)
    for thickness, start, end in lines:
        row = published[float(thickness)]
        assert (float(start), float(end)) == pytest.approx(
            (float(row["mode1_start_mm"]), float(row["mode1_end_mm"])), abs=0.0051
        )


@pytest.mark.full
@pytest.mark.parametrize("thickness_mm", [7.0, 8.0])
def test_thin_pads_have_no_deadband(rows, thickness_mm):
    score = rows[thickness_mm].score
    assert score["verdict"] == "CONTIGUOUS"
    assert score["deadband_mm"]["total"] == 0.0


@pytest.mark.full
@pytest.mark.parametrize("thickness_mm", [10.0, 12.0])
def test_thick_pads_have_a_deadband_of_a_millimetre_or_more(rows, thickness_mm):
    score = rows[thickness_mm].score
    assert score["verdict"] == "DEADBAND"
    assert score["deadband_mm"]["total"] >= 1.0
    start, end = score["deadband_mm"]["intervals"][0]
    assert start < 1.0 < end


@pytest.mark.full
def test_mode_2_is_open_at_12_mm(rows):
    assert rows[12.0].score["mode_gap_mm"] is None


@pytest.mark.full
def test_the_page_holds_what_the_models_say_now(rows, published):
    for thickness, row in rows.items():
        pair, told = row.shown, published[thickness]
        assert told["verdict"] == row.score["verdict"]
        for mode, names in (("mode1", ("start", "end")), ("mode2", ("onset", "end"))):
            for name, found in zip(names, pair[f"{mode}_mm"], strict=True):
                said = told[f"{mode}_{name}_mm"]
                assert (said == "") == (found is None)
                if found is not None:
                    assert float(said) == pytest.approx(found, abs=BOUNDARY_MM)
        dead = sum(end - start for start, end in pair["deadbands_mm"])
        assert float(told["shown_pair_deadband_mm"]) == pytest.approx(dead, abs=DEADBAND_MM)


@pytest.mark.full
def test_the_findings_of_the_reduced_copy_are_those_of_the_page(rows):
    found = findings(tuple(rows.values()))
    assert [one.answer for one in found] == ["agrees", "agrees", "agrees", "MISS", "open"]
    page = PAGE.read_text(encoding="utf-8")
    assert all(one.paper in page for one in found)
    assert len(table(tuple(rows.values()))) == len(rows) + 2
