"""What a small step of each field changes: against the whole score, and the order it puts fields in."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import optopad.sims.score.judge as stages
from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.sims.bounds.observability import MANY_PAIRS_BOUNDS
from optopad.sims.contact.indentation import force_in_advance, solved_press, wall_findings
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.score.cost import score_cost
from optopad.sims.score.field_steps import STEPS, stepped_fields, with_field_steps
from optopad.sims.score.judge import MANY_PAIRS, SETTINGS, Judge
from optopad.sims.score.scoring import score
from optopad.sims.verdict.presses import MAP_ACCURACY
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


SIZED_PAD = preset("piacenza2017-pad")


class AskedError(Exception):
    """Ends the map once its light is asked for."""


@pytest.fixture
def asked(monkeypatch):
    found = {}

    def never_traced(_design, places_mm, depth_mm, *, accuracy, **_rest):
        found.update(places=len(places_mm), depths=len(depth_mm), accuracy=accuracy)
        raise AskedError

    monkeypatch.setattr(stages, "map_light", never_traced)
    return found


@pytest.mark.parametrize(
    ("settings", "places", "fewest_depths", "accuracy"),
    [
        ("score", 25, 26, MAP_ACCURACY),
        ("full", 121, 51, MAP_ACCURACY),
        ("fine", 121, 51, ACCURACIES["standard"]),
    ],
)
def test_a_full_map_has_121_places_and_51_depths_at_least(asked, settings, places, fewest_depths, accuracy):
    with pytest.raises(AskedError):
        _ = Judge(Draft.of(SIZED_PAD), settings).pad_map
    assert asked["places"] == places
    assert asked["depths"] >= fewest_depths
    assert asked["accuracy"] == accuracy


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
