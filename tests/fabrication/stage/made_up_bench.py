"""A simulated printer over a simulated board with the made-up pad: a whole bench without hardware."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from optopad.fabrication.stage.fake_printer import FakePrinter, TipFinger
from optopad.fabrication.stage.gcode_stage import GcodeStage
from optopad.fabrication.stage.stage import limits_of
from tests.fabrication.driver.made_up_pad import board, pad_config

CONFIG = replace(pad_config(), board=replace(pad_config().board, boot_s=0.2))
LIMITS = limits_of(CONFIG.workspace)
MIDDLE = (16.0, 16.0, 0.0)


class WatchedPrinter(FakePrinter):
    """Notes every ride: where it began and ended, in the cavity frame."""

    def __init__(self, *arguments: object, **options: object) -> None:
        self.rides: list[tuple[np.ndarray, np.ndarray]] = []
        super().__init__(*arguments, **options)  # type: ignore[arg-type]

    def _travel(self, target: np.ndarray, now_s: float) -> None:
        flip = np.array([1.0, 1.0, -1.0])
        self.rides.append((self._ride.end * flip, target * flip))
        super()._travel(target, now_s)

    def here_mm(self) -> np.ndarray:
        """(3,) where the tip is now."""
        return self.tip_mm(time.monotonic())


@dataclass
class Bench:
    """Ports of a bench."""

    printer: WatchedPrinter
    stage_port: FakePort
    board_port: FakePort | None

    def stage(self, **options: object) -> GcodeStage:
        """A stage on it that is fast and impatient."""
        fast = {"travel_speed_mm_s": 400.0, "press_speed_mm_s": 100.0, "answer_s": 0.5, "boot_s": 3.0}
        return GcodeStage(self.stage_port.name, LIMITS, **(fast | options))  # type: ignore[arg-type]

    def sensor(self, rate_hz: float = 300.0) -> Sensor:
        """A sensor on it."""
        assert self.board_port is not None
        return Sensor(CONFIG, self.board_port.name, rate_hz=rate_hz, baseline_s=0.0, gather_s=0.0)


@contextmanager
def bench(*, has_board: bool = False, link: Path | None = None, **options: object) -> Iterator[Bench]:
    """A bench whose tip stands on the middle of the pad, barely touching."""
    printer = WatchedPrinter(MIDDLE, **options)
    with ExitStack() as ports:
        stage_port = ports.enter_context(FakePort(printer, PtyWire(link)))
        path = TipFinger(printer)
        board_port = ports.enter_context(FakePort(board(path))) if has_board else None  # type: ignore[arg-type]
        yield Bench(printer=printer, stage_port=stage_port, board_port=board_port)
