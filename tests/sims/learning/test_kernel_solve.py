"""The kernel system is solved as scikit-learn solves it, in less memory."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.kernel_ridge import KernelRidge

from optopad.design.errors import InputError
from optopad.sims.learning.learners import BLOCK_ROWS, kernel_matrix, solved

GAMMA, RIDGE = 0.02, 0.1


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(4)
    features = rng.normal(size=(2 * BLOCK_ROWS + 300, 6)) * 10.0  # three blocks, the last one short
    targets = np.stack(
        [np.sin(features[:, 0] / 9.0), features[:, 1] / 20.0, np.cos(features[:, 2] / 7.0)], axis=1
    )
    return features, targets + 0.05 * rng.normal(size=targets.shape)


@pytest.fixture(scope="module")
def wanted(problem):
    features, targets = problem
    return KernelRidge(kernel="laplacian", gamma=GAMMA, alpha=RIDGE).fit(features, targets).dual_coef_


def test_the_solution_is_scikit_learns(problem, wanted):
    features, targets = problem
    found = solved(kernel_matrix(features, GAMMA), RIDGE, targets)
    # weights up to 10; both solve a system with a condition number of at most 1300 / 0.1 in double precision
    assert np.abs(found - wanted).max() < 1e-9


def test_a_matrix_that_is_not_positive_definite_is_refused_with_the_way_out():
    twins = np.zeros((40, 3))
    with pytest.raises(InputError, match=r"lambda -1; give"):
        solved(kernel_matrix(twins, 1.0), -1.0, twins)


def test_what_lies_above_the_diagonal_decides_nothing(problem):
    features, targets = (one[: BLOCK_ROWS + 100] for one in problem)
    matrix = kernel_matrix(features, GAMMA)
    assert not matrix[:BLOCK_ROWS, BLOCK_ROWS:].any()  # not filled, and not left to chance
    wanted = solved(matrix.copy(), RIDGE, targets)
    matrix[np.triu_indices(len(matrix), 1)] = np.nan
    np.testing.assert_array_equal(solved(matrix, RIDGE, targets), wanted)


def test_progress_rises_to_the_end(problem):
    shares = []
    kernel_matrix(problem[0], GAMMA, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 0.5
