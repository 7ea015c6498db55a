"""The paper's thickness experiment: the same assumptions at every thickness, the verdict of each."""

import json

import pytest

from optopad.cli import main

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def row_of(tmp_path_factory):
    out = tmp_path_factory.mktemp("outputs")

    def row(thickness_mm, capsys):
        command = [
            "score",
            "piacenza2017-pair",
            "--set",
            f"cavity.clear_thickness_mm={thickness_mm}",
            "--json",
        ]
        assert main([*command, "--out", str(out)]) == 0
        return json.loads(capsys.readouterr().out)

    return row


@pytest.mark.parametrize("thickness_mm", [7, 8])
def test_thin_pads_have_no_deadband(row_of, thickness_mm, capsys):
    row = row_of(thickness_mm, capsys)
    assert row["verdict"] == "CONTIGUOUS"
    assert row["deadband_mm"]["total"] == 0.0


@pytest.mark.parametrize("thickness_mm", [10, 12])
def test_thick_pads_have_a_deadband_of_a_millimetre_or_more(row_of, thickness_mm, capsys):
    row = row_of(thickness_mm, capsys)
    assert row["verdict"] == "DEADBAND"
    assert row["deadband_mm"]["total"] >= 1.0
    start, end = row["deadband_mm"]["intervals"][0]
    assert start < 1.0 < end


def test_mode_2_is_open_at_12_mm(row_of, capsys):
    assert row_of(12, capsys)["mode_gap_mm"] is None
