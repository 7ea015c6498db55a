"""The blocked factor is LAPACK's, and so is the solution."""

from __future__ import annotations

import numpy as np
import pytest

from sims.learning.fits import kernel_ridge as block_cholesky
from sims.learning.fits.kernel_ridge import factorise_in_place, substituted


@pytest.fixture
def matrix(monkeypatch) -> np.ndarray:
    monkeypatch.setattr(block_cholesky, "BLOCK", 37)  # five blocks, the last one short
    rng = np.random.default_rng(8)
    root = rng.normal(size=(170, 170))
    return root @ root.T / 170.0 + np.eye(170)


def test_the_factor_is_lapacks(matrix):
    wanted = np.linalg.cholesky(matrix)
    factorise_in_place(matrix)
    # a condition number below 10, entries of about 1
    assert np.abs(np.tril(matrix) - wanted).max() < 1e-13


def test_the_upper_triangle_is_not_read(matrix):
    wanted = np.linalg.cholesky(matrix)
    above = np.triu_indices(len(matrix), 1)
    spoilt = matrix.copy()
    spoilt[above] = np.nan
    factorise_in_place(spoilt)
    assert np.abs(np.tril(spoilt) - wanted).max() < 1e-13


@pytest.mark.parametrize(("kind", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-4)])
def test_the_solution_solves_the_system(matrix, kind, tolerance):
    right = np.random.default_rng(1).normal(size=(170, 3))
    factor = matrix.astype(kind)
    factorise_in_place(factor)
    # rounding of the type times a condition number below 10 times a hundred terms
    assert np.abs(matrix @ substituted(factor, right) - right).max() < tolerance


def test_what_is_not_positive_definite_is_refused(matrix):
    matrix[120, 120] = -1.0
    with pytest.raises(np.linalg.LinAlgError):
        factorise_in_place(matrix)
