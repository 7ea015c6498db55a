"""Modulus and relaxation from a load cell's force under known presses."""

from __future__ import annotations

import numpy as np
import pytest

from design.errors import InputError
from design.preset import preset
from sims.contact.indentation import solved_press
from sims.contact.load_protocol import StandardLinearSolid, viscoelastic_load_n
from sims.learning.force_fit import fit_force

PAD = preset("piacenza2017-pad")
ELASTIC = StandardLinearSolid(relaxed_share=0.0, time_constant_s=1.0)
TARE_N = 0.3


def pressed(
    count: int,
    factor: float,
    solid: StandardLinearSolid = ELASTIC,
    *,
    offset_mm: float = 0.0,
    depth_error_mm: float = 0.0,
    noise_n: float = 0.005,
    trend: float = 0.0,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, presses and force of presses at random places and depths, each held for three seconds.

    offset_mm, depth_error_mm : true depth minus the stage's, for all presses, and its scatter from press to press
    """
    rng = np.random.default_rng(seed)
    time_s, press_mm, force_n, now = [], [], [], 0.0
    for k in range(count):
        (x, y), deepest = rng.uniform(8.0, 24.0, 2), rng.uniform(0.8, 4.0)
        knots = np.cumsum([0.0, rng.uniform(0.8, 2.0), 0.3 + deepest / 4, 3.0, 0.4])
        own = np.arange(0.0, knots[-1], 0.04)
        depth = np.interp(own, knots, [-1.0, -1.0, deepest, deepest, -1.0])
        true = np.maximum(depth + offset_mm + depth_error_mm * rng.standard_normal(), 0.0)
        solved = solved_press(PAD, 4.6, at_mm=(float(x), float(y)))
        elastic = factor * (1.0 + trend * k / count) * np.array([solved.force_n(float(one)) for one in true])
        time_s.append(now + own)
        press_mm.append(np.stack([np.full(len(own), x), np.full(len(own), y), depth], axis=1))
        force_n.append(np.maximum(viscoelastic_load_n(own, elastic, solid), 0.0))
        now += knots[-1]
    force = np.concatenate(force_n)
    noise = noise_n * rng.standard_normal(len(force))
    return np.concatenate(time_s), np.concatenate(press_mm), force + TARE_N + noise


def test_modulus_relaxation_and_zero_of_depth_are_found():
    solid = StandardLinearSolid(relaxed_share=0.08, time_constant_s=1.0)
    found = fit_force(PAD, *pressed(10, 0.7, solid, offset_mm=0.04))
    assert found.modulus_mpa == pytest.approx(0.7 * found.design_mpa, rel=0.002)
    assert found.relaxed_share == pytest.approx(0.08, abs=0.002)
    assert found.time_constant_s == pytest.approx(1.0, rel=0.05)
    assert found.offset_mm == pytest.approx(0.04, abs=0.003)
    made = found.applied(PAD)
    assert made.elastomer.youngs_modulus_mpa == pytest.approx(found.modulus_mpa, rel=1e-4)
    assert made.elastomer.viscoelastic is not None
    assert made.elastomer.viscoelastic.relaxed_share == pytest.approx(found.relaxed_share, rel=1e-3)


def test_an_elastic_pad_has_no_relaxation():
    found = fit_force(PAD, *pressed(8, 1.3))
    assert (found.time_constant_s, found.time_sigma_s) == (None, None)
    assert found.applied(PAD).elastomer.viscoelastic is None
    assert found.modulus_mpa == pytest.approx(1.3 * found.design_mpa, rel=0.002)
    assert "relaxes   not found" in found.lines[1]


@pytest.mark.slow
def test_the_stated_error_is_that_of_many_repetitions():
    solid = StandardLinearSolid(relaxed_share=0.05, time_constant_s=1.0)
    found = [
        fit_force(PAD, *pressed(12, 1.0, solid, offset_mm=0.02, depth_error_mm=0.03, seed=seed))
        for seed in range(8)
    ]
    miss = np.array([(one.modulus_mpa / one.design_mpa - 1.0) / one.relative_sigma for one in found])
    assert 0.5 < np.sqrt(np.mean(miss**2)) < 2.0
    stated = np.median([one.relative_sigma for one in found])
    assert 0.003 < stated < 0.03
    assert all(4 <= one.sufficient < 40 for one in found)


def test_a_pad_that_hardens_shows_a_trend():
    found = fit_force(PAD, *pressed(12, 1.0, trend=0.1))
    change, error = found.trend
    assert change == pytest.approx(0.09, abs=0.02)
    assert change > 3 * error
    assert "the modulus changed by +" in found.lines[-1]


def test_a_force_that_fits_no_press_is_refused():
    time_s, press_mm, force_n = pressed(6, 1.0)
    half = time_s < time_s[-1] / 2
    with pytest.raises(InputError, match=r"covers \d presses .* needs 4: press more often"):
        fit_force(PAD, time_s[half], press_mm[half], force_n[half])
    with pytest.raises(InputError, match="is its sign reversed"):
        fit_force(PAD, time_s, press_mm, -force_n)
