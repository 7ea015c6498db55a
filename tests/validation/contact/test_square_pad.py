"""Square pads of the oracle, stored, and the design's round model against them."""

from __future__ import annotations

import numpy as np
import pytest

from sims.contact.pad_surface import pad_surface
from sims.optics.accuracy import ACCURACIES
from tests.validation.contact.square_pad import (
    DEPTHS_MM,
    GRID_MM,
    MARKS,
    PAGE,
    PLACES,
    TIP_RADIUS_MM,
    SquarePress,
    dense_top,
    engine_height_mm,
    is_off_walls,
    is_outside_contact,
    light_errors,
    modelled,
    oracle_field,
    press_error,
    size_of,
    square_press,
)

PRESSES = [(name, depth_mm) for name in PLACES for depth_mm in DEPTHS_MM]


def both(name: str, depth_mm: float) -> tuple[SquarePress, SquarePress]:
    """The oracle's press on its finer and coarser mesh."""
    return square_press(name, depth_mm), square_press(name, depth_mm, half=True)


@pytest.mark.parametrize(("name", "depth_mm"), PRESSES)
def test_the_oracles_meshes_agree(name: str, depth_mm: float) -> None:
    """Elements of half the size: errors that fall with the square leave the finer mesh a third of these."""
    fine, coarse = both(name, depth_mm)
    assert fine.force < coarse.force < 1.03 * fine.force
    outside = is_outside_contact(PLACES[name], modelled(PLACES[name], depth_mm))
    rms_mm, largest_mm = size_of((coarse.height_mm - fine.height_mm)[outside])
    assert rms_mm < 6e-3 * depth_mm  # found: 2.6 to 4.8 um a mm
    assert largest_mm < 50e-3 * depth_mm  # beside the contact


@pytest.mark.parametrize(("name", "depth_mm"), PRESSES)
def test_the_oracles_top_keeps_its_volume_and_its_walls(name: str, depth_mm: float) -> None:
    """Poisson's ratio 0.499 lets go force x layer / bulk modulus or a little more: 0.04 to 0.08 of 2.4 R³ at 1 R."""
    top = square_press(name, depth_mm).height_mm
    sunk = top[top < 0].sum()
    assert abs(top.sum()) < 0.04 * abs(sunk)
    assert max(np.abs(side).max() for side in (top[0], top[-1], top[:, 0], top[:, -1])) == 0.0
    assert (top == top[:, ::-1]).all()
    assert top.min() == pytest.approx(-depth_mm, abs=1e-6)


@pytest.mark.parametrize("name", ["pad middle", "pair middle"])
def test_a_press_in_the_middle_has_the_symmetry_of_the_square(name: str) -> None:
    top = square_press(name, 3.0).height_mm
    # the mesh is symmetric, the triangles that heights are read from are not
    assert np.abs(top - top[::-1]).max() < 1e-3
    assert np.abs(top - top.T).max() < 1e-3


