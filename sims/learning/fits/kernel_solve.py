"""The linear system of kernel ridge regression, solved in the memory that there is.

    (K + λ I) a = y,    K_ij = exp(-γ |s_i - s_j|₁)

`exact`     double precision, Cholesky in place: 8 n² bytes. 24,000 samples take 4.6 GB.
`single`    where that does not fit: single precision, 4 n² bytes, and one step of iterative refinement, whose residual
            is computed in double precision from the samples: r = y - (K + λ I) a, then a += (K + λ I)⁻¹ r.
`nystroem`  where that does not fit either: all samples, but kernels of m of them only (landmarks z),
            min |y - K_nm a|² + λ aᵀ K_mm a, by its normal equations accumulated in blocks: 8 m² bytes. Source: Williams
            and Seeger, Using the Nystroem method to speed up kernel machines, NIPS 13 (2001); Rudi, Camoriano and
            Rosasco, Less is more, NIPS 28 (2015).

Which one served is part of the result: nothing is approximated silently. The matrix is built a block of rows at a time,
lower triangle only, so that nothing else of its size exists.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from design.arrays import FloatArray
from design.errors import InputError
from design.progress import OnShare
from sims.learning.fits.block_cholesky import factorise_in_place, substituted

BLOCK_ROWS = 500
CHECKED_ROWS = 1_000
RIDGE_OF_LANDMARKS = 1e-9
"""Added to K_mm in proportion to its diagonal, which is 1: keeps its Cholesky factor real beside rounding errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class KernelSolution:
    """Weights of the kept samples.

    Attributes
    ----------
    kept : (kept,) numbers of the samples that carry weights
    weights : (kept, output) in units of the targets
    method : exact, single or nystroem
    largest_residual : of `CHECKED_ROWS` rows of the system, over the largest target [-]; NaN for `nystroem`, which
        solves another one
    """

    kept: NDArray[np.intp]
    weights: FloatArray
    method: str
    largest_residual: float


def method_for(samples: int, memory_gb: float) -> str:
    """The most exact method whose matrix fits."""
    if 8e-9 * samples**2 <= memory_gb:
        return "exact"
    return "single" if 4e-9 * samples**2 <= memory_gb else "nystroem"


def solve_kernel(
    features: FloatArray,
    targets: FloatArray,
    *,
    gamma: float,
    ridge: float,
    method: str,
    landmarks: NDArray[np.intp] | None = None,
    refinements: int = 1,
    on_share: OnShare = lambda _share: None,
) -> KernelSolution:
    """Solve by one of the methods.

    Parameters
    ----------
    features : (sample, feature) [-]
    targets : (sample, output), their mean taken off
    gamma : per unit of L1 distance [-]
    ridge : λ [-]
    landmarks : numbers of the samples that `nystroem` keeps
    refinements : of `single`; 0 is for the comparison with it

    Raises
    ------
    InputError : the matrix is not positive definite in the precision at hand.
    """
    if method == "nystroem":
        assert landmarks is not None
        weights = _nystroem(features, targets, landmarks, gamma, ridge, on_share)
        return KernelSolution(kept=landmarks, weights=weights, method=method, largest_residual=float("nan"))
    kind = np.float64 if method == "exact" else np.float32
    factor = factorise(kernel_matrix(features, gamma, kind, on_share), ridge)
    weights = substituted(factor, targets)
    everything = np.arange(len(features))
    for _ in range(refinements if method == "single" else 0):
        residual = _residual(features, targets, weights, gamma, ridge, everything)
        weights = weights + substituted(factor, residual)
    checked = everything[:: -(-len(features) // CHECKED_ROWS)]
    residual = _residual(features, targets, weights, gamma, ridge, checked)
    return KernelSolution(
        kept=np.arange(len(features)),
        weights=weights,
        method=method,
        largest_residual=float(np.abs(residual).max() / np.abs(targets).max()),
    )


def kernel_matrix(
    features: FloatArray, gamma: float, kind: type[Any], on_share: OnShare = lambda _share: None
) -> NDArray[Any]:
    """(sample, sample) kernel, lower triangle only; zeros above it, which cost no memory until they are touched."""
    samples = len(features)
    matrix = np.zeros((samples, samples), kind)

    def fill(start: int) -> int:
        end = min(start + BLOCK_ROWS, samples)
        block = cdist(features[start:end], features[:end], "cityblock")
        block *= -gamma
        np.exp(block, out=matrix[start:end, :end], casting="same_kind")
        return end

    with ThreadPoolExecutor(
        kernel_threads()
    ) as pool:  # SciPy's distances and NumPy's exp let go of the interpreter
        for end in pool.map(fill, range(0, samples, BLOCK_ROWS)):
            on_share(0.5 * (end / samples) ** 2)
    return matrix


def kernel_threads() -> int:
    """Threads that fill the matrix: as many as BLAS may take by `OMP_NUM_THREADS`, else the machine's cores."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, int(wanted) if wanted.isdecimal() else os.cpu_count() or 1)


def factorise(matrix: NDArray[Any], ridge: float) -> NDArray[Any]:
    """Cholesky factor of matrix + ridge I, in the lower triangle of the matrix' own memory.

    Raises
    ------
    InputError : not positive definite in this precision.
    """
    matrix.flat[:: len(matrix) + 1] += ridge
    try:
        factorise_in_place(matrix)
    except np.linalg.LinAlgError:
        raise InputError(
            f"kernel ridge: the matrix is not positive definite at lambda {ridge:g}; give a larger lambda"
        ) from None
    return matrix


def _residual(
    features: FloatArray,
    targets: FloatArray,
    weights: FloatArray,
    gamma: float,
    ridge: float,
    rows: NDArray[np.intp],
) -> FloatArray:
    """(row, output) y - (K + λ I) a of some rows, in double precision, a block of them at a time."""
    residual = targets[rows] - ridge * weights[rows]

    def subtract(start: int) -> None:
        block = rows[start : start + BLOCK_ROWS]
        kernel = np.exp(-gamma * cdist(features[block], features, "cityblock"))
        residual[start : start + BLOCK_ROWS] -= kernel @ weights

    with ThreadPoolExecutor(kernel_threads()) as pool:
        list(pool.map(subtract, range(0, len(rows), BLOCK_ROWS)))
    return residual


def _nystroem(
    features: FloatArray,
    targets: FloatArray,
    landmarks: NDArray[np.intp],
    gamma: float,
    ridge: float,
    on_share: OnShare,
) -> FloatArray:
    """Weights of the landmarks; the Cholesky factor of K_mm conditions the normal equations."""
    points = features[landmarks]
    among = np.exp(-gamma * cdist(points, points, "cityblock"))
    among.flat[:: len(among) + 1] += RIDGE_OF_LANDMARKS
    root = np.linalg.cholesky(among)
    normal = np.zeros((len(points), len(points)))
    right = np.zeros((len(points), targets.shape[1]))
    for start in range(0, len(features), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        kernel = np.exp(-gamma * cdist(points, features[rows], "cityblock"))
        white = solve_triangular(root, kernel, lower=True, overwrite_b=True, check_finite=False)
        normal += white @ white.T
        right += white @ targets[rows]
        on_share(0.8 * (start + BLOCK_ROWS) / (len(features) + BLOCK_ROWS))
    weights = substituted(factorise(normal, ridge), right)
    return np.asarray(solve_triangular(root, weights, lower=True, trans="T", check_finite=False))
