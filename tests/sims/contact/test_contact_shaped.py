"""Presses on discs and crowned pads: local thickness and curvature, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import SHAPED_PRESETS, preset
from optopad.sims.contact.indentation import indent, solved_press
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.pad_surface import pad_surface, pad_surfaces
from optopad.sims.contact.scope import contact_of

DOME, RIDGE, DISC = preset("fingertip-dome"), preset("crowned-40x25"), preset("levi2013-disc")


def test_curvature_and_thickness_are_those_of_the_place() -> None:
    assert contact_of(DOME).mean_crown == pytest.approx(2.0 / 18.0)
    assert contact_of(RIDGE).mean_crown == pytest.approx(3.0 / 120.0)
    assert contact_of(DISC).mean_crown == 0.0
    # 5 mm beside the apex of a sphere of 18 mm the top is 18 - sqrt(18² - 5²) lower, and leans by asin 5/18
    upright = (9.0 - (18.0 - math.sqrt(299.0))) / 2.0
    assert contact_of(DOME).layer_at((16.0, 11.0)) == pytest.approx(
        upright / math.sqrt(1.0 - (5.0 / 18.0) ** 2)
    )
    assert contact_of(RIDGE).layer_at((5.0, 12.5)) == pytest.approx(3.0)
    upright = (9.0 - (60.0 - math.sqrt(3575.0))) / 3.0
    assert contact_of(RIDGE).layer_at((20.0, 17.5)) == pytest.approx(
        upright / math.sqrt(1.0 - (5.0 / 60.0) ** 2)
    )


def test_a_flat_disc_is_the_round_pad_itself() -> None:
    press, library = (
        solved_press(contact_of(DISC), 3.0),
        shipped_library().press(3.0, contact_of(DISC).wall_radius),
    )
    assert press.force_n(3.0) == press.modulus.value * 9.0 * library.force_at(1.0)
    surface = press.at(3.0)
    assert surface.is_hemisphere
    assert surface.radius_mm[-1] == pytest.approx(27.5)  # farther than any wall of the library
    assert surface.height_mm[-1] == pytest.approx(0.0, abs=1e-9)
    small = solved_press(contact_of(DISC.with_(**{"cavity.diameter_mm": 40.0})), 3.0)
    surface, whole = small.at(3.0), small.round_pad_at(3.0)
    assert np.array_equal(surface.height_mm, whole.height_mm)
    assert surface.radius_mm[-1] == pytest.approx(20.0)
    assert surface.height_mm[-1] == pytest.approx(0.0, abs=2e-3)  # bonded at the wall


def test_beside_the_middle_of_a_disc_a_press_is_followed_to_the_nearest_wall_and_runs_out_to_the_farthest() -> (
    None
):
    press = solved_press(contact_of(DOME), at_mm=(15.0, 11.0))
    surface, whole = press.at(2.0), press.round_pad_at(2.0)
    radius = np.linspace(0.0, 6.5, 200)
    assert np.interp(radius, surface.radius_mm, surface.height_mm) == pytest.approx(
        np.interp(radius, whole.radius_mm, whole.height_mm), abs=1e-6
    )
    assert surface.radius_mm[-1] == pytest.approx(15.0)
    assert (surface.height_mm[-1], surface.inclination_deg[-1]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert surface.height_mm[surface.radius_mm > 7.0].min() > -1e-9


@pytest.mark.parametrize("design", [DOME, RIDGE], ids=["sphere", "cylinder"])
def test_a_press_into_a_crown_touches_the_tip_and_ends_at_the_untouched_top(design) -> None:
    tip, crown = design.indenter.tip_radius_mm, contact_of(design).mean_crown
    press = solved_press(contact_of(design), 2.0).at(2.0)
    inside = press.radius_mm < 0.9 * min(press.contact_radius_mm, 0.99 * tip)
    radius = press.radius_mm[inside]
    sphere = tip - 2.0 - np.sqrt(tip**2 - radius**2) + (tip / crown - np.sqrt((tip / crown) ** 2 - radius**2))
    assert press.height_mm[inside] == pytest.approx(sphere, abs=0.01 * tip)
    assert not press.is_hemisphere
    assert press.height_mm[-1] == pytest.approx(0.0, abs=0.01)
    assert solved_press(contact_of(design), 2.0).at(0.0).height_mm == pytest.approx(0.0, abs=1e-9)


def test_a_crown_is_softer_than_a_flat_pad_at_first_touch_and_firmer_where_it_is_thin() -> None:
    shallow = 0.2
    flat = solved_press(contact_of(DOME.with_(crown=None))).force_n(shallow)
    # two spheres have the effective radius R C / (R + C): by Hertz force goes with its root
    assert solved_press(contact_of(DOME)).force_n(shallow) / flat == pytest.approx(
        math.sqrt(18.0 / 20.0), rel=0.03
    )
    apex, beside = (solved_press(contact_of(DOME), at_mm=(x, 11.0)).force_n(2.0) for x in (11.0, 17.5))
    assert beside > apex


def test_tops_of_many_places_are_those_of_each() -> None:
    presses = np.array([[11.0, 11.0, 1.0], [14.0, 9.0, 2.0]])
    for row, found in zip(presses, pad_surfaces(contact_of(DOME), presses), strict=True):
        alone = pad_surface(DOME, float(row[2]), (float(row[0]), float(row[1])))
        assert np.array_equal(found.near.height_mm, alone.near.height_mm)
        assert found.near.force_n == alone.near.force_n
        assert found.beside_mm(np.array([3.0, 4.0]), np.array([5.0])).tolist() == [[0.0], [0.0]]


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_the_deepest_press_is_known_at_the_border_of_the_workspace(name: str) -> None:
    design = preset(name)
    inset = design.indenter.tip_radius_mm + design.operating.workspace_margin_mm
    place = (inset + 1e-9, design.cavity.width_mm / 2)
    assert design.operating.max_depth_mm <= contact_of(design).depth_limit_mm
    assert indent(design, design.operating.max_depth_mm, place).force_n > 0.0


def test_what_is_not_covered_is_refused_by_its_field() -> None:
    with pytest.raises(ModelScopeError, match=r"indenter\.shape: 'flat_punch'"):
        solved_press(
            contact_of(DOME.with_(**{"indenter.shape": "flat_punch", "operating.max_depth_mm": 1.0}))
        )
    with pytest.raises(ModelScopeError, match=r"0\.48 tip"):
        solved_press(contact_of(DISC), at_mm=(1.5, 27.5))
    with pytest.raises(InputError, match="lie in"):
        solved_press(contact_of(DISC), at_mm=(1.0, 1.0))
    thin = DOME.with_(**{"indenter.tip_radius_mm": 4.4, "operating.max_depth_mm": 3.0})
    with pytest.raises(ModelScopeError, match=r"cavity\.clear_thickness_mm.*are 9 mm"):
        solved_press(contact_of(thin))
