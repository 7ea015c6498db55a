"""Time of a simulated pad's frame of 8 + 8 parts on one core, next to that of a step of its scene."""

from __future__ import annotations

import mujoco
import pytest

from optopad.fabrication.scene.simulated_pad import SimulatedPad
from tests.fabrication.scene.made_up_scene import DESIGN, Press, StandInLight, ball, pad_body, scene

LIMIT_US = 200.0
"""Longest time for a frame of 8 + 8 parts under a ball [us]."""


@pytest.mark.parametrize(
    ("depth_mm", "step_m"), [(-1.0, 0.0), (1.0, 0.0), (1.0, 2e-5)], ids=["untouched", "held", "moving"]
)
def test_a_frame_of_eight_and_eight_parts(benchmark, bench_size, depth_mm, step_m):
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
    pad = SimulatedPad(press.model, DESIGN, light=StandInLight())
    data = press.to(depth_mm)
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
        assert benchmark.stats["min"] * 1e6 <= LIMIT_US


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
