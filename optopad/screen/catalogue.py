"""Entries of the catalogue on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import shorten

from optopad.design.part_entry import PartEntry
from optopad.design.parts.listing import Listed
from optopad.screen.answer import row

SOURCE = 60
"""Longest source in the overview of the whole catalogue [characters]."""


def overview(found: Sequence[Listed], *, is_whole: bool) -> list[str]:
    """Two lines for each entry; the whole catalogue has its sources shortened."""
    lines: list[str] = []
    for number, one in enumerate(found):
        if number == 0 or found[number - 1].kind != one.kind:
            lines += [*([""] if lines else []), one.kind]
        counted = ", ".join(f"{count} {level}" for level, count in one.confidences.items())
        source = shorten(one.source, SOURCE, placeholder=" ...") if is_whole else one.source
        lines += [f"  {one.name:<24}{one.figures}", f"  {'':<24}{source} ({counted})"]
    return lines


def new_part_lines(entry: PartEntry, file: Path) -> list[str]:
    """A part of the user's own: what was derived, its file, and how a design names it."""
    section = f"{entry.part.kind}s"
    lines = row("part", f"{entry.part_id}: {entry.part.title}, {entry.part.kind} ({entry.part.mounting})", 2)
    for title, remark in entry.remarks.items():
        lines += row(title.lower(), remark, 6)
    lines += row("file", f"{file}")
    lines += row(
        "next",
        f"put {file.name} into the folder of the design and name it there, before the first table: catalog_files = "
        f'["{file.name}"] (or its path from that folder); under [{section}]: part = "{entry.part_id}"',
        3,
    )
    return lines
