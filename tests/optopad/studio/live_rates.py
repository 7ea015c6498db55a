"""Does the studio's view of the sensor lose frames, or slow the driver? The simulated board, read beside work.

    python -m tests.optopad.studio.live_rates --seconds 600 --work python

A thread asks for the newest snapshot 30 times a second, another one works without a pause: in Python alone, which
fights for the interpreter, or by tracing light, as the studio does.
"""

from __future__ import annotations

import argparse
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from optopad.design.draft import Draft
from optopad.design.preset import FLAT_PRESETS, preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.frames import Frame
from optopad.studio.live import FAKE, LiveSensor

LOOKS_HZ = 30.0
SETTLED_S = 5.0
"""After the first frames: from then on memory is compared."""
PAGES_PER_MB = 1e6 / os.sysconf("SC_PAGE_SIZE")
MOST_FRAMES = 1_000_000


class Clock:
    """When frames were measured, arrived, and were handed on: a row each [s]."""

    def __init__(self, live: LiveSensor) -> None:
        self.rows = np.full((MOST_FRAMES, 3), np.nan)
        self.count = 0
        self._follow: Callable[..., None] = live._follow
        live._follow = self.follow  # type: ignore[method-assign]

    def follow(self, sensor: object, frame: Frame, touch: object) -> None:
        """Note one, and hand it on."""
        self.rows[self.count % MOST_FRAMES] = frame.device_us / 1e6, frame.host_s, time.time()
        self.count += 1
        self._follow(sensor, frame, touch)

    def told(self) -> list[str]:
        """How late frames arrived beside the board's clock, and how late they were handed on."""
        device, arrived, handed = self.rows[: min(self.count, MOST_FRAMES)].T
        return [
            f"arrival, later than the soonest: {spread(arrived - device - (arrived - device).min())}",
            f"from arrival to the view: {spread(handed - arrived)}",
        ]


def spread(seconds: np.ndarray) -> str:
    """Median, 99th percentile and largest [ms]."""
    middle, most, worst = 1e3 * np.percentile(seconds, [50, 99, 100])
    return f"median {middle:.1f} ms, 99 % below {most:.1f} ms, worst {worst:.1f} ms"


def in_python(_design: SensorDesign, is_over: threading.Event) -> None:
    """Work that holds the interpreter whenever it may."""
    while not is_over.is_set():
        sum(k * k for k in range(10_000))


def by_light(design: SensorDesign, is_over: threading.Event) -> None:
    """Work as the studio's: the untouched pad's light, over and over."""
    from optopad.sims.verdict.presses import untouched_flux

    seed = 1
    while not is_over.is_set():
        untouched_flux(Draft.of(design), seed=seed)
        seed += 1


WORK: dict[str, Callable[[SensorDesign, threading.Event], None]] = {
    "none": lambda _design, _is_over: None,
    "python": in_python,
    "light": by_light,
}


def memory_mb() -> float:
    """Resident memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) / PAGES_PER_MB


def measured(design: SensorDesign, seconds: float, work: str) -> list[str]:
    """Lines of what was found."""
    is_over = threading.Event()
    with LiveSensor(design, port=FAKE, model=None, bundles=Path("outputs")) as live:
        clock = Clock(live)
        live.start()
        while (view := live.latest()) is None or not view.is_reading:
            time.sleep(0.1)
            if not live._thread.is_alive():
                raise SystemExit(view and view.status)
        threading.Thread(target=WORK[work], args=(design, is_over), daemon=True).start()
        begun, seen_s, worst_s, slowest_s, looks = time.monotonic(), time.monotonic(), 0.0, 0.0, 0
        memory, first = None, view.frames
        while (now := time.monotonic()) - begun < seconds:
            newest = live.latest()
            slowest_s = max(slowest_s, time.monotonic() - now)
            looks += 1
            if newest is not None and newest.frames != view.frames:
                view, worst_s, seen_s = newest, max(worst_s, now - seen_s), now
            if memory is None and now - begun > SETTLED_S:
                memory = memory_mb()
            time.sleep(max(now + 1.0 / LOOKS_HZ - time.monotonic(), 0.0))
        is_over.set()
        passed_s, grown_mb = time.monotonic() - begun, memory_mb() - (memory or memory_mb())
    return [
        f"{design.name}, work {work}, {passed_s:.0f} s: {view.frames - first} frames, {view.lost} lost, "
        f"{view.damaged} damaged, {view.reconnects} reconnects, {view.view_lost} lost by the view",
        f"{looks / passed_s:.1f} looks a second, the slowest {1e3 * slowest_s:.2f} ms; "
        f"worst gap between new snapshots {1e3 * worst_s:.0f} ms",
        *clock.told(),
        f"rate {view.rate_hz or 0.0:.2f} Hz; memory {grown_mb:+.1f} MB after the first {SETTLED_S:.0f} s",
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--design", default=FLAT_PRESETS[0], choices=FLAT_PRESETS)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--work", choices=WORK, default="python")
    given = parser.parse_args()
    os.environ.setdefault("OPTOPAD_LIGHT_CACHE_MB", "0")  # light that is kept is no work
    print("\n".join(measured(preset(given.design), given.seconds, given.work)))
