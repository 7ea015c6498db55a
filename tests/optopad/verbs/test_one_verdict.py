"""One figure for one thing: verdict and usable depth of a design are the same wherever they are told."""

from __future__ import annotations

from typing import Any

import pytest

import optopad
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import CLEAR
from optopad.screen.sweep import table_row
from optopad.sims.score.objective import judge
from optopad.sims.score.result import ContinuityScore
from optopad.sims.score.scoring import score, verdict_of
from optopad.studio.session import LivePress
from optopad.studio.workshop import LiveVerdict
from optopad.verbs.compare import compare
from optopad.verbs.sweep import sweep
from tests.optopad.studio.test_workshop import Answers, Request, working

ROW = preset("piacenza2017-pair").with_(
    **{
        "layout": [{"pattern": "facing_rows", "count": 1}],
        "operating.max_depth_mm": 2.5,
        "receivers.height_mm": 7.0,
        "emitters.height_mm": 7.0,
    }
)
PAD = preset("fingertip-16").with_(
    **{"layout": [{"pattern": "alternating_ring", "parts_per_side": 2}], "operating.max_depth_mm": 0.8}
)


def told(found: ContinuityScore) -> tuple[Any, ...]:
    document = found.to_json()
    return document["verdict"], document["usable_depth_mm"], document["deadband_mm"]["total"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "design", [pytest.param(ROW, marks=pytest.mark.full), PAD], ids=["facing row", "pad"]
)
def test_verdict_and_usable_depth_are_equal_wherever_they_are_told(design: SensorDesign, tmp_path):
    expected = told(score(design, tolerance=False))
    assert expected[1] is not None
    clear = design.cavity.clear_thickness_mm
    other = design.with_(name="other")

    found = {
        "improve": told(verdict_of(design)),
        "python": (
            (one := optopad.score(design)).verdict,
            one.to_dict()["usable_depth_mm"],
            one.to_dict()["deadband_mm"]["total"],
        ),
        "studio": told(studio_score(design)),
    }
    swept = sweep(design, CLEAR, [clear], out=tmp_path)
    cells = table_row(swept.rows[0])
    found["sweep"] = (cells["verdict"], cells["usable_depth_mm"], cells["deadband_mm"])
    compared = compare({"a": design, "b": other}, out=tmp_path)
    figures = {one.name: one.values[0] for one in compared.measures}
    found["compare"] = (compared.rows[0].score["verdict"], figures["usable"], figures["deadband"])
    searched = judge(design, (), wanted=("verdict", "usable_depth_mm"), accuracy="score")
    found["explore"] = (
        searched.verdict,
        searched.figures["usable_depth_mm"],
        searched.figures["deadband_mm"],
    )
    plain = {
        name: (verdict, round(usable, 4), round(dead, 4)) for name, (verdict, usable, dead) in found.items()
    }
    verdict, usable, dead = expected
    assert plain == dict.fromkeys(found, (verdict, round(usable, 4), round(dead, 4)))


def studio_score(design: SensorDesign) -> ContinuityScore:
    """The score that the studio shows once the design rests."""
    with working() as (shop, answers):
        assert isinstance(answers, Answers)
        shop.want(
            Request(
                design=design,
                press=LivePress(
                    x_mm=design.cavity.length_mm / 2, y_mm=design.cavity.width_mm / 2, depth_mm=0.5
                ),
            )
        )
        place = answers.wait(lambda one: isinstance(one, LiveVerdict) and one.level == "score")
        found: ContinuityScore = answers.all[place].score
        return found
