"""Load protocols: the published one is as stated, and what cannot be driven is refused."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from optopad.design.errors import InputError
from optopad.design.fields.quantity import Quantity
from optopad.design.press_protocol import LoadProtocol, load_protocol
from tests.said import pattern

PAPER = load_protocol("piacenza2017")


def changed(name: str, value: float) -> LoadProtocol:
    quantity = getattr(PAPER, name)
    return LoadProtocol.model_validate(
        dict(PAPER) | {name: Quantity.model_validate(dict(quantity) | {"value": value})}
    )


def test_the_published_protocol_is_as_stated_and_says_what_is_assumed() -> None:
    assert (PAPER.step_mm.value, PAPER.deepest_mm.value, PAPER.pause_s.value, PAPER.steps) == (
        1.0,
        5.0,
        10.0,
        5,
    )
    read = {PAPER.step_mm.confidence, PAPER.deepest_mm.confidence, PAPER.pause_s.confidence}
    assert read == {"read"}
    assert PAPER.speed_mm_per_s.confidence == "unverified"
    assert "does not state" in PAPER.speed_mm_per_s.source


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("step_mm", 0.0, "step_mm: 0 must be above 0"),
        ("speed_mm_per_s", -1.0, "speed_mm_per_s: -1 must be above 0"),
        ("pause_s", -1.0, "pause_s: -1 must be at least 0"),
        ("deepest_mm", 4.5, "deepest_mm: 4.5 ... of 1"),
        ("deepest_mm", 0.0, "deepest_mm: 0 ... of 1"),
    ],
)
def test_a_protocol_that_cannot_be_driven_is_refused(name: str, value: float, words: str) -> None:
    with pytest.raises(ValidationError, match=pattern(words)):
        changed(name, value)


def test_an_unknown_protocol_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'piacenza'.*piacenza2017"):
        load_protocol("piacenza")
    with pytest.raises(InputError, match="there are: piacenza2017"):
        load_protocol("x")
