"""The kernel system is solved as scikit-learn solves it, in less memory."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.kernel_ridge import KernelRidge

from design.errors import InputError
from sims.learning.fits.kernel_ridge import BLOCK_ROWS, factorise, kernel_matrix, method_for, solve_kernel
from sims.learning.settings import EFFORTS

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


def test_the_exact_solution_is_scikit_learns(problem, wanted):
    found = solve_kernel(*problem, gamma=GAMMA, ridge=RIDGE, method="exact")
    # weights up to 10; both solve a system with a condition number of at most 1300 / 0.1 in double precision
    assert np.abs(found.weights - wanted).max() < 1e-9
    assert found.largest_residual < 1e-11
    assert found.method == "exact"


def test_single_precision_refined_once_comes_near_the_exact_solution(problem, wanted):
    found = solve_kernel(*problem, gamma=GAMMA, ridge=RIDGE, method="single")
    # an unrefined solution is off by condition x 6e-8 = 1e-3 at worst; a refinement squares that
    assert np.abs(found.weights - wanted).max() < 1e-5
    assert found.largest_residual < 1e-6


def test_the_approximation_with_every_sample_as_landmark_is_exact(problem, wanted):
    features, _ = problem
    found = solve_kernel(
        *problem, gamma=GAMMA, ridge=RIDGE, method="nystroem", landmarks=np.arange(len(features))
    )
    said = kernel_between(features[:50], features) @ found.weights
    # the jitter of 1e-9 on the landmarks' kernel is all that differs
    assert np.abs(said - kernel_between(features[:50], features) @ wanted).max() < 1e-5


def test_fewer_landmarks_come_nearer_the_more_there_are(problem, wanted):
    features, _ = problem
    exact = kernel_between(features, features) @ wanted
    errors = []
    for count in (50, 200, 800):
        kept = np.random.default_rng(0).permutation(len(features))[:count]
        found = solve_kernel(*problem, gamma=GAMMA, ridge=RIDGE, method="nystroem", landmarks=kept)
        assert np.array_equal(found.kept, kept)
        errors.append(np.abs(kernel_between(features, features[kept]) @ found.weights - exact).mean())
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2]


def kernel_between(one, other):
    return np.exp(-GAMMA * np.abs(one[:, None] - other[None]).sum(axis=2))


def test_the_method_follows_from_memory():
    found = [method_for(samples, 5.0) for samples in (24_000, 30_000, 49_000)]
    assert found == ["exact", "single", "nystroem"]


def test_the_papers_touched_samples_fit_into_a_kernel_of_single_precision():
    assert method_for(49_368, EFFORTS["whole"].memory_gb) == "single"
    assert method_for(EFFORTS["full"].fit_samples, EFFORTS["full"].memory_gb) == "exact"


def test_a_matrix_that_single_precision_cannot_factorise_is_refused_with_the_way_out():
    twins = np.zeros((40, 3))
    with pytest.raises(InputError, match="1e-12; give"):
        factorise(kernel_matrix(twins, 1.0, np.float32), 1e-12)


@pytest.mark.parametrize(("kind", "bits"), [(np.uint32, 0x7FA00000), (np.uint64, 0x7FF4000000000000)])
def test_what_lies_above_the_diagonal_decides_nothing(problem, kind, bits):
    number = np.float32 if kind is np.uint32 else np.float64
    matrix = kernel_matrix(problem[0][: BLOCK_ROWS + 100], GAMMA, number)
    assert not matrix[:BLOCK_ROWS, BLOCK_ROWS:].any()  # not filled, and not left to chance
    wanted = np.tril(factorise(matrix.copy(), RIDGE))
    matrix.view(kind)[np.triu_indices(len(matrix), 1)] = bits  # signalling NaN, as memory may hold
    np.testing.assert_array_equal(np.tril(factorise(matrix, RIDGE)), wanted)


def test_progress_rises_to_the_end(problem):
    shares = []
    solve_kernel(*problem, gamma=GAMMA, ridge=RIDGE, method="exact", on_share=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 0.5
