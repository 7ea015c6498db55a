"""A whole score of two touches on a small pad: its data are in the bundle, and the screen's lines are about them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from optopad.cli.main import main
from optopad.design.preset import preset
from optopad.report.sections.touches import touches_of
from optopad.screen.touches import touch_lines

PAIR = "piacenza2017-pair"


@pytest.mark.full
def test_a_score_says_how_near_two_touches_may_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["score", PAIR, "--touches", "2", "--json", "--out", str(tmp_path)]) == 0
    found = json.loads(capsys.readouterr().out)["touches"]
    (folder,) = tmp_path.glob(f"{PAIR}-*")
    assert touches_of(folder) == found
    radius, two_point = preset(PAIR).indenter.tip_radius_mm, found["two_point_mm"]
    assert found["touching_mm"] == 2.0 * radius
    assert 2.0 * radius <= two_point["median"] <= two_point["worst"] < 3.0 * radius
    distance = np.array(found["distance"], dtype=np.float64)
    assert (np.diff(np.nanmedian(distance, axis=(0, 1))) > 0.0).all()  # clearer the deeper
    assert np.nanmin(distance[..., -1]) > 10.0
    lines = touch_lines(found)
    assert any(
        "that touch each other, 6 mm apart, are resolved as two everywhere from" in one for one in lines
    )
