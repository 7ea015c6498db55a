"""What the page's views are drawn from: the mold's mesh, the pairs' curves, the maps by depth, the build sheet."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.cad.mesh import read_stl
from optopad.design.errors import ModelScopeError
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, direct_path_pairs
from optopad.fabrication.sheets.casting import casting_md
from optopad.report.markdown import html_of
from optopad.report.page import write_report
from optopad.report.scenes.mold_scene import mold_scene
from optopad.report.scenes.pair_scene import STEPS, pair_scene
from optopad.report.scenes.ray_scene import (
    CURVE_TOLERANCE_MM,
    RayScene,
    _marked_depths,
    _nearest_pairs,
    _thinned,
    ray_scene,
    scene_json,
)
from optopad.report.sections.maps import load_map, map_scene
from optopad.report.sections.rays import rays_section
from optopad.report.words import script_policy, script_text
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.rays import LOST, MIRRORED
from optopad.sims.verdict.depth_curve import noise_units
from optopad.sims.verdict.pad_map import Place, pad_profile
from tests.optopad.report.bounded_score import bounded_score
from tests.optopad.report.page_reader import Page
from tests.optopad.report.shell_mold import shell_stl
from tests.sims.made_up_scores import CHECKS, contiguous_score, dead_score, made_up_depths, out_of_scope_score

PAIR = preset("piacenza2017-pair")
PAD = preset("piacenza2017-pad")


def test_the_mold_of_the_view_is_the_printed_one_to_two_micrometres(tmp_path: Path) -> None:
    stl = shell_stl(PAIR)
    (tmp_path / "cad").mkdir()
    (tmp_path / "cad" / "mold.stl").write_bytes(stl)
    scene = mold_scene(PAIR, tmp_path)
    assert scene is not None
    points = np.frombuffer(base64.b64decode(scene["points"]), "<u2").reshape(-1, 3)
    places = np.array(scene["low"]) + scene["step"] * points
    lifted = places + np.array([0.0, 0.0, bed_lift_mm(PAIR)])
    # half a step is what rounding leaves
    assert np.abs(lifted - read_stl(stl).vertices).max() <= 0.5 * scene["step"] + 1e-6
    assert scene["step"] <= 0.002
    triangles = np.frombuffer(base64.b64decode(scene["triangles"]), "<u4")
    assert triangles.size == 3 * 24
    assert triangles.max() < len(points)


def test_bodies_stand_behind_their_walls_and_reach_to_their_inner_faces(tmp_path: Path) -> None:
    (tmp_path / "cad").mkdir()
    (tmp_path / "cad" / "mold.stl").write_bytes(shell_stl(PAIR))
    scene = mold_scene(PAIR, tmp_path)
    assert scene is not None
    cavity, outline = cavity_of(PAIR), outline_of(PAIR)
    for kind, corners in scene["bodies"]:
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        inner = 0.0 if kind == "emitter" else cavity.length_mm  # west and east walls
        assert inner in (low[0], high[0])
        assert not 0.0 < (low[0] + high[0]) / 2 < cavity.length_mm
        assert -outline.wall_x_mm < low[0]
        assert high[0] < cavity.length_mm + outline.wall_x_mm
    assert mold_scene(PAIR, tmp_path / "elsewhere") is None


def test_curves_of_the_picker_add_up_and_keep_four_digits() -> None:
    score = dead_score(PAIR)
    data = pair_scene(PAIR, score)
    assert data["pairs"][data["first"]]["name"] == score.governing
    for row, pair in zip(data["pairs"], score.pairs, strict=True):
        light = pair.curves.total / pair.curves.total[0]
        assert np.abs(np.array(row["total"]) / STEPS - light).max() <= 0.5 / STEPS
        assert row["dead"] == [list(span) for span in pair.score.deadbands_mm]


def test_dead_zones_by_depth_are_the_deadbands_of_the_map() -> None:
    score = dead_score(PAD)
    scene = map_scene(PAD, score)
    assert scene is not None
    depth = scene.profile.depth_mm
    for number, place in enumerate(score.pad_map.places):
        dead_mm = depth[scene.profile.is_dead[:, number]]
        if place.deadbands_mm:
            ((start, end),) = place.deadbands_mm
            # the schedule's step is 0.1 mm
            assert dead_mm.min() == pytest.approx(start, abs=0.1)
            assert dead_mm.max() == pytest.approx(end, abs=0.1)
        else:
            assert dead_mm.size == 0


def test_the_change_by_depth_is_that_of_the_most_responsive_pair_over_three_tenths() -> None:
    """A single pair whose counts fall in a straight line from 1.0 to 2.0 mm, in every place."""
    score = contiguous_score(PAIR)
    places, readout = len(score.pad_map.places), score.readout
    depth = np.linspace(0.0, 5.0, 51)
    share = np.clip((depth - 1.0), 0.0, 1.0)
    mask = direct_path_pairs(cavity_of(PAIR))
    flux = np.zeros((places, 51, *mask.shape))
    flux[..., 1, 1] = (300.0 - 200.0 * share) / readout.counts_per_flux
    presses = np.zeros((places, 51, 3))
    presses[..., 2] = depth
    light = LightSignals(
        flux=flux.reshape(-1, *mask.shape),
        by_class={},
        standard_error=np.zeros((places * 51, *mask.shape)),
        presses=presses.reshape(-1, 3),
        digest="",
        seed=0,
    )
    profile = pad_profile(cavity_of(PAIR), score.pad_map, light, readout, depth)
    assert profile.change is not None
    assert profile.change.shape == (51, places)
    noise = {
        "read_noise_counts": PAIR.noise.read_noise_counts,
        "relative_noise": PAIR.noise.relative_noise,
    }
    units = noise_units(300.0 - 200.0 * share, **noise)
    inside = float(np.interp(1.35, depth, units) - np.interp(1.65, depth, units))
    assert profile.change[15] == pytest.approx(inside, rel=1e-9)  # 1.5 mm: from 1.35 to 1.65 mm
    assert profile.change[3] == pytest.approx(0.0, abs=1e-9)
    assert profile.change[40] == pytest.approx(0.0, abs=1e-9)


def test_the_least_change_by_depth_is_the_margin_of_the_verdict() -> None:
    """Where the whole curve is known, the map by depth and the verdict's margin agree."""
    from optopad.sims.verdict.depth_curve import smallest_range

    score = contiguous_score(PAIR)
    depth = np.linspace(0.0, 5.0, 51)
    place = Place(
        x_mm=10.0,
        y_mm=10.0,
        depths=made_up_depths(margin=1.0),
        answering_pairs=1,
    )
    pad = replace(score.pad_map, x_mm=(10.0,), y_mm=(10.0,), places=(place,))
    counts = 300.0 - 45.0 * depth - 6.0 * np.sin(3.0 * depth)
    shape = direct_path_pairs(cavity_of(PAIR)).shape
    flux = np.zeros((51, *shape))
    flux[:, 0, 0] = counts / score.readout.counts_per_flux
    presses = np.column_stack([np.full(51, 10.0), np.full(51, 10.0), depth])
    light = LightSignals(
        flux=flux, by_class={}, standard_error=np.zeros_like(flux), presses=presses, digest="", seed=0
    )
    profile = pad_profile(cavity_of(PAIR), pad, light, score.readout, depth)
    noise = {
        "read_noise_counts": PAIR.noise.read_noise_counts,
        "relative_noise": PAIR.noise.relative_noise,
    }
    margin = smallest_range(depth, noise_units(counts, **noise), 0.3)
    assert profile.change is not None
    # windows that begin half-way between two depths are not among those centred on a depth: a step's change
    assert profile.change.min() == pytest.approx(margin, rel=0.02)
    assert profile.change.min() >= margin - 1e-9


