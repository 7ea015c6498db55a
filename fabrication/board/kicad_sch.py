"""The circuit of a board as a KiCad schematic (version 6 and later).

Each part is a box with its pins; a label at a pin names its net, so equal labels are connected. The drawing with wires
is schematic.svg.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from optopad.fabrication.board.kicad_pcb import quoted, stamp
from optopad.fabrication.board.model import Board, Footprint

GRID_MM = 2.54
PIN_MM = 2.54
ROOM_MM = 30.48
"""Room for labels between two columns of parts [mm]."""
TEXT = "(effects (font (size 1.27 1.27)){})"


def schematic_text(board: Board) -> str:
    """Text of the schematic's file."""
    parts = board.footprints
    places, size = _places(parts)
    root = stamp(board.name, "sheet")
    lines = [
        "(kicad_sch (version 20211123) (generator optopad)",
        f'  (uuid {root}) (paper "User" {size[0]:g} {size[1]:g})',
        f"  (title_block (title {quoted(board.title)}))",
        "  (lib_symbols",
    ]
    symbols = {_symbol(one): one for one in parts}
    for name, one in symbols.items():
        lines += _library(name, one)
    lines.append("  )")
    for one, place in zip(parts, places, strict=True):
        lines += _labels(one, place)
    for one, place in zip(parts, places, strict=True):
        lines += _instance(one, place)
    lines.append('  (sheet_instances (path "/" (page "1")))')
    lines.append("  (symbol_instances")
    for one in parts:
        path = f'(path "/{stamp("symbol", one.reference)}" (reference {quoted(one.reference)}) (unit 1)'
        lines.append(f"    {path} (value {quoted(one.value)}) (footprint {quoted(one.library)}))")
    return "\n".join([*lines, "  )", ")", ""])


def _symbol(one: Footprint) -> str:
    """Name of a part's symbol: parts with the same pads share one."""
    numbers = "-".join(pad.number for pad in one.pads) if len(one.pads) <= 4 else str(len(one.pads))
    letters = one.reference.rstrip("0123456789")
    return f"optopad:{letters}-{numbers}"


def _pins(one: Footprint) -> list[tuple[str, float, float, int]]:
    """Number, x and y (upward) of the outer end, and direction of each pin: one half on the left, one on the right."""
    numbers = list(dict.fromkeys(pad.number for pad in one.pads if pad.number))
    half = (len(numbers) + 1) // 2
    out = _half_width(one) + PIN_MM
    left = [(number, -out, -k * GRID_MM, 0) for k, number in enumerate(numbers[:half])]
    return left + [(number, out, -k * GRID_MM, 180) for k, number in enumerate(numbers[half:])]


def _half_width(one: Footprint) -> float:
    return 5.08 if len(one.pads) <= 4 else 7.62


def _rows(one: Footprint) -> int:
    return (len(one.pads) + 1) // 2


def _places(parts: Sequence[Footprint]) -> tuple[list[tuple[float, float]], tuple[float, float]]:
    """Position of each part's first pin row on the sheet, in columns, and the size of the sheet [mm]."""
    high = 10 * GRID_MM + max(sum(_rows(one) + 4 for one in parts) * GRID_MM / 8, 60 * GRID_MM)
    high = round(high / GRID_MM) * GRID_MM
    x, y, places = 20 * GRID_MM, 8 * GRID_MM, []
    for one in parts:
        if y + _rows(one) * GRID_MM > high:
            x, y = x + 2 * (ROOM_MM + 7.62), 8 * GRID_MM
        places.append((x, y))
        y += (_rows(one) + 4) * GRID_MM
    return places, (x + 20 * GRID_MM, high + 20 * GRID_MM)


def _library(name: str, one: Footprint) -> Iterator[str]:
    letters = one.reference.rstrip("0123456789")
    yield f"    (symbol {quoted(name)} (in_bom yes) (on_board yes)"
    for k, (key, value) in enumerate(
        (("Reference", letters), ("Value", ""), ("Footprint", ""), ("Datasheet", ""))
    ):
        hidden = " hide" if k > 1 else ""
        yield f"      (property {quoted(key)} {quoted(value)} (id {k}) (at 0 0 0) {TEXT.format(hidden)})"
    short, wide = name.partition(":")[2], _half_width(one)
    low = -_rows(one) * GRID_MM
    box = (
        f"(start {-wide:g} 2.54) (end {wide:g} {low:g}) (stroke (width 0.254) (type default) (color 0 0 0 0))"
    )
    yield f"      (symbol {quoted(short + '_0_1')} (rectangle {box} (fill (type background))))"
    yield f"      (symbol {quoted(short + '_1_1')}"
    for number, x, y, angle in _pins(one):
        names = f"(name {quoted(number)} {TEXT.format('')}) (number {quoted(number)} {TEXT.format('')})"
        yield f"        (pin passive line (at {x:g} {y:g} {angle}) (length {PIN_MM:g}) {names})"
    yield "      )"
    yield "    )"


def _labels(one: Footprint, place: tuple[float, float]) -> Iterator[str]:
    nets = {pad.number: pad.net for pad in one.pads}
    for number, x, y, angle in _pins(one):
        at = f"{place[0] + x:g} {place[1] - y:g}"
        if not nets[number]:
            yield f"  (no_connect (at {at}) (uuid {stamp('open', one.reference, number)}))"
            continue
        to, side = (180, "right") if angle == 0 else (0, "left")
        name = f"(global_label {quoted(nets[number])} (shape passive) (at {at} {to}) (fields_autoplaced)"
        look = TEXT.format(f" (justify {side})")
        yield f"  {name} {look} (uuid {stamp('label', one.reference, number)}))"


def _instance(one: Footprint, place: tuple[float, float]) -> Iterator[str]:
    x, y = place
    yield f"  (symbol (lib_id {quoted(_symbol(one))}) (at {x:g} {y:g} 0) (unit 1) (in_bom yes) (on_board yes)"
    yield f"    (uuid {stamp('symbol', one.reference)})"
    below = y + (_rows(one) + 0.6) * GRID_MM
    for k, (key, value, at, hidden) in enumerate(
        (
            ("Reference", one.reference, y - 1.5 * GRID_MM, ""),
            ("Value", one.value, below, ""),
            ("Footprint", one.library, y, " hide"),
            ("Datasheet", "", y, " hide"),
        )
    ):
        yield f"    (property {quoted(key)} {quoted(value)} (id {k}) (at {x:g} {at:g} 0) {TEXT.format(hidden)})"
    for number in dict.fromkeys(pad.number for pad in one.pads if pad.number):
        yield f"    (pin {quoted(number)} (uuid {stamp('pin', one.reference, number)}))"
    yield "  )"
