"""The rates that are asked of the firmware, measured anew, and the page that tells them."""

from __future__ import annotations

import re

import pytest

from tests.validation.driver.firmware_rates import ASKED_HZ, EARLY, PAGE, QUIET, measured, with_prescaler

FRAMES = 40
SHORT_US = {64: 185_000.0, 32: 110_000.0}
"""Long enough for 40 frames."""

COMPILERS = 0.03
"""Another compiler's program may take another time between two conversions, a part of the frame."""


@pytest.mark.parametrize("prescaler", ASKED_HZ)
def test_the_firmware_reaches_the_rate_asked_for_with_every_reading_right(board_harness, prescaler):
    found = measured(board_harness, with_prescaler(prescaler), QUIET, SHORT_US[prescaler])
    assert found.frames >= 2 * FRAMES
    assert found.wrong_readings == 0
    assert found.simulator_hz >= ASKED_HZ[prescaler]
    assert (
        found.simulator_hz > found.edges_hz > found.budget_hz
    )  # rules promise no more than the firmware keeps
    assert found.simulator_hz == pytest.approx(told_hz()[prescaler], rel=COMPILERS)


def test_switching_early_is_faster_by_what_the_page_says(board_harness):
    found = measured(board_harness, with_prescaler(32), EARLY, SHORT_US[32])
    assert found.wrong_readings == 0
    assert found.simulator_hz == pytest.approx(told_hz(table=1)[32], rel=COMPILERS)


def told_hz(table: int = 0) -> dict[int, float]:
    """Rates by prescaler in a table of the page."""
    part = PAGE.read_text(encoding="utf-8").split("| prescaler |")[1 + table]
    rows = re.findall(r"^\| (\d+) \| (\d+) \|", part, flags=re.MULTILINE)
    return {int(prescaler): float(hz) for prescaler, hz in rows}
