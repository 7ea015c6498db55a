"""Places that the map's own error leaves open are judged again, by independent halves and finer light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import optopad.sims.score.judge as judging
import optopad.sims.score.judge as stages
from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, direct_path_pairs
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.readings.readout import readout_of
from optopad.sims.score.judge import Judge
from optopad.sims.score.result import margin_caution
from optopad.sims.score.scoring import score
from optopad.sims.verdict.pad_map import PadMap
from optopad.sims.verdict.presses import (
    DOUBT_ACCURACIES,
    MAP_ACCURACY,
    MOST_TRACED_AGAIN,
    SECOND_SEED,
    pair_curves,
)
from tests.sims.made_up_scores import made_up_depths, made_up_map

PAD = preset("piacenza2017-pad")
CAVITY = cavity_of(PAD)
MASK = direct_path_pairs(CAVITY)
UNTOUCHED = 2.4e-3 * MASK
READOUT = readout_of(Draft.of(PAD), UNTOUCHED, MASK)
FAST, SLOW = 0.19, 0.012
"""Share of its untouched light that every pair loses a millimetre: 110 noise units of 48 pairs over 0.3 mm, and 7."""
FROM_MM, TO_MM = 2.0, 3.0
"""Where the first places are slow."""

Calls = list[tuple[object, int, int, float, float]]
Trace = Callable[..., LightSignals]


def traced(slow_places: int, errors: dict[object, float], calls: Calls) -> Trace:
    """A trace with random errors, a share of every signal by the setting; a seed makes them its own."""

    def light(_design, places_mm, depth_mm, *, accuracy, seed, on_step, near=None):
        calls.append((accuracy, seed, len(places_mm), float(depth_mm[0]), float(depth_mm[-1])))
        slow = np.clip(depth_mm - FROM_MM, 0.0, TO_MM - FROM_MM)
        lost = np.where(
            (np.arange(len(places_mm)) < slow_places)[:, None],
            FAST * (depth_mm - slow) + SLOW * slow,
            FAST * depth_mm,
        )
        flux = (1.0 - lost).reshape(-1)[:, None, None] * UNTOUCHED
        error = errors[accuracy]
        chance = np.random.default_rng([seed, len(depth_mm)])
        return LightSignals(
            flux=flux + error * chance.normal(size=flux.shape) * UNTOUCHED,
            by_class={},
            standard_error=error * np.ones_like(flux) * UNTOUCHED,
            presses=np.zeros((len(flux), 3)),
            digest="",
            seed=seed,
        )

    return light


def judged(monkeypatch: pytest.MonkeyPatch, slow: int, *errors: float) -> tuple[PadMap, LightSignals, Calls]:
    """The map of a pad with some slow places, and what was traced, with an error for each setting in turn."""
    calls: Calls = []
    by_setting = dict(zip((MAP_ACCURACY, *DOUBT_ACCURACIES), errors, strict=True))
    for room, name in ((stages, "map_light"), (judging, "pad_light")):
        monkeypatch.setattr(room, name, traced(slow, by_setting, calls))
    judge = Judge(Draft.of(PAD), seed=7)
    judge.readout = READOUT
    return judge.pad_map, judge.pad_signals, calls


def test_a_map_without_doubt_is_traced_once(monkeypatch):
    found, _, calls = judged(monkeypatch, 0, 1e-3, 1e-3, 1e-3)
    assert [call[0] for call in calls] == [MAP_ACCURACY]
    assert not found.is_open
    assert found.usable_depth_mm == PAD.operating.max_depth_mm


def test_a_second_trace_settles_a_few_places_at_the_depths_in_question(monkeypatch):
    found, signals, calls = judged(monkeypatch, 3, 2e-3, 1e-3, 1e-3)
    assert [(call[0], call[2]) for call in calls] == [(MAP_ACCURACY, 25), (MAP_ACCURACY, 3)]
    assert calls[0][1] == 7 != calls[1][1]
    assert FROM_MM - 0.6 <= calls[1][3] < calls[1][4] <= TO_MM + 0.6
    assert found.dead_share == 0.0
    assert not found.is_open
    assert [place.margin < 20.0 for place in found.places] == [True] * 3 + [False] * 22
    # the map's own light, of which bounds take differences, stays one trace
    assert np.allclose(signals.standard_error, 2e-3 * UNTOUCHED)


@pytest.mark.slow
def test_finer_light_is_traced_in_two_halves_while_places_stay_open(monkeypatch):
    found, _, calls = judged(monkeypatch, 3, 6e-3, 6e-3, 3e-4)
    assert [call[0] for call in calls[1:]] == [
        MAP_ACCURACY, DOUBT_ACCURACIES[0], DOUBT_ACCURACIES[0], DOUBT_ACCURACIES[1], DOUBT_ACCURACIES[1],
    ]  # fmt: skip
    assert not found.is_open
    assert found.dead_share == 0.0
    still, _, _ = judged(monkeypatch, 3, 6e-3, 6e-3, 6e-3)
    assert still.is_open
    (words,) = margin_caution(still)
    assert "verdict is undecided" in words


@pytest.mark.slow
def test_no_more_than_so_many_places_are_traced_again(monkeypatch):
    _, _, calls = judged(monkeypatch, MOST_TRACED_AGAIN + 3, 2e-3, 1e-3, 1e-3)
    assert calls[1][2] == MOST_TRACED_AGAIN


def test_a_sure_deadband_settles_the_verdict_and_usable_depth_is_the_least():
    pad = made_up_map(CAVITY, dead_mm=0.0)
    first, second, *others = pad.places
    opened = replace(pad, places=(replace(first, depths=made_up_depths(is_open=True)), second, *others))
    assert opened.is_open
    dead = replace(second, depths=made_up_depths(((1.0, 2.0),)))
    assert not replace(opened, places=(opened.places[0], dead, *others)).is_open
    faded = replace(pad, places=(replace(first, depths=made_up_depths(usable_mm=4.3)), second, *others))
    assert faded.usable_depth_mm == 4.3
    assert faded.dead_share == 0.0
    assert faded.weakest is faded.places[0]
    assert faded.places[0].is_blind(4.4)
    assert not faded.places[0].is_blind(4.2)
    assert margin_caution(pad) == []


@pytest.mark.slow
def test_facing_pairs_in_doubt_are_asked_of_a_second_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """By one trace the outer pairs of the prototype may hide a deadband near contact; two agree that none is."""
    design = preset("piacenza2017-pair")
    found = score(design, verdict_only=True)
    assert any(pair.score.possible_deadbands_mm for pair in found.pairs)
    assert (found.verdict, found.is_open) == ("CONTIGUOUS", False)

    def disagreeing(*given: Any, seed: int, **others: Any) -> Any:
        traced = pair_curves(*given, seed=seed, **others)
        if seed < SECOND_SEED:
            return traced
        return tuple(
            replace(one, total=np.where(one.depth_mm < 1.0, one.total[0], one.total)) for one in traced
        )

    monkeypatch.setattr(stages, "pair_curves", disagreeing)
    assert score(design, verdict_only=True).is_open
