"""A simulated pad that is read like a port: by recordings, LeRobot, the messages of ROS 2 and trained models."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

import optopad
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.observations import AGE, Observations
from optopad.fabrication.driver.recording.lerobot import SIGNALS, write_lerobot
from optopad.fabrication.driver.recording.mcap_file import frame_message
from optopad.fabrication.driver.ros_fields import touch_message
from optopad.fabrication.driver.touch_reader import TouchReader
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.fabrication.scene.simulated_sensor import SimulatedSensor
from optopad.sims.learning.inference.header import ModelHeader
from optopad.sims.learning.inference.kernel_ridge import KernelRidgeModel
from optopad.sims.learning.inference.touch_model import FeatureScaling, TouchSvm
from optopad.sims.robot.shapes import Shape
from tests.fabrication.scene.made_up_scene import (
    DESIGN,
    TIP_RADIUS_MM,
    Press,
    StandInLight,
    ball,
    pad_body,
    scene,
)

PLACE_MM = (6.0, 9.0)


class Scripted(Press):
    """A ball that is down for a second, from 1 s on, 1 mm deep; `advance` is a user's own function to step."""

    def advance(self) -> None:
        after_s = self.data.time + self.model.opt.timestep
        self.step(1.0 if 1.0 <= after_s % 3.0 < 2.0 else -1.0)


def scripted(*names: str, design: SensorDesign = DESIGN) -> Scripted:
    prefixes = [f"{name}_" for name in names] or [""]
    bodies = [pad_body(prefix, 0.05 * place, design) for place, prefix in enumerate(prefixes)]
    return Scripted(scene(*bodies, ball(), step_s=0.004), *PLACE_MM)


@cache
def ball_model() -> KernelRidgeModel:
    """A kernel-ridge model, solved here, of the ball on the pad with the stand-in for its light."""
    light, rng = StandInLight(), np.random.default_rng(5)
    presses = np.column_stack([rng.uniform(3, 13, (600, 2)), rng.uniform(0.1, 1.5, 600)])
    tip = Shape(kind="sphere", size_mm=np.array([TIP_RADIUS_MM, 0.0, 0.0]))
    top = light.points_mm[0, 2] + TIP_RADIUS_MM
    centre = np.column_stack([presses[:, :2], top - presses[:, 2]])
    ratios = light.ratios(light.imprint(tip, centre, np.broadcast_to(np.eye(3), (600, 3, 3))))
    untouched = SimulatedPad(scene(pad_body()), DESIGN, light=light).baseline
    assert untouched is not None
    signals = (ratios * untouched).reshape(600, -1)
    config = SimulatedPad(scene(pad_body()), DESIGN, light=light).config
    scaling = FeatureScaling(kept=np.arange(64), centre=untouched.ravel(), scale=np.full(64, 20.0))
    features = scaling.features(signals)
    distance = np.array([np.abs(features - one).sum(axis=1) for one in features])
    mean_mm = presses.mean(axis=0)
    gamma = 0.01
    loss = FeatureScaling(kept=np.arange(64), centre=untouched.ravel(), scale=untouched.ravel())
    return KernelRidgeModel(
        header=ModelHeader(
            kind="kernel-ridge",
            design_digest=config.digest,
            emitter_names=tuple(part.name for part in config.emitters),
            receiver_names=tuple(part.name for part in config.receivers),
            untouched_counts=untouched.ravel(),
        ),
        touch=TouchSvm(scaling=loss, weights=np.full(64, -100.0 / 64), bias=-0.5),
        scaling=scaling,
        samples=features.astype(np.float32),
        weights=np.linalg.solve(np.exp(-gamma * distance) + 0.1 * np.eye(600), presses - mean_mm),
        mean_mm=mean_mm,
        gamma=gamma,
    )


def pad(model: mujoco.MjModel, name: str = "", design: SensorDesign = DESIGN, seed: int = 0) -> SimulatedPad:
    return SimulatedPad(model, design, name, light=StandInLight(design), seed=seed)


@pytest.mark.parametrize("suffix", [".optorec", ".mcap"])
@pytest.mark.parametrize("dark", ["frame", "each"])
def test_a_recording_holds_the_frames_that_were_read(suffix: str, dark: str, tmp_path: Path) -> None:
    design = DESIGN.with_(**{"board.dark": dark})
    press = scripted(design=design)
    sensor = SimulatedSensor(pad(press.model, design=design), press.data, press.advance)
    with sensor, sensor.record(tmp_path / f"press{suffix}"):
        frames = list(sensor.frames(seconds=2.0))
    recorded = optopad.read_recording(tmp_path / f"press{suffix}")
    assert len(frames) == 120  # the first one begins at 0, the last one is delivered by 2 s
    assert recorded.config.digest == design.digest
    assert recorded.is_whole
    np.testing.assert_array_equal(recorded.counts, [one.counts for one in frames])
    np.testing.assert_array_equal(recorded.sequence, [one.sequence for one in frames])
    np.testing.assert_allclose(recorded.device_s, [one.device_us / 1e6 for one in frames])
    np.testing.assert_allclose(recorded.host_s, [one.host_s for one in frames])


