"""Sideways loads with friction, solved with finite strains: closed forms, symmetry and energy."""

from __future__ import annotations

from copy import copy
from itertools import pairwise

import numpy as np
import pytest

from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.tip_outlines import sphere_tip
from tests.validation.held.slide_oracle import PlaneSlide
from tests.validation.held.slide_truth import CASES, PLACES_MM, SHEARS_MM, pressed, read_slides, rows, slid
from tests.validation.held.truth_file import read_truth

STORED = read_slides()
FINE = [row for row in STORED if row.mesh == "fine"]
LONG = "long cylinder, radius 5"
DEPTH = 0.2


@pytest.fixture(scope="module")
def press() -> PlaneSlide:
    """A long cylinder, pressed to a fifth of its radius on a coarse mesh."""
    grading = Grading(size=0.2, axis_size=0.1, largest_axial=0.3)
    found = PlaneSlide(1.8, 3.2, grading, POISSON_RATIO, sphere_tip(), 0)
    found.advance(DEPTH)
    return found


def begun(press: PlaneSlide, friction: float) -> PlaneSlide:
    """A pressed object that has friction from now on."""
    found = copy(press)
    found.friction = friction
    found.remember()
    return found


def test_the_tangent_of_friction_is_its_derivative(press: PlaneSlide) -> None:
    slide = begun(press, 0.3)
    slide.slide(0.04)
    touches, slips = slide.contact()
    assert slips.any()
    assert (touches & ~slips).any()
    slide.shear += 0.01
    rubbing = slide.rubbed(slide.depth, slide.penalty)
    moved = np.random.default_rng(5).normal(size=slide.size)
    step = 1e-7
    ahead, behind = (rubbing.assemble(slide.state + sign * step * moved)[0] for sign in (1, -1))
    _, tangent = rubbing.assemble(slide.state)
    wanted = tangent @ moved
    assert np.abs((ahead - behind) / (2.0 * step) - wanted).max() < 1e-5 * np.abs(wanted).max()


def test_without_friction_the_press_moves_with_the_object(press: PlaneSlide) -> None:
    before = begun(press, 0.0).state_now()
    tops = []
    for way in (1.0, -1.0):
        slide = begun(press, 0.0)
        slide.slide(0.06 * way)
        state = slide.state_now()
        assert state.force == pytest.approx(before.force, rel=2e-3)
        assert abs(state.pull) < 2e-3 * state.force  # the walls are no longer equally far
        assert state.edges == pytest.approx([edge + 0.06 * way for edge in before.edges], abs=0.02)
        x, z = state.lines["along"]
        tops.append(np.interp(np.linspace(-3.0, 3.0, 61), way * x[:: int(way)], z[:: int(way)]))
    assert tops[0] == pytest.approx(tops[1], abs=1e-6)


@pytest.mark.slow
def test_a_closed_loop_gains_no_energy(press: PlaneSlide) -> None:
    """0.4 mm to both sides, of a radius of 5 mm. Work is summed by the trapezoidal rule."""
    slide = begun(press, 0.3)
    slide.shear_step = 0.005

    def stored() -> float:
        creep = (slide.top.weight * (slide.past.traction**2).sum(axis=-1)).sum() / (2.0 * slide.stiffness)
        return float(slide.solid.assemble(slide.solid_state, False).energy + creep)

    start, lost = stored(), [0.0]
    for to in (0.02, 0.04, 0.06, 0.08, 0.06, 0.04, 0.0, -0.04, -0.06, -0.08, -0.04, 0.0):
        slide.slide(to)
        lost.append(slide.work - (stored() - start))
    assert all(later > earlier - 2e-3 * lost[-1] for earlier, later in pairwise(lost))
    assert lost[-1] > 2.0 * lost[4] > 0.0  # the way back and the other side slip, too


