"""The grid of places over a workspace: a rectangle's whole, of a disc what lies in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import PRESETS, SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.design.shape.outline import disc, rectangle
from optopad.fabrication.driver.simulated.press_table import table_of
from optopad.sims.verdict.pad_map import grid_inside, grid_places_mm, map_grid_mm, on_grid

DISC = disc((2.0, 2.0, 12.0, 12.0))


@pytest.mark.parametrize("name", PRESETS)
def test_every_place_of_a_map_is_a_press_centre_on_its_lines(name: str) -> None:
    cavity = cavity_of(preset(name))
    x_mm, y_mm = map_grid_mm(cavity, 5)
    places = grid_places_mm(cavity.workspace, x_mm, y_mm)
    assert all(cavity.workspace.contains(*place) for place in places)
    for axis, lines in ((0, x_mm), (1, y_mm)):
        assert np.abs(places[:, axis, None] - lines).min(axis=1).max() < 1e-9
    if not cavity.workspace.arcs:
        assert len(places) == len(x_mm) * len(y_mm)


def test_the_places_of_a_disc_have_the_symmetry_of_their_grid_and_reach_its_border() -> None:
    cavity = cavity_of(preset("levi2013-disc"))
    counts = {}
    for wanted in (5, 11):
        x_mm, y_mm = map_grid_mm(cavity, wanted)
        inside = grid_inside(cavity.workspace, x_mm, y_mm)
        counts[wanted] = int(inside.sum())
        assert np.array_equal(inside, inside.T)
        assert np.array_equal(inside, inside[::-1])
        assert inside[len(y_mm) // 2].all()  # the border itself is pressed
    assert counts == {5: 13, 11: 81}


def test_what_is_known_of_places_lands_in_its_cells_and_nothing_elsewhere() -> None:
    lines = np.linspace(2.0, 12.0, 7)
    inside = grid_inside(DISC, lines, lines)
    places = grid_places_mm(DISC, lines, lines)
    found = on_grid(places, inside)
    assert np.array_equal(np.isnan(found[..., 0]), ~inside)
    rows, columns = np.nonzero(inside)
    assert found[rows, columns] == pytest.approx(np.stack([lines[columns], lines[rows]], axis=1))


def test_even_shares_fill_a_disc_evenly() -> None:
    shares = (np.outer(np.arange(1, 20_001), [0.7548776662, 0.5698402910])) % 1.0
    places = DISC.spread(shares) - 7.0
    away = np.hypot(*places.T)
    assert away.max() <= 5.0
    assert np.mean(away < 2.5) == pytest.approx(0.25, abs=0.005)  # a quarter of the area
    assert np.mean(places[:, 0] > 0) == pytest.approx(0.5, abs=0.005)
    square = rectangle((0.0, 1.0, 2.0, 5.0))
    assert square.spread(np.array([[0.25, 0.5]])) == pytest.approx(np.array([[0.5, 3.0]]))


def test_a_table_of_a_disc_takes_the_nearest_place_where_it_has_none() -> None:
    lines = np.linspace(2.0, 12.0, 5)
    places = grid_places_mm(DISC, lines, lines)
    presses = np.array([[*place, depth] for place in places for depth in (0.0, 1.0)])
    counts = (presses[:, 0] + 100.0 * presses[:, 1] + presses[:, 2])[:, None, None]
    table = table_of(presses, counts, is_whole=False)
    assert table.counts.shape == (5, 5, 2, 1, 1)
    assert table.counts[2, 2, 1, 0, 0] == 7.0 + 700.0 + 1.0
    corner = table.counts[0, 0, 1, 0, 0]
    assert corner == 4.5 + 450.0 + 1.0  # of the nearest pressed place


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_presses_of_a_protocol_lie_in_the_workspace(name: str) -> None:
    space = cavity_of(preset(name)).workspace
    places = space.spread(np.random.default_rng(1).random((200, 2)))
    assert all(space.contains(*place) for place in places)


@pytest.mark.parametrize(("length_mm", "width_mm"), [(22.0, 14.0), (28.0, 13.0), (40.0, 9.0), (14.0, 22.0)])
def test_the_middle_of_a_pad_is_a_place_of_its_map_whatever_its_sides(
    length_mm: float, width_mm: float
) -> None:
    space = rectangle((4.0, 4.0, 4.0 + length_mm, 4.0 + width_mm))
    cavity = replace(cavity_of(preset("piacenza2017-pad")), workspace=space)
    for places in (3, 5, 11):
        x_mm, y_mm = map_grid_mm(cavity, places)
        middle = np.array([4.0 + length_mm / 2, 4.0 + width_mm / 2])
        away = np.abs(grid_places_mm(space, x_mm, y_mm) - middle).max(axis=1)
        assert away.min() < 1e-9
        assert max(len(x_mm), len(y_mm)) == places
