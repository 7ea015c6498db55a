"""Rules for the board: pins, converter, frame rate, serial rate, and the generated firmware.

An asynchronous receiver samples the last of 10 bits after 9.5 bit times, when the clocks of sender and receiver may
differ by half a bit, which is 5.3 %. About half of that is allowed for each end, because the other end may also
deviate: a deviation of more than 2.5 % is an error, and one of more than 1 % is a warning.

Rules for the firmware cover the chip, its converter, the ports of the used pins, and memory.

If the board's catalogue entry does not describe the chip, a warning says that no firmware will be generated. This is
not an error, because mold, wiring and driver configuration do not need firmware. A layout whose frames do not fit in
the memory is an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from optopad.design.circuit.amplifier import chosen_amplifier
from optopad.design.circuit.circuit import MS_PER_S, US_PER_MS, Circuit, baud_error, frame_bytes, made_baud
from optopad.design.circuit.emitter_switch import (
    CurrentSink,
    current_sink,
    emitter_switch,
    most_drive_ma,
    transistor_of,
    transistor_shortfalls,
)
from optopad.design.circuit.pin_rules import pin_findings
from optopad.design.circuit.transimpedance import gain_findings, settling_findings
from optopad.design.fields.finding import FAILS, Finding, error, note, warning
from optopad.design.parts.board_firmware import ArduinoProgram, BoardFirmware
from optopad.design.parts.catalog import Board, LedDriver
from optopad.design.shape.cavity import PlacedPart
from optopad.design.spec import BoardUse

FIRMWARE_ADC_BITS = 10
PORTABLE_ADC_BITS = range(8, 17)
"""Numbers of bits per reading that the portable firmware, for boards other than AVR chips, can pack."""

TICK_HZ = 8_000_000
"""Frequency of which an AVR's clock must be a multiple.

The firmware's timer, at an eighth of the clock, then has whole counts per microsecond.
"""

HELLO_BYTES = 56
FRAME_BUFFERS = 2
"""Number of frame buffers: the firmware fills one while it sends the other."""

PROGRAM_RAM_BYTES = 512
"""Memory that the firmware needs in addition to the frames [bytes].

It covers variables (170 bytes measured), five bytes per emitter, and the stack.
"""


def firmware_findings(circuit: Circuit) -> Iterator[Finding]:
    """Findings about limits of the board that prevent the generated firmware from running on it."""
    board = circuit.board
    chip = board.firmware
    if board.arduino is not None:
        yield from _portable_findings(circuit, board.arduino)
        return
    if chip is None:
        yield warning(
            "board.kind",
            "no firmware is made for this board: its entry does not name its chip",
            value=circuit.use.kind,
            limit="an entry with a table `firmware` or `arduino`",
            way_out="add one in your catalogue, or name another board",
        )
        return
    yield from _converter_findings(board)
    yield from _pin_findings(circuit, chip)
    own = frame_bytes(circuit.emitter_count, circuit.receiver_count, board.adc_bits, circuit.use.dark)
    yield from _memory_findings(board, chip, own)


def _portable_findings(circuit: Circuit, chip: ArduinoProgram) -> Iterator[Finding]:
    bits, known = PORTABLE_ADC_BITS, circuit.board.analog_channels
    if circuit.adc.bits not in bits:
        yield warning(
            "board.kind",
            "no firmware is made for this board: its readings are too long or too short",
            value=f"{circuit.adc.bits} bits",
            limit=f"{bits[0]} to {bits[-1]} bits",
            way_out="set adc_bits of the board's entry to what its core's analogReadResolution takes",
        )
    unnamed = [name for name in circuit.channels if name in known and name not in chip.analog_pins]
    yield from _unknown("board.receiver_channels", "arduino", "analog_pins", unnamed)
    yield from _memory_findings(circuit.board, chip, circuit.frame_bytes)


def _converter_findings(board: Board) -> Iterator[Finding]:
    if board.adc_bits != FIRMWARE_ADC_BITS or board.clock_hz % TICK_HZ:
        yield warning(
            "board.kind",
            "no firmware is made for this board: it is for AVR chips at 8 or 16 MHz with 10-bit converters",
            value=f"{board.adc_bits} bits at {board.clock_hz:g} Hz",
            limit=f"{FIRMWARE_ADC_BITS} bits, a multiple of {TICK_HZ:g} Hz",
            way_out="name another board, or program this one yourself (docs/how-to/board-options.md)",
        )


def _pin_findings(circuit: Circuit, chip: BoardFirmware) -> Iterator[Finding]:
    board, pins = circuit.board, circuit.switch_pins
    if circuit.adc.separate is None:
        pins += tuple(pin for chips in circuit.receiver_chips for pin in chips.pins)
    unported = [pin for pin in pins if pin in board.digital_pins and pin >= len(chip.pin_ports)]
    unset = [
        name for name in circuit.channels if name in board.analog_channels and name not in chip.channel_mux
    ]
    yield from _unknown("board.emitter_pins", "firmware", "pin_ports", unported)
    yield from _unknown("board.receiver_channels", "firmware", "channel_mux", unset)


def _unknown(field: str, program: str, table: str, names: Sequence[object]) -> Iterator[Finding]:
    if names:
        yield warning(
            field,
            f"no firmware is made: the board's entry does not list them in {table}",
            value=", ".join(map(str, names)),
            limit=f"names that {table} has",
            way_out=f"add them to {program}.{table} of the board's entry, or choose others",
        )


def _memory_findings(
    board: Board, chip: BoardFirmware | ArduinoProgram, frame_length: int
) -> Iterator[Finding]:
    frame = max(frame_length, HELLO_BYTES)
    needed = FRAME_BUFFERS * frame + PROGRAM_RAM_BYTES
    if needed > chip.ram_bytes:
        yield error(
            "board.kind",
            f"two frames of {frame} bytes and the program's variables do not fit the memory of the {board.title}",
            value=f"{needed} bytes",
            limit=f"at most {chip.ram_bytes} bytes",
            way_out="use fewer parts, or name a board with more memory",
        )


LEAST_TARGET_SHARE = 0.05
"""Share of a converter's full scale below which the target for untouched readings causes a warning."""
USUAL_TARGET_SHARE = 0.3
"""The default target for untouched readings as a share of full scale: 300 of 1023 counts at 10 bits."""

