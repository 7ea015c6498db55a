from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.oracle.called_oracle_kernels import is_in_elastomer, tip_hit, top_exit
from tests.oracle.chance import draw, lobe_direction, ray_stream
from tests.oracle.form_scenes import crown_press, disc_scene
from tests.oracle.oracle_scenes import dimple, flat_top, ring_scene, scene_of, wrapped_press
from tests.oracle.paths import LightWalker, sample_paths
from tests.oracle.scene import fresnel_reflectance, refracted_direction
from tests.oracle.top import lower_presses
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES


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


CENTRE = np.array([14.0, 17.0])
WHITE = {"wall_reflectance": 1.0, "bottom_reflectance": 1.0, "tip_reflectance": 1.0}


def ends(scene, centre, press, emitter, rays, seed=1):
    """How many of an emitter's rays end with each fate at each receiver (-1: at none)."""
    paths = LightWalker(scene, centre, press, seed).random_paths(emitter, count=rays, most_rays=rays)
    return Counter((path.fate, path.receiver) for path in paths)


@pytest.mark.parametrize(
    ("scene", "press"),
    [
        (ring_scene(**WHITE), None),
        (ring_scene(**WHITE), dimple(2.0, 0.1)),
        (ring_scene(**WHITE), wrapped_press()),
        (disc_scene(crown_radius_mm=30.0, **WHITE), crown_press(2.0, 30.0, 0.1)),
    ],
    ids=["untouched", "pressed", "wrapped", "dome"],
)
def test_with_white_walls_and_tip_every_ray_is_received_or_leaves(scene, press):
    found = ends(scene, [14.0, 11.0], press, 1, 500)
    received = sum(number for (fate, _), number in found.items() if fate in CLASSES)
    escaped = sum(number for (fate, _), number in found.items() if fate == "escaped")
    assert received + escaped == found.total() == 500
    assert min(received, escaped) > 20


@pytest.mark.parametrize("press", [None, dimple(0.7, 0.1)], ids=["untouched", "pressed"])
def test_light_between_windows_of_one_size_is_reciprocal_in_few_rays(press):
    """Either window may shine, the other receives the same; both fill most of their wall, so many rays arrive."""
    box = {
        "wall_reflectance": 0.0,
        "bottom_reflectance": 0.0,
        "length_mm": 8.0,
        "width_mm": 8.0,
        "height_mm": 6.0,
    }
    south, east = [(0, 4.0, 3.0, 2.5, 2.5)], [(1, 4.0, 3.0, 2.5, 2.5)]
    forth = ends(scene_of(south, east, **box), [4.5, 4.0], press, 0, 20_000, seed=8)
    back = ends(scene_of(east, south, **box), [4.5, 4.0], press, 0, 20_000, seed=9)
    for name in ("direct", "top") if press is None else ("direct", "top", "skirt"):
        there, here = forth[name, 0], back[name, 0]
        error = math.sqrt(there + here)
        assert there > 5.0 * error, name
        assert abs(there - here) < 4.0 * error, name


def test_a_deep_press_between_a_facing_pair_ends_its_direct_light_in_few_rays():
    scene = scene_of([(3, 16.0, 4.0, 0.5, 0.5)], [(1, 16.0, 4.0, 1.3, 1.3)])
    assert ends(scene, [16, 16], None, 0, 20_000)["direct", 0] > 30
    pressed = ends(scene, [16, 16], wrapped_press(), 0, 20_000)
    assert pressed["direct", 0] == 0
    assert pressed["tip", -1] > 30


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "press"),
    [
        (ring_scene(tip_reflectance=0.3), dimple(2.0)),
        (disc_scene(crown_radius_mm=30.0), crown_press(2.0, 30.0)),
    ],
    ids=["pad", "dome"],
)
def test_single_paths_are_the_rays_that_the_oracle_counts(scene, press):
    light = trace_oracle(scene, [CENTRE], [press], rays=2_000, seed=1)
    counted = np.zeros_like(light.flux)
    for emitter in range(len(scene.emitter_wall)):
        for (fate, receiver), number in ends(scene, CENTRE, press, emitter, 2_000).items():
            if receiver >= 0:
                counted[CLASSES.index(fate), 0, emitter, receiver] = number
    assert counted == pytest.approx(light.flux * 2_000, abs=1e-6)


PLACE = np.array([15.0, 17.0])


@pytest.mark.parametrize("press", [None, dimple(0.5), dimple(3.0, 0.2), wrapped_press()])
def test_every_leg_of_a_path_is_wholly_in_the_elastomer_or_wholly_in_air(press):
    surface = flat_top() if press is None else flat_top((PLACE, press))
    scene = ring_scene(wall_reflectance=0.5, bottom_reflectance=0.5, tip_reflectance=0.5)
    crossed = 0
    for name, places in sample_paths(scene, PLACE, press, emitter=1, count=800, seed=1):
        in_air = []
        for start, end in pairwise(places):
            points = start + np.linspace(0.01, 0.99, 25)[:, None] * (end - start)
            assert (points[:, :2] > -1e-5).all()
            assert (points[:, :2] < 32.0 + 1e-5).all()
            # neighbouring pieces overlap by 1 nm, rays restart 1 nm beside the surface
            below, above = (
                [is_in_elastomer(surface, x, y, z + lift) for x, y, z in points] for lift in (-2e-6, 2e-6)
            )
            assert all(below) or not any(above)
            in_air.append(not all(below))
        assert not in_air or not in_air[0]
        assert name not in CLASSES or any(in_air) == (name == "crossing")
        assert name != "crossing" or not in_air[-1]
        assert name != "bottom" or not in_air[-1]
        crossed += any(in_air)
    assert (crossed > 3) == (press is not None)


