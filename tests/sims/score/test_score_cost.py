"""Time that is told before a score or a run begins."""

from __future__ import annotations

import re

import pytest

from optopad.design.preset import preset
from optopad.sims.bounds.observability import MANY_PAIRS_BOUNDS
from optopad.sims.contact.indentation import force_in_advance, solved_press, wall_findings
from optopad.sims.contact.scope import contact_of
from optopad.sims.score.cost import score_cost
from optopad.sims.score.judge import MANY_PAIRS, SETTINGS
from optopad.sims.score.scoring import score


def test_a_press_that_the_library_does_not_have_costs_minutes() -> None:
    punch = preset("gripper-teensy").with_(**{"indenter.shape": "flat_punch", "operating.max_depth_mm": 0.9})
    assert score_cost(punch)["contact"] > 300.0


def test_walls_that_change_a_punch_too_much_are_known_in_advance() -> None:
    near = preset("gripper-teensy").with_(
        **{
            "indenter.shape": "flat_punch",
            "indenter.tip_radius_mm": 2.5,
            "operating.max_depth_mm": 1.6,
            "operating.workspace_margin_mm": 1.6,
        }
    )
    found = score(near)
    assert found.verdict == "OUT_OF_MODEL_SCOPE"
    assert re.search(
        r"1\.6 mm deep at 4\.1, 4\.1 mm.*raise operating\.workspace_margin_mm to \d", found.reason
    )
    assert [*wall_findings(contact_of(near.with_(**{"operating.workspace_margin_mm": 3.2})))] == []


def test_the_force_in_advance_is_the_librarys_within_a_quarter() -> None:
    pad = preset("piacenza2017-pad")
    press = solved_press(contact_of(pad))
    for depth in (0.1, 0.6, 1.0, 1.6):
        assert force_in_advance(contact_of(pad), depth) == pytest.approx(
            press.smooth.force_at(depth), rel=0.25
        )


def test_hundreds_of_pairs_are_judged_in_the_map_s_steps_and_by_lighter_bounds() -> None:
    for name, row in SETTINGS.items():
        assert row.for_pairs(MANY_PAIRS) is row
        many = row.for_pairs(MANY_PAIRS + 1)
        assert many.step_mm == max(row.step_mm, row.map_step_mm)
        assert (many.bounds == MANY_PAIRS_BOUNDS) == (name in {"score", "full", "fine"})
        assert many.map == row.map