BAUD_ERROR_LIMIT = 0.025
BAUD_ERROR_WARNING = 0.01
BOOT_LOADER_BAUD = 1200
"""Serial rate that starts the boot loader of Arduino's cores for native USB (the "1200 baud touch") [baud]."""
LONGEST_FRAME_MS = 2000.0
"""Longest frame without a warning: the driver waits 2.5 s for the response to a command."""


def board_findings(circuit: Circuit) -> Iterator[Finding]:
    """Findings about limits of the board that a design exceeds or nearly reaches."""
    use, board = circuit.use, circuit.board
    yield from pin_findings(circuit)
    yield from _voltage_findings(use, board)
    yield from _reference_findings(use, board)
    if board.divides_clock:
        yield from _prescaler_findings(use, board)
        yield from _baud_findings(use, board)
    yield from _boot_loader_findings(use, board)
    for known in board.warnings or ():
        yield warning(
            "board.kind", known, value=circuit.use.kind, limit="none", way_out="see the board's notes"
        )
    yield from _rate_findings(circuit)
    yield from firmware_findings(circuit)


def circuit_findings(circuit: Circuit) -> Iterator[Finding]:
    """Findings about the circuit around the board: it must light the emitters, switch them, and settle in time."""
    driver, sink = circuit.led_driver, current_sink(circuit)
    if driver is None or sink is None:
        yield from _switch_findings(circuit)
    else:
        yield from _sink_findings(circuit, driver, sink)
    yield from _amplifier_findings(circuit)
    yield from _target_findings(circuit)
    errors = list(gain_findings(circuit))
    yield from errors or settling_findings(circuit)


def _amplifier_findings(circuit: Circuit) -> Iterator[Finding]:
    named = circuit.use.amplifier
    chosen = chosen_amplifier(circuit, None, circuit.use.settle_us)
    for one in chosen.shortfalls:
        yield (warning if named is None or "full scale" in one.meaning else error)(
            "board.kind" if named is None else "board.amplifier",
            f"{chosen.entry.name} {one.meaning}"
            + (", as every other of the catalogue" if named is None else ""),
            value=one.value,
            limit=one.limit,
            way_out="add one that does to your catalogue"
            if named is None
            else "remove board.amplifier, so that one that fits is chosen",
        )


