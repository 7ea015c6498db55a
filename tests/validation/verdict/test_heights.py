"""The table of part heights: what is varied, and what is told of those that pass."""

from __future__ import annotations

from itertools import product

from design.preset import preset
from design.shape.cavity import cavity_of
from tests.validation.verdict.heights import AREA_MM, EMITTER_MM, RECEIVER_MM, markdown, with_heights


def test_a_combination_changes_heights_and_emitting_area_alone() -> None:
    plain = preset("piacenza2017-pad")
    cavity = cavity_of(with_heights(plain, (4.5, 6.5, 1.0)))
    assert {part.height_mm for part in cavity.emitters} == {4.5}
    assert {part.height_mm for part in cavity.receivers} == {6.5}
    assert {part.part.active_width_mm.value for part in cavity.emitters} == {1.0}
    as_designed = (plain.emitters.height_mm, plain.receivers.height_mm, 2.0)
    assert as_designed in set(product(EMITTER_MM, RECEIVER_MM, AREA_MM))


def test_the_table_has_a_row_for_each_that_passes() -> None:
    passed = {"missed": "", "verdict": "CONTIGUOUS", "usable_mm": 5.0, "margin": 5.86, "depth_error_mm": 0.4}
    text = markdown({(5.0, 6.0, 2.0): passed, (4.0, 5.0, 1.0): {"missed": "DEADBAND at 8 mm"}})
    assert text.startswith("1 of 2 combinations pass.")
    assert text.splitlines()[-1] == "| 5 | 6 | 2 x 2 | CONTIGUOUS | 5.00 | 5.9 | 0.400 |"
