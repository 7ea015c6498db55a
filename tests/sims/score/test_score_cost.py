"""Time that is told before a score or a run begins."""

from __future__ import annotations

import pytest

from design.preset import preset
from sims.bounds.observability import MANY_PAIRS_BOUNDS
from sims.score.judge import MANY_PAIRS, SETTINGS
from sims.score.scoring import score_cost


def test_a_run_costs_more_than_a_score_and_says_so() -> None:
    dome = preset("fingertip-dome")
    score, run = (score_cost(dome, fine=False, full=False, is_run=is_run) for is_run in (False, True))
    assert run.core_s > score.core_s
    assert run.sentence(2).startswith("run: about")
    assert score.sentence(2).startswith("score: about")


def test_a_dome_costs_more_than_a_disc_with_more_pairs() -> None:
    dome, disc = (
        score_cost(preset(name), fine=False, full=False) for name in ("fingertip-dome", "levi2013-disc")
    )
    assert dome.pairs < disc.pairs
    assert dome.core_s > 1.5 * disc.core_s


@pytest.mark.parametrize("name", ["piacenza2017-pad", "crowned-40x25"])
def test_the_time_is_that_of_the_stages_together(name: str) -> None:
    cost = score_cost(preset(name), fine=False, full=False)
    assert cost.core_s == pytest.approx(sum(cost.stages_s.values()))
    assert {"map", "bounds", "builds"} <= set(cost.stages_s)
    assert all(seconds > 0.0 for seconds in cost.stages_s.values())


def test_hundreds_of_pairs_are_judged_in_the_map_s_steps_and_by_lighter_bounds() -> None:
    for name, row in SETTINGS.items():
        assert row.for_pairs(MANY_PAIRS) is row
        many = row.for_pairs(MANY_PAIRS + 1)
        assert many.step_mm == max(row.step_mm, row.map_step_mm)
        assert (many.bounds == MANY_PAIRS_BOUNDS) == (name in {"score", "full", "fine"})
        assert many.map == row.map
