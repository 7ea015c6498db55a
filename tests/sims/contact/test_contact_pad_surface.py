"""The top of a whole pad: the tip, the walls, symmetry, and the force of a place."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.contact import indent
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.pad_surface import contact_notes, curve_height_mm, pad_surface
from optopad.sims.contact.scope import contact_of

NODES = np.linspace(0.0, 32.0, 65)
PLACES = [(16.0, 16.0), (7.0, 9.0), (6.0, 16.0), (6.0, 6.0)]


@pytest.fixture(scope="module")
def pad() -> SensorDesign:
    return preset("piacenza2017-pad")


def from_axis(at: tuple[float, float]) -> np.ndarray:
    return np.hypot(NODES[:, None] - at[0], NODES[None, :] - at[1])


@pytest.mark.parametrize("at", PLACES)
@pytest.mark.parametrize("depth_mm", [0.3, 2.0, 5.0])
def test_the_top_is_bonded_at_every_wall(pad: SensorDesign, at: tuple[float, float], depth_mm: float) -> None:
    top = pad_surface(pad, depth_mm, at).height_mm(NODES, NODES)
    # what is interpolated between the nodes of the walls, beside a press 6 mm from one
    assert max(np.abs(side).max() for side in (top[0], top[-1], top[:, 0], top[:, -1])) < 2.5e-3 * depth_mm


@pytest.mark.parametrize("at", PLACES)
def test_inside_the_contact_the_top_is_the_tip(pad: SensorDesign, at: tuple[float, float]) -> None:
    surface = pad_surface(pad, 2.0, at)
    radius = np.linspace(0.0, 0.95 * surface.near.contact_radius_mm, 9)
    sphere = 3.0 - 2.0 - np.sqrt(9.0 - radius**2)
    # the curve has a point every 0.06 mm on the tip, joined by monotone cubics
    found = surface.height_mm(at[0] + radius, np.array([at[1]]))[:, 0]
    np.testing.assert_allclose(found, sphere, atol=1e-3)


@pytest.mark.parametrize("at", PLACES)
def test_the_curve_and_what_is_beside_it_meet_the_tip_on_the_axis(
    pad: SensorDesign, at: tuple[float, float]
) -> None:
    surface = pad_surface(pad, 3.0, at)
    assert abs(surface.beside_mm(np.array([at[0]]), np.array([at[1]]))[0, 0]) < 1e-4
    assert surface.near.height_mm[0] == pytest.approx(-3.0, abs=1e-12)
    # in the contact it is the tilt that is left out: at most 3 % of 3 mm
    inside = from_axis(at) < surface.near.contact_radius_mm
    assert np.abs(surface.beside_mm(NODES, NODES)[inside]).max() < 0.1


@pytest.mark.parametrize("at", PLACES)
def test_rubber_keeps_its_volume(pad: SensorDesign, at: tuple[float, float]) -> None:
    """What the tip displaces rises elsewhere: the linear layer is incompressible, the library nearly."""
    fine = np.linspace(0.0, 32.0, 321)
    top = pad_surface(pad, 2.0, at).height_mm(fine, fine)
    # grid of 0.1 mm, and 0.5 % that the library's own presses do not return (tests/sims/contact/solver)
    assert abs(top.sum()) < 0.02 * np.abs(top[top < 0.0]).sum()


def test_mirrored_presses_have_mirrored_tops_and_the_same_force(pad: SensorDesign) -> None:
    one, other = pad_surface(pad, 1.5, (7.0, 9.0)), pad_surface(pad, 1.5, (25.0, 9.0))
    np.testing.assert_allclose(one.height_mm(NODES, NODES), other.height_mm(NODES, NODES)[::-1], atol=1e-9)
    turned = pad_surface(pad, 1.5, (9.0, 7.0)).height_mm(NODES, NODES)
    np.testing.assert_allclose(one.height_mm(NODES, NODES), turned.T, atol=1e-9)
    assert one.near.force_n == pytest.approx(other.near.force_n, rel=1e-9)


def test_in_the_middle_of_a_square_pad_the_press_is_that_of_the_round_pad_of_its_area(
    pad: SensorDesign,
) -> None:
    """Their walls are 1.13 half widths away and a half width to 1.41: a few micrometres to half the way there."""
    surface = pad_surface(pad, 2.0)
    radius = from_axis((16.0, 16.0))
    near = (radius > surface.near.contact_radius_mm) & (radius < 8.0)
    round_pad = curve_height_mm(solved_press(contact_of(pad)).round_pad_at(2.0), radius)
    assert np.abs(surface.height_mm(NODES, NODES) - round_pad)[near].max() < 6e-3
    assert solved_press(contact_of(pad)).force_n(2.0) == pytest.approx(
        9.0 * solved_press(contact_of(pad)).smooth.force_at(2 / 3) * 1.0, rel=0.02
    )


@pytest.mark.slow
def test_walls_stiffen_a_press_beside_them_and_a_small_pad(pad: SensorDesign) -> None:
    middle, side, corner = (indent(pad, 2.0, at).force_n for at in (None, (6.0, 16.0), (6.0, 6.0)))
    assert middle < side < corner
    small = solved_press(contact_of(preset("fingertip-16")))
    wide = shipped_library().press(small.smooth.layer_depth)
    assert small.smooth.force_at(0.5) > 1.01 * wide.force_at(0.5)


def test_a_place_nearer_to_a_wall_than_the_model_covers_is_refused_by_name(pad: SensorDesign) -> None:
    with pytest.raises(ModelScopeError, match=r"1\.00 tip"):
        indent(pad, 1.0, (3.0, 16.0))


def test_notes_tell_of_the_force_in_the_corner_and_of_live_solves(pad: SensorDesign) -> None:
    notes = " ".join(contact_notes(contact_of(pad)))
    assert "walls stiffen" in notes
    assert " % at the workspace corner (6, 6) mm" in notes
    assert "solved live" not in notes


def test_an_untouched_pad_is_flat_everywhere(pad: SensorDesign) -> None:
    surface = pad_surface(pad, 0.0, (7.0, 8.0))
    assert surface.near.force_n == 0.0
    np.testing.assert_array_equal(surface.height_mm(NODES, NODES), 0.0)
