"""Faces on the floor and skins on the top: the ray tracer against closed forms and quadrature."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.oracle.floor_scenes import (
    CLEAR_MM,
    EMITTERS,
    LENGTH_MM,
    RECEIVERS,
    TILTED_EMITTERS,
    TILTED_RECEIVERS,
    WIDTH_MM,
    crowned_floor_scene,
    floor_scene,
)
from tests.oracle.oracle_scenes import dimple
from tests.oracle.paths import LightWalker
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.oracle.walk import FATES
from tests.sims.optics.form_factors import parallel_factor, perpendicular_factor

DIRECT, TOP, SKIRT, WALL, DIFFUSE, CROSSING = range(6)
DARK = {"wall_reflectance": 0.0, "bottom_reflectance": 0.0}
GREY = {"wall_reflectance": 0.3, "bottom_reflectance": 0.3, "tip_reflectance": 0.3, "absorption_per_mm": 0.01}
AT = [[10.0, 8.0]]
RAYS = 400_000


def fate(light, name):
    return light.ledger[FATES.index(name)]


def sampled(face, points):
    """Points (n, 3) of a face, their weights, its normal and its area; axes by rotations of an upward face."""
    x, y, z, tilt, turn, half_u, half_v = face
    turned = Rotation.from_euler("yz", [tilt, turn], degrees=True)
    nodes, weights = np.polynomial.legendre.leggauss(points)
    u, v = (grid.ravel() for grid in np.meshgrid(half_u * nodes, half_v * nodes, indexing="ij"))
    place = np.array([x, y, z]) + turned.apply(np.stack([-v, u, np.zeros_like(u)], axis=-1))
    return (
        place,
        np.outer(weights, weights).ravel() / 4.0,
        turned.apply([0.0, 0.0, 1.0]),
        4.0 * half_u * half_v,
    )


def form_factor(emitter, receiver, share=None, points=12):
    """Share of a Lambertian emitter's light that reaches a receiver: straight, or by the image in the flat top.

    share : share that the top mirrors, over the cosine of the angle of incidence; None for straight light
    """
    place, weights, normal, _ = sampled(emitter, points)
    other, others, looks, area = sampled(receiver, points)
    if share is not None:
        other, looks = other * [1, 1, -1] + [0, 0, 2.0 * CLEAR_MM], looks * [1, 1, -1]
    way = other[None] - place[:, None]
    length = np.linalg.norm(way, axis=-1)
    way /= length[..., None]
    kernel = np.maximum(way @ normal, 0.0) * np.maximum(-way @ looks, 0.0) / (math.pi * length**2)
    if share is not None:
        kernel *= share(way[..., 2])
    return area * float(weights @ kernel @ others)


def scattered_once(emitter, receiver, points=6, lid_points=60):
    """Share of a Lambertian emitter's light that a white Lambertian top scatters to a receiver at once."""
    lid = (LENGTH_MM / 2.0, WIDTH_MM / 2.0, CLEAR_MM, 180.0, 0.0, WIDTH_MM / 2.0, LENGTH_MM / 2.0)
    middle, middles, down, lid_area = sampled(lid, lid_points)
    assert down == pytest.approx([0.0, 0.0, -1.0])
    parts = []
    for face in (emitter, receiver):
        place, weights, normal, area = sampled(face, points)
        way = middle[None] - place[:, None]
        length = np.linalg.norm(way, axis=-1)
        way /= length[..., None]
        kernel = np.maximum(way @ normal, 0.0) * np.maximum(-way @ down, 0.0) / (math.pi * length**2)
        parts.append((weights @ kernel, area))
    (sent, _), (caught, area) = parts
    return lid_area * area * float(middles @ (sent * caught))


def fresnel(cosine, index=1.41):
    """Share that a flat border to air mirrors, from the amplitudes in Snell's angles."""
    angle = np.arccos(cosine)
    sine = index * np.sin(angle)
    out = np.arcsin(np.minimum(sine, 1.0))
    s = np.sin(angle - out) / np.sin(angle + out)
    p = np.tan(angle - out) / np.tan(angle + out)
    return np.where(sine >= 1.0, 1.0, (s * s + p * p) / 2.0)


def traced(scene, *, seed, rays=RAYS, presses=(None,)):
    return trace_oracle(scene, AT * len(presses), list(presses), rays=rays, seed=seed)