def test_maps_of_the_bounds_hatch_what_is_dead_and_give_both_ends() -> None:
    score = bounded_score()
    scene = map_scene(PAD, score)
    assert scene is not None
    assert [one.key for one in scene.maps] == ["dead", "location", "depth", "felt", "load"]
    place = next(one for one in scene.maps if one.key == "location")
    # 0.004 mm times 4 a layer: above the limit of 0.5 mm in the last one only, and blind at one place there
    assert place.is_hatched.sum(axis=1).tolist() == [0, 0, 0, 0, 25]
    assert np.isnan(place.values[-1, 0])
    assert place.ends is not None
    assert place.ends[1, 3] == pytest.approx([0.016 * 0.98, 0.016 * 1.02])  # two standard errors of 1 %
    data = place.data()
    assert data["values"][-1][0] is None
    assert data["ends"][-1][0] == [None, None]
    assert data["depth"] == [0.2, 0.7, 1.5, 2.8, 4.9]


def test_the_load_map_rises_with_depth_and_towards_the_walls() -> None:
    score = dead_score(PAD)
    loads = load_map(PAD, score.pad_map, np.array([0.0, 1.0, 2.0, 4.0]))
    assert loads.depth_mm.tolist() == [1.0, 2.0, 4.0]
    assert (np.diff(loads.values, axis=0) > 0.0).all()
    grid = loads.values[1].reshape(5, 5)
    assert grid[0, 0] > grid[0, 2] > grid[2, 2]  # a corner is stiffer than a side, a side than the middle
    assert grid == pytest.approx(grid[::-1, ::-1], rel=1e-9)
    assert loads.ends is not None
    assert (loads.ends[..., 0] < loads.values).all()
    assert (loads.values < loads.ends[..., 1]).all()


