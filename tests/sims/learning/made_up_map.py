"""A pad that exists on paper: smooth signals of 8 x 8 pairs over place and depth, in closed form.

Ratio of a pair to its untouched signal: 1 - exp(-(distance to its chord / 3 mm)²) (1 - exp(-depth / 1.5 mm)) 0.9, for
chords between parts that alternate around a 32 x 32 mm pad, two of each a wall.
"""

from __future__ import annotations

import numpy as np

from optopad.design.shape.outline import rectangle
from optopad.sims.learning.inference.header import ForceCurve, ModelHeader
from optopad.sims.learning.inference.signal_map import Box, ReadingNoise, SignalMapModel
from optopad.sims.learning.traced_map import SignalMap

SIDE_MM = 32.0
COUNT = 8
EMITTERS = tuple(f"E{number}" for number in range(1, COUNT + 1))
RECEIVERS = tuple(f"R{number}" for number in range(1, COUNT + 1))
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
EMITTER_MM = np.concatenate(
    [np.array([[4.0, 0.0], [20.0, 0.0]]) @ np.linalg.matrix_power(TURN, k).T for k in range(4)]
)
EMITTER_MM += np.repeat([[0.0, 0.0], [32.0, 0.0], [32.0, 32.0], [0.0, 32.0]], 2, axis=0)
RECEIVER_MM = SIDE_MM - EMITTER_MM[:, ::-1]
WORKSPACE = rectangle((6.0, 6.0, 26.0, 26.0))
DEEPEST_MM = 5.0
PAIRS = COUNT * COUNT


def ratios(press_mm: np.ndarray) -> np.ndarray:
    """(n, 64) signal over untouched signal."""
    start = np.repeat(EMITTER_MM, COUNT, axis=0)
    along = np.tile(RECEIVER_MM, (COUNT, 1)) - start
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    to_press = press_mm[:, None, :2] - start
    distance = along[:, 0] * to_press[..., 1] - along[:, 1] * to_press[..., 0]
    depth = np.maximum(press_mm[:, 2:], 0.0)
    return 1.0 - 0.9 * np.exp(-((distance / 3.0) ** 2)) * (1.0 - np.exp(-depth / 1.5))


def untouched_counts() -> np.ndarray:
    return np.linspace(60.0, 600.0, PAIRS)


def made_up_signal_map(pitch_mm: float = 1.0, depths: int = 13) -> SignalMap:
    x_mm = np.linspace(5.0, 27.0, round(22.0 / pitch_mm) + 1)
    root = np.linspace(0.0, np.sqrt(5.1), depths)
    x, y, s = np.meshgrid(x_mm, x_mm, root, indexing="ij")
    presses = np.stack([x.ravel(), y.ravel(), s.ravel() ** 2], axis=1)
    flux = ratios(presses) * untouched_counts() * 1e-5
    return SignalMap(
        x_mm=x_mm,
        y_mm=x_mm,
        root_depth=root,
        flux=flux.reshape(*x.shape, COUNT, COUNT),
        workspace=WORKSPACE,
        digest="cd" * 32,
        accuracy="draft",
        seed=0,
        error=np.full(PAIRS, 1e-4),
    )


def made_up_noise(**changes) -> ReadingNoise:
    values = {
        "floor_counts": np.full(PAIRS, 0.8),
        "shot": 0.01,
        "relative": 0.002,
        "emitter_drift": 0.002,
        "receiver_drift": 0.002,
        "emitters": COUNT,
        "clip_counts": np.full(PAIRS, 1023.0),
    }
    return ReadingNoise(**(values | changes))


def made_up_map_model(noise: ReadingNoise | None = None) -> SignalMapModel:
    return SignalMapModel(
        header=ModelHeader(
            kind="signal-map",
            design_digest="cd" * 32,
            emitter_names=EMITTERS,
            receiver_names=RECEIVERS,
            untouched_counts=untouched_counts(),
            force_curve=ForceCurve(depth_mm=(0.0, 1.0, 5.0), force_n=(0.0, 4.0, 36.0)),
        ),
        ratio_root=made_up_signal_map().ratio_root,
        full_counts=untouched_counts(),
        noise=noise or made_up_noise(),
        box=Box(low=np.array([6.0, 6.0, 0.0]), high=np.array([26.0, 26.0, DEEPEST_MM])),
        threshold=6.0,
    )


def random_presses(count: int, seed: int, depth_mm: tuple[float, float] = (0.5, 4.5)) -> np.ndarray:
    chance = np.random.default_rng(seed)
    place = chance.uniform(7.0, 25.0, size=(count, 2))
    return np.column_stack([place, chance.uniform(*depth_mm, size=count)])


def noisy_signals(press_mm: np.ndarray, noise: ReadingNoise, seed: int) -> np.ndarray:
    """Frames by the noise's own model, gains drawn anew for every frame."""
    chance = np.random.default_rng(seed)
    mean = ratios(press_mm) * untouched_counts()
    own = chance.normal(size=mean.shape) * np.sqrt(noise.variance(mean))
    gains = chance.normal(size=(len(mean), 2 * COUNT))
    return mean + own + (gains[:, None, :] @ noise.gain_columns(mean))[:, 0]