def assert_is(light, name, truth, pair=(0, 0)):
    """One class of one pair's light is as it should be, within 4 standard errors, which are below 3 %."""
    error = light.class_standard_error[(name, 0, *pair)]
    assert error < 0.03 * truth
    assert abs(light.flux[(name, 0, *pair)] - truth) < 4.0 * error


def assert_only(light, name):
    """Between dark walls only one way leads from floor to floor."""
    assert np.delete(light.flux, name, axis=0).max() == 0.0


@pytest.mark.slow
def test_a_specular_skin_shows_the_receiver_s_image_twice_as_high():
    light = traced(floor_scene("specular", 0.8, **DARK), seed=1, rays=1_000_000)
    truth = 0.8 * parallel_factor((5.6, 6.4), (4.5, 5.5), (3.9, 6.1), (13.1, 14.9), 2.0 * CLEAR_MM)
    quadrature = form_factor(EMITTERS[0], RECEIVERS[0], share=lambda cosine: 0.8 + 0.0 * cosine)
    assert truth == pytest.approx(quadrature, rel=1e-9)
    assert_is(light, TOP, truth)
    assert_only(light, TOP)


@pytest.mark.slow
def test_small_faces_under_a_mirror_follow_the_inverse_square():
    """The flux of two small faces s apart, floor to floor over the image: rho (2 h)² A / (pi d⁴), d² = s² + (2 h)²."""
    faces = [(8.0, 8.0, 0.0, 0.0, 0.0, 0.1, 0.1)], [(12.0, 8.0, 0.0, 0.0, 0.0, 0.2, 0.2)]
    light = traced(
        floor_scene("specular", 0.8, emitters=faces[0], receivers=faces[1], **DARK), seed=2, rays=4_000_000
    )
    assert_is(light, TOP, 0.8 * 64.0 * 0.16 / (math.pi * (16.0 + 64.0) ** 2))


@pytest.mark.slow
def test_a_diffuse_skin_scatters_what_quadrature_over_the_top_gives():
    light = traced(floor_scene("diffuse", 0.6, **DARK), seed=3, rays=1_000_000)
    truth = 0.6 * scattered_once(EMITTERS[0], RECEIVERS[0])
    assert truth == pytest.approx(0.6 * scattered_once(EMITTERS[0], RECEIVERS[0], 4, 40), rel=1e-4)
    assert_is(light, DIFFUSE, truth)
    assert_only(light, DIFFUSE)


@pytest.mark.slow
def test_a_bare_top_mirrors_fresnel_s_share_at_the_image_s_angle():
    light = traced(floor_scene(**DARK), seed=4, rays=1_000_000)
    truth = form_factor(EMITTERS[0], RECEIVERS[0], share=fresnel, points=40)
    assert truth == pytest.approx(form_factor(EMITTERS[0], RECEIVERS[0], share=fresnel, points=20), rel=2e-3)
    assert_is(light, TOP, truth)
    assert_only(light, TOP)


@pytest.mark.slow
def test_light_from_one_tilted_face_to_another_is_their_form_factor():
    scene = floor_scene("specular", 0.5, emitters=TILTED_EMITTERS, receivers=TILTED_RECEIVERS, **DARK)
    light = traced(scene, seed=5, rays=1_000_000)
    for pair in ((0, 0), (1, 1)):
        faces = TILTED_EMITTERS[pair[0]], TILTED_RECEIVERS[pair[1]]
        assert_is(light, DIRECT, form_factor(*faces), pair)
        assert_is(light, TOP, form_factor(*faces, share=lambda cosine: 0.5 + 0.0 * cosine), pair)
    level = parallel_factor((9.5, 10.5), (0.6, 1.4), (0.3, 2.1), (8.9, 11.1), 10.0)
    assert level == pytest.approx(form_factor(TILTED_EMITTERS[1], TILTED_RECEIVERS[1]), rel=1e-9)


@pytest.mark.slow
def test_a_level_face_lights_the_floor_by_the_form_factor_around_a_corner():
    emitter, receiver = (3.0, 8.0, 1.0, 90.0, 0.0, 0.7, 0.4), (6.0, 9.0, 0.0, 0.0, 0.0, 1.1, 0.9)
    light = traced(floor_scene(emitters=[emitter], receivers=[receiver], **DARK), seed=6)
    truth = perpendicular_factor((0.6, 1.4), (7.3, 8.7), (7.9, 10.1), (2.1, 3.9))
    assert truth == pytest.approx(form_factor(emitter, receiver), rel=1e-6)
    assert_is(light, DIRECT, truth)


