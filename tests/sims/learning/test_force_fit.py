"""Modulus and relaxation from a load cell's force under known presses."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.load_protocol import StandardLinearSolid, viscoelastic_load_n
from optopad.sims.contact.scope import contact_of
from optopad.sims.learning.force_checks import band_mpa, modulus_notes, tare_notes
from optopad.sims.learning.force_fit import ForceFit, fit_force
from optopad.sims.learning.press_force import (
    EXCESS,
    LOG_TIME,
    TABLE_MM,
    TING,
    UNKNOWNS,
    PressWindow,
    TipPath,
    force_at,
    press_windows,
    relaxing_part,
    smoothed,
    spans,
)
from tests.sims.contact.test_viscoelastic import ting_load, triangle

PAD = preset("piacenza2017-pad")
ELASTIC = StandardLinearSolid(relaxed_share=0.0, time_constant_s=1.0)
SOLID = StandardLinearSolid(relaxed_share=0.08, time_constant_s=1.0)
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
        solved = solved_press(contact_of(PAD), 4.6, at_mm=(float(x), float(y)))
        elastic = factor * (1.0 + trend * k / count) * np.array([solved.force_n(float(one)) for one in true])
        time_s.append(now + own)
        press_mm.append(np.stack([np.full(len(own), x), np.full(len(own), y), depth], axis=1))
        force_n.append(np.maximum(viscoelastic_load_n(own, elastic, solid), 0.0))
        now += knots[-1]
    force = np.concatenate(force_n)
    noise = noise_n * rng.standard_normal(len(force))
    return np.concatenate(time_s), np.concatenate(press_mm), force + TARE_N + noise


def fitted(time_s: np.ndarray, press_mm: np.ndarray, force_n: np.ndarray, late_s: float = 0.0) -> ForceFit:
    """The fit of a log whose times are late by a latency."""
    return fit_force(PAD, time_s + late_s, TipPath(time_s=time_s, press_mm=press_mm), force_n)


def holds(found: ForceFit, modulus: float, share: float, tau: float, zero_mm: float) -> bool:
    """Whether the true values are in the stated intervals, and a relaxation was found where there is one."""
    truth = {
        "youngs_modulus_mpa": modulus * found.design_mpa,
        "relaxed_share": share,
        "depth_offset_mm": zero_mm,
    }
    truth |= {"time_constant_s": tau} if share else {}
    inside = all(
        name in found.intervals and found.intervals[name][0] <= value <= found.intervals[name][1]
        for name, value in truth.items()
    )
    return inside and (found.time_constant_s is None) == (share == 0.0)


def stepped(time_s: np.ndarray, press_mm: np.ndarray, *, late: bool) -> np.ndarray:
    """Labels that jump: set after the motion and until the next one (late), or before it and until the hold ends."""
    labels = press_mm.copy()
    for begin, end, _ in spans(TipPath(time_s=time_s, press_mm=press_mm)):
        depth = press_mm[begin:end, 2]
        held = np.flatnonzero(depth > depth.max() - 1e-6) + begin
        labels[begin:end, 2] = -1.0
        labels[held[0] if late else begin : end if late else held[-1] + 1, 2] = depth.max()
    return labels


def test_modulus_relaxation_zero_of_depth_and_latency_are_found():
    found = fitted(*pressed(8, 0.7, SOLID, offset_mm=0.04), late_s=0.05)
    assert found.modulus_mpa == pytest.approx(0.7 * found.design_mpa, rel=0.002)
    assert found.relaxed_share == pytest.approx(0.08, abs=0.002)
    assert found.time_constant_s == pytest.approx(1.0, rel=0.05)
    assert found.offset_mm == pytest.approx(0.04, abs=0.003)
    assert found.clock_s == pytest.approx(-0.05, abs=0.002)
    assert holds(found, 0.7, 0.08, 1.0, 0.04)
    made = found.applied(PAD)
    assert made.elastomer.youngs_modulus_mpa == pytest.approx(found.modulus_mpa, rel=1e-4)
    assert made.elastomer.viscoelastic is not None
    assert made.elastomer.viscoelastic.relaxed_share == pytest.approx(found.relaxed_share, rel=1e-3)


def test_an_elastic_pad_has_no_relaxation_although_the_log_is_late():
    found = fitted(*pressed(6, 1.3), late_s=0.05)
    assert (found.time_constant_s, found.time_sigma_s) == (None, None)
    assert found.applied(PAD).elastomer.viscoelastic is None
    assert found.modulus_mpa == pytest.approx(1.3 * found.design_mpa, rel=0.002)
    assert holds(found, 1.3, 0.0, 1.0, 0.0)
    assert found.intervals["relaxed_share"][1] < 0.05
    assert "relaxes   not found" in found.lines[1]


@pytest.mark.full
def test_the_stated_error_is_that_of_many_repetitions():
    solid = StandardLinearSolid(relaxed_share=0.05, time_constant_s=1.0)
    found = [
        fitted(*pressed(12, 1.0, solid, offset_mm=0.02, depth_error_mm=0.03, seed=seed)) for seed in range(8)
    ]
    miss = np.array([(one.modulus_mpa / one.design_mpa - 1.0) / one.relative_sigma for one in found])
    assert 0.3 < np.sqrt(np.mean(miss**2)) < 1.5  # noise counts twice, so errors are stated too large
    stated = np.median([one.relative_sigma for one in found])
    assert 0.003 < stated < 0.03
    assert all(4 <= one.sufficient < 40 for one in found)


@pytest.mark.slow
def test_logs_of_many_kinds_have_the_true_values_in_the_stated_intervals():
    time_s, press_mm, force_n = pressed(6, 0.7, SOLID)
    top_n = force_n.max() - TARE_N

    def sampled(rate: float) -> tuple[np.ndarray, np.ndarray]:
        own = np.arange(0.0, time_s[-1], 1.0 / rate)
        return own, np.interp(own, time_s, force_n)

    path = TipPath(time_s=time_s, press_mm=press_mm)
    logs = {f"{rate} Hz": sampled(rate) for rate in (80.0, 9.7, 5.0)}
    logs |= {
        f"drift {share}": (time_s, force_n + share * top_n * time_s / time_s[-1]) for share in (0.1, 0.5)
    }
    logs |= {f"clock {rate}": (time_s * (1.0 + rate) - 0.1, force_n) for rate in (0.0005, 0.003)}
    for name, log in logs.items():
        assert holds(fit_force(PAD, log[0], path, log[1]), 0.7, 0.08, 1.0, 0.0), name


@pytest.mark.slow
def test_labels_that_jump_give_the_right_values_from_the_holds_alone():
    time_s, press_mm, force_n = pressed(6, 0.7, SOLID)
    for late in (True, False):
        labels = stepped(time_s, press_mm, late=late)
        found = fit_force(PAD, time_s, TipPath(time_s=time_s, press_mm=labels), force_n)
        assert holds(found, 0.7, 0.08, 1.0, 0.0)
        assert "holds are used" in found.notes[0]


@pytest.mark.slow
def test_a_pad_that_hardens_shows_a_trend():
    found = fitted(*pressed(8, 1.0, trend=0.1))
    change, error = found.trend
    assert change == pytest.approx(0.0875, abs=0.02)
    assert change > 3 * error
    assert "the modulus changed by +" in found.lines[-1]


@pytest.mark.slow
def test_a_force_that_fits_no_press_is_refused():
    time_s, press_mm, force_n = pressed(6, 1.0)
    path = TipPath(time_s=time_s, press_mm=press_mm)
    half = time_s < time_s[-1] / 2
    with pytest.raises(InputError, match=r"covers \d of 6 presses .* needs 4: it has 25 samples a second"):
        fit_force(PAD, time_s[half], path, force_n[half])
    with pytest.raises(InputError, match="is its sign reversed"):
        fit_force(PAD, time_s, path, -force_n)
    with pytest.raises(InputError, match="6 presses"):
        fit_force(PAD, time_s, TipPath(time_s=time_s[::25], press_mm=press_mm[::25]), force_n)
    with pytest.raises(InputError, match="follow the presses"):
        fit_force(PAD, time_s, path, np.roll(force_n, len(force_n) // 2))


def test_a_fit_outside_the_material_s_band_is_refused_with_the_unit_that_fits():
    low, high = band_mpa(PAD)
    assert (low, high) == (0.66, 1.49)
    for factor, unit in (
        (1.0 / 9.80665e-3, "grams"),
        (1e3, "millinewtons"),
        (0.1020, "kilograms"),
        (0.2248, "pounds"),
        (41200.0, "raw counts"),
    ):
        modulus = 0.7 * factor if factor > 1.0 else 1.4 * factor
        with pytest.raises(InputError, match=f"is the force in ([a-z ]+ or )?{unit}"):
            modulus_notes(PAD, (0.99 * modulus, 1.01 * modulus))
    with pytest.raises(InputError, match=r"factor of 1\.5 .* give elastomer\.youngs_modulus_mpa"):
        modulus_notes(PAD, (2.25, 2.35))
    assert modulus_notes(PAD, (1.4, 1.6)) == ()
    assert "warning: the fitted modulus, 1.8 MPa" in modulus_notes(PAD, (1.7, 1.9))[0]
    own = PAD.with_(**{"elastomer.youngs_modulus_mpa": 0.2})
    assert band_mpa(own) == (0.1, 0.4)


def test_presses_at_the_end_of_the_cell_s_range_are_left_out_or_refused():
    time_s, press_mm, force_n = pressed(7, 0.7)
    path, top = TipPath(time_s=time_s, press_mm=press_mm), force_n.max()
    found = fit_force(PAD, time_s, path, np.minimum(force_n, 0.85 * top))
    assert len(found.single_mpa) == 5
    assert "presses left out" in found.notes[0]
    assert holds(found, 0.7, 0.0, 1.0, 0.0)
    with pytest.raises(InputError, match="needs 4"):
        fit_force(PAD, time_s, path, np.minimum(force_n, 0.2 * top))
    with pytest.raises(InputError, match="cuts off below"):
        fit_force(PAD, time_s, path, np.maximum(force_n, 0.4))


def test_a_drift_of_the_tare_is_reported():
    time_s, press_mm, force_n = pressed(4, 0.7)
    windows = press_windows(PAD, TipPath(time_s=time_s, press_mm=press_mm), time_s, force_n + 0.1 * time_s)
    assert "rest drifts" in tare_notes(windows)[0]
    still = press_windows(PAD, TipPath(time_s=time_s, press_mm=press_mm), time_s, force_n)
    assert tare_notes(still) == ()


def hertz_window(time_s: np.ndarray, depth_mm: np.ndarray) -> PressWindow:
    """A press whose elastic force is depth^1.5 N."""
    return PressWindow(
        node_s=time_s,
        node_mm=depth_mm,
        rounded_mm=depth_mm,
        turn=int(np.argmax(depth_mm)),
        table_n=np.arange(0.0, 1.5, TABLE_MM) ** 1.5,
        time_s=time_s,
        force_n=np.zeros(len(time_s)),
        rests=(0, 0),
        used=np.ones(len(time_s), dtype=bool),
    )


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_the_retraction_is_tings_solution_or_that_of_an_elastic_contact(share: float) -> None:
    solid = StandardLinearSolid(relaxed_share=share, time_constant_s=1.0)
    time_s, depth_mm = triangle(1.0, 1.0, samples=200)
    window, unknowns = hertz_window(time_s, depth_mm), np.zeros(UNKNOWNS)
    unknowns[[EXCESS, LOG_TIME, TING]] = solid.excess, 0.0, 1.0
    expected = ting_load(time_s[::20], solid)
    found = force_at(window, unknowns, 0.0)
    np.testing.assert_allclose(found[::20], expected, atol=1e-4 * expected.max())  # steps of 5 ms
    unknowns[TING] = 0.0
    elastic = np.maximum(viscoelastic_load_n(time_s, depth_mm**1.5, solid), 0.0)
    np.testing.assert_allclose(force_at(window, unknowns, 0.0), elastic, atol=1e-4 * elastic.max())


def test_the_relaxing_part_is_that_of_the_load_protocol_over_any_span() -> None:
    time_s = np.cumsum(np.random.default_rng(0).uniform(0.0, 0.2, 2000))
    load = 1.0 - np.cos(time_s)
    for tau in (0.01, 0.05, 3.0):  # exp(span/τ) overflows for the first
        solid = StandardLinearSolid(relaxed_share=0.5, time_constant_s=tau)
        expected = viscoelastic_load_n(time_s, load, solid) - load
        first = load[0] * np.exp(-(time_s - time_s[0]) / tau)  # the window starts at rest
        np.testing.assert_allclose(relaxing_part(time_s / tau, load), expected - first, atol=1e-9)


def test_noise_of_the_depth_is_smoothed_and_its_corners_stay() -> None:
    time_s = np.arange(0.0, 4.0, 0.005)
    depth = np.interp(time_s, [0.0, 1.0, 2.0, 3.0, 4.0], [-1.0, -1.0, 2.0, 2.0, -1.0])
    noisy = depth + 0.002 * np.random.default_rng(0).standard_normal(len(depth))
    off = smoothed(time_s, noisy) - depth
    assert off.std() < 0.6 * 0.002
    assert np.abs(off).max() < 0.008
    np.testing.assert_array_equal(smoothed(time_s, depth), depth)


def test_flicker_of_the_depth_near_zero_does_not_divide_a_press() -> None:
    depth = np.array([-1.0, 0.001, -0.001, 0.002, 1.0, 1.0, 0.001, -0.001, 0.001, -1.0, -1.0, 0.5, -1.0])
    path = TipPath(time_s=0.04 * np.arange(len(depth)), press_mm=np.column_stack([depth, depth, depth]))
    assert path.contacts.tolist() == [[1, 9], [11, 12]]
    assert [len(times) for times in path.touches_s] == [2, 2]


def test_an_unknown_stretch_divides_presses_and_pauses() -> None:
    depth = np.array([-1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
    path = TipPath(
        time_s=np.arange(13.0),
        press_mm=np.column_stack([depth, depth, depth]),
        after_unknown=np.array([4, 9, 12]),
    )
    assert path.contacts.tolist() == [[1, 3], [6, 7], [8, 9], [9, 10], [11, 12]]
    assert [len(times) for times in path.touches_s] == [4, 3]
    assert [(begin, end, rows.start, rows.stop) for begin, end, rows in spans(path)] == [
        (1, 3, 0, 4),
        (6, 7, 4, 8),
    ]
