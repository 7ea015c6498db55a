"""The light engine against the converged reference: a reduced copy of docs/validation/light.md, by the same code."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from tests.bench.measures.benchmark_states import SURFACES
from tests.validation.light.light_figures import errors_of, measured, reference_errors
from tests.validation.light.light_reference import GROUPS, STORED, reference
from tests.validation.light.light_reference_build import recipe
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


@pytest.mark.parametrize("surface", SURFACES)
def test_the_reference_gives_no_more_light_than_there_is(surface: str) -> None:
    flux = reference(surface).flux
    assert flux.shape == (len(GROUPS), 108, 8, 8)
    assert flux.min() > -1e-12  # differences of classes, rounded
    assert flux.sum(axis=(0, 3)).max() < 0.2


def test_the_stored_reference_says_how_it_was_made() -> None:
    with np.load(STORED, allow_pickle=False) as stored:
        made = json.loads(str(stored["recipe"]))
    assert made["versions"] == json.loads(recipe())["versions"]
    for surface in SURFACES:
        one, two = made["halves"][surface].values()
        assert one["seed"] != two["seed"]
        assert one["accuracy"] != two["accuracy"]


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