def _transistor_findings(circuit: Circuit, placed: PlacedPart) -> Iterator[Finding]:
    named, chosen = circuit.use.transistor, transistor_of(circuit, placed.part)
    for one in transistor_shortfalls(circuit, chosen.entry, placed.part):
        yield warning(
            placed.origin if named is None else "board.transistor",
            f"{chosen.entry.name} {one.meaning} of {placed.part_id}"
            + (", as every other of the catalogue" if named is None else ""),
            value=one.value,
            limit=one.limit,
            way_out="use LED drivers (board.emitters.driver), or a part with less max_current_ma"
            if named is None
            else "remove board.transistor, so that one that fits is chosen",
        )


def _target_findings(circuit: Circuit) -> Iterator[Finding]:
    gain, converter = circuit.design.gain, circuit.adc.separate
    steps, target, given = 2**circuit.adc.bits, gain.target_counts, gain.feedback_ohm
    if converter is None or not isinstance(given, str) or target >= LEAST_TARGET_SHARE * steps:
        return
    yield warning(
        "gain.target_counts",
        f"the readings of the untouched pad use a small part of the {steps} counts of {converter.name}",
        value=f"{target:g} counts, {target / steps:.1%} of full scale",
        limit=f"at least {LEAST_TARGET_SHARE:.0%}, {LEAST_TARGET_SHARE * steps:.0f} counts",
        way_out=f"set gain.target_counts = {USUAL_TARGET_SHARE * steps:.0f} or so, and noise.read_noise_counts in "
        "the counts of this converter",
    )


def _sink_findings(circuit: Circuit, driver: LedDriver, sink: CurrentSink) -> Iterator[Finding]:
    supply_v, field = circuit.board.emitter_v, driver.field
    if supply_v > driver.max_led_v:
        yield error(
            field,
            f"the supply of the emitters is above what an output of {driver.name} bears",
            value=f"{supply_v:g} V",
            limit=f"at most {driver.max_led_v:g} V",
            way_out="name a board.kind with a lower supply_v, or another driver",
        )
    if sink.current_ma < driver.least_output_ma.value:
        yield error(
            field,
            f"the emitters' max_current_ma is below the least current of {driver.name}",
            value=f"{sink.current_ma:.2f} mA",
            limit=f"at least {driver.least_output_ma.value:g} mA",
            way_out="name emitters of more current, or use transistors: remove board.emitters.driver",
        )
    for placed in {one.part_id: one for one in circuit.cavity.emitters}.values():
        if sink.needed_v(placed.part) > supply_v:
            yield warning(
                placed.origin,
                f"the supply does not give {placed.part_id} its constant current at every forward voltage",
                value=f"{sink.needed_v(placed.part):g} V with {sink.dropout_v:g} V at the output of {driver.name}",
                limit=f"at most the supply's {supply_v:g} V",
                way_out="use a higher supply for the emitters, or another part",
            )
        most = placed.part.max_current_ma
        if most is not None and most.value > sink.asked_ma:
            yield note(
                placed.origin,
                f"all outputs of {driver.name} have one current, so {placed.part_id} has less than it bears",
                value=f"{sink.current_ma:.1f} mA of {most.value:g} mA",
                limit="emitters of equal max_current_ma for full light of each",
                way_out="choose emitters of one kind, or accept less light",
            )
    if sink.asked_ma > driver.max_output_ma.value:
        yield note(
            field,
            f"an output of {driver.name} limits the emitters' current",
            value=f"{sink.current_ma:.1f} mA of {sink.asked_ma:g} mA",
            limit=f"at most {driver.max_output_ma.value:g} mA",
            way_out="accept less light, or use transistors: remove board.emitters.driver",
        )
    lit_us = driver.turn_on_wait_us + circuit.lit_ms * US_PER_MS
    if lit_us > driver.least_period_us:
        yield warning(
            field,
            f"{driver.name} switches its outputs off for one step in {2**driver.grayscale_bits} at the end of each PWM "
            "period, which falls into the readings of a long state",
            value=f"{lit_us:.0f} us with an emitter on",
            limit=f"at most {driver.least_period_us:g} us, the shortest period",
            way_out="lower board.averages or board.settle_us, name a faster converter, or use transistors: "
            "remove board.emitters.driver",
        )


