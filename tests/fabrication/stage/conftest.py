"""The simulated printer boots at once here, and nobody waits for answers to questions that were asked twice."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def quick_greeting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("optopad.fabrication.stage.fake_printer.BOOT_S", 0.02)
    monkeypatch.setattr("optopad.fabrication.stage.gcode_stage.QUIET_S", 0.05)
