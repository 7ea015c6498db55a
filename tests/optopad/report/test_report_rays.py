"""The view of the light on the page: its numbers, its one script, and that it turns in a real browser."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.design.preset import preset
from optopad.report.page import write_report
from optopad.report.scenes.ray_scene import (
    CURVE_TOLERANCE_MM,
    RayScene,
    _marked_depths,
    _nearest_pairs,
    _thinned,
    ray_scene,
    scene_json,
)
from optopad.report.sections.rays import rays_section
from optopad.report.words import script_policy
from optopad.sims.rays import LOST, MIRRORED
from tests.sims.made_up_scores import CHECKS, contiguous_score, dead_score, out_of_scope_score

PAIR = preset("piacenza2017-pair")
PAD = preset("piacenza2017-pad")
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
