"""Rows of docs/validation/objects.md: there is one for each stored press, and cheap ones are made anew."""

from __future__ import annotations

import re
from itertools import groupby

import pytest

from tests.validation.held.object_table import PAGE, contact_row, turned
from tests.validation.held.truth_file import read_truth
from tests.validation.stored import ROOT, table

PRESSES = {
    (name, depth): {row.quantity: row for row in rows}
    for name, of_case in read_truth().items()
    for depth, rows in groupby(of_case, lambda row: row.depth_mm)
}
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")


def stored(*heads: str) -> list[list[str]]:
    """The rows of the page's table with these headings."""
    return [list(row.values()) for row in table(PAGE.relative_to(ROOT).as_posix(), *heads)]


def require_same(made: list[str], there: list[str]) -> None:
    """Equal words, and numbers that differ by one in the last digit at most."""
    for one, other in zip(made, there, strict=True):
        assert NUMBER.sub("", one) == NUMBER.sub("", other)
        for found, wanted in zip(NUMBER.finditer(one), NUMBER.finditer(other), strict=True):
            digits = len((wanted[1] or ".")[1:])
            assert float(found[0]) == pytest.approx(float(wanted[0]), abs=1.01 * 10.0**-digits)


def test_each_stored_press_has_its_row() -> None:
    rows = stored("object", "covered")
    assert [(row[0], float(row[2])) for row in rows] == list(PRESSES), (
        "renew: python -m tests.validation.held.object_table contact"
    )


QUICK = [press for press in PRESSES if "160 apart" in press[0]]


@pytest.mark.parametrize(
    "press", [*QUICK, *(pytest.param(p, marks=pytest.mark.slow) for p in PRESSES if p not in QUICK)]
)
def test_a_row_of_contact_is_what_the_command_makes(press: tuple[str, float]) -> None:
    (row,) = (row for row in stored("object", "covered") if (row[0], float(row[2])) == press)
    require_same(contact_row(*press, PRESSES[press]), row)


@pytest.mark.slow
def test_the_row_of_a_turned_cylinder_is_what_the_command_makes() -> None:
    require_same(turned(), stored("presses", "stated error %")[0])