def test_points_between_nodes_are_those_of_the_elements() -> None:
    rest = np.stack([one.ravel() for one in np.meshgrid([-1.0, 0.0, 1.0, 2.5, 4.0], [0.0, 0.5, 1.0])])

    def bent(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.stack([x + 0.1 * x**2, y, x**2 * y**2 - x * y], axis=1)

    points = dense_top(rest, bent(*rest))
    x = (np.sqrt(1.0 + 0.4 * points[:, 0]) - 1.0) / 0.2
    assert len(points) == 17 * 9
    assert points == pytest.approx(bent(x, points[:, 1]), abs=1e-12)  # a biquadratic: round-off


def test_a_model_compared_with_itself_has_no_error() -> None:
    place = PLACES["pair middle"]
    press = modelled(place, 2.0)
    own = engine_height_mm(place, press)
    force = square_press("pair middle", 2.0).force
    error = press_error(place, press, *[SquarePress(force=force, height_mm=own)] * 2)
    assert error.everywhere_um == error.off_walls_um == error.mesh_um == (0.0, 0.0)
    assert error.mesh_force_ratio == 1.0
    (light,) = light_errors(place, [press], [own], [own], ACCURACIES["draft"])
    # a field of zeros is marched through, no field is not: the same paths to the march's tolerance
    assert light.size[1] < 1e-3
    assert light.mesh == (0.0, 0.0)


def test_curve_and_field_are_the_oracles_top() -> None:
    place, press = PLACES["pad near a wall"], modelled(PLACES["pad near a wall"], 2.0)
    top = square_press("pad near a wall", 2.0).height_mm
    found = engine_height_mm(place, press, oracle_field(place, press, top))
    set_in = place.radius_mm() > press.contact_radius_mm + 0.2 * TIP_RADIUS_MM
    assert np.abs(found - top)[set_in].max() < 1e-9  # nodes of the field: round-off
    assert place.grid_mm()[0][1, 0] == GRID_MM


@pytest.mark.parametrize(("name", "depth_mm"), PRESSES)
def test_the_model_has_the_oracles_force(name: str, depth_mm: float) -> None:
    """The library is off by 1.5 % (docs/validation/contact.md), the oracle by a third of its meshes' 2.7 %."""
    place = PLACES[name]
    error = press_error(place, modelled(place, depth_mm), *both(name, depth_mm))
    assert error.force_ratio == pytest.approx(1.0, abs=0.03)


# These limits hold only where the curve is that of the round pad of the same area, followed to half the width and run
# out from there. With the axisymmetric oracle's curve of that round pad, run out over 4 mm, the three presses are off
# by 2.2, 6.4 and 11.3 um in the pad and by 5.9, 17.7 and 32.3 um in the pair; the library adds up to 2 um rms.
@pytest.mark.parametrize(
    ("name", "limits_um"),
    [
        ("pad middle", (4.0, 8.0, 12.0)),
        ("pair middle", (8.0, 20.0, 36.0)),
        # the walls' field is not in the curve: found 7, 20 and 36 um
        ("pad near a wall", (8.0, 22.0, 40.0)),
    ],
)
def test_a_round_pad_of_the_same_area_has_the_square_pads_surface(
    name: str, limits_um: tuple[float, ...]
) -> None:
    place = PLACES[name]
    for depth_mm, limit_um in zip(DEPTHS_MM, limits_um, strict=True):
        error = press_error(place, modelled(place, depth_mm), *both(name, depth_mm))
        assert error.off_walls_um[0] <= limit_um, depth_mm


def test_the_page_holds_every_press_as_the_model_has_it_now() -> None:
    made = PAGE.read_text(encoding="utf-8").split(MARKS[0])[1].split(MARKS[1])[0]
    lines = [[cell.strip() for cell in line.split("|")[1:6]] for line in made.strip().splitlines()[2:]]
    assert [line[:2] for line in lines] == [[name, f"{depth_mm:g}"] for name, depth_mm in PRESSES]
    for (name, depth_mm), line in zip(PRESSES, lines, strict=True):
        error = press_error(PLACES[name], modelled(PLACES[name], depth_mm), *both(name, depth_mm))
        # digits of the page
        assert float(line[2]) == pytest.approx(100.0 * (error.force_ratio - 1.0), abs=0.06)
        assert float(line[3].split(",")[0]) == pytest.approx(error.everywhere_um[0], abs=0.6)
        assert float(line[4].split(",")[0]) == pytest.approx(error.off_walls_um[0], abs=0.6)


@pytest.mark.parametrize("name", PLACES)
def test_the_whole_pads_surface_is_the_oracles_to_what_its_meshes_tell(name: str) -> None:
    place = PLACES[name]
    at_mm = place.at_mm
    for depth_mm, limit_um in zip(DEPTHS_MM, (4.0, 10.0, 18.0), strict=True):
        press = modelled(place, depth_mm)
        off_um = 1e3 * (
            pad_surface(place.design, depth_mm, at_mm).height_mm(*place.grid_mm())
            - square_press(name, depth_mm).height_mm
        )
        # found at 3 mm: 9.9, 16 and 14.6 µm; the correction's own error is 10 to 39 µm (docs/validation/walls.md)
        assert size_of(off_um[is_outside_contact(place, press) & is_off_walls(place)])[0] < limit_um, depth_mm
