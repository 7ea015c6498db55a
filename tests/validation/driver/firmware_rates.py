"""Frame rates of the compiled firmware on a simulated board, and its size: docs/validation/firmware.md.

    python -m tests.validation.driver.firmware_rates  writes the page anew; needs avr-gcc and libsimavr, takes seconds

Each rate is of full frames as sent, from the device's own clock, after the first two. The simulator's converter starts
at once; a chip's waits for the next edge of the converter's clock, which the harness around the simulator adds.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from optopad.design.arrays import IntArray
from optopad.design.circuit.circuit import MS_PER_S, US_PER_S
from optopad.design.io import write_text_atomically
from optopad.design.pad import Pad
from optopad.design.preset import FLAT_PRESETS, SHAPED_PRESETS, preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.link.protocol import Command, pack_command
from optopad.fabrication.flash import COMPILER, compiled_image
from optopad.fabrication.sketch import firmware_settings
from tests.fabrication.simulated_board import (
    AMPLIFIER_TAU_US,
    LIGHT_TAU_US,
    Run,
    build_harness,
    light_table_mv,
    missing_tools,
    not_by_the_simulator,
    quantised,
    random_table,
    simulate,
)

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "firmware.md"
PAD = preset("piacenza2017-pad")
PRESCALERS = (128, 64, 32, 16)
ASKED_HZ = {64: 235.0, 32: 400.0}
PAPER_HZ = 60.0
RUN_US = 700_000.0
"""Long enough for 80 frames at the slowest setting."""

QUIET, EARLY = "SWITCH_EARLY=0", "SWITCH_EARLY=1"
START_UP_US = 8_000.0
LONG_US = 4_400_000.0
"""Long enough for 1000 frames at the preset's prescaler."""

IGNORED_FRAMES = 2
"""The first ones find the line idle, and are a little faster."""


@dataclass(frozen=True, kw_only=True)
class Rate:
    """One row.

    Attributes
    ----------
    frames, wrong_readings : how many were read, and how many of their readings were not the simulated voltage
    simulator_hz : with the simulator's converter, which starts at once
    edges_hz : with conversions that wait for the next edge of the converter's clock, as on a chip
    budget_hz : by the plain sum of optopad.design.circuit.circuit, which rules and driver.toml rest on
    """

    prescaler: int
    frames: int
    wrong_readings: int
    simulator_hz: float
    edges_hz: float
    budget_hz: float


def measured(harness: Path, design: SensorDesign, change: str, duration_us: float = RUN_US) -> Rate:
    """The rate of a design's firmware, running freely.

    Parameters
    ----------
    change : a definition in place of that in config.h
    duration_us : of simulated time
    """
    settings = firmware_settings(Pad.of(design))
    at_once = _counted(harness, design, change, duration_us, edges=False)
    at_edges = _counted(harness, design, change, duration_us, edges=True)
    budget_ms = settings.circuit.frame_ms
    return Rate(
        prescaler=design.board.adc_prescaler,
        frames=at_once.frames + at_edges.frames,
        wrong_readings=at_once.wrong_readings + at_edges.wrong_readings,
        simulator_hz=at_once.hz,
        edges_hz=at_edges.hz,
        budget_hz=MS_PER_S / budget_ms,
    )


@dataclass(frozen=True, kw_only=True)
class _Count:
    frames: int
    wrong_readings: int
    hz: float


def _counted(harness: Path, design: SensorDesign, change: str, duration_us: float, *, edges: bool) -> _Count:
    table_mv = random_table(firmware_settings(Pad.of(design)))
    run = freely_run(harness, design, table_mv, change, duration_us, edges=edges)
    frame_us = float(np.diff(run.frames.device_us.astype(np.int64)[IGNORED_FRAMES:]).mean())
    wrong = int((run.frames.counts != quantised(table_mv)).sum())
    return _Count(frames=len(run.frames.counts), wrong_readings=wrong, hz=US_PER_S / frame_us)


