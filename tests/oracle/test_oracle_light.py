from __future__ import annotations

import math
from functools import cache

import numba
import numpy as np
import pytest

from tests.oracle.oracle_scenes import dimple, ring_scene, scene_of, wrapped_press
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES

DIRECT, TOP, SKIRT, WALL, DIFFUSE, CROSSING = range(6)


def fate(light, name):
    return light.ledger[FATES.index(name)]


@cache
def ring_light():
    """The ring scene, absorbing, with a reflecting tip: flat, shallow, deep, wrapped, at a wall."""
    scene = ring_scene(absorption_per_mm=0.01, tip_reflectance=0.3)
    presses = [None, dimple(0.5), dimple(3.0, 0.2), wrapped_press(), dimple(3.0, 0.2)]
    centres = [[16, 16], [16, 16], [14, 17], [16, 16], [3.2, 12.0]]
    return trace_oracle(scene, centres, presses, rays=100_000, seed=1)


def gauss(low, high, points=24):
    x, w = np.polynomial.legendre.leggauss(points)
    return low + (high - low) * 0.5 * (x + 1.0), 0.5 * w


def pair_flux(scene, emitter, receiver, *, mirrored, order=1.0, points=24):
    """Flux of one pair over a flat top by quadrature over both rectangles; Fresnel in Snell's angles."""
    axis = {0: (0, 1, 0.0), 1: (1, -1, scene.length_mm), 2: (0, -1, scene.width_mm), 3: (1, 1, 0.0)}
    grids = []
    for wall, patch in (
        (int(scene.emitter_wall[emitter]), scene.emitter_patch[emitter]),
        (int(scene.receiver_wall[receiver]), scene.receiver_patch[receiver]),
    ):
        along, w = gauss(patch[0] - patch[2], patch[0] + patch[2], points)
        height, v = gauss(patch[1] - patch[3], min(patch[1] + patch[3], scene.height_mm), points)
        share = (min(patch[1] + patch[3], scene.height_mm) - patch[1] + patch[3]) / (2.0 * patch[3])
        a, h = (g.ravel() for g in np.meshgrid(along, height, indexing="ij"))
        run, inward, place = axis[wall]
        point = np.zeros((a.size, 3))
        point[:, run], point[:, 1 - run], point[:, 2] = a, place, h
        normal = np.zeros(3)
        normal[1 - run] = inward
        grids.append((point, normal, np.outer(w, v).ravel(), share, 4.0 * patch[2] * patch[3] * share))
    (p, n, wp, share, _), (q, m, wq, _, area) = grids
    q = q.copy()
    if mirrored:
        q[:, 2] = 2.0 * scene.height_mm - q[:, 2]
    total = 0.0
    for point, weight in zip(p, wp, strict=True):
        step = q - point
        distance = np.linalg.norm(step, axis=1)
        start, end = step @ n / distance, -(step @ m) / distance
        kernel = (order + 1.0) / (2.0 * math.pi) * start**order * end / distance**2
        kernel *= np.exp(-scene.absorption_per_mm * distance)
        if mirrored:
            kernel *= reflectance_by_angles(step[:, 2] / distance, scene.refractive_index)
        total += weight * float(wq @ kernel)
    return total * area * share


def reflectance_by_angles(cosine, index):
    inside = np.arccos(cosine)
    beyond = index * np.sin(inside) >= 1.0
    out = np.arcsin(np.where(beyond, 0.0, index * np.sin(inside)))
    crossed = (np.sin(inside - out) / np.sin(inside + out)) ** 2
    within = (np.tan(inside - out) / np.tan(inside + out)) ** 2
    return np.where(beyond, 1.0, 0.5 * (crossed + within))


def signs(rectangle, other, primitive):
    """Sum over the corners of two rectangles with alternating signs, as in the closed forms."""
    total = 0.0
    for i, j, k, n in np.ndindex(2, 2, 2, 2):
        sign = (-1) ** (i + j + k + n)
        total += sign * primitive(rectangle[0][i], rectangle[1][j], other[0][k], other[1][n])
    return total / ((rectangle[0][1] - rectangle[0][0]) * (rectangle[1][1] - rectangle[1][0]))


