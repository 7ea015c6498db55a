"""A verdict in seconds: the draft says what the score says, pair by pair and place by place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import DesignError, ModelScopeError, OptopadError
from optopad.design.preset import FLAT_PRESETS, preset
from optopad.design.shape.cavity import beside_chord, cavity_of, judged_pairs, pair_name
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.observability import pad_bounds
from optopad.sims.contact.indentation import round_press, solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.score import judge as map_judging
from optopad.sims.score.judge import SETTINGS
from optopad.sims.score.objective import curves_under, draft_score, pairs_under, with_draft_bounds
from optopad.sims.score.result import ContinuityScore
from optopad.sims.score.scoring import score
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD

PAD, PAIR = "piacenza2017-pad", "piacenza2017-pair"
MIDDLE = {PAD: (16.0, 16.0), PAIR: (10.0, 10.0)}
CLEAR = "cavity.clear_thickness_mm"


@pytest.fixture(scope="module")
def pair_draft() -> ContinuityScore:
    return draft_score(preset(PAIR))


def same_bits(one: ContinuityScore, other: ContinuityScore) -> bool:
    return one.to_json() == other.to_json()


def test_the_pair_s_draft_is_the_verdict_of_facing_rows_with_figures_of_every_pair(
    pair_draft: ContinuityScore,
) -> None:
    assert pair_draft.is_facing_rows
    assert [pair.name for pair in pair_draft.pairs] == ["E2-R2", "E1-R1", "E3-R3"]  # the governing one first
    assert pair_draft.governing == "E2-R2"
    dead = any(pair.score.deadbands_mm for pair in pair_draft.pairs)
    assert pair_draft.verdict == ("DEADBAND" if dead else "CONTIGUOUS")
    assert pair_draft.deadbands_mm == pair_draft.pairs[0].score.deadbands_mm
    assert pair_draft.digest == preset(PAIR).digest
    assert pair_draft.force is not None
    assert pair_draft.force.depth_mm[-1] == 5.0


def test_the_outer_pairs_of_the_draft_mirror_each_other(pair_draft: ContinuityScore) -> None:
    _, first, last = (pair.curves.total / pair.curves.total[0] for pair in pair_draft.pairs)
    assert first == pytest.approx(last, abs=0.01)


@pytest.mark.parametrize("seed", [0, pytest.param(7, marks=pytest.mark.slow)])
def test_the_same_seed_gives_the_same_bits(seed: int, pair_draft: ContinuityScore) -> None:
    again = draft_score(preset(PAIR), seed=seed)
    assert same_bits(again, pair_draft) == (seed == 0)
    one, other = (curves_under(preset(PAIR), (8.0, 9.0), seed=seed) for _ in range(2))
    for here, there in zip(one.pairs, other.pairs, strict=True):
        assert here.name == there.name
        assert np.array_equal(here.curves.total, there.curves.total)
        assert np.array_equal(here.curves.standard_error, there.curves.standard_error)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        pytest.param({}, "CONTIGUOUS", marks=pytest.mark.slow),
        pytest.param({CLEAR: 10.0}, "DEADBAND", marks=pytest.mark.slow),
        pytest.param({"noise.relative_noise": 0.02}, "DEADBAND", marks=pytest.mark.slow),
    ],
)
def test_the_draft_of_the_pair_says_what_its_score_says(changes: dict[str, float], verdict: str) -> None:
    design = preset(PAIR).with_(**changes)
    found, true = draft_score(design), score(design, verdict_only=True)
    assert found.verdict == true.verdict == verdict
    assert found.governing == true.governing
    assert found.usable_depth_mm == pytest.approx(true.usable_depth_mm, abs=0.1)
    for here, there in zip(found.pairs, true.pairs, strict=True):
        long = [
            span for span in there.score.deadbands_mm if span[1] - span[0] > 0.4
        ]  # a draft may miss 0.3 mm
        assert [span for span in here.score.deadbands_mm if span[1] - span[0] > 0.4] == [
            pytest.approx(span, abs=0.1) for span in long
        ]


@pytest.mark.full
@pytest.mark.parametrize(
    ("changes", "verdict"), [({}, "CONTIGUOUS"), ({CLEAR: 10.0, "noise.relative_noise": 0.01}, "DEADBAND")]
)
def test_the_draft_of_the_pad_says_what_its_score_says(changes: dict[str, float], verdict: str) -> None:
    design = preset(PAD).with_(**changes)
    found, true = draft_score(design), score(design, verdict_only=True)
    assert found.verdict == true.verdict == verdict
    assert found.usable_depth_mm == pytest.approx(true.usable_depth_mm, abs=0.4)
    assert found.pad_map is not None
    assert true.pad_map is not None
    assert (found.pad_map.x_mm, found.pad_map.y_mm) == (true.pad_map.x_mm, true.pad_map.y_mm)


@pytest.mark.full
def test_pairs_far_from_a_place_may_be_left_as_untouched(monkeypatch: pytest.MonkeyPatch) -> None:
    design = preset(PAD)
    found = draft_score(design).pad_map
    monkeypatch.setitem(SETTINGS, "draft", replace(SETTINGS["draft"], near_tips=None))
    whole = draft_score(design).pad_map
    assert found is not None
    assert whole is not None
    margins = np.array(
        [[here.margin, there.margin] for here, there in zip(found.places, whole.places, strict=True)]
    )
    low = margins[:, 1] < 4.0 * DEADBAND_THRESHOLD  # a verdict may depend on them
    assert low.sum() >= 4
    assert np.abs(np.diff(margins[low])).max() < 0.3
    assert np.abs(np.diff(margins)).max() < 8.0


@pytest.mark.full
def test_a_place_that_is_nearly_blind_is_judged_by_finer_light(monkeypatch: pytest.MonkeyPatch) -> None:
    design, stages = preset(PAD).with_(**{CLEAR: 10.0}), set[str]()
    found = draft_score(design, on_step=lambda stage, _share: stages.add(stage))
    assert "open places" in stages
    monkeypatch.setattr(map_judging, "CLOSE_UNITS", 0.0)
    coarse = draft_score(design)
    assert found.pad_map is not None
    assert coarse.pad_map is not None
    margins = [
        (one.margin, other.margin)
        for one, other in zip(found.pad_map.places, coarse.pad_map.places, strict=True)
    ]
    changed = [number for number, (fine, rough) in enumerate(margins) if fine != rough]
    assert changed == [12]  # the middle
    assert np.abs(np.array(margins[12]) - DEADBAND_THRESHOLD).max() < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("clear_mm", [8.0])
def test_draft_bounds_are_near_the_score_s_and_call_no_place_blind_that_is_not(clear_mm: float) -> None:
    design = preset(PAD).with_(**{CLEAR: clear_mm})
    found = draft_score(design)
    bounded = with_draft_bounds(design, found).bounds
    true = pad_bounds(Draft.of(design), places=3, depths_mm=(1.5,), readout=found.readout, with_losses=False)
    assert bounded is not None
    assert np.array_equal(bounded.is_blind, true.is_blind)
    assert bounded.median_location_mm.value == pytest.approx(true.median_location_mm.value, rel=0.05)
    assert bounded.location_mm == pytest.approx(true.location_mm, rel=0.1)


@pytest.mark.slow
def test_bounds_are_added_to_a_pad_s_draft_and_leave_the_rest(pair_draft: ContinuityScore) -> None:
    design = preset(PAD)
    stages: list[str] = []
    found = draft_score(design, on_step=lambda stage, _share: stages.append(stage))
    bounded = with_draft_bounds(design, found, on_step=lambda stage, _share: stages.append(stage))
    assert [stage for stage in dict.fromkeys(stages) if stage != "contact"] == ["map", "bounds"]
    assert bounded.bounds is not None
    assert bounded.bounds.detection is not None
    assert np.isfinite(bounded.bounds.location_mm).all()
    assert bounded.bounds.location_mm.shape == (3, 3, 2)
    assert 0.0 < bounded.bounds.median_location_mm.value < 1.0
    assert same_bits(replace(bounded, bounds=None), found)
    assert with_draft_bounds(preset(PAIR), pair_draft) is pair_draft


@pytest.mark.slow
@pytest.mark.parametrize("name", [PAIR, PAD])
def test_draft_curves_are_within_a_hundredth_of_the_untouched_signal_of_fine_ones(name: str) -> None:
    design = preset(name)
    coarse = curves_under(design, MIDDLE[name])
    fine = curves_under(design, MIDDLE[name], is_draft=False)
    assert (coarse.is_draft, fine.is_draft) == (True, False)
    assert [pair.name for pair in coarse.pairs] == [pair.name for pair in fine.pairs]
    assert len(coarse.pairs) >= 1
    for here, there in zip(coarse.pairs, fine.pairs, strict=True):
        depth_mm, untouched = here.curves.depth_mm, there.curves.total[0]
        assert depth_mm[-1] == there.curves.depth_mm[-1] == design.operating.max_depth_mm
        true = np.interp(depth_mm, there.curves.depth_mm, there.curves.total / untouched)
        assert here.curves.total / here.curves.total[0] == pytest.approx(true, abs=0.01)


def test_curves_tell_their_progress_up_to_the_end() -> None:
    told: list[tuple[str, float]] = []
    curves_under(preset(PAIR), MIDDLE[PAIR], on_step=lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert {stage for stage, _ in told} == {"curves"}
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize("name", FLAT_PRESETS)
def test_pairs_under_the_tip_are_the_nearest_and_no_more_than_eight(name: str) -> None:
    cavity = cavity_of(preset(name))
    space = cavity.workspace
    for share in (0.0, 0.3, 0.5, 1.0):
        place = (
            space.x0_mm + share * (space.x1_mm - space.x0_mm),
            space.y0_mm + share**2 * (space.y1_mm - space.y0_mm),
        )
        found = pairs_under(cavity, place)
        away = {pair: beside_chord(cavity, pair, place)[0] for pair in judged_pairs(cavity)}
        under = [pair for pair in away if away[pair] <= cavity.tip_radius_mm]
        assert len(found) == min(len(under), 8) or (not under and len(found) == min(len(away), 3))
        assert [away[pair] for pair in found] == pytest.approx(sorted(away.values())[: len(found)], abs=1e-6)
        assert len({pair_name(cavity, pair) for pair in found}) == len(found)


@pytest.mark.parametrize(
    "call",
    [
        lambda design: draft_score(design),
        lambda design: curves_under(design, (16.0, 16.0)),
        lambda design: curves_under(design, (16.0, 16.0), is_draft=False),
    ],
    ids=["draft", "curves", "fine curves"],
)
def test_a_design_that_breaks_a_rule_is_refused(call) -> None:
    with pytest.raises(DesignError, match=r"receivers\.height_mm"):
        call(preset(PAD).with_(**{"receivers.height_mm": 8.5}))


@pytest.mark.parametrize("name", [PAD, PAIR])
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"operating.max_depth_mm": 0.2}, "deadband's least length"),
        ({CLEAR: 7.0, "operating.max_depth_mm": 6.0, "receivers.height_mm": 4.0, "emitters.height_mm": 4.0}, "mm"),
    ],
)  # fmt: skip
def test_what_the_models_do_not_cover_is_out_of_their_scope(
    name: str, changes: dict[str, float], words: str
) -> None:
    design = preset(name).with_(**changes)
    found = draft_score(design)
    assert found.verdict == "OUT_OF_MODEL_SCOPE"
    assert words in found.reason
    assert with_draft_bounds(design, found) is found
    with pytest.raises(ModelScopeError, match=words):
        curves_under(design, MIDDLE[name])


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=() if one == PAIR else pytest.mark.slow) for one in FLAT_PRESETS]
)
def test_the_round_press_is_the_whole_one_without_its_own_walls(name: str) -> None:
    design: SensorDesign = preset(name)
    whole, bare = solved_press(contact_of(design)), round_press(contact_of(design))
    assert bare.placed is None
    assert bare.smooth is whole.smooth
    assert (bare.tip_radius_mm, bare.modulus) == (whole.tip_radius_mm, whole.modulus)
    without = replace(whole, placed=None)
    for depth_mm in (0.5, 1.7, design.operating.max_depth_mm):
        here, there = bare.at(depth_mm), without.at(depth_mm)
        assert here.force_n == there.force_n
        assert np.array_equal(here.radius_mm, there.radius_mm)
        assert np.array_equal(here.height_mm, there.height_mm)


@pytest.mark.parametrize("depth_mm", [float("nan"), float("inf"), 7.9])
def test_the_round_press_refuses_the_depths_that_the_whole_one_refuses(depth_mm: float) -> None:
    messages = []
    for press in (round_press, solved_press):
        with pytest.raises(OptopadError) as caught:
            press(contact_of(preset(PAD)), depth_mm)
        messages.append((type(caught.value), str(caught.value)))
    assert messages[0] == messages[1]
