"""Errors of mode boundaries: the trace's standard error over the slope of the light that tells the boundary."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.verdict.figure_errors import mode_errors_mm
from optopad.sims.verdict.pair_score import find_modes
from tests.sims.made_up_scores import made_up_pair


def test_an_error_moves_a_boundary_by_itself_over_the_slope():
    """Shifting the whole direct curve by its error moves the level's crossing by what is stated, to the curvature."""
    curves = made_up_pair(onset_mm=1.0, last_mm=3.0).curves
    modes = find_modes(curves.depth_mm, curves.top, curves.direct)
    _, (_, stated) = mode_errors_mm(curves, modes)
    level = 0.05 * curves.direct[0]
    crossings = [
        float(np.interp(-level, -(curves.direct + shift), curves.depth_mm))
        for shift in (-curves.standard_error, curves.standard_error)
    ]
    assert stated == pytest.approx(0.5 * (crossings[1] - crossings[0]), rel=0.1)


def test_twice_the_error_moves_boundaries_twice_as_far_and_open_ones_have_none():
    curves = made_up_pair(onset_mm=3.0, last_mm=9.0).curves
    modes = find_modes(curves.depth_mm, curves.top, curves.direct)
    (start, end), (onset, last) = mode_errors_mm(curves, modes)
    doubled = mode_errors_mm(replace(curves, standard_error=2 * curves.standard_error), modes)
    assert modes.mode2_mm[1] is None
    assert last is None
    assert doubled[0] == pytest.approx((2 * start, 2 * end))
    assert doubled[1][0] == pytest.approx(2 * onset)
