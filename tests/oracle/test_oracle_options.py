from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.sims.optics.scene.optical_scene import SmoothField, smooth_field
from tests.oracle.chance import pattern_cosine, pattern_shares, table_value
from tests.oracle.oracle_scenes import dimple, flat_field, ring_scene, scene_of, wrapped_press
from tests.oracle.paths import LightWalker
from tests.oracle.scene import fresnel_reflectance
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES
from tests.sims.optics.form_factors import parallel_factor

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


def fate(light, name):
    return light.ledger[FATES.index(name)]


def gauss(low, high, points=16):
    x, w = np.polynomial.legendre.leggauss(points)
    return low + (high - low) * 0.5 * (x + 1.0), 0.5 * w


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


def test_a_lambertian_table_draws_the_square_root():
    table = PATTERNS["lambertian"]
    shares = pattern_shares(table[None])[0]
    for u in np.linspace(0.0, 0.999, 50):
        assert pattern_cosine(table, shares, u) == pytest.approx(math.sqrt(u), abs=1e-12)


def test_a_table_is_read_linearly():
    table = np.array([0.0, 2.0, 1.0])
    found = [table_value(table, c) for c in (0.0, 0.25, 0.5, 0.75, 1.0, 1.0 + 1e-12)]
    assert found == pytest.approx([0.0, 1.0, 2.0, 1.5, 1.0, 1.0], abs=1e-9)


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
def test_a_row_of_nan_is_an_emitter_by_its_order():
    orders = np.linspace(0.5, 3.0, 8)
    rows = np.tile(PATTERNS["forward"], (8, 1))
    rows[2:] = np.nan
    plain = trace_oracle(ring_scene(emitter_order=orders), [CENTRE], [dimple(1.0)], rays=2000)
    mixed = trace_oracle(
        ring_scene(emitter_order=orders, emitter_pattern=rows), [CENTRE], [dimple(1.0)], rays=2000
    )
    assert np.array_equal(mixed.flux[:, :, 2:], plain.flux[:, :, 2:])
    assert not np.array_equal(mixed.flux[:, :, :2], plain.flux[:, :, :2])


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


def test_fresnels_share_into_a_denser_medium_is_that_of_the_angles():
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


@pytest.mark.slow
def test_a_constant_field_is_a_thicker_pad_ray_by_ray():
    scene = ring_scene(wall_reflectance=0.3, absorption_per_mm=0.01)
    lifted = trace_oracle(scene, [CENTRE], [None], fields=[flat_field(0.4)], rays=5_000, seed=10)
    thicker = trace_oracle(replace(scene, height_mm=8.4), [CENTRE], [None], rays=5_000, seed=10)
    assert np.abs(lifted.flux - thicker.flux).max() < 1e-12
    assert np.abs(lifted.ledger - thicker.ledger).max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("press", [dimple(0.5), dimple(3.0, 0.2)])
def test_one_tip_as_a_sum_gives_the_light_of_the_surface_of_revolution(press):
    scene = ring_scene(wall_reflectance=0.3, tip_reflectance=0.3)
    rays = 50_000
    alone = trace_oracle(scene, [CENTRE], [press], rays=rays, seed=11)
    summed = trace_oracle(scene, [CENTRE], [press], fields=[flat_field(0.0)], rays=rays, seed=11)
    moved = np.abs(alone.flux - summed.flux).sum() * rays
    # the same rays meet surfaces up to 2 µm apart: few change their receiver, mostly after several reflections
    assert moved < 0.005 * alone.total.sum() * rays


@pytest.mark.slow
def test_two_tips_far_apart_change_what_each_changes_alone():
    rows = [(0, 8.0, 4.0, 0.5, 0.5), (0, 52.0, 4.0, 0.5, 0.5)]
    faces = [(2, 8.0, 4.0, 1.3, 1.3), (2, 52.0, 4.0, 1.3, 1.3)]
    scene = scene_of(rows, faces, length_mm=60.0, wall_reflectance=0.0, bottom_reflectance=0.0)
    places, presses = [[8.0, 16.0], [52.0, 17.0]], [dimple(3.0, 0.1), dimple(2.0, 0.05)]
    state = trace_oracle(scene, [places], [presses], rays=200_000, seed=12)
    for near in range(2):
        one = [press if k == near else None for k, press in enumerate(presses)]
        nothing = [smooth_field(lambda x, y: 0.0 * (x + y), 60.0, 32.0, 4.0)]
        alone = trace_oracle(scene, [places], [one], fields=nothing, rays=200_000, seed=12)
        flat = trace_oracle(scene, [places], [[None, None]], rays=200_000, seed=12)
        assert np.array_equal(state.flux[:, 0, near, near], alone.flux[:, 0, near, near])
        assert alone.total[0, near, near] < 0.9 * flat.total[0, near, near]
        other = 1 - near
        assert np.array_equal(alone.flux[:, 0, other, other], flat.flux[:, 0, other, other])


def test_a_fold_is_refused_only_where_heights_add_up():
    nothing = SmoothField(origin_mm=np.zeros(2), step_mm=np.full(2, 8.0), nodes=np.zeros((5, 5, 4)))
    assert LightWalker(ring_scene(), CENTRE, wrapped_press(), 0).random_paths(0, count=1, most_rays=10)
    with pytest.raises(ModelScopeError, match=r"indentations\[0\]"):
        trace_oracle(ring_scene(), [CENTRE], [wrapped_press()], fields=[nothing], rays=10)