def test_a_lerobot_data_set_and_a_robot_s_steps_have_the_press(tmp_path: Path) -> None:
    press = scripted()
    sensor = SimulatedSensor(pad(press.model), press.data, press.advance)
    with sensor, sensor.record(tmp_path / "press.optorec"):
        observations, steps = Observations(sensor, fps=25), []
        while press.data.time < 2.0:
            for _ in range(10):
                press.advance()
            steps.append(observations.step())
            assert 0.0 <= steps[-1][AGE][0] < sensor.pad.interval_s
    signals = np.array([one[SIGNALS] for one in steps])
    untouched, touched = signals[3:22].mean(axis=0), signals[28:47].mean(axis=0)
    assert (touched / untouched).min() < 0.95
    written = write_lerobot(
        optopad.read_recording(tmp_path / "press.optorec"), tmp_path / "set", fps=25, task="press"
    )
    assert written.steps == pytest.approx(len(steps), abs=1)


def test_a_trained_model_reads_the_ball_where_it_is() -> None:
    press = scripted()
    sensor = SimulatedSensor(pad(press.model), press.data, press.advance)
    touches = list(TouchReader(sensor, ball_model()).touches(seconds=1.9))
    held = [one for one in touches if 1.2 < one.frame.began_s < 1.9]
    assert all(one.is_touched for one in held)
    assert not any(one.is_touched for one in touches if one.frame.began_s < 0.98)
    presses_mm = np.array([one.press_mm for one in held])
    np.testing.assert_allclose(presses_mm.mean(axis=0)[:2], PLACE_MM, atol=0.5)
    np.testing.assert_allclose(presses_mm[:, 2], 1.0, atol=0.1)
    assert max(one.latency_ms for one in touches) <= 4.0 + 1e-6  # one step of the simulation


def test_a_pad_gives_the_touch_of_its_latest_frame() -> None:
    press = scripted()
    one = SimulatedPad(press.model, DESIGN, light=StandInLight(), touch_model=ball_model())
    while press.data.time < 1.5:
        press.advance()
        touch = one.touch(press.data)
        assert touch.frame is one.frame(press.data)
    assert one.touch(press.data) is touch
    assert touch.is_touched
    assert touch.press_mm[2] == pytest.approx(1.0, abs=0.1)
    message = touch_message(touch, "pad", dict)  # type: ignore[arg-type]
    assert message["header"]["stamp"] == frame_message(touch.frame, "pad")["header"]["stamp"]
    with pytest.raises(InputError, match="touch_model: is None"):
        pad(press.model).touch(press.data)


def test_two_pads_share_the_steps_of_a_simulation() -> None:
    press = scripted("left", "right")
    left = SimulatedSensor(pad(press.model, "left"), press.data, press.advance)
    right = SimulatedSensor(pad(press.model, "right", seed=1), press.data, beside=left)
    seen = list(left.frames(count=60))
    assert right.waiting == 60
    other = [right.read() for _ in range(60)]
    assert press.data.time == seen[-1].host_s or press.data.time - seen[-1].host_s < 0.004
    assert [one.began_s for one in seen] == [one.began_s for one in other]
    assert right.waiting == 0
    right.read()  # which advances the simulation for both
    assert left.waiting == 1


def test_frames_that_a_program_s_own_steps_deliver_are_waiting() -> None:
    press = scripted()
    sensor = SimulatedSensor(pad(press.model), press.data)
    for _ in range(100):
        press.advance()
    assert sensor.waiting == int((0.4 - sensor.pad.delay_s) / sensor.pad.interval_s) + 1
    assert press.data.time == pytest.approx(0.4)


def test_a_baseline_is_renewed_from_the_simulation() -> None:
    press = scripted()
    sensor = SimulatedSensor(pad(press.model), press.data, press.advance)
    before = sensor.baseline
    after = sensor.take_baseline(0.5)
    assert before is not None
    np.testing.assert_allclose(after, before, rtol=0.01)
    frame: Frame = sensor.read()
    assert frame.baseline is after


def test_sensors_that_cannot_share_a_simulation_are_refused() -> None:
    press = scripted("left", "right")
    left = SimulatedSensor(pad(press.model, "left"), press.data)
    with pytest.raises(InputError, match="reads the pad 'left' already"):
        SimulatedSensor(pad(press.model, "left"), press.data, beside=left)
    with pytest.raises(InputError, match="has other data"):
        SimulatedSensor(pad(press.model, "right"), mujoco.MjData(press.model), beside=left)
    with pytest.raises(InputError, match="given along with beside"):
        SimulatedSensor(pad(press.model, "right"), press.data, press.advance, beside=left)
    with pytest.raises(InputError, match="did not advance"):
        list(SimulatedSensor(pad(press.model, "right"), press.data, lambda: None).frames(count=2))