def freely_run(
    harness: Path,
    design: SensorDesign,
    table_mv: IntArray,
    change: str,
    duration_us: float,
    *,
    edges: bool = True,
) -> Run:
    """A design's firmware, told to run as fast as it can, against a table of voltages."""
    freely = (START_UP_US, pack_command(Command.RATE, 0))
    start = (START_UP_US + 1000.0, pack_command(Command.START))
    with TemporaryDirectory() as scratch:
        return simulate(
            harness,
            Path(scratch),
            design,
            table_mv,
            [freely, start],
            duration_us=duration_us,
            changes=[change],
            edges=edges,
        )


def told_loop(harness: Path) -> tuple[str, bool]:
    """Lines on a thousand frames of simulated light, right and with too short a settle time; whether both are found."""
    table_mv = light_table_mv(PAD)
    wrong = {}
    for change, duration_us in (("SETTLE_US=20UL", LONG_US), ("SETTLE_US=2UL", LONG_US)):
        counts = freely_run(harness, PAD, table_mv, change, duration_us).frames.counts[:1000]
        wrong[change] = int((counts != quantised(table_mv)).sum()), counts.size, len(counts)
    right, short = wrong.values()
    text = f"""The paper's pad, pressed 2 mm deep next to the centre: light at draft accuracy, the design's gain, 20 mV
of ambient light. LEDs follow their pins with {LIGHT_TAU_US:g} us, amplifiers the light with {AMPLIFIER_TAU_US:g} us.

| settle time us | frames | readings | other than the quantised voltage |
| --- | --- | --- | --- |
| 20 | {right[2]} | {right[1]} | {right[0]} |
| 2, too short | {short[2]} | {short[1]} | {short[0]} |"""
    return text, right[0] == 0 < short[0]


def with_prescaler(prescaler: int) -> SensorDesign:
    """The paper's pad with another divider of the converter's clock."""
    return PAD.with_(**{"board.adc_prescaler": prescaler})


def main() -> int:
    """Write the page; 0 when every demand is met."""
    if missing := missing_tools():
        print(f"firmware_rates: {missing}", file=sys.stderr)
        return 2
    with TemporaryDirectory() as scratch:
        harness = build_harness(Path(scratch))
        rates = {
            change: [measured(harness, with_prescaler(p), change) for p in PRESCALERS]
            for change in (QUIET, EARLY)
        }
        layouts = [(name, measured(harness, preset(name), QUIET)) for name in FLAT_PRESETS + SHAPED_PRESETS]
        loop_text, is_right = told_loop(harness)
    write_text_atomically(PAGE, page(rates[QUIET], rates[EARLY], layouts, loop_text))
    met = all(rate.simulator_hz >= ASKED_HZ.get(rate.prescaler, 0.0) for rate in rates[QUIET])
    return (
        0
        if met and is_right and not any(rate.wrong_readings for rate in (*rates[QUIET], *rates[EARLY]))
        else 1
    )


