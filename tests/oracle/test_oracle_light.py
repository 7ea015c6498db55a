from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numba
import numpy as np
import pytest

from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.oracle.chance import pattern_cosine, pattern_shares
from tests.oracle.oracle_scenes import dimple, flat_field, ring_scene, scene_of, wrapped_press
from tests.oracle.scene import fresnel_reflectance
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES
from tests.sims.optics.form_factors import parallel_factor, perpendicular_factor

DIRECT, TOP, SKIRT, WALL, DIFFUSE, CROSSING = range(6)


def fate(light, name):
    return light.ledger[FATES.index(name)]


def gauss(low, high, points=16):
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
            kernel *= by_angles(step[:, 2] / distance, scene.refractive_index, 1.0)
        total += weight * float(wq @ kernel)
    return total * area * share


@pytest.mark.slow
def test_direct_flux_of_facing_rectangles_is_the_closed_form():
    scene = scene_of([(3, 15.0, 4.0, 1.5, 1.0)], [(1, 17.0, 5.0, 2.0, 2.5)], length_mm=10.0)
    light = trace_oracle(scene, [[5, 5]], [None], rays=1_000_000, seed=2)
    truth = parallel_factor((13.5, 16.5), (3.0, 5.0), (2.5, 7.5), (15.0, 19.0), 10.0)
    assert truth == pytest.approx(pair_flux(scene, 0, 0, mirrored=False), rel=1e-9)
    assert abs(light.flux[DIRECT, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[DIRECT, 0, 0, 0]


@pytest.mark.slow
def test_direct_flux_around_a_corner_is_the_closed_form():
    scene = scene_of([(0, 4.0, 4.0, 1.5, 1.0)], [(3, 5.0, 5.0, 2.0, 2.5)])
    light = trace_oracle(scene, [[5, 5]], [None], rays=1_000_000, seed=3)
    truth = perpendicular_factor((2.5, 5.5), (3.0, 5.0), (2.5, 7.5), (3.0, 7.0))
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
def test_the_standard_error_is_the_spread_over_seeds():
    scene = scene_of([(3, 16.0, 4.0, 0.5, 0.5)], [(1, 16.0, 4.0, 1.3, 1.3)], absorption_per_mm=0.02)
    lights = [trace_oracle(scene, [[16, 14]], [dimple(2.0)], rays=20_000, seed=seed) for seed in range(60)]
    spread = np.std([light.total[0, 0, 0] for light in lights], ddof=1)
    claimed = np.mean([light.standard_error[0, 0, 0] for light in lights])
    assert spread / claimed == pytest.approx(1.0, abs=4.0 / math.sqrt(2 * 59))


DIRECT, TOP, SKIRT, WALL, DIFFUSE, CROSSING = range(6)
CENTRE = np.array([14.0, 17.0])
COSINES = np.linspace(0.0, 1.0, 11)


def pattern_of(values):
    """A radiance table of unit power from relative values at the nodes."""
    table = np.asarray(values, dtype=np.float64)[None]
    return table[0] / pattern_shares(table)[0, -1]


PATTERNS = {
    "lambertian": pattern_of(np.ones(11)),
    "forward": pattern_of(COSINES**3),
    "batwing": pattern_of(0.3 + np.sin(math.pi * COSINES) ** 2),
    "with dark nodes": pattern_of([0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 0]),
    "two nodes": pattern_of([2.0, 1.0]),
}


def facing_flux(scene, *, shift_mm=0.0, emitted=None, counted=None, mirror=None):
    """Flux from a patch on the west to one on the east wall by quadrature; the receiver is shifted along y.

    emitted : radiance table; counted : response table; mirror : reflectance of the cosine to the south wall.
    """
    (a, h, da, dh), (b, g, db, dg) = scene.emitter_patch[0], scene.receiver_patch[0]
    axes = [gauss(m - d, m + d) for m, d in ((a, da), (h, dh), (b + shift_mm, db), (g, dg))]
    y0, z0, y1, z1 = np.meshgrid(*(x for x, _ in axes), indexing="ij")
    weight = math.prod(np.meshgrid(*(w for _, w in axes), indexing="ij"))
    step = np.stack([np.full_like(y0, scene.length_mm), y1 - y0, z1 - z0])
    distance = np.sqrt((step**2).sum(axis=0))
    cosine = scene.length_mm / distance
    radiance = (
        1.0 / math.pi if emitted is None else np.interp(cosine, np.linspace(0, 1, emitted.size), emitted)
    )
    kernel = radiance * cosine**2 / distance**2
    if counted is not None:
        kernel = kernel * np.interp(cosine, np.linspace(0, 1, counted.size), counted)
    if mirror is not None:
        kernel = kernel * mirror(np.abs(step[1]) / distance)
    return float((weight * kernel).sum() * 4.0 * db * dg)


def by_angles(cosine, inside, outside):
    """Unpolarised reflectance from the angles of Snell's law (not from cosines, as the oracle has it)."""
    angle = np.arccos(cosine)
    sine = inside / outside * np.sin(angle)
    out = np.arcsin(np.minimum(sine, 1.0))
    crossed = (np.sin(angle - out) / np.sin(angle + out)) ** 2
    within = (np.tan(angle - out) / np.tan(angle + out)) ** 2
    return np.where(sine >= 1.0, 1.0, 0.5 * (crossed + within))


@pytest.mark.parametrize("name", PATTERNS)
def test_cosines_are_drawn_exactly_from_the_table(name):
    table = PATTERNS[name]
    shares = pattern_shares(table[None])[0]
    assert shares[-1] == pytest.approx(1.0, abs=1e-12)
    for u in np.concatenate([np.linspace(0.0, 1.0, 101)[:-1], [1e-12, 1.0 - 1e-12]]):
        cosine = pattern_cosine(table, shares, u)
        assert 0.0 <= cosine <= 1.0
        nodes = np.unique(np.append(np.linspace(0, 1, table.size), cosine))
        x, w = np.polynomial.legendre.leggauss(3)  # exact for the cubic between nodes
        power = 0.0
        for low, high in pairwise(nodes):
            if high <= cosine:
                c = low + (high - low) * 0.5 * (x + 1.0)
                radiance = np.interp(c, np.linspace(0, 1, table.size), table)
                power += 2.0 * math.pi * (high - low) * 0.5 * float(w @ (c * radiance))
        assert power == pytest.approx(u, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lambertian", "forward", "batwing"])
def test_direct_light_of_a_table_is_the_quadrature(name):
    table = PATTERNS[name]
    scene = scene_of(
        [(3, 15.0, 4.0, 1.5, 1.0)], [(1, 17.0, 5.0, 2.0, 2.5)], length_mm=10.0, emitter_pattern=table[None]
    )
    light = trace_oracle(scene, [[5, 5]], [None], rays=1_000_000, seed=2)
    truth = facing_flux(scene, emitted=table)
    if name == "lambertian":
        closed = parallel_factor((13.5, 16.5), (3.0, 5.0), (2.5, 7.5), (15.0, 19.0), 10.0)
        assert truth == pytest.approx(closed, rel=1e-9)
    assert abs(light.flux[DIRECT, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[DIRECT, 0, 0, 0]


@pytest.mark.slow
def test_a_receiver_counts_the_share_of_its_table():
    response = np.array([0.1, 0.9, 0.4, 1.0])
    scene = scene_of(
        [(3, 15.0, 4.0, 1.5, 1.0)], [(1, 17.0, 5.0, 4.0, 3.0)], length_mm=5.0, wall_reflectance=0.0
    )
    counting = replace(scene, receiver_response=response[None])
    light = trace_oracle(counting, [[2, 5]], [None], rays=1_000_000, seed=3)
    truth = facing_flux(counting, counted=response)
    assert abs(light.flux[DIRECT, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[DIRECT, 0, 0, 0]
    everything = trace_oracle(scene, [[2, 5]], [None], rays=1_000_000, seed=3)
    arrived = light.total[0, 0, 0] + fate(light, "uncounted")[0, 0]
    assert arrived == pytest.approx(everything.total[0, 0, 0], abs=1e-12)


def air_gap_scene(**changes):
    """Two facing patches near the south wall; top, bottom and north wall are far."""
    size = {"length_mm": 16.0, "width_mm": 200.0, "height_mm": 200.0}
    black = {"wall_reflectance": 0.0, "bottom_reflectance": 0.0}
    return scene_of([(3, 3.0, 100.0, 1.5, 1.5)], [(1, 4.0, 100.0, 3.0, 3.0)], **size, **black, **changes)


@pytest.mark.slow
def test_an_air_gap_is_an_exact_mirror_at_grazing_angles():
    scene = air_gap_scene(wall_index=1.0)
    light = trace_oracle(scene, [[8, 50]], [None], rays=2_000_000, seed=4)
    # the flattest chord meets the wall at cos = 11.5 / sqrt(11.5² + 16²), 54.3°; the critical angle is 45.2°
    image = parallel_factor((1.5, 4.5), (98.5, 101.5), (97.0, 103.0), (-7.0, -1.0), 16.0)
    direct = parallel_factor((1.5, 4.5), (98.5, 101.5), (97.0, 103.0), (1.0, 7.0), 16.0)
    assert image == pytest.approx(facing_flux(scene, shift_mm=-8.0), rel=1e-9)
    errors = light.class_standard_error[:, 0, 0, 0]
    assert abs(light.flux[DIRECT, 0, 0, 0] - direct) < 4.0 * errors[DIRECT]
    # two reflections between east and west add (3 %)² of less than the direct light, a tenth of an error
    assert abs(light.flux[WALL, 0, 0, 0] - image) < 4.0 * errors[WALL]
    assert light.flux[[TOP, SKIRT, DIFFUSE, CROSSING]].max() == 0.0


@pytest.mark.slow
def test_a_wall_of_higher_index_mirrors_fresnels_share():
    scene = air_gap_scene(wall_index=1.54)
    light = trace_oracle(scene, [[8, 50]], [None], rays=4_000_000, seed=5)
    truth = facing_flux(scene, shift_mm=-8.0, mirror=lambda cosine: by_angles(cosine, 1.41, 1.54))
    assert 1e-5 < truth < 0.1 * light.flux[DIRECT, 0, 0, 0]
    assert abs(light.flux[WALL, 0, 0, 0] - truth) < 4.0 * light.class_standard_error[WALL, 0, 0, 0]


def test_fresnels_share_is_that_of_the_angles():
    for cosine in np.linspace(0.02, 0.98, 25):
        for outside in (1.0, 1.3, 1.54, 2.0):
            expected = float(by_angles(np.array(cosine), 1.41, outside))
            assert fresnel_reflectance(cosine, 1.41 / outside) == pytest.approx(expected, abs=1e-9)


def all_options(**changes):
    rng = np.random.default_rng(4)
    patterns = np.array([pattern_of(0.2 + rng.random(11)) for _ in range(8)])
    return ring_scene(emitter_pattern=patterns, wall_index=1.0, **changes)


STATES = {
    "untouched": ([CENTRE], [None], None),
    "one tip": ([CENTRE], [dimple(2.0, 0.1)], None),
    "one wrapped tip": ([CENTRE], [wrapped_press()], None),
    "one tip on a field": ([CENTRE], [dimple(2.0, 0.1)], [flat_field(0.05)]),
    "two tips on a slope": (
        [[[9.0, 9.0], [22.0, 20.0]]],
        [[dimple(2.0, 0.1), dimple(1.0)]],
        [smooth_field(lambda x, y: 0.01 * x - 0.008 * y, 32.0, 32.0, 4.0)],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("state", STATES)
def test_energy_is_kept_with_every_option(state):
    centres, presses, fields = STATES[state]
    responses = np.tile(np.linspace(0.3, 1.0, 5), (8, 1))
    absorbing = all_options(absorption_per_mm=0.01, tip_reflectance=0.3, receiver_response=responses)
    light = trace_oracle(absorbing, centres, presses, fields=fields, rays=20_000, seed=6)
    assert np.abs(light.ledger.sum(axis=0) - 1.0).max() < 1e-9
    assert light.ledger[: len(CLASSES)] == pytest.approx(light.flux.sum(axis=3), abs=1e-12)
    assert fate(light, "unresolved").max() == 0.0
    assert fate(light, "uncounted").min() > 0.0
    white = all_options(wall_reflectance=1.0, bottom_reflectance=1.0, tip_reflectance=1.0)
    light = trace_oracle(white, centres, presses, fields=fields, rays=5_000, seed=7)
    received = light.ledger[: len(CLASSES)].sum(axis=0)
    # where a field lifts the top into the tip, by 0.05 to 0.2 mm here, light in air counts as absorbed there
    lifted = 1e-3 if fields is None else 1e-2
    assert received + fate(light, "escaped") == pytest.approx(1.0, abs=lifted)


@pytest.mark.slow
@pytest.mark.parametrize("several", [False, True])
def test_light_is_reciprocal_with_tables_and_smooth_walls(several):
    emitters, receivers = [(0, 5.0, 5.0, 1.5, 1.5)], [(1, 5.0, 5.5, 1.5, 1.3)]
    radiance, response = PATTERNS["batwing"], np.linspace(0.2, 1.0, 11)
    options = {"length_mm": 14.0, "width_mm": 14.0, "wall_index": 1.0, "wall_reflectance": 0.0}
    options["bottom_reflectance"] = 0.0
    forth_scene = scene_of(
        emitters, receivers, emitter_pattern=radiance[None], receiver_response=response[None], **options
    )
    power, peak = float(pattern_shares(response[None])[0, -1]), radiance.max()
    back_scene = scene_of(
        receivers,
        emitters,
        emitter_pattern=response[None] / power,
        receiver_response=radiance[None] / peak,
        **options,
    )
    centres = [[[9.0, 5.0], [4.5, 9.5]]] if several else [[9.0, 5.0]]
    presses = [[dimple(0.7, 0.05), dimple(0.4)]] if several else [dimple(0.7, 0.05)]
    fields = [smooth_field(lambda x, y: 0.01 * (x - y), 14.0, 14.0, 2.0)] if several else None
    forth = trace_oracle(forth_scene, centres, presses, fields=fields, rays=1_000_000, seed=8)
    back = trace_oracle(back_scene, centres, presses, fields=fields, rays=1_000_000, seed=9)
    area = [4.0 * row[3] * row[4] for row in (emitters[0], receivers[0])]
    for name in (DIRECT, TOP, SKIRT, WALL):
        forward = forth.flux[name, 0, 0, 0] * area[0]
        backward = back.flux[name, 0, 0, 0] * area[1] * power * peak
        error = math.hypot(
            forth.class_standard_error[name, 0, 0, 0] * area[0],
            back.class_standard_error[name, 0, 0, 0] * area[1] * power * peak,
        )
        assert forward > 8.0 * error
        assert abs(forward - backward) < 4.0 * error
