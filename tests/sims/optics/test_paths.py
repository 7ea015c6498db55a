"""Drawn light paths: ray by ray those of the oracle, whose streams of random numbers they share; requests, numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from optopad.sims.optics.paths import FATES, LOST, LightWalker
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import Indentation
from tests.oracle.form_scenes import crown_press, disc_scene, vault_scene
from tests.oracle.oracle_scenes import dimple, ring_scene, scene_of, shank_press
from tests.oracle.paths import LightWalker as OracleWalker

CENTRE = np.array([15.0, 17.0])
RAYS = 4000
CLASSES = FATES[:6]


def tables(scene: OpticalScene) -> OpticalScene:
    """Emitters that radiate by a table, of power 1, and receivers that count less at grazing angles."""
    cosine = np.linspace(0.0, 1.0, 9)
    radiance = 1.0 + 3.0 * cosine**2  # linear between the nodes
    low, step = radiance[:-1], np.diff(radiance)
    power = 2.0 * np.pi / 8 * (cosine[:-1] * (low + step / 2) + (low / 2 + step / 3) / 8).sum()
    return replace(
        scene,
        emitter_pattern=np.tile(radiance / power, (8, 1)),
        receiver_response=np.tile(np.sqrt(cosine), (8, 1)),
    )


def near_the_top() -> OpticalScene:
    """An emitter just below the top of a pad that bends light little, between walls that receive."""
    parts = [(0, 12.0, 7.0, 0.5, 0.5), (0, 16.0, 7.4, 0.5, 0.5)]
    return scene_of(parts, [(wall, 16.0, 4.0, 16.0, 4.0) for wall in (1, 2, 3)], refractive_index=1.05)


def flat_tip() -> Indentation:
    """The dimple taken for a tip that is no hemisphere."""
    return replace(dimple(1.5), is_hemisphere=False)


CASES: dict[str, tuple[OpticalScene, tuple[float, float], Indentation | None]] = {
    "untouched": (ring_scene(), (15.0, 17.0), None),
    "shallow": (ring_scene(), (15.0, 17.0), dimple(0.5)),
    "a raised rim": (ring_scene(), (15.0, 17.0), dimple(3.0, 0.2)),
    "a wetted shank": (ring_scene(), (15.0, 17.0), shank_press()),
    "no hemisphere": (ring_scene(), (15.0, 17.0), flat_tip()),
    "smooth walls": (ring_scene(wall_index=1.0), (15.0, 17.0), dimple(2.0)),
    "tables": (tables(ring_scene()), (15.0, 17.0), dimple(1.0)),
    "a disc": (disc_scene(), (11.0, 12.5), dimple(1.0)),
    "a dome": (disc_scene(crown_radius_mm=40.0), (11.0, 12.5), crown_press(1.0, 40.0)),
    "a vault along x": (vault_scene("x"), (11.0, 9.0), crown_press(1.0, 60.0)),
    "a vault along y": (vault_scene("y"), (13.0, 9.0), crown_press(1.0, 60.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_every_ray_is_the_oracle_s(name: str) -> None:
    given, centre, press = CASES[name]
    # neither scatters: only there the two measure the angle about a normal from different directions
    scene = replace(given, wall_reflectance=0.5, bottom_reflectance=0.0, tip_reflectance=0.0)
    ours, theirs = (
        {path.ray: path for path in walker(scene, centre, press, 3).follow(1, range(RAYS))}
        for walker in (LightWalker, OracleWalker)
    )
    assert len(ours) >= 0.999 * RAYS
    alike, apart = 0, []
    for number in ours.keys() & theirs.keys():
        one, other = ours[number], theirs[number]
        same_class = one.fate == other.fate or {one.fate, other.fate} == {"top", "skirt"}  # another border
        if same_class and one.receiver == other.receiver and len(one.places_mm) == len(other.places_mm):
            alike += 1
            apart.append(np.abs(one.places_mm - other.places_mm).max())
    assert alike >= 0.995 * RAYS
    assert np.median(apart) < 1e-12
    assert np.quantile(apart, 0.98) < 0.005


def test_what_tip_and_bottom_scatter_ends_as_often_as_the_oracle_says() -> None:
    scene = ring_scene(
        wall_reflectance=0.5, bottom_reflectance=0.6, tip_reflectance=0.7, refractive_index=1.1
    )
    ours, theirs = (
        Counter(path.fate for path in walker(scene, CENTRE, dimple(3.0, 0.2), 3).follow(1, range(20_000)))
        for walker in (LightWalker, OracleWalker)
    )
    for fate in {*ours, *theirs} - {"top", "skirt"}:
        assert abs(ours[fate] - theirs[fate]) < 4.5 * np.sqrt(ours[fate] + theirs[fate]), fate
    assert ours["crossing"] > 20


def test_light_across_the_crater_takes_the_oracle_s_ways_through_air() -> None:
    scene, centre, press = near_the_top(), (20.0, 6.0), dimple(3.0, 0.2)
    ours, theirs = (
        {
            path.ray: path.places_mm
            for path in walker(scene, centre, press, 3).random_paths(
                1, [0, 1, 2], count=10**6, most_rays=100_000
            )
            if path.fate == "crossing"
        }
        for walker in (LightWalker, OracleWalker)
    )
    assert len(ours.keys() | theirs.keys()) > 100
    both = [number for number in ours.keys() & theirs.keys() if len(ours[number]) == len(theirs[number])]
    assert len(both) > 0.95 * len(ours.keys() | theirs.keys())
    apart = [np.abs(ours[number] - theirs[number]).max() for number in both]
    assert np.median(apart) < 0.001
    assert np.quantile(apart, 0.9) < 0.01


def test_paths_to_a_receiver_start_on_the_emitter_and_end_on_it() -> None:
    scene = ring_scene()
    paths = LightWalker(scene, CENTRE, dimple(1.0), 2).random_paths(0, [4], count=30, most_rays=10**6)
    assert len(paths) == 30
    assert {path.fate for path in paths} <= set(CLASSES)
    for path in paths:
        places = path.places_mm
        assert places[0, 1] == 0.0
        assert np.abs(places[0, [0, 2]] - scene.emitter_patch[0, :2]).max() <= 0.5
        assert places[-1, 1] == pytest.approx(32.0, abs=1e-9)
        assert np.abs(places[-1, [0, 2]] - scene.receiver_patch[4, :2]).max() <= 1.325 + 1e-9
        assert path.fate != "direct" or len(places) == 2


def test_a_ray_followed_under_a_press_leaves_its_emitter_the_same_way() -> None:
    scene = ring_scene()
    walker = LightWalker(scene, CENTRE, None, 5)
    found = walker.random_paths(0, [4], count=20, most_rays=10**6)
    assert len(found) == 20
    numbers = [path.ray for path in found]
    assert numbers == sorted(set(numbers))
    for path, again in zip(found, walker.follow(0, numbers), strict=True):
        assert np.array_equal(path.places_mm, again.places_mm)
        assert (again.fate, again.receiver, again.ray) == (path.fate, 4, path.ray)
    middle = (scene.emitter_patch[0, 0] + scene.receiver_patch[4, 0]) / 2, 16.0  # under the chord
    pressed = LightWalker(scene, middle, dimple(3.0), 5).follow(0, numbers)
    assert [path.ray for path in pressed] == numbers
    for path, bent in zip(found, pressed, strict=True):
        first, other = (legs[1] - legs[0] for legs in (path.places_mm, bent.places_mm))
        assert np.array_equal(bent.places_mm[0], path.places_mm[0])
        assert np.cross(first, other) == pytest.approx(0.0, abs=1e-9)  # one direction, to rounding
    assert any(path.receiver != 4 for path in pressed)


def test_a_search_for_paths_ends_after_the_rays_allowed() -> None:
    found = LightWalker(ring_scene(), CENTRE, None, 5).random_paths(0, [4], count=50, most_rays=2000)
    assert 0 < len(found) < 50
    assert max(path.ray for path in found) < 2000


def test_ends_choose_between_several_receivers_and_lost_light() -> None:
    walker = LightWalker(ring_scene(), CENTRE, None, 6)
    both = walker.random_paths(0, [4, 5], count=60, most_rays=10**6)
    assert {path.receiver for path in both} == {4, 5}
    lost = walker.random_paths(0, [LOST], count=60, most_rays=10**6)
    assert {path.receiver for path in lost} == {LOST}
    assert {path.fate for path in lost}.isdisjoint(CLASSES)
    assert [path.ray for path in walker.random_paths(0, count=60, most_rays=10**6)] == list(range(60))
