"""What the page's views are drawn from: the mold's mesh, the pairs' curves, the maps by depth, the build sheet."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.cad.mesh import read_stl
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, direct_path_pairs
from optopad.fabrication.sheets.casting import casting_md
from optopad.report.markdown import html_of
from optopad.report.scenes.mold_scene import mold_scene
from optopad.report.scenes.pair_scene import STEPS, pair_scene
from optopad.report.sections.maps import load_map, map_scene
from optopad.report.words import script_text
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.verdict.depth_curve import noise_units
from optopad.sims.verdict.pad_map import Place, pad_profile
from tests.optopad.report.bounded_score import bounded_score
from tests.optopad.report.page_reader import Page
from tests.optopad.report.shell_mold import shell_stl
from tests.sims.made_up_scores import contiguous_score, dead_score, made_up_depths

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
