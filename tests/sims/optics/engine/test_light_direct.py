"""Straight and mirrored light against closed forms and independent quadrature."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.optics.engine.trace_states import Accuracy, trace_scene
from optopad.sims.optics.scene.optical_scene import OpticalScene
from tests.sims.optics.form_factors import parallel_factor, perpendicular_factor

CHEAP = Accuracy(reference_rays=1024, flat_nodes=16)


def scene(walls, patches, **changes):
    values = {
        "length_mm": 24.0,
        "width_mm": 20.0,
        "height_mm": 8.0,
        "refractive_index": 1.41,
        "absorption_per_mm": 0.0,
        "wall_reflectance": 0.0,
        "bottom_reflectance": 0.0,
        "tip_reflectance": 0.0,
        "emitter_wall": np.array([walls[0]]),
        "emitter_patch": np.array([patches[0]]),
        "emitter_order": np.ones(1),
        "receiver_wall": np.array([walls[1]]),
        "receiver_patch": np.array([patches[1]]),
    }
    return OpticalScene(**(values | changes))


def untouched(given):
    raw = trace_scene(given, np.zeros((1, 2)), [None], accuracy=CHEAP)
    return raw.flux[:, 0, 0, 0]


def test_direct_flux_equals_the_form_factor_of_facing_rectangles():
    flux = untouched(scene((0, 2), ([8.0, 4.0, 0.5, 0.5], [15.0, 5.0, 1.3, 1.3])))
    expected = parallel_factor((7.5, 8.5), (3.5, 4.5), (3.7, 6.3), (13.7, 16.3), 20.0)
    assert flux[0] == pytest.approx(expected, rel=1e-9)


def test_direct_flux_equals_the_form_factor_of_rectangles_round_a_corner():
    flux = untouched(scene((0, 3), ([4.0, 4.0, 0.5, 0.5], [4.0, 5.0, 1.3, 1.3])))
    expected = perpendicular_factor((3.5, 4.5), (3.5, 4.5), (3.7, 6.3), (2.7, 5.3))
    assert flux[0] == pytest.approx(expected, rel=1e-7)


def fresnel(cos_angle, index):
    sin_t = index * np.sqrt(1 - cos_angle**2)
    cos_t = np.sqrt(np.maximum(1 - sin_t**2, 0))
    rs = (index * cos_angle - cos_t) / (index * cos_angle + cos_t)
    rp = (cos_angle - index * cos_t) / (cos_angle + index * cos_t)
    return np.where(sin_t >= 1, 1.0, (rs**2 + rp**2) / 2)


def mirrored_by_quadrature(patches, width, top, index, absorption, nodes=14):
    """South to north wall by Gauss nodes in all four coordinates."""
    t, w = np.polynomial.legendre.leggauss(nodes)
    (xe, ze, ue, ve), (xr, zr, ur, vr) = patches
    a, b, c, d = np.meshgrid(xe + ue * t, ze + ve * t, xr + ur * t, 2 * top - zr + vr * t, indexing="ij")
    weight = np.einsum("i,j,k,l->ijkl", w, w, w, w) / 4 * ur * vr
    d2 = (a - c) ** 2 + (b - d) ** 2 + width**2
    kernel = width**2 / (np.pi * d2**2) * np.exp(-absorption * np.sqrt(d2))
    return np.sum(weight * kernel * fresnel((d - b) / np.sqrt(d2), index))


@pytest.mark.parametrize("index", [1.41, 1.001])
@pytest.mark.parametrize("absorption", [0.0, 0.05])
def test_flat_mirror_equals_independent_quadrature(index, absorption):
    patches = ([8.0, 4.0, 0.5, 0.5], [15.0, 5.0, 1.3, 1.3])
    given = scene((0, 2), patches, refractive_index=index, absorption_per_mm=absorption)
    expected = mirrored_by_quadrature(patches, 20.0, 8.0, index, absorption)
    assert untouched(given)[1] == pytest.approx(expected, rel=1e-7)


def test_strong_absorption_leaves_nothing():
    given = scene((0, 2), ([8.0, 4.0, 0.5, 0.5], [15.0, 5.0, 1.3, 1.3]), absorption_per_mm=50.0)
    assert untouched(given).sum() < 1e-300**0.5


def test_weak_absorption_lowers_flux_by_path_length():
    patches = ([10.0, 4.0, 0.05, 0.05], [10.0, 4.0, 0.05, 0.05])
    clear, dim = (untouched(scene((0, 2), patches, absorption_per_mm=value))[0] for value in (0.0, 1e-3))
    assert np.log(clear / dim) == pytest.approx(1e-3 * 20.0, rel=1e-5)


def test_order_two_source_is_brighter_ahead_by_three_halves():
    patches = ([10.0, 4.0, 0.01, 0.01], [10.0, 4.0, 0.01, 0.01])
    plain = untouched(scene((0, 2), patches))[0]
    beamed = untouched(scene((0, 2), patches, emitter_order=np.array([2.0])))[0]
    assert beamed / plain == pytest.approx(1.5, rel=1e-5)


def test_only_the_submerged_part_of_an_emitter_emits():
    tall = scene((0, 2), ([8.0, 7.75, 0.5, 0.5], [15.0, 5.0, 1.3, 1.3]))
    cut = scene((0, 2), ([8.0, 7.625, 0.5, 0.375], [15.0, 5.0, 1.3, 1.3]))
    assert untouched(tall)[0] == pytest.approx(0.75 * untouched(cut)[0], rel=1e-12)


def test_flux_is_reciprocal_for_lambertian_patches():
    small, large = [8.0, 4.0, 0.5, 0.6], [7.0, 5.0, 1.3, 1.1]
    there = untouched(scene((0, 1), (small, large), wall_reflectance=0.0))
    back = untouched(scene((1, 0), (large, small), wall_reflectance=0.0))
    ratio = (4 * 0.5 * 0.6) / (4 * 1.3 * 1.1)
    assert there[:2] * ratio == pytest.approx(back[:2], rel=1e-9)


def test_pairs_on_one_wall_have_neither_straight_nor_mirrored_light():
    given = scene((0, 0), ([6.0, 4.0, 0.5, 0.5], [15.0, 5.0, 1.3, 1.3]), wall_reflectance=0.05)
    flux = untouched(given)
    assert flux[:4].sum() == 0.0
    assert flux[4] > 0.0


def test_diffuse_light_vanishes_with_reflectance_and_grows_in_proportion():
    given = scene((0, 2), ([8.0, 4.0, 0.5, 0.5], [15.0, 5.0, 1.3, 1.3]))
    black = untouched(given)[4]
    weak = untouched(replace(given, wall_reflectance=1e-4, bottom_reflectance=1e-4))[4]
    twice = untouched(replace(given, wall_reflectance=2e-4, bottom_reflectance=2e-4))[4]
    assert black == 0.0
    assert twice / weak == pytest.approx(2.0, rel=1e-3)
