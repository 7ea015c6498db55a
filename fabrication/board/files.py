"""Writes a board: KiCad project, Gerber and drill files with their archive, bill, placement file and notes.

Coordinates of the placement file are those of the Gerber files: from the board's lower left corner, seen from the top.
"""

from __future__ import annotations

import io
import zipfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from optopad.design.io import write_text_atomically
from optopad.fabrication.board.gerber import gerber_texts
from optopad.fabrication.board.kicad_pcb import pcb_text, project_text
from optopad.fabrication.board.kicad_sch import schematic_text
from optopad.fabrication.board.model import Board, Footprint
from optopad.fabrication.sheets.template import csv_text

NAME = "optopad"
"""Beginning of the files' names."""
BILL_COLUMNS = ("Comment", "Designator", "Footprint", "Manufacturer Part Number")
PLACEMENT_COLUMNS = ("Designator", "Mid X", "Mid Y", "Layer", "Rotation")
GERBERS = "gerbers"
ARCHIVE_TIME = (2000, 1, 1, 0, 0, 0)
"""Time of the files in the archive, the same for equal boards."""


def bill_csv(board: Board) -> str:
    """The parts to solder onto the board, one line for each value."""
    lines: dict[tuple[str, str, str, str], list[str]] = {}
    for one in _assembled(board):
        footprint = one.library.partition(":")[2] or one.package
        letters = one.reference.rstrip("0123456789")
        lines.setdefault((letters, one.value, footprint, one.part_number), []).append(one.reference)
    rows = [
        (value, ",".join(sorted(names, key=lambda name: (len(name), name))), footprint, number)
        for (_, value, footprint, number), names in lines.items()
    ]
    return csv_text(BILL_COLUMNS, rows)


def placement_csv(board: Board) -> str:
    """Position and rotation of each part to solder."""
    x0, y0, _, _ = board.box
    rows = (
        (one.reference, f"{one.x - x0:.4f}mm", f"{one.y - y0:.4f}mm", "Top", f"{one.angle_deg:g}")
        for one in _assembled(board)
    )
    return csv_text(PLACEMENT_COLUMNS, rows)


def _assembled(board: Board) -> list[Footprint]:
    return [one for one in board.footprints if one.is_placed]


def unrouted_words(board: Board) -> str:
    """A sentence that names the nets with connections without a track; empty if there are none."""
    if not board.unrouted:
        return ""
    counts = Counter(one.net for one in board.unrouted)
    names = ", ".join(net if count == 1 else f"{net} ({count} times)" for net, count in counts.items())
    count = len(board.unrouted)
    return (
        f"the board is not finished: {count} of its connections {'has' if count == 1 else 'have'} no track, of the "
        f"nets {names}; open optopad.kicad_pcb in KiCad and route them, or choose a design with fewer parts"
    )


def notes_text(board: Board) -> str:
    """What to know before the board is ordered."""
    x0, y0, x1, y1 = board.box
    kind = (
        "carries the mold, whose parts are wired to it"
        if board.kind == "carrier"
        else "carries the optical parts"
    )
    unrouted = unrouted_words(board)
    lines = [
        f"Board of {board.title}: it {kind}.",
        f"Size {x1 - x0:g} x {y1 - y0:g} mm, 2 layers, 1.6 mm; {len(board.footprints)} parts, {len(board.vias)} vias.",
        *(["WARNING: " + unrouted] if unrouted else []),
        *(f"- {note}" for note in board.notes),
    ]
    return "\n".join([*lines, ""])


def write_gaps(gaps: Sequence[str], folder: Path) -> None:
    """Write only the notes, with the reasons why there is no board, into a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text_atomically(folder / "notes.txt", f"WARNING: no board was made: {'; '.join(gaps)}\n")


def board_texts(board: Board) -> dict[str, str]:
    """Text of every file but the archive, by its path in the folder."""
    return {
        f"{NAME}.kicad_pro": project_text(board),
        f"{NAME}.kicad_sch": schematic_text(board),
        f"{NAME}.kicad_pcb": pcb_text(board),
        **{f"{GERBERS}/{NAME}-{name}": text for name, text in gerber_texts(board).items()},
        "bill.csv": bill_csv(board),
        "placement.csv": placement_csv(board),
        "notes.txt": notes_text(board),
    }


def write_board(board: Board, folder: Path) -> list[Path]:
    """Write all files of a board into a folder, which is created; return their paths.

    Raises
    ------
    OutputError : the folder cannot be written.
    """
    (folder / GERBERS).mkdir(parents=True, exist_ok=True)
    texts = board_texts(board)
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, text in texts.items():
            if name.startswith(GERBERS):
                packed.writestr(zipfile.ZipInfo(Path(name).name, ARCHIVE_TIME), text)
    (folder / f"{GERBERS}.zip").write_bytes(archive.getvalue())
    return [folder / name for name in (*texts, f"{GERBERS}.zip")]
