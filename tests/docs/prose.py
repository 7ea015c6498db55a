"""The prose of a Markdown page: its text without code, and its sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator

FENCE = re.compile(r"^( *)(`{3,}|:{3,})[^\n]*\n.*?^\1\2\s*$", flags=re.MULTILINE | re.DOTALL)
FRONT = re.compile(r"\A---\n.*?\n---\n", flags=re.DOTALL)
COMMENT = re.compile(r"<!--.*?-->", flags=re.DOTALL)
CODE = re.compile(r"`[^`]+`")
INDENTED = re.compile(r"(?<=\n\n)(?: {4,}(?![-*] |\d+\. ).*\n)+")
IMAGE = re.compile(r"!\[([^\]]*)\]\([^)]*\)")
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
NEW_BLOCK = re.compile(r"^\s*(?:[-*] |\d+\. |#|\||>|\*\*[^*]+\*\*$)")
END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*]*(?:[A-Z0-9§]|code\b|optopad\b))")


def without_code(text: str) -> str:
    """The text of a page without front matter, code, comments and targets of links; line numbers stay."""
    for pattern in (FRONT, FENCE, COMMENT):
        text = pattern.sub(lambda found: "\n" * found.group().count("\n"), text)
    text = INDENTED.sub(lambda found: "\n" * found.group().count("\n"), text)
    text = CODE.sub("code", text)
    return LINK.sub(r"\1", IMAGE.sub(r"\1", text))


def sentences(text: str) -> Iterator[str]:
    """Sentences of paragraphs and list items; headings and tables have none."""
    for block in blocks(text):
        if block.lstrip().startswith(("|", "#")):
            continue
        for one in END.split(" ".join(block.split())):
            if len(one.split()) > 1:
                yield one


def blocks(text: str) -> Iterator[str]:
    """Paragraphs, list items, headings and rows of tables of a page without its code."""
    held: list[str] = []
    for line in [*without_code(text).splitlines(), ""]:
        if not line.strip() or NEW_BLOCK.match(line):
            if held:
                yield "\n".join(held)
            held = []
        if line.strip():
            held.append(line)


def words_in(sentence: str) -> int:
    """Words, a number with its unit as one."""
    joined = re.sub(r"(?<=\d) (?=(?:mm|µm|%|N|s|ms|Hz|MPa|counts|mV|V|GB|MB|°C?|nm)\b|%)", "", sentence)
    return len([one for one in joined.split() if re.search(r"\w", one)])
