import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

import optopad
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import symmetries_of
from optopad.sims.robot.fast_light import draft_nodes, fast_light, load_fast_light, together
from optopad.sims.robot.forward import forward
from optopad.sims.robot.light_fit import _motion, fit_fast_light
from optopad.sims.robot.shapes import Shape
from tests.sims.robot.made_up_light import made_up_light

EYE = np.eye(3)[None]


@pytest.fixture(scope="module")
def light():
    return made_up_light()


def _ball(light, x, y, depth, radius=None):
    radius = light.tip_radius_mm if radius is None else radius
    shape = Shape(kind="sphere", size_mm=np.array([radius, 0.0, 0.0]))
    return light.imprint(shape, np.array([[x, y, light.top.clear_mm + radius - depth]]), EYE)


def test_a_ball_like_the_tip_reads_the_light_of_the_tip(light):
    press = np.array([[12.0, 9.0, 0.7]])
    found = light.ratios(_ball(light, *press[0]))
    np.testing.assert_allclose(found.reshape(1, -1), light.tip.values(press) ** 2, rtol=1e-6)


def test_nothing_that_touches_leaves_the_light_exactly(light):
    assert (light.ratios(_ball(light, 12.0, 9.0, -0.01)) == 1.0).all()
    assert (light.ratios(_ball(light, 12.0, 9.0, -3.0, radius=8.0)) == 1.0).all()


def test_objects_in_contact_count_together(light):
    one, other = _ball(light, 7.0, 9.0, 0.5), _ball(light, 23.0, 12.0, 0.8, radius=2.0)
    both = together([one, other])
    np.testing.assert_allclose(light.parts(both)[0], light.parts(one)[0] * light.parts(other)[0])
    np.testing.assert_array_equal(both.overlap_mm, np.maximum(one.overlap_mm, other.overlap_mm))
    assert both.deepest_mm == pytest.approx(0.8, abs=0.05)  # between the nodes
    of_one = light.features(one.overlap_mm).reshape(-1, light.nodes.cells)
    found = light.features(both.overlap_mm).reshape(-1, light.nodes.cells)
    near_first = light.nodes.cell_lines_mm[0] < 9.0
    is_near = np.repeat(near_first, len(light.nodes.cell_lines_mm[1]))
    np.testing.assert_allclose(found[:, is_near], of_one[:, is_near], atol=5e-3)


def test_deeper_objects_count_as_that_deep(light):
    deep = light.ratios(_ball(light, 15.0, 11.0, 2.9, radius=6.0))
    limit = light.ratios(_ball(light, 15.0, 11.0, light.deepest_mm, radius=6.0))
    np.testing.assert_allclose(deep, limit, atol=2e-3)  # depths are those at the nodes


def test_rows_without_an_object_stay_untouched(light):
    one = _ball(light, 9.0, 9.0, 0.5, radius=4.0)
    found = light.ratios(one.among([1], 3))
    assert (found[[0, 2]] == 1.0).all()
    np.testing.assert_allclose(found[1], light.ratios(one)[0], rtol=1e-6)


def test_a_map_is_the_same_from_its_file(light, tmp_path):
    light.save(tmp_path / "one.npz")
    found = load_fast_light(tmp_path / "one.npz")
    imprint = _ball(light, 9.0, 9.0, 0.5, radius=4.0)
    np.testing.assert_array_equal(found.ratios(imprint), light.ratios(imprint))
    assert (found.digest, found.errors, found.top) == (light.digest, light.errors, light.top)


def test_damaged_and_missing_maps_are_refused(light, tmp_path, monkeypatch):
    light.save(tmp_path / "one.npz")
    whole = (tmp_path / "one.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"half.npz.*`optopad scene DESIGN --fit`"):
        load_fast_light(tmp_path / "half.npz")
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=r"run `optopad scene DESIGN --fit` once.*20 minutes"):
        fast_light(optopad.load("gripper-teensy"))


@pytest.mark.parametrize("name", ["piacenza2017-pad", "levi2013-disc"])
def test_channels_turn_with_the_pad(name):
    """The channels of overlaps that a symmetry moves are the channels it moves."""
    design = optopad.load(name)
    light = made_up_light(name)
    assert light.nodes.inside.mean() > 0.7
    shape = Shape(kind="box", size_mm=np.array([3.0, 2.0, 2.0]))
    middle = light.nodes.points_mm.mean(axis=0) + np.array([1.3, -0.7, 1.7])
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]])
    overlap = light.imprint(shape, middle[None], turn).overlap_mm
    channels = light.features(overlap).reshape(-1, light.nodes.cells)
    motions = [(each, _motion(light.nodes, each)) for each in symmetries_of(scene_of(design))]
    known = [(each, one) for each, one in motions if one is not None]
    assert len(known) >= 2
    for each, one in known:
        moved = light.features(moved_overlap(light, each, overlap)).reshape(channels.shape)
        np.testing.assert_allclose(moved, one.channels @ channels[:, one.cells], atol=1e-5)


def moved_overlap(light, symmetry, overlap):
    """Overlaps of the same objects, moved by a symmetry."""
    places = light.nodes.points_mm[:, :2]
    _, image = cKDTree(places).query(symmetry.image(places))
    moved = np.empty_like(overlap)
    moved[:, image] = overlap
    return moved


