"""What gains of parts explain of a change: all of a gain, little of a press."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from optopad.fabrication.driver.drift import GAIN_SHARE, HELD_EXCESS, SHORT_S
from optopad.fabrication.driver.gain_pattern import GainPattern, relative_change
from optopad.sensor import driver_source, press_table

LEVELS = np.random.default_rng(2).uniform(50, 800, (8, 8))
NOISE = np.hypot(0.76, 0.002 * LEVELS)
"""Of one frame: reading and dark reading at 0.5 counts and rounding, and 0.2 % of light."""


def test_gains_of_parts_are_explained_whole() -> None:
    rng = np.random.default_rng(3)
    pattern = GainPattern(LEVELS, NOISE)
    emitter, receiver = rng.uniform(-0.1, 0.1, (8, 1)), rng.uniform(-0.1, 0.1, 8)
    change = (emitter + receiver).reshape(1, -1)
    assert pattern.freedom == 64 - 15
    assert pattern.gain_change(change) == pytest.approx(change, abs=1e-12)
    assert pattern.excess(change) == pytest.approx(0.0, abs=1e-12)
    product = ((1 + emitter) * (1 + receiver) - 1).reshape(1, -1)
    assert np.abs(pattern.gain_change(product) - product).max() < 0.1**2  # second order of gains up to 10 %


def test_noise_alone_has_an_excess_of_one() -> None:
    frames = LEVELS + NOISE * np.random.default_rng(4).standard_normal((4000, 8, 8))
    excess = GainPattern(LEVELS, NOISE).excess(relative_change(frames.reshape(4000, -1), LEVELS.ravel()))
    assert excess.mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / 49 / 4000))
    assert excess.std() == pytest.approx(np.sqrt(2 / 49), rel=0.1)


def test_pairs_that_tell_no_ratio_are_left_out() -> None:
    levels = LEVELS.copy()
    levels[0, 0], levels[3, 4] = 2.0, 1023.0
    pattern = GainPattern(levels, NOISE, full_scale=1003.0)
    assert (~pattern.used).nonzero()[0].tolist() == [0, 28]
    change = np.zeros((1, 64))
    change[0, [0, 28]] = 5.0
    assert pattern.excess(change) == 0.0


@pytest.mark.slow
def test_gains_explain_no_press_of_the_published_pad(tmp_path: Path) -> None:
    source = driver_source("piacenza2017-pad", None, tmp_path)
    _, table = press_table(source, seed=0, on_step=lambda *_: None)
    signals = np.minimum(table.counts, 1023.0)
    flat = table.untouched
    noise = np.hypot(0.76, 0.002 * flat)
    pattern = GainPattern(np.minimum(flat, 1023.0), noise, 0.98 * 1023)
    change = relative_change(signals[:, :, 1:].reshape(-1, 64), np.minimum(flat, 1023.0).ravel())
    rest = (pattern.rest(change) ** 2).sum(axis=1)
    whole = ((change / pattern.sigma)[:, pattern.used] ** 2).sum(axis=1)
    explained = 1 - rest / whole
    print(f"explained: {explained.max():.2f} at most, {np.median(explained):.2f} in the middle")
    assert explained.max() < 0.8 < GAIN_SHARE
    # Averaged over 0.2 s at 60 Hz the noise square is 1 / (2 x 0.2 x 60) of a frame's; just after the start that of
    # the levels, a mean of 30 frames, comes to it. The table's depths are 0.1, 0.25, 0.5 mm, ...
    excess = pattern.excess(change).reshape(-1, len(table.depth_mm) - 1) / (1 / (2 * SHORT_S * 60) + 1 / 30)
    print(
        f"excess over the noise's: {excess.min(axis=0)} at least by depth, {np.median(excess[:, 0]):.0f} in the middle"
    )
    assert excess[:, 1:].min() > 5 * HELD_EXCESS
    assert np.mean(1 + excess[:, 0] > HELD_EXCESS) > 0.9
