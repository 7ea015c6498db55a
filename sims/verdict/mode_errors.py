"""How far the light trace's own error may move the boundaries of the modes.

A boundary is where a curve crosses a level, so an error of the curve moves it by that error over the curve's slope
there. The trace tells the standard error of the whole light only; it is taken for that of the mirrored and of the
direct part, too, which is too much for the direct part (quadrature, no rays). Errors of the level (a share of the
curve's range) and of neighbouring depths, which partly cancel, are left out.
"""

from __future__ import annotations

import numpy as np

from design.arrays import FloatArray
from sims.verdict.pair.modes import Modes
from sims.verdict.presses import PairCurves

Errors = tuple[float | None, float | None]


def mode_errors_mm(curves: PairCurves, modes: Modes) -> tuple[Errors, Errors]:
    """Standard errors of the boundaries of mode 1 and mode 2 [mm]; None where open, or where the curve is flat."""
    first = tuple(_moved_mm(curves, curves.top, boundary) for boundary in modes.mode1_mm)
    second = tuple(_moved_mm(curves, curves.direct, boundary) for boundary in modes.mode2_mm)
    return (first[0], first[1]), (second[0], second[1])


def _moved_mm(curves: PairCurves, light: FloatArray, boundary_mm: float | None) -> float | None:
    """Standard error over slope, both in the segment that holds the boundary [mm]."""
    if boundary_mm is None:
        return None
    depth = curves.depth_mm
    segment = min(max(int(np.searchsorted(depth, boundary_mm)) - 1, 0), len(depth) - 2)
    slope = abs(light[segment + 1] - light[segment]) / (depth[segment + 1] - depth[segment])
    if slope == 0.0:
        return None
    return float(np.interp(boundary_mm, depth, curves.standard_error) / slope)