def test_nodes_of_all_shapes_cover_the_pad():
    for name in ("gripper-stadium", "levi2013-disc", "crowned-40x25", "fingertip-dome", "oblong-60x40"):
        plan = Draft.of(optopad.load(name)).plan
        nodes = draft_nodes(Draft.of(optopad.load(name)), 1.5)
        cell = nodes.pitch_mm**2
        assert nodes.inside.sum() * cell == pytest.approx(plan.area_mm2, rel=0.06)
        on_top = plan.top.height_mm(*nodes.points_mm[nodes.inside, :2].T)
        np.testing.assert_allclose(nodes.points_mm[nodes.inside, 2], on_top)


def test_readings_of_presses_are_gains_times_light(light):
    pad = forward(optopad.load("gripper-teensy"), light)
    press = np.array([[12.0, 9.0, 0.7], [15.0, 11.0, 0.0]])
    found = pad.presses(press)
    np.testing.assert_allclose(found[1], pad.untouched)
    wanted = light.untouched.ravel() * light.tip.values(press[:1])[0] ** 2
    np.testing.assert_allclose((found[0] / pad.chain.gains).ravel(), wanted, rtol=1e-6)
    np.testing.assert_allclose(pad.objects(f"sphere,radius={light.tip_radius_mm}", press), found, rtol=1e-6)
    noisy = pad.presses(np.repeat(press, 200, axis=0), seed=3)
    np.testing.assert_allclose(noisy[:200].mean(axis=0), found[0], rtol=0.02, atol=1.0)
    assert noisy[:200].std() > 0.0


@pytest.mark.parametrize("press", [np.zeros((0, 3)), [[1.0, 2.0]], [[1.0, np.nan, 0.1]], 3.0])
def test_presses_that_are_no_rows_are_refused(light, press):
    pad = forward(optopad.load("gripper-teensy"), light)
    with pytest.raises(InputError, match="press_mm"):
        pad.presses(press)


def test_a_fit_of_too_few_states_is_refused():
    with pytest.raises(InputError, match="states: 3 is refused"):
        fit_fast_light(optopad.load("gripper-teensy"), states=3)


@pytest.mark.full
def test_a_small_fit_explains_most_of_the_light_of_objects(tmp_path):
    """With a hundredth of the states of a whole fit; the light is that of objects, traced anew."""
    design = optopad.load("piacenza2017-pair")
    steps = []
    light = fit_fast_light(design, states=200, on_step=lambda stage, share: steps.append((stage, share)))
    assert list(dict.fromkeys(stage for stage, _ in steps)) == ["map", "states", "fit", "check"]
    assert light.errors["ball like the tip"] < 0.01
    assert light.errors["all"] < 0.1
    found = forward(design)  # which the cache now has
    at = found.light.nodes.points_mm.mean(axis=0)[:2]
    view = optopad.press(design, "sphere", at=(float(at[0]), float(at[1])), depth=1.0)
    traced = view.light.flux[0] / view.light.untouched
    np.testing.assert_allclose(found.presses([[*at, 1.0]])[0] / found.untouched, traced, atol=0.03)


def test_the_program_for_jax_gives_the_map(light, monkeypatch, tmp_path):
    """With NumPy in the place of JAX."""
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "robot-simulation.md").read_text(encoding="utf-8")
    (program,) = [one for one in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "xp = np" in one]
    monkeypatch.setattr("optopad.sims.robot.fast_light.fast_light", lambda _design: light)
    (tmp_path / "page.py").write_text(program, encoding="utf-8")
    names = runpy.run_path(str(tmp_path / "page.py"))
    box = Shape(kind="box", size_mm=np.array([3.0, 2.0, 2.0]))
    imprint = light.imprint(box, np.array([[14.0, 10.0, light.top.clear_mm + 1.5]]), EYE)
    found = names["ratios"](light, imprint.overlap_mm)
    np.testing.assert_allclose(found, light.ratios(imprint).reshape(1, -1), atol=1e-5)


def test_a_ball_beside_the_pad_changes_nothing(light):
    for x in (-6.0, 300.0):
        assert (light.ratios(_ball(light, x, 9.0, 0.8)) == 1.0).all()


def test_bright_pairs_read_full_scale_when_nothing_touches():
    design = optopad.load("piacenza2017-pad")
    bright = made_up_light(design=design)
    bright.untouched[0, 0] *= 100.0
    pad = forward(design, bright)
    assert pad.untouched.max() == pad.chain.full_scale_counts
    np.testing.assert_array_equal(pad.presses([[16.0, 16.0, 0.0]])[0], pad.untouched)


def test_readings_of_another_design_and_of_places_outside_are_refused(light):
    with pytest.raises(InputError, match="light: of design"):
        forward(optopad.load("piacenza2017-pad"), light)
    pad = forward(optopad.load("gripper-teensy"), light)
    with pytest.raises(InputError, match=r"row 1: \(40, 9\) mm is outside the pad"):
        pad.presses([[12.0, 9.0, 0.2], [40.0, 9.0, 0.2]])
