"""What the link stands, and what it costs: docs/validation/link.md.

    python -m tests.validation.driver.link_table          (about three minutes of one core)

A million frames through each kind of damage, the host's processor time at 400 frames a second, and the time from
plugging the board in again to the next frame. The board is simulated, in another process where the host is measured.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from optopad.design.io import write_text_atomically
from optopad.design.preset import preset
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link.ports import GATHER_S
from optopad.fabrication.driver.simulated.port import FakePort, PtyWire
from optopad.fabrication.driver_config import dump_driver_config
from tests.fabrication.driver.made_up_pad import board, pad_config, untouched
from tests.validation.driver.link_damage import Chances, Tally, through_the_line

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "validation" / "link.md"
FRAMES = 1_000_000
SEED = 20
KINDS = {
    "1 % of bytes changed": Chances(flip=0.01),
    "a byte inserted behind 1 % of them": Chances(insert=0.01),
    "1 % of bytes lost": Chances(drop=0.01),
    "all three at once": Chances(flip=0.01, insert=0.01, drop=0.01),
}
RATE_HZ, MEASURED_S = 400.0, 20.0
RECONNECTS = 10

HEAD = """\
# The link under damage, and what it costs the host

**Question.** Does a damaged serial line deliver wrong frames, or lose intact ones? How much processor time does reading
take, and how fast does the driver recover after the board was unplugged?

**Answer.** {sent:,} frames were sent through damaged lines: {wrong} corrupted frames were accepted, and {least:.3f} %
or more of the intact ones arrived. Reading {rate:.0f} frames a second takes {share:.1%} of a core. After plugging in
again the next frame comes at most {back:.2f} s later.

## Method

- Frames of the paper's pad: 9 x 8 readings of 10 bits, 105 bytes with CRC-32.
- Damage: every byte is changed, followed by an inserted one, or lost, each with a chance of 1 %. A frame is *intact*
  when none of its bytes was changed or lost and none inserted between them; most frames of 105 bytes are not. What the
  scanner delivers is compared with what was sent, byte by byte.
- Load: processor time of the reading process over {measured:g} s, its thread and the system's part included; the
  simulated board is another process. Frames are taken off the line in batches {gather:g} ms apart unless said
  otherwise.
- {machine}. A loop of a million additions in Python took {spin:.0f} ms of
  the same core.
- Plugged in again: a simulated board's port goes away and comes back, {times} times.

## Figures

| line | sent | intact | of these delivered | delivered though corrupted |
|---|---|---|---|---|
"""

LOAD_HEAD = """\

| what is done | frames a second | lost | share of one core |
|---|---|---|---|
"""

TAIL = """\

Back after unplugging: {median:.2f} s in the median, at most {back:.2f} s.

## What it means

- A delivered frame is reliable. A corrupted one can pass with a chance of 2^-32 for each beginning that is tried.
- The few intact frames that are missed follow a frame whose last byte was lost. If that byte equals the next frame's
  first, the damaged frame is complete again and the intact one lacks its beginning.
- Waking the process costs more than decoding: take frames in batches where processor time is scarce.
- A real Arduino resets when its port is opened, and its boot loader takes a second or two before the firmware runs.
  That time comes on top, and nothing on the host can shorten it.
- Sequence numbers and device time hold for 24 hours at 400 Hz, across the wrap of both counters
  (`pytest tests/fabrication/driver/test_protocol.py`).

## Made by

