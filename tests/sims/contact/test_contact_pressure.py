"""Pressure under the tip: it carries the press force, and is Hertz' where the press is shallow."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.design.preset import preset
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.live_press import fit_press, tributary_areas
from optopad.sims.contact.library.solved_press import SolvedPress
from optopad.sims.contact.mesh import shared_out
from optopad.sims.contact.pressure import FEWEST_SPACINGS, contact_pressure
from optopad.sims.contact.scope import contact_of

PAD = preset("piacenza2017-pad")
TWELFTH = 1.0 / 12.0


@pytest.fixture(scope="module")
def pad_press() -> SolvedPress:
    return solved_press(contact_of(PAD))


@pytest.mark.parametrize("depth_mm", [0.75, 1.0, 1.37, 2.0, 3.0, 4.2, 5.0])
def test_the_pressure_carries_the_press_force(pad_press: SolvedPress, depth_mm: float) -> None:
    pressure = contact_pressure(pad_press, depth_mm)
    assert pressure.is_resolved
    # rings add up exactly; the curve drawn through them misses their edge by less than a percent
    assert pressure.axial_force_n == pytest.approx(pad_press.force_n(depth_mm), rel=0.01)


def test_the_pressure_ends_at_the_contact_edge(pad_press: SolvedPress) -> None:
    pressure, press = contact_pressure(pad_press, 2.0), pad_press.at(2.0)
    assert pressure.radius_mm[0] == 0.0
    assert pressure.radius_mm[-1] == pytest.approx(press.contact_radius_mm, rel=1e-9)
    assert pressure.height_mm[0] == pytest.approx(-2.0)
    assert pressure.pressure_mpa[-1] == pytest.approx(0.0, abs=1e-12)
    assert np.all(pressure.pressure_mpa[:-1] > 0.0)


def test_pressure_is_proportional_to_the_modulus(pad_press: SolvedPress) -> None:
    stiffer = solved_press(contact_of(PAD.with_(**{"elastomer.youngs_modulus_mpa": 2.0})))
    twice = contact_pressure(stiffer, 2.0).pressure_mpa
    assert twice == pytest.approx(2.0 * contact_pressure(pad_press, 2.0).pressure_mpa, rel=1e-12)


def test_a_contact_of_few_mesh_cells_quotes_no_peak(pad_press: SolvedPress) -> None:
    small = contact_pressure(pad_press, 0.1)
    assert pad_press.at(0.1).contact_radius_mm < FEWEST_SPACINGS * pad_press.mesh_mm
    assert not small.is_resolved
    assert small.peak_mpa is None


@pytest.mark.parametrize("depth_mm", [0.0, -1.0])
def test_an_untouched_pad_feels_no_pressure(pad_press: SolvedPress, depth_mm: float) -> None:
    pressure = contact_pressure(pad_press, depth_mm)
    assert pressure.axial_force_n == 0.0
    assert pressure.peak_mpa is None


def test_a_depth_that_was_not_solved_is_refused(pad_press: SolvedPress) -> None:
    with pytest.raises(ModelScopeError, match="beyond the solved"):
        contact_pressure(pad_press, pad_press.deepest_mm + 0.1)


def test_tributary_areas_add_up_and_give_the_axis_a_third_of_its_disk() -> None:
    radius = np.linspace(0.0, 2.0, 5)
    areas = tributary_areas(radius, np.zeros(5))
    assert areas.sum() == pytest.approx(4.0 * np.pi)
    assert areas[0] == pytest.approx(np.pi * 0.25 / 3.0)


def test_point_forces_are_shared_by_the_lever_rule() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    at = np.array([[0.25, 0.0], [1.0, 0.3], [5.0, 0.0]])
    assert shared_out(at, np.array([4.0, 2.0, 1.0]), nodes) == pytest.approx([3.0, 3.0, 1.0])


@pytest.mark.full
def test_nodal_forces_add_up_to_the_press_force_and_a_shallow_press_has_hertz_pressure() -> None:
    depths = [0.02 / 3, 0.05 / 3, 0.1 / 3, 0.15 / 3, 0.2 / 3, TWELFTH, 0.1, 0.4 / 3, 0.5 / 3]
    inputs = stored_press.PressInputs(layer=6.0, mesh_size=0.1, depths=tuple(depths), poisson_ratio=0.49)
    unit = stored_press._solve(inputs, None)
    for index in range(2, len(depths)):
        height_share = np.sqrt(np.maximum(1.0 - unit.radii[index] ** 2, 0.0))  # cosine of the tip's normal
        carried = float(np.sum(unit.normal_force[index] * height_share))
        assert carried == pytest.approx(float(unit.force[index]), rel=0.01)  # measured: 0.14 %, facets
        assert np.all(unit.normal_force[index] >= 0.0)
    press = SolvedPress(smooth=fit_press(unit), tip_radius_mm=1.0, modulus=contact_of(PAD).draft.modulus)
    found, edge_mm = contact_pressure(press, depths[-1]), press.at(depths[-1]).contact_radius_mm
    ratio = found.radius_mm / edge_mm
    hertz = np.sqrt(np.maximum(1.0 - ratio**2, 0.0))
    peak = 1.5 * press.force_n(depths[-1]) / (np.pi * edge_mm**2)
    miss = (found.pressure_mpa / peak - hertz)[ratio < 0.8]
    # the mesh: four spacings from axis to edge; measured 2.8 % root mean square and 5.2 % at most, on the axis
    assert np.sqrt(np.mean(miss**2)) < 0.03
    assert np.abs(miss).max() < 0.06
