"""A small copy of docs/validation/learning.md: every method runs, a page comes of it, a cut run goes on."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from tests.validation.learning.learning_speed import (
    Case,
    Outcome,
    in_a_process,
    kept_outcomes,
    largest_difference_mm,
    outcome,
)


@pytest.mark.full
@pytest.mark.parametrize("ridge", [1e-4, 1.0])
def test_refined_single_precision_says_the_same_presses(ridge):
    exact = in_a_process(Case(1_000, "exact", ridge))  # its memory is its own there
    plain, single = (outcome(Case(1_000, method, ridge)) for method in ("plain", "single"))
    # condition of at most 1000 / 1e-4: single precision alone may be off by 1e7 x 6e-8 of 30 mm, refined by its square
    assert largest_difference_mm(single, exact) < 1e-4
    assert largest_difference_mm(single, exact) <= largest_difference_mm(plain, exact)
    assert exact.memory_gb < 2.0


def test_finished_fits_are_found_again(tmp_path):
    made = Outcome(wall_s=1.0, processor_s=1.0, memory_gb=0.5, told_mm=[])
    (tmp_path / "kept.json").write_text(json.dumps({"exact-1": asdict(made)}), encoding="utf-8")
    assert kept_outcomes(tmp_path / "kept.json") == {"exact-1": made}
    assert kept_outcomes(tmp_path / "absent.json") == {}