def _switch_findings(circuit: Circuit) -> Iterator[Finding]:
    board = circuit.board
    for placed in {one.part_id: one for one in circuit.cavity.emitters}.values():
        switch = emitter_switch(placed.part, board)
        supply_v = board.emitter_v
        if switch.series_ohm is None:
            yield warning(
                placed.origin,
                f"the supply cannot light {placed.part_id}",
                value=f"a forward voltage of {switch.forward_v.value:g} V",
                limit=f"less than the supply's {supply_v:g} V",
                weight=FAILS,
                way_out="use a higher supply for the emitters, or another part",
            )
        yield from _transistor_findings(circuit, placed)
        driver, most_ma = most_drive_ma(circuit)
        if switch.base_current_ma > most_ma:
            yield warning(
                placed.origin,
                f"{driver} gives too much current to switch {placed.part_id} by a bipolar transistor",
                value=f"{switch.base_current_ma:.1f} mA",
                limit=f"at most {most_ma:g} mA",
                weight=FAILS,
                way_out="use a logic-level MOSFET or a driver instead, or a part with less max_current_ma",
            )


def _reference_findings(use: BoardUse, board: Board) -> Iterator[Finding]:
    if use.reference == "internal" and board.internal_reference_v is None:
        yield error(
            "board.reference",
            f"{board.title} has no internal reference that the program can select",
            value="internal",
            limit="supply",
            way_out="leave it out, or name another board.kind",
        )


def _voltage_findings(use: BoardUse, board: Board) -> Iterator[Finding]:
    """Warning about a user's board whose entry gives no voltages: 5 V is assumed, which destroys a 3.3 V board."""
    if board.supply_v is None or board.logic_v is None:
        yield warning(
            "board.kind",
            "the board's entry does not give its voltages, so circuit and amplifiers are for 5 V",
            value=use.kind,
            limit="an entry with supply_v and logic_v",
            way_out="add both to the entry; 5 V on an input of a 3.3 V board destroys it",
        )


def _prescaler_findings(use: BoardUse, board: Board) -> Iterator[Finding]:
    prescaler = use.adc_prescaler
    assert board.adc_prescalers is not None
    if prescaler not in board.adc_prescalers:
        yield error(
            "board.adc_prescaler",
            f"{board.title} has no such divider of the converter's clock",
            value=prescaler,
            limit=f"one of {', '.join(map(str, board.adc_prescalers))}",
            way_out="choose one of them",
        )


def _baud_findings(use: BoardUse, board: Board) -> Iterator[Finding]:
    wanted = use.baud
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


def _boot_loader_findings(use: BoardUse, board: Board) -> Iterator[Finding]:
    """Warning about the serial rate that many boards with native USB take as the request for their boot loader."""
    if board.usb_bytes_per_s is not None and use.baud == BOOT_LOADER_BAUD:
        yield warning(
            "board.baud",
            "a port opened at this rate asks many boards with native USB to end the program and wait for an upload",
            value=use.baud,
            limit=f"any rate but {BOOT_LOADER_BAUD}",
            way_out="leave it out: native USB has no serial rate",
        )


def _answer_findings(circuit: Circuit, takes_ms: float) -> Iterator[Finding]:
    if takes_ms > LONGEST_FRAME_MS:
        yield warning(
            "board.averages" if circuit.use.averages > 1 else "board.settle_us",
            "the board obeys commands between frames, so the driver may give it up during one",
            value=f"{takes_ms / MS_PER_S:.1f} s a frame",
            limit=f"at most {LONGEST_FRAME_MS / MS_PER_S:g} s",
            way_out=f"lower {_slow_fields(circuit)}",
        )


def _slow_fields(circuit: Circuit) -> str:
    """Remedy for a frame that takes too long: the fields to lower or raise."""
    use, is_avr = circuit.use, circuit.board.divides_clock
    fields = ["board.averages"] if use.averages > 1 else []
    fields += ["board.adc_prescaler"] if is_avr else []
    faster = "raise board.baud" if is_avr else "name a faster board"
    if circuit.adc.separate is not None:
        faster = f"name a faster converter in {circuit.adc.separate.field}"
    fewer = ['set board.dark = "frame"'] if use.dark == "each" else []
    return f"{', '.join([*fields, 'board.settle_us', *fewer])}, or {faster}"


def _rate_findings(circuit: Circuit) -> Iterator[Finding]:
    use = circuit.use
    if circuit.board.divides_clock and use.adc_prescaler <= 0:
        return  # another finding covers it
    takes = circuit.frame_ms
    yield from _answer_findings(circuit, takes)
    budget = MS_PER_S / use.frame_rate_hz
    if takes > budget:
        yield error(
            "board.frame_rate_hz",
            f"a frame takes {takes:.2f} ms, which allows {MS_PER_S / takes:.1f} frames a second",
            value=f"{use.frame_rate_hz:g} Hz",
            limit=f"a frame within {budget:.2f} ms",
            way_out=f"lower it, {_slow_fields(circuit)}",
        )
