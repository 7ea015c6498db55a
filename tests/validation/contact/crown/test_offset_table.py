"""Presses beside the apex: the chart, the oracle at the apex against the axisymmetric one, the written table."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.contact.crown.crown_oracle import Crown
from tests.validation.contact.crown.offset_oracle import PADS, OffsetPress, offset_state
from tests.validation.contact.crown.offset_table import (
    FRAGMENT,
    apex_errors,
    errors,
    markdown,
)
from tests.validation.elements.block_oracle import BlockGrading

COARSE = BlockGrading(size=1.2, growth=2.0)
BESIDE = {name: pad for name, pad in PADS.items() if pad.offset_mm > 0.0}


@pytest.mark.parametrize("name", PADS)
def test_derivatives_of_the_chart_are_those_of_its_places(name: str) -> None:
    chart, step = PADS[name].chart, 1e-6
    west, east, _, north = chart.walls
    flat = np.random.default_rng(7).uniform([-west, 0.0, -chart.layer], [east, north, 0.0], (50, 3)).T
    for axis in range(3):
        shift = step * np.eye(3)[:, axis, None]
        slope = (chart.places(flat + shift) - chart.places(flat - shift)) / (2.0 * step)
        # central differences: round-off 1e-15 over the step
        np.testing.assert_allclose(slope.T, chart.jacobian(flat)[..., axis], atol=1e-8)


def test_the_untouched_pad_has_the_volume_below_the_sphere_and_its_top_the_sphere_s_area() -> None:
    chart = PADS["dome"].chart
    press = OffsetPress(chart, BlockGrading(), POISSON_RATIO)
    sphere, drop = 1.0 / chart.curvature, float(Crown(chart.curvature).drop(np.array(chart.wall)))
    below = np.pi * chart.wall**2 * (chart.layer - drop) + np.pi * drop**2 * (sphere - drop / 3.0)
    # three Gauss points an axis on elements of up to 2; the chart's roots are singular at the pad's four corners
    assert press.copies * press.rest_volume == pytest.approx(below, rel=1e-4)
    rest = chart.places(press.rest_top.T)
    np.testing.assert_allclose(np.hypot(*rest[:2]) ** 2 + (rest[2] + sphere) ** 2, sphere**2, rtol=1e-12)
    wall = press.solid.nodes[0] > chart.walls[1] - 1e-9
    np.testing.assert_allclose(
        np.hypot(*chart.places(press.solid.nodes[:, wall])[:2]), chart.wall, rtol=1e-12
    )


@pytest.mark.full
def test_contact_force_beside_the_apex_balances_the_bonded_faces() -> None:
    press = OffsetPress(PADS["dome"].chart, COARSE, POISSON_RATIO)
    press.advance(0.2)
    state = press.state_now()
    np.testing.assert_allclose(state.force, -state.reaction, atol=1e-7)
    assert 2.0 * state.contact[:, 3].sum() == pytest.approx(state.force[2])


def test_at_the_apex_three_dimensions_agree_with_the_axisymmetric_oracle_and_halved_elements_are_nearer() -> (
    None
):
    for depth_mm in PADS["apex"].depths_mm:
        found = apex_errors(depth_mm)
        fine, half = found["fine"], found["half"]
        # elements of a quarter of a tip radius at the contact, and a singular rim
        assert abs(fine.force_ratio - 1.0) < 0.01
        assert abs(fine.force_ratio - 1.0) < abs(half.force_ratio - 1.0)
        assert fine.near_um[0] < 2.5 * depth_mm
        assert fine.near_um[0] < half.near_um[0]
        # the mesh is the same on both sides
        assert fine.apex_um == pytest.approx(fine.rim_um, abs=0.1)


@pytest.mark.parametrize("name", PADS)
def test_stored_tops_end_at_the_bonded_wall_and_contact_points_lie_on_the_tip(name: str) -> None:
    pad = PADS[name]
    for depth_mm in pad.depths_mm:
        state = offset_state(name, depth_mm)
        at_wall = np.hypot(*state.rest_mm.T[:2]) > pad.wall_mm - 1e-5
        assert np.abs(state.moved_mm[at_wall]).max() == 0.0
        assert 2.0 * state.contact_n.sum() == pytest.approx(state.force_n[2], rel=1e-5)
        from_middle = state.contact_mm - [0.0, 0.0, pad.tip_mm - depth_mm]
        lower = from_middle[:, 2] < 0.0
        reach = np.linalg.norm(from_middle[lower], axis=1) / pad.tip_mm
        # contact holds on the mean over faces: gaps at points are some ten-thousandths of the tip
        assert np.average(np.abs(reach - 1.0), weights=state.contact_n[lower]) < 0.001


@pytest.mark.parametrize("name", BESIDE)
def test_beside_the_apex_the_model_has_the_force_and_lacks_a_tilt(name: str) -> None:
    for depth_mm in PADS[name].depths_mm:
        local = errors(name, depth_mm)["local"]
        assert abs(local.force_ratio - 1.0) < 0.03
        assert local.rim_um > local.apex_um


def test_the_written_table_is_that_of_the_stored_presses() -> None:
    """But for the versions in its first line."""
    written, present = (text.split("\n", 1)[1].strip() for text in (FRAGMENT.read_text(), markdown()))
    assert written == present