@pytest.mark.slow
def test_the_axes_of_a_turned_face_are_where_the_pose_says():
    """Long, narrow faces that are tilted and turned: exchanged axes or another sign would show."""
    emitter, receiver = (6.0, 6.0, 0.8, 70.0, 20.0, 1.5, 0.1), (9.5, 8.0, 1.2, 20.0, 215.0, 0.2, 2.0)
    light = traced(floor_scene(emitters=[emitter], receivers=[receiver], **DARK), seed=7, rays=1_000_000)
    truth = form_factor(emitter, receiver)
    assert_is(light, DIRECT, truth)
    error = light.standard_error[0, 0, 0]
    for wrong in ((*emitter[:5], 0.1, 1.5), (*emitter[:4], -20.0, *emitter[5:])):
        assert abs(form_factor(wrong, receiver) - truth) > 8.0 * error
    for wrong in ((*receiver[:5], 2.0, 0.2), (*receiver[:4], 145.0, *receiver[5:])):
        assert abs(form_factor(emitter, wrong) - truth) > 8.0 * error


def test_light_passes_the_back_of_a_face():
    """A receiver above an emitter, looking up, does not hide it; looking down, it takes all light that meets it."""
    emitters, seen = [(10.0, 8.0, 0.0, 0.0, 0.0, 0.2, 0.2)], (10.0, 8.0, 3.0, 180.0, 0.0, 1.0, 1.0)
    up, down = (10.0, 8.0, 1.0, 0.0, 0.0, 1.5, 1.5), (10.0, 8.0, 1.0, 180.0, 0.0, 1.5, 1.5)
    open_, backed, hidden = (
        traced(
            floor_scene("specular", 0.0, emitters=emitters, receivers=[seen, *more], **DARK),
            seed=8,
            rays=20_000,
        )
        for more in ([], [up], [down])
    )
    assert open_.flux[DIRECT, 0, 0, 0] == backed.flux[DIRECT, 0, 0, 0] > 0.05
    assert backed.flux[:, 0, 0, 1].sum() == 0.0
    assert hidden.flux[:, 0, 0, 0].sum() == 0.0
    assert hidden.flux[DIRECT, 0, 0, 1] > 0.5


@pytest.mark.slow
def test_an_emitter_s_face_scatters_like_the_bottom():
    """Under a mirror, a large emitter's face next to a small one scatters a share of its light back to the mirror."""
    emitters = [(7.0, 8.0, 0.0, 0.0, 0.0, 0.2, 0.2), (10.5, 8.0, 0.0, 0.0, 0.0, 2.5, 2.5)]
    scenes = [
        floor_scene("specular", 1.0, emitters=rows, wall_reflectance=0.0, bottom_reflectance=0.5)
        for rows in (emitters, emitters[:1])
    ]
    flush, floor = (traced(scene, seed=9, rays=50_000) for scene in scenes)
    assert flush.flux[:, 0, 0] == pytest.approx(floor.flux[:, 0, 0], abs=1e-12)
    assert fate(flush, "bottom")[0, 0] == pytest.approx(fate(floor, "bottom")[0, 0], abs=1e-12)


GREY_SCENES = {
    "bare": lambda: floor_scene(**GREY),
    "specular": lambda: floor_scene("specular", 0.8, **GREY),
    "diffuse": lambda: floor_scene("diffuse", 0.6, **GREY),
    "crowned": lambda: crowned_floor_scene("diffuse", 0.6, **GREY),
    "tilted": lambda: floor_scene(
        "specular", 0.8, emitters=TILTED_EMITTERS, receivers=TILTED_RECEIVERS, **GREY
    ),
    "black": lambda: floor_scene("diffuse", 1.0, **DARK),
}


@cache
def grey_light(name):
    return traced(GREY_SCENES[name](), seed=10, rays=20_000, presses=(None, dimple(1.5)))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in GREY_SCENES if name != "crowned"])