def parallel_form_factor(first, second, gap):
    """Between parallel rectangles (Howell, catalogue of configuration factors, C-13)."""

    def primitive(x, y, xi, eta):
        u, v = x - xi, y - eta
        p, q = math.hypot(u, gap), math.hypot(v, gap)
        return (
            v * p * math.atan(v / p)
            + u * q * math.atan(u / q)
            - 0.5 * gap**2 * math.log(u**2 + v**2 + gap**2)
        ) / (2.0 * math.pi)

    return signs(first, second, primitive)


def perpendicular_form_factor(first, second):
    """Between rectangles at right angles; (distance from the common edge, place along it) (Howell, C-15)."""

    def primitive(x, y, xi, eta):
        far, v = x**2 + xi**2, y - eta
        return (
            v * math.sqrt(far) * math.atan(v / math.sqrt(far)) - 0.25 * (far - v**2) * math.log(far + v**2)
        ) / (2.0 * math.pi)

    return signs(first, second, primitive)


@pytest.mark.slow
def test_direct_flux_of_facing_rectangles_is_the_closed_form():
    scene = scene_of([(3, 15.0, 4.0, 1.5, 1.0)], [(1, 17.0, 5.0, 2.0, 2.5)], length_mm=10.0)
    light = trace_oracle(scene, [[5, 5]], [None], rays=1_000_000, seed=2)
    truth = parallel_form_factor(([13.5, 16.5], [3, 5]), ([15, 19], [2.5, 7.5]), 10.0)
    assert truth == pytest.approx(pair_flux(scene, 0, 0, mirrored=False), rel=1e-9)
    assert abs(light.flux[DIRECT, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[DIRECT, 0, 0, 0]


@pytest.mark.slow
def test_direct_flux_around_a_corner_is_the_closed_form():
    scene = scene_of([(0, 4.0, 4.0, 1.5, 1.0)], [(3, 5.0, 5.0, 2.0, 2.5)])
    light = trace_oracle(scene, [[5, 5]], [None], rays=1_000_000, seed=3)
    truth = perpendicular_form_factor(([2.5, 5.5], [3, 5]), ([3, 7], [2.5, 7.5]))
    assert truth == pytest.approx(pair_flux(scene, 0, 0, mirrored=False), rel=1e-9)
    assert abs(light.flux[DIRECT, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[DIRECT, 0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("receiver", [(1, 17.0, 5.0, 2.0, 2.5), (2, 5.0, 5.0, 2.0, 2.5)])
def test_flat_mirrored_flux_is_the_quadrature_with_fresnel(receiver):
    scene = scene_of([(3, 15.0, 4.0, 1.5, 1.0)], [receiver], length_mm=10.0, width_mm=20.0)
    light = trace_oracle(scene, [[5, 5]], [None], rays=1_000_000, seed=4)
    truth = pair_flux(scene, 0, 0, mirrored=True)
    # the kink of Fresnel's curve at the critical angle: halving the points moves the quadrature by less
    assert truth == pytest.approx(pair_flux(scene, 0, 0, mirrored=True, points=12), rel=2e-3)
    assert abs(light.flux[TOP, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[TOP, 0, 0, 0]


@pytest.mark.slow
def test_a_narrow_lobe_in_an_absorbing_pad_is_the_quadrature():
    scene = scene_of(
        [(3, 15.0, 4.0, 1.5, 1.0)],
        [(1, 15.0, 5.0, 2.0, 2.5)],
        length_mm=10.0,
        absorption_per_mm=0.05,
        emitter_order=np.array([5.0]),
    )
    light = trace_oracle(scene, [[5, 5]], [None], rays=400_000, seed=5)
    for name, mirrored in ((DIRECT, False), (TOP, True)):
        truth = pair_flux(scene, 0, 0, mirrored=mirrored, order=5.0)
        assert abs(light.flux[name, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[name, 0, 0, 0]


@pytest.mark.slow
def test_only_the_submerged_part_of_emitter_and_receiver_counts():
    scene = scene_of([(3, 15.0, 7.5, 1.0, 1.0)], [(1, 15.0, 7.0, 2.0, 2.0)], length_mm=10.0)
    light = trace_oracle(scene, [[5, 5]], [None], rays=400_000, seed=6)
    assert fate(light, "unsubmerged")[0, 0] == pytest.approx(0.25, abs=4.0 * math.sqrt(0.1875 / 400_000))
    truth = pair_flux(scene, 0, 0, mirrored=False)
    assert abs(light.flux[DIRECT, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[DIRECT, 0, 0, 0]


@pytest.mark.slow
def test_all_light_is_accounted_for_on_flat_and_deformed_pads():
    light = ring_light()
    assert np.abs(light.ledger.sum(axis=0) - 1.0).max() < 1e-9
    assert light.ledger[: len(CLASSES)] == pytest.approx(light.flux.sum(axis=3), abs=1e-12)
    assert (light.ledger >= 0.0).all()
    assert fate(light, "unresolved").max() == 0.0
    assert fate(light, "tip")[0].max() == 0.0
    assert fate(light, "tip")[1:].min() > 0.0
    assert fate(light, "volume").min() > 0.05


@pytest.mark.slow
def test_a_flat_pad_has_no_skirt_light_and_a_pressed_one_does():
    light = ring_light()
    assert CLASSES[SKIRT] == "skirt"
    assert light.flux[SKIRT, 0].max() == 0.0
    assert light.flux[SKIRT, 1:].sum(axis=(1, 2)).min() > 0.0


@pytest.mark.slow
def test_pairs_on_one_wall_see_diffuse_light_only_while_the_pad_is_flat():
    scene, light = ring_scene(), ring_light()
    same = scene.emitter_wall[:, None] == scene.receiver_wall
    assert light.flux[:DIFFUSE, 0][:, same].max() == 0.0
    assert light.flux[DIFFUSE, 0][same].sum() > 0.0


@pytest.mark.slow
@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread allowed")
def test_one_and_two_threads_give_the_same_bits():
    lights = []
    before = numba.get_num_threads()
    for threads in (1, 2):
        numba.set_num_threads(threads)
        lights.append(
            trace_oracle(ring_scene(absorption_per_mm=0.01), [[14, 17]], [dimple(2.0)], rays=20_000)
        )
    numba.set_num_threads(before)
    for name in ("flux", "class_standard_error", "standard_error", "ledger"):
        assert np.array_equal(getattr(lights[0], name), getattr(lights[1], name))


@pytest.mark.slow
def test_a_ray_keeps_its_path_when_more_rays_are_asked_for():
    few = trace_oracle(ring_scene(), [[14, 17]], [dimple(2.0)], rays=1000)
    more = trace_oracle(ring_scene(), [[14, 17]], [dimple(2.0)], rays=2000)
    assert (np.rint(more.flux * 2000) >= np.rint(few.flux * 1000)).all()


@pytest.mark.slow
def test_signal_is_mirror_symmetric_for_a_centred_press():
    rows = [(wall, 16.0, 4.0, 0.5, 0.5) for wall in range(4)]
    wide = [(wall, along, 4.0, 1.3, 1.3) for wall in range(4) for along in (10.0, 22.0)]
    light = trace_oracle(scene_of(rows, wide), [[16, 16]], [dimple(2.0)], rays=200_000, seed=7)
    flux, error = light.total[0], light.standard_error[0]
    mirror = [wall * 2 + side for wall in (0, 3, 2, 1) for side in (1, 0)]
    mirror[2:4], mirror[6:8] = [6, 7], [2, 3]  # east and west swap; their places along the wall stay
    pull = (flux[0] - flux[0][mirror]) / np.hypot(error[0], error[0][mirror])
    assert np.nanmax(np.abs(pull)) < 4.0
    facing = (flux[0, 4:6].sum() - flux[2, 0:2].sum()) / math.hypot(*error[0, 4:6], *error[2, 0:2])
    assert abs(facing) < 4.0


@pytest.mark.slow
def test_light_is_reciprocal_under_a_press():
    emitters = [(0, 5.0, 5.0, 1.0, 1.0), (3, 7.0, 5.5, 1.5, 1.0)]
    receivers = [(2, 6.5, 4.0, 1.3, 1.5), (1, 5.0, 5.5, 1.3, 1.3)]
    black = {"wall_reflectance": 0.0, "bottom_reflectance": 0.0, "length_mm": 12.0, "width_mm": 12.0}
    press, centre = dimple(0.7, 0.1), [[6.0, 5.5]]
    forth = trace_oracle(scene_of(emitters, receivers, **black), centre, [press], rays=1_000_000, seed=8)
    back = trace_oracle(scene_of(receivers, emitters, **black), centre, [press], rays=1_000_000, seed=9)
    area = np.array([[4.0 * row[3] * row[4] for row in rows] for rows in (emitters, receivers)])
    for name in (DIRECT, TOP, SKIRT):
        forward = forth.flux[name, 0] * area[0][:, None]
        backward = (back.flux[name, 0] * area[1][:, None]).T
        error = np.hypot(
            forth.class_standard_error[name, 0] * area[0][:, None],
            (back.class_standard_error[name, 0] * area[1][:, None]).T,
        )
        assert (forward / error).max() > 20.0
        assert np.abs((forward - backward) / error).max() < 4.0


@pytest.mark.slow
def test_in_a_white_box_all_light_is_received_or_leaves_through_the_top():
    scene = ring_scene(wall_reflectance=1.0, bottom_reflectance=1.0)
    light = trace_oracle(scene, [[16, 16]], [None], rays=5_000, seed=10)
    received = light.ledger[: len(CLASSES)].sum(axis=0)
    assert received + fate(light, "escaped") == pytest.approx(1.0, abs=1e-9)
    assert received.min() > 0.05
    assert fate(light, "escaped").min() > 0.05


@pytest.mark.slow
def test_at_a_huge_index_nearly_nothing_leaves():
    # the escape cone's solid angle is 1 / index², and 4 n / (1 + n)² of it gets out: 1e-11 of light
    scene = ring_scene(wall_reflectance=1.0, bottom_reflectance=1.0, refractive_index=1e4)
    light = trace_oracle(scene, [[16, 16]], [dimple(1.0)], rays=2_000, seed=11)
    assert fate(light, "escaped").max() == 0.0
    assert light.ledger[: len(CLASSES)].sum(axis=0) + fate(light, "tip") == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
def test_without_an_index_step_every_ray_that_meets_the_top_leaves():
    light = trace_oracle(ring_scene(refractive_index=1.0), [[16, 16]], [dimple(1.0)], rays=50_000)
    assert light.flux[TOP : SKIRT + 1].max() == 0.0
    assert fate(light, "escaped").min() > 0.2


@pytest.mark.slow
def test_a_press_that_covers_nothing_changes_nothing():
    scene = ring_scene()
    light = trace_oracle(scene, [[16, 16]] * 2, [None, dimple(0.005)], rays=500_000, seed=12)
    flux, error = light.total, light.standard_error
    pull = (flux[1] - flux[0]) / np.hypot(error[0], error[1])
    assert np.abs(pull).max() < 4.5  # 64 pairs: one beyond 4.5 in 2,000 runs


@pytest.mark.slow
def test_a_deep_press_between_a_facing_pair_ends_its_direct_light():
    scene = scene_of([(3, 16.0, 4.0, 0.5, 0.5)], [(1, 16.0, 4.0, 1.3, 1.3)])
    light = trace_oracle(scene, [[16, 16]] * 2, [None, wrapped_press()], rays=300_000, seed=13)
    assert light.flux[DIRECT, 0, 0, 0] > 20.0 * light.class_standard_error[DIRECT, 0, 0, 0]
    assert light.flux[DIRECT, 1, 0, 0] == 0.0


@pytest.mark.slow
def test_a_press_at_the_wall_bares_the_emitter_beneath_it():
    scene = scene_of([(3, 16.0, 7.0, 0.5, 0.5)], [(1, 16.0, 4.0, 1.3, 1.3)])
    light = trace_oracle(scene, [[1.0, 16.0]], [dimple(2.0)], rays=20_000)
    assert fate(light, "unsubmerged")[0, 0] == 1.0


@pytest.mark.slow
def test_the_standard_error_is_the_spread_over_seeds():
    scene = scene_of([(3, 16.0, 4.0, 0.5, 0.5)], [(1, 16.0, 4.0, 1.3, 1.3)], absorption_per_mm=0.02)
    lights = [trace_oracle(scene, [[16, 14]], [dimple(2.0)], rays=20_000, seed=seed) for seed in range(60)]
    spread = np.std([light.total[0, 0, 0] for light in lights], ddof=1)
    claimed = np.mean([light.standard_error[0, 0, 0] for light in lights])
    assert spread / claimed == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * 59))


@pytest.mark.slow
def test_steps_are_reported():
    steps = []
    trace_oracle(
        ring_scene(),
        [[16, 16]] * 2,
        [None, None],
        rays=10,
        on_step=lambda done, total: steps.append((done, total)),
    )
    assert steps == [(k + 1, 16) for k in range(16)]


@pytest.mark.slow
def test_a_place_is_not_read_where_the_pad_is_untouched():
    light = trace_oracle(ring_scene(), [[math.nan, math.nan]], [None], rays=1000)
    assert np.isfinite(light.total).all()
