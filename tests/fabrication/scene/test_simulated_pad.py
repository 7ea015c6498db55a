"""Frames of a simulated pad: those that its board would have delivered by then, of the objects that touch it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import optopad
from optopad.design.errors import InputError
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.sims.robot.fast_light import Imprint
from tests.fabrication.scene.made_up_scene import (
    DESIGN,
    QUIET,
    TIP_RADIUS_MM,
    Press,
    StandInLight,
    ball,
    flat_imprint,
    pad_body,
    scene,
)


def quiet_body(prefix: str = "", at_m: float = 0.0) -> str:
    return pad_body(prefix, at_m, QUIET)


def quiet_pad(model: mujoco.MjModel, name: str = "", **options: object) -> SimulatedPad:
    return SimulatedPad(model, QUIET, name, light=StandInLight(QUIET), **options)  # type: ignore[arg-type]


def test_an_untouched_pad_has_its_baseline_in_every_frame() -> None:
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
    pad = SimulatedPad(press.model, DESIGN, light=StandInLight())
    frames = [pad.frame(press.step(-1.0)) for _ in range(100)]
    assert type(frames[0]) is Frame
    assert frames[0].counts.shape == (9, 8)
    assert frames[0].counts.dtype == np.uint16
    np.testing.assert_array_equal(
        frames[0].signals, frames[0].counts[:-1].astype(int) - frames[0].counts[-1].astype(int)
    )
    assert np.mean([one.normalised for one in frames]) == pytest.approx(1.0, abs=2e-3)
    assert not frames[0].saturated.any()


def test_a_frame_is_the_latest_delivered_one_however_often_it_is_asked_for() -> None:
    press = Press(scene(pad_body(), ball(), step_s=0.001), 8.0, 8.0)
    pad = SimulatedPad(press.model, DESIGN, light=StandInLight(), rate_hz=100)
    distinct = {}
    for _ in range(100):
        frame = pad.frame(press.step(0.5))
        now_s = press.data.time
        assert frame.sequence == 0 or frame.host_s <= now_s + 1e-9 < frame.host_s + pad.interval_s
        assert frame.host_s - frame.began_s == pytest.approx(pad.delay_s)
        distinct.setdefault(frame.sequence, frame)
        assert distinct[frame.sequence] is frame
    assert list(distinct) == list(range(10))
    assert [one.device_us for one in distinct.values()] == [1000 + 10_000 * k for k in range(10)]


class EvenLight(StandInLight):
    """Light of all pairs that falls evenly with the depth, and counts the states that it is asked for."""

    asked = 0

    def ratios(self, imprint: Imprint) -> np.ndarray:
        self.asked += len(imprint)
        depth_mm = np.maximum(imprint.deepest_mm, 0.0)
        return np.broadcast_to((1.0 - 0.2 * depth_mm)[:, None, None], (len(imprint), 8, 8))


def even_pad(step_s: float) -> tuple[SimulatedPad, EvenLight, Press]:
    light = EvenLight(QUIET)
    press = Press(scene(quiet_body(), ball(), step_s=step_s), *light.points_mm[112, :2])
    return SimulatedPad(press.model, QUIET, light=light), light, press


@pytest.mark.parametrize(("step_s", "steps"), [(0.001, 1), (0.004, 1), (0.003, 10)])
@pytest.mark.parametrize("speed_mm_s", [5.0, 30.0])
def test_each_pair_has_the_light_of_its_own_conversion(step_s: float, steps: int, speed_mm_s: float) -> None:
    """The depth grows evenly in time, so between the calls the light of each pair is known, whatever their interval."""
    pad, light, press = even_pad(step_s)
    pad.frame(press.to(1e-9))
    while press.data.time < 0.07:
        for _ in range(steps):
            press.step(speed_mm_s * (press.data.time + step_s))
        frame = pad.frame(press.data)
    at_s = frame.began_s + pad._chain.read_at_s[:-1]
    exact = light.untouched * pad._chain.gains * (1.0 - 0.2 * speed_mm_s * at_s)
    assert frame.began_s > 0.03
    assert np.abs(frame.signals - exact).max() <= 0.5 + 1e-6


def test_a_contact_within_a_frame_is_seen_by_the_later_pairs_alone() -> None:
    pad, light, press = even_pad(0.001)
    frame, touched_s = pad.frame(press.to(-1.0)), 0.0525
    while press.data.time < 0.06:
        press.step(50.0 * (press.data.time + 0.001 - touched_s))
        frame = pad.frame(press.data)
    at_s = frame.began_s + pad._chain.read_at_s[:-1]
    depth_mm = np.maximum(50.0 * (at_s - touched_s), 0.0)
    assert 0 < (depth_mm > 0.0).sum() < 64
    exact = light.untouched * pad._chain.gains * (1.0 - 0.2 * depth_mm)
    assert np.abs(frame.signals - exact).max() <= 2.0  # of 300: the light is linear between two steps


def test_light_is_computed_once_while_objects_rest() -> None:
    pad, light, press = even_pad(0.001)
    while press.data.time < 0.5:
        frame = pad.frame(press.step(0.5))
    assert frame.sequence == 29
    assert light.asked == 1
    press.step(0.52)
    while press.data.time < 0.55:
        frame = pad.frame(press.step(0.52))
    assert light.asked == 2
    assert frame.normalised[0, 0] == pytest.approx(1.0 - 0.2 * 0.52, abs=2e-3)


def test_a_pad_reads_the_same_wherever_it_is_mounted() -> None:
    press = Press(scene(quiet_body(), ball()), 6.0, 9.0)
    here = quiet_pad(press.model).frame(press.to(0.7))
    model = scene(f'<body pos="0.3 -0.2 0.5" euler="30 -120 70">{quiet_body("left_")}</body>', ball())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axes, origin = data.site("left_pad_cavity").xmat.reshape(3, 3), data.site("left_pad_cavity").xpos
    data.qpos[:3] = origin + axes @ press.data.qpos[:3]
    mujoco.mj_forward(model, data)
    there = quiet_pad(model, "left").frame(data)
    assert here.normalised.min() < 0.96
    assert np.abs(there.counts.astype(int) - here.counts.astype(int)).max() <= 1


def test_two_pads_of_one_model_see_their_own_objects() -> None:
    press = Press(scene(quiet_body("left_"), quiet_body("right_", 0.05), ball()), 8.0, 8.0, at_m=0.05)
    left, right = quiet_pad(press.model, "left"), quiet_pad(press.model, "right")
    data = press.to(0.5)
    assert left.frame(data).normalised.min() == 1.0
    assert right.frame(data).normalised.min() < 0.96


def test_a_reset_of_the_scene_starts_the_board_again() -> None:
    press = Press(scene(quiet_body(), ball()), 8.0, 8.0)
    pad = quiet_pad(press.model)
    for _ in range(20):
        touched = pad.frame(press.step(0.5))
    mujoco.mj_resetData(press.model, press.data)
    mujoco.mj_forward(press.model, press.data)
    frame = pad.frame(press.data)
    assert (touched.connection, frame.connection, frame.sequence, frame.began_s) == (1, 2, 0, 0.0)
    assert touched.normalised.min() < 0.96
    assert frame.normalised.min() == 1.0


def test_a_model_without_the_pad_names_the_pads_that_it_has() -> None:
    model = scene(quiet_body("left_"), quiet_body("right_", 0.05))
    with pytest.raises(InputError, match=r"'middle' is no pad of this model.* its pads are 'left', 'right'"):
        quiet_pad(model, "middle")
    with pytest.raises(InputError, match=r"file pad\.xml of `optopad scene`"):
        quiet_pad(scene(ball()))


def test_light_or_a_pad_of_another_design_is_refused() -> None:
    with pytest.raises(InputError, match="light: of design"):
        SimulatedPad(scene(pad_body()), DESIGN, light=StandInLight(QUIET))
    with pytest.raises(InputError, match="but the model's pad '' is of design"):
        SimulatedPad(scene(quiet_body()), DESIGN, light=StandInLight())


def test_a_design_without_a_map_of_light_is_told_how_to_get_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=r"optopad scene DESIGN --fit` once.* 20 minutes"):
        SimulatedPad(scene(quiet_body()), QUIET)
    with pytest.raises(InputError, match=r"no\.npz"):
        SimulatedPad(scene(quiet_body()), QUIET, light=tmp_path / "no.npz")


def test_an_object_deeper_than_the_map_of_light_counts_as_that_deep_and_is_told_once() -> None:
    press = Press(scene(quiet_body(), ball()), 8.0, 8.0)
    shallow = SimulatedPad(press.model, QUIET, light=StandInLight(QUIET, deepest_mm=1.0))
    with pytest.warns(UserWarning, match=r"1\.\d\d mm deep, and the map of light ends at 1\.00 mm"):
        shallow.frame(press.step(1.5))
    for _ in range(20):
        deep = shallow.frame(press.step(1.5))  # a second warning would be an error
    unlimited = quiet_pad(press.model).frame(press.to(1.5))
    assert unlimited.normalised.min() < deep.normalised.min() < 1.0
    shallow.reset()
    np.testing.assert_allclose(deep.normalised, shallow.frame(press.to(1.0)).normalised, atol=0.02)


def test_every_frame_is_recorded_although_the_program_asks_seldom(tmp_path: Path) -> None:
    press = Press(scene(quiet_body(), ball(), step_s=0.004), 8.0, 8.0)
    pad = quiet_pad(press.model)
    with pad.record(tmp_path / "seldom.optorec"):
        for _ in range(25):
            for _ in range(10):
                press.step(min(press.data.time, 1.0))
            given = pad.frame(press.data)
    recorded = optopad.read_recording(tmp_path / "seldom.optorec")
    np.testing.assert_array_equal(recorded.sequence, np.arange(given.sequence + 1))
    np.testing.assert_array_equal(recorded.counts[-1], given.counts)
    weakest = recorded.signals.reshape(len(recorded.counts), -1).min(axis=1)
    assert (np.diff(weakest) <= 0).all()


def test_a_released_press_leaves_its_residue() -> None:
    design = QUIET.with_(**{"noise.release_residue": 0.05, "noise.release_decay_s": 1.0})
    press = Press(scene(pad_body(design=design), ball()), 8.0, 8.0)
    pad = SimulatedPad(press.model, design, light=StandInLight(design))
    while press.data.time < 0.5:
        pressed = pad.frame(press.step(2.0))
    while press.data.time < 1.5:
        left = pad.frame(press.step(-1.0))
    loss, rest = 1.0 - pressed.normalised, 1.0 - left.normalised
    strong = loss > 0.2
    since_s = left.began_s - pressed.began_s - pad.interval_s
    assert strong.sum() > 4
    share = (rest[strong] / loss[strong]).mean()  # of rounded counts
    assert share == pytest.approx(0.05 / (1.0 + since_s), rel=0.1)


CUBE = " ".join(f"{x} {y} {z}" for x in (-0.003, 0.003) for y in (-0.002, 0.002) for z in (-0.001, 0.001))
CUBE_MESH = f'<mesh name="cube" vertex="{CUBE}"/>'
SAME = {
    "box and mesh": ('type="box" size="0.003 0.002 0.001"', 'type="mesh" mesh="cube"'),
    "sphere and ellipsoid": ('size="0.004"', 'type="ellipsoid" size="0.004 0.004 0.004"'),
    "capsule and sphere": ('type="capsule" size="0.004 1e-6"', 'size="0.004"'),
}


def body_of(geom: str) -> str:
    return f'<body pos="0 0 1"><freejoint/><geom {geom}/></body>'


def frame_of(geom: str, height_mm: float) -> Frame:
    """Frame of a geom whose centre is so far above the top, turned about the vertical."""
    press = Press(scene(quiet_body(), body_of(geom), assets=CUBE_MESH), 7.0, 9.0)
    press.data.qpos[3:] = np.cos(0.2), 0.0, 0.0, np.sin(0.2)
    return quiet_pad(press.model).frame(press.to(TIP_RADIUS_MM - height_mm))


@pytest.mark.parametrize("pair", ["box and mesh", "sphere and ellipsoid", "capsule and sphere"])
def test_geoms_of_one_shape_are_read_alike(pair: str) -> None:
    one, other = (frame_of(geom, {"box and mesh": 0.5}.get(pair, 3.3)) for geom in SAME[pair])
    assert one.normalised.min() < 0.98
    assert np.abs(one.counts.astype(int) - other.counts.astype(int)).max() <= 1


def test_a_lying_cylinder_is_read_along_its_own_axis() -> None:
    along = frame_of('type="cylinder" size="0.003 0.006" euler="90 0 0"', 2.0)
    across = frame_of('type="cylinder" size="0.003 0.006" euler="0 90 0"', 2.0)
    upright = frame_of('type="cylinder" size="0.003 0.002"', 1.0)
    assert np.abs(along.normalised - across.normalised).max() > 0.02
    assert np.abs(along.normalised - upright.normalised).max() > 0.02


def test_a_plane_presses_the_whole_top() -> None:
    model = scene(f'<body pos="0 0 1"><freejoint/>{quiet_body()}</body>', '<geom type="plane" size="1 1 1"/>')
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0, 0.0, StandInLight().points_mm[0, 2] / 1e3 - 3e-4, 0.0, 1.0, 0.0, 0.0
    mujoco.mj_forward(model, data)
    pad = quiet_pad(model)
    expected = pad._light.ratios(flat_imprint(np.full((1, 225), 0.3)))[0]
    np.testing.assert_allclose(pad.frame(data).normalised, expected, atol=5e-3)


def test_two_objects_press_by_the_larger_overlap() -> None:
    both = scene(quiet_body(), body_of('size="0.004"'), body_of('size="0.004"'))
    data, top_m = mujoco.MjData(both), StandInLight().points_mm[0, 2] / 1e3
    frames = []
    for places in ([(4, 8), (12, 8)], [(4, 8), (90, 8)], [(90, 8), (12, 8)]):
        for k, (x, y) in enumerate(places):
            data.qpos[7 * k : 7 * k + 3] = x / 1e3, y / 1e3, top_m + 3e-3
        mujoco.mj_forward(both, data)
        frames.append(quiet_pad(both).frame(data).normalised)
    np.testing.assert_allclose(frames[0], frames[1] * frames[2], atol=0.01)
    assert frames[0].min() < frames[1].min() + 0.05


def test_an_object_beside_the_map_of_light_is_told_once() -> None:
    press = Press(scene(quiet_body(), ball(radius_mm=0.4)), 0.0, 8.0)
    pad = quiet_pad(press.model)
    with pytest.warns(UserWarning, match="the geom ball touches the pad beside the area of the map of light"):
        frame = pad.frame(press.to(TIP_RADIUS_MM - 0.2))
    assert (frame.normalised == 1.0).all()


def test_a_shape_that_the_light_does_not_know_is_told_once() -> None:
    field = '<hfield name="hill" nrow="2" ncol="2" size="0.02 0.02 0.001 0.01" elevation="1 1 1 1"/>'
    model = scene(
        f'<body pos="0 0 1"><freejoint/>{quiet_body()}</body>',
        '<geom name="ground" type="hfield" hfield="hill"/>',
        assets=field,
    )
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0, 0.0, StandInLight().points_mm[0, 2] / 1e3 - 2e-4, 0.0, 1.0, 0.0, 0.0
    mujoco.mj_forward(model, data)
    assert data.ncon
    with pytest.warns(UserWarning, match=r"the geom ground \(hfield\) touches the pad"):
        assert (quiet_pad(model).frame(data).normalised == 1.0).all()