def page(
    quiet: Sequence[Rate], early: Sequence[Rate], layouts: Sequence[tuple[str, Rate]], loop_text: str
) -> str:
    """Text of docs/validation/firmware.md."""
    usual = next(rate for rate in quiet if rate.prescaler == PAD.board.adc_prescaler)
    return f"""# The firmware on a simulated board

**Question.** How many frames a second does the firmware send, are its readings right, and does it fit into the chip?

**Answer.** {usual.simulator_hz:.0f} full frames a second of the paper's pad at its prescaler of {usual.prescaler},
{usual.edges_hz:.0f} with the waits of a chip's converter; the paper had {PAPER_HZ:.0f}.
{wrong_text([*quiet, *early])} Program and RAM take less than a tenth of the chip.
Nothing here was measured on a real board.

## Method

- The program is the one that `optopad driver firmware` makes, compiled by {compiler_version()}, run by
  simavr as fast as it can.
- Full frames of `piacenza2017-pad`: 9 states x 8 receivers, 105 bytes with CRC-32 at 1 Mbaud,
  {PAD.board.settle_us:g} us of settling after every switch. Every reading of every frame is compared
  with the simulated voltage.
- *Simulator*: its converter starts at once. *With clock edges*: a chip's converter starts at the next edge of its clock
  (the data sheet); the harness around the simulator adds that wait. It is the better guess for a board.
- *Sum*: settle, convert, then send, one after the other (`design/circuit/circuit.py`). Rules and `driver.toml` promise
no more.

## Frame rates

{rate_table(quiet)}

With `SWITCH_EARLY` set to 1 in `config.h`, the next emitter is switched on while a state's last input is converted,
once it is held:

{rate_table(early)}

Presets, as they are:

{layout_table(layouts)}

Of `oblong-60x40` {not_by_the_simulator(firmware_settings(Pad.of(preset("oblong-60x40"))))}.

## A thousand frames of simulated light

{loop_text}

## Memory

{memory_table()}

RAM is without the stack; a self-test reports how much was left free at the deepest call.

## What it means

- Plan with the *sum*: rules and driver promise that rate, and every rate measured is above it.
- 10 bits need a converter's clock of 50 to 200 kHz, prescaler 128 (the data sheet). At 64 and below the last bits are
  worse, which the simulator does not show.
- `SWITCH_EARLY` is faster and not the default: the step of the LED's current falls into a conversion whose reference is
  the same supply, which the simulator does not show either.
- A settle time shorter than LED and amplifier need gives wrong readings; 20 us gives none.

## Made by

`python -m tests.validation.driver.firmware_rates`: seconds; needs avr-gcc and libsimavr.
"""


def wrong_text(rates: Sequence[Rate]) -> str:
    """Readings that were not the simulated voltage, in a sentence."""
    wrong = sum(rate.wrong_readings for rate in rates)
    return f"{wrong} readings were wrong." if wrong else "Every reading was right."


def rate_table(rates: Iterable[Rate]) -> str:
    """Rows by prescaler."""
    columns = ("prescaler", "simulator Hz", "with clock edges Hz", "sum Hz", "frames", "wrong readings")
    return table(columns, ((r.prescaler, *in_hz(r), r.frames, r.wrong_readings) for r in rates))


def layout_table(layouts: Sequence[tuple[str, Rate]]) -> str:
    """Rows by preset."""
    rows = []
    for name, rate in layouts:
        settings = firmware_settings(Pad.of(preset(name)))
        readings = f"{settings.circuit.state_count} x {settings.circuit.receiver_count}"
        rows.append((name, readings, *in_hz(rate)))
    return table(("preset", "readings a frame", "simulator Hz", "with clock edges Hz", "sum Hz"), rows)


def memory_table() -> str:
    """Rows by preset: bytes and shares of the chip's."""
    rows = []
    for name in FLAT_PRESETS + SHAPED_PRESETS:
        image, chip = (
            compiled_image(firmware_settings(Pad.of(preset(name)))),
            firmware_settings(Pad.of(preset(name))).chip,
        )
        shares = image.flash_bytes / chip.flash_bytes, image.ram_bytes / chip.ram_bytes
        rows.append((name, image.flash_bytes, f"{shares[0]:.1%}", image.ram_bytes, f"{shares[1]:.1%}"))
    return table(("preset", "program bytes", "of the chip's", "RAM bytes", "of the chip's"), rows)


def in_hz(rate: Rate) -> tuple[str, str, str]:
    """Simulator, with edges, by the sum; whole hertz."""
    return f"{rate.simulator_hz:.0f}", f"{rate.edges_hz:.0f}", f"{rate.budget_hz:.0f}"


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def compiler_version() -> str:
    """Name and version of the compiler."""
    said = subprocess.run([COMPILER, "--version"], capture_output=True, text=True, check=True).stdout
    found = re.search(r"(\d+\.\d+\.\d+)", said)
    return f"{COMPILER} {found[1]}" if found else COMPILER


if __name__ == "__main__":
    sys.exit(main())
