"""A small copy of docs/validation/learning.md: a fit runs, a page comes of it, a cut run goes on."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from tests.validation.learning.learning_speed import Outcome, in_a_process, kept_outcomes


@pytest.mark.full
def test_a_small_fit_takes_little_memory():
    assert 0.05 < in_a_process(1_000).memory_gb < 2.0  # Python and its libraries alone take 0.1


def test_finished_fits_are_found_again(tmp_path):
    made = Outcome(wall_s=1.0, processor_s=1.0, memory_gb=0.5)
    (tmp_path / "kept.json").write_text(json.dumps({1_000: asdict(made)}), encoding="utf-8")
    assert kept_outcomes(tmp_path / "kept.json") == {1_000: made}
    assert kept_outcomes(tmp_path / "absent.json") == {}
