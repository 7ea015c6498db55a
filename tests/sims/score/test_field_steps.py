"""What a small step of each field changes: against the whole score, and the order it puts fields in."""

from __future__ import annotations

from dataclasses import replace

import pytest

from optopad.design.preset import preset
from optopad.sims.score.field_steps import STEPS, stepped_fields, with_field_steps
from optopad.sims.score.scoring import score
from optopad.sims.verdict.tolerance import AMPLE_MARGIN, Effect, FieldStep, FieldSteps
from tests.sims.made_up_scores import out_of_scope_score

PAIR, PAD = preset("piacenza2017-pair"), preset("piacenza2017-pad")
CLEAR = "cavity.clear_thickness_mm"
BASE = Effect(usable_mm=5.0, deadband_mm=0.0, margin=4.0, location_mm=0.01, depth_mm=0.004)


@pytest.mark.slow
def test_a_step_says_what_the_whole_score_says_of_the_stepped_design():
    """Thicker by 0.5 mm the pair is dead; the brief look and the score agree on it, and on how it is untouched."""
    found = with_field_steps(PAIR, score(PAIR, verdict_only=True)).steps
    assert found.judged == "E2-R2"
    row = next(one for one in found.rows if one.path == CLEAR)
    thick = score(PAIR.with_(**{CLEAR: PAIR.cavity.clear_thickness_mm + 0.5}), verdict_only=True)
    middle = next(pair for pair in thick.pairs if pair.name == "E2-R2")
    assert row.higher.deadband_mm == pytest.approx(middle.score.deadband_total_mm, abs=0.1)
    assert row.higher.deadband_mm > 0.3
    assert found.as_designed.deadband_mm == 0.0
    assert found.as_designed.usable_mm < row.higher.usable_mm <= 5.0  # parts sit lower beneath it
    assert found.better_sides().get(CLEAR) != 1


def test_the_fields_are_those_that_the_design_has():
    assert [path for path, _ in stepped_fields(PAD)] == list(STEPS)
    ohms = PAD.with_(**{"gain.feedback_ohm": 100000.0})
    assert "gain.target_counts" not in dict(stepped_fields(ohms))
    assert "layout.0.pitch_mm" in dict(stepped_fields(PAIR))


def test_out_of_scope_there_is_nothing_to_step():
    assert with_field_steps(PAD, out_of_scope_score()).steps is None


@pytest.mark.parametrize(
    ("change", "gain_mm"),
    [
        ({"usable_mm": 4.0}, -1.0),
        ({"deadband_mm": 0.5}, -0.5),
        ({"margin": 5.0}, 0.1),
        ({"margin": 60.0}, 0.1 * (AMPLE_MARGIN - 4.0)),
        ({"location_mm": 0.001}, 0.0),  # first the margin
    ],
)
def test_depth_counts_first_then_margin(change, gain_mm):
    assert replace(BASE, **change).gain_over(BASE) == pytest.approx(gain_mm)


def test_with_margin_enough_accuracy_counts():
    safe = replace(BASE, margin=9.0)
    assert replace(safe, location_mm=0.01 / 2.718281828).gain_over(safe) == pytest.approx(1.0)
    rows = replace(safe, location_mm=None)  # facing rows: the depth's bound
    assert replace(rows, depth_mm=0.008).gain_over(rows) < 0.0
    blind = replace(safe, location_mm=None)
    assert (blind.gain_over(safe), safe.gain_over(blind), blind.gain_over(blind)) == (-1.0, 1.0, 0.0)


def test_fields_come_in_the_order_of_what_they_gain():
    steps = FieldSteps(
        judged="E1-R1",
        bounds_at_mm=(1.0, 2.0, 3.0),
        as_designed=BASE,
        rows=(
            FieldStep(path="a", step=0.1, lower=replace(BASE, margin=3.0), higher=replace(BASE, margin=5.0)),
            FieldStep(path="b", step=0.1, lower=replace(BASE, margin=5.5), higher=None),
            FieldStep(path="c", step=0.1, lower=replace(BASE, margin=3.5), higher=BASE),
        ),
    )
    assert list(steps.better_sides().items()) == [("b", -1), ("a", 1)]
    document = steps.to_json()
    assert document["fields"][1]["higher"] is None
    assert document["as_designed"]["margin_noise_units"] == 4.0
