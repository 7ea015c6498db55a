"""Places where the map's own error may hide a deadband are judged again, by finer light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import sims.continuity.scoring as continuity
from design.geometry.cavity import cavity_of
from design.geometry.pairs import direct_path_pairs
from design.preset import preset
from sims.optics.light_signals import LightSignals
from sims.readings.readout import readout_of
from sims.verdict.pad_map import PadMap
from sims.verdict.presses import DOUBT_ACCURACY, MAP_ACCURACY, MOST_TRACED_AGAIN

PAD = preset("piacenza2017-pad")
CAVITY = cavity_of(PAD)
MASK = direct_path_pairs(CAVITY)
UNTOUCHED = 2.4e-3 * MASK
READOUT = readout_of(PAD, UNTOUCHED, MASK)
PER_MM = {"slow": 0.05, "fast": 0.19}
"""Share of its untouched light that every pair loses a millimetre: 4 noise units over 0.3 mm, and 16."""

SLOW_TO_MM = 1.0

Trace = Callable[..., LightSignals]


def traced(slow_places: int, share_error: float, calls: list[tuple[object, int, float]]) -> Trace:
    """A trace under which the first so many places are slow near contact, with an error of every signal."""

    def light(_design, places_mm, depth_mm, *, accuracy, seed, on_step):
        calls.append((accuracy, len(places_mm), float(depth_mm[-1])))
        first = np.where(np.arange(len(places_mm)) < slow_places, PER_MM["slow"], PER_MM["fast"])
        shallow = np.minimum(depth_mm, SLOW_TO_MM)
        left = 1.0 - first[:, None] * shallow - PER_MM["fast"] * (depth_mm - shallow)
        flux = left.reshape(-1)[:, None, None] * UNTOUCHED
        return LightSignals(
            flux=flux,
            by_class={},
            standard_error=share_error * flux,
            presses=np.zeros((len(flux), 3)),
            digest="",
            seed=seed,
        )

    return light


def judged(monkeypatch: pytest.MonkeyPatch, slow: int, *, finer: float) -> tuple[PadMap, LightSignals, list]:
    """The map of a pad with some slow places, and what was traced; the second time with another error."""
    calls: list[tuple[object, int, float]] = []
    monkeypatch.setattr(continuity, "map_light", traced(slow, 2.5e-3, calls))
    monkeypatch.setattr(continuity, "pad_light", traced(slow, finer, calls))
    found, signals = continuity._pad_map(
        PAD, CAVITY, READOUT, fine=False, full=False, seed=0, tell=lambda _stage, _share: None
    )
    return found, signals, calls


def test_a_few_doubtful_places_are_traced_again_and_settled(monkeypatch):
    found, signals, calls = judged(monkeypatch, 3, finer=1e-4)
    first, second = calls
    assert first == (MAP_ACCURACY, 25, PAD.operating.max_depth_mm)
    assert second[:2] == (DOUBT_ACCURACY, 3)
    assert SLOW_TO_MM <= second[2] <= SLOW_TO_MM + 0.6  # the depths in question, and no deeper ones
    assert not found.is_open
    assert [place.tightest.trace_error < 0.1 for place in found.places] == [True] * 3 + [False] * 22
    # the map's own light, of which bounds take differences, stays one trace
    assert np.allclose(signals.standard_error, 2.5e-3 * signals.flux)


def test_a_place_that_finer_light_leaves_in_doubt_keeps_the_verdict_open(monkeypatch):
    found, _, calls = judged(monkeypatch, 3, finer=2.5e-3)
    assert len(calls) == 2
    assert found.is_open
    assert found.doubtful == [0, 1, 2]


def test_a_map_without_doubt_or_in_doubt_nearly_everywhere_is_traced_once(monkeypatch):
    for slow in (0, MOST_TRACED_AGAIN + 1):
        found, _, calls = judged(monkeypatch, slow, finer=1e-4)
        assert [call[:2] for call in calls] == [(MAP_ACCURACY, 25)]
        assert len(found.doubtful) == slow
