"""Pads of the oracle, stored, and the design's presses against them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.contact.pad_oracle import (
    DEPTHS_MM,
    PLACES,
    PadPress,
    dense_top,
    pad_press,
)
from tests.validation.contact.pad_table import (
    MARKS,
    PAGE,
    is_outside_contact,
    modelled,
    press_error,
    size_of,
)

PRESSES = [(name, depth_mm) for name in PLACES for depth_mm in DEPTHS_MM]
FAST = "pad middle"


def marked(name: str) -> tuple[pytest.MarkDecorator, ...]:
    """All places but one wait for the slow tests."""
    return () if name == FAST else (pytest.mark.slow,)


EVERY_PRESS = [pytest.param(name, depth_mm, marks=marked(name)) for name, depth_mm in PRESSES]
EVERY_PLACE = [pytest.param(name, marks=marked(name)) for name in PLACES]


def both(name: str, depth_mm: float) -> tuple[PadPress, PadPress]:
    """The oracle's press on its finer and coarser mesh."""
    return pad_press(name, depth_mm), pad_press(name, depth_mm, half=True)


@pytest.mark.parametrize(("name", "depth_mm"), EVERY_PRESS)
def test_the_oracles_meshes_agree(name: str, depth_mm: float) -> None:
    """Elements of half the size: errors that fall with the square leave the finer mesh a third of these."""
    fine, coarse = both(name, depth_mm)
    assert fine.force < coarse.force < 1.035 * fine.force
    outside = is_outside_contact(PLACES[name], modelled(PLACES[name], depth_mm).near)
    rms_mm, largest_mm = size_of((coarse.height_mm - fine.height_mm)[outside])
    assert rms_mm < 7e-3 * depth_mm
    assert largest_mm < 70e-3 * depth_mm  # beside the contact


@pytest.mark.parametrize(("name", "depth_mm"), EVERY_PRESS)
def test_the_oracles_top_keeps_its_volume_and_its_walls(name: str, depth_mm: float) -> None:
    """Poisson's ratio 0.499 lets go force x layer / bulk modulus or a little more: 0.04 to 0.11 of 2.4 R³ at 1 R."""
    place, top = PLACES[name], pad_press(name, depth_mm).height_mm
    sunk = top[top < 0].sum()
    assert abs(top.sum()) < (0.05 if name == "small pad" else 0.04) * abs(sunk)
    assert max(np.abs(side).max() for side in (top[0], top[-1], top[:, 0], top[:, -1])) == 0.0
    if place.is_mirrored:
        assert np.abs(top - top[:, ::-1]).max() < 1e-3
    assert top.min() == pytest.approx(-depth_mm, abs=1e-6)


def test_points_between_nodes_are_those_of_the_elements() -> None:
    rest = np.stack([one.ravel() for one in np.meshgrid([-1.0, 0.0, 1.0, 2.5, 4.0], [0.0, 0.5, 1.0])])

    def bent(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.stack([x + 0.1 * x**2, y, x**2 * y**2 - x * y], axis=1)

    points = dense_top(rest, bent(*rest))
    x = (np.sqrt(1.0 + 0.4 * points[:, 0]) - 1.0) / 0.2
    assert len(points) == 17 * 9
    assert points == pytest.approx(bent(x, points[:, 1]), abs=1e-12)  # a biquadratic: round-off


@pytest.mark.parametrize(("name", "depth_mm"), EVERY_PRESS)
def test_the_model_has_the_oracles_force(name: str, depth_mm: float) -> None:
    """The library is off by 1.5 % (docs/validation/contact.md), the oracle by a third of its meshes' 2.7 %."""
    place = PLACES[name]
    error = press_error(place, modelled(place, depth_mm), *both(name, depth_mm))
    assert error.force_ratio == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("name", EVERY_PLACE)
def test_the_whole_top_is_the_oracles_to_what_its_meshes_tell(name: str) -> None:
    place = PLACES[name]
    for depth_mm in DEPTHS_MM:
        error = press_error(place, modelled(place, depth_mm), *both(name, depth_mm))
        assert error.surface_um[0] < max(error.mesh_um[0], 4.0), depth_mm


@pytest.mark.slow
def test_the_page_holds_every_press_as_the_model_has_it_now() -> None:
    made = PAGE.read_text(encoding="utf-8").split(MARKS[0])[1].split(MARKS[1])[0]
    lines = [[cell.strip() for cell in line.split("|")[1:5]] for line in made.strip().splitlines()[2:]]
    assert [line[:2] for line in lines] == [[name, f"{depth_mm:g}"] for name, depth_mm in PRESSES]
    for (name, depth_mm), line in zip(PRESSES, lines, strict=True):
        error = press_error(PLACES[name], modelled(PLACES[name], depth_mm), *both(name, depth_mm))
        # digits of the page
        assert float(line[2]) == pytest.approx(100.0 * (error.force_ratio - 1.0), abs=0.06)
        assert float(line[3].split(",")[0]) == pytest.approx(error.surface_um[0], abs=0.6)
