"""Recordings of a made-up build: presses through all depths, gains and reference depths of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from optopad.design.recordings import SetEntry
from optopad.sims.readings.press_data import PressData
from tests.sims.learning.made_up_map import COUNT, EMITTERS, RECEIVERS, made_up_noise

DEPTHS_MM = np.concatenate([[-2.0, -1.5, -1.0, -0.5], np.arange(0.0, 5.01, 0.25)])


def made_up_data(
    light: Callable[[np.ndarray], np.ndarray],
    presses: int,
    seed: int,
    zero_mm: np.ndarray,
    *,
    full_scale: float = 4095.0,
    gain: float = 1e5,
    places: np.ndarray | None = None,
) -> tuple[PressData, np.ndarray]:
    """Data of presses at random places, if none are given, and the gains (pair,) behind them."""
    chance = np.random.default_rng(seed)
    gains = gain * np.exp(0.1 * chance.normal(size=(COUNT, 1)) + 0.1 * chance.normal(size=(1, COUNT))).ravel()
    places = chance.uniform(7.0, 25.0, size=(presses, 2)) if places is None else places
    reported, signals, number = [], [], []
    for press, (place, zero) in enumerate(zip(places, zero_mm, strict=True)):
        at = np.column_stack([np.tile(place, (len(DEPTHS_MM), 1)), DEPTHS_MM])
        reported.append(at)
        signals.append(light(at + np.array([0.0, 0.0, zero])) * gains)
        number.append(np.full(len(at), press))
    mean = np.concatenate(signals)
    noise = made_up_noise()
    mean = mean + chance.normal(size=mean.shape) * np.sqrt(noise.variance(mean))
    lit = np.clip(mean + 2.0, 0.0, full_scale).reshape(-1, COUNT, COUNT)
    counts = np.concatenate([lit, np.full((len(lit), 1, COUNT), 2.0)], axis=1)
    data = PressData(
        counts=counts.astype(np.float32),
        press_mm=np.concatenate(reported),
        time_s=np.arange(len(counts), dtype=np.float64),
        set_number=np.zeros(len(counts), dtype=np.int64),
        place_number=np.concatenate(number),
        sets=(SetEntry(name="measured", role="train", pattern="measured", is_ambient=False),),
        state_names=(*EMITTERS, "off"),
        receiver_names=RECEIVERS,
        full_scale_counts=full_scale,
        design_digest="cd" * 32,
        attributes={},
        true_press_mm=None,
    )
    return data, gains
