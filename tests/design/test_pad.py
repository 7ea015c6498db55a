"""A pad is a valid design, and every part of it is resolved once."""

from __future__ import annotations

import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.draft import Draft
from optopad.design.errors import DesignError
from optopad.design.mold.outline import outline_of
from optopad.design.once import KEPT, once
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign

PAIR = preset("piacenza2017-pair")


def test_a_pad_has_the_warnings_of_its_design_and_its_parts() -> None:
    pad = Pad.of(PAIR)
    assert pad.findings == check(PAIR) != ()
    assert pad.circuit is Circuit.of(PAIR)
    assert pad.cavity is pad.circuit.cavity is cavity_of(PAIR)
    assert pad.outline is outline_of(PAIR)
    assert [place.name for place in pad.places] == [part.name for part in pad.cavity.parts]


def test_a_design_with_errors_is_no_pad_and_all_its_errors_are_listed() -> None:
    wrong = PAIR.with_(**{"board.baud": 230_400, "operating.max_depth_mm": 20.0})
    errors = [str(one) for one in check(wrong) if one.severity == "error"]
    assert len(errors) >= 2
    with pytest.raises(DesignError) as refused:
        Pad.of(wrong)
    assert str(refused.value).splitlines()[1:] == [f"  {line}" for line in errors]


def test_a_draft_of_an_unknown_board_has_a_cavity_but_no_circuit() -> None:
    draft = Draft(PAIR.with_(**{"board.kind": "no-board"}))
    assert len(draft.cavity.emitters) == len(cavity_of(PAIR).emitters)
    with pytest.raises(DesignError, match="no-board"):
        _ = draft.circuit


def test_each_design_is_resolved_once_and_an_equal_copy_for_itself() -> None:
    asked: list[SensorDesign] = []

    @once
    def resolved(design: SensorDesign) -> str:
        asked.append(design)
        return design.name

    copy = PAIR.model_copy()
    assert copy == PAIR
    assert [resolved(one) for one in (PAIR, PAIR, copy, PAIR)] == [PAIR.name] * 4
    assert [id(one) for one in asked] == [id(PAIR), id(copy)]


def test_a_refusal_is_not_kept_and_old_designs_are_forgotten() -> None:
    tries = []

    @once
    def resolved(design: SensorDesign) -> str:
        tries.append(design.name)
        if len(tries) == 1:
            raise DesignError("not yet")
        return design.name

    with pytest.raises(DesignError, match="not yet"):
        resolved(PAIR)
    assert resolved(PAIR) == PAIR.name
    for _ in range(KEPT):
        resolved(PAIR.model_copy())
    resolved(PAIR)
    assert len(tries) == 2 + KEPT + 1