`python -m tests.validation.driver.link_table`: about three minutes of one core.
`pytest tests/validation/driver/test_link.py` sends 20,000 frames through each damage with every change.
"""


def main() -> None:
    """Measure, write the page."""
    damage = {name: through_the_line(FRAMES, chances, SEED) for name, chances in KINDS.items()}
    print({name: vars(tally) for name, tally in damage.items()}, flush=True)
    loads = measured_loads()
    print(loads, flush=True)
    back_s = reconnect_times_s()
    print(back_s, flush=True)
    write_text_atomically(PAGE, page_text(damage, loads, back_s))


def measured_loads() -> dict[str, tuple[float, float, int]]:
    """Measured rate [Hz], share of one core, and frames lost, by what the host does with the frames."""
    with TemporaryDirectory() as folder:
        config = Path(folder) / "driver.toml"
        fast = preset("piacenza2017-pad").with_(**{"board.adc_prescaler": 16, "board.frame_rate_hz": 400.0})
        text = dump_driver_config(fast, [1e5] * 8, np.minimum(untouched(), 1023))
        config.write_text(text, encoding="utf-8")
        link = Path(folder) / "pad"
        command = [sys.executable, "-m", "optopad", "driver", "fake", str(config), "--link", str(link)]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as fake:
            try:
                while not link.is_symlink():
                    time.sleep(0.1)
                return {
                    "frames with counts and signals": _load(config, link),
                    "the same, normalised, and recorded": _load(
                        config, link, recording=Path(folder) / "a.optorec"
                    ),
                    "each handed on at once (`gather_s=0`)": _load(config, link, gather_s=0.0),
                }
            finally:
                fake.terminate()


def _load(
    config: Path, link: Path, recording: Path | None = None, gather_s: float = GATHER_S
) -> tuple[float, float, int]:
    with Sensor(config, str(link), rate_hz=RATE_HZ, gather_s=gather_s) as sensor:
        recorder = None if recording is None else sensor.record(recording)
        sensor.read()
        begun_s, used_s, count, deepest = time.monotonic(), time.process_time(), 0, 1.0
        for frame in sensor.frames(seconds=MEASURED_S):
            count += 1
            if recorder is not None:
                deepest = min(deepest, frame.normalised[0, 2])
        passed_s = time.monotonic() - begun_s
        share = (time.process_time() - used_s) / passed_s
        lost = sensor.counts.lost
    return count / passed_s, share, lost


def spin_ms() -> float:
    """Processor time of a million additions in Python [ms]."""
    begun, total = time.process_time(), 0
    for number in range(1_000_000):
        total += number
    return 1e3 * (time.process_time() - begun)


def reconnect_times_s() -> list[float]:
    """From plugging in again to the next frame [s]."""
    found = []
    with TemporaryDirectory() as folder:
        link = Path(folder) / "pad"
        port = FakePort(board(), PtyWire(link)).__enter__()
        with Sensor(pad_config(), str(link), rate_hz=100, baseline_s=0) as sensor:
            for number in range(RECONNECTS):
                sensor.read()
                port.unplug()
                time.sleep(0.2 + 0.037 * number)  # at another moment of the search each time
                port = FakePort(board(), PtyWire(link)).__enter__()
                plugged_s = time.monotonic()
                while sensor.read().connection < number + 2:
                    pass
                found.append(time.monotonic() - plugged_s)
        port.unplug()
    return found


def page_text(
    damage: dict[str, Tally], loads: dict[str, tuple[float, float, int]], back_s: list[float]
) -> str:
    """The page."""
    rows = [
        f"| {name} | {t.sent:,} | {t.intact:,} | {100 * t.intact_share:.3f} % | {t.corrupted_accepted} |"
        for name, t in damage.items()
    ]
    used = [f"| {name} | {rate:.0f} | {lost} | {share:.1%} |" for name, (rate, share, lost) in loads.items()]
    rate, share, _ = next(iter(loads.values()))
    head = HEAD.format(
        sent=sum(t.sent for t in damage.values()),
        wrong=sum(t.corrupted_accepted for t in damage.values()) or "no",
        least=100 * min(t.intact_share for t in damage.values()),
        rate=rate,
        share=share,
        back=max(back_s),
        measured=MEASURED_S,
        machine=f"{os.cpu_count()}-core machine shared with other work, Python {platform.python_version()}",
        spin=spin_ms(),
        gather=GATHER_S * 1e3,
        times=len(back_s),
    )
    tail = TAIL.format(median=np.median(back_s), back=max(back_s))
    return head + "\n".join(rows) + "\n" + LOAD_HEAD + "\n".join(used) + "\n" + tail


if __name__ == "__main__":
    main()
