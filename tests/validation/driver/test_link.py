"""The link under damage: nothing corrupted passes, what is intact arrives. A million frames: link_table."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.validation.driver.firmware_rates import ASKED_HZ, EARLY, PAGE, QUIET, measured, with_prescaler
from tests.validation.driver.link_damage import PAD, Chances, damaged, through_the_line

ONE_PERCENT = {
    "flips": Chances(flip=0.01),
    "insertions": Chances(insert=0.01),
    "drops": Chances(drop=0.01),
    "all three": Chances(flip=0.01, insert=0.01, drop=0.01),
}


@pytest.mark.parametrize("kind", ONE_PERCENT)
def test_no_corrupted_frame_is_accepted_and_the_intact_ones_arrive(kind: str) -> None:
    tally = through_the_line(20_000, ONE_PERCENT[kind], seed=7)
    assert tally.corrupted_accepted == 0
    assert tally.intact_share >= 0.999  # 0.95 is asked for; link_table says which are missed


def test_a_clean_line_loses_nothing() -> None:
    tally = through_the_line(2_000, Chances(), seed=7)
    assert (tally.delivered, tally.delivered_intact, tally.corrupted_accepted) == (2_000, 2_000, 0)


def test_the_damage_leaves_as_many_frames_intact_as_chance_says() -> None:
    rng = np.random.default_rng(3)
    _, intact = damaged([rng.bytes(PAD.total_bytes) for _ in range(20_000)], Chances(flip=0.01), rng)
    wanted = 0.99**PAD.total_bytes
    assert intact.mean() == pytest.approx(
        wanted, abs=5 * np.sqrt(wanted * (1 - wanted) / 20_000)
    )  # 5 standard errors


def test_the_page_of_a_million_frames_keeps_what_was_asked_for() -> None:
    page = (Path(__file__).parents[3] / "docs" / "validation" / "link.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\| .+ \| 1,000,000 \| [\d,]+ \| ([\d.]+) % \| (\d+) \|$", page, flags=re.MULTILINE)
    assert len(lines) == 4
    assert all(float(share) >= 95 and int(corrupted) == 0 for share, corrupted in lines)
    loads = dict(re.findall(r"^\| ([a-z][^|]+) \| \d+ \| \d+ \| ([\d.]+)% \|$", page, flags=re.MULTILINE))
    assert float(loads["frames with counts and signals"]) <= 10
    longest = re.search(r"at\s+most\s+([\d.]+) s", page)
    assert longest is not None
    assert float(longest[1]) <= 1.0


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
