"""The relaxing load against closed forms, and against Ting's solution where it is known to differ."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.press_protocol import load_protocol
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.sims.contact import load_protocol as module
from optopad.sims.contact.force_curve import band_factors, force_curve
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.load_protocol import (
    StandardLinearSolid,
    load_history,
    loop_energy_mj,
    protocol_path,
    solid_of,
    viscoelastic_load_n,
)
from optopad.sims.contact.scope import contact_of

SOLID = StandardLinearSolid(relaxed_share=0.3, time_constant_s=2.0)
EXCESS = 0.3 / 0.7
ROUNDING = 1e-12
"""The update is exact for these inputs; what is left is floating-point."""


def triangle(press_s: float, deepest_mm: float, samples: int = 400) -> tuple[FloatArray, FloatArray]:
    """Times and depths of a press and retraction at one rate."""
    time = np.linspace(0.0, 2.0 * press_s, 2 * samples + 1)
    return time, deepest_mm * (1.0 - np.abs(time / press_s - 1.0))


def test_a_held_step_relaxes_as_the_solid_does() -> None:
    time = np.array([0.0, 0.1, 1.0, 2.0, 5.0, 40.0])
    load = viscoelastic_load_n(time, np.full(6, 3.0), SOLID)
    assert load == pytest.approx(3.0 * (1.0 + EXCESS * np.exp(-time / 2.0)), rel=ROUNDING)
    assert load == pytest.approx(3.0 * SOLID.relaxation(time), rel=ROUNDING)


def test_a_step_between_equal_times_is_instantaneous() -> None:
    load = viscoelastic_load_n(np.array([0.0, 0.0]), np.array([0.0, 3.0]), SOLID)
    assert load == pytest.approx([0.0, 3.0 / 0.7], rel=ROUNDING)


def test_a_ramp_of_load_gives_the_closed_form_whatever_the_samples() -> None:
    time = np.array([0.0, 0.01, 0.5, 0.55, 3.0, 9.0])
    expected = 1.5 * time + 1.5 * EXCESS * 2.0 * (1.0 - np.exp(-time / 2.0))
    assert viscoelastic_load_n(time, 1.5 * time, SOLID) == pytest.approx(expected, rel=ROUNDING, abs=1e-15)


def test_a_fast_press_has_the_instantaneous_modulus_and_a_slow_one_the_long_time_modulus() -> None:
    shares = np.linspace(0.0, 1.0, 200)
    elastic = 5.0 * shares**1.5
    fast = viscoelastic_load_n(1e-6 * shares, elastic, SOLID)
    slow = viscoelastic_load_n(1e6 * shares, elastic, SOLID)
    # the ratio of press time to time constant is 5e-7 either way: no more than that relaxes or is left
    assert fast == pytest.approx(elastic / 0.7, rel=1e-6)
    assert slow == pytest.approx(elastic, abs=5.0 * 1e-5)


def test_no_relaxed_share_is_the_elastic_load() -> None:
    time, depth = triangle(1.0, 2.0)
    solid = StandardLinearSolid(relaxed_share=0.0, time_constant_s=2.0)
    assert np.array_equal(viscoelastic_load_n(time, depth**1.5, solid), depth**1.5)


def test_the_load_depends_on_time_over_the_time_constant_only() -> None:
    time, depth = triangle(1.0, 2.0)
    slower = StandardLinearSolid(relaxed_share=0.3, time_constant_s=20.0)
    assert viscoelastic_load_n(10.0 * time, depth, slower) == pytest.approx(
        viscoelastic_load_n(time, depth, SOLID), abs=1e-12
    )


def test_loads_of_two_histories_add_up() -> None:
    time = np.linspace(0.0, 5.0, 50)
    first, second = np.sin(time), time**2
    both = viscoelastic_load_n(time, first + second, SOLID)
    apart = viscoelastic_load_n(time, first, SOLID) + viscoelastic_load_n(time, second, SOLID)
    assert both == pytest.approx(apart, abs=1e-12 * float(np.abs(both).max()))


def test_the_sampled_integral_converges_with_the_square_of_the_step() -> None:
    # between samples the elastic load is a straight line: its error, and the load's, is of second order
    def last(samples: int) -> float:
        time = np.linspace(0.0, 2.0, samples + 1)
        return float(viscoelastic_load_n(time, time**3, SOLID)[-1])

    exact = last(40000)
    errors = np.array([abs(last(samples) - exact) for samples in (10, 20, 40, 80)])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([2.0, 2.0, 2.0], abs=0.05)


def test_the_work_lost_in_a_linear_cycle_is_the_closed_form() -> None:
    # F = d + e q; q rises by T(1 - exp(-t/T)) over 1 s, then falls from there at rate -1
    time, depth = triangle(1.0, 1.0, samples=20000)
    tau = 2.0
    decay = np.exp(-1.0 / tau)
    risen = tau * (1.0 - decay)
    rising = tau * (1.0 - risen)
    falling = (risen + tau) * tau * (1.0 - decay) - tau
    expected = EXCESS * (rising - falling)
    lost = loop_energy_mj(depth, viscoelastic_load_n(time, depth, SOLID))
    assert lost == pytest.approx(expected, rel=1e-8)  # trapezia of 1/20000 s: (5e-5)^2 / 12 / tau^2


@settings(deadline=None, max_examples=200)
@given(
    share=st.floats(0.0, 0.95),
    tau=st.floats(1e-3, 1e3),
    power=st.floats(1.0, 2.5),
    cycles=st.integers(1, 4),
)
def test_cycles_of_press_and_retract_never_give_work_back(
    share: float, tau: float, power: float, cycles: int
) -> None:
    time, depth = triangle(1.0, 1.0, samples=100)
    time = np.concatenate([time + 2.0 * number for number in range(cycles)])
    depth = np.tile(depth, cycles)
    solid = StandardLinearSolid(relaxed_share=share, time_constant_s=tau)
    load = np.maximum(viscoelastic_load_n(time, depth**power, solid), 0.0)
    assert loop_energy_mj(depth, load) >= -1e-9 * float(load.max())  # 800 rounded terms


def ting_load(time: FloatArray, solid: StandardLinearSolid) -> FloatArray:
    """Ting 1966 for d = 1 - |t - 1| and a Hertz contact of unit stiffness: F = d^1.5 for an elastic layer."""
    tau = solid.time_constant_s

    def memory(span: float) -> float:
        return span + solid.excess * tau * (1.0 - float(np.exp(-span / tau)))

    def load(now: float) -> float:
        last = now
        if now > 1.0:  # the time in the press at which the contact was as large as now

            def balance(then: float) -> float:
                return memory(now - then) - 2.0 * memory(now - 1.0)

            if balance(0.0) <= 0.0:
                return 0.0
            last = float(brentq(balance, 0.0, 1.0))
        return float(
            quad(lambda then: float(solid.relaxation(np.array(now - then))) * 1.5 * then**0.5, 0.0, last)[0]
        )

    return np.array([load(float(now)) for now in time])


@pytest.mark.parametrize(
    ("share", "most_load", "most_work"), [(0.1, 0.02, 0.16), (0.3, 0.04, 0.12), (0.5, 0.05, 0.08)]
)
def test_tings_solution_is_met_in_the_press_and_missed_by_the_stated_amount_in_retraction(
    share: float, most_load: float, most_work: float
) -> None:
    solid = StandardLinearSolid(relaxed_share=share, time_constant_s=1.0)
    time, depth = triangle(1.0, 1.0, samples=200)
    ours = np.maximum(viscoelastic_load_n(time, depth**1.5, solid), 0.0)
    ting = ting_load(time[::10], solid)
    miss = np.abs(ours[::10] - ting) / ting.max()
    assert miss[: miss.size // 2 + 1].max() < 1e-6  # straight lines between 200 samples of d^1.5
    assert 0.5 * most_load < miss.max() < most_load  # what the module says it leaves out
    work = loop_energy_mj(depth[::10], ours[::10]) / loop_energy_mj(depth[::10], ting) - 1.0
    assert 0.0 < work < most_work


def test_times_out_of_order_are_refused() -> None:
    with pytest.raises(InputError, match="sort the samples"):
        viscoelastic_load_n(np.array([0.0, 2.0, 1.0]), np.zeros(3), SOLID)
    with pytest.raises(InputError, match="one time per load"):
        viscoelastic_load_n(np.array([0.0, 2.0]), np.zeros(3), SOLID)


def test_the_option_is_off_unless_the_design_asks_for_it() -> None:
    design = preset("piacenza2017-pad")
    assert solid_of(design) is None
    asked = design.with_(
        **{"elastomer.viscoelastic.relaxed_share": 0.3, "elastomer.viscoelastic.time_constant_s": 2.0}
    )
    assert solid_of(asked) == SOLID


PAPER = load_protocol("piacenza2017")
GEL = StandardLinearSolid(relaxed_share=0.2, time_constant_s=5.0)


def hertz_like(depth_mm: float) -> float:
    return 3.3 * depth_mm**1.5


def test_the_papers_protocol_goes_in_five_steps_and_out_with_pauses_of_ten_seconds() -> None:
    time, depth, ends = protocol_path(PAPER)
    assert depth[ends].tolist() == [1, 2, 3, 4, 5, 4, 3, 2, 1, 0]
    assert time[ends] == pytest.approx(11.0 * np.arange(1, 11))  # 1 s of driving at 1 mm/s, 10 s of waiting
    still = np.isclose(np.diff(depth), 0.0)
    assert np.diff(time)[still].sum() == pytest.approx(100.0)
    assert np.abs(np.diff(depth))[~still] / np.diff(time)[~still] == pytest.approx(1.0)


def test_without_relaxation_the_load_is_the_elastic_one_and_no_work_is_lost() -> None:
    history = load_history(PAPER, hertz_like)
    assert np.array_equal(history.load_n, history.elastic_n)
    assert not history.has_relaxation
    assert not history.has_left.any()
    assert history.lost_mj == pytest.approx(0.0, abs=1e-9 * float(history.load_n.max()))


def test_relaxation_shows_higher_loads_in_than_out_and_loses_work() -> None:
    history = load_history(PAPER, hertz_like, GEL)
    ends, steps = history.pause_ends, PAPER.steps
    inward, outward = history.load_n[ends[: steps - 1]], history.load_n[ends[steps:-1]][::-1]
    assert np.all(inward > outward)
    assert history.lost_mj > 0.0
    assert history.depth_mm[history.turn] == 5.0


def test_a_pause_relaxes_towards_the_elastic_load_at_the_solids_rate() -> None:
    history = load_history(PAPER, hertz_like, GEL)
    first, last = history.pause_ends[0] - module.SAMPLES_PER_STEP, history.pause_ends[0]
    excess = history.load_n - history.elastic_n
    assert excess[last] / excess[first] == pytest.approx(np.exp(-10.0 / 5.0), rel=1e-12)  # 10 s, exactly


def test_a_tip_that_would_have_to_pull_has_left_and_feels_nothing() -> None:
    history = load_history(PAPER, hertz_like, GEL)
    assert history.load_n.min() == 0.0
    assert history.has_left[-1]
    assert np.all(history.load_n[history.has_left] == 0.0)


def test_finer_sampling_changes_the_load_by_less_than_1e_5_of_its_peak(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    coarse = load_history(PAPER, hertz_like, GEL)
    monkeypatch.setattr(module, "SAMPLES_PER_STEP", 10 * module.SAMPLES_PER_STEP)
    fine = load_history(PAPER, hertz_like, GEL)
    found = np.interp(coarse.time_s, fine.time_s, fine.load_n)
    assert np.abs(found - coarse.load_n).max() < 1e-5 * float(fine.load_n.max())


DEPTH_MM = np.array([0.0, 0.5, 1.0, 2.0, 3.0])
PAD = preset("piacenza2017-pad")


def test_the_band_is_that_of_the_catalogues_modulus() -> None:
    curve = force_curve(solved_press(contact_of(PAD)), DEPTH_MM)
    young = modulus(PAD)
    assert young.low is not None
    assert young.high is not None
    assert curve.low_n == pytest.approx(curve.force_n * young.low / young.value, rel=ROUNDING)
    assert curve.high_n == pytest.approx(curve.force_n * young.high / young.value, rel=ROUNDING)
    assert curve.has_band


def test_the_load_at_the_low_modulus_is_the_load_of_a_pad_of_that_modulus() -> None:
    low = modulus(PAD).low
    softer = PAD.with_(**{"elastomer.youngs_modulus_mpa": low})
    band = force_curve(solved_press(contact_of(PAD)), DEPTH_MM).low_n
    own = force_curve(solved_press(contact_of(softer)), DEPTH_MM)
    assert own.force_n == pytest.approx(band, rel=ROUNDING)
    assert not own.has_band
    assert np.array_equal(own.low_n, own.high_n)


@pytest.mark.parametrize(("ratio", "expected"), [(10.0, 2.0), (20.0, 1.0), (30.0, 2.0 / 3.0)])
def test_the_mixing_ratio_sets_the_load(ratio: float, expected: float) -> None:
    mixed: SensorDesign = PAD.with_(**{"elastomer.mixing_ratio": ratio})
    load = force_curve(solved_press(contact_of(mixed)), DEPTH_MM).force_n[-1]
    unit = force_curve(solved_press(contact_of(PAD)), DEPTH_MM).force_n[-1]
    assert load / unit == pytest.approx(expected, rel=1e-5)  # E = 20 MPa / ratio, to the catalogue's digits


def test_the_load_starts_at_nothing_and_rises() -> None:
    curve = force_curve(solved_press(contact_of(PAD)), DEPTH_MM)
    assert curve.force_n[0] == curve.contact_radius_mm[0] == 0.0
    assert np.all(np.diff(curve.force_n) > 0.0)
    assert curve.at(1.0) == (curve.force_n[2], curve.low_n[2], curve.high_n[2])
    assert curve.contact_radius_at(1.0) == curve.contact_radius_mm[2]


def test_a_value_without_a_band_has_factors_of_one() -> None:
    assert band_factors(modulus(PAD).model_copy(update={"low": None, "high": None})) == (1.0, 1.0)
