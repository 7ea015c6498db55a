"""The light engine against the converged reference: a reduced copy of docs/validation/light.md, by the same code."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

from tests.bench.measures.benchmark_states import SURFACES
from tests.validation.light import crossing_light
from tests.validation.light.crossing_light import cells
from tests.validation.light.light_figures import errors_of, measured, reference_errors
from tests.validation.light.light_table import (
    DATA,
    JUDGED,
    LIMITS,
    MARKS,
    PAGE,
    SETTINGS,
    Row,
    comma_separated,
    exceeded,
    markdown,
    row_of,
)
from tests.validation.light.shapes_table import compared

REDUCED = [0, 8, 16, 27, 40, 53, 70, 91]
"""States of eight places that go through all depths."""


@pytest.fixture(scope="module")
def judged() -> Row:
    """One setting on the analytic surfaces, for which the limits hold."""
    return row_of("analytic", JUDGED, measured("analytic", JUDGED, REDUCED), REDUCED)


@pytest.mark.parametrize(("surface", "limit"), [("analytic", 1e-4), ("contact", 1.5e-4)])
def test_the_reference_is_converged_to_about_a_hundredth_of_a_percent(surface: str, limit: float) -> None:
    """A sixth of what the engine may be off, and a quarter where more light is mirrored by bent surfaces."""
    assert reference_errors(surface).rms < limit
    assert abs(reference_errors(surface).bias) < LIMITS.bias / 4.0


def test_figures_of_errors_are_what_they_say() -> None:
    found = errors_of(np.array([[-0.03, 0.0], [0.01, 0.0]]))
    assert found.rms == pytest.approx(np.sqrt((9e-4 + 1e-4) / 4))
    assert (found.median, found.worst, found.bias) == pytest.approx((0.005, 0.03, -0.005))


@pytest.mark.slow
def test_the_judged_setting_is_within_the_limits_on_some_states(judged: Row) -> None:
    assert exceeded(judged) == []


@pytest.mark.slow
def test_claimed_errors_cover_the_real_ones(judged: Row) -> None:
    """A claim of one degree of freedom holds 50, 70 and 80 % of errors within 1, 2 and 3 of it."""
    assert judged.claims.error_over_claim < 2.0
    assert judged.claims.within_one > 0.4
    assert judged.claims.within_three > 0.7


@pytest.mark.slow
def test_an_error_above_its_limit_is_named(judged: Row) -> None:
    bad = replace(judged, total=replace(LIMITS, rms=7e-4, bias=-2e-4))
    assert exceeded(bad) == ["rms 0.0007 > 0.0006", "bias -0.0002 > 0.0001"]
    assert "above a limit: rms 0.0007 > 0.0006; bias -0.0002 > 0.0001." in markdown([bad])
    assert len(comma_separated([bad]).splitlines()) == 2


def test_the_page_and_its_data_hold_every_setting() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert all(mark in page for mark in MARKS)
    published = list(csv.DictReader(DATA.read_text(encoding="utf-8").splitlines()))
    assert {(row["surface"], row["accuracy"]) for row in published} == {
        (surface, str(setting)) for surface in SURFACES for setting in SETTINGS
    }


@pytest.fixture
def made_up(tmp_path, monkeypatch):
    """A pad where every pair's signal is 0.004, and at the second place one pair has light that crosses."""

    def crossing(scene, centre_mm, presses, rays, seed):
        flux = np.zeros((len(presses), len(scene.emitter_wall), 8))
        if centre_mm[0] == 20.0:
            flux[-1, -1 if len(scene.emitter_wall) == 1 else 5, 2] = 8e-5
        return flux

    monkeypatch.setattr(crossing_light, "BUILD", tmp_path)
    monkeypatch.setattr(crossing_light, "crossing_flux", crossing)
    monkeypatch.setattr(crossing_light, "flat_flux", lambda: np.full((8, 8), 0.004))


def test_shares_are_of_the_pairs_own_undeformed_signal(made_up):
    places = np.array([[10.0, 10.0], [20.0, 12.0]])
    shallow, deep = crossing_light.measured("analytic", places, (1.0, 2.0), 10**6, "made-up")
    assert (shallow.mean, shallow.largest, shallow.rms) == (0.0, 0.0, 0.0)
    assert deep.largest == pytest.approx(0.02)
    assert deep.mean == pytest.approx(0.02 / (2 * 48))
    assert deep.where == (20.0, 12.0, 5, 2)
    # a count of 80 in a million, its noise taken off the square; 800 in the second measurement
    assert deep.rms == pytest.approx(np.sqrt((0.02**2 - 80.0 / 4000.0**2) / 96.0), rel=1e-3)
    assert deep.largest_error == pytest.approx(np.sqrt(800.0) / 40000.0, rel=1e-3)
    assert "5 → 2 at (20.0, 12.0) mm" in cells(deep)
    assert deep.is_clear
    assert "none above noise" in cells(shallow)


def test_a_change_that_is_off_by_one_percent_is_one_percent_beyond_the_oracle_s_noise():
    random = np.random.default_rng(3)
    engine = np.stack([np.full((8, 8), 1e-2), np.full((8, 8), 0.8e-2)])
    error = np.full((2, 8, 8), 1e-4)
    known = engine.copy()
    known[1] += 1e-4
    batches = known + random.normal(0.0, 1e-4, (8, 1, 8, 8)) + random.normal(0.0, 1e-4, (8, 2, 8, 8))
    found = compared(engine, error, engine, batches, 1, 10_000_000)
    assert found.noise == pytest.approx(np.sqrt(2.0 / 8.0) * 1e-2, rel=0.1)
    assert found.change == pytest.approx(1e-2, rel=0.15)
    assert found.stated == pytest.approx(1e-2)
    assert 1.0 < found.worst < 5.0
