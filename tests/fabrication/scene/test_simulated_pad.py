"""Frames of a simulated pad: those that its board would have delivered by then, of the objects that touch it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.sims.readings.signal_chain import without_noise
from tests.fabrication.scene.made_up_scene import DESIGN, Press, StandInLight, ball, pad_body, scene

QUIET = without_noise(DESIGN)
"""The design without noise: counts are gain times light."""


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


@pytest.mark.parametrize("step_s", [0.001, 0.004, 0.03])
def test_each_pair_has_the_light_of_its_own_conversion(step_s: float) -> None:
    """The light falls evenly in time, and so does that of each pair between the calls, whatever their interval."""

    class Even(StandInLight):
        def ratios(self, overlap_mm: np.ndarray) -> np.ndarray:
            return np.broadcast_to(
                (1.0 - 0.2 * overlap_mm.max(axis=1))[:, None, None], (len(overlap_mm), 8, 8)
            )

    light = Even(QUIET)
    node = light.points_mm[112]
    press = Press(scene(pad_body(), ball(), step_s=step_s), node[0], node[1])
    pad = SimulatedPad(press.model, QUIET, light=light)
    pad.frame(press.to(1e-9))
    while press.data.time < 0.2:
        frame = pad.frame(press.step(5.0 * (press.data.time + step_s)))
    at_s = frame.began_s + pad._chain.read_at_s[:-1]
    exact = light.untouched * pad._chain.gains * (1.0 - 0.2 * 5.0 * at_s)
    assert np.ptp(5.0 * at_s) > 0.015
    assert np.abs(frame.signals - exact).max() <= 0.5 + 1e-6


def test_a_pad_reads_the_same_wherever_it_is_mounted() -> None:
    press = Press(scene(pad_body(), ball()), 6.0, 9.0)
    here = quiet_pad(press.model).frame(press.to(0.7))
    model = scene(f'<body pos="0.3 -0.2 0.5" euler="30 -120 70">{pad_body("left_")}</body>', ball())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axes, origin = data.site("left_pad_cavity").xmat.reshape(3, 3), data.site("left_pad_cavity").xpos
    data.qpos[:3] = origin + axes @ press.data.qpos[:3]
    mujoco.mj_forward(model, data)
    there = quiet_pad(model, "left").frame(data)
    assert here.normalised.min() < 0.96
    assert np.abs(there.counts.astype(int) - here.counts.astype(int)).max() <= 1


def test_two_pads_of_one_model_see_their_own_objects() -> None:
    press = Press(scene(pad_body("left_"), pad_body("right_", 0.05), ball()), 8.0, 8.0, at_m=0.05)
    left, right = quiet_pad(press.model, "left"), quiet_pad(press.model, "right")
    data = press.to(0.5)
    assert left.frame(data).normalised.min() == 1.0
    assert right.frame(data).normalised.min() < 0.96


def test_a_reset_of_the_scene_starts_the_board_again() -> None:
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
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
    model = scene(pad_body("left_"), pad_body("right_", 0.05))
    with pytest.raises(InputError, match=r"no pad 'middle' .*middle_pad_top.*: 'left', 'right'"):
        quiet_pad(model, "middle")
    with pytest.raises(InputError, match="optopad scene DESIGN --out"):
        quiet_pad(scene(ball()))


def test_light_of_another_design_is_refused() -> None:
    with pytest.raises(InputError, match="light: of design"):
        SimulatedPad(scene(pad_body()), DESIGN, light=StandInLight(QUIET))


def test_an_object_deeper_than_the_map_of_light_counts_as_that_deep_and_is_told_once() -> None:
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
    shallow = SimulatedPad(press.model, QUIET, light=StandInLight(QUIET, deepest_mm=1.0))
    with pytest.warns(UserWarning, match=r"1\.\d\d mm deep, and the map of light ends at 1\.00 mm"):
        shallow.frame(press.step(1.5))
    for _ in range(20):
        deep = shallow.frame(press.step(1.5))  # a second warning would be an error
    unlimited = quiet_pad(press.model).frame(press.to(1.5))
    assert unlimited.normalised.min() < deep.normalised.min() < 1.0
