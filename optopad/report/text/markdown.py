"""The build sheet's Markdown as HTML: headings, paragraphs, lists, tables, fenced code, code in a line.

Only what `fabrication.sheets.casting` writes; text is escaped after the sheet's own escapes are taken back, so that
what a design says stays text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby

from optopad.report.text.markup import Html, bullets, element, joined, table

_ESCAPE = re.compile(r"\\([\\`*_{}\[\]<>#|~])")
_CELLS = re.compile(r"(?<!\\)\|")


def html_of(text: str, *, deepest_heading: int = 4) -> Html:
    """Blocks of a sheet, its title left out; second-level headings become third-level ones, and so on."""
    return joined(_blocks(text, deepest_heading))


def _blocks(text: str, deepest: int) -> Iterator[Html]:
    pieces = re.split(r"^```\w*\n(.*?)^```\n?", text, flags=re.DOTALL | re.MULTILINE)
    for number, piece in enumerate(pieces):
        if number % 2:
            yield element("pre", element("code", piece.rstrip("\n")), tabindex="0")
            continue
        for block in re.split(r"\n\s*\n", piece):
            if lines := [line for line in block.splitlines() if line.strip()]:
                yield from _block(lines, deepest)


def _block(lines: list[str], deepest: int) -> Iterator[Html]:
    for kind, group in groupby(_joined_lines(lines), key=_kind):
        rows = list(group)
        if kind == "heading":
            yield from (_heading(row, deepest) for row in rows)
        elif kind == "table":
            yield _table(rows)
        elif kind == "ordered":
            yield element("ol", *(element("li", _inline(row.split(". ", 1)[1])) for row in rows))
        elif kind == "bullets":
            yield bullets(_inline(row[2:]) for row in rows)
        else:
            yield from (element("p", _inline(row)) for row in rows)


def _joined_lines(lines: list[str]) -> list[str]:
    """Lines that go on joined to what they go on from; a sentence on a line of its own stays its own paragraph."""
    found: list[str] = []
    for line in lines:
        goes_on = line.startswith(" ") or (_kind(line) == "text" and found and _kind(found[-1]) == "text")
        if found and goes_on and not found[-1].endswith((".", ":")):
            found[-1] += " " + line.strip()
        else:
            found.append(line.strip())
    return found


def _kind(line: str) -> str:
    if line.startswith("#"):
        return "heading"
    if line.startswith("|"):
        return "table"
    if re.match(r"\d+\. ", line):
        return "ordered"
    return "bullets" if line.startswith("- ") else "text"


def _heading(line: str, deepest: int) -> Html:
    level = len(line) - len(line.lstrip("#"))
    if level == 1:
        return Html("")
    return element(f"h{min(level + 1, deepest)}", _inline(line[level:].strip()))


def _table(rows: list[str]) -> Html:
    cells = [[cell.strip() for cell in _CELLS.split(row)[1:-1]] for row in rows]
    heads, body = cells[0], cells[2:]
    numeric = [
        column
        for column in range(1, len(heads))
        if all(re.fullmatch(r"-?[\d.]+\*?", row[column]) for row in body)
    ]
    return table(
        [_plain(head) for head in heads],
        [[_inline(cell) for cell in row] for row in body],
        label=_plain(", ".join(heads)),
        numeric=numeric,
    )


def _inline(text: str) -> Html:
    """Code in a line, the rest as text."""
    pieces = re.split(r"(?<!\\)`([^`]*)`", text)
    return joined(
        element("code", piece) if number % 2 else _plain(piece) for number, piece in enumerate(pieces)
    )


def _plain(text: str) -> str:
    return _ESCAPE.sub(r"\1", text).replace("&lt;", "<")
