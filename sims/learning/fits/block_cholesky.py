"""Cholesky factor of a large symmetric matrix in its own memory, block by block.

    A = L Lᵀ,   for each block column k:   L_kk = chol(A_kk),   L_ik = A_ik L_kk⁻ᵀ,   A_ij -= L_ik L_jkᵀ   (i ≥ j > k)

Only the lower triangle is read and written. LAPACK's own routine does the same in one call; with the OpenBLAS that
SciPy 1.17 brings, that call ended in a memory fault for 24,000 rows on two threads. Here every call works on blocks of
`BLOCK` rows, and nearly all of the time goes into their products. Source: Golub and Van Loan, Matrix computations
(2013), section 4.2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from design.arrays import FloatArray

BLOCK = 1_500


def factorise_in_place(matrix: NDArray[Any]) -> None:
    """Put L into the lower triangle of a matrix (n, n), single or double precision.

    Raises
    ------
    numpy.linalg.LinAlgError : not positive definite in this precision; the matrix is then spoilt.
    """
    size = len(matrix)
    for start in range(0, size, BLOCK):
        here = slice(start, min(start + BLOCK, size))
        # without what lies above: a signalling NaN there would pass for a matrix that is not positive definite
        matrix[here, here] = np.linalg.cholesky(np.tril(matrix[here, here]))
        for rows in _below(here.stop, size):
            matrix[rows, here] = solve_triangular(
                matrix[here, here], matrix[rows, here].T, lower=True, check_finite=False
            ).T
        for columns in _below(here.stop, size):
            for rows in _below(columns.start, size):
                matrix[rows, columns] -= matrix[rows, here] @ matrix[columns, here].T


def substituted(factor: NDArray[Any], targets: FloatArray) -> FloatArray:
    """(n, output) solution of L Lᵀ x = targets (n, output); L in the lower triangle of a factor (n, n)."""
    found = np.array(targets, dtype=factor.dtype)
    blocks = list(_below(0, len(factor)))
    for here in blocks:
        found[here] -= factor[here, : here.start] @ found[: here.start]
        found[here] = _solved(factor[here, here], found[here], "N")
    for here in reversed(blocks):
        found[here] -= factor[here.stop :, here].T @ found[here.stop :]
        found[here] = _solved(factor[here, here], found[here], "T")
    return np.asarray(found, dtype=np.float64)


def _below(start: int, size: int) -> list[slice]:
    """Blocks of rows from a start to the end."""
    return [slice(row, min(row + BLOCK, size)) for row in range(start, size, BLOCK)]


def _solved(triangle: NDArray[Any], right: NDArray[Any], trans: str) -> NDArray[Any]:
    return np.asarray(solve_triangular(triangle, right, lower=True, trans=trans, check_finite=False))
