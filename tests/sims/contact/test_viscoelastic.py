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
from optopad.sims.contact.load_protocol import (
    StandardLinearSolid,
    loop_energy_mj,
    solid_of,
    viscoelastic_load_n,
)

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