def test_what_a_design_says_in_its_build_sheet_stays_text() -> None:
    attack = "<img src=x onerror=alert(1)> `code` | * # [a](b) \\"
    said = html_of(casting_md(PAIR.with_(description=attack)))
    assert "<img" not in said
    assert attack.strip() in Page(f"<main>{said}</main>").text


def test_the_script_names_no_address_and_closes_no_element() -> None:
    assert "http" not in script_text()
    assert "</" not in script_text()


LARGEST_SECTION = 300_000


@pytest.fixture(scope="module")
def scene() -> RayScene:
    found = ray_scene(PAIR, dead_score(PAIR), seed=7)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def text(folder: Path, scene: RayScene) -> str:
    """A page with the light of `scene`, and without ink on its plots."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optopad.report.sections.drawings.svg_text", lambda *_: '<svg viewBox="0 0 1 1"></svg>')
        patch.setattr("optopad.report.sections.early.ray_scene", lambda *_, **__: scene)
        return written(folder)


def written(folder: Path) -> str:
    return write_report(PAIR, folder, dead_score(PAIR), CHECKS, seed=7).read_text(encoding="utf-8")


def test_presses_are_at_the_verdicts_place_with_both_ends_of_its_deadband(scene):
    governing = dead_score(PAIR).pairs[0]
    start, end = governing.score.deadbands_mm[0]
    assert scene.place_mm == governing.curves.press_mm
    words = dict(zip([round(state.press_mm[2], 3) for state in scene.states], scene.labels, strict=True))
    assert words[0.0] == "untouched"
    assert words[round(start, 3)].endswith("the deadband begins")
    assert words[round(end, 3)].endswith("the deadband ends")
    assert list(words) == sorted(words)


def test_a_pad_is_shown_at_its_weakest_place_with_the_pairs_that_pass_there():
    score = dead_score(PAD)
    weakest = score.pad_map.weakest
    pairs = _nearest_pairs(ray_scene_cavity(), (weakest.x_mm, weakest.y_mm))
    assert len(pairs) == 8
    # E8 sits at (0, 12) and R1 at (12, 0): their chord passes through (6, 6), the weakest place
    assert (weakest.x_mm, weakest.y_mm) == (6, 6)
    assert pairs[0] == (7, 0)


def ray_scene_cavity():
    from optopad.design.shape.cavity import cavity_of

    return cavity_of(PAD)


def test_a_depth_beside_an_end_of_the_deadband_is_left_out():
    found = _marked_depths(((1.1, 2.9),), 5.0)
    assert sorted(found) == [0.5, 1.1, 2.0, 2.9, 5.0]
    assert sorted(_marked_depths((), 5.0)) == [0.5, 1.0, 2.0, 3.0, 5.0]
    assert 5.4 not in _marked_depths(((4.0, 5.4),), 5.0)


def test_without_a_verdict_there_is_no_view():
    assert ray_scene(PAIR, out_of_scope_score(PAIR), seed=0) is None
    assert ray_scene(PAD, replace(contiguous_score(PAD), pad_map=None), seed=0) is None


def test_shares_of_the_untouched_pad_add_up_to_one(scene):
    assert sum(scene.share(0, kind) or 0.0 for kind in scene.kinds) == pytest.approx(1.0)
    for pair in range(len(scene.pairs)):
        assert sum(scene.share(0, kind, pair) or 0.0 for kind in scene.kinds) == pytest.approx(1.0)
    assert scene.share(1, LOST) is None
    assert scene.share(len(scene.states) - 1, MIRRORED) < scene.share(0, MIRRORED)


def test_data_holds_every_path_of_its_pair_to_a_hundredth_of_a_millimetre(scene):
    data = scene_json(scene)
    keys = [kind["key"] for kind in data["kinds"]]
    for row, state in zip(data["states"], scene.states, strict=True):
        assert len(row["rays"]) == len(state.paths) + len(state.lost)
        for (kind, pair, numbers), path in zip(row["rays"], (*state.paths, *state.lost), strict=True):
            assert np.array(numbers).reshape(-1, 3) / 100 == pytest.approx(path.places_mm, abs=0.0051)
            assert scene.pairs[pair][0] == path.emitter
            assert keys[kind] == "lost" or scene.pairs[pair][1] == path.receiver
    # the tip stands between the parts of the first pair; beside it the rubber that it displaces lets more light through
    between = np.array([row["shares"][1] for row in data["states"]], dtype=np.float64)
    assert np.all(np.diff(between[:, keys.index("direct")]) <= 0.0)
    assert np.all(np.diff(between[:, -1]) < 0.0)
    assert data["states"][0]["shares"][0][-1] == 1.0


def test_a_thinned_curve_stays_within_its_tolerance():
    x = np.linspace(0.0, 3.0, 400)
    curve = np.column_stack([x, np.sin(2 * x)])
    thin = _thinned(curve, CURVE_TOLERANCE_MM)
    assert len(thin) < 60
    # an upright distance is at most 1 / cos(slope) of the tolerance; the slope is at most 2
    assert np.abs(np.interp(x, *thin.T) - curve[:, 1]).max() < CURVE_TOLERANCE_MM * 5**0.5


def test_the_section_stays_small(scene):
    assert len(rays_section(scene).encode()) < LARGEST_SECTION


@pytest.mark.slow
def test_the_section_of_a_pad_stays_small():
    pad = ray_scene(PAD, dead_score(PAD), seed=0)
    assert pad is not None
    assert len(rays_section(pad).encode()) < LARGEST_SECTION


def test_only_the_views_own_script_may_run(text):
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)
    scripts = re.findall(r"<script(?: [^>]*)?>(.*?)</script>", text, flags=re.DOTALL)
    kinds = [kind.strip() for kind in re.findall(r"<script([^>]*)>", text)]
    data = [f'type="application/json" id="{name}-data"' for name in ("rays", "pairs", "maps")]
    assert kinds == [*data, ""]
    digest = base64.b64encode(hashlib.sha256(scripts[-1].encode()).digest()).decode()
    assert policy == f"default-src 'none'; style-src 'unsafe-inline'; img-src data:{script_policy()}"
    assert script_policy() == f"; script-src 'sha256-{digest}'"


def test_data_cannot_end_its_own_element(scene):
    states = (scene.labels[0], "</script><script>alert(1)</script>", *scene.labels[2:])
    section = rays_section(replace(scene, labels=states))
    assert section.count("<script") == 1
    found = re.search(r'id="rays-data">(.*?)</script>', section, flags=re.DOTALL)
    assert found is not None
    assert json.loads(found[1])["states"][1]["label"] == states[1]


@pytest.mark.usefixtures("undrawn")
def test_a_design_that_the_ray_tracer_refuses_still_has_a_page(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise ModelScopeError("made-up <limit>")

    monkeypatch.setattr("optopad.report.sections.early.ray_scene", refuse)
    page = write_report(PAIR, tmp_path, dead_score(PAIR), CHECKS, seed=7).read_text(encoding="utf-8")
    assert "design. made-up &lt;limit&gt" in page
    assert 'id="rays-data"' not in page
