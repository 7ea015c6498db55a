"""Presses at the apex of a crowned pad in mm and N: heights above the untouched crown, limits, scaling, storage."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.sims.contact.library.smooth_press import above_crown, on_crown
from optopad.sims.contact.library.solved_press import SolvedPress
from optopad.sims.contact.library.stored_press import PressInputs, entry_path, read_entry, write_entry
from optopad.sims.contact.tip import tip_gap
from tests.sims.contact.kept_presses import COARSE_MM, CROWNED_DEPTH_MM
from tests.sims.contact.kept_presses import CROWNED_PAD as PAD
from tests.validation.contact.crown.crowned_press import CrownedPress, crowned_press


def drop_mm(radius_mm: np.ndarray) -> np.ndarray:
    return np.asarray(14.0 - np.sqrt(14.0**2 - radius_mm**2))


@pytest.fixture(scope="module")
def press() -> CrownedPress:
    return crowned_press(PAD, CROWNED_DEPTH_MM, COARSE_MM)


def test_untouched_pad_has_height_zero_everywhere(press: CrownedPress) -> None:
    for depth_mm in (0.0, -1.0):
        untouched = press.at(depth_mm)
        np.testing.assert_allclose(untouched.height_mm, 0.0, atol=1e-12)
        np.testing.assert_allclose(untouched.inclination_deg, 0.0, atol=1e-9)
        assert (untouched.force_n, untouched.contact_radius_mm, untouched.depth_mm) == (0.0, 0.0, 0.0)
        assert untouched.radius_mm[-1] == pytest.approx(9.0)


@pytest.mark.parametrize("depth_mm", [0.003, 0.03, 0.11, 0.39])
def test_curve_is_the_tip_inside_the_contact_and_ends_at_the_rim(
    press: CrownedPress, depth_mm: float
) -> None:
    above, absolute = press.at(depth_mm), press.absolute_at(depth_mm)
    assert (above.radius_mm[0], above.height_mm[0]) == (0.0, pytest.approx(-depth_mm))
    assert above.radius_mm[-1] == pytest.approx(9.0)
    assert above.height_mm[-1] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(above.height_mm - drop_mm(above.radius_mm), absolute.height_mm, atol=1e-9)
    assert above.force_n == absolute.force_n > 0.0
    if depth_mm >= 0.02:
        gap = tip_gap(absolute.radius_mm / 3.0, absolute.height_mm / 3.0, depth_mm / 3.0)
        assert gap.min() > -1e-12
        inside = absolute.radius_mm < above.contact_radius_mm - 1e-9
        np.testing.assert_allclose(gap[inside], 0.0, atol=1e-12)


def test_inclination_is_the_slope_of_the_height_above_the_crown(press: CrownedPress) -> None:
    above = press.at(0.3)
    assert above.inclination_deg is not None
    chords = np.degrees(np.arctan2(np.diff(above.height_mm), np.diff(above.radius_mm)))
    middles = 0.5 * (above.inclination_deg[1:] + above.inclination_deg[:-1])
    # third order in the points' spacing of 0.06 mm; at the contact edge curvature jumps
    assert np.abs(chords - middles).max() < 0.3
    beyond = (above.radius_mm[1:] > 3.0) & (above.radius_mm[1:] < 8.0)  # at the rim the surface is steep
    assert np.abs(chords - middles)[beyond].max() < 0.01


def test_taking_the_crown_off_and_putting_it_on_again_changes_nothing(press: CrownedPress) -> None:
    curve = press.smooth.curve_at(0.1)
    back = on_crown(above_crown(curve, press.smooth.crown), press.smooth.crown)
    np.testing.assert_allclose(back.height, curve.height, atol=1e-14)
    np.testing.assert_allclose(back.inclination, curve.inclination, atol=1e-14)


def test_layer_keeps_its_volume(press: CrownedPress) -> None:
    above = press.at(0.39)
    moment = 2.0 * np.pi * above.radius_mm * above.height_mm
    step = np.diff(above.radius_mm)
    dimple = -np.sum(0.5 * (np.minimum(moment, 0.0)[1:] + np.minimum(moment, 0.0)[:-1]) * step)
    # a Poisson's ratio of 0.499; facets of 0.45 mm under a contact of 1 mm: 8 %
    assert abs(np.sum(0.5 * (moment[1:] + moment[:-1]) * step)) < 0.1 * dimple


def test_twice_the_size_is_twice_the_shape_and_four_times_the_force(press: CrownedPress) -> None:
    double = replace(PAD, tip_radius_mm=6.0, crown_radius_mm=28.0, elastic_depth_mm=12.0, pad_radius_mm=18.0)
    large, small = crowned_press(double, 0.8, 0.9).at(0.6), press.at(0.3)
    np.testing.assert_allclose(large.height_mm, 2.0 * small.height_mm, atol=1e-12)
    assert large.force_n == pytest.approx(4.0 * small.force_n, rel=1e-12)
    assert large.contact_radius_mm == pytest.approx(2.0 * small.contact_radius_mm, rel=1e-12)


def test_modulus_scales_the_force_alone(press: CrownedPress) -> None:
    stiff = crowned_press(replace(PAD, youngs_modulus_mpa=2.5), 0.4, COARSE_MM)
    assert stiff.force_n(0.3) == pytest.approx(2.5 * press.force_n(0.3), rel=1e-12)
    np.testing.assert_array_equal(stiff.at(0.3).height_mm, press.at(0.3).height_mm)


def test_deeper_than_solved_is_refused(press: CrownedPress) -> None:
    with pytest.raises(ModelScopeError, match="depth_mm: 3 is beyond the solved"):
        press.at(3.0)
    with pytest.raises(ModelScopeError, match=r"deepest_mm: 5\.5 mm.*covers: 4\.8"):
        crowned_press(PAD, 5.5)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"crown_radius_mm": 8.5}, ModelScopeError, "ends before the wall"),
        ({"crown_radius_mm": 10.4}, ModelScopeError, "left at"),
        ({"crown_radius_mm": -14.0}, InputError, "crown_radius_mm: -14"),
        ({"elastic_depth_mm": 40.0}, ModelScopeError, "elastic_depth_mm: 40 mm must lie between"),
    ],
)
def test_pads_outside_the_model_are_refused(
    change: dict[str, float], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        crowned_press(replace(PAD, **change), 0.4, COARSE_MM)


def test_depths_and_meshes_outside_the_model_are_refused() -> None:
    with pytest.raises(InputError, match="deepest_mm"):
        crowned_press(PAD, float("nan"))
    with pytest.raises(InputError, match=r"mesh_mm: 2 mm must lie between 0\.12 and 0\.45 mm"):
        crowned_press(PAD, 0.4, 2.0)


def test_walls_of_a_crowned_pad_are_not_modelled(press: CrownedPress) -> None:
    with pytest.raises(ModelScopeError, match="walls covers flat"):
        _ = press.smooth.far


def test_a_crown_is_part_of_the_key_and_a_flat_entry_may_lack_it(coarse_press: SolvedPress) -> None:
    flat = PressInputs(layer=2.0, mesh_size=0.15, depths=(0.02, 0.04), poisson_ratio=0.49)
    assert replace(flat, crown=0.1).key() != flat.key()
    key = flat.key()
    assert coarse_press.unit is not None
    assert write_entry(key, coarse_press.unit) is None
    with np.load(entry_path(key), allow_pickle=False) as held:
        arrays = {name: held[name] for name in held.files if name != "crown"}
    os.remove(entry_path(key))
    np.savez(entry_path(key), **arrays)
    found = read_entry(key)
    assert found is not None
    assert found.crown == 0.0
