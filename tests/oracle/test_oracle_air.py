from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.oracle.called_oracle_kernels import tip_hit, top_entry, top_exit
from tests.oracle.oracle_scenes import dimple, flat_top, ring_scene, scene_of, wrapped_press
from tests.oracle.paths import sample_paths
from tests.oracle.scene import fresnel_reflectance, refracted_direction
from tests.oracle.top import lower_presses
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES

DIRECT, CROSSING = CLASSES.index("direct"), CLASSES.index("crossing")
CENTRE = np.array([14.0, 17.0])


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


@pytest.mark.parametrize("press", [dimple(1.0, 0.05), dimple(3.0, 0.2), wrapped_press()])
def test_a_surface_is_met_at_the_same_place_from_outside(press):
    surface = flat_top((CENTRE, without_tip(press)))
    rng = np.random.default_rng(1)
    met = 0
    for start in rng.uniform((9.0, 12.0, 4.0), (19.0, 22.0, 7.9), (1500, 3)):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        t, what, *normal = top_exit(surface, *start, *direction, 30.0)
        cosine = float(direction @ normal)
        if what == 0 or t < 1e-3 or cosine < 0.05:
            continue
        beyond = start + (t + 1e-7) * direction
        back, found, *inward = top_entry(surface, *beyond, *(-direction), 30.0)
        assert found == what
        assert back == pytest.approx(1e-7, abs=1e-8 / cosine)
        assert np.array(inward) == pytest.approx(-np.array(normal), abs=1e-6)
        met += 1
    assert met > 300


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


@pytest.mark.slow
def test_light_that_crosses_is_reciprocal():
    emitters = [(0, 5.0, 5.0, 1.0, 1.0), (3, 7.0, 5.5, 1.5, 1.0)]
    receivers = [(2, 6.5, 4.0, 1.3, 1.5), (1, 5.0, 5.5, 1.3, 1.3)]
    black = {"wall_reflectance": 0.0, "bottom_reflectance": 0.0, "length_mm": 12.0, "width_mm": 12.0}
    press, centre = without_tip(dimple(1.0, 0.1)), [[6.0, 5.5]]
    forth = trace_oracle(scene_of(emitters, receivers, **black), centre, [press], rays=600_000, seed=8)
    back = trace_oracle(scene_of(receivers, emitters, **black), centre, [press], rays=600_000, seed=9)
    area = np.array([[4.0 * row[3] * row[4] for row in rows] for rows in (emitters, receivers)])
    forward = forth.flux[CROSSING, 0] * area[0][:, None]
    backward = (back.flux[CROSSING, 0] * area[1][:, None]).T
    error = np.hypot(
        forth.class_standard_error[CROSSING, 0] * area[0][:, None],
        (back.class_standard_error[CROSSING, 0] * area[1][:, None]).T,
    )
    seen = error > 0.0
    assert (forward[seen] / error[seen]).max() > 10.0
    assert np.abs((forward - backward)[seen] / error[seen]).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("press", [dimple(2.0, 0.1), wrapped_press()])
def test_with_white_walls_and_tip_all_light_is_received_or_flies_over_the_walls(press):
    scene = ring_scene(wall_reflectance=1.0, bottom_reflectance=1.0, tip_reflectance=1.0)
    light = trace_oracle(scene, [CENTRE], [press], rays=20_000, seed=3)
    received = light.ledger[: len(CLASSES)].sum(axis=0)
    # light between the tip and the surface close to it starts inside the tip by rounding: a part in 100,000
    assert received + fate(light, "escaped") == pytest.approx(1.0, abs=1e-4)
    assert light.flux[CROSSING].sum() > 0.01
    assert light.without_crossing == pytest.approx(light.total - light.flux[CROSSING], abs=1e-12)


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


@pytest.mark.slow
def test_light_over_an_untouched_pad_never_comes_back():
    light = trace_oracle(ring_scene(), [CENTRE], [None], rays=20_000)
    assert light.flux[CROSSING].max() == 0.0
    assert fate(light, "escaped").min() > 0.05