DIRECT, CROSSING = CLASSES.index("direct"), CLASSES.index("crossing")


def without_tip(press):
    """The same surface with nothing in it."""
    return replace(press, contact_radius_mm=0.0)


def fate(light, name):
    return light.ledger[FATES.index(name)]


def test_a_border_treats_light_alike_from_both_sides():
    for angle in np.linspace(0.0, 0.78, 40):
        into = np.array([math.sin(angle), 0.0, math.cos(angle)])
        out = np.array(refracted_direction(*into, 0.0, 0.0, 1.0, 1.41))
        assert out[0] == pytest.approx(1.41 * into[0], abs=1e-14)  # Snell
        assert np.linalg.norm(out) == pytest.approx(1.0, abs=1e-14)
        back = np.array(refracted_direction(*(-out), 0.0, 0.0, -1.0, 1.0 / 1.41))
        assert back == pytest.approx(-into, abs=1e-12)
        assert fresnel_reflectance(out[2], 1.0 / 1.41) == pytest.approx(
            fresnel_reflectance(into[2], 1.41), abs=1e-12
        )


def high_ring(**changes):
    """The ring with its parts so high that they see each other across a crater."""
    scene = ring_scene(**changes)
    lift = np.array([0.0, 2.5, 0.0, 0.0])
    return replace(
        scene, emitter_patch=scene.emitter_patch + lift, receiver_patch=scene.receiver_patch + lift
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("press", "as_sum"),
    [
        (dimple(1.5), False),
        (dimple(1.5), True),
        (dimple(3.0, 0.2), False),
        (dimple(3.0, 0.2), True),
        (wrapped_press(), False),
    ],
)
def test_without_an_index_step_an_empty_crater_takes_nothing_away(press, as_sum):
    """The same rays arrive at the same receivers, straight through the crater: what crosses is what direct lost."""
    scene = high_ring(refractive_index=1.0, wall_reflectance=0.0, bottom_reflectance=0.0)
    fields = [smooth_field(lambda x, y: 0.0 * (x + y), 32.0, 32.0, 4.0)] if as_sum else None
    flat = trace_oracle(scene, [CENTRE], [None], rays=50_000, seed=1)
    pressed = trace_oracle(scene, [CENTRE], [without_tip(press)], fields=fields, rays=50_000, seed=1)
    through = pressed.flux[DIRECT, 0] + pressed.flux[CROSSING, 0]
    assert 50_000 * pressed.flux[CROSSING, 0].sum() > 25.0
    # a ray that starts, ends or grazes within a nanometre of the surface could go either way: none of these does
    assert np.array_equal(np.rint(50_000 * through), np.rint(50_000 * flat.flux[DIRECT, 0]))
    assert fate(pressed, "unresolved").max() == 0.0


def test_a_tip_is_a_half_sphere_under_a_cylinder():
    (top,) = lower_presses(ring_scene(), [CENTRE], [dimple(2.0)])  # its centre is 9 mm high
    for z, half in ((8.0, math.sqrt(8.0)), (9.5, 3.0), (30.0, 3.0)):
        t, is_hit, *normal = tip_hit(top, 4.0, 17.0, z, 1.0, 0.0, 0.0, 50.0)
        assert is_hit
        assert t == pytest.approx(10.0 - half, abs=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        assert normal[0] == pytest.approx(-half / 3.0, abs=1e-12)
    assert not tip_hit(top, 4.0, 20.01, 9.5, 1.0, 0.0, 0.0, 50.0)[1]
    assert not tip_hit(top, 4.0, 17.0, 5.9, 1.0, 0.0, 0.0, 50.0)[1]
    below = tip_hit(top, 16.9, 17.0, 6.4, 0.0, 0.0, 1.0, 50.0)  # the flank, from the gap beside it
    assert below[1]
    assert 6.4 + below[0] == pytest.approx(9.0 - math.sqrt(9.0 - 2.9**2), abs=1e-12)
    inside = tip_hit(top, 14.0, 17.0, 9.0, 1.0, 0.0, 0.0, 50.0)
    assert inside == (0.0, True, 0.0, 0.0, 0.0)


def test_a_path_across_the_crater_refracts_where_it_leaves_and_enters():
    press = without_tip(dimple(3.0, 0.2))
    paths = sample_paths(ring_scene(), CENTRE, press, emitter=1, count=20_000, seed=2)
    crossing = [places for name, places in paths if name == "crossing" and len(places) == 4]
    assert len(crossing) >= 5
    surface = flat_top((CENTRE, press))
    for start, leaves, enters, end in crossing:
        legs = [b - a for a, b in ((start, leaves), (leaves, enters), (enters, end))]
        inside, air, again = (leg / np.linalg.norm(leg) for leg in legs)
        for before, after, origin, hit in (
            (inside, air, start, top_exit),
            (-again, -air, end, top_exit),
        ):
            _, _, *normal = hit(surface, *(origin + 1e-5 * before), *before, 60.0)
            # along the surface 1.41 times the elastomer's direction is the air's; places are 1 nm off by the nudge
            tangential = 1.41 * np.cross(normal, before) - np.cross(normal, after)
            assert np.abs(tangential).max() < 1e-4
