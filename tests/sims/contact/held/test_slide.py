"""Objects that move sideways: the response to sideways loads, Mindlin's contact, symmetry, energy, and refusals."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.design.shape.cavity import Plan
from optopad.design.shape.outline import outline_in
from optopad.design.shape.top import Top
from optopad.sims.contact.held import layer, slide
from optopad.sims.contact.held.bottoms import bottom_mm
from optopad.sims.contact.held.layer import WideLayer, pad_layer
from optopad.sims.contact.held.press import HeldPress, grid_of, held_press
from optopad.sims.contact.held.slide import pulled, slid
from optopad.sims.contact.scope import contact_of

PAD = contact_of(preset("fingertip-16").with_(**{"cavity.clear_thickness_mm": 5.13}))
"""A pad that nothing else computes, so that it may be computed coarsely."""
AT = (8.0, 8.0)
FRICTION, DEPTH = 0.6, 0.6


@pytest.fixture(autouse=True, scope="module")
def coarse() -> object:
    """Few finite elements: the tests compare the model with itself and with closed forms far from walls."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layer, "MOST_ELEMENTS", 4)
        yield


def ball(shift: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
    x, y = grid_of(PAD, AT)
    return bottom_mm(held_of("sphere,radius=2"), x - shift[0], y - shift[1])


def moved(*path: tuple[float, float], friction: float = FRICTION) -> list[HeldPress]:
    return slid(PAD, AT, ball(), depth_mm=DEPTH, friction=friction, path_mm=np.array(path))


@pytest.mark.slow
def test_finite_elements_of_a_wide_pad_answer_as_the_layer_without_walls(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(layer, "MOST_ELEMENTS", 6)
    thickness, side = 3.0, 24.0
    middle = 0.5 * side
    plan = Plan(
        outline=outline_in("rectangle", (0.0, 0.0, side, side)),
        top=Top(clear_mm=2.0, apex_mm=(middle, middle)),
    )
    x = np.linspace(0.0, side, 49)
    step = x[1]
    patch = np.maximum(1.0 - ((x[:, None] - middle) ** 2 + (x - middle) ** 2) / 16.0, 0.0) ** 2
    load = np.stack([patch, 0.5 * patch, 0.8 * patch])
    pad = pad_layer(plan, 1.0, sideways=True)
    splines = pad.at(np.repeat(x, len(x)), np.tile(x, len(x)))
    shares = splines.T @ load.reshape(3, -1).T
    change = splines @ (pad.coefficients @ shares.T.ravel()).reshape(3, -1).T * step**2
    wide = WideLayer(thickness, (step, step), patch.shape).moved_by(load)
    assert np.abs(change).max(axis=0) == pytest.approx(np.zeros(3), abs=0.025 * np.abs(wide).max())
    front, back = wide[2, 34, 24], wide[2, 14, 24]
    assert front < back, "the top rises in front of what drags it, and sinks behind"


def test_sideways_loads_work_on_each_other_alike() -> None:
    rng = np.random.default_rng(3)
    one, other = rng.random((2, 3, 20, 24))
    wide = WideLayer(4.0, (0.4, 0.4), (20, 24))
    assert float((wide.moved_by(one) * other).sum()) == pytest.approx(
        float((wide.moved_by(other) * one).sum())
    )
    window = wide.within((8, 9), sideways=True)
    part = np.zeros_like(one)
    part[:, 5:13, 6:15] = one[:, :8, :9]
    np.testing.assert_allclose(
        window.moved_by(one[:, :8, :9]), wide.moved_by(part)[:, 5:13, 6:15], atol=1e-12
    )


def test_a_ball_that_slips_partly_is_that_of_mindlin() -> None:
    step, thickness, radius, friction = 0.08, 30.0, 1.0, 0.5
    x = (np.arange(37) - 18) * step
    r = np.hypot(x[:, None], x)
    pressure = np.sqrt(np.maximum(1.0 - (r / radius) ** 2, 0.0))
    wide = WideLayer(thickness, (step, step), r.shape).within(r.shape, sideways=True)
    most = friction * float(pressure.sum()) * step**2
    for share in (0.3, 0.7):
        # Mindlin 1949; Johnson, Contact Mechanics, 1985, eq. 7.42, for one body, shear modulus 1, Poisson's ratio 1/2
        shift = 3.0 * most * 1.5 / (16.0 * radius) * (1.0 - (1.0 - share) ** (2.0 / 3.0))
        wanted = np.stack([np.full_like(r, shift), np.zeros_like(r)])
        load = slide._sideways_load(wide.moved_by, 0.0 * wanted, wanted, friction * pressure, 1e-4 * shift)
        assert float(load[0].sum()) * step**2 == pytest.approx(share * most, rel=0.04)
        sticks = (np.hypot(*load) < 0.999 * friction * pressure) & (pressure > 0.0)
        found = math.sqrt(sticks.sum() * step**2 / math.pi)
        assert found == pytest.approx(radius * (1.0 - share) ** (1.0 / 3.0), rel=0.05)


def test_without_friction_it_is_the_press_at_the_new_place() -> None:
    (found,) = moved((0.25, 0.0), friction=0.0)
    wanted = held_press(PAD, AT, ball((0.25, 0.0)), depth_mm=DEPTH)
    assert np.abs(found.top.height_mm - wanted.top.height_mm).max() < 2e-3
    assert found.pull_n == (0.0, 0.0)
    assert found.force_n == pytest.approx(wanted.force_n, rel=2e-3)


def test_opposite_ways_are_mirror_images_and_friction_bounds_the_pull() -> None:
    there, back = moved((0.2, 0.0))[0], moved((-0.2, 0.0))[0]
    np.testing.assert_allclose(there.top.height_mm, back.top.height_mm[::-1], atol=2e-5)
    assert there.pull_n[0] == pytest.approx(-back.pull_n[0])
    far = moved((0.8, 0.0))[0]
    assert far.slip_share > 0.95
    assert far.pull_n[0] == pytest.approx(far.holds_n, rel=0.01)
    assert FRICTION * far.force_n < far.holds_n < 1.2 * FRICTION * far.force_n


def test_a_closed_loop_of_stick_and_slip_gains_no_energy() -> None:
    shifts = [0.0, 0.1, 0.2, 0.1, 0.0, -0.1, -0.2, -0.1, 0.0, 0.1, 0.2]
    pulls = [one.pull_n[0] for one in moved(*((one, 0.0) for one in shifts[1:]))]
    steps = list(pairwise(zip(shifts, [0.0, *pulls], strict=True)))
    work = [0.5 * (a[1] + b[1]) * (b[0] - a[0]) for a, b in steps]
    stored = 0.5 * pulls[1] * shifts[2]
    assert 0.0 < sum(work[2:]) < stored, "from 0.2 mm and back to it"
    assert pulls[-1] == pytest.approx(pulls[1], rel=0.02), "the loop closes"


def test_a_pull_is_reached_or_refused() -> None:
    held = moved((0.0, 0.0))[0].holds_n
    arguments = {"contact": PAD, "at_mm": AT, "bottoms": ball(), "depth_mm": DEPTH, "friction": FRICTION}
    found = pulled(**arguments, pull_n=(0.5 * held, 0.2 * held))
    assert found.pull_n == pytest.approx((0.5 * held, 0.2 * held), rel=0.003)
    (same,) = moved(found.shear_mm)
    assert same.pull_n == pytest.approx(found.pull_n, rel=0.01), "a pull grows and does not come back"
    assert pulled(**arguments, pull_n=(1e-9, 0.0)).shear_mm == pytest.approx((0.0, 0.0), abs=0.01)
    with pytest.raises(ModelScopeError, match="more than the pad holds"):
        pulled(**arguments, pull_n=(1.1 * held, 0.0))


def test_what_cannot_be_moved_is_refused() -> None:
    for friction in (-0.1, 3.1, math.nan):
        with pytest.raises(InputError, match=r"friction: .* is refused: give 0 to 3"):
            moved((0.1, 0.0), friction=friction)
    with pytest.raises(InputError, match="do not touch the pad, so nothing holds them"):
        slid(PAD, AT, ball(), depth_mm=0.0, friction=0.5, path_mm=np.array([[0.1, 0.0]]))
    with pytest.raises(InputError, match="two finite numbers"):
        moved((math.inf, 0.0))
    with pytest.raises(ModelScopeError):
        moved((7.0, 0.0))
