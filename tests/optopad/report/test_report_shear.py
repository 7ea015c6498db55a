"""The page's section on sideways load, and the lines of the screen, from made-up figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from optopad.design.preset import preset
from optopad.report.sections.shear import NAME, shear_drawing, shear_of, shear_section
from optopad.screen.shear import shear_lines

DESIGN = preset("gripper-stadium")


def figures(**changed: Any) -> dict[str, Any]:
    """The data of a score of sideways load at three locations and two depths."""
    moved = {
        "off_mm": [[0.01, 0.02]] * 3,
        "moved_mm": [[[0.1] * 4, [0.3] * 4]] * 3,
        "deeper_mm": [[[-0.05] * 4, [0.01] * 4]] * 3,
        "stronger_n": [[[0.2] * 4, [0.2] * 4]] * 3,
    }
    errors = {"location_mm": [0.02, 0.05], "depth_mm": [0.003, 0.01]}
    known = {"location_mm": [0.01, 0.02], "depth_mm": [0.002, 0.01], "pull_n": [0.12, 0.31]}
    return {
        "friction": 1.0,
        "places_mm": [[8.0, 7.0], [12.0, 7.0], [16.0, 7.0]],
        "depth_mm": [0.5, 1.0],
        "pull_n": [0.35, 0.5],
        "shear_mm": [0.3, 0.2],
        "least_pull_n": [[0.2, 0.1], [0.15, None], [0.3, 0.1]],
        "location_times": [[1.5, 1.2], [1.1, None], [1.3, 1.2]],
        "depth_times": [[1.1, 1.0], [1.1, None], [1.3, 1.0]],
        "unmodelled": {"signal-map": moved, "kernel-ridge": moved},
        "map_errors": [
            {"map": name, "is_pulled": is_pulled} | of
            for is_pulled in (False, True)
            for name, of in (("signal-map", errors), ("signal map with shear", known))
        ],
    } | changed


def test_the_screen_says_what_is_resolved_and_what_a_pull_moves():
    text = "\n".join(shear_lines(figures()))
    for words in (
        "0.5 and 1 mm deep at 3 locations, pulled sideways by 0.35 to 0.5 N with a friction of 1",
        "one frame gives the pull within 0.15 N (median; worst 0.3 N), location and depth unknown; "
        "not resolved at 1 of 6",
        "bounds 1.20 times as large for location and 1.10 for depth",
        "unmodelled  0.35 to 0.5 N move what signal-map reports by 0.2 mm, its depth by 0.03 mm and its force by "
        "0.2 N (medians; worst 0.3 mm, 0.05 mm and 0.2 N)",
        "\n            0.35 to 0.5 N move what kernel-ridge reports",
        "location within 0.01 mm in place of 0.02 mm, depth 0.002 in place of 0.003 mm, the pull within 0.12 N",
    ):
        assert words in text
    nothing = {"least_pull_n": [[None, None]] * 3, "location_times": [[None, None]] * 3}
    assert "one frame does not give the pull" in "\n".join(shear_lines(figures(**nothing)))
    assert shear_lines({"refused": "too deep"}) == ["shear       not computed: too deep"]


def test_the_page_has_the_section_if_the_figures_are_there(tmp_path: Path):
    assert shear_of(tmp_path) is None
    assert shear_section(None, {}) == ""
    (tmp_path / "sims").mkdir()
    file = tmp_path / "sims" / "shear.json"
    file.write_text("{}")
    assert shear_of(tmp_path) is None
    file.write_text(json.dumps(figures()))
    found = shear_of(tmp_path)
    assert found is not None
    page = shear_section(found, {NAME: shear_drawing(DESIGN, found)})
    for words in ("How it resolves sideways load", "0.2 (0.3)", "0.12 (0.31)", "<svg", "kernel-ridge"):
        assert words in page
