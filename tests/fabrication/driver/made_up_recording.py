"""Recordings of the made-up pad under presses at known times, without a board."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from optopad.fabrication.driver.link.protocol import frame_format, pack_frames
from optopad.fabrication.driver.recording.recorder import Recorder
from tests.fabrication.driver.made_up_pad import pad_config, press_table

BEGUN_S = 1_780_000_000.0
RATE_HZ = 60.0
HOVER_MM = -5.0


def tip_path(seed: int = 1, presses: int = 6, *, rhythm_s: float | None = None) -> np.ndarray:
    """(row, 4) time [s], x, y, depth [mm] of a stage that presses here and there; rows where it turns.

    rhythm_s : time from press to press; None lets the way to the next place take as long as it is
    """
    rng = np.random.default_rng(seed)
    now, x, y = 2.0, 16.0, 16.0
    rows = [(0.0, x, y, HOVER_MM), (now, x, y, HOVER_MM)]
    for _ in range(presses):
        begun = now
        to_x, to_y = rng.uniform(6.0, 26.0, 2)
        now += 0.3 + np.hypot(to_x - x, to_y - y) / 10.0
        x, y = to_x, to_y
        depth = rng.uniform(1.0, 4.0) if rhythm_s is None else 3.0
        steps = [(0.8, depth), (1.0, depth), (0.8, HOVER_MM)]
        if rhythm_s is not None:
            now = begun + 0.5
            steps.append((rhythm_s - 3.1, HOVER_MM))
        rows.append((now, x, y, HOVER_MM))
        for seconds, to in steps:
            now += seconds
            rows.append((now, x, y, to))
    return np.array([*rows, (now + 1.0, x, y, HOVER_MM)])


def positions(path: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """(n, 3) x, y, depth at times [mm]."""
    return np.stack([np.interp(time_s, path[:, 0], axis) for axis in path[:, 1:].T], axis=1)


def write_recording(
    file: Path,
    path: np.ndarray,
    *,
    gain_per_s: float | np.ndarray = 0.0,
    seed: int = 0,
    pause_s: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """Record the path from `BEGUN_S` on; (frame, 3) where the tip was [mm].

    pause_s : begin and end of a time in which nobody read the port; its frames are read at its end
    """
    rng = np.random.default_rng(seed)
    config = pad_config()
    time_s = np.arange(0.0, path[-1, 0], 1.0 / RATE_HZ)
    truth = positions(path, time_s)
    light = press_table().at(truth) * (1.0 + np.multiply.outer(time_s, np.broadcast_to(gain_per_s, (8, 8))))
    light *= 1.0 + 0.002 * rng.standard_normal((len(light), light.shape[1], 1))
    counts = np.concatenate([light, np.zeros((len(light), 1, light.shape[2]))], axis=1) + 2.0
    counts = np.clip(np.round(counts + 0.5 * rng.standard_normal(counts.shape)), 0, 1023).astype(int)
    messages = pack_frames(frame_format(config), range(len(time_s)), np.round(time_s * 1e6), counts)
    with Recorder(file, config) as recorder:
        for moment, message in zip(time_s, messages, strict=True):
            came_s = pause_s[1] if pause_s[0] <= moment < pause_s[1] else moment
            recorder.frame(message, BEGUN_S + came_s)
    return truth


def write_log(file: Path, path: np.ndarray, *, late_s: float = 0.0, every_s: float = 0.05) -> None:
    """A log of the path with a row every so often, by a clock that is ahead of the recording's by `late_s`."""
    time_s = np.arange(0.0, path[-1, 0] + every_s, every_s)
    rows = np.column_stack([BEGUN_S + late_s + time_s, positions(path, time_s)])
    lines = [f"{t:.3f},{x:.4f},{y:.4f},{depth:.4f}" for t, x, y, depth in rows]
    file.write_text("\n".join(["time_s,x_mm,y_mm,depth_mm", *lines]) + "\n")
