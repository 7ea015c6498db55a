"""Time of a frame's first conversion by this machine's clock, estimated from the times of arrival.

Every frame states the board's time d of its first conversion. It arrives at the host's time

    h = d + offset + least delay + jitter,   jitter >= 0,

where the least delay is the duration of the conversions and of the transfer, by the timing model. Jitter is the time
for which the bytes wait in drivers and buffers. The offset is the minimum of h - d over the last `WINDOW_S`, less the
least delay. Two quartz clocks differ by up to 100 ppm, so the minimum is taken over a short window only.

The stated error is the drift of the clocks within the window. Left out: a delay that every frame has, such as that of a
USB bridge, which makes all stamps late by the same time.
"""

from __future__ import annotations

from collections import deque

WINDOW_S = 10.0
"""Time over which the least delay is sought [s]."""
BLOCK_S = 0.5
"""Time for which one minimum is kept [s]."""
QUARTZ = 1e-4
"""Largest relative difference between the board's clock and that of this machine [-]."""


class BoardClock:
    """Estimates when frames were read, in this machine's time.

    Parameters
    ----------
    least_delay_s : time from a frame's first conversion to its arrival, without waiting [s]
    """

    def __init__(self, least_delay_s: float) -> None:
        self._least_delay_s = least_delay_s
        self._blocks: deque[tuple[float, float]] = deque()

    def restart(self) -> None:
        """Forget all frames, because the board's clock started again."""
        self._blocks.clear()

    def began_s(self, device_s: float, host_s: float) -> float:
        """Host's time at which a frame's first conversion began [s]; never after its arrival.

        Parameters
        ----------
        device_s : board's time of the first conversion [s]
        host_s : host's time at the frame's arrival [s]
        """
        behind = host_s - device_s
        blocks = self._blocks
        if blocks and device_s - blocks[-1][0] < BLOCK_S:
            blocks[-1] = (blocks[-1][0], min(blocks[-1][1], behind))
        else:
            blocks.append((device_s, behind))
            while blocks[0][0] < device_s - WINDOW_S:
                blocks.popleft()
        return device_s + min(least for _, least in blocks) - self._least_delay_s

    @property
    def error_s(self) -> float:
        """Bound of the error by the drift of the clocks within the window [s]; infinite before the first frame."""
        blocks = self._blocks
        return QUARTZ * (blocks[-1][0] - blocks[0][0] + BLOCK_S) if blocks else float("inf")