@pytest.mark.slow
def test_small_strains_stick_like_cattaneo_and_mindlin() -> None:
    """A thick layer: what sticks has the half width a √(1 - Q/(f P)) (Johnson, Contact Mechanics, section 7.2)."""
    grading = Grading(
        size=0.0125,
        axis_size=0.0125,
        axis_radius=0.05,
        fine_radius=0.15,
        fine_depth=0.04,
        growth=1.4,
        largest_radial=0.6,
        largest_axial=0.4,
    )
    press = PlaneSlide(2.0, 4.0, grading, POISSON_RATIO, sphere_tip(), 0)
    press.largest_step = 0.01
    press.advance(0.02)
    half = np.sqrt(-4.0 * press.forces()[1] / np.pi * (1.0 - POISSON_RATIO**2))
    slide = begun(press, 0.5)
    for shear in (0.002, 0.004, 0.006):
        slide.slide(shear)
        pull, force = slide.forces()
        share = -pull / (0.5 * force)
        touches, slips = slide.contact()
        weight = slide.top.weight
        width = 0.5 * float(weight[touches].sum())
        sticks = 0.5 * float(weight[touches & ~slips].sum())
        assert width == pytest.approx(half, rel=0.02)
        assert sticks / width == pytest.approx(np.sqrt(1.0 - share), abs=0.03)
        x = slide.top.rest[..., 0]
        outer, inner = (np.sqrt(np.maximum(width**2 * part - x**2, 0.0)) for part in (1.0, 1.0 - share))
        wanted = (-force / np.pi / width**2 * (outer - inner)).mean(axis=1)
        off = -slide.past.traction[..., 0].mean(axis=1) - wanted
        assert np.sqrt(np.mean(off**2)) < 0.05 * np.sqrt(np.mean(wanted[wanted > 0.0] ** 2))


def test_every_case_is_stored() -> None:
    wanted = {
        (name, depth, friction, shear, mesh)
        for name, case in CASES.items()
        for depth in case.depths_mm
        for friction in case.frictions
        for shear in SHEARS_MM
        for mesh in ("coarse", "fine")
    }
    assert {(row.case, row.depth_mm, row.friction, row.shear_mm, row.mesh) for row in STORED} == wanted


@pytest.mark.slow
def test_a_stored_slide_is_solved_again() -> None:
    case = CASES[LONG]
    press = case.presses()[0]
    pressed(case, 1.0, [press])
    stored = [row for row in STORED if (row.case, row.depth_mm, row.mesh) == (LONG, 1.0, "coarse")]
    for wanted, (shear_mm, there) in zip(stored, slid(case, press, 0.3), strict=False):
        (row,) = rows(LONG, case, 1.0, shear_mm, "coarse", there)
        assert (row.force, row.pull, row.low_mm) == pytest.approx(
            (wanted.force, wanted.pull, wanted.low_mm), abs=1e-4
        )
        assert row.height_mm == pytest.approx(wanted.height_mm, abs=2e-4)


def test_meshes_agree() -> None:
    for fine in FINE:
        (coarse,) = (
            row
            for row in STORED
            if row.mesh == "coarse"
            and (row.case, row.depth_mm, row.friction, row.shear_mm, row.line)
            == (fine.case, fine.depth_mm, fine.friction, fine.shear_mm, fine.line)
        )
        assert coarse.force == pytest.approx(fine.force, rel=0.02)
        assert coarse.pull == pytest.approx(fine.pull, rel=0.03, abs=1e-6)
        beside = (fine.low_mm - 0.5 > PLACES_MM) | (fine.high_mm + 0.5 < PLACES_MM)
        assert coarse.height_mm[beside] == pytest.approx(fine.height_mm[beside], abs=0.02 * fine.depth_mm)


def test_presses_without_a_way_are_the_stored_ones() -> None:
    truth = read_truth()
    for row in FINE:
        if row.shear_mm == 0.0 and row.case in truth:
            force = next(
                one for one in truth[row.case] if one.depth_mm == row.depth_mm and "force" in one.quantity
            )
            assert row.force == pytest.approx(force.value, rel=0.01)
            assert row.pull == pytest.approx(0.0, abs=1e-5)


def test_slip_and_pull_grow_with_the_way() -> None:
    for before, after in pairwise(row for row in FINE if row.line == "along"):
        if after.shear_mm > 0.0:
            assert after.pull > before.pull
            assert after.slip_share >= before.slip_share - 0.02
            assert after.low_mm > before.low_mm
            assert after.high_mm > before.high_mm
