"""The report of discs and crowned pads: layout, sections, maps, the views in space, words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.patches import Polygon

from optopad.design.shape.cavity import cavity_of
from optopad.report.page import write_report
from optopad.report.scenes.cause_drawing import plot_cause
from optopad.report.scenes.layout_drawing import plot_layout
from optopad.report.scenes.map_scene import plot_by_depth
from optopad.report.scenes.mold_scene import mold_scene
from optopad.report.scenes.pair_scene import plan_of
from optopad.report.scenes.ray_scene import scene_json
from optopad.report.sections.maps import map_scene
from tests.optopad.report.browser import browser_path, tab
from tests.optopad.report.shaped_scenes import made_up_light, shaped_score
from tests.optopad.report.shell_mold import shell_stl
from tests.optopad.screen.test_one_screen import cause
from tests.sims.made_up_scores import CHECKS
from tests.sims.plots.shaped_pads import BENT, DISC, DOME, made_up_press


class Load:
    """A load that goes with depth, with its band."""

    def at(self, depth_mm: float) -> tuple[float, float, float]:
        return depth_mm, 0.7 * depth_mm, 1.4 * depth_mm


@pytest.fixture
def made_up_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Presses and loads that need no contact library."""
    monkeypatch.setattr("optopad.report.scenes.cause_drawing.indent", made_up_press)
    monkeypatch.setattr("optopad.report.sections.maps.place_force", lambda *_: (Load(), True))


@pytest.mark.parametrize(("design", "edge"), [(DOME, "edge 4.25 to 4.32"), (BENT, "edge 6.68 to 8")])
def test_the_section_of_a_crowned_pad_shows_its_top_and_its_edge(design, edge):
    plan = cavity_of(design).plan
    cut = plot_layout(design).figure.axes[1]
    assert edge in {text.get_text() for text in cut.texts}
    top = next(patch for patch in cut.patches if type(patch) is Polygon and len(patch.get_xy()) > 80)
    # 81 places along the section: its highest one is next to the apex
    assert top.get_xy()[:, 1].max() == pytest.approx(plan.clear_mm, abs=1e-3)


def test_a_tip_comes_along_the_normal_in_the_section_of_a_cause(made_up_contact):
    """The tip's lowest point in the plane through the axis is its depth from the top, along the normal."""
    cavity = cavity_of(DOME)
    found = cause("apart")
    witness = replace(found.witnesses[0], pair="E1-R4")
    start, end = (np.array(part.position_mm[:2]) for part in (cavity.emitters[0], cavity.receivers[3]))
    place = start + 0.35 * (end - start)
    at = float(place[0]), float(place[1])
    axes = plot_cause(DOME, replace(found, place_mm=at, witnesses=(witness,)))
    assert axes is not None
    normal, top = np.array(cavity.plan.normal(*at)), cavity.plan.top_mm(*at)
    chord = (end - start) / np.hypot(*(end - start))
    # the axis leans a little out of the plane, by the part of the normal square to the chord
    (begins,) = [patch.get_xy() for patch in axes.patches if patch.get_gid() == "tip"]
    (ends,) = [np.array(line.get_data()).T for line in axes.lines if line.get_gid() == "deepest-tip"]
    tips = (begins, ends)
    for tip, depth in zip(tips, found.depth_mm, strict=True):
        apex = 0.35 * np.hypot(*(end - start)) - depth * float(normal[:2] @ chord), top - depth * normal[2]
        assert np.hypot(*(tip - apex).T).min() < 0.06


def test_maps_know_the_cell_of_every_place(made_up_contact):
    score = shaped_score(DISC)
    scene = map_scene(DISC, score)
    assert scene is not None
    data = scene.data()
    assert len(data["cells"]) == len(score.pad_map.places) < len(data["x"]) * len(data["y"])
    for (row, column), place in zip(data["cells"], score.pad_map.places, strict=True):
        assert (data["x"][column], data["y"][row]) == pytest.approx((place.x_mm, place.y_mm), abs=1e-4)
    for one in data["maps"]:
        assert {len(row) for row in one["values"]} == {len(data["cells"])}
    ax = plot_by_depth(scene, scene.maps[0])
    mesh = next(one for one in ax.collections if isinstance(one, QuadMesh))
    assert np.ma.count(mesh.get_array()) == len(data["cells"])


