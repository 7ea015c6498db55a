"""Can the board do it? Pins, converter, frame rate, serial rate.

An asynchronous frame of 10 bits samples its last bit at 9.5 bit times, so sender and receiver may
differ by half a bit there, 5.3 %. Each end is given half of that: a rate more than 2.5 % off is an
error, and one more than 1 % off a warning, since the other end need not be exact either.
"""

from __future__ import annotations

from collections.abc import Iterator

from design.circuit.emitter_switch import emitter_switch
from design.circuit.pins import pin_findings
from design.circuit.timing import MS_PER_S, baud_error, frame_time_ms, made_baud
from design.circuit.transimpedance import gain_findings, settling_findings
from design.fields.finding import Finding, error, warning
from design.parts.assumptions import assumption
from design.parts.catalog import Board
from design.rules.firmware import firmware_findings
from design.shape.cavity import cavity_of
from design.spec import SensorDesign

BAUD_ERROR_LIMIT = 0.025
BAUD_ERROR_WARNING = 0.01


def board_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> Iterator[Finding]:
    """Everything that the board cannot do, or only just."""
    yield from pin_findings(design, board, emitter_count, receiver_count)
    yield from _prescaler_findings(design, board)
    yield from _baud_findings(design, board)
    yield from _rate_findings(design, board, emitter_count, receiver_count)
    yield from firmware_findings(design, board, emitter_count, receiver_count)


def circuit_findings(design: SensorDesign, board: Board) -> Iterator[Finding]:
    """What the circuit around the board cannot do: light an emitter, switch it by a pin, settle in time."""
    for placed in {one.part_id: one for one in cavity_of(design).emitters}.values():
        switch = emitter_switch(placed.part)
        supply_v, most = assumption("supply_v").value, board.max_pin_current_ma.value
        if switch.series_ohm is None:
            yield warning(
                placed.origin,
                f"the supply cannot light {placed.part_id}",
                value=f"a forward voltage of {switch.forward_v.value:g} V",
                limit=f"less than the supply's {supply_v:g} V",
                way_out="use a higher supply for the emitters, or another part",
            )
        if switch.overloads_pin(board):
            yield warning(
                placed.origin,
                f"a pin gives too much current to switch {placed.part_id} by a bipolar transistor",
                value=f"{switch.base_current_ma:.1f} mA",
                limit=f"at most {most:g} mA",
                way_out="use a logic-level MOSFET or a driver in its place, or a part with less max_current_ma",
            )
    errors = list(gain_findings(design))
    yield from errors or settling_findings(design)


def _prescaler_findings(design: SensorDesign, board: Board) -> Iterator[Finding]:
    prescaler = design.board.adc_prescaler
    if prescaler not in board.adc_prescalers:
        yield error(
            "board.adc_prescaler",
            f"{board.title} has no such divider of the converter's clock",
            value=prescaler,
            limit=f"one of {', '.join(map(str, board.adc_prescalers))}",
            way_out="choose one of them",
        )


def _baud_findings(design: SensorDesign, board: Board) -> Iterator[Finding]:
    wanted = design.board.baud
    off = baud_error(board.clock_hz, wanted)
    if abs(off) <= BAUD_ERROR_WARNING:
        return
    is_error = abs(off) > BAUD_ERROR_LIMIT
    limit = BAUD_ERROR_LIMIT if is_error else BAUD_ERROR_WARNING
    make = error if is_error else warning
    yield make(
        "board.baud",
        f"the board's clock makes {made_baud(board.clock_hz, wanted):.0f} baud instead, {off:+.1%}",
        value=wanted,
        limit=f"within {limit:.1%}",
        way_out=f"use one of {', '.join(map(str, board.exact_bauds))}, which it makes exactly",
    )


def _rate_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> Iterator[Finding]:
    if design.board.adc_prescaler <= 0:
        return  # has its own finding
    takes = frame_time_ms(board, design.board, emitter_count, receiver_count)
    budget = MS_PER_S / design.board.frame_rate_hz
    if takes > budget:
        yield error(
            "board.frame_rate_hz",
            f"a frame takes {takes:.2f} ms, which allows {MS_PER_S / takes:.1f} frames a second",
            value=f"{design.board.frame_rate_hz:g} Hz",
            limit=f"a frame within {budget:.2f} ms",
            way_out="lower it, board.adc_prescaler or board.settle_us, or raise board.baud",
        )
