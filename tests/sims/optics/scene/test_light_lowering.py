"""Designs become scenes: options that are absent leave the scene as it was, options that are given fill it."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.preset import SHAPED_PRESETS, preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.optics.scene.lower import check_scene, scene_of
from optopad.sims.optics.scene.optical_scene import COSINE_NODES, pattern_power, response_nodes
from tests.design.parts.own_parts import SHEET, own_part, quantity, with_own_part
from tests.design.spec.spec_fields import good

SHEET_TABLE = {"angle_deg": [0.0, 30.0, 60.0, 90.0], "relative": [1.0, 0.9, 0.4, 0.0], **SHEET}


@pytest.mark.parametrize("name", ["piacenza2017-pad", "piacenza2017-pair", "oblong-60x40", "fingertip-16"])
def test_presets_have_bare_receivers_cosine_emitters_and_scattering_walls(name):
    scene = scene_of(preset(name))
    assert (scene.emitter_pattern, scene.receiver_response, scene.wall_index) == (None, None, None)


def test_a_pattern_is_lowered_to_unit_power_for_every_emitter():
    scene = scene_of(with_own_part("emitter", angular_pattern=SHEET_TABLE))
    check_scene(scene)
    assert scene.emitter_pattern.shape == (len(scene.emitter_wall), COSINE_NODES)
    assert np.abs(pattern_power(scene.emitter_pattern) - 1).max() < 1e-12


def test_emitters_without_a_pattern_keep_their_order_beside_others():
    base = good().model_dump(mode="json")["layout"]
    more = {"pattern": "single", "kind": "emitter", "wall": "north", "along_mm": 16.0, "part": "mine"}
    parts = {"parts": {"mine": own_part("emitter", angular_pattern=SHEET_TABLE)}}
    scene = scene_of(good(catalog=parts, layout=[*base, more]))
    check_scene(scene)
    by_order = np.isnan(scene.emitter_pattern).all(axis=1)
    assert by_order.tolist() == [True] * (len(by_order) - 1) + [False]


def test_epoxy_on_one_kind_of_receiver_leaves_the_others_bare():
    base = good().model_dump(mode="json")["layout"]
    more = {"pattern": "single", "kind": "receiver", "wall": "north", "along_mm": 16.0, "part": "mine"}
    parts = {"parts": {"mine": own_part("receiver", epoxy_index=quantity(1.53, "1"))}}
    design = good(catalog=parts, layout=[*base, more])
    scene = scene_of(design)
    check_scene(scene)
    assert (scene.receiver_response[:-1] == 1.0).all()
    expected = response_nodes(design.catalog.parts["mine"], scene.refractive_index)
    assert (scene.receiver_response[-1] == expected).all()


@pytest.mark.parametrize(("finish", "index"), [("diffuse", None), ("glossy", 1.54), ("air_gap", 1.0)])
def test_the_finish_sets_the_index_behind_the_walls(finish, index):
    assert scene_of(good(**{"surfaces.wall_finish": finish})).wall_index == index
    check_scene(scene_of(good(**{"surfaces.wall_finish": finish})))


def test_a_spectrum_sets_the_index():
    blue = {"wavelength_nm": [440.0, 460.0], "weight": [1.0, 1.0], **SHEET}
    red = {"wavelength_nm": [620.0, 640.0], "weight": [1.0, 1.0], **SHEET}
    indices = [scene_of(with_own_part("emitter", spectrum=colour)).refractive_index for colour in (blue, red)]
    assert indices[0] - indices[1] == pytest.approx(1.4159 - 1.4055, abs=5e-4)  # 20:1 at 0.45 and 0.63 um


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_a_shaped_pad_has_the_walls_top_and_windows_of_its_cavity(name: str) -> None:
    design = preset(name)
    scene, cavity = scene_of(design), cavity_of(design)
    form = scene.form
    assert form is not None
    walls = np.concatenate([scene.emitter_wall, scene.receiver_wall])
    patches = np.vstack([scene.emitter_patch, scene.receiver_patch])
    for part, wall, patch in zip(cavity.parts, form.walls[walls], patches, strict=True):
        place = wall[:2] + patch[0] * wall[2:4]
        assert (*place, patch[1]) == pytest.approx(part.position_mm)
        assert tuple(wall[4:]) == part.line.outward
    x, y = np.random.default_rng(3).uniform(0.2, 0.8, (2, 50)) * [[scene.length_mm], [scene.width_mm]]
    wanted = [cavity.plan.top_mm(*place) for place in zip(x, y, strict=True)]
    assert form.top.height_mm(x, y) == pytest.approx(wanted)
    normals = [cavity.plan.normal(*place) for place in zip(x, y, strict=True)]
    assert form.top.normal(x, y) == pytest.approx(np.array(normals))


def test_a_window_of_no_wall_of_its_form_is_refused() -> None:
    scene = scene_of(preset("fingertip-dome"))
    check_scene(scene)
    with pytest.raises(InputError, match=r"emitter_wall\[0\]: 40.*form.walls, 0 to 11"):
        check_scene(replace(scene, emitter_wall=np.full(6, 40)))


def test_a_flat_rectangle_has_no_form() -> None:
    assert scene_of(preset("oblong-60x40")).form is None
