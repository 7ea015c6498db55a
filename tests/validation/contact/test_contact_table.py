"""The contact model against the oracle's stored solutions: the acceptance limits, and the published table."""

from __future__ import annotations

import csv
import math
from dataclasses import replace

import pytest

from tests.validation.contact.contact_table import (
    BEGIN,
    DATA,
    END,
    PAGE,
    Row,
    comma_separated,
    exceeded,
    limits,
    markdown,
    rows,
    with_table,
)


@pytest.fixture(scope="module")
def found() -> list[Row]:
    return list(rows())


@pytest.mark.slow
def test_every_press_is_within_the_limits_of_acceptance(found: list[Row]) -> None:
    assert [text for row in found for text in exceeded(row)] == []


@pytest.mark.slow
def test_the_oracle_is_much_better_than_the_limits(found: list[Row]) -> None:
    """Its difference from the coarser mesh, of which a third remains, is below a tenth of each limit."""
    for row in found:
        most, error = limits(row.depth_mm), row.oracle
        assert abs(error.force_ratio - 1.0) < 0.1 * most.force
        assert error.surface_rms_um < 0.1 * most.surface_rms_um
        assert error.surface_largest_um < 0.1 * most.surface_largest_um
        assert error.slope_rms_deg < 0.2 * most.slope_rms_deg


def test_limits_follow_the_depth() -> None:
    assert [limits(depth).force for depth in (0.2, 0.5, 4.0, 5.0)] == [0.06, 0.03, 0.03, 0.06]
    assert [limits(depth).surface_rms_um for depth in (0.2, 3.0, 4.0, 5.0)] == [10.0, 10.0, 30.0, 30.0]


@pytest.mark.slow
def test_an_error_above_its_limit_is_named_and_printed_bold(found: list[Row]) -> None:
    bad = replace(found[0], model=replace(found[0].model, force_ratio=1.07, slope_rms_deg=0.6))
    assert exceeded(bad) == [
        "6 mm layer at 0.2 mm: force 0.07 > 0.06",
        "6 mm layer at 0.2 mm: slope_rms_deg 0.6 > 0.5",
    ]
    assert "**7.00** (6)" in markdown([bad])


@pytest.mark.slow
def test_the_table_stands_between_its_marks(found: list[Row]) -> None:
    page = with_table(f"before\n{BEGIN}\nold\n{END}\nafter\n", "new")
    assert page == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"
    assert BEGIN in PAGE.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_published_figures_are_those_of_this_version(found: list[Row]) -> None:
    """Six digits are written; a thousandth leaves room for another version of NumPy and SciPy."""
    published = list(csv.DictReader(DATA.read_text(encoding="utf-8").splitlines()))
    present = list(csv.DictReader(comma_separated(found).splitlines()))
    assert len(published) == len(present)
    for old, new in zip(published, present, strict=True):
        assert old.keys() == new.keys()
        different = [
            name
            for name in new
            if not math.isclose(float(old[name]), float(new[name]), rel_tol=1e-3, abs_tol=1e-4)
        ]
        assert different == []
