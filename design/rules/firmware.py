"""Can the generated firmware run on the board? Chip, converter, ports of the pins in use, memory.

A board without an entry for its chip is no error: mold, wiring and driver configuration do not need one.
Then the warning says that no firmware will be made. A layout whose frames do not fit the memory is an error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from design.circuit.timing import frame_bytes
from design.fields.finding import Finding, error, warning
from design.parts.board_firmware import BoardFirmware
from design.parts.catalog import Board
from design.spec import SensorDesign

FIRMWARE_ADC_BITS = 10
TICK_HZ = 8_000_000
"""The firmware's clock counts eighths of the processor's, a whole number a microsecond."""

HELLO_BYTES = 56
FRAME_BUFFERS = 2
"""One is filled while the other is sent."""

PROGRAM_RAM_BYTES = 512
"""Everything but the frames: variables (170 bytes measured), five bytes an emitter, the stack."""


def firmware_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> Iterator[Finding]:
    """Everything that keeps the firmware from running on the board."""
    chip = board.firmware
    if chip is None:
        yield warning(
            "board.kind",
            "no firmware is made for this board: its entry does not say which chip it has",
            value=design.board.kind,
            limit="an entry with a table `firmware`",
            way_out="add one in your catalogue, or name another board",
        )
        return
    yield from _converter_findings(board)
    yield from _pin_findings(design, board, chip, emitter_count, receiver_count)
    yield from _memory_findings(board, chip, emitter_count, receiver_count)


def _converter_findings(board: Board) -> Iterator[Finding]:
    if board.adc_bits != FIRMWARE_ADC_BITS or board.clock_hz % TICK_HZ:
        yield warning(
            "board.kind",
            "no firmware is made for this board: it is for AVR chips at 8 or 16 MHz with 10-bit converters",
            value=f"{board.adc_bits} bits at {board.clock_hz:g} Hz",
            limit=f"{FIRMWARE_ADC_BITS} bits, a multiple of {TICK_HZ:g} Hz",
            way_out="name another board, or program this one yourself to the protocol of docs/how-to/program-board.md",
        )


def _pin_findings(
    design: SensorDesign, board: Board, chip: BoardFirmware, emitter_count: int, receiver_count: int
) -> Iterator[Finding]:
    use = design.board
    pins = use.emitter_pins or board.digital_pins[:emitter_count]
    channels = use.receiver_channels or board.analog_channels[:receiver_count]
    unported = [pin for pin in pins if pin in board.digital_pins and pin >= len(chip.pin_ports)]
    unset = [name for name in channels if name in board.analog_channels and name not in chip.channel_mux]
    yield from _unknown("board.emitter_pins", "pin_ports", unported)
    yield from _unknown("board.receiver_channels", "channel_mux", unset)


def _unknown(field: str, table: str, names: Sequence[object]) -> Iterator[Finding]:
    if names:
        yield warning(
            field,
            f"no firmware is made: the board's entry does not say in {table} where they are",
            value=", ".join(map(str, names)),
            limit=f"names that {table} has",
            way_out=f"add them to firmware.{table} of the board's entry, or choose others",
        )


def _memory_findings(
    board: Board, chip: BoardFirmware, emitter_count: int, receiver_count: int
) -> Iterator[Finding]:
    frame = max(frame_bytes(emitter_count, receiver_count, board.adc_bits), HELLO_BYTES)
    needed = FRAME_BUFFERS * frame + PROGRAM_RAM_BYTES
    if needed > chip.ram_bytes:
        yield error(
            "board.kind",
            f"two frames of {frame} bytes and the program's variables do not fit the memory of the {chip.mcu}",
            value=f"{needed} bytes",
            limit=f"at most {chip.ram_bytes} bytes",
            way_out="place fewer parts, or name a board with more memory",
        )
