"""The linear layer under pressed objects against closed forms and other code, and the solver of unilateral contact."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from optopad.design.arrays import FloatArray
from optopad.design.preset import preset
from optopad.design.shape.cavity import Plan
from optopad.design.shape.outline import outline_in
from optopad.design.shape.top import Top
from optopad.sims.contact import walls
from optopad.sims.contact.held import layer
from optopad.sims.contact.held.layer import WideLayer, pad_layer, wide_compliance
from optopad.sims.contact.held.solve import contact_pressure
from optopad.sims.contact.scope import contact_of


def test_a_small_ball_and_a_punch_on_a_thick_layer_are_those_of_hertz_and_sneddon() -> None:
    step, thickness = 0.06, 40.0
    x = (np.arange(51) - 25) * step
    radius = np.hypot(x[:, None], x)
    wide = WideLayer(thickness, (step, step), radius.shape).within(radius.shape)

    def force(gap: FloatArray) -> float:
        return float(contact_pressure(wide.moved, gap, 1e-6, np.maximum(-gap, 0.0))[0].sum()) * step**2

    def confined(contact_radius: float) -> float:
        """Stiffening by the floor, first order (Dimitriadis et al. 2002, bonded and incompressible)."""
        return 1.0 + 1.133 * contact_radius / thickness

    depth, ball, punch = 0.1, 10.0, 16.25 * step
    hertz = 16.0 / 3.0 * math.sqrt(ball) * depth**1.5 * confined(math.sqrt(ball * depth))
    assert force(radius**2 / (2.0 * ball) - depth) == pytest.approx(hertz, rel=0.01)
    covered = math.sqrt((radius <= punch).sum() * step**2 / math.pi)
    sneddon = 8.0 * covered * depth * confined(covered)
    assert force(np.where(radius <= punch, -depth, np.inf)) == pytest.approx(sneddon, rel=0.015)


def test_a_window_of_the_wide_layer_answers_as_the_whole() -> None:
    whole = WideLayer(5.0, (0.3, 0.3), (60, 50))
    load = np.zeros((60, 50))
    load[20:31, 14:30] = np.random.default_rng(1).random((11, 16))
    window = whole.within((11, 16)).moved(load[20:31, 14:30])
    np.testing.assert_allclose(window, whole.moved(load)[20:31, 14:30], atol=1e-12)


def test_a_long_cylinder_is_that_of_an_active_set() -> None:
    count, length, thickness, depth = 512, 120.0, 9.0, 0.5
    x = (np.arange(count) - count // 2) * length / count
    compliance = wide_compliance(np.abs(2.0 * np.pi * np.fft.fftfreq(count, length / count)), thickness)
    gap = np.where(np.abs(x) < 5.0, 5.0 - np.sqrt(np.maximum(25.0 - x**2, 0.0)), np.inf) - depth

    def moved(load: FloatArray) -> FloatArray:
        return np.fft.ifft(np.fft.fft(load) * compliance).real

    found, _ = contact_pressure(moved, gap, 1e-9, np.maximum(-gap, 0.0))
    green = np.fft.ifft(compliance).real
    on = gap < 0.0
    for _ in range(50):
        at = np.flatnonzero(on)
        wanted = np.zeros(count)
        wanted[at] = np.linalg.solve(green[(at[:, None] - at) % count], -gap[at])
        if (wanted[at] >= 0.0).all():
            break
        on &= wanted > 0.0
    np.testing.assert_allclose(found, wanted, atol=1e-6 * wanted.max())


PAD = contact_of(preset("fingertip-16"))


def load_over(x: FloatArray, at: tuple[float, float], width: float) -> FloatArray:
    """A pressure of unit force around a place, as `walls` has it."""
    square = ((x[:, None] - at[0]) ** 2 + (x - at[1]) ** 2) / width**2
    return 2.5 / (math.pi * width**2) * np.maximum(1.0 - square, 0.0) ** 1.5


def change_of(load: FloatArray, x: FloatArray) -> FloatArray:
    """Downward change of the top by the pad's walls."""
    pad = pad_layer(PAD.draft.plan, PAD.design.cavity.black_thickness_mm)
    splines = pad.at(np.repeat(x, len(x)), np.tile(x, len(x)))
    found = splines @ (pad.coefficients @ (splines.T @ load.ravel())) * (x[1] - x[0]) ** 2
    return np.asarray(found.reshape(load.shape))


@pytest.mark.parametrize("at", [(8.0, 8.0), (5.0, 6.0)])
def test_the_walls_change_the_top_as_other_finite_elements_say(
    at: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    cavity = PAD.design.cavity
    thickness = cavity.clear_thickness_mm + cavity.black_thickness_mm
    x = np.linspace(0.0, cavity.length_mm, 81)
    width = walls.LOAD_RADII[-1]
    found = -change_of(load_over(x, at, width), x)
    size = (cavity.length_mm, cavity.width_mm)
    others = walls._found(thickness, walls.WIDE * thickness, size, at)
    wanted = RectBivariateSpline(others.block.x, others.block.y, others.added[-1])(x, x)
    top = np.abs(others.wide[-1].top_at(np.zeros(1)))[0]
    inner = slice(8, -8)
    assert np.abs((found - wanted)[inner, inner]).max() < 0.01 * top


def test_the_response_of_the_pad_is_symmetric() -> None:
    x = np.linspace(0.0, 16.0, 81)
    one, other = load_over(x, (5.0, 9.0), 1.5), load_over(x, (10.0, 6.0), 2.0)
    assert float((change_of(one, x) * other).sum()) == pytest.approx(
        float((change_of(other, x) * one).sum()), rel=1e-9
    )


@pytest.mark.slow
def test_a_disc_answers_as_finite_elements_that_are_symmetric_about_its_axis() -> None:
    thickness, radius, width = 6.0, 8.0, 2.5
    outline = outline_in("disc", (0.0, 0.0, 2.0 * radius, 2.0 * radius))
    plan = Plan(outline=outline, top=Top(clear_mm=thickness - 1.0, apex_mm=(radius, radius)))
    x = np.linspace(0.0, 2.0 * radius, 81)
    step, load = x[1], load_over(x, (radius, radius), width)
    disc = pad_layer(plan, 1.0)
    splines = disc.at(np.repeat(x, len(x)), np.tile(x, len(x)))
    change = splines @ (disc.coefficients @ (splines.T @ load.ravel())) * step**2
    found = WideLayer(thickness, (step, step), load.shape).moved(load) + change.reshape(load.shape)
    round_layer = walls.RoundLayer(thickness, radius)
    exact = round_layer.field(
        lambda r: 2.5 / (np.pi * width**2) * np.maximum(1.0 - (r / width) ** 2, 0.0) ** 1.5
    )
    away = np.hypot(x[:, None] - radius, x - radius)
    off = np.abs(-found - exact.top_at(away))[away < 0.9 * radius]
    assert off.max() < 0.01 * np.abs(exact.top_at(np.zeros(1)))[0]


def test_a_pad_s_layer_is_kept_between_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    black_mm = PAD.design.cavity.black_thickness_mm
    one = pad_layer(PAD.draft.plan, black_mm)
    layer._found.cache_clear()
    monkeypatch.delattr(layer, "_Quarter")
    np.testing.assert_array_equal(pad_layer(PAD.draft.plan, black_mm).coefficients, one.coefficients)
