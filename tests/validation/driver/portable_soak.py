"""Whether the driver takes 1,000 frames a second from the portable firmware, recording included, and loses none.

    python -m tests.validation.driver.portable_soak [SECONDS [live]]     one minute unless given; needs g++

`live` reads through the studio's live view in place of a recording.

The program is compiled for this machine and runs in real time behind a pseudo-terminal: 9 x 8 readings of 12 bits.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.fabrication.driver import Sensor
from optopad.fabrication.driver.link.frames import US_PER_S
from optopad.fabrication.driver.recording.raw import RecordKind, read_records
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.sketch import firmware_settings
from optopad.studio.live import LiveSensor, LiveView
from tests.fabrication.simulated_board import board_on_a_port, portable_pad, quantised, random_table

RATE_HZ = 1000.0
FAST = {"board.baud": 2_000_000, "board.frame_rate_hz": RATE_HZ}


@dataclass(frozen=True, kw_only=True)
class Soak:
    """What came: frames read, and recorded; lost, damaged, late, wrong ones; rate [Hz]; share of one core."""

    frames: int
    recorded: int
    lost: int
    damaged: int
    overrun: int
    late: int
    wrong: int
    rate_hz: float
    core_share: float


def soak(seconds: float) -> Soak:
    """Read and record for so long."""
    pad = portable_pad(preset("piacenza2017-pad")).with_(**FAST)
    settings = firmware_settings(Pad.of(pad))
    table_mv = random_table(settings)
    expected = quantised(table_mv, settings.circuit.adc.bits)
    wrong, times_us = 0, []
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        config, recording = folder / "driver.toml", folder / "soak.optorec"
        config.write_text(dump_driver_config(pad), encoding="utf-8")
        with (
            board_on_a_port(None, folder, pad, table_mv) as port,
            Sensor(config, port, baseline_s=0.0) as sensor,
        ):
            began_s = time.process_time()
            with sensor.record(recording):
                for frame in sensor.frames(seconds=seconds):
                    wrong += bool((frame.counts != expected).any())
                    times_us.append(frame.device_us)
            used_s = time.process_time() - began_s
            late, counts = sensor.self_test().late_frames, sensor.counts
        recorded = sum(record.kind == RecordKind.FRAME for record in read_records(recording)[2])
    return Soak(
        frames=len(times_us),
        recorded=recorded,
        lost=counts.lost,
        damaged=counts.damaged,
        overrun=counts.overrun,
        late=late,
        wrong=wrong,
        rate_hz=(len(times_us) - 1) / (times_us[-1] - times_us[0]) * US_PER_S,
        core_share=used_s / seconds,
    )


def live_soak(seconds: float) -> LiveView:
    """What the studio's live view has after so long: frames, lost ones, and those that it never got."""
    pad = portable_pad(preset("piacenza2017-pad")).with_(**FAST)
    table_mv = random_table(firmware_settings(Pad.of(pad)))
    with (
        TemporaryDirectory() as scratch,
        board_on_a_port(None, Path(scratch), pad, table_mv) as port,
        LiveSensor(pad, port=port, model=None, bundles=Path(scratch)) as live,
    ):
        live.start()
        time.sleep(seconds)
        view = live.latest()
    assert view is not None
    return view


if __name__ == "__main__":
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    if "live" in sys.argv:
        seen = live_soak(seconds)
        print(f"live view: {seen.status}; {seen.frames} frames, {seen.lost} lost, {seen.damaged} damaged, "
              f"{seen.view_lost} not shown to it, {seen.reconnects} reconnects")  # fmt: skip
    else:
        print(soak(seconds))
