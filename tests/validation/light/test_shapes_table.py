"""The comparison of discs and crowned pads with the oracle: its figures on light that is made up."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.light.shapes_table import compared


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


def test_dim_pairs_do_not_count_for_changes():
    engine = np.array([[[1e-2, 1e-5]], [[1e-2, 3e-5]]])
    batches = np.tile(engine[0], (4, 2, 1, 1))
    found = compared(engine, np.full((2, 1, 2), 1e-6), engine, batches, 1, 10**6)
    assert found.change == 0.0