def test_all_light_is_accounted_for(name):
    light = grey_light(name)
    assert np.abs(light.ledger.sum(axis=0) - 1.0).max() < 1e-9
    assert light.ledger[: len(CLASSES)] == pytest.approx(light.flux.sum(axis=3), abs=1e-12)
    assert fate(light, "unresolved").max() == 0.0
    assert (fate(light, "escaped").min() > 0.0) == (fate(light, "tip")[1].min() > 0.0) == (name == "bare")
    assert (fate(light, "skin").min() > 0.0) == (name not in ("bare", "black"))
    if name == "black":  # a white top sends all light to the dark walls, the floor and the receivers
        assert fate(light, "skin").max() == 0.0
        assert fate(light, "walls") + fate(light, "bottom") + fate(light, "diffuse") == pytest.approx(1.0)


@pytest.mark.parametrize(("finish", "share"), [("specular", 0.8), ("diffuse", 0.6)])
def test_what_touches_a_skin_has_no_effect_of_its_own(finish, share):
    black, white = (
        traced(floor_scene(finish, share, tip_reflectance=tip), seed=11, rays=5_000, presses=(dimple(1.5),))
        for tip in (0.0, 0.9)
    )
    assert np.array_equal(black.ledger, white.ledger)
    assert fate(black, "tip").max() == 0.0


def bounces(scene, press, limit):
    """Directions into and out of the top, in contact with a ball, and normals into the ball, from single rays."""
    tip = np.array([*AT[0], CLEAR_MM - press.depth_mm + press.tip_radius_mm])
    into, out, normals = [], [], []
    for path in LightWalker(scene, AT[0], press, 12).random_paths(0, count=limit, most_rays=limit):
        legs = np.diff(path.places_mm, axis=0)
        long = np.linalg.norm(legs, axis=1)
        legs /= long[:, None]
        off = path.places_mm - tip
        on_ball = np.abs(np.linalg.norm(off, axis=1) - press.tip_radius_mm) < 1e-9
        for k in range(1, len(legs)):
            if on_ball[k] and min(long[k - 1], long[k]) > 0.1:
                into.append(legs[k - 1])
                out.append(legs[k])
                normals.append(-off[k] / press.tip_radius_mm)
    return np.array(into), np.array(out), np.array(normals)


def test_a_skin_under_a_ball_mirrors_about_the_ball_s_normal():
    emitters = [(10.0, 8.0, 0.0, 0.0, 0.0, 1.0, 1.0)]
    into, out, normal = bounces(floor_scene("specular", 1.0, emitters=emitters), dimple(1.5), 500)
    along = np.sum(into * normal, axis=1)
    assert len(into) > 100
    assert (along > 0.0).all()
    assert (
        np.abs(out - into + 2.0 * along[:, None] * normal).max() < 1e-4
    )  # a place is 1 nm off the leg's end


def test_a_diffuse_skin_under_a_ball_scatters_about_the_ball_s_normal():
    emitters = [(10.0, 8.0, 0.0, 0.0, 0.0, 1.0, 1.0)]
    _, out, normal = bounces(floor_scene("diffuse", 1.0, emitters=emitters), dimple(1.5), 4_000)
    back = -np.sum(out * normal, axis=1)
    assert len(back) > 1_000
    assert (back > -1e-4).all()
    assert back.mean() == pytest.approx(2.0 / 3.0, abs=4.0 * math.sqrt(1.0 / 18.0 / len(back)))


@pytest.mark.slow
def test_light_under_a_crown_is_brighter_where_the_crown_focuses_it():
    """A cylinder focuses across its straight direction; all light is accounted for, and a huge radius is flat."""
    light = grey_light("crowned")
    assert np.abs(light.ledger.sum(axis=0) - 1.0).max() < 1e-9
    flat = floor_scene("specular", 0.8, **DARK)
    bent = crowned_floor_scene("specular", 0.8, **DARK)
    nearly = replace(bent, form=replace(bent.form, top=replace(bent.form.top, ky=1e-7)))
    one, other = (traced(scene, seed=13, rays=50_000) for scene in (flat, nearly))
    assert one.flux == pytest.approx(other.flux, abs=3.0 / 50_000)
    curved = traced(bent, seed=13, rays=50_000)
    assert abs(curved.flux.sum() - one.flux.sum()) > 5.0 * curved.standard_error.max()
