"""`indent` refuses what the model does not cover, by name, and needs no solver for a stored press."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import DesignError, InputError, ModelScopeError, OptopadError
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.contact import indent
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.live_press import fit_press, tributary_areas
from optopad.sims.contact.library.solved_press import SolvedPress
from optopad.sims.contact.mesh import shared_out
from optopad.sims.contact.pressure import FEWEST_SPACINGS, contact_pressure
from optopad.sims.contact.scope import DEPTH_STEP, contact_of, solved_depths
from tests.sims.contact.kept_presses import COARSE_MM

SOLVE = stored_press._solve
"""Before the tests of this folder read kept presses in its place."""


def test_indent_is_the_solved_press_at_that_depth(
    check_design: SensorDesign, coarse_press: SolvedPress
) -> None:
    press = indent(check_design, 1.25, mesh_mm=0.45)
    assert press.force_n == coarse_press.at(1.25).force_n
    assert (press.depth_mm, press.tip_radius_mm) == (1.25, 3.0)


def test_a_press_in_a_corner_is_that_of_a_deeper_one_in_the_middle(
    check_design: SensorDesign, coarse_press: SolvedPress
) -> None:
    middle, corner = (indent(check_design, 1.0, at, mesh_mm=0.45) for at in (None, (5.0, 6.0)))
    assert (middle.height_mm[0], corner.height_mm[0]) == pytest.approx((-1.0, -1.0))
    assert corner.force_n > 1.02 * middle.force_n
    assert corner.contact_radius_mm > middle.contact_radius_mm


@pytest.mark.parametrize(
    ("depth_mm", "at_mm", "error", "message"),
    [
        (float("nan"), None, InputError, "depth_mm: nan"),
        (float("inf"), None, InputError, "depth_mm: inf"),
        (5.2, None, ModelScopeError, r"depth_mm: 5\.2 mm.*5\.1 mm"),
        (1.0, (-1.0, 5.0), InputError, "at_mm: x.*-1 mm must"),
        (1.0, (5.0, 1e9), InputError, r"at_mm: y = 1e\+09 mm"),
        (1.0, (5.0, float("nan")), InputError, "at_mm: y = nan"),
    ],
)
def test_bad_arguments_are_named(
    check_design: SensorDesign,
    depth_mm: float,
    at_mm: tuple[float, float] | None,
    error: type[OptopadError],
    message: str,
) -> None:
    with pytest.raises(error, match=message):
        indent(check_design, depth_mm, at_mm, mesh_mm=0.45)


@pytest.mark.parametrize("mesh_mm", [0.0, -0.3, 0.05, 2.0, float("nan")])
def test_a_spacing_that_cannot_work_is_refused(check_design: SensorDesign, mesh_mm: float) -> None:
    with pytest.raises(InputError, match="mesh_mm: "):
        indent(check_design, 1.0, mesh_mm=mesh_mm)


def test_a_press_beyond_four_fifths_of_the_layer_is_refused(check_design: SensorDesign) -> None:
    thin = check_design.with_(**{"cavity.clear_thickness_mm": 3.5, "operating.max_depth_mm": 3.7})
    assert contact_of(thin).depth_limit_mm == pytest.approx(0.8 * 4.5)
    with pytest.raises(ModelScopeError, match=r"operating\.max_depth_mm: 3\.7 mm is deeper .* 3\.6 mm"):
        solved_press(contact_of(thin))


@pytest.mark.parametrize("clear_mm", [1.9, 30.0])
def test_a_layer_outside_the_modelled_range_is_refused(check_design: SensorDesign, clear_mm: float) -> None:
    changed = check_design.with_(**{"cavity.clear_thickness_mm": clear_mm, "operating.max_depth_mm": 1.0})
    with pytest.raises(ModelScopeError, match=r"here 3 to 30 mm"):
        indent(changed, 0.5)


def test_zero_radius_and_negative_modulus_are_refused_by_the_design(check_design: SensorDesign) -> None:
    with pytest.raises(DesignError, match=r"indenter\.tip_radius_mm"):
        check_design.with_(**{"indenter.tip_radius_mm": 0.0})
    with pytest.raises(DesignError, match=r"elastomer\.youngs_modulus_mpa"):
        check_design.with_(**{"elastomer.youngs_modulus_mpa": -1.0})


def test_solved_depths_follow_the_schedule_and_stop_at_the_first_sufficient_one() -> None:
    depths_mm = solved_depths(3.0, 0.75 / 3) * 3.0
    expected = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]
    np.testing.assert_allclose(depths_mm, expected, atol=1e-12)


@pytest.mark.parametrize("layer", [1.3, 2.0, 3.0, 6.0])
def test_solved_depths_end_at_the_limit_of_the_model(layer: float) -> None:
    limit = min(0.8 * layer, 1.7)
    depths = solved_depths(layer, limit)
    assert depths[-1] == pytest.approx(limit)
    assert np.diff(depths).min() > 1e-6
    assert np.diff(depths).max() <= DEPTH_STEP + 1e-9


@pytest.fixture(scope="module")
def live(
    check_design: SensorDesign, tmp_path_factory: pytest.TempPathFactory
) -> tuple[SolvedPress, list[float]]:
    """The coarse press solved here and now, and its progress."""
    seen: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OPTOPAD_CACHE", str(tmp_path_factory.mktemp("live")))
        patch.setattr(stored_press, "_SOLVED", {})
        patch.setattr(stored_press, "_solve", SOLVE)
        return solved_press(contact_of(check_design), mesh_mm=COARSE_MM, on_step=seen.append), seen


@pytest.mark.slow
def test_progress_rises_to_one(live: tuple[SolvedPress, list[float]]) -> None:
    press, seen = live
    # every depth at two Poisson's ratios, in either order
    assert press.unit is not None
    steps = 2 * press.unit.depths.size
    assert sorted(seen) == pytest.approx(np.arange(1, steps + 1) / steps)


@pytest.mark.slow
def test_the_kept_press_is_what_the_solver_gives(
    live: tuple[SolvedPress, list[float]], coarse_press: SolvedPress
) -> None:
    """Where this fails because results changed on purpose: `python -m tests.sims.contact.kept_presses`."""
    found, kept = live[0].unit, coarse_press.unit
    assert found is not None
    assert kept is not None
    np.testing.assert_array_equal(found.depths, kept.depths)
    np.testing.assert_array_equal(found.rest_radii, kept.rest_radii)
    # another processor rounds differently, and a state counts as settled where it moves by less than 1e-4 a step
    np.testing.assert_allclose(found.heights, kept.heights, rtol=0.0, atol=1e-3)
    np.testing.assert_allclose(found.radii, kept.radii, rtol=0.0, atol=1e-3)
    np.testing.assert_allclose(found.force, kept.force, rtol=5e-3)
    for depth_mm in (0.2, 1.0, 2.0, 3.0):
        assert live[0].at(depth_mm).force_n == pytest.approx(coarse_press.at(depth_mm).force_n, rel=5e-3)


@pytest.mark.slow
def test_a_stored_press_is_read_without_loading_the_solver(
    contact_cache: Path, coarse_press: SolvedPress
) -> None:
    program = (
        "import sys\n"
        "from optopad.design.preset import preset\n"
        "from optopad.sims.contact import indent\n"
        "design = preset('piacenza2017-pad').with_(**{'cavity.clear_thickness_mm': 7.0, "
        "'operating.max_depth_mm': 3.0, 'elastomer.youngs_modulus_mpa': 1.0})\n"
        "print(indent(design, 1.0, mesh_mm=0.45).force_n, 'mujoco' in sys.modules)\n"
    )
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, timeout=60, check=True
    )
    force, loaded = done.stdout.split()
    assert float(force) == pytest.approx(coarse_press.at(1.0).force_n, rel=1e-12)
    assert loaded == "False"


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