def test_the_plan_of_a_disc_has_its_outline_and_directions_of_its_parts():
    cavity = cavity_of(DISC)
    plan = plan_of(cavity, 3.0)
    away = np.hypot(*(np.array(plan["outline"]) - 27.5).T)
    assert away.max() == pytest.approx(27.5, abs=1e-3)
    name, _, x, y, right, up = plan["parts"][1]
    assert (name, right, up) == ("E2", pytest.approx(0.7071, abs=1e-3), pytest.approx(0.7071, abs=1e-3))
    assert (x - 27.5) / right == pytest.approx((y - 27.5) / up)
    assert len(plan_of(cavity_of(BENT), 3.0)["outline"]) == 4


def test_the_view_in_space_stands_on_the_crown():
    scene = made_up_light(DOME)
    data, plan = scene_json(scene), cavity_of(DOME).plan
    assert data["round"]
    assert data["press"]["crown"] == 18.0
    assert data["press"]["axes"][2] == pytest.approx(plan.normal(*scene.place_mm))
    assert data["press"]["origin"] == pytest.approx([*scene.place_mm, plan.top_mm(*scene.place_mm)])
    assert {part["name"] for part in data["parts"]} >= {"E1", "R6"}
    heights = np.array(data["edge"])[:, 2]
    assert (heights.min(), heights.max()) == pytest.approx(plan.rim_mm, abs=1e-3)


@pytest.mark.parametrize("design", [DOME, DISC, BENT], ids=["dome", "disc", "cylinder"])
def test_bodies_of_parts_stand_behind_their_facets(design, tmp_path):
    (tmp_path / "cad").mkdir()
    (tmp_path / "cad" / "mold.stl").write_bytes(shell_stl(design))
    scene = mold_scene(design, tmp_path)
    assert scene is not None
    assert scene["lid"] is None  # the bundle has none
    for part, (kind, corners) in zip(cavity_of(design).parts, scene["bodies"], strict=True):
        assert kind == part.kind
        outward = [part.line.along_and_outward_mm(x, y)[1] for x, y, _ in corners]
        assert min(outward) == pytest.approx(0.0, abs=1e-9)
        assert max(outward) == pytest.approx(part.part.body_depth_mm.value)
        for behind, place in enumerate((np.array(corners[4:]), np.array(corners[:4]))):
            turn = np.cross(
                place[1] - place[0], place[2] - place[1]
            )  # counter-clockwise, seen from the front
            assert turn / np.linalg.norm(turn) == pytest.approx(part.axis)
            assert (place - part.position_mm) @ part.axis == pytest.approx(
                -behind * part.part.body_depth_mm.value
            )


@pytest.mark.slow
@pytest.mark.skipif(browser_path() is None, reason="no browser")
def test_in_a_browser_a_dome_s_views_work_and_keys_stay_in_its_workspace(
    made_up_contact, monkeypatch, tmp_path: Path
):
    monkeypatch.setattr("optopad.report.sections.early.ray_scene", lambda *_, **__: made_up_light(DOME))
    folder = tmp_path / "bundle"
    (folder / "cad").mkdir(parents=True)
    (folder / "cad" / "mold.stl").write_bytes(shell_stl(DOME))
    score = shaped_score(DOME)
    page = write_report(DOME, folder, score, CHECKS, seed=7)
    with tab(tmp_path / "profile") as shown:
        shown.open(page)
        for view in ("rays-view", "pairs-view", "maps-view"):
            assert shown.run(f"document.getElementById('{view}').dataset.ready") == "yes"
        for look in ("cut", "whole", "none"):
            shown.run(f"document.querySelector('input[name=rays-mold][value={look}]').click()")
            shown.run("document.querySelector(\"input[name=rays-press][value='1']\").click()")
            shown.settle()
            assert '"direct":1' in shown.run("document.getElementById('rays-view').dataset.drawn")
        assert shown.run("document.querySelectorAll('[data-map] .cell').length") == len(score.pad_map.places)
        shown.run("document.querySelector('[data-map]').focus()")
        seen = []
        for key in ("ArrowRight", "ArrowUp", "ArrowLeft", "ArrowDown"):
            shown.press(key, times=12)
            seen.append(int(shown.run("document.getElementById('maps-view').dataset.place")))
        assert all(0 <= place < len(score.pad_map.places) for place in seen)
        assert len(set(seen)) > 2
        assert shown.complaints == []
