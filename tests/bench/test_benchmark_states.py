"""The benchmark is the scene and the presses that the published figures name."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from design.rules.check import require_valid
from tests.bench.measures.benchmark_states import (
    DEPTHS_MM,
    SURFACES,
    benchmark_design,
    benchmark_scene,
    benchmark_states,
    different_walls,
    pad_scan,
    places_mm,
)
from tests.bench.test_bench_light import ring


def test_the_named_design_is_the_benchmark_scene():
    """Order of intensity: ln 1/2 over ln cos 60 degrees, which is 1 to rounding."""
    lowered, expected = benchmark_scene(), ring()
    for field in fields(expected):
        value, wanted = getattr(lowered, field.name), getattr(expected, field.name)
        assert (value is None) == (wanted is None), field.name
        if wanted is not None:
            np.testing.assert_allclose(value, wanted, rtol=1e-12, atol=0.0, err_msg=field.name)


def test_the_named_design_can_be_built():
    require_valid(benchmark_design())


def test_forty_eight_of_sixty_four_pairs_face_from_two_walls():
    assert different_walls(benchmark_scene()).sum() == 48


def test_eighteen_places_are_spread_over_the_pad_and_stay_the_same():
    places = places_mm()
    assert places.shape == (18, 2)
    assert places.min() > 5.0
    assert places.max() < 27.0
    quarters = {(x > 16.0, y > 16.0) for x, y in places}
    assert len(quarters) == 4
    assert places.sum() == pytest.approx(558.4402044287556, abs=1e-9)


@pytest.mark.parametrize("surface", SURFACES)
def test_states_go_place_by_place_through_all_depths(surface):
    states = benchmark_states(surface)
    assert states.centres_mm.shape == (108, 2)
    depths = np.array([press.depth_mm for press in states.indentations]).reshape(18, 6)
    assert (depths == np.array(DEPTHS_MM)).all()
    assert len({id(press) for press in states.indentations}) == 6


def test_a_scan_of_the_pad_has_121_places_and_51_depths():
    centres, presses = pad_scan("analytic")
    assert centres.shape == (6171, 2)
    assert len(presses) == 6171
    assert sum(press is None for press in presses) == 121
