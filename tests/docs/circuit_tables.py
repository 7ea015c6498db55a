"""Tables of boards and of converters, for docs/how-to/program-board.md and board-options.md, from the catalogue."""

from __future__ import annotations

from dataclasses import replace

from optopad.design.circuit.circuit import Circuit
from optopad.design.parts.catalog import Board, packaged
from optopad.design.parts.circuits import Converter
from optopad.design.preset import preset
from optopad.design.spec.sensor import ReceiverInputs

PAD = preset("piacenza2017-pad")
COUNTS = (4, 8, 16)
"""Emitters of a frame, and as many receivers."""


def boards_table() -> str:
    """A row for each board: voltage, bits, inputs, pins, and rates by the timing model."""
    rows = [
        "| board | `board.kind` | pin voltage | bits | inputs | emitter pins | frames/s with 4 + 4 | 8 + 8 | 16 + 16 "
        "| rates checked on |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, board in packaged().boards.items():
        rates = " | ".join(_rate(board, count) for count in COUNTS)
        checked = "not measured" if board.firmware is None else "the simulated chip"
        rows.append(
            f"| {board.title} | `{name}` | {board.pin_v:g} V | {board.adc_bits} | {len(board.analog_channels)} | "
            f"{len(board.digital_pins)} | {rates} | {checked} |"
        )
    return "\n".join(rows)


def _rate(board: Board, count: int) -> str:
    has_inputs = len(board.analog_channels) >= count
    entry = None if has_inputs else packaged().multiplexers["74hc4067"]
    if count + (entry.address_bits if entry else 0) > len(board.digital_pins):
        return "too few pins"
    circuit = replace(Circuit.of(PAD), board=board, emitter_count=count, receiver_count=count)
    circuit = circuit if has_inputs else circuit.with_use(receivers=ReceiverInputs(multiplexer="74hc4067"))
    rate = circuit.frame_rate_hz
    return f"{rate:.0f}" + ("" if has_inputs else " with mux")


def converters_table() -> str:
    """A row for each converter: inputs, bits, supply, full scale, and time of a reading."""
    rows = [
        "| `board.receivers.converter` | inputs | bits | supply | full scale | time of a reading |",
        "|---|---|---|---|---|---|",
    ]
    for name, one in packaged().converters.items():
        supply, full_scale = "voltage of the board's pins", "its supply"
        if one.has_own_logic:
            supply = f"{one.supply_low_v:g} to {one.supply_high_v:g} V for its inputs, {supply} for its bus"
        if one.full_scale_v is not None:
            full_scale = f"{one.full_scale_v:g} V"
        rows.append(
            f"| `{name}` | {one.channels} | {one.bits} | {supply} | {full_scale} | {_reading_time(one)} |"
        )
    return "\n".join(rows)


def _reading_time(converter: Converter) -> str:
    boards = packaged().boards
    low, high = (
        f"{converter.reading_us(boards[name]):.2g} µs" for name in ("teensy-41", "arduino-uno-r4-minima")
    )
    return low if low == high else f"{low}, or {high} on boards with 5 V pins"
