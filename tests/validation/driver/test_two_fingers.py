"""Two fingers that pass each other on the paper's pad, through port, driver and a trained model."""

from __future__ import annotations

import numpy as np
import pytest

from tests.validation.driver.two_fingers import DEPTH_MM, NEAREST_MM, crossing, prepared, tracked


@pytest.mark.full
def test_fingers_that_almost_touch_each_other_keep_their_tracks() -> None:
    path = crossing()
    touches = prepared().read(path)
    tips = path.at(np.array([touch.frame.device_us / 1e6 for touch in touches]))
    both = (tips[..., 2] > 0.9 * DEPTH_MM).all(axis=1)
    found = [touch for touch, is_both in zip(touches, both.tolist(), strict=True) if is_both]
    assert len(found) > 60
    assert np.mean([len(touch.contacts) == 2 for touch in found]) > 0.95
    _, number, place = tracked(found)
    assert set(number) == {1, 2}
    assert (
        len({(int(one), y > 16.0) for one, y in zip(number, place[:, 1], strict=True)}) == 2
    )  # none is exchanged
    off_mm = np.abs(np.abs(place[:, 1] - 16.0) - NEAREST_MM / 2)
    assert np.quantile(off_mm, 0.9) < 0.3
