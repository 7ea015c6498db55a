"""Presses of rigid objects into a pad: laws that hold for any object, and balls against the library of presses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.sims.contact.held.press import HeldPress, edge_level, grid_of, held_press
from optopad.sims.contact.pad_surface import pad_surface
from optopad.sims.contact.scope import contact_of

PAD = contact_of(preset("fingertip-16"))
RADIUS = PAD.tip_radius_mm
MIDDLE = (8.0, 8.0)


def ball(at_mm: tuple[float, float] = MIDDLE, x_mm: float = 0.0, y_mm: float = 0.0) -> FloatArray:
    """The design's ball over a place of the press frame at a location."""
    x, y = grid_of(PAD, at_mm)
    square = (x[:, None] - x_mm) ** 2 + (y - y_mm) ** 2
    drop = RADIUS - np.sqrt(np.maximum(RADIUS**2 - square, 0.0))
    return np.where(square < RADIUS**2, drop, np.inf)


def cylinder() -> FloatArray:
    """A lying cylinder along x of 2 mm radius and 6 mm length."""
    x, y = grid_of(PAD, MIDDLE)
    drop = np.where(np.abs(y) < 2.0, 2.0 - np.sqrt(np.maximum(4.0 - y**2, 0.0)), np.inf)
    return np.where(np.abs(x[:, None]) <= 3.0, drop, np.inf)


def cell_mm2(press: HeldPress) -> float:
    """Area of a cell of the grid."""
    return float(np.diff(press.top.x_mm[:2])[0] * np.diff(press.top.y_mm[:2])[0])


@pytest.mark.parametrize("at_mm", [MIDDLE, (5.0, 5.5)])
@pytest.mark.parametrize("depth_mm", [0.3, 0.8, 1.3])
def test_a_ball_is_pressed_as_in_the_library_of_solved_presses(
    at_mm: tuple[float, float], depth_mm: float
) -> None:
    press = held_press(PAD, at_mm, ball(at_mm), depth_mm=depth_mm)
    solved = pad_surface(PAD.design, depth_mm, at_mm)
    assert press.force_n == pytest.approx(solved.near.force_n, rel=0.045)
    assert math.sqrt(press.area_mm2 / math.pi) == pytest.approx(solved.near.contact_radius_mm, rel=0.05)
    top = press.top
    wanted = solved.height_mm(top.x_mm + at_mm[0], top.y_mm + at_mm[1])
    radius = np.hypot(top.x_mm[:, None], top.y_mm)
    off = (top.height_mm - wanted)[radius > solved.near.contact_radius_mm]
    assert np.abs(off).max() < 0.05 * depth_mm
    assert math.sqrt(np.mean(off**2)) < 0.01 * depth_mm


def test_the_force_is_that_of_the_pressure_and_the_volume_stays() -> None:
    press = held_press(PAD, MIDDLE, cylinder(), depth_mm=0.8)
    assert press.force_n == pytest.approx(float(press.pressure_mpa.sum()) * cell_mm2(press), rel=1e-12)
    assert press.pressure_mpa.min() == 0.0
    dimple = float(-np.minimum(press.top.height_mm, 0.0).sum())
    assert abs(float(press.top.height_mm.sum())) < 0.01 * dimple


def test_inside_the_contact_the_top_is_the_object_and_outside_it_is_below() -> None:
    bottoms = cylinder()
    press = held_press(PAD, MIDDLE, bottoms, depth_mm=0.8)
    touching = press.pressure_mpa > 0.0
    np.testing.assert_allclose(press.top.height_mm[touching], bottoms[touching] - 0.8, rtol=0.0, atol=1e-12)
    assert (press.top.height_mm <= bottoms - 0.8 + 1e-5).all()
    assert ((press.top.level > 0.0) == touching).mean() > 0.999
    for side in (press.top.height_mm[0], press.top.height_mm[:, -1]):
        assert np.abs(side).max() < 1e-3


def test_a_turned_object_gives_the_turned_answer() -> None:
    one = held_press(PAD, MIDDLE, cylinder(), depth_mm=0.8)
    other = held_press(PAD, MIDDLE, cylinder().T, depth_mm=0.8)
    assert other.force_n == pytest.approx(one.force_n, rel=1e-6)
    np.testing.assert_allclose(other.top.height_mm, one.top.height_mm.T, atol=1e-6)


def test_no_depth_and_no_force_change_nothing() -> None:
    for asked in ({"depth_mm": 0.0}, {"force_n": 0.0}):
        press = held_press(PAD, MIDDLE, ball(), **asked)
        assert press.force_n == press.area_mm2 == press.depth_mm == 0.0
        assert not press.top.height_mm.any()
        assert not press.pressure_mpa.any()
        assert (press.top.level < 0.0).all()


def test_a_force_finds_the_depth() -> None:
    press = held_press(PAD, MIDDLE, cylinder(), depth_mm=0.7)
    found = held_press(PAD, MIDDLE, cylinder(), force_n=press.force_n)
    assert found.depth_mm == pytest.approx(0.7, rel=1e-4)
    assert found.force_n == pytest.approx(press.force_n, rel=1e-4)


def test_the_level_of_a_small_ball_s_contact_is_its_distance_from_the_edge() -> None:
    step, radius = 0.16, 1.234  # Hertz: pressure and gap of a ball of 5 mm
    x = np.arange(-20, 21) * step
    away = np.hypot(x[:, None] - 0.03, x - 0.05) / radius
    inner, outer = np.minimum(away, 1.0), np.maximum(away, 1.0)
    pressure = 8.0 / math.pi * radius / 5.0 * np.sqrt(1.0 - inner**2)
    rise = (2.0 - outer**2) * np.arcsin(1.0 / outer) + np.sqrt(outer**2 - 1.0)
    gap = radius**2 / 5.0 * (0.5 * outer**2 - 1.0 + rise / math.pi)
    level = edge_level(pressure, gap, step)
    near = np.abs(away - 1.0) * radius < 0.7 * step
    np.testing.assert_allclose(level[near], ((1.0 - away) * radius)[near], atol=0.15 * step)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"depth_mm": math.nan}, "finite"),
        ({"depth_mm": -0.1}, "0 or more"),
        ({}, "one of both"),
        ({"depth_mm": 1.0, "force_n": 1.0}, "one of both"),
    ],
)
def test_bad_numbers_are_refused(asked: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        held_press(PAD, MIDDLE, ball(), **asked)


@pytest.mark.parametrize(
    ("bottoms", "asked", "said"),
    [
        (ball(), {"depth_mm": 3.5}, "deeper than the model"),
        (ball(), {"force_n": 500.0}, "more than the model covers"),
        (np.full_like(ball(), np.inf), {"depth_mm": 1.0}, "over the pad"),
        (np.zeros_like(ball()), {"depth_mm": 1.0}, "rim"),
        (ball(x_mm=5.8), {"depth_mm": 1.0}, "wall"),
    ],
)
def test_a_press_outside_the_model_is_refused(
    bottoms: FloatArray, asked: dict[str, float], said: str
) -> None:
    with pytest.raises(ModelScopeError, match=said):
        held_press(PAD, MIDDLE, bottoms, **asked)


def test_heights_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="bottoms"):
        held_press(PAD, MIDDLE, ball()[:-1], depth_mm=0.5)
    with pytest.raises(InputError, match="bottoms"):
        held_press(PAD, MIDDLE, np.full_like(ball(), np.nan), depth_mm=0.5)
