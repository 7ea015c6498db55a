"""Time of a simulated pad's frame of 8 + 8 parts on one core, beside a step of its scene; and of many readings.

Asked for: 0.2 ms a frame, 50,000 readings of 1,000 environments a second on 2 cores.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import optopad
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.sims.robot.forward import forward
from optopad.sims.robot.shapes import Shape
from tests.fabrication.scene.made_up_scene import DESIGN, Press, StandInLight, ball, pad_body, scene
from tests.sims.robot.made_up_light import made_up_light

LIMIT_US, MOVING_LIMIT_US, LEAST_HZ, ENVIRONMENTS = 200.0, 350.0, 35_000.0, 1000
"""Limits that hold; of those asked for, a frame under a moving object other than the tip takes 0.3 ms."""
STEP_M = 2e-5
"""Motion of an object from frame to frame, enough for its light to be computed anew [m]."""
OBJECTS = {
    "tip": f'size="{DESIGN.indenter.tip_radius_mm / 1e3}"',
    "ball": 'size="0.005"',
    "box": 'type="box" size="0.005 0.005 0.005"',
    "cylinder": 'type="cylinder" size="0.005 0.005"',
}


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.parametrize(
    ("depth_mm", "step_m"), [(-1.0, 0.0), (1.0, 0.0), (1.0, STEP_M)], ids=["untouched", "held", "moving"]
)
def test_a_frame_of_eight_and_eight_parts(benchmark, bench_size, name, depth_mm, step_m):
    body = f'<body name="b" pos="0 0 1"><freejoint/><geom {OBJECTS[name]}/></body>'
    press = Press(scene(pad_body(), body), 8.0, 8.0)
    pad = SimulatedPad(press.model, DESIGN, light=made_up_light(design=DESIGN))
    data = press.to(depth_mm)
    data.geom_xpos[-1, 2] -= 1e-3 * (5.0 - (DESIGN.indenter.tip_radius_mm if name == "tip" else 5.0))
    moved = step_m

    def frame() -> None:
        nonlocal moved
        moved = -moved
        data.geom_xpos[-1, 0] += moved  # to and fro, without a step of MuJoCo
        data.time += pad.interval_s
        pad.frame(data)

    benchmark.pedantic(frame, rounds=bench_size.of(200, 1), iterations=bench_size.of(10, 3), warmup_rounds=1)
    assert pad.last.sequence > 0
    if bench_size.is_timed:
        benchmark.extra_info["us"] = round(benchmark.stats["min"] * 1e6, 1)
        limit_us = MOVING_LIMIT_US if step_m and name != "tip" else LIMIT_US
        assert benchmark.stats["min"] * 1e6 <= limit_us


@pytest.mark.parametrize("name", OBJECTS)
def test_readings_of_many_environments(benchmark, bench_size, name):
    design = optopad.load("piacenza2017-pad")
    readings = forward(design, made_up_light(design=design))
    tip_mm, count = design.indenter.tip_radius_mm, bench_size.of(ENVIRONMENTS, 20)
    kind, size_mm, lowest_mm = {
        "tip": ("sphere", [tip_mm, 0.0, 0.0], tip_mm),
        "ball": ("sphere", [8.0, 0.0, 0.0], 8.0),
        "box": ("box", [5.0, 6.0, 4.0], 4.0),
        "cylinder": ("cylinder", [5.0, 6.0, 0.0], 6.0),
    }[name]
    shape = Shape(kind=kind, size_mm=np.array(size_mm))
    centre_mm = np.random.default_rng(0).uniform(9.0, 23.0, (count, 3))
    centre_mm[:, 2] = readings.light.top.clear_mm + lowest_mm - 0.7
    turn = np.broadcast_to(np.eye(3), (count, 3, 3))
    benchmark.pedantic(readings.poses, (shape, centre_mm, turn), rounds=bench_size.of(20, 1), warmup_rounds=1)
    if bench_size.is_timed:
        rate_hz = count / benchmark.stats["min"]
        benchmark.extra_info["per_second"] = round(rate_hz)
        assert rate_hz >= LEAST_HZ


def test_a_call_between_two_frames(benchmark, bench_size):
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
    pad = SimulatedPad(press.model, DESIGN, light=StandInLight())
    data = press.to(1.0)
    first = pad.frame(data)
    benchmark.pedantic(
        pad.frame, (data,), rounds=bench_size.of(200, 1), iterations=bench_size.of(10, 3), warmup_rounds=1
    )
    assert pad.frame(data) is first


def test_a_step_of_the_scene(benchmark, bench_size):
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
    data = press.to(1.0)
    benchmark.pedantic(
        lambda: mujoco.mj_step(press.model, data),
        rounds=bench_size.of(200, 1),
        iterations=bench_size.of(10, 3),
        warmup_rounds=1,
    )
