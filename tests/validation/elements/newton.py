"""Newton's method with step halving for the oracle's equations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from optopad.design.arrays import FloatArray, IntArray

RESIDUAL_LIMIT = 1e-9
"""Largest residual of a converged state [E R²]."""
MOST_ITERATIONS = 25
SMALLEST_FRACTION = 0.02
"""Smallest part of a Newton step that is tried [-]."""


class OracleError(RuntimeError):
    """A state was not found."""


class InvertedElementError(OracleError):
    """A quadrature point has no positive volume."""


def solve_newton(
    assemble: Callable[[FloatArray], tuple[FloatArray, csc_matrix]],
    start: FloatArray,
    free: IntArray,
    most_iterations: int = MOST_ITERATIONS,
    ordering: str = "MMD_AT_PLUS_A",
) -> tuple[FloatArray, int]:
    """State with zero residual in the free unknowns, and the number of iterations.

    The tangent is symmetric and indefinite (saddle point). A step is halved until the residual's norm falls.

    Parameters
    ----------
    assemble : state -> residual and tangent of all unknowns; raises InvertedElementError outside its domain
    start : first guess, which holds the prescribed values
    free : indices of the unknowns that are not prescribed
    most_iterations : patience
    ordering : of the elimination, as of `scipy.sparse.linalg.splu`; NATURAL is that of `free`

    Raises
    ------
    OracleError : no convergence
    """
    state = start
    residual, tangent = assemble(state)
    for count in range(most_iterations):
        norm = float(np.linalg.norm(residual[free]))
        if np.abs(residual[free]).max() < RESIDUAL_LIMIT:
            return state, count
        factors = splu(
            tangent[free][:, free].tocsc(),
            permc_spec=ordering,
            diag_pivot_thresh=1e-3,
            options={"SymmetricMode": True},
        )
        step = np.zeros_like(state)
        step[free] = -factors.solve(residual[free])
        fraction = 1.0
        while True:
            if fraction < SMALLEST_FRACTION:
                raise OracleError(f"no descent at residual {norm:.1e}")
            try:
                residual, tangent = assemble(state + fraction * step)
            except InvertedElementError:
                fraction *= 0.5
                continue
            if np.linalg.norm(residual[free]) < (1.0 - 0.1 * fraction) * norm:
                break
            fraction *= 0.5
        state = state + fraction * step
    raise OracleError(f"residual {norm:.1e} after {most_iterations} iterations")
