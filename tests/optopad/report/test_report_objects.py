"""The page's section on what the pad sees of objects, and the lines of the screen, from made-up figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.preset import preset
from optopad.report.sections.objects import NAME, objects_drawing, objects_of, objects_section
from optopad.screen.held import object_lines
from optopad.sims.held_score import NAMES, standard_objects

DESIGN = preset("gripper-stadium")


def figures(**changed: Any) -> dict[str, Any]:
    """The data of a score of objects at two locations, in which only edge and cylinder are alike."""
    apart = np.full((2, 5, 5), 9.0)
    apart[0, 1, 2] = apart[0, 2, 1] = 2.4
    as_ball = {
        "moved_mm": [0.1, 0.7],
        "deeper_mm": [0.1, 0.3],
        "apart_sigma": [5.0, 6.0],
        "is_beyond": [False, False],
    }
    return {
        "objects": {name: one.words for name, one in standard_objects(1.5).items()},
        "force_n": 0.84,
        "radius_of_tip_mm": 1.5,
        "places_mm": [[12.0, 7.0], [14.0, 7.0]],
        "depth_mm": [[0.5, 0.2, 0.3, 0.15, 0.9]] * 2,
        "apart_sigma": apart.tolist(),
        "edge_turn_deg": [0.7, 1.1],
        "cylinder_radius_mm": [0.15, None],
        "changes_sigma": {name: np.linspace(-30.0, 5.0, 16).reshape(4, 4).tolist() for name in NAMES},
        "as_ball": dict.fromkeys(NAMES, as_ball),
    } | changed


def test_the_screen_says_what_is_alike_known_and_mistaken():
    text = "\n".join(object_lines(figures()))
    for words in (
        "distinct    9 of 10 pairs, location, depth and turn unknown; ",
        "not edge and cylinder (2.4 sigma), less than 3 sigma",
        "turn within 0.7 to 1.1 deg",
        "radius of 1.5 mm within 0.15 mm, but not at 1 of 2 locations",
        "an edge up to 0.7 mm away and +0.1 to +0.3 mm deeper",
    ):
        assert words in text
    clear = figures(apart_sigma=np.full((2, 5, 5), 9.0).tolist(), edge_turn_deg=[None, None])
    text = "\n".join(object_lines(clear))
    assert "all, location, depth and turn unknown; the closest" in text
    assert "one frame does not give its turn" in text


def test_the_screen_says_why_nothing_is_said_of_objects():
    assert object_lines({"refused": "depth: too deep"}) == ["objects     not computed: depth: too deep"]


def test_the_page_has_the_section_if_the_figures_are_there(tmp_path: Path):
    assert objects_of(tmp_path) is None
    assert objects_section(None, {}) == ""
    (tmp_path / "sims").mkdir()
    file = tmp_path / "sims" / "objects.json"
    file.write_text("{")
    assert objects_of(tmp_path) is None
    file.write_text(json.dumps(figures()))
    found = objects_of(tmp_path)
    assert found is not None
    page = objects_section(found, {NAME: objects_drawing(DESIGN, found)})
    for words in (
        "What it sees of objects",
        "0.84 N",
        '<td class="number">2</td>',
        "0.70",
        "+0.10 to +0.30",
        "<svg",
    ):
        assert words in page
