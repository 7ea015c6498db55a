"""The light trace's error in continuity, evenness and strength: nothing of nothing, its size, shared by equal pairs."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.builds import score_curves
from optopad.sims.verdict.figure_errors import DRAWS, FIGURES, drawn_figures, figure_errors, figures_of
from optopad.sims.verdict.presses import PairCurves

DESIGN = preset("piacenza2017-pair")
DEPTH_MM = depth_schedule_mm(5.0)
READOUT = Readout(counts_per_flux=5e4, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003)
STEPS = FIGURES.index("resolvable_steps")


def curves_with(error: float, pair=(0, 0)) -> PairCurves:
    """A signal that falls from 500 counts to 50, evenly in depth."""
    total = 1e-2 * (1.0 - 0.18 * DEPTH_MM)
    return PairCurves(
        pair=pair,
        press_mm=(10.0, 10.0),
        depth_mm=DEPTH_MM,
        direct=0.6 * total,
        top=0.4 * total,
        diffuse=np.zeros_like(total),
        total=total,
        standard_error=np.full_like(total, error),
    )


def drawn(*curves: PairCurves):
    scores = [score_curves(one, READOUT) for one in curves]
    return drawn_figures(curves, scores, READOUT), np.stack([figures_of(score) for score in scores])


def test_light_without_error_leaves_figures_without_error():
    found, judged = drawn(curves_with(0.0))
    assert found.shape == (1, DRAWS, len(FIGURES))
    assert figure_errors(found, judged) == dict.fromkeys(FIGURES, 0.0)


def test_an_error_of_the_light_is_an_error_of_the_steps_of_its_size():
    """Steps are the range of u over 3, du = error/σ; both ends of the range, σ of 500 and 50 counts 1.6 and 0.6."""
    error = 2e-5  # 1 count
    found, judged = drawn(curves_with(error))
    ends = np.hypot(1.0 / 1.61, 1.0 / 0.60) / 3.0
    told = figure_errors(found, judged)
    # 16 draws know a deviation to 18 %, and the range takes the extremes of several neighbours: 60 % together
    assert told["resolvable_steps"] == pytest.approx(ends, rel=0.6)
    twice = figure_errors(*drawn(curves_with(2 * error)))
    assert twice["resolvable_steps"] > 1.4 * told["resolvable_steps"]
    assert told["continuity"] == 0.0  # nowhere near a deadband
    assert 0.0 < told["evenness"] < 0.2


def test_pairs_that_a_symmetry_makes_one_share_their_draws_and_others_do_not():
    same = replace(curves_with(2e-5), total=curves_with(2e-5).total * (1.0 + 1e-15))
    found, _ = drawn(curves_with(2e-5), same, curves_with(2.1e-5))
    assert (found[0] == found[1]).all()
    assert (found[0, :, STEPS] != found[2, :, STEPS]).any()
