from __future__ import annotations

import math

import numpy as np
import pytest

from tests.oracle.chance import draw, lobe_direction, ray_stream
from tests.oracle.scene import fresnel_reflectance


def test_reflectance_at_normal_incidence_is_the_square_of_the_index_step():
    assert fresnel_reflectance(1.0, 1.41) == pytest.approx((0.41 / 2.41) ** 2, rel=1e-14)


def test_at_brewsters_angle_only_the_crossed_polarisation_reflects():
    angle = math.atan(1.0 / 1.41)
    out = math.asin(1.41 * math.sin(angle))
    crossed = (math.sin(angle - out) / math.sin(angle + out)) ** 2
    assert fresnel_reflectance(math.cos(angle), 1.41) == pytest.approx(0.5 * crossed, rel=1e-9)


def test_reflection_is_total_beyond_the_critical_angle():
    critical = math.asin(1.0 / 1.41)
    assert fresnel_reflectance(math.cos(critical + 1e-6), 1.41) == 1.0
    assert fresnel_reflectance(math.cos(critical - 1e-6), 1.41) < 0.995


def test_no_index_step_reflects_nothing():
    assert fresnel_reflectance(0.3, 1.0) == pytest.approx(0.0, abs=1e-30)


@pytest.mark.parametrize("order", [0.0, 1.0, 2.7, 20.0])
@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.36, -0.48, 0.8), (0.0, -0.6, -0.8)])
def test_directions_follow_a_power_of_the_cosine(order, normal):
    rng = np.random.default_rng(3)
    count = 20_000
    directions = np.array([lobe_direction(*normal, order, *uv) for uv in rng.random((count, 2))])
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0, abs=1e-12)
    cosine = directions @ np.array(normal)
    mean, square = (order + 1.0) / (order + 2.0), (order + 1.0) / (order + 3.0)
    assert cosine.mean() == pytest.approx(mean, abs=4.5 * math.sqrt((square - mean**2) / count))
    # sideways there is no preference: both components vanish within 4.5 standard errors
    sideways = directions - np.outer(cosine, normal)
    assert np.abs(sideways.mean(axis=0)).max() < 4.5 * math.sqrt(0.5 * (1.0 - square) / count) + 1e-12


def test_streams_of_neighbouring_rays_are_uniform_and_unrelated():
    count = 40_000
    first = np.empty(count)
    for ray in range(count):
        _, first[ray] = draw(np.uint64(ray_stream(0, 0, 0, ray)))
    expected = count / 50
    chi_square = ((np.histogram(first, 50, (0.0, 1.0))[0] - expected) ** 2 / expected).sum()
    assert 20.0 < chi_square < 95.0  # 49 degrees of freedom: outside with probability 1e-4
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 4.5 / math.sqrt(count)


def test_streams_differ_by_seed_state_emitter_and_ray():
    keys = {ray_stream(*key) for key in np.ndindex(6, 6, 6, 6)}
    assert len(keys) == 6**4
