"""The top of a whole pad: centred shape, walls, symmetry, and the force of a place."""

from __future__ import annotations

import numpy as np
import pytest

from design.errors import ModelScopeError
from design.preset import preset
from design.spec import SensorDesign
from sims.contact import indent
from sims.contact.indentation import solved_press
from sims.contact.library.profile_library import shipped_library
from sims.contact.pad_surface import pad_surface
from sims.contact.press_notes import contact_notes
from sims.contact.walls.near_walls import wall_correction, wall_force_factor


@pytest.fixture(scope="module")
def pad() -> SensorDesign:
    return preset("piacenza2017-pad")


def test_a_centred_press_of_the_published_pad_is_that_of_its_area_up_to_the_strip_beside_the_walls(
    pad: SensorDesign,
) -> None:
    surface = pad_surface(pad, 2.0)
    assert surface.correction.force_factor == 1.0
    assert indent(pad, 2.0).force_n == indent(pad, 2.0, (16.0, 16.0)).force_n
    x = np.linspace(19.0, 23.0, 17)
    of_area = np.interp(x - 16.0, surface.of_area.radius_mm, surface.of_area.height_mm)
    np.testing.assert_allclose(surface.height_mm(x, np.full_like(x, 16.0)), of_area, atol=5e-4)


def test_the_field_for_light_makes_the_curve_the_whole_surface(pad: SensorDesign) -> None:
    surface = pad_surface(pad, 2.0, (7.0, 9.0))
    x, y = np.meshgrid(np.linspace(0.5, 31.5, 32), np.linspace(0.5, 31.5, 32))
    radius = np.hypot(x - 7.0, y - 9.0)
    curve = np.interp(radius, surface.press.radius_mm, surface.press.height_mm)
    away = radius > surface.press.contact_radius_mm + 0.7
    # the curve has a point every 0.24 mm at most, here joined by straight lines
    np.testing.assert_allclose(
        (curve + surface.wall_height_mm(x, y))[away], surface.height_mm(x, y)[away], atol=1.5e-3
    )


def test_a_layer_that_the_library_lacks_is_refused_by_name(pad: SensorDesign) -> None:
    with pytest.raises(
        ModelScopeError, match=r"hemispheres in layers of 3\.9 to 18 mm, here hemisphere in 3\.5 mm"
    ):
        pad_surface(pad.with_(**{"cavity.clear_thickness_mm": 2.5, "operating.max_depth_mm": 1.0}), 0.1)


def test_the_top_is_bonded_at_every_wall(pad: SensorDesign) -> None:
    surface = pad_surface(pad, 2.0, (7.0, 8.0))
    along = np.linspace(0.0, 32.0, 33)
    for x, y in (
        (along, np.zeros(33)),
        (along, np.full(33, 32.0)),
        (np.zeros(33), along),
        (np.full(33, 32.0), along),
    ):
        # a tenth of a micrometre: the rim is interpolated between the knots of the curve
        assert np.abs(surface.height_mm(x, y)).max() < 1e-4


def test_mirrored_presses_have_mirrored_tops_and_the_same_force(pad: SensorDesign) -> None:
    one, other = pad_surface(pad, 1.5, (7.0, 9.0)), pad_surface(pad, 1.5, (25.0, 9.0))
    x, y = np.meshgrid(np.linspace(0.5, 31.5, 13), np.linspace(0.5, 31.5, 13))
    np.testing.assert_allclose(one.height_mm(x, y), other.height_mm(32.0 - x, y), atol=1e-12)
    assert one.press.force_n == pytest.approx(other.press.force_n, rel=1e-12)


def test_the_surface_inside_the_contact_is_the_tip(pad: SensorDesign) -> None:
    surface = pad_surface(pad, 2.0, (7.0, 9.0))
    radius = np.linspace(0.0, 0.95 * surface.press.contact_radius_mm, 9)
    sphere = 3.0 - 2.0 - np.sqrt(9.0 - radius**2)
    # the curve has a point every 0.06 mm on the tip, joined by monotone cubics that round the edge off a little
    np.testing.assert_allclose(surface.height_mm(7.0 + radius, np.full(9, 9.0)), sphere, atol=1e-3)


def test_walls_stiffen_a_press_beside_them_and_a_small_pad(pad: SensorDesign) -> None:
    middle, side, corner = (indent(pad, 2.0, at).force_n for at in (None, (6.0, 16.0), (6.0, 6.0)))
    assert middle < side < corner
    small = solved_press(preset("fingertip-16"))
    wide = shipped_library().press(small.smooth.layer_depth)
    assert small.smooth.force_at(0.5) > 1.01 * wide.force_at(0.5)


def test_a_place_nearer_to_a_wall_than_the_data_is_refused_by_name(pad: SensorDesign) -> None:
    with pytest.raises(ModelScopeError, match=r"the west wall is 1\.00 tip radii from the press axis"):
        indent(pad, 1.0, (3.0, 16.0))


def test_notes_tell_of_the_force_in_the_corner_and_of_live_solves(pad: SensorDesign) -> None:
    notes = " ".join(contact_notes(pad))
    assert "pressed in the corner of the workspace (6, 6) mm" in notes
    assert "solved live" not in notes


def test_an_untouched_pad_is_flat_everywhere(pad: SensorDesign) -> None:
    surface = pad_surface(pad, 0.0, (7.0, 8.0))
    assert surface.press.force_n == 0.0
    np.testing.assert_array_equal(surface.height_mm(np.linspace(0, 32, 9), np.linspace(0, 32, 9)), 0.0)


@pytest.mark.parametrize("walls", [(2.0, 8.67, 5.33, 5.33), (2.4, 3.0, 2.2, 9.0), (16 / 3,) * 4])
def test_the_factor_alone_is_that_of_the_whole_correction(walls: tuple[float, ...]) -> None:
    assert wall_force_factor(3.0, 0.7, walls) == wall_correction(3.0, 0.7, walls).force_factor
