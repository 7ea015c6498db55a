"""The table of part heights: what is varied, and what is told of those that pass."""

from __future__ import annotations

from itertools import product

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from tests.validation.verdict.heights import AREA_MM, EMITTER_MM, RECEIVER_MM, with_heights


def test_a_combination_changes_heights_and_emitting_area_alone() -> None:
    plain = preset("piacenza2017-pad")
    cavity = cavity_of(with_heights(plain, (4.5, 6.5, 1.0)))
    assert {part.height_mm for part in cavity.emitters} == {4.5}
    assert {part.height_mm for part in cavity.receivers} == {6.5}
    assert {part.part.active_width_mm.value for part in cavity.emitters} == {1.0}
    as_designed = (plain.emitters.height_mm, plain.receivers.height_mm, 2.0)
    assert as_designed in set(product(EMITTER_MM, RECEIVER_MM, AREA_MM))
