"""Frames through a damaged line: what is sent, what a line does to it, what the scanner makes of it.

Every byte is changed, followed by an inserted one, or lost, each with the given chance. A frame is intact when
none of its bytes was changed or lost and none was inserted between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optopad.design.arrays import BoolArray
from optopad.fabrication.driver.link.protocol import FrameFormat, Scanner, message_lengths, pack_frames

PAD = FrameFormat(emitters=8, receivers=8, bits=10)
BLOCK = 10_000
"""Frames at a time, so that a million take little memory."""


@dataclass(frozen=True, kw_only=True)
class Chances:
    """Chance of each kind of damage to a byte [-]."""

    flip: float = 0.0
    insert: float = 0.0
    drop: float = 0.0


@dataclass
class Tally:
    """Frames sent, those of them intact, delivered intact ones, delivered ones that nobody sent."""

    sent: int = 0
    intact: int = 0
    delivered_intact: int = 0
    delivered: int = 0
    corrupted_accepted: int = 0

    @property
    def intact_share(self) -> float:
        """Delivered share of the intact frames [-]."""
        return self.delivered_intact / self.intact


def through_the_line(frames: int, chances: Chances, seed: int) -> Tally:
    """Send frames of random readings, damage them, scan, compare byte by byte."""
    rng, scanner, tally = np.random.default_rng(seed), Scanner(message_lengths(PAD)), Tally()
    truth: dict[bytes, bool] = {}
    for start in range(0, frames, BLOCK):
        count = min(BLOCK, frames - start)
        numbers = np.arange(start, start + count)
        sent = pack_frames(PAD, numbers, 2500 * numbers, rng.integers(0, 1024, (count, 9, 8)))
        stream, intact = damaged(sent, chances, rng)
        truth |= dict(zip(sent, intact.tolist(), strict=True))
        _count(tally, scanner, truth, stream)
        for frame in list(truth)[: -BLOCK // 2]:  # those still in the scanner are the last ones
            del truth[frame]
        tally.sent += count
        tally.intact += int(intact.sum())
    _count(tally, scanner, truth, bytes(PAD.total_bytes))  # lets a last unfinished candidate end
    return tally


def damaged(frames: list[bytes], chances: Chances, rng: np.random.Generator) -> tuple[bytes, BoolArray]:
    """The stream behind the line, and which of the frames are intact, (n,)."""
    stream = np.frombuffer(b"".join(frames), np.uint8).copy()
    size = len(stream) // len(frames)
    flip, insert, drop = (
        rng.random(len(stream)) < chance for chance in (chances.flip, chances.insert, chances.drop)
    )
    stream[flip] ^= rng.integers(1, 256, int(flip.sum()), dtype=np.uint8)
    inside = insert.reshape(-1, size)[:, :-1].any(axis=1)  # behind the last byte is between two frames
    intact = ~((flip | drop).reshape(-1, size).any(axis=1) | inside)
    copies = np.where(drop, 0, 1) + insert
    out = np.repeat(stream, copies)
    added = np.cumsum(copies)[insert] - 1
    out[added] = rng.integers(0, 256, len(added), dtype=np.uint8)
    return out.tobytes(), intact


def _count(tally: Tally, scanner: Scanner, truth: dict[bytes, bool], stream: bytes) -> None:
    for _, message in scanner.feed(stream):
        tally.delivered += 1
        tally.corrupted_accepted += message not in truth
        tally.delivered_intact += truth.get(message, False)
