"""Noise units against the variance model that defines them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, chord_midpoint_mm, judged_pairs, mask_of
from optopad.sims.optics.tracing import trace
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import Readout
from optopad.sims.verdict.builds import score_curves
from optopad.sims.verdict.depth_curve import counts_of_noise_units, noise_units, sigma_counts
from optopad.sims.verdict.figure_errors import DRAWS, FIGURES, drawn_figures, figure_errors, figures_of
from optopad.sims.verdict.presses import (
    MAP_ACCURACY,
    NEAR_ACCURACY,
    PairCurves,
    map_depths_mm,
    map_light,
    pad_light,
    pair_curves,
    states_of,
)

PROPERTY = settings(max_examples=80, deadline=None, derandomize=True)
ROUNDING = 1e-12  # some hundred ulps: the functions are a handful of operations


def test_sigma_adds_rounding_read_noise_and_light_noise_in_quadrature():
    # 1/12 + 0.5² + (0.003 x 800)² = 0.083333 + 0.25 + 5.76
    assert sigma_counts(800.0, 0.5, 0.003) == pytest.approx(np.sqrt(6.0933333333333), rel=ROUNDING)


def test_sigma_without_other_noise_is_that_of_rounding():
    assert sigma_counts(0.0, 0.0, 0.0) == pytest.approx(1.0 / np.sqrt(12.0), rel=ROUNDING)


def test_one_noise_unit_is_one_standard_deviation_everywhere():
    counts = np.linspace(0.0, 1023.0, 200)
    step = 1e-3  # the third derivative of u leaves an error of (ρ step/σ0)²/6, about 5e-12
    slope = (noise_units(counts + step) - noise_units(counts - step)) / (2.0 * step)
    # 1e-8: rounding of u (1e-13) over the step
    np.testing.assert_allclose(slope * sigma_counts(counts), 1.0, rtol=1e-8)


@pytest.mark.parametrize("rho", [0.1, 0.003, 1e-4, 1e-6])
def test_noise_units_are_the_closed_form(rho):
    sigma0 = np.sqrt(1.0 / 12.0 + 0.25)
    assert noise_units(800.0, 0.5, rho) == pytest.approx(np.arcsinh(rho * 800.0 / sigma0) / rho, rel=ROUNDING)


def test_without_relative_noise_units_are_counts_over_sigma():
    counts = np.array([0.0, 10.0, 1023.0])
    np.testing.assert_allclose(
        noise_units(counts, 0.5, 0.0), counts / np.sqrt(1.0 / 12.0 + 0.25), rtol=ROUNDING
    )


@pytest.mark.parametrize("rho", [1e-320, 1e-100, 1e-13, 1e-12, 1e-11, 1e-9])
def test_the_limit_of_small_relative_noise_is_smooth(rho):
    # asinh(x) = x (1 - x²/6): at ρ = 1e-9 and 1000 counts x is 1.8e-6 and the difference 5e-13
    assert noise_units(1000.0, 0.5, rho) == pytest.approx(noise_units(1000.0, 0.5, 0.0), rel=ROUNDING)


@PROPERTY
@given(
    counts=st.floats(-2000.0, 5000.0),
    read_noise=st.floats(0.0, 20.0),
    relative_noise=st.floats(0.0, 0.1),
)
def test_the_inverse_gives_the_counts_back(counts, read_noise, relative_noise):
    units = noise_units(counts, read_noise, relative_noise)
    back = counts_of_noise_units(units, read_noise, relative_noise)
    # sinh magnifies the rounding of ρ u, at most asinh(1750) = 8.2, so to about 10 ulps
    assert back == pytest.approx(counts, rel=ROUNDING, abs=ROUNDING)


@PROPERTY
@given(relative_noise=st.floats(0.0, 0.1))
def test_noise_units_are_odd_and_increasing(relative_noise):
    counts = np.linspace(0.0, 1023.0, 50)
    units = noise_units(counts, 0.5, relative_noise)
    assert np.all(np.diff(units) > 0.0)
    np.testing.assert_array_equal(noise_units(-counts, 0.5, relative_noise), -units)


def test_simulated_readings_scatter_by_one_noise_unit():
    rng = np.random.default_rng(3)
    for mean in (5.3, 100.3, 800.3):
        light = mean * (1.0 + 0.003 * rng.standard_normal(40_000))
        readings = np.round(light + 0.5 * rng.standard_normal(40_000))
        spread = np.std(noise_units(readings, 0.5, 0.003))
        # 5 standard errors of a standard deviation from 40,000 readings: 5 / √80,000 = 1.8 %
        assert spread == pytest.approx(1.0, abs=0.018)


@pytest.mark.parametrize(("read_noise", "relative_noise"), [(-0.1, 0.003), (0.5, -1.0), (np.nan, 0.0)])
def test_impossible_noise_is_refused_by_name(read_noise, relative_noise):
    name = "relative_noise" if relative_noise < 0.0 else "read_noise_counts"
    with pytest.raises(InputError, match=rf"{name}: .*needs a finite number >= 0"):
        noise_units(1.0, read_noise, relative_noise)


PAD = preset("piacenza2017-pad")
CAVITY = cavity_of(PAD)
DEPTH_MM = np.array([0.5, 2.0])


def test_states_run_through_depths_first():
    states = states_of(np.array([[1.0, 2.0], [3.0, 4.0]]), DEPTH_MM)
    assert states.tolist() == [[1.0, 2.0, 0.5], [1.0, 2.0, 2.0], [3.0, 4.0, 0.5], [3.0, 4.0, 2.0]]


def test_a_pair_s_curves_are_its_light_under_a_press_at_its_chord_s_midpoint():
    pairs = judged_pairs(CAVITY)[:3]
    for pair, curves in zip(
        pairs, pair_curves(Draft.of(PAD), pairs, DEPTH_MM, accuracy="draft", seed=1), strict=True
    ):
        assert curves.press_mm == chord_midpoint_mm(CAVITY, pair)
        states = states_of(np.array([curves.press_mm]), DEPTH_MM)
        alone = trace(Draft.of(PAD), states, accuracy="draft", seed=1, pairs=mask_of((pair,), CAVITY))
        assert curves.total == pytest.approx(alone.flux[:, *pair], rel=1e-9)
        assert curves.direct + curves.top + curves.diffuse == pytest.approx(curves.total, rel=1e-12)


def test_a_map_s_light_has_one_entry_a_state_throughout():
    """The two places go onto each other in a half turn: one is traced, both come back."""
    places = np.array([[12.0, 9.0], [CAVITY.length_mm - 12.0, CAVITY.width_mm - 9.0]])
    light = pad_light(Draft.of(PAD), places, DEPTH_MM, accuracy=MAP_ACCURACY, seed=0)
    assert light.presses.tolist() == states_of(places, DEPTH_MM).tolist()
    for of_state in (light.flux, light.standard_error, light.relative_error, light.is_met):
        assert of_state is not None
        assert len(of_state) == 4
    assert sorted(light.flux[1].ravel()) == sorted(light.flux[3].ravel())


@pytest.mark.slow
def test_a_map_is_finer_near_contact_and_keeps_the_order_of_its_states():
    places, depth_mm = np.array([[12.0, 9.0], [20.0, 11.0]]), np.array([0.0, 0.1, 0.5, 2.0])
    light = map_light(Draft.of(PAD), places, depth_mm, accuracy=MAP_ACCURACY, seed=0)
    near = pad_light(Draft.of(PAD), places, depth_mm[:2], accuracy=NEAR_ACCURACY, seed=0)
    deep = pad_light(Draft.of(PAD), places, depth_mm[2:], accuracy=MAP_ACCURACY, seed=0)
    assert light.presses.tolist() == states_of(places, depth_mm).tolist()
    for name in ("flux", "standard_error"):
        found = getattr(light, name).reshape(2, 4, 8, 8)
        assert (found[:, :2] == getattr(near, name).reshape(2, 2, 8, 8)).all()
        assert (found[:, 2:] == getattr(deep, name).reshape(2, 2, 8, 8)).all()
    assert sum(light.by_class.values()) == pytest.approx(light.flux, rel=1e-12)


def test_a_map_s_depths_hold_all_near_contact_and_end_at_the_deepest_press():
    assert map_depths_mm(0.5, 0.2).tolist() == [0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.4, 0.5]
    assert map_depths_mm(0.12, 0.2).tolist() == [0.0, 0.02, 0.05, 0.1, 0.12]


DESIGN = preset("piacenza2017-pair")
FIGURE_DEPTH_MM = depth_schedule_mm(5.0)
READOUT = Readout(counts_per_flux=5e4, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003)
STEPS = FIGURES.index("resolvable_steps")


def curves_with(error: float, pair=(0, 0)) -> PairCurves:
    """A signal that falls from 500 counts to 50, evenly in depth."""
    total = 1e-2 * (1.0 - 0.18 * FIGURE_DEPTH_MM)
    return PairCurves(
        pair=pair,
        press_mm=(10.0, 10.0),
        depth_mm=FIGURE_DEPTH_MM,
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
