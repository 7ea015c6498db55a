"""The page's section on two touches, and the lines of the screen, from made-up figures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from optopad.design.preset import preset
from optopad.report.sections.touches import NAME, touches_drawing, touches_of, touches_section
from optopad.screen.touches import touch_lines
from optopad.sims.plots.style import VERMILLION

DESIGN = preset("gripper-stadium")
PLACES = [[8.0, 7.0], [12.0, 7.0], [16.0, 7.0]]
DIRECTIONS = [0.0, 90.0]


def figures(**changed: Any) -> dict[str, Any]:
    """The data of a score of two touches at three locations, in two directions and at two depths; one has no room."""

    def table(shallow: float, deep: float) -> list[Any]:
        rows: list[Any] = [[[shallow, deep], [shallow, deep]] for _ in PLACES]
        rows[2][1] = [None, None]
        return rows

    has_room = [[[one is not None for one in of] for of in row] for row in table(1.0, 1.0)]
    return {
        "two_point_mm": {"median": 4.0, "worst": 4.0},
        "radius_of_tip_mm": 2.0,
        "touching_mm": 4.0,
        "places_mm": PLACES,
        "directions_deg": DIRECTIONS,
        "depth_mm": [0.2, 1.0],
        "has_room": has_room,
        "least_mm": table(4.0, 4.0),
        "is_open": [[[False, False]] * 2] * 3,
        "distance": table(5.0, 30.0),
        "location_mm": table(0.1, 0.05),
        "bound_depth_mm": table(0.01, 0.01),
        "location_times": table(1.3, 1.1),
        "depth_times": table(1.4, 1.2),
    } | changed


def shallow_from(*values: float | None) -> list[Any]:
    """Least separations of the five shallow states with room; the deep ones are those of tips that touch."""
    rest = iter(values)
    return [[[next(rest), 4.0], [next(rest), 4.0] if row < 2 else [None, None]] for row in range(3)]


def test_the_screen_says_where_tips_that_touch_each_other_are_resolved():
    lines = touch_lines(figures())
    assert lines[0] == (
        "touches     two tips of 2 mm radius, equally deep: 0.2 and 1 mm, around 3 locations, in 2 directions"
    )
    assert lines[1].startswith(
        "two points  two tips of 2 mm that touch each other, 4 mm apart, are resolved as two"
    )
    assert lines[1].endswith(" everywhere from 0.2 mm deep")
    assert "by 5 sigma or more; least around (8, 7) mm at 0 degrees, 0.2 mm deep; 3 are needed" in lines[2]
    assert lines[2].startswith("difference  ")
    assert lines[3].endswith(
        "makes the bounds 1.20 times as large for location and 1.30 for depth (medians; worst 1.30 and 1.40)"
    )
    assert len(lines) == 4


@pytest.mark.parametrize(
    ("least", "words"),
    [
        ((4.0, 5.0, 5.5, 6.0, 7.0), "0.2 mm deep: resolved from 5.5 mm (median; worst 7 mm)"),
        (
            (4.0, None, 5.0, None, 7.0),
            "resolved from 5 mm (median of those that are; worst 7 mm); never at 2 of 5 states",
        ),
        ((None,) * 5, "0.2 mm deep: never at 5 of 5 states"),
    ],
)
def test_the_screen_says_from_which_separation_touches_are_resolved(
    least: tuple[float | None, ...], words: str
):
    everywhere, shallow, *_ = touch_lines(figures(least_mm=shallow_from(*least)))[1:]
    assert everywhere.endswith("are resolved as two everywhere from 1 mm deep")
    assert shallow.endswith(words)
    assert shallow.startswith(" " * 12)


def test_the_screen_says_what_a_pad_cannot_do():
    nothing = [[[None, None]] * 2] * 3
    lines = touch_lines(figures(least_mm=nothing, location_times=nothing, depth_times=nothing))
    assert lines[1].startswith("two points  this pad cannot separate two touches")
    assert len(lines) == 2
    unbounded = touch_lines(figures(location_times=nothing, depth_times=nothing))
    assert unbounded[-1].endswith(
        "bounds of location and depth of two tips that touch each other are not resolved"
    )
    some = figures()["depth_times"]
    some[0][0][0] = None
    assert touch_lines(figures(depth_times=some))[-1].endswith("; not resolved at 1 of 10")
    is_open = [[[True, False], [False, False]], *[[[False, False]] * 2] * 2]
    assert (
        "in 1 of 10 states the error of the light model leaves open"
        in touch_lines(figures(is_open=is_open))[-1]
    )
    assert touch_lines({"refused": "too deep"}) == ["touches     not computed: too deep"]


def test_the_page_has_the_section_if_the_figures_are_there(tmp_path: Path):
    assert touches_of(tmp_path) is None
    assert touches_section(None, {}) == ""
    (tmp_path / "sims").mkdir()
    file = tmp_path / "sims" / "touches.json"
    file.write_text("{}")
    assert touches_of(tmp_path) is None
    file.write_text(json.dumps(figures(least_mm=shallow_from(4.0, 5.0, 6.0, None, 7.0))))
    found = touches_of(tmp_path)
    assert found is not None
    drawing = touches_drawing(DESIGN, found)
    page = touches_section(found, {NAME: drawing})
    for words in ("How near two touches may be", "5.5 (7)", "1 of 5", "0 of 5", "30 (30)", "<svg"):
        assert words in page
    everywhere = touches_drawing(DESIGN, figures())
    assert VERMILLION.lower() in drawing.svg
    assert VERMILLION.lower() not in everywhere.svg


def test_a_pad_that_separates_nothing_has_a_page_too():
    nothing = [[[None, None]] * 2] * 3
    found = figures(
        least_mm=nothing, distance=[[[0.0, 0.0]] * 2] * 3, location_mm=nothing, bound_depth_mm=nothing
    )
    page = touches_section(found, {NAME: touches_drawing(DESIGN, found)})
    assert "cannot separate two touches" in page
    assert "5 of 5" in page
