"""The load over a protocol: times and depths as stated, elastic or relaxing, never a pull."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.press_protocol import load_protocol
from optopad.sims.contact import load_protocol as module
from optopad.sims.contact.load_protocol import StandardLinearSolid, load_history, protocol_path

PAPER = load_protocol("piacenza2017")
SOLID = StandardLinearSolid(relaxed_share=0.2, time_constant_s=5.0)


def hertz_like(depth_mm: float) -> float:
    return 3.3 * depth_mm**1.5


def test_the_papers_protocol_goes_in_five_steps_and_out_with_pauses_of_ten_seconds() -> None:
    time, depth, ends = protocol_path(PAPER)
    assert depth[ends].tolist() == [1, 2, 3, 4, 5, 4, 3, 2, 1, 0]
    assert time[ends] == pytest.approx(11.0 * np.arange(1, 11))  # 1 s of driving at 1 mm/s, 10 s of waiting
    still = np.isclose(np.diff(depth), 0.0)
    assert np.diff(time)[still].sum() == pytest.approx(100.0)
    assert np.abs(np.diff(depth))[~still] / np.diff(time)[~still] == pytest.approx(1.0)


def test_without_relaxation_the_load_is_the_elastic_one_and_no_work_is_lost() -> None:
    history = load_history(PAPER, hertz_like)
    assert np.array_equal(history.load_n, history.elastic_n)
    assert not history.has_relaxation
    assert not history.has_left.any()
    assert history.lost_mj == pytest.approx(0.0, abs=1e-9 * float(history.load_n.max()))


def test_relaxation_shows_higher_loads_in_than_out_and_loses_work() -> None:
    history = load_history(PAPER, hertz_like, SOLID)
    ends, steps = history.pause_ends, PAPER.steps
    inward, outward = history.load_n[ends[: steps - 1]], history.load_n[ends[steps:-1]][::-1]
    assert np.all(inward > outward)
    assert history.lost_mj > 0.0
    assert history.depth_mm[history.turn] == 5.0


def test_a_pause_relaxes_towards_the_elastic_load_at_the_solids_rate() -> None:
    history = load_history(PAPER, hertz_like, SOLID)
    first, last = history.pause_ends[0] - module.SAMPLES_PER_STEP, history.pause_ends[0]
    excess = history.load_n - history.elastic_n
    assert excess[last] / excess[first] == pytest.approx(np.exp(-10.0 / 5.0), rel=1e-12)  # 10 s, exactly


def test_a_tip_that_would_have_to_pull_has_left_and_feels_nothing() -> None:
    history = load_history(PAPER, hertz_like, SOLID)
    assert history.load_n.min() == 0.0
    assert history.has_left[-1]
    assert np.all(history.load_n[history.has_left] == 0.0)


def test_finer_sampling_changes_the_load_by_less_than_1e_5_of_its_peak(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    coarse = load_history(PAPER, hertz_like, SOLID)
    monkeypatch.setattr(module, "SAMPLES_PER_STEP", 10 * module.SAMPLES_PER_STEP)
    fine = load_history(PAPER, hertz_like, SOLID)
    found = np.interp(coarse.time_s, fine.time_s, fine.load_n)
    assert np.abs(found - coarse.load_n).max() < 1e-5 * float(fine.load_n.max())
