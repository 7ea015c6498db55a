"""A trial: which moves it makes, when it ends, and that only a traced verdict of the whole counts."""

from __future__ import annotations

from dataclasses import replace

import pytest

from optopad.design.preset import preset
from optopad.sims.score import trials
from optopad.sims.score.scoring import score
from optopad.sims.score.trials import ENOUGH_MARGIN, MOST_BRIEFS, with_trial
from optopad.sims.verdict.builds import Brief
from optopad.sims.verdict.causes import Cause
from tests.sims.made_up_scores import contiguous_score, dead_score, out_of_scope_score

PAD, PAIR = preset("piacenza2017-pad"), preset("piacenza2017-pair")
GOOD = trials._Whole(verdict="CONTIGUOUS", deadband_mm=0.0, usable_mm=5.0, margin=6.0, judged="all locations")
BAD = replace(GOOD, verdict="DEADBAND", deadband_mm=0.8, margin=1.0)


def caused(lack="apart", kind="deadband", short_mm=2.0):
    cause = Cause(
        kind=kind, place_mm=(16.0, 16.0), depth_mm=(1.4, 3.1), lack=lack, short_mm=short_mm, witnesses=()
    )
    return replace(dead_score(), causes=(cause,))


def rise_mm(build):
    """How much nearer to the top the components sit than in the preset, on average [mm]."""
    ends = build.emitters.height_mm - 5.0 + build.receivers.height_mm - 6.0
    return 0.5 * ends - (build.cavity.clear_thickness_mm - 8.0)


def tried(monkeypatch, found, *, enough=(0.6, 1.2), whole=lambda _build: GOOD):
    """The trial where a rise of so many mm is enough [mm]."""
    judged = []

    def judge(draft):
        build = draft.design
        judged.append(build)
        is_enough = enough[0] - 1e-9 <= rise_mm(build) <= enough[1] + 1e-9
        return Brief(
            gap_mm=None,
            deadband_mm=0.0 if is_enough else 0.5,
            margin=ENOUGH_MARGIN if is_enough else 1.0,
            usable_mm=5.0,
        )

    monkeypatch.setattr(trials, "_judge_at", lambda *_: ("here", judge))
    monkeypatch.setattr(trials, "_whole_pad", lambda build, _seed: whole(build))
    return with_trial(PAD, found).trial, judged


def test_without_a_cause_that_heights_fix_nothing_is_tried():
    for one in (contiguous_score(), out_of_scope_score(), caused("clipped"), caused("dim")):
        assert with_trial(PAD, one).trial is None


def test_modes_too_far_apart_raise_components_or_thin_the_layer_by_the_least_that_is_enough(monkeypatch):
    trial, judged = tried(monkeypatch, caused())
    assert (trial.found, trial.verdict, trial.judged) == ("move", "CONTIGUOUS", "all locations")
    assert all(rise_mm(build) > 0.0 for build in judged)
    (move,) = trial.moves  # one field before two
    moved = PAD.with_(**{move.path: move.to})
    assert 0.6 <= rise_mm(moved) <= 0.8
    assert len(judged) <= MOST_BRIEFS


def test_light_used_up_lowers_components(monkeypatch):
    trial, judged = tried(monkeypatch, caused("used up"), enough=(-1.2, -0.6))
    assert trial.found == "move"
    assert all(rise_mm(build) < 0.0 for build in judged)


def test_a_cause_without_a_direction_goes_both_ways(monkeypatch):
    trial, judged = tried(monkeypatch, caused("slight", short_mm=None), enough=(-0.9, -0.3))
    assert min(map(rise_mm, judged)) < 0.0 < max(map(rise_mm, judged))
    assert trial.found == "move"
    assert len(judged) <= MOST_BRIEFS


def test_a_move_that_leaves_a_deadband_at_another_location_is_not_offered(monkeypatch):
    trial, _ = tried(monkeypatch, caused(), whole=lambda _build: BAD)
    assert (trial.found, trial.moves, trial.verdict) == ("none", (), None)
    assert trial.more_parts_tried


def test_too_few_components_is_said_only_where_more_help(monkeypatch):
    trial, _ = tried(
        monkeypatch,
        caused(),
        enough=(9.0, 9.0),
        whole=lambda build: GOOD if build.layout[0].parts_per_side == 5 else BAD,
    )
    assert trial.found == "more parts"
    assert [(one.path, one.was, one.to) for one in trial.moves] == [
        ("layout.0.parts_per_side", 4, 5),
        ("layout.0.pitch_mm", None, 6.0),  # evenly spaced, sockets reach into the corners
    ]


def test_where_no_chord_runs_near_more_components_come_first(monkeypatch):
    trial, judged = tried(monkeypatch, caused("none near", short_mm=None))
    assert trial.found == "more parts"
    assert judged == []


def test_the_components_that_move_are_named(monkeypatch):
    trial, _ = tried(monkeypatch, caused(), enough=(1.0, 1.0))
    document = trial.to_json()
    assert document["found"] == "move"
    names = {"receivers.height_mm": "R1-R8", "emitters.height_mm": "E1-E8", "cavity.clear_thickness_mm": ""}
    assert all(one["parts"] == names[one["path"]] for one in document["moves"])
    assert document["tried"]


@pytest.mark.slow
def test_the_score_of_the_moved_pair_says_what_its_trial_says():
    thick = PAIR.with_(**{"cavity.clear_thickness_mm": 10.0})
    trial = with_trial(thick, score(thick, verdict_only=True)).trial
    assert trial.found == "move"
    moved = score(thick.with_(**{one.path: one.to for one in trial.moves}), verdict_only=True)
    assert moved.verdict == trial.verdict == "CONTIGUOUS"
    assert moved.usable_depth_mm == pytest.approx(trial.usable_mm, abs=0.1)
