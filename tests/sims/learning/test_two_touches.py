"""Two touches by a signal map, on signals known in closed form: slopes, starts, one or two, files, refusals."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.model_file import load_model, save_model
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.inference.together import Together
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA
from optopad.sims.learning.inference.two_touches import Touches, found_touches, require_two_touches, search_of
from optopad.sims.learning.together_fit import matched_to
from tests.sims.learning.made_up_map import (
    PAIRS,
    made_up_map_model,
    made_up_noise,
    ratios,
    untouched_counts,
)
from tests.sims.learning.made_up_models import made_up_kernel_ridge

RADIUS = 3.0


@cache
def model() -> SignalMapModel:
    together = Together(
        radius_mm=RADIUS,
        errors=np.array([1e-3, 0.01, 0.0]),
        floor_counts=np.full(PAIRS, 0.8),
        threshold=8.0,
        sigma=UNIT_SIGMA,
    )
    return replace(made_up_map_model(), together=together)


def presses(count: int, seed: int, apart_mm: tuple[float, float] = (6.5, 12.0)) -> FloatArray:
    """Two touches (n, 2, 3) in the workspace."""
    rng = np.random.default_rng(seed)
    found: list[FloatArray] = []
    while len(found) < count:
        angle, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*apart_mm)
        first = rng.uniform(7.0, 25.0, 2)
        second = first + away * np.array([np.cos(angle), np.sin(angle)])
        if (second > 7.0).all() and (second < 25.0).all():
            found.append(np.column_stack([[first, second], rng.uniform(0.5, 3.0, 2)]))
    return np.array(found)


def frames(touches: FloatArray, seed: int) -> FloatArray:
    """Noisy frames of touches (n, tip, 3), whose light is the product of their ratios."""
    rng, noise = np.random.default_rng(seed), made_up_noise()
    ratio = np.prod([ratios(touches[:, k]) for k in range(touches.shape[1])], axis=0)
    mean = ratio * untouched_counts()
    gains = rng.normal(size=(len(mean), 1, 16))
    return (
        mean
        + rng.normal(size=mean.shape) * np.sqrt(noise.variance(mean))
        + (gains @ noise.gain_columns(mean))[:, 0]
    )


def test_slopes_are_those_of_signals_and_of_the_overlap():
    search, press = search_of(model()), presses(12, 1, (5.0, 8.0)).reshape(12, 6)
    slopes = search.answers(press)[1]
    for axis, step in enumerate(1e-3 * np.eye(6)):
        change = (search.answers(press + step)[0] - search.answers(press - step)[0]) / 2e-3
        np.testing.assert_allclose(slopes[:, axis], change, atol=0.02 * np.abs(slopes[:, axis]).max())


def test_two_touches_are_found_where_they_are_and_their_deviations_are_honest():
    press = presses(100, 2)
    found = found_touches(model(), frames(press, 3))
    is_two = found.count == 2
    assert is_two.mean() > 0.97
    off = found.press_mm[is_two] - matched_to(press[is_two], found.press_mm[is_two])
    location = np.hypot(off[..., 0], off[..., 1])
    assert np.median(location) < 0.1
    assert np.quantile(location, 0.9) < 0.5
    assert (np.diff(found.press_mm[is_two, :, 2], axis=1) <= 0.0).all()  # the deeper first
    score = np.abs(off / found.sigma_mm[is_two])
    assert 0.4 < np.median(score) < 1.4  # 0.67 of a normal distribution
    assert found.force_n is not None
    assert (found.force_n[is_two] > 0.0).all()


def test_one_touch_is_called_one():
    found = found_touches(model(), frames(presses(150, 4)[:, :1], 5))
    assert (found.count == 1).mean() >= 0.99
    absent = np.arange(2) >= found.count[:, None]
    assert np.isnan(found.press_mm[absent]).all()
    assert np.isfinite(found.press_mm[~absent]).all()
    assert found.force_n is not None
    assert (found.force_n[absent] == 0.0).all()


def test_without_a_touch_the_model_of_one_touch_decides():
    signals = frames(presses(60, 4)[:, :1] * [1.0, 1.0, 0.0], 5)
    found = found_touches(model(), signals)
    np.testing.assert_array_equal(found.count > 0, model().predict(signals).is_touched)
    assert (found.count < 2).all()


def test_a_single_touch_is_the_one_that_the_model_of_one_touch_finds():
    signals = frames(presses(20, 6)[:, :1], 7)
    found, alone = found_touches(model(), signals), model().predict(signals)
    is_one = found.count == 1
    np.testing.assert_array_equal(found.press_mm[is_one, 0], alone.press_mm[is_one])
    np.testing.assert_array_equal(found.sigma_mm[is_one, 0], alone.sigma_mm[is_one])


def test_frames_are_answered_alone_as_they_are_together():
    signals = frames(presses(6, 8), 9)
    together = found_touches(model(), signals)
    each = [found_touches(model(), one[None]) for one in signals]
    assert together.count.tolist() == [int(one.count[0]) for one in each]
    np.testing.assert_allclose(together.press_mm, np.concatenate([one.press_mm for one in each]), atol=1e-3)
    assert isinstance(found_touches(model(), signals[:0]), Touches)


def test_a_file_keeps_what_is_known_of_two_touches(tmp_path: Path):
    save_model(tmp_path / "a.optomodel", model())
    read = require_two_touches(load_model(tmp_path / "a.optomodel"))
    signals = frames(presses(5, 10), 11)
    np.testing.assert_allclose(
        found_touches(read, signals).press_mm, found_touches(model(), signals).press_mm
    )
    save_model(tmp_path / "b.optomodel", made_up_map_model())
    with pytest.raises(InputError, match=r"trained for one touch.*--touches 2"):
        require_two_touches(load_model(tmp_path / "b.optomodel"))


def test_other_learners_are_refused():
    with pytest.raises(InputError, match=r"kernel-ridge knows one touch.*signal-map"):
        found_touches(made_up_kernel_ridge(), np.zeros((1, PAIRS)))
