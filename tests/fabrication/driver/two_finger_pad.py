"""A pad in closed form under two fingers: its simulated board, its model of two touches, and frames without a port."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from optopad.fabrication.driver.descriptor import descriptor_of
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.simulated.board import FakeBoard
from optopad.fabrication.driver.simulated.finger import Finger
from optopad.sims.learning.inference.signal_map import SignalMapModel
from optopad.sims.learning.inference.together import Together
from optopad.sims.learning.inference.touch_model import UNIT_SIGMA
from tests.fabrication.driver.made_up_model import header
from tests.fabrication.driver.made_up_pad import pad_config
from tests.sims.learning.made_up_map import (
    COUNT,
    made_up_map_model,
    ratios,
    untouched_counts,
)

RADIUS_MM = 2.0


class ClosedLight:
    """The table of the simulated board, in closed form; two fingers multiply, as in the model."""

    knows_presses = True
    untouched = untouched_counts().reshape(COUNT, COUNT)

    def together(self, tips: np.ndarray) -> np.ndarray:
        """Signals under several tips [counts]."""
        return np.asarray(self.untouched * ratios(tips).prod(axis=0).reshape(COUNT, COUNT))


@cache
def two_touch_model() -> SignalMapModel:
    """A map of the closed light."""
    model = made_up_map_model()
    together = Together(
        radius_mm=RADIUS_MM,
        errors=np.full(3, 1e-3),
        floor_counts=model.noise.floor_counts,
        threshold=12.0,
        sigma=UNIT_SIGMA,
    )
    curve = model.header.force_curve
    own = header(kind="signal-map", untouched_counts=untouched_counts(), force_curve=curve)
    return replace(model, header=own, together=together)


def board_of(path: Finger, **options: Any) -> FakeBoard:
    """A simulated board of this pad."""
    return FakeBoard(pad_config(), ClosedLight(), path, **options)  # type: ignore[arg-type]


class PlainSensor:
    """Frames of a simulated board at a steady rate, without a port and without waiting."""

    now_s = 0.0

    def __init__(self, board: FakeBoard, rate_hz: float, waiting: int = 8) -> None:
        self.board, self.rate_hz, self.waiting = board, rate_hz, waiting
        self.descriptor, self._read = descriptor_of(pad_config()), 0

    def new_frames(self, seconds: float, least: int) -> list[Frame]:
        """The next frames."""
        return list(self.frames(max(least, round(seconds * self.rate_hz)), None))

    def frames(self, count: int | None, seconds: float | None) -> Iterator[Frame]:
        """The next frames, up to a number or a time of the board."""
        end = self._read + (count or round((seconds or 0.0) * self.rate_hz))
        while self._read < end:
            counts = self.board.counts(self._read / self.rate_hz)
            yield Frame(
                connection=1,
                sequence=self._read,
                device_us=round(1e6 * self._read / self.rate_hz),
                host_s=0.0,
                lost_before=0,
                counts=counts,
                signals=counts[:-1].astype(np.int32) - counts[-1],
                saturated=counts >= 1023,
            )
            self._read += 1
