"""Which pin drives which emitter, which analogue input reads which receiver.

The one answer that wiring, driver config, firmware and rules share. A list in the design has exactly
one entry a part, in the order of E1, E2, ... and R1, R2, ...; without a list, pins and inputs are
dealt out in the board's recommended order.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from design.errors import DesignError
from design.fields.finding import Finding, error
from design.parts import catalog
from design.parts.catalog import Board
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from design.spec.properties import entries_of

Name = TypeVar("Name", int, str)


def board_of(design: SensorDesign) -> Board:
    """The catalogue entry of the design's board."""
    return catalog.find_board(entries_of(design), design.board.kind)


def assigned_pins(design: SensorDesign) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Emitter pins and receiver channels, in the order of the cavity's emitters and receivers.

    Raises
    ------
    DesignError : too few of them, too many, one twice, one that the board lacks or needs itself.
    """
    cavity, board = cavity_of(design), board_of(design)
    findings = pin_findings(design, board, len(cavity.emitters), len(cavity.receivers))
    if findings:
        raise DesignError("\n".join(str(finding) for finding in findings))
    pins = _dealt(design.board.emitter_pins, board.digital_pins, len(cavity.emitters))
    channels = _dealt(design.board.receiver_channels, board.analog_channels, len(cavity.receivers))
    return pins, channels


def pin_findings(
    design: SensorDesign, board: Board, emitter_count: int, receiver_count: int
) -> list[Finding]:
    """Everything wrong with the pins and channels of a design."""
    use = design.board
    return [
        *_list_findings(
            "board.emitter_pins", "emitter", "pin", use.emitter_pins, board.digital_pins, emitter_count
        ),
        *_unknown_pin_findings(use.emitter_pins or (), board),
        *_reserved_findings(use.emitter_pins, board),
        *_list_findings(
            "board.receiver_channels",
            "receiver",
            "analogue input",
            use.receiver_channels,
            board.analog_channels,
            receiver_count,
        ),
        *_unknown_findings(
            "board.receiver_channels", "analogue input", use.receiver_channels or (), board.analog_channels
        ),
    ]


def _dealt(given: tuple[Name, ...] | None, known: tuple[Name, ...], count: int) -> tuple[Name, ...]:
    return known[:count] if given is None else given


def _list_findings(
    field: str,
    part: str,
    noun: str,
    given: Sequence[Name] | None,
    known: Sequence[Name],
    count: int,
) -> list[Finding]:
    if given is None:
        return _room_findings(field, part, noun, len(known), count)
    found = []
    if len(given) != count:
        found.append(
            error(
                field,
                f"the layout has {count} {part}s, the list is for {len(given)}",
                value=f"{len(given)} entries",
                limit=f"exactly {count}",
                way_out=f"give one {noun} for each {part}, or leave the list out",
            )
        )
    for name in sorted({name for name in given if list(given).count(name) > 1}):
        found.append(
            error(
                field,
                f"{noun} {name} is given to {list(given).count(name)} {part}s",
                value=name,
                limit=f"each {noun} once",
                way_out=f"give every {part} its own {noun}",
            )
        )
    return found


def _room_findings(field: str, part: str, noun: str, available: int, count: int) -> list[Finding]:
    if count <= available:
        return []
    return [
        error(
            field,
            f"the layout has {count} {part}s, more than the board has {noun}s for",
            value=count,
            limit=f"at most {available}",
            way_out=f"place fewer {part}s, or name another board.kind",
        )
    ]


def _unknown_findings(field: str, noun: str, given: Sequence[Name], known: Sequence[Name]) -> list[Finding]:
    strange = [name for name in dict.fromkeys(given) if name not in known]
    return [
        error(
            field,
            f"{noun} {name} is not one that the board offers",
            value=name,
            limit=f"one of {', '.join(map(str, known))}",
            way_out="choose another, or leave the list out",
        )
        for name in strange
    ]


def _unknown_pin_findings(pins: Sequence[int], board: Board) -> list[Finding]:
    busy = {*board.reserved_pins, *board.uart_pins}  # these have their own finding
    return _unknown_findings(
        "board.emitter_pins", "pin", [pin for pin in pins if pin not in busy], board.digital_pins
    )


def _reserved_findings(pins: Sequence[int] | None, board: Board) -> list[Finding]:
    serial, reserved = set(board.uart_pins), set(board.reserved_pins)
    return [
        error(
            "board.emitter_pins",
            f"pin {pin} {'carries the serial line to the host' if pin in serial else 'has another job'}",
            value=pin,
            limit=f"none of {', '.join(map(str, sorted(serial | reserved)))}",
            way_out="choose another pin, or leave the list out",
        )
        for pin in dict.fromkeys(pins or ())
        if pin in serial | reserved
    ]
